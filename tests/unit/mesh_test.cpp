// Meshes file by file and part by part: PLY faces and strips, what weld drops, damaged chunks and stores, scenes that
// are written and read again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_work.h"
#include "lod/import/ply/mesh.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

/// A PLY mesh through the front door; `memoryBytes`: of its vertices.
Result<lod::TriangleMesh> readPlyMesh(const std::string& path, uint64_t& bad, uint64_t memoryBytes = 1 << 24) {
    STIPPLE_ASSIGN(const lod::MeshSource source,
                   lod::openPlyMesh(path, memoryBytes, std::filesystem::temp_directory_path().string()));
    STIPPLE_ASSIGN(const auto bounds, source.survey(test::tellNobody));
    static_cast<void>(bounds);
    const Result<void> read = source.read([](const lod::TriangleMesh&) -> Result<void> { return {}; });
    if (!read) return tl::unexpected(read.error());
    bad = source.badTriangles();
    return test::collect(source);
}

/// Corners by position, three a triangle.
std::vector<glm::dvec3> cornersOf(const lod::TriangleMesh& mesh) {
    std::vector<glm::dvec3> out;
    for (const uint32_t i : mesh.indices) out.push_back(mesh.position[i]);
    return out;
}

TEST(PlyMesh, PolygonsAndStripsBecomeTriangles) {
    const test::TempFolder folder;
    test::spit(folder / "a.ply",
               "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 3\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
               "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n7 4 0 1 2 3\n7 3 0 1 4\n7 3 0 1 9\n");
    ASSERT_TRUE(lod::plyFaces(folder / "a.ply")->any());
    uint64_t bad = 0;
    const auto mesh = readPlyMesh(folder / "a.ply", bad);
    ASSERT_TRUE(mesh) << mesh.error().line();
    const std::array<glm::dvec3, 5> v{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}}};
    const auto of = [](const auto& places, std::initializer_list<size_t> indices) {
        std::vector<glm::dvec3> out;
        for (const size_t i : indices) out.push_back(places[i]);
        return out;
    };
    EXPECT_EQ(cornersOf(*mesh), of(v, {0, 1, 2, 0, 2, 3, 0, 1, 4}));
    EXPECT_EQ(bad, 1u);
    EXPECT_EQ(mesh->normal.size(), 5u);
    EXPECT_NEAR(mesh->normal[2].z, 1, 1e-6);
    // A strip turns every second triangle round; -1 starts a new one.
    std::string strip =
        "ply\nformat binary_little_endian 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    const std::array<float, 18> positions{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0};
    const std::array<int32_t, 9> corners{8, 0, 1, 2, 3, -1, 3, 4, 5};
    strip.append(reinterpret_cast<const char*>(positions.data()), sizeof(positions));
    strip.append(reinterpret_cast<const char*>(corners.data()), sizeof(corners));
    test::spit(folder / "b.ply", strip);
    const auto strips = readPlyMesh(folder / "b.ply", bad);
    ASSERT_TRUE(strips) << strips.error().line();
    const std::array<glm::dvec3, 6> s{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}, {1, 2, 0}}};
    EXPECT_EQ(cornersOf(*strips), of(s, {0, 1, 2, 1, 3, 2, 3, 4, 5}));
    // Every truncation is refused, never read as something else.
    for (size_t length = strip.size() - 90; length < strip.size(); ++length) {
        test::spit(folder / "c.ply", strip.substr(0, length));
        EXPECT_FALSE(readPlyMesh(folder / "c.ply", bad)) << length;
    }
}

/// The same rows as bytes and as text: `counts` and `corners` are types of PLY.
std::pair<std::string, std::string> bothEncodings(const std::vector<std::vector<int64_t>>& rows,
                                                  const std::string& counts, const std::string& corners) {
    const auto head = [&](const std::string& encoding) {
        return "ply\nformat " + encoding +
               " 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face " +
               std::to_string(rows.size()) + "\nproperty list " + counts + " " + corners +
               " vertex_indices\nend_header\n";
    };
    std::string bytes = head("binary_little_endian"), text = head("ascii");
    for (int v = 0; v < 6; ++v) {
        const std::array<float, 3> place{static_cast<float>(v), static_cast<float>(v * v), 1};
        bytes.append(reinterpret_cast<const char*>(place.data()), sizeof(place));
        text += std::to_string(v) + " " + std::to_string(v * v) + " 1\n";
    }
    for (const std::vector<int64_t>& row : rows) {
        bytes += static_cast<char>(row.size());
        text += std::to_string(row.size());
        for (const int64_t corner : row) {
            const auto word = static_cast<uint32_t>(corner);
            bytes.append(reinterpret_cast<const char*>(&word), 4);
            text += " " + std::to_string(corner);
        }
        text += "\n";
    }
    return {bytes, text};
}

TEST(PlyMesh, RowsOfThreeCornersAreReadLikeAnyOthers) {
    const test::TempFolder folder;
    uint64_t bad = 0, badOfText = 0;
    for (const auto& [counts, corners] : {std::pair{"uchar", "int"}, {"char", "int"}, {"uchar", "uint"}}) {
        // Rows are taken by 4,096: other ones stand there, at both ends, and one after the other.
        std::vector<std::vector<int64_t>> rows;
        for (int64_t r = 0; r < 9000; ++r) {
            const bool isOther = r == 0 || r == 4095 || r == 4096 || r == 4098 || r == 8999;
            rows.push_back({r % 6, (r + 1) % 6, (r / 6 + 2) % 6});
            if (isOther) rows.back().push_back((r + 3) % 6);
            if (r % 1000 == 7) rows.back()[1] = std::string(corners) == "int" ? -1 : 0xfffffff0;
            if (r % 1000 == 8) rows.back()[2] = 6;
        }
        const auto [bytes, text] = bothEncodings(rows, counts, corners);
        test::spit(folder / "a.ply", bytes);
        test::spit(folder / "b.ply", text);
        const auto one = readPlyMesh(folder / "a.ply", bad), other = readPlyMesh(folder / "b.ply", badOfText);
        ASSERT_TRUE(one) << one.error().line();
        ASSERT_TRUE(other) << other.error().line();
        EXPECT_EQ(one->indices.size() / 3, 9000u + 5 - 18);
        EXPECT_EQ(cornersOf(*one), cornersOf(*other));
        EXPECT_EQ(bad, 18u);
        EXPECT_EQ(badOfText, 18u);
        // Whatever is missing of the last rows is missed.
        for (size_t length = bytes.size() - 60; length < bytes.size(); ++length) {
            test::spit(folder / "c.ply", bytes.substr(0, length));
            const auto cut = readPlyMesh(folder / "c.ply", bad);
            ASSERT_FALSE(cut) << length;
            EXPECT_NE(cut.error().line().find("element 'face', at row 899"), std::string::npos) << cut.error().line();
        }
    }
    // A count below zero is none.
    auto [bytes, text] = bothEncodings({{0, 1, 2}, {1, 2, 3}}, "char", "int");
    bytes[bytes.size() - 13] = static_cast<char>(-3);
    test::spit(folder / "d.ply", bytes);
    EXPECT_FALSE(readPlyMesh(folder / "d.ply", bad));
}

TEST(PlyMesh, RowsLongerThanABlockAndVerticesBeyondTheMemoryAreTheSame) {
    // A strip of 150,000 corners in one row (read in parts of 65,536), with a break, over a zigzag of vertices; once
    // with all its vertices in memory, once with 512 KiB of 4 MiB.
    const test::TempFolder folder;
    constexpr int kCorners = 150'000;
    std::string text =
        "ply\nformat binary_little_endian 1.0\nelement vertex 150000\nproperty double x\nproperty double y\n"
        "property double z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    const auto put = [&](const auto& value) { text.append(reinterpret_cast<const char*>(&value), sizeof(value)); };
    for (int i = 0; i < kCorners; ++i) {
        put(0.5 * i);
        put(i % 2 == 0 ? 0.0 : 1.0);
        put(0.001 * (i % 7));
    }
    put(kCorners + 1);
    for (int i = 0; i < kCorners; ++i) {
        if (i == 70'000) put(-1);
        put(i);
    }
    test::spit(folder / "long.ply", text);
    uint64_t bad = 0;
    const auto all = readPlyMesh(folder / "long.ply", bad, 1 << 24),
               some = readPlyMesh(folder / "long.ply", bad, 1 << 19);
    ASSERT_TRUE(all && some);
    ASSERT_EQ(all->indices.size() / 3, size_t{kCorners - 4});
    EXPECT_EQ(cornersOf(*all), cornersOf(*some));
    EXPECT_EQ(all->normal, some->normal);
    size_t up = 0;  // the winding alternates as it should: all normals point the same way
    for (const glm::vec3& n : all->normal) up += n.z < -0.9f ? 1 : 0;
    EXPECT_EQ(up, all->normal.size());
}

TEST(PlyMesh, TheRealMeshesHaveTheirTriangles) {
    for (const auto& [name, triangles] : {std::pair{"01_meshes/bunny/bun_zipper.ply", size_t{69451}},
                                          {"01_meshes/misc/horse.ply", size_t{96966}},
                                          {"01_meshes/misc/lucy.ply", size_t{99970}}}) {
        const std::string path = test::dataFile(name);
        if (path.empty()) return;
        uint64_t bad = 0;
        const auto mesh = readPlyMesh(path, bad);
        ASSERT_TRUE(mesh) << mesh.error().line();
        EXPECT_EQ(mesh->indices.size() / 3, triangles) << name;
        EXPECT_EQ(bad, 0u);
    }
    const auto igea = [] {
        uint64_t bad = 0;
        return readPlyMesh(test::dataFile("01_meshes/misc/igea.ply"), bad);
    }();
    ASSERT_TRUE(igea);
    EXPECT_GT(igea->indices.size() / 3, 260'000u);  // a closed surface has about twice as many as vertices
}

TEST(Weld, CountsWhatItDropsAndKeepsTheRest) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    lod::TriangleMesh in;
    in.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {nan, 0, 0}, {0, 0, 0}, {2, 0, 0}};
    in.indices = {0, 1, 2,  // kept
                  1, 2, 5,  // the same with an equal vertex, turned: a duplicate
                  2, 1, 0,  // the other side: kept
                  1, 3, 2,  // kept
                  0, 1, 6,  // no area
                  0, 0, 1,  // no area
                  0, 1, 4};
    const auto executor = makeSerialExecutor();
    lod::PlacedBlock placed =
        lod::placeBlock(in, lod::latticeOf(*lod::sourceOf(in).survey(test::tellNobody)), *executor);
    EXPECT_EQ(placed.degenerate, 2u);
    EXPECT_EQ(placed.notFinite, 1u);
    EXPECT_EQ(placed.rounding, 0);  // small whole numbers lie on the lattice
    lod::WeldedMesh mesh = lod::weld(placed.soup);
    EXPECT_EQ(lod::sortTriangles(mesh, placed.soup.indices), 1u);
    EXPECT_EQ(placed.soup.indices.size() / 3, 3u);
    EXPECT_EQ(mesh.vertices.size(), 4u);
}

TEST(MeshStore, DamagedChunksAndTablesAreRefused) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::MeshRecipe recipe;
    recipe.grow.triangles = 6'000;
    recipe.grow.textureSize = 64;
    const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
    ASSERT_TRUE(lod::verifyStore(*store, *executor));
    const lod::Hierarchy& h = store->hierarchy;
    // A chunk in a buffer of exactly its size, cut at every length: an error, and no read beyond (AddressSanitizer).
    const lod::Node& node = h.nodes[h.nodes.size() - 1];
    std::vector<uint8_t> bytes(node.chunkBytes);
    ASSERT_TRUE(store->file->readAt(node.chunkOffset, bytes.data(), bytes.size()));
    lod::MeshVertices kind = lod::MeshVertices::shortOnes;
    const auto decode = [&](const std::vector<uint8_t>& b) {
        return lod::decodeMeshChunk(b.data(), b.size(), node.records, h.groups.back(), kind, "test");
    };
    ASSERT_TRUE(decode(bytes));
    for (size_t length = 0; length < bytes.size(); length += length < 200 ? 1 : 37)
        EXPECT_FALSE(decode({bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(length)})) << length;
    Rng rng(5);
    for (int k = 0; k < 2000; ++k) {  // changed bytes: an error or a chunk whose indices are within it
        std::vector<uint8_t> changed = bytes;
        for (int c = 0; c < 3; ++c) changed[rng.below(changed.size())] = static_cast<uint8_t>(rng.next());
        kind = std::array{lod::MeshVertices::shortOnes, lod::MeshVertices::counted, lod::MeshVertices::pairs}.at(
            static_cast<size_t>(k % 3));
        const auto chunk = decode(changed);
        if (!chunk) continue;
        for (const shared::MeshCluster& c : chunk->clusters)
            ASSERT_LE(c.firstVertex + (c.counts & 0xffffu), chunk->vertices.size());
    }
    // A store with changed bytes anywhere: opening and verifying says so.
    const std::string whole = test::slurp(folder / "a.stipple");
    for (int k = 0; k < 300; ++k) {
        std::string changed = whole;
        const size_t at = rng.below(changed.size());
        changed[at] = static_cast<char>(changed[at] ^ static_cast<char>(1 + rng.below(255)));
        test::spit(folder / "b.stipple", changed);
        const auto opened = lod::openStore(folder / "b.stipple");
        if (!opened) continue;
        EXPECT_FALSE(lod::verifyStore(*opened, *executor)) << "byte " << at << " of " << whole.size();
    }
}

TEST(MeshStore, TablesThatLieAreRefused) {
    // Through the front door: hierarchies with one impossible value, written with proper hashes.
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::MeshRecipe recipe;
    recipe.grow.triangles = 20'000;
    recipe.grow.textureSize = 32;
    const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
    const auto opens = [&](const std::function<void(lod::Hierarchy&)>& change) {
        lod::Hierarchy h = store->hierarchy;
        change(h);
        auto writer = lod::StoreWriter::create(folder / "b.stipple");
        EXPECT_TRUE(writer);
        // The same chunks at the same places.
        std::vector<lod::ChunkPlace> places;
        for (uint32_t c = 0; c < store->hierarchy.chunks(); ++c) places.push_back(lod::chunkPlace(store->hierarchy, c));
        std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.offset < b.offset; });
        for (const lod::ChunkPlace& place : places) {
            std::vector<uint8_t> bytes(place.bytes);
            EXPECT_TRUE(store->file->readAt(place.offset, bytes.data(), bytes.size()));
            lod::Node node;
            EXPECT_TRUE(writer->appendChunk(bytes, {}, node));
            EXPECT_EQ(node.chunkOffset, place.offset);
        }
        EXPECT_TRUE(writer->finish(h, store->description));
        EXPECT_TRUE(writer->commit());
        return lod::openStore(folder / "b.stipple").has_value();
    };
    EXPECT_TRUE(opens([](lod::Hierarchy&) {}));  // negative control
    const auto same = lod::verifyStore(*lod::openStore(folder / "b.stipple"), *executor);
    ASSERT_TRUE(same) << same.error().line();
    EXPECT_GT(same->errorsMeasured, 10'000u);
    // Errors that are stated smaller than they are: that is seen only where they are measured again.
    EXPECT_TRUE(opens([](lod::Hierarchy& h) {
        for (uint32_t g = 0; g < h.nodes.size(); ++g) {
            bool isFinest = true;
            for (uint32_t r = h.groups[g].firstRun; r < h.groups[g].firstRun + h.groups[g].runs; ++r)
                isFinest = isFinest && h.runs[r].producer == lod::MeshRun::kOriginal;
            if (isFinest && h.groups[g].parents > 0) h.nodes[g].errorCode = 0;
        }
    }));
    const auto lying = lod::verifyStore(*lod::openStore(folder / "b.stipple"), *executor);
    ASSERT_FALSE(lying);
    EXPECT_NE(lying.error().line().find("off its triangles"), std::string::npos) << lying.error().line();
    const auto reject = [&](const char* what, const std::function<void(lod::Hierarchy&)>& change) {
        EXPECT_FALSE(opens(change)) << what;
    };
    reject("a chunk outside the file", [](lod::Hierarchy& h) { h.nodes[1].chunkOffset = 1ull << 40; });
    reject("a tile outside the file", [](lod::Hierarchy& h) { h.tiles[0].bytes = 1u << 31; });
    reject("a texture of a group that is none", [](lod::Hierarchy& h) { h.groupTextures.back() = 99; });
    reject("a sphere that is not finite", [](lod::Hierarchy& h) { h.nodes[2].radius = std::nan(""); });
    reject("a producer before its product", [](lod::Hierarchy& h) { h.runs.back().producer = 0; });
    reject("a parent after its child",
           [](lod::Hierarchy& h) { h.parents.back() = static_cast<uint32_t>(h.nodes.size()); });
    reject("runs beyond the table", [](lod::Hierarchy& h) { h.groups[0].runs = 1u << 30; });
    reject("a texture without tiles", [](lod::Hierarchy& h) { h.textures[0].levels = 16; });
    reject("more vertices than the bytes can hold", [](lod::Hierarchy& h) { h.groups[0].vertices = 0xffffffff; });
}

/// Materials, a light, instances and a reference to a store.
scene::Scene sceneOfEverything() {
    scene::Scene scene = grow::growMesh({"building", 12'000, 3, 16});
    scene.textures.clear();
    for (scene::Material& m : scene.materials) m.baseColourTexture = m.normalTexture = {};
    scene.materials[0].alphaMode = scene::AlphaMode::mask;
    scene.materials[0].alphaCutoff = 0.25f;
    scene.materials[1].isUnlit = true;
    scene.materials[1].isDoubleSided = true;
    scene::Node lamp;
    lamp.name = "lamp";
    lamp.parent = 0;
    lamp.light = 0;
    lamp.local[3] = glm::dvec4(1, 2, 3, 1);
    scene.nodes.push_back(lamp);
    scene::Light light;
    light.kind = scene::LightKind::spot;
    light.colour = {1, 0.5f, 0.25f};
    light.intensity = 7;
    light.innerCone = 0.1f;
    light.outerCone = 0.3f;
    scene.lights.push_back(light);
    scene::Node group;
    group.name = "instance group";
    group.mesh = 0;
    for (int k = 0; k < 5; ++k) {
        glm::dmat4 m(1);
        const double c = std::cos(k * 1.3), s = std::sin(k * 1.3), scale = 1 + 0.5 * k;
        m[0] = glm::dvec4(c * scale, 0, -s * scale, 0);
        m[1] = glm::dvec4(0, scale, 0, 0);
        m[2] = glm::dvec4(s * scale, 0, c * scale, 0);
        m[3] = glm::dvec4(10.0 * k, -k, 3, 1);
        group.instances.push_back(m);
    }
    scene.nodes.push_back(group);
    scene::Node scan;
    scan.name = "scan";
    scan.store = "grove.stipple";
    scan.isVisible = false;
    scene.nodes.push_back(scan);
    return scene;
}

TEST(GltfWriter, WhatIsWrittenIsReadAgain) {
    const test::TempFolder folder;
    const scene::Scene scene = sceneOfEverything();
    for (const char* name : {"a.glb", "a.gltf"}) {
        const auto written = scene::writeGltf(scene, folder / name);
        ASSERT_TRUE(written) << written.error().line();
        const auto back = scene::readGltf(folder / name);
        ASSERT_TRUE(back) << back.error().line();
        ASSERT_EQ(back->nodes.size(), scene.nodes.size());
        for (size_t n = 0; n < scene.nodes.size(); ++n) {
            const scene::Node& before = scene.nodes[n];
            const auto found = std::find_if(back->nodes.begin(), back->nodes.end(),
                                            [&](const scene::Node& m) { return m.name == before.name; });
            ASSERT_NE(found, back->nodes.end()) << before.name;  // the order may change
            const auto parentName = [](const scene::Scene& s, const scene::Node& m) {
                return m.parent < 0 ? std::string() : s.nodes[static_cast<size_t>(m.parent)].name;
            };
            EXPECT_EQ(parentName(*back, *found), parentName(scene, before));
            EXPECT_EQ(found->isVisible, before.isVisible);
            EXPECT_EQ(found->store.empty(), before.store.empty());
            EXPECT_EQ(found->store.find("grove.stipple") != std::string::npos, !before.store.empty());
            for (int c = 0; c < 4; ++c) EXPECT_EQ(found->local[c], before.local[c]);
            ASSERT_EQ(found->instances.size(), before.instances.size());
            for (size_t i = 0; i < before.instances.size(); ++i)
                for (int c = 0; c < 4; ++c)
                    EXPECT_LT(glm::length(found->instances[i][c] - before.instances[i][c]), 1e-5);
        }
        for (size_t p = 0; p < 2; ++p) {
            const auto &a = back->meshes[0].primitives[p], &b = scene.meshes[0].primitives[p];
            EXPECT_EQ(a.position, b.position);
            EXPECT_EQ(a.normal, b.normal);
            EXPECT_EQ(a.indices, b.indices);
            EXPECT_EQ(a.material, b.material);
        }
        EXPECT_EQ(back->materials[0].alphaMode, scene::AlphaMode::mask);
        EXPECT_EQ(back->materials[0].alphaCutoff, 0.25f);
        EXPECT_TRUE(back->materials[1].isUnlit && back->materials[1].isDoubleSided);
        EXPECT_FLOAT_EQ(back->materials[1].roughness, scene.materials[1].roughness);
        ASSERT_EQ(back->lights.size(), 1u);
        EXPECT_EQ(back->lights[0].kind, scene::LightKind::spot);
        EXPECT_FLOAT_EQ(back->lights[0].intensity, 7);
        EXPECT_FLOAT_EQ(back->lights[0].outerCone, 0.3f);
    }
    EXPECT_FALSE(scene::writeGltf(scene, folder / "a.obj"));
    EXPECT_FALSE(scene::writeGltf(scene, "/proc/no/a.glb"));
}

TEST(Flatten, MirroredAndFlatPlacementsKeepTheirSides) {
    scene::Scene scene = grow::growMesh({"rock", 2'000, 1, 16});
    const scene::Placement plain{0, glm::dmat4(1)};
    scene::Placement mirrored = plain;
    mirrored.world[0].x = -1;
    const lod::TriangleMesh a = test::collect(scene::triangleSource(scene, {plain})),
                            b = test::collect(scene::triangleSource(scene, {mirrored}));
    const auto outward = [](const lod::TriangleMesh& m) {
        size_t good = 0;
        for (size_t i = 0; i < m.indices.size(); i += 3) {
            const glm::dvec3 &p = m.position[m.indices[i]], &q = m.position[m.indices[i + 1]],
                             &r = m.position[m.indices[i + 2]];
            const glm::dvec3 face = glm::cross(q - p, r - p);
            good += glm::dot(face, p) > 0 && glm::dot(face, glm::dvec3(m.normal[m.indices[i]])) > 0;
        }
        return static_cast<double>(good) / (static_cast<double>(m.indices.size()) / 3);
    };
    EXPECT_GT(outward(a), 0.98);
    EXPECT_NEAR(outward(b), outward(a), 1e-9);
    scene::Placement flat = plain;  // scale 0 along one axis: normals are still those of the plane
    flat.world[1] = glm::dvec4(0);
    for (const glm::vec3& n : test::collect(scene::triangleSource(scene, {flat})).normal)
        ASSERT_TRUE(n == glm::vec3(0) || std::abs(std::abs(n.y) - 1) < 1e-6f);
}

}  // namespace
}  // namespace stipple
