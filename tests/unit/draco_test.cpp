// Meshes that are compressed with Draco: what its own encoder makes is read as its plain form is; data that is damaged,
// lies about its size or lacks something is one line, before memory is taken.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/base/rng.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using nlohmann::json;
using test::spit;
using test::TempFolder;

constexpr int kPosition = 0, kNormal = 1, kUv = 2, kColour = 3;  // as they are added

float height(float x, float y) { return 0.1f * std::sin(6 * x) * std::cos(5 * y); }
glm::vec3 slope(float x, float y) {
    return glm::normalize(
        glm::vec3(-0.6f * std::cos(6 * x) * std::cos(5 * y), 0.5f * std::sin(6 * x) * std::sin(5 * y), 1));
}

/// A sheet over the unit square, 2 n n triangles; right of the middle its texture coordinates jump by 1, so that there
/// is a seam. Colours are bytes that stand for 0 to 1.
std::unique_ptr<draco::Mesh> sheet(int n) {
    draco::TriangleSoupMeshBuilder builder;
    builder.Start(2 * n * n);
    using draco::GeometryAttribute;
    builder.AddAttribute(GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    builder.AddAttribute(GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
    builder.AddAttribute(GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
    builder.AddAttribute(GeometryAttribute::COLOR, 4, draco::DT_UINT8, true);
    const auto triangle = [&](uint32_t face, std::array<glm::ivec2, 3> at) {
        std::array<glm::vec3, 3> p, normal;
        std::array<glm::vec2, 3> uv;
        std::array<std::array<uint8_t, 4>, 3> colour;
        const bool isRight = (at[0].x + at[1].x + at[2].x) * 2 > 3 * n;
        for (size_t k = 0; k < 3; ++k) {
            const float x = static_cast<float>(at[k].x) / static_cast<float>(n),
                        y = static_cast<float>(at[k].y) / static_cast<float>(n);
            p[k] = {x, y, height(x, y)};
            normal[k] = slope(x, y);
            uv[k] = {x + (isRight ? 1.0f : 0.0f), y};
            colour[k] = {static_cast<uint8_t>(x * 255), static_cast<uint8_t>(y * 255), 128, 255};
        }
        const draco::FaceIndex f(face);
        builder.SetAttributeValuesForFace(kPosition, f, &p[0], &p[1], &p[2]);
        builder.SetAttributeValuesForFace(kNormal, f, &normal[0], &normal[1], &normal[2]);
        builder.SetAttributeValuesForFace(kUv, f, &uv[0], &uv[1], &uv[2]);
        builder.SetAttributeValuesForFace(kColour, f, &colour[0], &colour[1], &colour[2]);
    };
    uint32_t face = 0;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            triangle(face++, {glm::ivec2(i, j), {i + 1, j}, {i + 1, j + 1}});
            triangle(face++, {glm::ivec2(i, j), {i + 1, j + 1}, {i, j + 1}});
        }
    return builder.Finalize();
}

struct Packed {
    std::string bytes;
    size_t points = 0, triangles = 0;
};

Packed pack(const draco::Mesh& mesh, int method, int speed = 5) {
    draco::Encoder encoder;
    encoder.SetEncodingMethod(method);
    encoder.SetSpeedOptions(speed, speed);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, 10);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 12);
    encoder.SetTrackEncodedProperties(true);
    draco::EncoderBuffer out;
    EXPECT_TRUE(encoder.EncodeMeshToBuffer(mesh, &out).ok());
    return {std::string(out.data(), out.size()), encoder.num_encoded_points(), encoder.num_encoded_faces()};
}

/// A file with that mesh alone, whose bytes lie in mesh.drc.
json sceneOf(const Packed& mesh) {
    json root = json::parse(R"({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "extensionsUsed": ["KHR_draco_mesh_compression"], "extensionsRequired": ["KHR_draco_mesh_compression"],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3}, "indices": 4,
            "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0,
                "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3}}}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "min": [0, 0, -0.1], "max": [1, 1, 0.1]},
                      {"componentType": 5126, "type": "VEC3"}, {"componentType": 5126, "type": "VEC2"},
                      {"componentType": 5121, "type": "VEC4", "normalized": true},
                      {"componentType": 5123, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0}], "buffers": [{"uri": "mesh.drc"}]})");
    for (size_t i = 0; i < 5; ++i) root["accessors"][i]["count"] = i < 4 ? mesh.points : 3 * mesh.triangles;
    root["bufferViews"][0]["byteLength"] = root["buffers"][0]["byteLength"] = mesh.bytes.size();
    return root;
}

class Draco : public testing::Test {
  protected:
    Result<Scene> read(const json& root, const std::string& bytes, const ReadSettings& settings = {}) {
        spit(folder_ / "mesh.drc", bytes);
        spit(folder_ / "a.gltf", root.dump());
        return readGltf(folder_ / "a.gltf", settings);
    }
    void expectRefused(const json& root, const std::string& bytes, const std::string& text) {
        const auto scene = read(root, bytes);
        ASSERT_FALSE(scene) << text;
        EXPECT_EQ(scene.error().kind, ErrorKind::input) << scene.error().line();
        EXPECT_EQ(scene.error().where, (folder_ / "a.gltf") + ": /meshes/0/primitives/0") << scene.error().line();
        EXPECT_NE(scene.error().what.find(text), std::string::npos) << scene.error().line();
        EXPECT_NE(scene.error().hint, "");
    }

    TempFolder folder_;
};

json& compressed(json& root) { return root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]; }

/// Whatever order the vertices have: is each where the sheet has it, and does all of it cover the square?
void expectSheet(const Scene& scene, size_t triangles) {
    const Primitive& p = scene.meshes.at(0).primitives.at(0);
    ASSERT_EQ(p.indices.size(), 3 * triangles);
    ASSERT_EQ(p.uv.size(), 1u);
    double area = 0;
    for (size_t t = 0; t < triangles; ++t) {
        const uint32_t* v = &p.indices[3 * t];
        const glm::vec3 edges[2] = {p.position[v[1]] - p.position[v[0]], p.position[v[2]] - p.position[v[0]]};
        area += (edges[0].x * edges[1].y - edges[0].y * edges[1].x) / 2;
        const bool isRight = p.position[v[0]].x + p.position[v[1]].x + p.position[v[2]].x > 1.5f;
        for (size_t k = 0; k < 3; ++k) {
            const glm::vec3 at = p.position[v[k]];
            ASSERT_NEAR(at.z, height(at.x, at.y), 5e-4);
            ASSERT_LT(glm::length(p.normal[v[k]] - slope(at.x, at.y)), 0.02f);
            ASSERT_NEAR(p.uv[0][v[k]].x, at.x + (isRight ? 1 : 0), 2e-3);
            ASSERT_NEAR(p.uv[0][v[k]].y, at.y, 2e-3);
            ASSERT_LT(glm::length(p.colour[v[k]] - glm::vec4(at.x, at.y, 128 / 255.0f, 1)), 0.01f);
        }
    }
    EXPECT_NEAR(area, 1, 1e-3) << "and faces the right way";
}

TEST_F(Draco, AMeshIsReadAsItsPlainFormIs) {
    const auto mesh = sheet(24);
    for (const int method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING})
        for (const int speed : {0, 5, 10}) {
            const Packed packed = pack(*mesh, method, speed);
            json root = sceneOf(packed);
            for (const bool isStrict : {false, true}) {
                ReadSettings settings;
                settings.isStrict = isStrict;
                const auto scene = read(root, packed.bytes, settings);
                ASSERT_TRUE(scene) << scene.error().line();
                EXPECT_TRUE(scene->notes.empty()) << scene->notes[0];
                expectSheet(*scene, 2 * 24 * 24);
            }
            // A strip's triangles are compressed one by one; indices may be the mesh's alone.
            root["meshes"][0]["primitives"][0]["mode"] = 5;
            root["meshes"][0]["primitives"][0].erase("indices");
            const auto strip = read(root, packed.bytes);
            ASSERT_TRUE(strip) << strip.error().line();
            expectSheet(*strip, 2 * 24 * 24);
        }
}

TEST_F(Draco, NumbersKeepWhatTheyStandForInTheTypeThatTheFileAsksFor) {
    const Packed packed = pack(*sheet(8), draco::MESH_EDGEBREAKER_ENCODING);
    for (const auto& [type, isNormalised] : {std::pair{5126, false}, {5123, true}, {5121, true}}) {
        json root = sceneOf(packed);
        root["accessors"][3]["componentType"] = type;
        root["accessors"][3]["normalized"] = isNormalised;
        const auto scene = read(root, packed.bytes);
        ASSERT_TRUE(scene) << scene.error().line();
        expectSheet(*scene, 2 * 8 * 8);
    }
    // Floats as normalised bytes: texture coordinates beyond 1 do not fit, and that is said.
    json root = sceneOf(packed);
    root["accessors"][2]["componentType"] = 5121;
    root["accessors"][2]["normalized"] = true;
    expectRefused(root, packed.bytes, "does not fit its type");
}

TEST_F(Draco, PlainAccessorsBesideItAreTaken) {
    const Packed packed = pack(*sheet(4), draco::MESH_EDGEBREAKER_ENCODING);
    json root = sceneOf(packed);
    root.erase("extensionsRequired");
    const float corners[] = {0, 0, 0, 2, 0, 0, 0, 2, 0};
    const std::string plain(reinterpret_cast<const char*>(corners), sizeof(corners));
    root["buffers"].push_back({{"uri", "plain.bin"}, {"byteLength", 36}});
    root["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 36}});
    spit(folder_ / "plain.bin", plain);
    root["accessors"] = json::array({{{"bufferView", 1},
                                      {"componentType", 5126},
                                      {"count", 3},
                                      {"type", "VEC3"},
                                      {"min", {0, 0, 0}},
                                      {"max", {2, 2, 0}}}});
    json& primitive = root["meshes"][0]["primitives"][0];
    primitive["attributes"] = {{"POSITION", 0}};
    primitive.erase("indices");
    for (const std::string& bytes : {packed.bytes, std::string(packed.bytes.size(), '?')}) {
        const auto scene = read(root, bytes);
        ASSERT_TRUE(scene) << scene.error().line();
        EXPECT_TRUE(scene->notes.empty()) << scene->notes[0];
        ASSERT_EQ(scene->meshes[0].primitives[0].position.size(), 3u);
        EXPECT_EQ(scene->meshes[0].primitives[0].position[1].x, 2);
    }
}

TEST_F(Draco, WhatTheMeshLacksIsNamed) {
    const Packed packed = pack(*sheet(4), draco::MESH_EDGEBREAKER_ENCODING);
    json root = sceneOf(packed);
    compressed(root)["attributes"]["NORMAL"] = 9;
    expectRefused(root, packed.bytes, "lacks the attribute that is to be its NORMAL");
    for (const char* name : {"POSITION", "TEXCOORD_0"}) {
        root = sceneOf(packed);
        compressed(root)["attributes"].erase(name);
        expectRefused(root, packed.bytes, std::string("lacks the attribute that is to be its ") + name);
    }
    // Zeros that nobody draws are no lack.
    root = sceneOf(packed);
    root["accessors"].push_back({{"componentType", 5121}, {"count", packed.points}, {"type", "VEC4"}});
    root["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = 5;
    const auto zeros = read(root, packed.bytes);
    ASSERT_TRUE(zeros) << zeros.error().line();
    expectSheet(*zeros, 2 * 4 * 4);
    root = sceneOf(packed);
    root["accessors"][1]["type"] = "VEC4";
    expectRefused(root, packed.bytes, "NORMAL is to be VEC4, its Draco data has 3 components");
    root = sceneOf(packed);
    compressed(root)["bufferView"] = 7;
    expectRefused(root, packed.bytes, "names no buffer view");
    root = sceneOf(packed);
    root["meshes"][0]["primitives"][0]["mode"] = 1;
    expectRefused(root, packed.bytes, "has mode 1");
}

TEST_F(Draco, CountsOfTheFileThatDifferFromTheMeshAreAFaultThatIsPassedOver) {
    const Packed packed = pack(*sheet(4), draco::MESH_EDGEBREAKER_ENCODING);
    json root = sceneOf(packed);
    root["accessors"][4]["count"] = 3;
    root["accessors"][0]["count"] = 100000000;
    const auto scene = read(root, packed.bytes);
    ASSERT_TRUE(scene) << scene.error().line();
    expectSheet(*scene, 2 * 4 * 4);
    ASSERT_EQ(scene->notes.size(), 1u);
    EXPECT_NE(scene->notes[0].find("faults passed over: "), std::string::npos) << scene->notes[0];
    ReadSettings strict;
    strict.isStrict = true;
    EXPECT_FALSE(read(root, packed.bytes, strict));
}

/// The same data with other counts at its head: of the edgebreaker's form vertices and triangles, of the other
/// triangles and vertices.
std::string withCounts(const std::string& bytes, int method, uint32_t first, uint32_t second) {
    size_t at = method == draco::MESH_EDGEBREAKER_ENCODING ? 12 : 11;
    std::string out = bytes.substr(0, at);
    for (uint32_t v : {first, second}) {
        while ((bytes[at] & 0x80) != 0) ++at;
        ++at;
        for (; v >= 0x80; v >>= 7) out += static_cast<char>(v | 0x80);
        out += static_cast<char>(v);
    }
    return out + bytes.substr(at);
}

long peakKilobytes() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

TEST_F(Draco, DataThatLiesAboutItsSizeIsRefusedBeforeMemoryIsTaken) {
    for (const int method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
        const Packed packed = pack(*sheet(6), method);
        ASSERT_EQ(withCounts(packed.bytes, method, 0, 0).size(), withCounts(packed.bytes, method, 1, 1).size());
        const long before = peakKilobytes();
        for (const auto& [first, second] :
             {std::pair{0x20000000u, 0x40000000u}, {0x40000000u, 0x20000000u}, {77u, 0x50000000u}, {0x50000000u, 77u}})
            expectRefused(sceneOf(packed), withCounts(packed.bytes, method, first, second), "bytes cannot be");
        // Other numbers than are there.
        for (const auto& [first, second] : {std::pair{30u, 60u}, {60u, 90u}, {1000u, 1900u}, {1u, 1u}, {0u, 0u}})
            EXPECT_FALSE(read(sceneOf(packed), withCounts(packed.bytes, method, first, second)));
        EXPECT_LT(peakKilobytes() - before, 64 << 10);
    }
    // What is true, but more than may be taken.
    const Packed packed = pack(*sheet(300), draco::MESH_EDGEBREAKER_ENCODING);
    ReadSettings little;
    little.memoryBytes = uint64_t{16} << 20;
    const auto scene = read(sceneOf(packed), packed.bytes, little);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().kind, ErrorKind::budget) << scene.error().line();
    EXPECT_NE(scene.error().line().find("--memory"), std::string::npos) << scene.error().line();
    EXPECT_TRUE(read(sceneOf(packed), packed.bytes));
}

TEST_F(Draco, WhatGltfDoesNotAllowOfDracoIsNamed) {
    const Packed packed = pack(*sheet(4), draco::MESH_EDGEBREAKER_ENCODING);
    const auto with = [&](size_t at, char value) {
        std::string bytes = packed.bytes;
        bytes[at] = value;
        return bytes;
    };
    expectRefused(sceneOf(packed), with(0, 'd'), "are no Draco data");
    expectRefused(sceneOf(packed), with(6, 1), "has version 2.1");
    expectRefused(sceneOf(packed), with(7, 0), "is no mesh of triangles");
    expectRefused(sceneOf(packed), with(10, '\x80'), "has metadata");
    expectRefused(sceneOf(packed), with(8, 9), "is damaged");
}

TEST_F(Draco, EveryTruncationAndAnyDamageEndsInASceneOrALine) {
    Rng rng(5);
    ReadSettings modest;
    modest.memoryBytes = uint64_t{256} << 20;
    for (const int method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
        const Packed packed = pack(*sheet(5), method);
        const json whole = sceneOf(packed);
        for (size_t length = 1; length < packed.bytes.size(); ++length) {
            json root = whole;  // the view ends where the data does
            root["bufferViews"][0]["byteLength"] = root["buffers"][0]["byteLength"] = length;
            const auto scene = read(root, packed.bytes.substr(0, length), modest);
            if (scene) continue;  // (the last bytes may stand for zeros)
            EXPECT_EQ(scene.error().line().find('\n'), std::string::npos) << scene.error().line();
            EXPECT_NE(scene.error().line().find("Draco data"), std::string::npos) << scene.error().line();
        }
        json half = whole;
        half["bufferViews"][0]["byteLength"] = half["buffers"][0]["byteLength"] = packed.bytes.size() / 2;
        expectRefused(half, packed.bytes.substr(0, packed.bytes.size() / 2), "damaged");
        for (int round = 0; round < 700; ++round) {
            std::string bytes = packed.bytes;
            for (uint64_t n = 1 + rng.below(3); n > 0; --n)
                bytes[rng.below(bytes.size())] = static_cast<char>(rng.below(256));
            const auto scene = read(whole, bytes, modest);
            if (!scene) {
                ASSERT_EQ(scene.error().line().find('\n'), std::string::npos) << scene.error().line();
                continue;
            }
            (void)meshBounds(*scene);
            ASSERT_TRUE(triangleSource(*scene, placements(*scene)).read([](const lod::TriangleMesh&) -> Result<void> {
                return {};
            }));
        }
    }
}

TEST_F(Draco, TheProgramSaysWhereInOneLine) {
    const Packed packed = pack(*sheet(6), draco::MESH_EDGEBREAKER_ENCODING);
    spit(folder_ / "a.gltf", sceneOf(packed).dump());
    spit(folder_ / "mesh.drc", packed.bytes);
    EXPECT_EQ(test::runProgram(folder_, "info a.gltf").code, 0);
    std::string damaged = packed.bytes;
    for (size_t i = packed.bytes.size() / 4; i < damaged.size(); ++i) damaged[i] = '\0';
    spit(folder_ / "mesh.drc", damaged);
    test::expectOneLine(test::runProgram(folder_, "info a.gltf"), 3, {"a.gltf: /meshes/0/primitives/0", "Draco"});
}

}  // namespace
}  // namespace stipple::scene
