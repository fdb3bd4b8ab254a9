// Patches that send light by themselves, and those that are shown as they are: as the oracle has them, and as the mesh
// looks that they are made of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "engine/scene/place_looks.h"
#include "engine/scene/triangles.h"
#include "lod/primitives/patch_map.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/materials.h"
#include "tests/support/against_oracle.h"
#include "tests/support/glass.h"
#include "tests/support/meshes.h"
#include "tests/support/patch_scene.h"

namespace stipple {
namespace {

using test::PatchScene;

/// A bent patch with holes; its map says which squares send how much light, and which are not lit. Of density 0 the
/// light is all that the map says.
lod::Patch shining(uint32_t density, bool hasLight = true) {
    lod::Patch p = test::patchOfHeights(
        37, 33, [](double x, double y) { return 0.3 * x * x - 0.2 * y * y; }, 0.03);
    std::fill(p.colours.begin(), p.colours.end(), 0x305070u);
    if (density > 0)
        test::giveMap(p, density, [](double i, double j) {
            return 0x10101u * static_cast<uint32_t>(std::lround(90 + 60 * std::sin(2 * i) * std::cos(j)));
        });
    if (!hasLight) return p;
    const lod::MapLevel level = lod::mapOf(p);
    const double k = 1u << density;
    p.map.light.assign(level.isKnown.size(), 0);
    for (uint32_t y = 0; y < level.height; ++y)
        for (uint32_t x = 0; x < level.width; ++x) {
            const double i = x / k, j = y / k;
            const auto square = (static_cast<uint32_t>(i / 6) + static_cast<uint32_t>(j / 6)) % 3;
            const double light = 0.5 + 0.5 * std::sin(3 * i) * std::sin(2 * j);
            const glm::vec3 emission = square == 1 ? glm::vec3(light * glm::dvec3(3, 0.4, 0.05)) : glm::vec3(0);
            if (level.isKnown[level.at(x, y)] != 0) p.map.light[level.at(x, y)] = lod::packLight(emission, square == 2);
        }
    return p;
}

class PatchLight : public test::AgainstOracle {
  protected:
    static render::DrawSettings settings(uint32_t as = shared::kPatchStrips) {
        render::DrawSettings s;
        s.patchAs = as;
        s.lit = true;
        s.worldUp = {0, 1, 0};
        return s;
    }
};

TEST_F(PatchLight, IsThatOfTheOracle) {
    for (const uint32_t density : {0u, 1u, 3u}) {
        PatchScene scene({shining(density)}), dark({shining(density, false)});
        scene.setMaterials({{0.6f, 0}});
        dark.setMaterials({{0.6f, 0}});
        for (const auto& [eye, isOrthographic] : {std::pair{glm::dvec3(0.5, 1.4, 2.4), false},
                                                  {glm::dvec3(0.1, 0.2, 0.7), false},  // magnified
                                                  {glm::dvec3(2.0, 5.4, 9.4), false},  // minified
                                                  {glm::dvec3(0.5, 1.4, 2.4), true}})
            for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats}) {
                const lod::View view = test::glassView(eye, 200, isOrthographic);
                const render::Image expected = scene.draw(*oracle_, view, render::Mode::splat, settings(as));
                for (const auto& [name, backend] : backends_) {
                    const auto draw = [&](PatchScene& of) {
                        return of.draw(*backend, view, render::Mode::splat, settings(as));
                    };
                    EXPECT_GE(likeness(draw(scene), expected), 50) << name << as << ", " << density << " " << eye.z;
                    EXPECT_LT(likeness(draw(dark), expected), 30) << "the control: without light of its own";
                }
            }
    }
}

// A material for all of the picture is instead of all that stores say; without one patches are lit as points are.
TEST_F(PatchLight, GoesWithTheMaterialsOfTheStore) {
    const lod::View view = test::glassView({0.5, 1.4, 2.4}, 160);
    for (const auto& [name, backend] : backends_)
        for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats, shared::kPatchDirect}) {
            PatchScene scene({shining(1)}), dark({shining(1, false)});
            const auto draw = [&](PatchScene& of, const render::DrawSettings& how) {
                return of.draw(*backend, view, render::Mode::splat, how).rgba;
            };
            EXPECT_EQ(draw(scene, settings(as)), draw(dark, settings(as))) << name << as;
            scene.setMaterials({{0.6f, 0}});
            dark.setMaterials({{0.6f, 0}});
            EXPECT_NE(draw(scene, settings(as)), draw(dark, settings(as))) << name << as;
            render::DrawSettings asked = settings(as);
            asked.pointMaterial = lod::packed({0.2f, 1});
            EXPECT_EQ(draw(scene, asked), draw(dark, asked)) << name << as;
            asked = settings(as);
            asked.unlitTriangles = true;
            EXPECT_EQ(draw(scene, asked), draw(dark, asked)) << name << as << ": colours alone";
        }
}

// Points have no light of their own: it is in their colour.
TEST_F(PatchLight, OfSamplesIsInTheirColour) {
    for (const uint32_t density : {0u, 2u}) {
        lod::Patch p = test::patchOfHeights(17, 9, [](double, double) { return 0; });
        std::fill(p.colours.begin(), p.colours.end(), 0x808080u);
        if (density > 0) test::giveMap(p, density, [](double, double) { return 0x808080u; });
        p.map.light.assign(lod::mapOf(p).isKnown.size(), lod::packLight({0.25f, 0, 0}, false));
        const PatchScene scene({p});
        lod::Chunk chunk = scene.chunk();
        lod::samplesAsPoints(scene.hierarchy(), 0, chunk);
        const auto points = lod::withoutEmpty(chunk.records);
        ASSERT_EQ(points.size(), size_t{17} * 9);
        for (const shared::PointRecord& r : points) {
            const float red = shared::linearFromSrgb(128.0f / 255) + 0.25f;
            EXPECT_NEAR(r.colour & 255u, 255 * shared::srgbFromLinear(red), 1);
            EXPECT_EQ(r.colour >> 8 & 0xffffu, 0x8080u);
        }
    }
}

/// A bent sheet, 2 x 2 units, in two halves of a material each, which textures of 256 x 256 lie on.
scene::Scene sheetOf(const scene::Material& left, const scene::Material& right) {
    constexpr uint32_t kCells = 24;
    scene::Scene scene;
    scene.meshes.resize(1);
    for (int half = 0; half < 2; ++half) {
        scene::Primitive mesh;
        mesh.uv.resize(1);
        for (uint32_t j = 0; j <= kCells; ++j)
            for (uint32_t i = 0; i <= kCells / 2; ++i) {
                const double u = 0.5 * half + static_cast<double>(i) / kCells, v = static_cast<double>(j) / kCells;
                const double x = 2 * u - 1, y = 2 * v - 1;
                mesh.position.emplace_back(x, y, 0.2 * x * x - 0.1 * y * y);
                mesh.normal.emplace_back(glm::normalize(glm::dvec3(-0.4 * x, 0.2 * y, 1)));
                mesh.uv[0].emplace_back(u, 1 - v);
                if (i == 0 || j == 0) continue;
                const auto d = static_cast<uint32_t>(mesh.position.size() - 1), b = d - (kCells / 2 + 1);
                for (const uint32_t k : {b - 1, b, d, b - 1, d, d - 1}) mesh.indices.push_back(k);
            }
        mesh.material = half;
        scene.meshes[0].primitives.push_back(std::move(mesh));
    }
    scene.materials = {left, right};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    scene.textures.resize(2);
    scene.textures[0].image = 0;
    scene.textures[1].image = 1;
    scene.images.resize(2);
    return scene;
}
/// What lies on it: stripes that are soft at their edges, and discs that glow.
std::vector<scene::DecodedImage> pictures() {
    std::vector<scene::DecodedImage> out(2);
    const auto byte = [](double v) { return static_cast<uint32_t>(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
    for (scene::DecodedImage& image : out) image.width = image.height = 256;
    for (int y = 0; y < 256; ++y)
        for (int x = 0; x < 256; ++x) {
            const double stripe = 0.5 + 0.4 * std::sin(0.1 * x + 0.05 * y);
            out[0].rgba.push_back(byte(stripe) | byte(0.5 * stripe) << 8 | byte(0.8 - 0.5 * stripe) << 16 |
                                  0xff000000u);
            const double far = std::hypot(x % 64 - 32, y % 64 - 32), glow = std::clamp((26 - far) / 8, 0.0, 1.0);
            out[1].rgba.push_back(byte(glow) | byte(0.7 * glow) << 8 | byte(0.2 * glow) << 16 | 0xff000000u);
        }
    return out;
}

struct Both {
    std::shared_ptr<const lod::Store> mesh, patches;
};
Both storesOf(const scene::Scene& scene, const std::string& path, Executor& executor, bool keepsLight = true) {
    const std::vector<scene::DecodedImage> images = pictures();
    const auto placed = scene::placements(scene);
    Progress silent(false);
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(scene);
    build.textures = scene::textureImages(scene);
    for (size_t k = 0; k < build.textures.size(); ++k) {
        build.textures[k].width = images[k].width;
        build.textures[k].height = images[k].height;
        build.textures[k].rgba = images[k].rgba;
    }
    EXPECT_TRUE(lod::buildMeshStore(scene::triangleSource(scene, placed), path + ".mesh", build, executor, silent));
    lod::PatchBuildSettings settings;
    settings.leafTriangles = 600;
    settings.looks = scene::placeLooks(scene, images);
    settings.maps.detail = scene::textureDetail(scene, images);
    EXPECT_TRUE(settings.maps.detail.hasLight);
    settings.maps.detail.hasLight = keepsLight;
    settings.description.pointMaterials = scene::materialList(scene).list;
    EXPECT_TRUE(
        lod::buildPatchStore(scene::triangleSource(scene, placed), path + ".patches", settings, executor, silent));
    return {std::make_shared<const lod::Store>(*lod::openStore(path + ".mesh")),
            std::make_shared<const lod::Store>(*lod::openStore(path + ".patches"))};
}

scene::Material matte() {
    scene::Material m;
    m.metallic = 0;
    m.roughness = 0.8f;
    return m;
}

/// Over the pixels that show both, away from the sheet's border and from where its halves meet.
double likenessInside(const render::Image& mesh, const render::Image& patches, const lod::View& view) {
    double squares = 0, count = 0;
    for (size_t i = 0; i < mesh.rgba.size(); ++i) {
        if (!(mesh.depth[i] > 0 && patches.depth[i] > 0)) continue;
        const glm::dvec2 pixel(static_cast<double>(i % view.width) + 0.5, static_cast<double>(i / view.width) + 0.5);
        const glm::dvec2 off = (pixel - 0.5 * glm::dvec2(view.width, view.height)) / view.focalPixels;
        const glm::dvec3 p = view.eye + double{mesh.depth[i]} * (view.forward + off.x * view.right + off.y * view.down);
        if (std::abs(p.x) < 0.1 || std::abs(p.x) > 0.9 || std::abs(p.y) > 0.9) continue;
        for (int shift = 0; shift < 24; shift += 8) {
            const double d = static_cast<double>(mesh.rgba[i] >> shift & 255u) - (patches.rgba[i] >> shift & 255u);
            squares += d * d;
            ++count;
        }
    }
    EXPECT_GT(count, 1000);
    return 10 * std::log10(255 * 255 / std::max(squares / count, 1e-9));
}

// Near by, and from so far that inner nodes are drawn; textures, and factors alone; light brighter than white.
TEST_F(PatchLight, OfBuiltPatchesIsThatOfTheirMesh) {
    backends_["fp64"] = reference::makeReferenceBackend(*executor_);
    for (const bool isTextured : {true, false})
        for (const float strength : {1.0f, 6.0f}) {
            scene::Material left = matte(), right = matte();
            left.baseColour = {0.3f, 0.2f, 0.4f, 1};
            left.emissive = strength * glm::vec3(0.5f, 0.4f, 0.1f);
            right.isUnlit = true;
            right.baseColour = {0.2f, 0.7f, 0.4f, 1};
            if (isTextured) {
                left.baseColourTexture.texture = right.baseColourTexture.texture = 0;
                left.emissiveTexture.texture = 1;
            }
            const scene::Scene scene = sheetOf(left, right);
            const Both stores = storesOf(scene, folder_ / "a", *executor_),
                       baked = storesOf(scene, folder_ / "b", *executor_, false);
            for (const auto& [away, error] : {std::pair{2.6, 0.25}, {9.0, 1.0}})
                for (const auto& [name, backend] : backends_) {
                    const lod::View view = test::glassView({0.3, 0.5, away}, 256);
                    const auto seen = [&](const std::shared_ptr<const lod::Store>& store) {
                        render::FrameSettings s = test::glassSettings(render::Mode::surface);
                        s.budgets.errorPixels = error;
                        return test::draw({{store, {}, {}}}, *backend, *executor_, view, s);
                    };
                    const render::Image mesh = seen(stores.mesh);
                    EXPECT_GE(likenessInside(mesh, seen(stores.patches), view), 36)
                        << name << ", " << isTextured << ", strength " << strength << ", from " << away;
                    EXPECT_LT(likenessInside(mesh, seen(baked.patches), view), 26)
                        << "the control: light in colours, and lit";
                }
        }
}

// What is not lit has its colours to the bit, whatever shines; the control is lit.
TEST_F(PatchLight, WhatIsNotLitKeepsItsColours) {
    backends_["fp64"] = reference::makeReferenceBackend(*executor_);
    scene::Material unlit = matte();
    constexpr uint32_t kColour = 0xebbc7e;
    for (int a = 0; a < 3; ++a)
        unlit.baseColour[a] = shared::linearFromSrgb(static_cast<float>(kColour >> (8 * a) & 255u) / 255);
    for (const bool isUnlit : {true, false}) {
        unlit.isUnlit = isUnlit;
        unlit.emissive = isUnlit ? glm::vec3(0) : glm::vec3(1e-3f);
        const Both stores = storesOf(sheetOf(unlit, unlit), folder_ / "a", *executor_);
        const lod::View view = test::glassView({0.3, 0.5, 2.6}, 128);
        for (const auto& [name, backend] : backends_) {
            render::FrameSettings s = test::glassSettings(render::Mode::surface);
            std::vector<render::Image> images;
            for (const auto& store : {stores.mesh, stores.patches})
                images.push_back(test::draw({{store, {}, {}}}, *backend, *executor_, view, s));
            size_t both = 0, other = 0;
            for (size_t i = 0; i < images[0].rgba.size(); ++i) {
                if (!(images[0].depth[i] > 0 && images[1].depth[i] > 0)) continue;
                ++both;
                other += images[0].rgba[i] != images[1].rgba[i] || (images[0].rgba[i] & 0xffffffu) != kColour;
            }
            EXPECT_GT(both, 3000u);
            if (isUnlit) EXPECT_EQ(other, 0u) << name;
            if (!isUnlit) EXPECT_GT(other, both / 2) << name << ", the control";
        }
    }
}

}  // namespace
}  // namespace stipple
