// Pictures as a newcomer gets them: with their background, right side up, of the right kind, in colours that say
// something.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "engine/image/coverage.h"
#include "engine/image/image_io.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Picture : public testing::Test {
  protected:
    int run(const std::string& arguments) {
        const test::Outcome r = test::runProgram(folder_, arguments);
        printed_ = r.out;
        said_ = r.err;
        return r.code;
    }
    nlohmann::json json(const std::string& arguments) {
        EXPECT_EQ(run(arguments), 0) << said_;
        return nlohmann::json::parse(printed_, nullptr, false);
    }
    /// Pixels, r g b a.
    std::vector<std::array<uint32_t, 4>> render(const std::string& input, const std::string& options = "") {
        EXPECT_EQ(run("render " + input + " -o a.png --quiet --size 96x64 --device cpu " + options), 0) << said_;
        const auto image = image::readImage(folder_ / "a.png");
        std::vector<std::array<uint32_t, 4>> pixels;
        if (!image) return std::vector<std::array<uint32_t, 4>>(96 * 64);
        for (const uint32_t p : image->rgba) pixels.push_back({p & 255u, p >> 8 & 255u, p >> 16 & 255u, p >> 24});
        return pixels;
    }
    /// The bytes of a picture of `input`.
    std::string picture(const std::string& input, const std::string& name) {
        EXPECT_EQ(run("render " + input + " -o " + name + " --force --quiet --size 96x64 --device cpu"), 0) << said_;
        return test::slurp(folder_ / name);
    }
    /// A ball without colours or normals of its own, 400 points.
    void writeBall(const std::string& name) {
        std::ostringstream out;
        out << "ply\nformat ascii 1.0\nelement vertex 400\nproperty float x\nproperty float y\nproperty float z\n"
               "end_header\n";
        for (int i = 0; i < 400; ++i) {
            const double z = 1 - 2 * (i + 0.5) / 400, r = std::sqrt(1 - z * z), a = 2.399963 * i;
            out << r * std::cos(a) << ' ' << r * std::sin(a) << ' ' << z << '\n';
        }
        test::spit(folder_ / name, out.str());
    }
    /// A wedge of two triangles, `at` along x; other things behind the header's elements if asked for.
    void writeWedge(const std::string& name, double at) {
        std::ostringstream out;
        out << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
            << at << " 0 0\n"
            << at + 1 << " 0 0\n"
            << at + 1 << " 2 0.5\n"
            << at << " 2 0.5\n3 0 1 2\n3 0 2 3\n";
        test::spit(folder_ / name, out.str());
    }
    test::TempFolder folder_;
    std::string printed_, said_;
};

TEST_F(Picture, OneStrayPointFarAwayCutsNothingOffInFront) {
    // The near plane was a millionth of the scene: 2 units for a stray point 2,000 km away, before all of the ball.
    const auto cover = [&](bool hasStray) {
        std::ostringstream out;
        const int count = 8000;
        out << "ply\nformat ascii 1.0\nelement vertex " << count + (hasStray ? 1 : 0)
            << "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
        for (int i = 0; i < count; ++i) {
            const double z = 1 - 2 * (i + 0.5) / count, r = std::sqrt(1 - z * z), a = 2.399963 * i;
            out << r * std::cos(a) << ' ' << r * std::sin(a) << ' ' << z << '\n';
        }
        if (hasStray) out << "2000000 0 0\n";
        const std::string name = hasStray ? "stray.ply" : "alone.ply";
        test::spit(folder_ / name, out.str());
        const auto pixels =
            render(name, "--force --colour plain --eye 0,0,1.2 --target 0,0,0 --camera-up 0,1,0 --alpha");
        return std::count_if(pixels.begin(), pixels.end(), [](const auto& p) { return p[3] == 255; });
    };
    const auto alone = cover(false), beside = cover(true);
    EXPECT_EQ(alone, 96 * 64);
    EXPECT_EQ(beside, alone);
}

TEST_F(Picture, NoDateIsInAnExr) {
    writeBall("ball.ply");
    const std::string bytes = picture("ball.ply", "a.exr");
    ASSERT_GT(bytes.size(), 1000u);
    size_t dates = 0;  // as OpenEXR has them: 2026:11:22 16:33:02
    for (size_t i = 0; i + 19 <= bytes.size(); ++i)
        dates += bytes[i + 4] == ':' && bytes[i + 7] == ':' && bytes[i + 10] == ' ' && bytes[i + 13] == ':' &&
                 bytes[i + 16] == ':';
    EXPECT_EQ(dates, 0u);
}

TEST_F(Picture, IsOpaqueAndShowsItsBackground) {
    test::writePly(folder_ / "a.ply", test::bumpySphere(500, 1));
    for (const auto& p : render("a.ply", "--background 200,10,20")) ASSERT_EQ(p[3], 255u);
    EXPECT_EQ(render("a.ply", "--background 200,10,20").front(), (std::array<uint32_t, 4>{200, 10, 20, 255}));
    const auto plain = render("a.ply").front();
    EXPECT_EQ(plain,
              (std::array<uint32_t, 4>{render::kBackground[0], render::kBackground[1], render::kBackground[2], 255}))
        << "as in the window";
    const auto alpha = render("a.ply", "--alpha");
    EXPECT_EQ(alpha.front()[3], 0u);
    EXPECT_EQ(alpha[32 * 96 + 48][3], 255u);
    EXPECT_EQ(run("render a.ply -o a.png --alpha --background 1,2,3"), 2);
    EXPECT_EQ(render("a.ply", "--alpha --mode reference --samples 2").front()[3], 0u);
}

TEST_F(Picture, ShowsItsEnvironmentWhereThatIsTheBackground) {
    test::writePly(folder_ / "a.ply", test::bumpySphere(500, 1));
    std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n";
    for (int i = 0; i < 16 * 8; ++i) bytes += {char(-128), 64, 32, char(-128)};  // 1/2, 1/4, 1/8
    test::spit(folder_ / "even.hdr", bytes);
    const std::array<uint32_t, 4> even{188, 137, 99, 255};  // sRGB
    const auto isEven = [&](const std::array<uint32_t, 4>& p) {
        for (size_t k = 0; k < 4; ++k)
            if (std::abs(int(p.at(k)) - int(even.at(k))) > 1) return false;
        return true;
    };
    EXPECT_FALSE(isEven(render("a.ply", "--environment even.hdr").front())) << "the control: it lights, and no more";
    EXPECT_TRUE(isEven(render("a.ply", "--environment even.hdr --background environment").front()));
    EXPECT_TRUE(isEven(
        render("a.ply", "--environment even.hdr --background environment --mode reference --samples 2").front()));
    const auto backgroundOf = [&](const std::string& more) {
        const nlohmann::json j =
            json("render a.ply -o a.png --force --size 96x64 --device cpu --json --environment even.hdr " + more);
        for (const nlohmann::json& e : j["effects"])
            if (e["name"] == "background") return e;
        return nlohmann::json();
    };
    const nlohmann::json shown = backgroundOf("--background environment"), none = backgroundOf("");
    EXPECT_EQ(shown["called_for_by"], "--background environment");
    EXPECT_TRUE(shown["active"].get<bool>());
    EXPECT_EQ(shown["passes"], 1);
    EXPECT_FALSE(none["requested"].get<bool>() || none["active"].get<bool>());
    EXPECT_EQ(none["passes"], 0);
}

TEST_F(Picture, CoverageIsKeptApartFromColour) {
    render::Image image;
    image.width = 3;
    image.height = 1;
    image.rgba = {0x00123456u, 0xff0000ffu, 0x80000080u};
    image.linear = {0, 0, 0, 1, 0, 0, 128.0f / 255.0f, 0, 0};
    render::Image opaque = image;
    image::separateCoverage(image);
    EXPECT_EQ(image.rgba[0], 0u);
    EXPECT_EQ(image.rgba[1], 0xff0000ffu);
    EXPECT_EQ(image.rgba[2], 0x800000ffu) << "half covered by full red";
    image::makeOpaque(opaque);
    EXPECT_EQ(opaque.rgba[2], 0xff000080u);
}

/// The chunks of a PNG by name, in order, with their checksums as they should be (bit by bit: PNG, annex D).
std::vector<std::pair<std::string, std::string>> chunksOf(const std::string& png) {
    std::vector<std::pair<std::string, std::string>> out;
    const auto word = [&](size_t at) {
        uint32_t w = 0;
        for (size_t i = 0; i < 4; ++i) w = w << 8 | static_cast<uint8_t>(png.at(at + i));
        return w;
    };
    for (size_t at = 8; at < png.size();) {
        const size_t length = word(at);
        uint32_t crc = ~0u;
        for (size_t i = at + 4; i < at + 8 + length; ++i) {
            crc ^= static_cast<uint8_t>(png.at(i));
            for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
        }
        EXPECT_EQ(~crc, word(at + 8 + length)) << png.substr(at + 4, 4);
        out.emplace_back(png.substr(at + 4, 4), png.substr(at + 8, length));
        at += 12 + length;
    }
    return out;
}

TEST_F(Picture, SaysThatItIsOfBt709WhereItIs) {
    writeBall("ball.ply");
    const std::string how = "render ball.ply --quiet --size 96x64 --device cpu --background 0,128,255 ";
    ASSERT_EQ(run(how + "-o a.png --transfer rec709"), 0) << said_;
    ASSERT_EQ(run(how + "-o s.png"), 0) << said_;
    ASSERT_EQ(run(how + "-o a.exr"), 0) << said_;
    const auto encoded = image::readImage(folder_ / "a.png"), srgb = image::readImage(folder_ / "s.png");
    const auto light = image::readHdr(folder_ / "a.exr");
    ASSERT_TRUE(encoded && srgb && light);
    // What the light of each pixel is in BT.709, item 1.2, against the byte; sRGB is another.
    double worst = 0, control = 0;
    for (size_t i = 0; i < encoded->rgba.size(); ++i)
        for (size_t c = 0; c < 3; ++c) {
            const double l = std::clamp(double{light->rgb[3 * i + c]}, 0.0, 1.0);
            const double value = 255 * (l < 0.018 ? 4.5 * l : 1.099 * std::pow(l, 0.45) - 0.099);
            worst = std::max(worst, std::abs(value - static_cast<double>(encoded->rgba[i] >> (8 * c) & 255u)));
            control = std::max(control, std::abs(value - static_cast<double>(srgb->rgba[i] >> (8 * c) & 255u)));
        }
    EXPECT_LE(worst, 1.07);
    EXPECT_GT(control, 10) << "the control";
    std::map<std::string, std::string> chunks;
    bool isBeforePixels = true;
    for (const auto& [name, bytes] : chunksOf(test::slurp(folder_ / "a.png"))) {
        if (name == "IDAT") isBeforePixels = chunks.count("cICP") == 1;
        chunks[name] = bytes;
    }
    EXPECT_TRUE(isBeforePixels);
    EXPECT_EQ(chunks["cICP"], std::string("\1\1\0\1", 4));
    EXPECT_EQ(chunks.count("sRGB"), 0u);
    EXPECT_EQ(chunks["gAMA"], std::string("\0\0\xcb\x73", 4));
    std::set<std::string> plain;
    for (const auto& [name, bytes] : chunksOf(test::slurp(folder_ / "s.png"))) plain.insert(name);
    EXPECT_TRUE(plain.contains("sRGB") && !plain.contains("cICP"));
    EXPECT_EQ(run(how + "-o b.exr --transfer rec709"), 2);
    EXPECT_NE(said_.find("--transfer rec709"), std::string::npos) << said_;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "b.exr"));
}

TEST_F(Picture, AScanWithoutColoursShowsItsHeightAndItsShape) {
    writeBall("ball.ply");
    const auto differs = [](const std::array<uint32_t, 4>& p) {  // from grey
        return p[3] == 255 && (p[0] > p[2] + 8 || p[2] > p[0] + 8);
    };
    const auto ramp = render("ball.ply", "--alpha"), plain = render("ball.ply", "--alpha --colour plain");
    EXPECT_GT(std::count_if(ramp.begin(), ramp.end(), differs), 100);
    EXPECT_EQ(std::count_if(plain.begin(), plain.end(), differs), 0) << "grey when asked for";
    // Low is blue, high is not.
    const auto columnAt = [&](size_t y) { return ramp[y * 96 + 48]; };
    size_t top = 0, bottom = 63;
    while (top < 63 && columnAt(top)[3] == 0) ++top;
    while (bottom > 0 && columnAt(bottom)[3] == 0) --bottom;
    EXPECT_GT(columnAt(top + 2)[0], columnAt(top + 2)[2]);
    EXPECT_LT(columnAt(bottom - 2)[0], columnAt(bottom - 2)[2]);
    EXPECT_EQ(run("render ball.ply -o t.png --quiet --size 32x32 --mode reference --samples 1"), 0) << said_;
}

TEST_F(Picture, TheLegendTakesTheSamePartOfLargePictures) {
    writeBall("ball.ply");
    const auto partOf = [&](const std::string& size) {
        const auto pixels = [&](const std::string& options) {
            EXPECT_EQ(
                run("render ball.ply -o l.png --quiet --force --device cpu --colour height --size " + size + options),
                0)
                << said_;
            const auto image = image::readImage(folder_ / "l.png");
            return image ? image->rgba : std::vector<uint32_t>(1);
        };
        const std::vector<uint32_t> with = pixels(" --legend"), without = pixels("");
        size_t differ = 0;
        for (size_t i = 0; i < with.size(); ++i) differ += with[i] != without[i] ? 1 : 0;
        return static_cast<double>(differ) / static_cast<double>(with.size());
    };
    const double usual = partOf("1280x720");
    EXPECT_GT(usual, 0.005);
    EXPECT_NEAR(partOf("3840x2160") / usual, 1, 0.1);
}

TEST_F(Picture, ClassesAreLit) {
    ASSERT_EQ(run("grow scan -o a.las --points 5000"), 0) << said_;
    ASSERT_EQ(run("build a.las -o a.stipple --attributes classification --quiet"), 0) << said_;
    const auto colours = [](const std::vector<std::array<uint32_t, 4>>& pixels) {
        return std::set<std::array<uint32_t, 4>>(pixels.begin(), pixels.end()).size();
    };
    EXPECT_GT(colours(render("a.stipple", "--colour class --mode points")),
              2 * colours(render("a.stipple", "--colour class --mode points --shade unlit")));
}

TEST_F(Picture, UpTurnsMeshesToo) {
    writeWedge("m.ply", 0);
    const auto y = render("m.ply"), z = render("m.ply", "--up z");
    EXPECT_NE(y, z);
    ASSERT_EQ(run("build m.ply -o z.stipple --up z --quiet"), 0) << said_;
    EXPECT_EQ(json("info z.stipple --json")["up"], (nlohmann::json{0.0, 0.0, 1.0}));
    EXPECT_EQ(render("z.stipple"), z);
    EXPECT_EQ(render("z.stipple", "--up y"), y);
    test::spit(folder_ / "n.swc", "1 1 0 0 0 1 -1\n2 3 0 5 0 1 1\n3 3 2 9 0 1 2\n");
    ASSERT_EQ(run("build n.swc -o n.stipple --up z --quiet"), 0) << said_;
    EXPECT_EQ(json("info n.stipple --json")["up"], (nlohmann::json{0.0, 0.0, 1.0}));
}

TEST_F(Picture, AFlatSceneThatLooksZUpSaysSo) {
    std::ostringstream out;
    out << "ply\nformat ascii 1.0\nelement vertex 400\nproperty float x\nproperty float y\nproperty float z\n"
           "end_header\n";
    for (int i = 0; i < 400; ++i) out << i % 20 << ' ' << i / 20 << ' ' << 0.1 * (i % 7) << '\n';
    test::spit(folder_ / "flat.ply", out.str());
    ASSERT_EQ(run("render flat.ply -o a.png --size 64x64"), 0);
    EXPECT_NE(said_.find("--up z"), std::string::npos) << said_;
    ASSERT_EQ(run("render flat.ply -o a.png --size 64x64 --up z"), 0);
    EXPECT_EQ(said_.find("--up z"), std::string::npos) << said_;
}

TEST_F(Picture, SeveralPlyMeshesStayTriangles) {
    writeWedge("a.ply", 0);
    writeWedge("b.ply", 3);
    writeBall("p.ply");
    ASSERT_EQ(run("build a.ply b.ply -o both.stipple --quiet"), 0) << said_;
    const nlohmann::json info = json("info both.stipple --verify --json");
    EXPECT_EQ(info["primitive"], "triangles");
    EXPECT_EQ(info["points"], 4);
    EXPECT_EQ(info["max"][0], 4.0);
    EXPECT_EQ(render("a.ply b.ply"), render("both.stipple"));
    ASSERT_EQ(run("build a.ply p.ply -o mixed.stipple --quiet"), 0) << said_;
    EXPECT_NE(said_.find("a.ply has faces"), std::string::npos) << "what is lost is said: " << said_;
}

TEST_F(Picture, InfoNamesTheFacesOfAPly) {
    writeWedge("a.ply", 0);
    EXPECT_EQ(json("info a.ply --json")["faces"], 2);
    ASSERT_EQ(run("info a.ply"), 0);
    EXPECT_NE(printed_.find("faces"), std::string::npos);
    test::spit(folder_ / "s.ply",
               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
               "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
               "4 0 1 2 3\n");
    EXPECT_EQ(json("info s.ply --json")["triangle_strips"], 1);
}

TEST_F(Picture, AFileIsWhatItsBytesSay) {
    writeWedge("a.ply", 0);
    ASSERT_EQ(run("build a.ply -o a.stipple --quiet"), 0) << said_;
    const auto expected = render("a.stipple");
    for (const char* name : {"scene.txt", "scene", "scene.ply", "scene.glb"}) {
        std::filesystem::copy_file(folder_ / "a.stipple", folder_ / name,
                                   std::filesystem::copy_options::overwrite_existing);
        EXPECT_EQ(render(name), expected) << name;
        EXPECT_EQ(json(std::string("info ") + name + " --json")["kind"], "stipple store") << name;
    }
    std::filesystem::copy_file(folder_ / "a.ply", folder_ / "mesh.txt");
    EXPECT_EQ(render("mesh.txt"), expected);
    ASSERT_EQ(run("grow scan -o s.las --points 500"), 0) << said_;
    std::filesystem::copy_file(folder_ / "s.las", folder_ / "s.obj");
    EXPECT_EQ(render("s.obj"), render("s.las"));
}

TEST_F(Picture, InfoAtOfARawInputSaysWhatToDo) {
    writeBall("p.ply");
    EXPECT_EQ(run("info p.ply --at 0,0,0"), 2);
    EXPECT_NE(said_.find("stipple build"), std::string::npos) << said_;
}

}  // namespace
}  // namespace stipple
