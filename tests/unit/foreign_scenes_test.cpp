// Scene files of other programs: what can be drawn is drawn, with a note; what they name is read only where it may be;
// what they promise is checked before memory is taken.
#include <gtest/gtest.h>
#include <meshoptimizer.h>
#include <sys/stat.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "engine/scene/camera.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using nlohmann::json;
using test::spit;
using test::TempFolder;

/// A triangle whose numbers lie in triangle.bin, with a textured material.
json triangle() {
    return json::parse(R"({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "triangle.bin"}]})");
}

std::string floats(std::initializer_list<float> values) {
    return std::string(reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(float));
}

class ForeignScenes : public testing::Test {
  protected:
    void SetUp() override { spit(folder_ / "triangle.bin", floats({0, 0, 0, 1, 0, 0, 0, 1, 0})); }

    Result<Scene> read(const json& root, const ReadSettings& settings = {}) {
        spit(folder_ / "a.gltf", root.dump());
        return readGltf(folder_ / "a.gltf", settings);
    }
    static std::string notesOf(const Scene& scene) {
        std::string all;
        for (const std::string& note : scene.notes) all += note + "\n";
        return all;
    }
    static size_t trianglesOf(const Scene& scene) { return triangleSource(scene, placements(scene)).triangles; }

    TempFolder folder_;
};

/// What others pass over, of sizes and of how things are written: views, meshes and accessors of nothing ...
const std::vector<std::pair<const char*, std::function<void(json&)>>>& faultsOfForm() {
    static const std::vector<std::pair<const char*, std::function<void(json&)>>> faults{
        {"a buffer view of nothing",
         [](json& j) {
             j["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 36}, {"byteLength", 0}});
         }},
        {"an accessor of nothing",
         [](json& j) {
             j["accessors"].push_back({{"bufferView", 0}, {"componentType", 5126}, {"count", 0}, {"type", "VEC3"}});
             j["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 1}, {"NORMAL", 1}}}, {"indices", 2}});
             j["accessors"].push_back({{"componentType", 5125}, {"count", 0}, {"type", "SCALAR"}});
         }},
        {"a mesh of nothing",
         [](json& j) {
             j["meshes"].push_back({{"primitives", json::array()}});
         }},
        {"a stride of 0", [](json& j) { j["bufferViews"][0]["byteStride"] = 0; }},
        {"members that are null",
         [](json& j) {
             j["meshes"][0]["primitives"][0]["indices"] = j["nodes"][0]["matrix"] = j["nodes"][0]["extensions"] =
                 nullptr;
             j["accessors"][0]["byteOffset"] = j["accessors"][0]["normalized"] = nullptr;
         }},
        {"a version that is a number", [](json& j) { j["asset"]["version"] = 2.0; }},
        {"a buffer that is longer than its file", [](json& j) { j["buffers"][0]["byteLength"] = 40; }},
        {"what things are, required",
         [](json& j) { j["extensionsUsed"] = j["extensionsRequired"] = {"EXT_structural_metadata"}; }}};
    return faults;
}

TEST_F(ForeignScenes, FaultsThatChangeNothingDrawableAreNotedAndOnlyAStrictReaderRefusesThem) {
    std::vector<std::pair<const char*, std::function<void(json&)>>> faults{
        {"a factor above 1",
         [](json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][0] = 1.00000012; }},
        {"empty extensions", [](json& j) { j["materials"][0]["extensions"] = json::object(); }},
        {"empty arrays", [](json& j) { j["images"] = j["textures"] = j["nodes"][0]["children"] = json::array(); }},
        {"joints without a common root",
         [](json& j) {
             j["nodes"].push_back({{"name", "a"}});
             j["nodes"].push_back({{"name", "b"}});
             j["skins"] = json::array({{{"joints", {1, 2}}}});
         }},
        {"a skin without joints",
         [](json& j) {
             j["skins"] = json::array({{{"joints", json::array()}}});
         }},
        {"positions without bounds", [](json& j) { j["accessors"][0].erase("min"); }},
        {"wrong bounds",
         [](json& j) {
             j["accessors"][0]["max"] = {5, 5, 5};
         }},
        {"a name that is none", [](json& j) { j["nodes"][0]["name"] = 7; }},
        {"a texture that is not there",
         [](json& j) {
             j["materials"][0]["emissiveTexture"] = {{"index", 3}};
         }},
        {"a broken animation",
         [](json& j) {
             j["animations"] = json::array({{{"channels", 3}}});
         }},
        {"a broken camera",
         [](json& j) {
             j["cameras"] = json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0}, {"znear", 1}}}}});
             j["nodes"][0]["camera"] = 0;
         }},
        {"a rotation of another length",
         [](json& j) {
             j["nodes"][0]["rotation"] = {0, 0, 0, 0.5};
         }},
        {"a rotation beyond 1",
         [](json& j) {
             j["nodes"][0]["rotation"] = {0, 0, 0, 1.0000001};
         }},
        {"unknown attributes", [](json& j) { j["meshes"][0]["primitives"][0]["attributes"]["COLOR"] = 0; }},
        {"a child of two",
         [](json& j) {
             j["nodes"].push_back({{"children", {2}}});
             j["nodes"].push_back({{"name", "c"}});
             j["nodes"][0]["children"] = {2};
         }},
        {"missing texture coordinates",
         [](json& j) {
             j["images"] = json::array({{{"uri", "gone.png"}}});
             j["textures"] = json::array({{{"source", 0}}});
             j["materials"][0]["normalTexture"] = {{"index", 0}};
         }},
        {"an extension about looks",
         [](json& j) { j["extensionsUsed"] = j["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"}; }}};
    faults.insert(faults.end(), faultsOfForm().begin(), faultsOfForm().end());
    for (const auto& [what, make] : faults) {
        json root = triangle();
        make(root);
        const auto scene = read(root);
        ASSERT_TRUE(scene) << what << ": " << scene.error().line();
        EXPECT_EQ(trianglesOf(*scene), 1u) << what;
        EXPECT_NE(notesOf(*scene).find("faults passed over:"), std::string::npos) << what << ": " << notesOf(*scene);
        ReadSettings strict;
        strict.isStrict = true;
        EXPECT_FALSE(read(root, strict)) << what;
    }
    // And a file without fault has no note.
    const auto good = read(triangle());
    ASSERT_TRUE(good) << good.error().line();
    EXPECT_EQ(notesOf(*good), "");
}

TEST_F(ForeignScenes, ContainersThatOtherViewersOpenAreRead) {
    const auto word = [](size_t v) {
        const auto w = static_cast<uint32_t>(v);
        return std::string(reinterpret_cast<const char*>(&w), 4);
    };
    const std::string mark = "\xef\xbb\xbf", points = floats({0, 0, 0, 1, 0, 0, 0, 1, 0});
    const auto chunk = [&](const char* type, const std::string& body) {
        return word(body.size()) + std::string(type, 4) + body;
    };
    // `more`: bytes that its head claims beyond those that are there.
    const auto glb = [&](const std::string& text, const std::string& rest, int more = 0) {
        const std::string body = chunk("JSON", text) + rest;
        return "glTF" + word(2) + word(12 + body.size() + static_cast<size_t>(more)) + body;
    };
    json inside = triangle();
    inside["buffers"][0].erase("uri");
    std::string text = inside.dump(), odd = inside.dump();
    while (text.size() % 4 != 0) text += ' ';
    while (odd.size() % 4 != 3) odd += ' ';
    const std::string bin = chunk("BIN\0", points);
    const json latin = triangle();
    const std::vector<std::tuple<const char*, std::string, std::string>> files{
        {"a.gltf", mark + triangle().dump(), "byte order mark"},
        {"a.glb", glb(mark + text + " ", bin), "byte order mark"},
        {"a.glb", glb(odd, bin), "not a multiple of 4"},
        {"a.glb", glb(text, chunk("MORE", "....") + bin), "must be the second"},
        {"a.glb", glb(text, bin + chunk("BIN\0", "....")), "second binary chunk"},
        {"a.gltf", triangle().dump() + std::string(3, '\0'), "ends with zeros"},
        {"a.glb", glb(text + std::string(4, '\0'), bin), "ends with zeros"},
        {"a.gltf",
         latin.dump(-1, ' ', false, json::error_handler_t::ignore).replace(0, 1, "{\"extras\":\"M\xfchle \xe9\","),
         "not UTF-8"},
        {"a.glb", glb(text, bin, 5), "says it has"},
        {"a.glb", glb(text, bin, -3), "chunk 1 ends later"},
        {"a.glb", glb(text, bin + chunk("MORE", "....")), ""}};
    for (const auto& [name, bytes, note] : files) {
        spit(folder_ / name, bytes);
        const auto scene = readGltf(folder_ / name);
        ASSERT_TRUE(scene) << note << ": " << scene.error().line();
        EXPECT_EQ(trianglesOf(*scene), 1u) << note;
        EXPECT_NE(notesOf(*scene).find(note), std::string::npos) << notesOf(*scene);
        EXPECT_EQ(notesOf(*scene).empty(), note.empty()) << notesOf(*scene);
        ReadSettings strict;
        strict.isStrict = true;
        EXPECT_EQ(readGltf(folder_ / name, strict).has_value(), note.empty()) << note;
    }
    // What is cut off is refused wherever that is.
    const std::string whole = glb(text, bin);
    for (size_t length = 0; length < whole.size(); ++length) {
        spit(folder_ / "a.glb", whole.substr(0, length));
        EXPECT_FALSE(readGltf(folder_ / "a.glb")) << length;
    }
}

TEST_F(ForeignScenes, WhatMattersOfThoseFaultsIsRefused) {
    const auto refusal = [&](const auto& change) {
        json root = triangle();
        change(root);
        const auto scene = read(root);
        return scene ? std::string("none") : scene.error().line();
    };
    const auto expect = [&](const std::string& line, const std::string& text) {
        EXPECT_NE(line.find(text), std::string::npos) << line;
    };
    spit(folder_ / "short.bin", floats({0, 0, 0, 1, 0, 0, 0, 1}));
    expect(refusal([](json& j) { j["buffers"][0]["uri"] = "short.bin"; }), "reaches beyond the 32 bytes of its buffer");
    expect(refusal([](json& j) { j["bufferViews"][0]["byteLength"] = 0; }),
           "/accessors/0: 3 elements at 0 reach beyond");
    expect(refusal([](json& j) { j["bufferViews"][0]["byteStride"] = 260; }),
           "/accessors/0: 3 elements at 0 reach beyond");
    expect(refusal([](json& j) { j["bufferViews"][0]["byteStride"] = -4; }), "/bufferViews/0/byteStride");
    expect(refusal([](json& j) { j["bufferViews"][0]["byteLength"] = nullptr; }), "/bufferViews/0/byteLength");
    expect(refusal([](json& j) { j["asset"]["version"] = 3; }), "is glTF 3.0, 2.0 is read");
    expect(refusal([](json& j) { j["accessors"] = {{"a", j["accessors"][0]}}; }), "is glTF 1.0, 2.0 is read");
    // A stride beyond what is allowed is what it says, and no instances are none.
    std::string wide = floats({0, 0, 0});
    for (const std::string& p : {floats({1, 0, 0}), floats({0, 1, 0})}) wide += std::string(248, '?') + p;
    spit(folder_ / "wide.bin", wide);
    json root = triangle();
    root["buffers"][0] = {{"uri", "wide.bin"}, {"byteLength", wide.size()}};
    root["bufferViews"][0] = {{"buffer", 0}, {"byteLength", wide.size()}, {"byteStride", 260}};
    auto scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(scene->meshes[0].primitives[0].position[2], glm::vec3(0, 1, 0));
    root = triangle();
    root["accessors"].push_back({{"componentType", 5126}, {"count", 0}, {"type", "VEC3"}});
    root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = 1;
    scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(trianglesOf(*scene), 0u);
}

TEST_F(ForeignScenes, MeshoptUnderItsNewerNameIsReadAndWhatThatAddsIsNamed) {
    const std::array<float, 9> points{0, 0, 0, 1, 0, 0, 0, 1, 0};
    std::vector<unsigned char> coded(meshopt_encodeVertexBufferBound(3, 12));
    coded.resize(meshopt_encodeVertexBuffer(coded.data(), coded.size(), points.data(), 3, 12));
    constexpr const char* kName = "KHR_meshopt_compression";
    json root = triangle();
    root["extensionsUsed"] = root["extensionsRequired"] = {kName};
    root["buffers"] = {{{"byteLength", coded.size()}, {"uri", "coded.bin"}},
                       {{"byteLength", 36}, {"extensions", {{kName, {{"fallback", true}}}}}}};
    const json how{
        {"buffer", 0}, {"byteLength", coded.size()}, {"byteStride", 12}, {"count", 3}, {"mode", "ATTRIBUTES"}};
    root["bufferViews"][0] = {{"buffer", 1}, {"byteLength", 36}, {"byteStride", 12}, {"extensions", {{kName, how}}}};
    const auto readWith = [&] {
        spit(folder_ / "coded.bin", std::string(coded.begin(), coded.end()));
        return read(root);
    };
    auto scene = readWith();
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(notesOf(*scene), "");
    EXPECT_EQ(scene->meshes[0].primitives[0].position[1], glm::vec3(1, 0, 0));
    coded[0] = 0xa1;
    scene = readWith();
    ASSERT_FALSE(scene);
    EXPECT_NE(scene.error().line().find("codec 1 of KHR_meshopt_compression"), std::string::npos)
        << scene.error().line();
    root["bufferViews"][0]["extensions"][kName]["filter"] = "COLOR";
    scene = readWith();
    ASSERT_FALSE(scene);
    EXPECT_NE(scene.error().line().find("/bufferViews/0: is compressed with the filter COLOR"), std::string::npos)
        << scene.error().line();
}

TEST_F(ForeignScenes, TexturesOfGpuFormatsAreNamedOneByOneAndThoseOfWebpAreNotCalledAFault) {
    spit(folder_ / "t.ktx2", "\xabKTX 20\xbb\r\n\x1a\n and more");
    json root = triangle();
    root["extensionsUsed"] = root["extensionsRequired"] = {"KHR_texture_basisu"};
    root["images"] = json::array({{{"uri", "t.ktx2"}}});
    const json basis{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}};
    root["textures"] = json::array({basis, basis});
    const auto scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    ASSERT_EQ(scene->notes.size(), 2u) << notesOf(*scene);
    for (size_t i = 0; i < 2; ++i)
        EXPECT_EQ(scene->notes[i],
                  "texture " + std::to_string(i) + " is KTX2 (Basis), which is not read: drawn without it");
    EXPECT_TRUE(scene->images[0].bytes.empty()) << "nobody is to decode it";
    EXPECT_EQ(scene->textures[0].image, -1);
    spit(folder_ / "t.webp", "RIFF....WEBP");
    root["extensionsUsed"] = root["extensionsRequired"] = {"EXT_texture_webp"};
    root["images"] = json::array({{{"uri", "t.webp"}, {"mimeType", "image/webp"}}});
    root["textures"] = json::array({{{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}}});
    const auto webp = read(root);
    ASSERT_TRUE(webp) << webp.error().line();
    EXPECT_EQ(notesOf(*webp), "");
    EXPECT_EQ(webp->textures[0].image, 0);
}

TEST_F(ForeignScenes, ElementsThatCannotBeDrawnAreLeftOutAndCounted) {
    spit(folder_ / "triangle.bin",
         floats({0, 0, 0, 1, 0, 0, 0, 1, 0, HUGE_VALF, 0, 0}) + std::string("\0\1\2\0\1\3\0\1\77", 9));
    json root = triangle();
    root["buffers"][0]["byteLength"] = 57;
    root["bufferViews"] = {{{"buffer", 0}, {"byteLength", 48}}, {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", 9}}};
    root["accessors"][0]["count"] = 4;
    root["accessors"].push_back({{"bufferView", 1}, {"componentType", 5121}, {"count", 9}, {"type", "SCALAR"}});
    root["meshes"][0]["primitives"][0]["indices"] = 1;
    const auto scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(trianglesOf(*scene), 1u);
    EXPECT_NE(notesOf(*scene).find("2 of 3 elements"), std::string::npos) << notesOf(*scene);
}

TEST_F(ForeignScenes, AMissingTextureIsNamedAndTheMeshDrawnWithoutIt) {
    json root = triangle();
    root["images"] = json::array({{{"uri", "gone%20away.png"}}});
    root["textures"] = json::array({{{"source", 0}}});
    root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    const auto scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_NE(notesOf(*scene).find("gone away.png"), std::string::npos) << notesOf(*scene);
    EXPECT_EQ(scene->textures.at(0).image, -1);
    EXPECT_EQ(surfaceMaterials(*scene).at(0).baseTexture.texture, 0u);
}

TEST_F(ForeignScenes, DracoAndUnknownExtensionsAreTheReasonThatIsNamed) {
    json root = triangle();
    root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
    root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {
        {"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
    EXPECT_TRUE(read(root)) << "plain accessors are an alternative to it";
    root["accessors"][0].erase("bufferView");
    const auto scene = read(root);
    ASSERT_FALSE(scene);
    EXPECT_NE(scene.error().line().find("no Draco data"), std::string::npos) << scene.error().line();
    root = triangle();
    root["extensionsUsed"] = root["extensionsRequired"] = {"EXT_of_nobody"};
    const auto unknown = read(root);
    ASSERT_FALSE(unknown);
    EXPECT_NE(unknown.error().line().find("EXT_of_nobody"), std::string::npos) << unknown.error().line();
}

TEST_F(ForeignScenes, WhatLiesOutsideTheFolderIsReadOnlyWhenAskedFor) {
    std::filesystem::create_directory(folder_ / "in");
    const std::string inside = folder_ / "in/a.gltf";
    std::filesystem::create_symlink("../triangle.bin", folder_ / "in/link.bin");
    ReadSettings open;
    open.allowOutside = true;
    for (const std::string& uri :
         {std::string("../triangle.bin"), std::string("%2e%2e/triangle.bin"), std::string("..%2Ftriangle.bin"),
          std::string("x/../../triangle.bin"), std::string("..\\triangle.bin"), std::string("link.bin"),
          folder_ / "triangle.bin"}) {
        json root = triangle();
        root["buffers"][0]["uri"] = uri;
        spit(inside, root.dump());
        const auto scene = readGltf(inside);
        ASSERT_FALSE(scene) << uri;
        EXPECT_EQ(scene.error().kind, ErrorKind::input);
        EXPECT_NE(scene.error().line().find("--allow-outside"), std::string::npos) << scene.error().line();
        if (uri.find("x/") == std::string::npos) EXPECT_TRUE(readGltf(inside, open)) << uri;
    }
    // A picture is left out; a store that a node places is an error.
    json root = triangle();
    root["buffers"][0]["uri"] = "own.bin";
    std::filesystem::copy_file(folder_ / "triangle.bin", folder_ / "in/own.bin");
    root["images"] = json::array({{{"uri", "../secret.png"}}});
    spit(folder_ / "secret.png", "not for you");
    spit(inside, root.dump());
    const auto scene = readGltf(inside);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_TRUE(scene->images.at(0).bytes.empty());
    root["extensionsUsed"] = {"STIPPLE_store"};
    root["nodes"][0]["extensions"]["STIPPLE_store"]["uri"] = "../a.stipple";
    spit(inside, root.dump());
    EXPECT_FALSE(readGltf(inside));
    // Materials and textures of OBJ files.
    spit(folder_ / "out.mtl", "newmtl a\nKd 1 0 0\n");
    spit(folder_ / "in/a.obj", "mtllib ../out.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    const auto obj = readObj(folder_ / "in/a.obj");
    ASSERT_TRUE(obj) << obj.error().line();
    EXPECT_TRUE(obj->materials.empty());
    EXPECT_NE(notesOf(*obj).find("--allow-outside"), std::string::npos) << notesOf(*obj);
    EXPECT_EQ(readObj(folder_ / "in/a.obj", open)->materials.size(), 1u);
}

TEST_F(ForeignScenes, WhatIsNoRegularFileIsNotWaitedFor) {
    ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
    const auto direct = readGltf(folder_ / "fifo");
    ASSERT_FALSE(direct);
    EXPECT_NE(direct.error().line().find("not a regular file"), std::string::npos) << direct.error().line();
    json root = triangle();
    root["images"] = json::array({{{"uri", "fifo"}}});
    const auto scene = read(root);
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_NE(notesOf(*scene).find("not a regular file"), std::string::npos) << notesOf(*scene);
    root["buffers"][0]["uri"] = "fifo";
    EXPECT_FALSE(read(root));
    ReadSettings open;
    open.allowOutside = true;
    for (const std::string& library : {std::string("fifo"), std::string("/dev/zero")}) {
        spit(folder_ / "a.obj", "mtllib " + library + "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        const auto obj = readObj(folder_ / "a.obj", open);
        ASSERT_TRUE(obj) << obj.error().line();
        EXPECT_NE(notesOf(*obj).find("not a regular file"), std::string::npos) << notesOf(*obj);
    }
}

TEST_F(ForeignScenes, PromisesOfSizeAreErrorsOfTheBudgetBeforeMemoryIsTaken) {
    const auto expectOver = [&](const json& root, uint64_t memory) {
        ReadSettings settings;
        settings.memoryBytes = memory;
        const auto scene = read(root, settings);
        ASSERT_FALSE(scene);
        EXPECT_EQ(scene.error().kind, ErrorKind::budget) << scene.error().line();
        EXPECT_NE(scene.error().line().find("--memory"), std::string::npos) << scene.error().line();
    };
    json root = triangle();
    root["accessors"].push_back(
        {{"componentType", 5126}, {"count", 260000000}, {"type", "VEC3"}, {"min", {0, 0, 0}}, {"max", {0, 0, 0}}});
    root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 1}}}});
    expectOver(root, uint64_t{2} << 30);
    root = triangle();
    root["accessors"].push_back({{"componentType", 5126}, {"count", 100000000}, {"type", "VEC3"}});
    root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = 1;
    expectOver(root, uint64_t{2} << 30);
    root["accessors"][1]["count"] = 3000000;
    expectOver(root, uint64_t{256} << 20);
    // A text that becomes many values.
    root = triangle();
    root["extras"] = std::vector<json>(200000, json::object());
    expectOver(root, uint64_t{8} << 20);
    EXPECT_TRUE(read(triangle()));
}

/// A file with something of everything that is read.
json everything() {
    json root = triangle();
    root["bufferViews"] = {{{"buffer", 0}, {"byteLength", 36}, {"byteStride", 12}},
                           {{"buffer", 0}, {"byteLength", 36}},
                           {{"buffer", 0}, {"byteLength", 36}}};
    root["accessors"].push_back({{"bufferView", 1}, {"componentType", 5121}, {"count", 3}, {"type", "SCALAR"}});
    root["accessors"].push_back({{"bufferView", 1}, {"componentType", 5126}, {"count", 2}, {"type", "VEC4"}});
    root["accessors"].push_back(
        {{"componentType", 5126},
         {"count", 2},
         {"type", "VEC3"},
         {"sparse",
          {{"count", 1}, {"indices", {{"bufferView", 2}, {"componentType", 5123}}}, {"values", {{"bufferView", 2}}}}}});
    root["accessors"].push_back({{"bufferView", 1}, {"componentType", 5126}, {"count", 3}, {"type", "VEC2"}});
    json& primitive = root["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = primitive["attributes"]["TEXCOORD_1"] = 4;
    primitive["attributes"]["NORMAL"] = primitive["attributes"]["COLOR_0"] = 0;
    primitive["indices"] = 1;
    primitive["targets"] = json::array({{{"POSITION", 3}}});
    root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 3}, {"ROTATION", 2}};
    root["nodes"][0]["children"] = {1, 2};
    root["nodes"].push_back({{"camera", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}}});
    root["nodes"].push_back({{"mesh", 0},
                             {"skin", 0},
                             {"rotation", {0, 0, 0, 1}},
                             {"scale", {1, 2, 3}},
                             {"translation", {1, 2, 3}},
                             {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}};
    root["skins"] = {{{"joints", {1}}, {"inverseBindMatrices", 2}}};
    root["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                           {"samplers", {{{"input", 0}, {"output", 3}}}}}};
    root["images"] = {{{"uri", "data:image/png;base64,iVBORw0KGgo="}}, {{"bufferView", 1}, {"mimeType", "image/png"}}};
    root["samplers"] = {{{"wrapS", 33071}}};
    root["textures"] = {{{"source", 0}, {"sampler", 0}}, {{"source", 1}}};
    root["materials"][0]["normalTexture"] = {{"index", 1}, {"texCoord", 1}, {"scale", 2}};
    root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {
        {"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {1, 2}}, {"rotation", 1}}}}}};
    root["extensions"]["KHR_lights_punctual"]["lights"] = {
        {{"type", "spot"}, {"spot", {{"outerConeAngle", 1}}}, {"color", {1, 1, 1}}}};
    root["extensionsUsed"] = {"KHR_lights_punctual", "KHR_texture_transform", "EXT_mesh_gpu_instancing"};
    return root;
}

TEST_F(ForeignScenes, AnyValueAtAnyPlaceEndsInASceneOrAnError) {
    const json plain = everything();
    ASSERT_TRUE(read(plain)) << read(plain).error().line();
    std::vector<json::json_pointer> places;
    const std::function<void(const json&, const json::json_pointer&)> walk = [&](const json& value,
                                                                                 const json::json_pointer& at) {
        if (!at.empty()) places.push_back(at);
        if (value.is_object())
            for (const auto& [key, member] : value.items()) walk(member, at / key);
        if (value.is_array())
            for (size_t i = 0; i < value.size(); ++i) walk(value[i], at / i);
    };
    walk(plain, json::json_pointer());
    const std::vector<json> values{nullptr,
                                   true,
                                   -1,
                                   0,
                                   1,
                                   2,
                                   5,
                                   255,
                                   5126,
                                   1u << 31,
                                   1e300,
                                   -0.5,
                                   1e-300,
                                   "",
                                   "MAT4",
                                   "../../x",
                                   "\xc3\xa9",
                                   json::array(),
                                   json::object(),
                                   {0, 0},
                                   {1e300, 1e300, 1e300}};
    ReadSettings modest;
    modest.memoryBytes = uint64_t{64} << 20;
    Rng rng(17);
    size_t drawn = 0;
    const auto attempt = [&](const json& root) {
        for (const bool isStrict : {false, true}) {
            modest.isStrict = isStrict;
            const auto scene = read(root, modest);
            if (!scene) {
                ASSERT_EQ(scene.error().line().find("exception"), std::string::npos) << scene.error().line();
                continue;
            }
            ++drawn;
            (void)meshBounds(*scene);
            (void)surfaceMaterials(*scene);
            (void)textureImages(*scene);
            ASSERT_TRUE(triangleSource(*scene, placements(*scene)).read([](const lod::TriangleMesh&) -> Result<void> {
                return {};
            }));
        }
    };
    for (const auto& place : places)
        for (int k = 0; k < 4; ++k) {
            json root = plain;
            root[place] = values[rng.below(values.size())];
            attempt(root);
        }
    for (int k = 0; k < 300; ++k) {  // several at once, and members that go
        json root = plain;
        for (uint64_t n = 2 + rng.below(3); n > 0; --n) {
            const auto& place = places[rng.below(places.size())];
            if (!root.contains(place)) continue;
            if (rng.below(3) > 0)
                root[place] = values[rng.below(values.size())];
            else if (root[place.parent_pointer()].is_object())
                root[place.parent_pointer()].erase(place.back());
        }
        attempt(root);
    }
    EXPECT_GT(drawn, places.size());
}

}  // namespace
}  // namespace stipple::scene
