// Scenes and pictures are read from wherever their bytes are: what a scene names, somebody resolves, and what files
// give, their bytes in memory give, too.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "engine/base/file.h"
#include "engine/image/image_io.h"
#include "engine/scene/scene_bytes.h"
#include "tests/support/planes.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using test::spit;
using test::TempFolder;
namespace fs = std::filesystem;

/// All files of a folder, in memory; the folder is empty afterwards.
class Moved {
  public:
    explicit Moved(const TempFolder& folder) {
        std::vector<fs::path> paths;
        for (const auto& entry : fs::recursive_directory_iterator(folder.path()))
            if (entry.is_regular_file()) paths.push_back(entry.path());
        for (const fs::path& path : paths) {
            auto bytes = readWhole(path.string());
            EXPECT_TRUE(bytes);
            const std::string name = fs::relative(path, folder.path()).string();
            files_[name] = std::make_shared<const MemorySource>(name, std::move(*bytes));
            fs::remove(path);
        }
    }
    const ByteSource& operator[](const std::string& name) const { return *files_.at(name); }
    Resolve resolver() {
        return [this](const std::string& name) -> Result<std::shared_ptr<const ByteSource>> {
            asked.insert(name);
            const auto found = files_.find(name);
            if (found == files_.end()) return fail(ErrorKind::input, "is not in the archive", name);
            return found->second;
        };
    }
    std::set<std::string> asked;

  private:
    std::map<std::string, std::shared_ptr<const ByteSource>> files_;
};

void expectSame(const Result<Scene>& a, const Result<Scene>& b) {
    ASSERT_TRUE(a) << a.error().line();
    ASSERT_TRUE(b) << b.error().line();
    EXPECT_EQ(a->notes, b->notes);
    ASSERT_EQ(a->images.size(), b->images.size());
    for (size_t i = 0; i < a->images.size(); ++i) EXPECT_EQ(a->images[i].bytes, b->images[i].bytes);
    ASSERT_EQ(a->meshes.size(), b->meshes.size());
    for (size_t m = 0; m < a->meshes.size(); ++m) {
        ASSERT_EQ(a->meshes[m].primitives.size(), b->meshes[m].primitives.size());
        for (size_t p = 0; p < a->meshes[m].primitives.size(); ++p) {
            const Primitive &x = a->meshes[m].primitives[p], &y = b->meshes[m].primitives[p];
            EXPECT_FALSE(x.position.empty());
            EXPECT_EQ(x.position, y.position);
            EXPECT_EQ(x.indices, y.indices);
            EXPECT_EQ(x.uv, y.uv);
        }
    }
    ASSERT_EQ(a->materials.size(), b->materials.size());
    for (size_t m = 0; m < a->materials.size(); ++m) EXPECT_EQ(a->materials[m].baseColour, b->materials[m].baseColour);
    ASSERT_EQ(a->nodes.size(), b->nodes.size());
}

const char* const kTriangle = R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 1], "baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "looks/red%20one.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
                   "max": [1, 1, 0]}, {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteLength": 24}],
    "buffers": [{"byteLength": 36, "uri": "shape.bin"}]})";

void writeTriangle(const TempFolder& folder) {
    const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    spit(folder / "shape.bin", std::string(reinterpret_cast<const char*>(corners), sizeof(corners)));
    fs::create_directories(folder / "looks");
    render::Image red;
    red.width = red.height = 4;
    red.rgba.assign(16, 0xff0000ffu);
    ASSERT_TRUE(image::writeImage(folder / "looks/red one.png", red));
    spit(folder / "a.gltf", kTriangle);
}

TEST(MemoryScenes, GltfIsThatOfTheFileWithWhatItNames) {
    const TempFolder folder;
    writeTriangle(folder);
    const auto ofFile = readScene(folder / "a.gltf");
    ASSERT_TRUE(ofFile) << ofFile.error().line();
    ASSERT_TRUE(ofFile->notes.empty()) << ofFile->notes[0];
    ASSERT_TRUE(writeGltf(*ofFile, folder / "b.glb"));
    Moved moved(folder);
    expectSame(ofFile, readScene(moved["a.gltf"], {}, moved.resolver()));
    EXPECT_EQ(moved.asked, (std::set<std::string>{"shape.bin", "looks/red one.png"}));
    expectSame(ofFile, readScene(moved["b.glb"], {}));  // names nothing
    // Nothing was left on the disk to be read instead.
    EXPECT_FALSE(readScene(folder / "a.gltf"));
    const auto nameless = readScene(moved["a.gltf"], {});
    ASSERT_FALSE(nameless);
    EXPECT_NE(nameless.error().line().find("shape.bin"), std::string::npos) << nameless.error().line();
}

TEST(MemoryScenes, WhatIsNotResolvedIsNamedAndNoFileIsReadForIt) {
    const TempFolder folder;
    writeTriangle(folder);
    const auto bytes = readWhole(folder / "a.gltf");
    ASSERT_TRUE(bytes);
    const MemorySource scene(folder / "a.gltf", *bytes);  // under the name of a file whose neighbours are there
    EXPECT_TRUE(readScene(scene, {}));
    const Resolve none = [](const std::string&) { return Result<std::shared_ptr<const ByteSource>>(nullptr); };
    const auto refused = readScene(scene, {}, none);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().line().find("shape.bin: is not among what was given with the scene"), std::string::npos)
        << refused.error().line();
    // A picture that is missing is a note, as it is of files; one that does not fit is none.
    const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const auto* const raw = reinterpret_cast<const uint8_t*>(corners);
    const auto shape =
        std::make_shared<const MemorySource>("shape.bin", std::vector<uint8_t>(raw, raw + sizeof(corners)));
    const Resolve shapes = [&](const std::string& name) {
        return Result<std::shared_ptr<const ByteSource>>(name == "shape.bin" ? shape : nullptr);
    };
    const auto plain = readScene(scene, {}, shapes);
    ASSERT_TRUE(plain) << plain.error().line();
    std::string said;
    for (const std::string& note : plain->notes) said += note + "\n";
    EXPECT_NE(said.find("looks/red one.png: is not among"), std::string::npos) << said;
    ReadSettings small;
    small.memoryBytes = 64 << 10;
    const Resolve large = [](const std::string& name) {
        return Result<std::shared_ptr<const ByteSource>>(
            std::make_shared<const MemorySource>(name, std::vector<uint8_t>(size_t{1} << 20)));
    };
    const auto over = readScene(scene, small, large);
    ASSERT_FALSE(over);
    EXPECT_EQ(over.error().kind, ErrorKind::budget) << over.error().line();
    // Addresses are the resolver's to understand, and stores are files.
    std::string text(bytes->begin(), bytes->end());
    text.replace(text.find("shape.bin"), 9, "http://a.b/c%20d");
    text.replace(text.find("\"mesh\": 0}"), 10,
                 R"("mesh": 0, "name": "n", "extensions": {"STIPPLE_store": {"uri": "x.stipple"}}})");
    text.replace(text.find("\"asset\""), 7, R"("extensionsUsed": ["STIPPLE_store"], "asset")");
    std::set<std::string> asked;
    const Resolve all = [&](const std::string& name) {
        asked.insert(name);
        return Result<std::shared_ptr<const ByteSource>>(shape);
    };
    const auto far = readScene(MemorySource("a.gltf", {text.begin(), text.end()}), {}, all);
    ASSERT_TRUE(far) << far.error().line();
    EXPECT_EQ(asked.count("http://a.b/c%20d"), 1u);
    EXPECT_TRUE(far->nodes[0].store.empty());
    said.clear();
    for (const std::string& note : far->notes) said += note + "\n";
    EXPECT_NE(said.find("'x.stipple', which is read from a file only"), std::string::npos) << said;
}

TEST(MemoryScenes, ObjIsThatOfTheFileWithItsMaterials) {
    const TempFolder folder;
    writeTriangle(folder);  // for its picture
    spit(folder / "m.mtl", "newmtl a\nKd 1 0 0\nmap_Kd looks\\red one.png\n");
    spit(folder / "a.obj", "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    const auto ofFile = readScene(folder / "a.obj");
    ASSERT_TRUE(ofFile) << ofFile.error().line();
    ASSERT_EQ(ofFile->images.size(), 1u);
    Moved moved(folder);
    expectSame(ofFile, readScene(moved["a.obj"], {}, moved.resolver()));
    EXPECT_EQ(moved.asked, (std::set<std::string>{"m.mtl", "looks/red one.png"}));
    // A polygon of very many corners goes through a reader of its own.
    std::string ring, face = "f";
    for (int k = 1; k <= 600; ++k) {
        ring += fmt::format("v {} {} 0\n", std::cos(0.01 * k), std::sin(0.01 * k));
        face += fmt::format(" {}", k);
    }
    spit(folder / "ring.obj", ring + face + "\n");
    const auto large = readScene(folder / "ring.obj");
    Moved again(folder);
    expectSame(large, readScene(again["ring.obj"], {}));
}

TEST(MemoryScenes, PicturesAreThoseOfTheFile) {
    const TempFolder folder;
    Rng rng(4);
    render::Image noise;
    noise.width = 37;
    noise.height = 21;
    for (size_t i = 0; i < size_t{37} * 21; ++i) {
        noise.rgba.push_back(static_cast<uint32_t>(rng.below(1u << 24)) | 0xff000000u);
        for (int c = 0; c < 3; ++c) noise.linear.push_back(static_cast<float>(rng.below(1000)) / 100);
    }
    ASSERT_TRUE(image::writeImage(folder / "a.png", noise));
    ASSERT_TRUE(image::writeImage(folder / "b.exr", noise));
    std::vector<uint8_t> bytes;
    for (const uint32_t p : noise.rgba)
        for (int c = 0; c < 4; ++c) bytes.push_back(static_cast<uint8_t>(p >> (8 * c)));
    for (const char* name : {"c.jpg", "d.webp", "e.tif", "f.bmp", "g.tga"})
        test::writeBytes(folder / name, 37, 21, bytes);
    test::writeFloats(folder / "h.hdr", 37, 21, noise.linear);
    std::map<std::string, render::Image> pictures;
    std::map<std::string, render::HdrImage> floats;
    for (const char* name : {"a.png", "b.exr", "c.jpg", "d.webp", "e.tif", "f.bmp", "g.tga", "h.hdr"}) {
        const auto image = image::readImage(folder / name);
        const auto light = image::readHdr(folder / name);
        ASSERT_TRUE(image && light) << name;
        pictures[name] = *image;
        floats[name] = *light;
    }
    Moved moved(folder);
    for (const auto& [name, image] : pictures) {
        SCOPED_TRACE(name);
        const ByteSource& source = moved[name];
        const auto again = image::readImage(source);
        ASSERT_TRUE(again) << again.error().line();
        EXPECT_EQ(again->width, 37u);
        EXPECT_EQ(again->rgba, image.rgba);
        const auto light = image::readHdr(source);
        ASSERT_TRUE(light) << light.error().line();
        EXPECT_EQ(light->rgb, floats.at(name).rgb);
        // Without a name that says the format, by what it begins with (TGA has no mark).
        std::vector<uint8_t> whole(source.sizeBytes());
        ASSERT_TRUE(source.readAt(0, whole.data(), whole.size()));
        if (name != "g.tga") {
            const auto unnamed = image::readImage(MemorySource("picture", whole));
            ASSERT_TRUE(unnamed) << unnamed.error().line();
            EXPECT_EQ(unnamed->rgba, image.rgba);
        }
        // Half of it, and more than there is memory for.
        whole.resize(whole.size() / 2);
        const auto half = image::readImage(MemorySource(name, whole));
        if (!half) EXPECT_NE(half.error().line().find(name), std::string::npos) << half.error().line();
        const auto tight = image::readImage(source, 3000);
        ASSERT_FALSE(tight);
        EXPECT_EQ(tight.error().kind, ErrorKind::budget) << tight.error().line();
    }
    EXPECT_FALSE(image::readImage(MemorySource("a.png", {}))) << "nothing";
}

TEST(MemoryScenes, FormatsThatAreReadFromFilesOnlyAreNamed) {
    const std::vector<uint8_t> some(200, 7);
    const auto line = [&](const std::string& name) {
        const auto image = image::readImage(MemorySource(name, some));
        return image ? std::string() : image.error().line();
    };
    EXPECT_NE(line("a.ico").find("a.ico: ico is a format that is read from files only"), std::string::npos)
        << line("a.ico");
    EXPECT_NE(line("a.sgi").find("sgi is a format that is read from files only"), std::string::npos) << line("a.sgi");
    EXPECT_NE(line("a.txt").find("is no picture that can be read"), std::string::npos) << line("a.txt");
    EXPECT_NE(line("a").find("is no picture that can be read"), std::string::npos) << line("a");
}

}  // namespace
}  // namespace stipple::scene
