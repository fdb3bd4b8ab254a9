// Maps of stores of patches: detail that is on no sample, on every level; the same bytes whoever builds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/primitives/patch_map.h"
#include "lod/verify/patches.h"
#include "tests/support/crafted_store.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/triangle_field.h"

namespace stipple::lod {
namespace {

constexpr double kTexelsAUnit = 64, kWave = 0.25;

double red(const glm::dvec3& p) { return 0.5 + 0.4 * std::sin(2 * 3.14159265358979 * (p.x + 0.5 * p.y) / kWave); }

/// A sheet of a few triangles, 4 x 4 units; texture coordinates are places.
TriangleMesh sheetOf(double bend) {
    TriangleMesh mesh =
        test::sheet(6, 6, [&](double u, double v) { return glm::dvec3(4 * u, 4 * v, bend * u * (1 - u) * v); });
    mesh.uv.clear();
    for (const glm::dvec3& p : mesh.position) mesh.uv.emplace_back(p.x, p.y);
    mesh.surface.assign(mesh.position.size(), 0);
    mesh.colour.assign(mesh.position.size(), 0xffffffffu);
    mesh.normal.clear();
    return mesh;
}

PatchBuildSettings withMaps(uint32_t texels) {
    PatchBuildSettings settings;
    settings.leafTriangles = 4'000;  // of what two large triangles of the sheet are divided into, some 16,000
    settings.description.materials.resize(1);
    settings.maps.texels = texels;
    settings.maps.detail.texels = [](uint32_t) { return static_cast<float>(kTexelsAUnit); };
    settings.looks = [](uint32_t, const glm::vec2& uv, float) {
        return PlaceLook{{static_cast<float>(red({uv.x, uv.y, 0})), 0.2f, 0.2f}};
    };
    return settings;
}

struct Built {
    Store store;
    std::string bytes;
};
Built build(const TriangleMesh& mesh, const PatchBuildSettings& settings, int threads = 2) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(threads);
    Progress silent(false);
    Built out;
    const auto report = buildPatchStore(sourceOf(mesh), folder / "a.stipple", settings, *executor, silent);
    EXPECT_TRUE(report) << (report ? "" : report.error().line());
    if (!report) return out;
    auto store = openStore(folder / "a.stipple");
    EXPECT_TRUE(store);
    out.store = std::move(*store);
    out.bytes = test::slurp(folder / "a.stipple");
    return out;
}

template <typename Use>
void forEachPatch(const Store& store, uint32_t level, const Use& use) {
    const Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (h.nodes[n].level != level || h.nodes[n].kind != Kind::patches) continue;
        const auto patches = readPatches(store, n);
        ASSERT_TRUE(patches);
        const Node& node = h.nodes[n];
        const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
        for (const Patch& p : *patches) use(p, corner);
    }
}

/// Of the wave's height, what is off in the middles of cells of a level: of the texel there, or of the mean of the four
/// samples. 1: nothing is left of the wave; root of the mean square.
double detailLost(const Store& store, uint32_t level) {
    double squares = 0, count = 0;
    const Hierarchy& h = store.hierarchy;
    forEachPatch(store, level, [&](const Patch& p, const glm::dvec3& corner) {
        const PatchSurface surface(p);
        const uint32_t k = 1u << p.map.density, width = (p.width - 1) * k + 1;
        const auto linear = [](uint32_t c) {
            return double{shared::linearFromSrgb(static_cast<float>(c & 255u) / 255)};
        };
        for (uint32_t j = 0; j + 1 < p.height; ++j)
            for (uint32_t i = 0; i + 1 < p.width; ++i) {
                if (!p.hasCell(i, j)) continue;
                glm::dvec3 at(0);
                double is = 0;
                for (const size_t s : {p.at(i, j), p.at(i + 1, j), p.at(i, j + 1), p.at(i + 1, j + 1)}) {
                    at += 0.25 * (h.origin + h.unit * (corner + surface.position(s)));
                    is += 0.25 * linear(p.colours[s]);
                }
                if (std::min({at.x, at.y, 4 - at.x, 4 - at.y}) < 0.1) continue;  // beyond the border: what is near
                if (k > 1) is = linear(p.map.colours[size_t{j * k + k / 2} * width + i * k + k / 2]);
                squares += (is - red(at)) * (is - red(at));
                ++count;
            }
    });
    EXPECT_GT(count, 100) << level;
    return std::sqrt(squares / count) / (0.4 * std::sqrt(0.5));
}

uint32_t deepestOf(const Store& store) {
    uint32_t deepest = 0;
    for (const Node& n : store.hierarchy.nodes) deepest = std::max<uint32_t>(deepest, n.level);
    return deepest;
}

// Samples of a coarse level are as far apart as the waves are long: its texels know them.
TEST(PatchMapStores, EveryLevelKeepsDetailThatNoSampleHas) {
    const Built maps = build(sheetOf(0.3), withMaps(0)), none = build(sheetOf(0.3), withMaps(1));
    const uint32_t deepest = deepestOf(maps.store);
    ASSERT_GE(deepest, 1u);
    for (uint32_t level = 0; level <= deepest; ++level)
        EXPECT_LT(detailLost(maps.store, level), 0.35) << "level " << level << " of " << deepest;
    EXPECT_GT(detailLost(none.store, 0), 0.7) << "the control: a colour a sample";
    const auto executor = makeTbbExecutor(2);
    const auto verified = verifyStore(maps.store, *executor, 0);
    EXPECT_TRUE(verified) << (verified ? "" : verified.error().line());
}

/// Left of 1.5 it sends light, right of 2.5 it is lit by none.
PatchBuildSettings shining(bool isTextured, bool hasLight) {
    PatchBuildSettings settings = withMaps(isTextured ? 0 : 1);
    settings.description.pointMaterials = {{}};
    settings.maps.detail.hasLight = hasLight;
    settings.looks = [hasLight](uint32_t, const glm::vec2& uv, float) {
        PlaceLook look{{0.2f, 0.2f, 0.2f}};
        if (hasLight && uv.x < 1.5f) look.emission = {2, 0.5f, 0};
        look.isUnlit = hasLight && uv.x > 2.5f;
        return look;
    };
    return settings;
}

// What shines on the leaves shines on every level; stores without that have not a byte more, nor another version.
TEST(PatchMapStores, EveryLevelKeepsWhatShines) {
    for (const bool isTextured : {true, false}) {
        const Built built = build(sheetOf(0.3), shining(isTextured, true));
        EXPECT_EQ(built.bytes.at(8), kLightVersion);
        const uint32_t deepest = deepestOf(built.store);
        ASSERT_GE(deepest, 1u);
        const Hierarchy& h = built.store.hierarchy;
        for (uint32_t level = 0; level <= deepest; ++level) {
            size_t texels = 0, wrong = 0;
            forEachPatch(built.store, level, [&](const Patch& p, const glm::dvec3& corner) {
                const PatchSurface surface(p);
                for (uint32_t j = 0; j < p.height; ++j)
                    for (uint32_t i = 0; i < p.width; ++i) {
                        if (p.heights[p.at(i, j)] == 0) continue;
                        const glm::dvec3 at = h.origin + h.unit * (corner + surface.position(p.at(i, j)));
                        if (std::min({std::abs(at.x - 1.5), std::abs(at.x - 2.5), at.x, at.y, 4 - at.x, 4 - at.y}) <
                            0.3)
                            continue;
                        ++texels;
                        const uint32_t k = 1u << p.map.density, width = (p.width - 1) * k + 1;
                        const uint32_t light = p.map.light.empty() ? 0 : p.map.light[size_t{j * k} * width + i * k];
                        const glm::vec3 expected = at.x < 1.5 ? glm::vec3(2, 0.5f, 0) : glm::vec3(0);
                        const bool isRight =
                            glm::length(emissionOf(light) - expected) < 0.05f && keepsColour(light) == (at.x > 2.5);
                        wrong += isRight ? 0 : 1;
                    }
            });
            EXPECT_GT(texels, 100u);
            EXPECT_EQ(wrong, 0u) << "level " << level << " of " << deepest << ", " << isTextured;
        }
        const auto executor = makeTbbExecutor(2);
        const auto verified = verifyStore(built.store, *executor, 0);
        EXPECT_TRUE(verified) << (verified ? "" : verified.error().line());
        const Built dark = build(sheetOf(0.3), shining(isTextured, false));
        EXPECT_EQ(dark.bytes.at(8), kStoreVersion);
        PatchBuildSettings told = shining(isTextured, false);
        told.maps.detail.hasLight = true;  // some material nobody has
        EXPECT_TRUE(build(sheetOf(0.3), told).bytes == dark.bytes);
    }
}

// Light came with version 11: a file of before that claims it is damaged, read at once or page by page.
TEST(PatchMapStores, LightInAnOlderVersionIsRefused) {
    const test::TempFolder folder;
    const auto write = [&](const std::string& name, const std::string& bytes) {
        test::spit(folder / name, bytes);
        return folder / name;
    };
    const Built lit = build(sheetOf(0.3), shining(false, true)), dark = build(sheetOf(0.3), shining(false, false));
    ASSERT_GT(lit.store.hierarchy.nodes.size(), 2u);
    Store store = lit.store;
    store.path = write("lit.stipple", lit.bytes);
    const std::string paged = test::slurp(test::withPages(store, folder / "paged.stipple", 0));
    for (const Tables tables : {Tables::whole, Tables::asNeeded})
        for (const std::string& bytes : {lit.bytes, paged}) {
            ASSERT_TRUE(openStore(write("11.stipple", test::ofVersion(bytes, kLightVersion)), tables));
            const std::string path = write("10.stipple", test::ofVersion(bytes, kStoreVersion));
            const auto older = openStore(path, tables);
            ASSERT_FALSE(older);
            EXPECT_EQ(older.error().line(), path +
                                                ": node 0 claims light of its patches' own, which files before version "
                                                "11 do not have (the store is damaged or not whole; build it again)");
        }
    EXPECT_TRUE(openStore(write("d10.stipple", test::ofVersion(dark.bytes, kStoreVersion))));
    EXPECT_TRUE(openStore(write("d11.stipple", test::ofVersion(dark.bytes, kLightVersion)))) << "it may, it need not";
}

TEST(PatchMapStores, AreTheSameForAnyOrderAndThreads) {
    const Built built = build(sheetOf(0.3), withMaps(0));
    ASSERT_FALSE(built.bytes.empty());
    EXPECT_TRUE(build(sheetOf(0.3), withMaps(0), 1).bytes == built.bytes);
    EXPECT_TRUE(build(test::shuffled(sheetOf(0.3), 5), withMaps(0), 3).bytes == built.bytes);
    EXPECT_FALSE(build(sheetOf(0.3), withMaps(4)).bytes == built.bytes);
}

TEST(PatchMapStores, HaveAsManyTexelsAsAreAskedFor) {
    for (const uint32_t texels : {2u, 4u, 8u}) {
        const Built built = build(sheetOf(0.3), withMaps(texels));
        const uint32_t deepest = deepestOf(built.store);
        for (uint32_t level = 0; level <= deepest; ++level)
            forEachPatch(built.store, level, [&](const Patch& p, const glm::dvec3&) {
                EXPECT_EQ(1u << p.map.density, level == deepest ? texels : std::min(texels, 4u)) << level;
                EXPECT_TRUE(p.map.normals.empty() && !p.map.hasMaterials) << "textures say nothing of them";
            });
    }
}

// A smooth surface has little error of its shape; a coarse level of it still shows texels that are larger than those
// of the source.
TEST(PatchMapStores, ErrorsOfLevelsAreTexelsAtLeast) {
    TriangleMesh torus = test::torusMesh(160, 60);
    torus.uv.clear();
    for (const glm::dvec3& p : torus.position) torus.uv.emplace_back(4 * p.x, 4 * p.y);
    torus.surface.assign(torus.position.size(), 0);
    torus.colour.assign(torus.position.size(), 0xffffffffu);
    const Built maps = build(torus, withMaps(2)), none = build(torus, withMaps(1));
    const auto errorOfRoot = [](const Store& s) {
        return s.hierarchy.unit * s.hierarchy.errors.decode(s.hierarchy.nodes[0].errorCode);
    };
    double texel = 0;
    forEachPatch(maps.store, 0, [&](const Patch& p, const glm::dvec3&) {
        texel = std::max(texel, maps.store.hierarchy.unit * double{p.step} / (1u << p.map.density));
    });
    ASSERT_GT(texel, 1.5 / kTexelsAUnit) << "else there is nothing to say";
    EXPECT_GE(errorOfRoot(maps.store), texel);
    EXPECT_LT(errorOfRoot(none.store), texel) << "the control: of the shape alone";
}

}  // namespace
}  // namespace stipple::lod
