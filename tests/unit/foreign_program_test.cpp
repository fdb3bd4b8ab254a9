// The program with files of other programs: names that are not UTF-8, pictures that promise gigabytes, FIFOs.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "engine/base/text.h"
#include "engine/image/image_io.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/import.h"
#include "tests/support/runs.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using test::slurp;
using test::spit;
using test::TempFolder;

/// A PNG of this size without pixels: signature, IHDR, an empty IDAT. (CRCs are of zlib's polynomial.)
std::string pngHead(uint32_t width, uint32_t height, const std::string& kind = std::string("\x08\x06\0\0\0", 5)) {
    const auto number = [](uint32_t v) {
        std::string s;
        for (int shift = 24; shift >= 0; shift -= 8) s += static_cast<char>(v >> shift & 255u);
        return s;
    };
    const auto chunk = [&](const std::string& body) {
        uint32_t crc = ~0u;
        for (const char c : body) {
            crc ^= static_cast<uint8_t>(c);
            for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1u ? 0xedb88320u : 0u);
        }
        return number(static_cast<uint32_t>(body.size() - 4)) + body + number(~crc);
    };
    return "\x89PNG\r\n\x1a\n" + chunk("IHDR" + number(width) + number(height) + kind) + chunk("IDAT");
}

TEST(ForeignText, AnyBytesBecomeOneLineOfValidUtf8) {
    EXPECT_EQ(printable("Straße 漢字 \xf0\x9f\x8c\xb2"), "Straße 漢字 \xf0\x9f\x8c\xb2");
    EXPECT_EQ(printable("a\xff\x1b[2Jb\nc\x7f"), "a\\xff\\x1b[2Jb\\x0ac\\x7f");
    EXPECT_EQ(printable("\xc2\x9b!"), "\\xc2\\x9b!") << "C1: a control sequence in one character";
    EXPECT_EQ(printable("\xc0\xaf\xed\xa0\x80\xf4\x90\x80\x80\xe6\xbc"),
              "\\xc0\\xaf\\xed\\xa0\\x80\\xf4\\x90\\x80\\x80\\xe6\\xbc");
    EXPECT_EQ(toUtf8("a\nb\xff"), "a\nb\\xff");
    for (int byte = 0; byte < 256; ++byte) {
        const std::string text = printable(std::string(1, static_cast<char>(byte)) + "x");
        EXPECT_NO_THROW(static_cast<void>(nlohmann::json(text).dump()));
    }
}

TEST(ForeignProgram, NamesThatAreNotUtf8DoNotEndItsWork) {
    const TempFolder folder;
    const std::string name = folder / "n\xff\x1b.ply";
    spit(name,
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         "property float \xff\xc3q\nend_header\n0 0 0 1\n1 0 0 2\n0 1 0 3\n");
    const std::string store = folder / "a.stipple";
    ASSERT_EQ(test::shell(":", "build " + folder.path() + "/n*.ply -o " + store + " --attributes all --json --quiet",
                          folder.path()),
              0)
        << slurp(folder / "err");
    ASSERT_EQ(test::shell(":", "info " + folder.path() + "/n*.ply --json", folder.path()), 0) << slurp(folder / "err");
    const auto file = nlohmann::json::parse(slurp(folder / "out"));
    EXPECT_EQ(file["attributes"][0]["name"], "\\xff\\xc3q");
    ASSERT_EQ(test::shell(":", "info " + store + " --json", folder.path()), 0) << slurp(folder / "err");
    EXPECT_EQ(nlohmann::json::parse(slurp(folder / "out"))["attributes"][0]["name"], "\\xff\\xc3q");
    // OBJ with a texture of such a name.
    spit(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    spit(folder / "a.mtl", "newmtl a\nmap_Kd \xff\xfe.png\n");
    ASSERT_EQ(test::shell(":", "info " + folder.path() + "/a.obj --json", folder.path()), 0) << slurp(folder / "err");
    EXPECT_TRUE(nlohmann::json::accept(slurp(folder / "out")));
    // A message shows no foreign bytes.
    spit(folder / "b\x1b[31m.las", "x");
    EXPECT_EQ(test::shell(":", "info " + folder.path() + "/b*.las", folder.path()), 3);
    EXPECT_EQ(slurp(folder / "err").find('\x1b'), std::string::npos) << slurp(folder / "err");
}

TEST(ForeignProgram, FifosAsInputsAreRefusedAtOnce) {
    const TempFolder folder;
    for (const char* extension : {"las", "ply", "glb", "gltf", "obj", "swc", "stipple", "txt"}) {
        const std::string fifo = folder / (std::string("f.") + extension);
        ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
        for (const std::string& command : {"info " + fifo, "build " + fifo + " -o " + (folder / "o.stipple")}) {
            EXPECT_EQ(test::shell("ulimit -t 20", command, folder.path()), 3) << command;
            EXPECT_NE(slurp(folder / "err").find("not a regular file"), std::string::npos) << slurp(folder / "err");
        }
    }
    const std::string fifo = folder / "f.hdr";
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    const auto hdr = image::readHdr(fifo);
    ASSERT_FALSE(hdr);
    EXPECT_NE(hdr.error().line().find("not a regular file"), std::string::npos) << hdr.error().line();
    EXPECT_FALSE(image::readImage(fifo));
}

TEST(ForeignPictures, WhatAPictureClaimsIsCheckedBeforeMemoryIsTaken) {
    const TempFolder folder;
    constexpr uint64_t kMemory = uint64_t{512} << 20;
    const auto bytesOf = [](const std::string& text) { return std::vector<uint8_t>(text.begin(), text.end()); };
    // 69 bytes of PNG that would be 32000x32000.
    const auto lie = image::decodeImage(bytesOf(pngHead(32000, 32000)), "p", kMemory);
    ASSERT_FALSE(lie);
    EXPECT_EQ(lie.error().kind, ErrorKind::input) << lie.error().line();
    EXPECT_NE(lie.error().line().find("32000x32000"), std::string::npos) << lie.error().line();
    // One that could be true, but does not fit.
    const auto large = image::decodeImage(bytesOf(pngHead(32000, 32000) + std::string(1'000'000, '\0')), "p", kMemory);
    ASSERT_FALSE(large);
    EXPECT_EQ(large.error().kind, ErrorKind::budget) << large.error().line();
    EXPECT_NE(large.error().line().find("--memory"), std::string::npos) << large.error().line();
    // An interlaced one is decoded as a whole, 9 bytes a pixel where it has 16 bits a sample: 468 MB, not 288.
    for (const auto& [kind, fits] :
         {std::pair{std::string("\x10\x06\0\0\1", 5), false}, {std::string("\x10\x06\0\0\0", 5), true}}) {
        constexpr uint64_t kBetween = uint64_t{320} << 20;
        const auto whole =
            image::decodeImage(bytesOf(pngHead(6000, 6000, kind) + std::string(100'000, '\0')), "i", kBetween);
        ASSERT_FALSE(whole) << "there is nothing in it";
        EXPECT_EQ(whole.error().kind, fits ? ErrorKind::input : ErrorKind::budget) << whole.error().line();
    }
    const auto webp = image::decodeImage(
        bytesOf(std::string("RIFF\x30\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0\xfe\x3f\0\xfe\x3f\0VP8L\0\0\0\0", 38)), "w",
        kMemory);
    ASSERT_FALSE(webp);
    EXPECT_EQ(webp.error().kind, ErrorKind::budget) << webp.error().line();
    // The same of HDR files.
    spit(folder / "a.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n\2\2\x3e\x80");
    const auto hdr = image::readHdr(folder / "a.hdr", kMemory);
    ASSERT_FALSE(hdr);
    EXPECT_NE(hdr.error().line().find("16000x16000"), std::string::npos) << hdr.error().line();
    // And a whole one is read as before, rows of which are no multiple of the block.
    render::Image small;
    small.width = 7;
    small.height = 37;
    for (uint32_t i = 0; i < small.width * small.height; ++i)
        small.rgba.push_back(0xff000000u | i * 2654435u % 0xffffffu);
    ASSERT_TRUE(image::writeImage(folder / "a.png", small));
    const auto back = image::readImage(folder / "a.png");
    ASSERT_TRUE(back) << back.error().line();
    EXPECT_EQ(back->rgba, small.rgba);
}

TEST(ForeignPictures, ASceneWithATextureOfGigabytesEndsWithTheBudgetAndOneThatIsBrokenIsDrawnWithout) {
    const TempFolder folder;
    const auto scene = [&](const std::string& picture) {
        spit(folder / "t.png", picture);
        const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
        spit(folder / "t.bin", std::string(reinterpret_cast<const char*>(corners), sizeof(corners)));
        spit(folder / "a.gltf", R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}], "images": [{"uri": "t.png"}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                           "min": [0, 0, 0], "max": [1, 1, 0]},
                          {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "t.bin"}]})");
        return test::shell(test::isSanitized ? ":" : "ulimit -v 3000000",
                           "build " + (folder / "a.gltf") + " -o " + (folder / "a.stipple") + " --quiet --memory 1G",
                           folder.path());
    };
    EXPECT_EQ(scene(pngHead(20000, 20000) + std::string(1'500'000, '\0')), 6) << slurp(folder / "err");
    EXPECT_NE(slurp(folder / "err").find("20000x20000"), std::string::npos) << slurp(folder / "err");
    EXPECT_EQ(scene(pngHead(32000, 32000)), 0) << slurp(folder / "err");
    EXPECT_NE(slurp(folder / "err").find("a texture is left out"), std::string::npos) << slurp(folder / "err");
}

TEST(ForeignTables, CylinderModelsWithALineOfNamesAreRead) {
    // As R writes a table: quotes, a column of row names, columns in another order.
    const auto named = lod::readQsm(
        "\"\",\"parent\",\"extension\",\"start_X\",\"start_Y\",\"start_Z\",\"axis_X\",\"axis_Y\",\"axis_Z\","
        "\"length\",\"radius\"\n"
        "\"1\",0,2,0,0,0,0,0,1,2,0.5\n\"2\",1,0,0,0,2,0,0,1,3,0.25\n",
        "a.csv");
    ASSERT_TRUE(named) << named.error().line();
    EXPECT_EQ(named->curves(), 1u);
    ASSERT_EQ(named->position.size(), 3u);
    EXPECT_EQ(named->position[2], glm::dvec3(0, 0, 5));
    EXPECT_EQ(named->radius[0], 0.5f);
    // Without a name above the row names, and TreeQSM's own names (one for three columns).
    for (const std::string& head : {std::string("radius,length,x,y,z,a1,a2,a3,parent,extension\n"),
                                    std::string("radius (m)\tlength (m)\tstart_point\taxis\tparent\n")}) {
        const bool isR = head.find(',') != std::string::npos;
        const std::string row = isR ? "\"1\",0.5,2,0,0,0,0,0,1,0,0\n" : "0.5\t2\t0\t0\t0\t0\t0\t1\t0\t0\t\n";
        const auto set = lod::readQsm(head + row, "a.csv");
        ASSERT_TRUE(set) << set.error().line();
        EXPECT_EQ(set->position.at(1), glm::dvec3(0, 0, 2)) << head;
    }
    // Ends instead of axes, and no column of extensions (SimpleForest).
    const auto ends = lod::readQsm(
        "ID,parentID,startX,startY,startZ,endX,endY,endZ,volume,length,radius\n"
        "7,-1,0,0,0,0,0,2,1,2,0.5\n8,7,0,0,2,0,0,5,1,3,0.25\n9,7,0,0,2,1,0,2,1,1,0.1\n",
        "a.csv");
    ASSERT_TRUE(ends) << ends.error().line();
    EXPECT_EQ(ends->curves(), 2u);
    EXPECT_EQ(ends->position.at(2), glm::dvec3(0, 0, 5));
}

TEST(ForeignTables, PointsAsTextSayWhatIsRead) {
    const TempFolder folder;
    const std::string text = "1 2 3 100\n4 5 6 120\n";
    for (const char* name : {"a.xyz", "a.pts", "a.asc", "a.pcd", "a.e57"}) {
        spit(folder / name, text);
        const auto source = lod::openPointSource(folder / name);
        ASSERT_FALSE(source);
        EXPECT_NE(source.error().line().find(".laz, .ply"), std::string::npos) << source.error().line();
        EXPECT_NE(source.error().line().find("CloudCompare"), std::string::npos) << source.error().line();
    }
    for (const char* name : {"a.txt", "a.csv"}) {
        spit(folder / name, text);
        const auto curves = lod::openCurves(folder / name);
        ASSERT_FALSE(curves);
        EXPECT_NE(curves.error().line().find(".laz and .ply"), std::string::npos) << curves.error().line();
    }
}

TEST(ForeignTables, AScaleThatReachesBeyondNumbersNamesTheInput) {
    const TempFolder folder;
    test::writeLas(folder / "a.las", {{1, 2, 3}, {4, 5, 6}}, 0.01, glm::dvec3(0));
    std::string bytes = slurp(folder / "a.las");
    for (const double scale : {1e308, 1e95}) {
        for (size_t at = 131; at < 155; at += 8) std::memcpy(bytes.data() + at, &scale, 8);
        spit(folder / "scale.las", bytes);
        const auto source = lod::openPointSource(folder / "scale.las");
        ASSERT_FALSE(source);
        EXPECT_NE(source.error().line().find("scale.las"), std::string::npos) << source.error().line();
    }
}

}  // namespace
}  // namespace stipple
