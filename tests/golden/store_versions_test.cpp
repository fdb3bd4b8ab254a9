// Stores of every version that was ever written and is still read, kept as bytes: they open, are true, and hold what
// their inputs held, which is made again here. Whoever raises a version adds a file of the new one
// (STIPPLE_RENEW_GOLDENS writes those that are missing, and no other) and keeps the old ones as long as they are read.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

#include "engine/reference/decode.h"
#include "lod/store.h"
#include "tests/support/meshes.h"
#include "tests/support/strands.h"

namespace stipple {
namespace {

std::string pathOf(const std::string& kind, uint32_t version) {
    return fmt::format("{}/tests/golden/stores/{}_{}.stipple", STIPPLE_SOURCE_DIR, kind, version);
}

std::vector<test::TestPoint> inputPoints() {
    std::vector<test::TestPoint> points;
    for (int x = 0; x < 20; ++x)
        for (int y = 0; y < 15; ++y)
            points.push_back({{0.25 * x, 0.25 * y, 0.125 * (x * y % 7)}, glm::vec3(0, 0, 1), uint32_t(x) << 16});
    return points;
}

/// A bent sheet of 2 x 12 x 10 triangles; `far`: and one more triangle there.
lod::TriangleMesh inputMesh(double far) {
    lod::TriangleMesh mesh;
    constexpr uint32_t kWide = 13, kDeep = 11;
    const auto add = [&](const glm::dvec3& p) {
        mesh.position.push_back(p);
        mesh.normal.emplace_back(0, 0, 1);
        mesh.surface.push_back(shared::kSurfaceTwoSided | shared::kSurfaceFlat);
    };
    for (uint32_t y = 0; y < kDeep; ++y)
        for (uint32_t x = 0; x < kWide; ++x) add({0.5 * x, 0.5 * y, 0.0625 * (x * x % 5)});
    for (uint32_t y = 0; y + 1 < kDeep; ++y)
        for (uint32_t x = 0; x + 1 < kWide; ++x) {
            const uint32_t a = y * kWide + x, b = a + 1, c = a + kWide, d = c + 1;
            mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
        }
    if (far > 0) {
        const auto first = static_cast<uint32_t>(mesh.position.size());
        for (const glm::dvec3& p : {glm::dvec3(far, 0, 0), glm::dvec3(far, 1, 0), glm::dvec3(far, 0, 1)}) add(p);
        mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2});
    }
    return mesh;
}

lod::StrandSet inputStrands() { return test::curls({.count = 6, .vertices = 12}); }

void buildMesh(double far, const std::string& path, Executor& executor) {
    lod::MeshBuildSettings settings;
    settings.description.materials = {shared::SurfaceMaterial{}};
    Progress progress(false);
    ASSERT_TRUE(lod::buildMeshStore(lod::sourceOf(inputMesh(far)), path, settings, executor, progress));
}

void writeIfMissing(const std::string& kind, uint32_t version, Executor& executor) {
    const std::string path = pathOf(kind, version);
    if (std::filesystem::exists(path)) return;
    if (std::getenv("STIPPLE_RENEW_GOLDENS") == nullptr) {
        ADD_FAILURE() << "there is no store of this version yet: " << path;
        return;
    }
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    const test::TempFolder folder;
    if (kind == "points") {
        test::writePly(folder / "a.ply", inputPoints());
        lod::BuildSettings settings;
        settings.leafRecords = 64;
        test::build({folder / "a.ply"}, path, executor, settings);
    } else if (kind == "strands") {
        test::buildStrands(inputStrands(), path, executor, 16);
    } else {
        buildMesh(kind == "wide" ? 1e12 : 0, path, executor);
    }
    ADD_FAILURE() << "written: " << path;
}

/// Corners, ends and centres of what a store draws in full detail.
std::vector<glm::dvec3> placesOf(const lod::Store& store) {
    std::vector<glm::dvec3> places;
    const lod::Hierarchy& h = store.hierarchy;
    if (h.isMesh()) {
        for (const test::Triangle& t : test::leafTriangles(store)) places.insert(places.end(), t.begin(), t.end());
        return places;
    }
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        const auto chunk = lod::readChunk(store, n);
        EXPECT_TRUE(chunk);
        for (const auto& record : chunk->records)
            places.push_back(reference::decodeDisc(h, h.nodes[n], record).position);
        for (const auto& segment : chunk->segments) {
            const reference::Segment s = reference::decodeSegment(h, h.nodes[n], segment);
            places.insert(places.end(), {s.a, s.b});
        }
    }
    return places;
}

double farthest(const std::vector<glm::dvec3>& from, const std::vector<glm::dvec3>& to) {
    double worst = 0;
    for (const glm::dvec3& p : from) {
        double nearest = 1e300;
        for (const glm::dvec3& q : to) nearest = std::min(nearest, glm::length(p - q));
        worst = std::max(worst, nearest);
    }
    return worst;
}

uint32_t versionOf(const std::string& path) {
    const std::string bytes = test::slurp(path);
    uint32_t version = 0;
    if (bytes.size() >= 12) std::memcpy(&version, bytes.data() + 8, 4);
    return version;
}

void expectHolds(const std::string& path, const std::vector<glm::dvec3>& input, double tolerance, Executor& executor) {
    const auto store = lod::openStore(path);
    ASSERT_TRUE(store) << store.error().line();
    const auto checked = lod::verifyStore(*store, executor);
    EXPECT_TRUE(checked) << (checked ? "" : checked.error().line());
    const std::vector<glm::dvec3> places = placesOf(*store);
    EXPECT_GE(places.size(), input.size());
    EXPECT_LE(farthest(input, places), tolerance) << path << ": what was given is not there";
    if (!store->hierarchy.isStrands)  // (whose long segments are divided)
        EXPECT_LE(farthest(places, input), tolerance) << path << ": something else is there";
}

TEST(StoreVersions, EveryVersionHoldsWhatItWasGiven) {
    const auto executor = makeSerialExecutor();
    for (const char* kind : {"points", "mesh", "strands"}) writeIfMissing(kind, lod::kStoreVersion, *executor);
    writeIfMissing("wide", lod::kWideMeshVersion, *executor);
    size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(STIPPLE_SOURCE_DIR "/tests/golden/stores")) {
        const std::string name = entry.path().stem().string(), path = entry.path().string();
        if (entry.path().extension() != ".stipple") continue;
        ++files;
        SCOPED_TRACE(name);
        const std::string kind = name.substr(0, name.find('_'));
        EXPECT_EQ(pathOf(kind, versionOf(path)), path) << "the name says another version than the bytes";
        std::vector<glm::dvec3> input;
        if (kind == "points")
            for (const test::TestPoint& p : inputPoints()) input.push_back(p.position);
        else if (kind == "strands")
            input = inputStrands().position;
        else
            input = inputMesh(kind == "wide" ? 1e12 : 0).position;
        // What is drawn of a point, and the ends of curls in cells of 2, has 16 bits; a double at 1e12 has steps of
        // 1e-4.
        const std::map<std::string, double> tolerances{
            {"points", 1e-4}, {"mesh", 1e-6}, {"strands", 3e-4}, {"wide", 3e-4}};
        expectHolds(path, input, tolerances.at(kind), *executor);
    }
    EXPECT_GE(files, 4u);
}

/// Negative control: a byte of any of them that is another one is found.
TEST(StoreVersions, AChangedByteIsFound) {
    const auto executor = makeSerialExecutor();
    const test::TempFolder folder;
    for (const auto& [kind, version] :
         {std::pair{"points", lod::kStoreVersion}, std::pair{"wide", lod::kWideMeshVersion}}) {
        std::string bytes = test::slurp(pathOf(kind, version));
        ASSERT_GT(bytes.size(), 400u);
        bytes[260] = static_cast<char>(bytes[260] ^ 1);  // in the first chunk
        test::spit(folder / "changed.stipple", bytes);
        const auto store = lod::openStore(folder / "changed.stipple");
        EXPECT_FALSE(store && lod::verifyStore(*store, *executor)) << kind;
    }
}

}  // namespace
}  // namespace stipple
