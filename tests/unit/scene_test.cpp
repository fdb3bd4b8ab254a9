// glTF scenes: containers, graphs, primitives of every mode, compression, and surfels.
#include "engine/scene/scene.h"

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "engine/base/rng.h"
#include "engine/scene/surfels.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using nlohmann::json;

/// A file under construction: JSON and one buffer.
struct Draft {
    json root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};
    std::vector<uint8_t> bytes;

    template <typename T>
    size_t view(const std::vector<T>& values) {
        while (bytes.size() % 4 != 0) bytes.push_back(0);
        const size_t at = bytes.size();
        bytes.resize(at + values.size() * sizeof(T));
        std::memcpy(bytes.data() + at, values.data(), values.size() * sizeof(T));
        root["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", values.size() * sizeof(T)}});
        return root["bufferViews"].size() - 1;
    }
    size_t accessor(size_t view, int component, size_t count, const char* type) {
        root["accessors"].push_back(
            {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
        return root["accessors"].size() - 1;
    }
    size_t positions(const std::vector<glm::vec3>& p) {
        glm::vec3 lo = p[0], hi = p[0];
        for (const glm::vec3& v : p) {
            lo = glm::min(lo, v);
            hi = glm::max(hi, v);
        }
        const size_t a = accessor(view(p), 5126, p.size(), "VEC3");
        root["accessors"][a]["min"] = {lo.x, lo.y, lo.z};
        root["accessors"][a]["max"] = {hi.x, hi.y, hi.z};
        return a;
    }
    void write(const std::string& path) {
        while (bytes.size() % 4 != 0) bytes.push_back(0);
        if (!bytes.empty()) root["buffers"] = {{{"byteLength", bytes.size()}}};
        std::string text = root.dump();
        while (text.size() % 4 != 0) text += ' ';
        std::string out = "glTF";
        const auto word = [&](size_t v) {
            const auto w = static_cast<uint32_t>(v);
            out.append(reinterpret_cast<const char*>(&w), 4);
        };
        word(2);
        word(12 + 8 + text.size() + (bytes.empty() ? 0 : 8 + bytes.size()));
        word(text.size());
        out += "JSON" + text;
        if (!bytes.empty()) {
            word(bytes.size());
            out += std::string("BIN\0", 4) + std::string(bytes.begin(), bytes.end());
        }
        std::ofstream(path, std::ios::binary) << out;
    }
};

const std::vector<glm::vec3> kFive{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 2, 0}};

TEST(Gltf, EveryModeIsUnrolled) {
    const test::TempFolder folder;
    const std::vector<std::vector<uint32_t>> expected{{0, 1, 2, 3, 4},
                                                      {0, 1, 2, 3},
                                                      {0, 1, 1, 2, 2, 3, 3, 4, 4, 0},
                                                      {0, 1, 1, 2, 2, 3, 3, 4},
                                                      {0, 1, 2},
                                                      {0, 1, 2, 2, 1, 3, 2, 3, 4},
                                                      {1, 2, 0, 2, 3, 0, 3, 4, 0}};
    for (int mode = 0; mode <= 6; ++mode) {
        Draft d;
        const size_t p = d.positions(kFive);
        d.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", p}}}, {"mode", mode}}}}}};
        d.root["nodes"] = {{{"mesh", 0}}};
        d.write(folder / "a.glb");
        const auto scene = readGltf(folder / "a.glb");
        ASSERT_TRUE(scene) << scene.error().line();
        EXPECT_EQ(scene->meshes[0].primitives[0].indices, expected[static_cast<size_t>(mode)]) << "mode " << mode;
        EXPECT_EQ(scene->meshes[0].primitives[0].position, kFive);
    }
}

TEST(Gltf, TransformsNestAndMirrorAndInstance) {
    const test::TempFolder folder;
    Draft d;
    const size_t p = d.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    const size_t t = d.accessor(d.view(std::vector<glm::vec3>{{0, 0, 0}, {0, 0, 10}}), 5126, 2, "VEC3");
    d.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing", "KHR_lights_punctual"};
    d.root["extensions"]["KHR_lights_punctual"]["lights"] = {
        {{"type", "spot"}, {"spot", {{"outerConeAngle", 0.5}}}, {"color", {1, 0.5, 0}}}};
    d.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", p}}}}}}}};
    d.root["nodes"] = {{{"translation", {1e7, 0, 0}}, {"children", {1, 2}}},
                       {{"scale", {-1, 2, 1}},
                        {"rotation", {0, 0, 0.7071067811865476, 0.7071067811865476}},
                        {"mesh", 0},
                        {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", t}}}}}}}},
                       {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}}};
    d.write(folder / "a.glb");
    const auto scene = readGltf(folder / "a.glb");
    ASSERT_TRUE(scene) << scene.error().line();
    ASSERT_EQ(scene->nodes.size(), 3u);
    EXPECT_EQ(scene->nodes[1].instances.size(), 2u);
    EXPECT_EQ(scene->nodes[2].light, 0);
    EXPECT_EQ(scene->lights[0].kind, LightKind::spot);
    EXPECT_FLOAT_EQ(scene->lights[0].colour.g, 0.5f);
    // (1,0,0) -> scale (-1,0,0) -> rotate 90 degrees about z (0,-1,0); (0,1,0) -> (0,2,0) -> (-2,0,0); then 1e7 along
    // x.
    const Box box = meshBounds(*scene);
    EXPECT_NEAR(box.least.x, 1e7 - 2, 1e-8);
    EXPECT_NEAR(box.greatest.x, 1e7, 1e-8);
    EXPECT_NEAR(box.least.y, -1, 1e-12);
    EXPECT_NEAR(box.greatest.z, 10, 1e-12);
}

TEST(Gltf, AHundredThousandNodesDeepIsReadAndALoopRefused) {
    const test::TempFolder folder;
    Draft d;
    const size_t p = d.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    d.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", p}}}}}}}};
    json nodes = json::array();
    constexpr size_t kDeep = 100'000;
    for (size_t i = 0; i + 1 < kDeep; ++i) nodes.push_back({{"children", {i + 1}}, {"translation", {0.5, 0, 0}}});
    nodes.push_back({{"mesh", 0}});
    d.root["nodes"] = nodes;
    d.write(folder / "a.glb");
    const auto scene = readGltf(folder / "a.glb");
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(meshBounds(*scene).least.x, 0.5 * (kDeep - 1));
    d.root["nodes"][kDeep - 1]["children"] = {5};
    d.write(folder / "a.glb");
    const auto loop = readGltf(folder / "a.glb");
    ASSERT_FALSE(loop);
    EXPECT_NE(loop.error().line().find("/nodes/"), std::string::npos) << loop.error().line();
}

TEST(Gltf, SparseQuantisedAndCompressedDataAreUnpacked) {
    const test::TempFolder folder;
    Draft d;
    // Positions as normalised 16-bit, compressed by meshoptimizer; indices compressed; one position replaced.
    std::vector<std::array<int16_t, 4>> quantised;
    for (const glm::vec3& p : kFive)
        quantised.push_back({static_cast<int16_t>(p.x * 16383), static_cast<int16_t>(p.y * 16383), 0, 0});
    std::vector<uint8_t> coded(meshopt_encodeVertexBufferBound(5, 8));
    coded.resize(meshopt_encodeVertexBuffer(coded.data(), coded.size(), quantised.data(), 5, 8));
    const size_t codedView = d.view(coded);
    const json place = d.root["bufferViews"][codedView];
    d.root["bufferViews"][codedView] = {{"buffer", 1},
                                        {"byteLength", 40},
                                        {"byteStride", 8},
                                        {"extensions",
                                         {{"EXT_meshopt_compression",
                                           {{"buffer", 0},
                                            {"byteOffset", place["byteOffset"]},
                                            {"byteLength", coded.size()},
                                            {"byteStride", 8},
                                            {"count", 5},
                                            {"mode", "ATTRIBUTES"}}}}}};
    const size_t a = d.accessor(codedView, 5122, 5, "VEC3");
    d.root["accessors"][a]["normalized"] = true;
    d.root["accessors"][a]["min"] = {0, 0, 0};
    d.root["accessors"][a]["max"] = {32767, 32766, 0};
    const size_t which = d.view(std::vector<uint8_t>{2}), what = d.view(std::vector<int16_t>{32767, 0, 0, 0});
    d.root["bufferViews"][what]["byteLength"] = 6;
    d.root["accessors"][a]["sparse"] = {{"count", 1},
                                        {"indices", {{"bufferView", which}, {"componentType", 5121}}},
                                        {"values", {{"bufferView", what}}}};
    d.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", a}}}, {"mode", 0}}}}}};
    d.root["nodes"] = {{{"mesh", 0}}};
    d.root["extensionsUsed"] = d.root["extensionsRequired"] = {"KHR_mesh_quantization", "EXT_meshopt_compression"};
    while (d.bytes.size() % 4 != 0) d.bytes.push_back(0);
    Draft copy = d;
    copy.write(folder / "a.glb");
    // The second buffer is the proxy for readers without the extension.
    d.root["buffers"] = {{{"byteLength", d.bytes.size()}},
                         {{"byteLength", 40}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
    const std::vector<uint8_t> bytes = std::exchange(d.bytes, {});
    std::string text = d.root.dump();
    while (text.size() % 4 != 0) text += ' ';
    std::string out = "glTF";
    const auto word = [&](size_t v) {
        const auto w = static_cast<uint32_t>(v);
        out.append(reinterpret_cast<const char*>(&w), 4);
    };
    word(2);
    word(28 + text.size() + bytes.size());
    word(text.size());
    out += "JSON" + text;
    word(bytes.size());
    out += std::string("BIN\0", 4) + std::string(bytes.begin(), bytes.end());
    std::ofstream(folder / "a.glb", std::ios::binary) << out;
    const auto scene = readGltf(folder / "a.glb");
    ASSERT_TRUE(scene) << scene.error().line();
    const auto& p = scene->meshes[0].primitives[0].position;
    EXPECT_NEAR(p[1].x, 0.5f, 1e-4);
    EXPECT_FLOAT_EQ(p[2].x, 1.0f) << "the replaced one";
    EXPECT_NEAR(p[4].y, 1.0f, 1e-4);
}

TEST(Gltf, BrokenFilesSayWhere) {
    const test::TempFolder folder;
    const auto refusal = [&](const auto& change) {
        Draft d;
        const size_t p = d.positions(kFive);
        const size_t i = d.accessor(d.view(std::vector<uint16_t>{0, 1, 2, 2, 3, 4}), 5123, 6, "SCALAR");
        d.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", p}}}, {"indices", i}}}}}};
        d.root["nodes"] = {{{"mesh", 0}}};
        change(d);
        d.write(folder / "a.glb");
        ReadSettings strict;  // (what can be drawn all the same is only noted otherwise)
        strict.isStrict = true;
        const auto scene = readGltf(folder / "a.glb", strict);
        return scene ? std::string("none") : scene.error().line();
    };
    EXPECT_EQ(refusal([](Draft&) {}), "none");
    const auto expect = [&](const std::string& line, const char* text) {
        EXPECT_NE(line.find(text), std::string::npos) << line;
    };
    expect(refusal([](Draft& d) { d.root["accessors"][1]["count"] = 7; }), "/accessors/1");
    expect(refusal([](Draft& d) { d.bytes[d.root["bufferViews"][1]["byteOffset"].get<size_t>()] = 9; }), "vertex 9");
    expect(refusal([](Draft& d) { d.root["nodes"][0]["mesh"] = 3; }), "/nodes/0/mesh");
    expect(refusal([](Draft& d) { d.root["nodes"][0]["scale"] = {1, 2}; }), "/nodes/0/scale");
    expect(refusal([](Draft& d) { d.root["extensionsRequired"] = d.root["extensionsUsed"] = {"EXT_of_nobody"}; }),
           "EXT_of_nobody");
    expect(refusal([](Draft& d) {
               const float nan = std::nanf("");
               std::memcpy(d.bytes.data(), &nan, 4);
           }),
           "not finite");
    expect(refusal([](Draft& d) { d.root["bufferViews"][0]["byteLength"] = uint64_t{1} << 60; }), "/bufferViews/0");
}

TEST(Obj, PolygonsMaterialsAndBrokenFacesAreRead) {
    const test::TempFolder folder;
    std::ofstream(folder / "a.mtl") << "newmtl red\nKd 1 0 0\nnewmtl leaf\nKd 1 1 1\nmap_Kd none.png\n";
    std::ofstream(folder / "a.obj")
        << "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\n"
           "usemtl red\nf 1 2 3 4\nusemtl leaf\nf -5/1 -4/2 -1/3\nf 1 2 99\n";
    const auto scene = readObj(folder / "a.obj");
    ASSERT_TRUE(scene) << scene.error().line();
    size_t triangles = 0;
    for (const Primitive& p : scene->meshes[0].primitives) {
        triangles += p.indices.size() / 3;
        ASSERT_GE(p.material, 0);
        if (scene->materials[static_cast<size_t>(p.material)].name == "red") EXPECT_EQ(p.indices.size(), 6u);
    }
    EXPECT_EQ(triangles, 3u) << "a quadrangle and a triangle; the face with vertex 99 is dropped";
    EXPECT_EQ(scene->materials[0].baseColour, glm::vec4(1, 0, 0, 1));
    EXPECT_GE(scene->notes.size(), 2u) << "the texture that is missing, the face that is broken";
    std::ofstream(folder / "empty.obj") << "v 0 0 0\n";
    EXPECT_FALSE(readObj(folder / "empty.obj"));
    EXPECT_FALSE(readObj(folder / "none.obj"));
}

/// A square of side 2 in the plane z = 0, split in two triangles, placed twice.
Scene squares() {
    Scene s;
    Primitive p;
    p.position = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    p.indices = {0, 1, 2, 0, 2, 3};
    p.uv = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    p.material = 0;
    s.meshes.push_back({"square", {p}});
    Material m;
    m.baseColourTexture.texture = 0;
    s.materials.push_back(m);
    s.textures.push_back({0, Wrap::repeat, Wrap::repeat});
    Node n;
    n.mesh = 0;
    n.instances = {glm::dmat4(1), glm::dmat4(1)};
    n.instances[1][0][0] = -1;  // mirrored
    n.instances[1][3] = {5, 0, 0, 1};
    s.nodes.push_back(n);
    return s;
}

std::vector<lod::PointBlock> take(const lod::PointSource& source) {
    std::vector<lod::PointBlock> blocks;
    const auto read = source.openPart(0);
    for (;;) {
        lod::PointBlock block;
        if (*(*read)(block, 1000) == 0) return blocks;
        blocks.push_back(block);
    }
}

TEST(Surfels, CoverTheMeshEvenlyWithItsColoursAndSides) {
    // Left half red, right half blue.
    DecodedImage image{2, 1, {0xff0000ffu, 0xffff0000u}};
    const auto source = sampleSurfels(squares(), {image}, {20'000});
    ASSERT_TRUE(source) << source.error().line();
    EXPECT_NEAR(static_cast<double>(source->info.points), 20'000, 4);
    std::array<std::array<int, 8>, 8> grid{};
    size_t red = 0, count = 0;
    for (const auto& block : take(*source))
        for (size_t i = 0; i < block.position.size(); ++i) {
            const glm::dvec3 p = block.position[i];
            EXPECT_EQ(p.z, 0);
            const bool second = p.x > 2;
            ASSERT_FLOAT_EQ(block.normal[i].z, 1) << "a mirrored square faces the same way";
            if (second) continue;
            ++grid.at(static_cast<size_t>((p.x + 1) * 3.9999)).at(static_cast<size_t>((p.y + 1) * 3.9999));
            ++count;
            if ((block.colour[i] & 255u) > (block.colour[i] >> 16 & 255u)) ++red;
        }
    EXPECT_NEAR(static_cast<double>(count), 10'000, 100);
    EXPECT_NEAR(static_cast<double>(red), 5'000, 200);
    for (const auto& row : grid)
        for (const int cell : row) EXPECT_NEAR(cell, 10'000 / 64.0, 20);
}

/// Of triangles that are smaller than samples are apart, in any order: no place is left out.
TEST(Surfels, SmallTrianglesInAnyOrderAreSampledEvenly) {
    constexpr uint32_t kSide = 128, kCells = 16;
    Scene scene = squares();
    Primitive p;
    p.material = 0;
    std::vector<uint32_t> quads(kSide * kSide);
    for (uint32_t i = 0; i < quads.size(); ++i) quads[i] = i;
    Rng rng(7);
    for (size_t i = quads.size(); i > 1; --i) std::swap(quads[i - 1], quads[rng.below(i)]);
    for (uint32_t y = 0; y <= kSide; ++y)
        for (uint32_t x = 0; x <= kSide; ++x) p.position.emplace_back(glm::vec2(x, y) / static_cast<float>(kSide), 0);
    for (const uint32_t q : quads) {
        const uint32_t at = q / kSide * (kSide + 1) + q % kSide, above = at + kSide + 1;
        for (const uint32_t i : {at, at + 1, above, above, at + 1, above + 1}) p.indices.push_back(i);
    }
    scene.meshes[0].primitives = {p};
    scene.nodes[0].instances.clear();
    const auto source = sampleSurfels(scene, {DecodedImage{}}, {4 * kCells * kCells});
    ASSERT_TRUE(source) << source.error().line();
    glm::dvec2 least(1e300), most(-1e300);
    std::vector<glm::dvec2> places;
    for (const auto& block : take(*source))
        for (const glm::dvec3& at : block.position) {
            places.emplace_back(at);
            least = glm::min(least, glm::dvec2(at));
            most = glm::max(most, glm::dvec2(at));
        }
    std::vector<int> cells(kCells * kCells, 0);
    for (const glm::dvec2& at : places) {
        const glm::dvec2 in =
            glm::min((at - least) / (most - least) * static_cast<double>(kCells), glm::dvec2(kCells - 1));
        ++cells[static_cast<size_t>(in.y) * kCells + static_cast<size_t>(in.x)];
    }
    for (const int count : cells) {
        EXPECT_GE(count, 2);  // of 4; in the order of the file some have 1, and some 9
        EXPECT_LE(count, 7);
    }
}

TEST(Surfels, ACoarseSamplingSeesTheMeanOfTheTexture) {
    DecodedImage image{64, 64, {}};
    for (uint32_t i = 0; i < 64 * 64; ++i) image.rgba.push_back((i % 64 + i / 64) % 2 == 0 ? 0xffffffffu : 0xff000000u);
    const auto source = sampleSurfels(squares(), {image}, {200});
    ASSERT_TRUE(source);
    // The linear mean of black and white is 188 in sRGB.
    for (const auto& block : take(*source))
        for (const uint32_t c : block.colour) ASSERT_NEAR(static_cast<double>(c & 255u), 188, 25);
}

/// `side`^2 points over a texture, each in the middle of its share.
Scene texturedPoints(uint32_t side) {
    Scene scene = squares();
    Primitive p;
    p.kind = PrimitiveKind::points;
    p.material = 0;
    p.uv.resize(1);
    for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x) {
            const glm::vec2 uv = (glm::vec2(x, y) + 0.5f) / static_cast<float>(side);
            p.indices.push_back(static_cast<uint32_t>(p.position.size()));
            p.position.emplace_back(uv, 0);
            p.normal.emplace_back(0, 0, 1);
            p.uv[0].push_back(uv);
        }
    scene.meshes[0].primitives = {p};
    scene.nodes[0].instances.clear();
    return scene;
}

/// Points take their colours from textures: texels where they lie as densely, means of what lies between them where
/// they do not; times their own colour and the material's.
TEST(Surfels, PointsHaveTheColoursOfTheirTextures) {
    DecodedImage image{64, 64, {}};
    for (uint32_t i = 0; i < 64 * 64; ++i) image.rgba.push_back((i % 64 + i / 64) % 2 == 0 ? 0xffffffffu : 0xff000000u);
    const auto coloursOf = [&](const Scene& scene) {
        std::vector<uint32_t> colours;
        const auto source = sampleSurfels(scene, {image}, {0});
        EXPECT_TRUE(source);
        for (const auto& block : take(*source)) colours.insert(colours.end(), block.colour.begin(), block.colour.end());
        return colours;
    };
    Scene fine = texturedPoints(64);
    const std::vector<uint32_t> texels = coloursOf(fine);
    ASSERT_EQ(texels.size(), 4096u);
    for (size_t i = 0; i < texels.size(); ++i) EXPECT_EQ(texels[i] & 0xffffffu, image.rgba[i] & 0xffffffu);
    // Every sixth texel or so, by itself, would be black or white.
    for (const uint32_t c : coloursOf(texturedPoints(11))) EXPECT_NEAR(static_cast<double>(c & 255u), 188, 25);
    fine.materials[0].baseColour = {1, 0, 0, 1};
    fine.meshes[0].primitives[0].colour.assign(4096, {0.5f, 1, 1, 1});
    const std::vector<uint32_t> tinted = coloursOf(fine);
    EXPECT_EQ(tinted[0] & 0xffffffu, 188u);
    EXPECT_EQ(tinted[1] & 0xffffffu, 0u);
    fine.meshes[0].primitives[0].uv.clear();  // the control
    EXPECT_EQ(coloursOf(fine)[1] & 0xffffffu, 188u);
}

TEST(Surfels, MaskedPlacesAreLeftOutAndEmptyMeshesRefused) {
    Scene scene = squares();
    scene.materials[0].alphaMode = AlphaMode::mask;
    DecodedImage image{2, 1, {0x000000ffu, 0xffff0000u}};
    const auto source = sampleSurfels(scene, {image}, {2000});
    ASSERT_TRUE(source);
    EXPECT_NEAR(static_cast<double>(source->info.points), 1000, 60);
    scene.nodes[0].isVisible = false;
    EXPECT_FALSE(sampleSurfels(scene, {image}, {2000}));
}

}  // namespace
}  // namespace stipple::scene
