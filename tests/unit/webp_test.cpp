// Textures of EXT_texture_webp are drawn in their colours; WebP data that is damaged or lies about its size is a note,
// or an error of the budget.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "engine/scene/open/open_scene.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "tests/support/planes.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple::scene {
namespace {

using nlohmann::json;
using test::slurp;
using test::spit;
using test::TempFolder;

constexpr uint32_t kSize = 32;

/// Left red, right green.
std::vector<uint8_t> halves() {
    std::vector<uint8_t> rgba;
    for (uint32_t i = 0; i < kSize * kSize; ++i) {
        const bool isLeft = i % kSize < kSize / 2;
        rgba.insert(rgba.end(),
                    {static_cast<uint8_t>(isLeft ? 220 : 20), static_cast<uint8_t>(isLeft ? 20 : 200), 20, 255});
    }
    return rgba;
}

class Webp : public testing::Test {
  protected:
    void SetUp() override {
        const float corners[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0};
        const float uvs[] = {0, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 0};
        spit(folder_ / "square.bin", std::string(reinterpret_cast<const char*>(corners), sizeof(corners)) +
                                         std::string(reinterpret_cast<const char*>(uvs), sizeof(uvs)));
        test::writeBytes(folder_ / "t.webp", kSize, kSize, halves());
    }
    /// A square with that texture.
    json square() const {
        return json::parse(R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
                           "extensions": {"KHR_materials_unlit": {}}}],
            "extensionsUsed": ["EXT_texture_webp", "KHR_materials_unlit"], "extensionsRequired": ["EXT_texture_webp"],
            "textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}],
            "images": [{"uri": "t.webp", "mimeType": "image/webp"}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
                           "min": [-1, -1, 0], "max": [1, 1, 0]},
                          {"bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC2"}],
            "bufferViews": [{"buffer": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 48}],
            "buffers": [{"byteLength": 120, "uri": "square.bin"}]})");
    }
    /// (What is said of a file is said once.)
    std::vector<DecodedImage> decode(const json& root, std::string& said, const std::string& name = "a.gltf") {
        spit(folder_ / name, root.dump());
        const auto scene = readGltf(folder_ / name);
        EXPECT_TRUE(scene) << scene.error().line();
        if (!scene) return {};
        for (const std::string& note : scene->notes) said += note + "\n";
        auto images = decodeImages(*scene, uint64_t{1} << 30, [&](const std::string& line) { said += line + "\n"; });
        EXPECT_TRUE(images) << images.error().line();
        return images ? std::move(*images) : std::vector<DecodedImage>();
    }
    static bool isLike(uint32_t rgba, int r, int g, int b) {
        constexpr int kLossy = 24;
        const auto byte = [&](int shift) { return static_cast<int>(rgba >> shift & 255); };
        return std::abs(byte(0) - r) < kLossy && std::abs(byte(8) - g) < kLossy && std::abs(byte(16) - b) < kLossy;
    }

    TempFolder folder_;
};

TEST_F(Webp, ATextureHasItsColours) {
    std::string said;
    const auto images = decode(square(), said);
    EXPECT_EQ(said, "");
    ASSERT_EQ(images.size(), 1u);
    ASSERT_EQ(images[0].width, kSize);
    EXPECT_TRUE(isLike(images[0].rgba[5 * kSize + 5], 220, 20, 20)) << std::hex << images[0].rgba[5 * kSize + 5];
    EXPECT_TRUE(isLike(images[0].rgba[5 * kSize + 27], 20, 200, 20)) << std::hex << images[0].rgba[5 * kSize + 27];
    // The same inside of the file, and named as a plain source, which is not glTF and can only mean that.
    json root = square();
    const std::string bytes = slurp(folder_ / "t.webp");
    spit(folder_ / "square.bin", slurp(folder_ / "square.bin") + bytes);
    root["buffers"][0]["byteLength"] = 120 + bytes.size();
    root["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 120}, {"byteLength", bytes.size()}});
    root["images"][0] = {{"bufferView", 2}, {"mimeType", "image/webp"}};
    root["textures"][0] = {{"source", 0}};
    const auto inside = decode(root, said);
    ASSERT_EQ(inside.size(), 1u);
    EXPECT_EQ(inside[0].rgba, images[0].rgba);
    // And drawn so.
    const test::Outcome drawn = test::runProgram(folder_, "render a.gltf -o a.png --size 64x64 --quiet");
    ASSERT_EQ(drawn.code, 0) << drawn.err;
    const test::Planes picture = test::readPlanes(folder_ / "a.png");
    const std::vector<float> red = picture.plane("R"), green = picture.plane("G");
    EXPECT_GT(red[32 * 64 + 20], green[32 * 64 + 20] + 50);
    EXPECT_GT(green[32 * 64 + 44], red[32 * 64 + 44] + 50);
}

TEST_F(Webp, APictureOfAPlainFormatBesideItIsTaken) {
    std::vector<uint8_t> blue;
    for (uint32_t i = 0; i < kSize * kSize; ++i) blue.insert(blue.end(), {10, 20, 230, 255});
    test::writeBytes(folder_ / "t.png", kSize, kSize, blue);
    json root = square();
    root["images"].push_back({{"uri", "t.png"}});
    root["textures"][0]["source"] = 1;
    spit(folder_ / "a.gltf", root.dump());
    const auto scene = readGltf(folder_ / "a.gltf");
    ASSERT_TRUE(scene) << scene.error().line();
    EXPECT_EQ(scene->textures[0].image, 1);
}

TEST_F(Webp, DataThatIsDamagedOrLiesAboutItsSizeIsANoteOrAnErrorOfTheBudget) {
    const std::string whole = slurp(folder_ / "t.webp");
    // Cut off anywhere, and with a size that its pixels do not have.
    std::vector<std::string> broken{whole.substr(0, 14), whole.substr(0, 40), whole.substr(0, whole.size() / 2)};
    std::string canvas = std::string("VP8X\x0a\0\0\0\0\0\0\0\xff\x0f\0\xff\x0f\0", 18) + whole.substr(12);
    const auto size = static_cast<uint32_t>(canvas.size() + 4);
    broken.push_back("RIFF" + std::string(reinterpret_cast<const char*>(&size), 4) + "WEBP" + canvas);
    for (const std::string& bytes : broken) {
        spit(folder_ / "t.webp", bytes);
        std::string said;
        const auto images = decode(square(), said, std::to_string(bytes.size()) + ".gltf");
        ASSERT_EQ(images.size(), 1u);
        EXPECT_EQ(images[0].width, 1u) << bytes.size();
        EXPECT_NE(said.find("a texture is left out: "), std::string::npos) << said;
        EXPECT_NE(said.find("t.webp"), std::string::npos) << said;
        EXPECT_EQ(said.find('\n'), said.size() - 1) << said;
    }
    canvas[12] = canvas[15] = '\xff';  // 16 thousand each way
    canvas[13] = canvas[16] = '\x3f';
    spit(folder_ / "t.webp", "RIFF" + std::string(reinterpret_cast<const char*>(&size), 4) + "WEBP" + canvas);
    spit(folder_ / "a.gltf", square().dump());
    test::expectOneLine(test::runProgram(folder_, "build a.gltf -o a.stipple --quiet --memory 512M"), 6,
                        {"16384x16384", "--memory"});
}

}  // namespace
}  // namespace stipple::scene
