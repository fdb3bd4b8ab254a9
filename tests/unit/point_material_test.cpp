// Materials of points from input to store: exact or to 1/30, by majority in coarse records, the same bytes for any
// threads, memory and order; damage is found.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <random>

#include "engine/reference/decode.h"
#include "engine/scene/surfels.h"
#include "lod/primitives/kinds.h"
#include "lod/store/attributes.h"
#include "lod/store/materials.h"
#include "tests/support/crafted_store.h"
#include "tests/support/meshes.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

struct Rough {
    glm::vec3 position{0};
    float roughness = 1, metallic = 0;
};

void writeRough(const std::string& path, const std::vector<Rough>& points, bool hasMaterials = true) {
    std::ofstream out(path, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
        << "\nproperty float x\nproperty float y\nproperty float z\n";
    if (hasMaterials) out << "property float roughness\nproperty float metallic\n";
    out << "end_header\n";
    for (const Rough& p : points) out.write(reinterpret_cast<const char*>(&p), hasMaterials ? 20 : 12);
}

/// On a wavy ground; roughness and metallic are functions of the place.
std::vector<Rough> ground(size_t count) {
    Rng rng(4);
    std::vector<Rough> points(count);
    for (Rough& p : points) {
        const auto x = static_cast<float>(rng.uniform(0, 100)), y = static_cast<float>(rng.uniform(0, 100));
        p = {{x, y, std::sin(0.1f * x)}, x / 100, y / 100};
    }
    return points;
}

std::shared_ptr<const Store> built(const std::vector<std::string>& inputs, const std::string& output, int threads = 0,
                                   uint64_t memory = uint64_t{2} << 30) {
    const auto executor = makeTbbExecutor(threads);
    BuildSettings settings;
    settings.memoryBytes = memory;
    test::build(inputs, output, *executor, settings);
    return std::make_shared<const Store>(*openStore(output));
}

/// Calls use(chunk index, its records with their materials) for all payloads.
template <typename Use>
void forEachChunk(const Store& store, const Use& use) {
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n) {
        Chunk chunk = *readChunk(store, n);
        ASSERT_TRUE(addMaterials(store, n, chunk));
        use(n, chunk);
    }
}

TEST(PointMaterials, OfPlyFilesAreKeptToATwentiethAndMergeByMajority) {
    const test::TempFolder folder;
    writeRough(folder / "a.ply", ground(60'000));
    const auto store = built({folder / "a.ply"}, folder / "a.stipple");
    ASSERT_TRUE(store->hierarchy.hasMaterials);
    EXPECT_TRUE(store->description.isReflectance);
    double worst = 0;
    uint64_t leaves = 0;
    forEachChunk(*store, [&](uint32_t n, const Chunk& chunk) {
        ASSERT_EQ(chunk.materials.size(), chunk.records.size());
        const uint64_t overview = store->hierarchy.overviewOf(store->hierarchy.nodes[n]);  // (is not read here)
        EXPECT_EQ(decodedBytes(store->hierarchy, n), chunk.sizeBytes() + overview * (sizeof(shared::PointRecord) + 2));
        for (size_t i = 0; i < chunk.records.size(); ++i) {
            const reference::Disc d =
                reference::decodeDisc(store->hierarchy, store->hierarchy.nodes[n], chunk.records[i]);
            const double roughness = (chunk.materials[i] >> 8) / 255.0, metallic = (chunk.materials[i] & 255) / 255.0;
            if (!store->hierarchy.nodes[n].isLeaf()) continue;
            ++leaves;
            worst =
                std::max({worst, std::abs(roughness - d.position.x / 100), std::abs(metallic - d.position.y / 100)});
        }
    });
    EXPECT_EQ(leaves, 60'000u);
    EXPECT_LE(worst, 1.0 / 30 + 0.003);  // and half a byte
    EXPECT_GT(worst, 1.0 / 40) << "the bound is no larger than it must be";
}

/// Whole numbers are shares of the largest of their type.
TEST(PointMaterials, OfSignedTypesReachOneAtTheirLargest) {
    const test::TempFolder folder;
    for (const auto& [type, largest] :
         {std::pair{"char", "127"}, std::pair{"uchar", "255"}, std::pair{"short", "32767"},
          std::pair{"ushort", "65535"}, std::pair{"int", "2147483647"}}) {
        SCOPED_TRACE(type);
        std::ofstream out(folder / "a.ply");
        out << "ply\nformat ascii 1.0\nelement vertex 64\nproperty float x\nproperty float y\nproperty float z\n"
            << "property " << type << " roughness\nproperty " << type << " metallic\nend_header\n";
        for (int i = 0; i < 64; ++i) out << i % 8 << " " << i / 8 << " 0 " << largest << " " << largest << "\n";
        out.close();
        const auto store = built({folder / "a.ply"}, folder / "a.stipple");
        forEachChunk(*store, [&](uint32_t, const Chunk& chunk) {
            ASSERT_FALSE(chunk.materials.empty());
            for (const uint16_t m : chunk.materials) ASSERT_EQ(m, 0xffff);
        });
    }
}

TEST(PointMaterials, CoarseRecordsHaveThatOfMostBelowThem) {
    const test::TempFolder folder;
    std::vector<Rough> points = ground(60'000);
    Rng rng(9);
    for (Rough& p : points) p.roughness = p.metallic = rng.uniform() < 0.7 ? 0.0f : 1.0f;
    writeRough(folder / "a.ply", points);
    const auto store = built({folder / "a.ply"}, folder / "a.stipple");
    std::map<uint32_t, std::pair<double, double>> byLevel;  // of all records, of those that have the more frequent one
    forEachChunk(*store, [&](uint32_t n, const Chunk& chunk) {
        auto& [all, most] = byLevel[store->hierarchy.nodes[n].level];
        for (const uint16_t m : chunk.materials) {
            all += 1;
            most += m == 0 ? 1 : 0;
            EXPECT_TRUE(m == 0 || m == 0xffff) << "one of the two, no mean";
        }
    });
    ASSERT_GE(byLevel.size(), 3u);
    EXPECT_NEAR(byLevel.rbegin()->second.second / byLevel.rbegin()->second.first, 0.7, 0.1);
    EXPECT_GE(byLevel.begin()->second.second / byLevel.begin()->second.first, 0.9) << "of many points most are it";
}

TEST(PointMaterials, AreTheSameForAnyThreadsMemoryAndOrder) {
    const test::TempFolder folder;
    std::vector<Rough> points = ground(600'000);
    writeRough(folder / "a.ply", points);
    std::shuffle(points.begin(), points.end(), std::mt19937(3));
    writeRough(folder / "b.ply", points);
    const auto whole = built({folder / "a.ply"}, folder / "a.stipple", 2);
    const uint64_t little = uint64_t{92 + 58} << 20;
    const auto chunksOf = [&](const Store& store) {
        const std::string bytes = test::slurp(store.path);
        const uint64_t end = store.hierarchy.nodes[0].chunkOffset;  // the root's comes last
        EXPECT_GT(end, 1'000'000u);
        return bytes.substr(512, end - 512);
    };
    const std::string truth = chunksOf(*whole);
    EXPECT_TRUE(chunksOf(*built({folder / "a.ply"}, folder / "c.stipple", 16, little)) == truth);
    EXPECT_TRUE(chunksOf(*built({folder / "b.ply"}, folder / "d.stipple", 1)) == truth);
    EXPECT_TRUE(chunksOf(*built({folder / "b.ply"}, folder / "e.stipple", 2, little)) == truth);
    // The control: one material less is other bytes.
    points.front().roughness = points.front().roughness > 0.5f ? 0.0f : 1.0f;
    writeRough(folder / "b.ply", points);
    EXPECT_FALSE(chunksOf(*built({folder / "b.ply"}, folder / "f.stipple", 2)) == truth);
}

TEST(PointMaterials, OfFilesWithAndWithoutThemAreMatteWhereNothingIsSaid) {
    const test::TempFolder folder;
    std::vector<Rough> points = ground(4000);
    for (Rough& p : points) p.roughness = 0.2f, p.metallic = 1;
    writeRough(folder / "a.ply", points);
    for (Rough& p : points) p.position.z += 10;
    writeRough(folder / "b.ply", points, false);
    const auto store = built({folder / "a.ply", folder / "b.ply"}, folder / "a.stipple");
    std::map<uint16_t, uint64_t> found;
    forEachChunk(*store, [&](uint32_t n, const Chunk& chunk) {
        for (const uint16_t m : chunk.materials) found[m] += store->hierarchy.nodes[n].isLeaf() ? 1 : 0;
    });
    EXPECT_EQ(found[packed({0.2f, 1})], 4000u);
    EXPECT_EQ(found[packed({1, 0})], 4000u);
}

TEST(PointMaterials, ThatAreNotInTheListAreFound) {
    const test::TempFolder folder;
    writeRough(folder / "a.ply", ground(5000));
    const auto store = built({folder / "a.ply"}, folder / "a.stipple");
    const auto executor = makeTbbExecutor(0);
    EXPECT_TRUE(verifyStore(*store, *executor));
    Store shorter = *store;
    shorter.description.pointMaterials.resize(3);
    const auto verified = verifyStore(shorter, *executor);
    ASSERT_FALSE(verified);
    EXPECT_NE(verified.error().line().find("names material"), std::string::npos) << verified.error().line();
    Chunk chunk = *readChunk(shorter, 0);
    ASSERT_TRUE(addMaterials(shorter, 0, chunk)) << "drawn all the same";
    // A byte of the stream.
    const Payload& p = store->hierarchy.nodes[0];
    std::string bytes = test::slurp(folder / "a.stipple");
    bytes[p.chunkOffset + p.chunkBytes + p.attributeBytes / 2] ^= 0x10;
    test::spit(folder / "b.stipple", bytes);
    const auto damaged = openStore(folder / "b.stipple");
    ASSERT_TRUE(damaged);
    EXPECT_FALSE(verifyStore(*damaged, *executor));
}

/// Two squares side by side, each of its own material.
scene::Scene twoSquares() {
    scene::Scene scene;
    scene.path = "squares";
    scene.materials.resize(2);
    scene.materials[0].roughness = 0.25f;
    scene.materials[0].metallic = 1;
    scene.materials[1].roughness = 0.75f;
    scene.materials[1].metallic = 0;
    scene.meshes.resize(1);
    for (int k = 0; k < 2; ++k) {
        scene::Primitive square;
        const auto x = static_cast<float>(k);
        square.position = {{x, 0, 0}, {x + 1, 0, 0}, {x + 1, 1, 0}, {x, 1, 0}};
        square.indices = {0, 1, 2, 0, 2, 3};
        square.material = k;
        scene.meshes[0].primitives.push_back(square);
    }
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    return scene;
}

TEST(PointMaterials, WithoutOneSurfelsAreNotMetallicAsTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    scene::Scene scene = twoSquares();
    scene.meshes[0].primitives[1].material = -1;
    BuildSettings settings;
    settings.open = [&](const std::string&, const ReadOptions&) { return scene::sampleSurfels(scene, {}, {2'000}); };
    test::spit(folder / "scene", "x");
    test::build({folder / "scene"}, folder / "a.stipple", *executor, settings);
    const std::vector<PointMaterial> list = openStore(folder / "a.stipple")->description.pointMaterials;
    for (const PointMaterial& m : {PointMaterial{0.25f, 1}, PointMaterial{1, 0}})
        EXPECT_EQ(std::count(list.begin(), list.end(), m), 1) << m.roughness;
    EXPECT_EQ(list.size(), 2u);
}

/// Of scans "roughness" is that of the ground, in any unit: a material says both.
TEST(PointMaterials, RoughnessAloneIsAnAttribute) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::ofstream out(folder / "a.ply", std::ios::binary);
    out << "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\nproperty float z\n"
           "property float roughness\nend_header\n";
    for (int i = 0; i < 300; ++i) out << i % 20 << " " << i / 20 << " 0 " << i % 12 << "\n";
    out.close();
    BuildSettings settings;
    settings.attributes = {"roughness"};
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor, settings);
    const StoreDescription d = openStore(folder / "a.stipple")->description;
    EXPECT_TRUE(d.pointMaterials.empty());
    EXPECT_FALSE(d.isReflectance);
    ASSERT_EQ(d.attributes.size(), 1u);
    EXPECT_EQ(d.attributes[0].name, "roughness");
    EXPECT_EQ(d.attributes[0].greatest, 11);
}

TEST(PointMaterials, AnAttributeOfThatNameIsTheUsers) {
    StoreDescription d;
    AttributeInfo own;
    own.name = kMaterialAttribute;
    own.type = ScalarType::u8;
    d.attributes = {own};
    d.pointMaterials = {PointMaterial{0.3f, 1}};
    EXPECT_FALSE(materialAttribute(d)) << "of one material there is no index";
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::ofstream out(folder / "a.ply", std::ios::binary);
    out << "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\nproperty float z\n"
           "property float material\nproperty float roughness\nproperty float metallic\nend_header\n";
    for (int i = 0; i < 300; ++i) out << i % 20 << " " << i / 20 << " 0 " << i % 7 << " " << i % 2 << " 0\n";
    out.close();
    BuildSettings settings;
    settings.attributes = {"material"};
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor, settings);
    const StoreDescription both = openStore(folder / "a.stipple")->description;
    ASSERT_EQ(both.attributes.size(), 2u);
    EXPECT_EQ(both.attributes[0].name, "material");
    EXPECT_EQ(both.attributes[1].name, "material_index");
    EXPECT_EQ(materialAttribute(both), std::optional<size_t>(1));
    const auto verified = openStore(folder / "a.stipple");
    EXPECT_TRUE(verifyStore(*verified, *executor));
}

TEST(PointMaterials, OfMeshesAreThoseOfTheirTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const scene::Scene scene = twoSquares();
    BuildSettings settings;
    settings.open = [&](const std::string&, const ReadOptions&) { return scene::sampleSurfels(scene, {}, {20'000}); };
    test::spit(folder / "scene", "x");
    test::build({folder / "scene"}, folder / "a.stipple", *executor, settings);
    const Store store = *openStore(folder / "a.stipple");
    EXPECT_EQ(store.description.pointMaterials.size(), 2u);
    uint64_t wrong = 0, all = 0;
    forEachChunk(store, [&](uint32_t n, const Chunk& chunk) {
        if (!store.hierarchy.nodes[n].isLeaf()) return;
        for (size_t i = 0; i < chunk.records.size(); ++i) {
            const double x =
                reference::decodeDisc(store.hierarchy, store.hierarchy.nodes[n], chunk.records[i]).position.x;
            wrong += chunk.materials[i] != (x < 1 ? packed({0.25f, 1}) : packed({0.75f, 0}));
            ++all;
        }
    });
    EXPECT_GT(all, 19'000u);
    EXPECT_LE(wrong, 2u) << "where both meet places are rounded";
    // One of a mesh without materials has none.
    scene::Scene plain = scene;
    plain.materials.clear();
    for (scene::Primitive& p : plain.meshes[0].primitives) p.material = -1;
    settings.open = [&](const std::string&, const ReadOptions&) { return scene::sampleSurfels(plain, {}, {20'000}); };
    test::build({folder / "scene"}, folder / "b.stipple", *executor, settings);
    EXPECT_TRUE(openStore(folder / "b.stipple")->description.pointMaterials.empty());
}

TEST(PointMaterials, AreSaidByInfo) {
    const test::TempFolder folder;
    std::vector<Rough> points = ground(3000);
    for (size_t i = 0; i < points.size(); ++i) {
        points[i].roughness = i < 1000 ? 0.2f : 1.0f;
        points[i].metallic = 0;
    }
    writeRough(folder / "a.ply", points);
    built({folder / "a.ply"}, folder / "a.stipple");
    const test::Outcome text = test::runProgram(folder, "info a.stipple");
    EXPECT_NE(text.out.find("roughness 0.2, metallic 0: 1000 points"), std::string::npos) << text.out;
    EXPECT_NE(text.out.find("roughness 1, metallic 0: 2000 points"), std::string::npos) << text.out;
    // What no material has is not counted to one, whatever the table says.
    auto crafted = test::CraftedStore::read(folder / "a.stipple");
    const size_t at = crafted.description.find(",1000]");
    ASSERT_NE(at, std::string::npos) << crafted.description;
    const size_t begin = crafted.description.rfind('[', at) + 1;
    for (const char* value : {"-0.5", "-1e300", "1e300"}) {
        auto c = crafted;
        c.description.replace(begin, at - begin, value);
        c.write(folder / "b.stipple");
        const test::Outcome odd = test::runProgram(folder, "info b.stipple");
        EXPECT_EQ(odd.code, 0) << odd.err;
        EXPECT_EQ(odd.out.find("1000 points"), std::string::npos) << odd.out;
    }
}

}  // namespace
}  // namespace stipple::lod
