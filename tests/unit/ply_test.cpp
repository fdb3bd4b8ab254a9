#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "lod/import/import.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

Result<std::vector<PointBlock>> readAll(const std::string& path) {
    auto source = openPointSource(path);
    if (!source) return tl::unexpected(source.error());
    std::vector<PointBlock> blocks;
    const auto read = readPoints(*source, [&](const PointBlock& block) -> Result<void> {
        blocks.push_back(block);
        return {};
    });
    if (!read) return tl::unexpected(read.error());
    return blocks;
}

void writeText(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

TEST(Ply, ReadsAnyOrderAndTypeAndSkipsTheRest) {
    const test::TempFolder folder;
    writeText(folder / "a.ply",
              "ply\r\nformat ascii 1.0\ncomment hello\nelement camera 1\nproperty float fov\nelement vertex "
              "2\nproperty uchar red\n"
              "property double z\nproperty list uchar int extra\nproperty short x\nproperty float y\nproperty uchar "
              "green\nproperty uchar blue\n"
              "element face 1\nproperty list uchar int vertex_indices\nend_header\n50\n10 3.5 2 7 8 -1 2e1 20 30\n\n40 "
              "1 0 5 +6 50 60\n3 0 1 1\n");
    const auto blocks = readAll(folder / "a.ply");
    ASSERT_TRUE(blocks) << blocks.error().line();
    ASSERT_EQ(blocks->size(), 1u);
    const PointBlock& b = blocks->front();
    EXPECT_EQ(b.position[0], glm::dvec3(-1, 20, 3.5));
    EXPECT_EQ(b.position[1], glm::dvec3(5, 6, 1));
    EXPECT_EQ(b.colour[0], 10u | 20u << 8 | 30u << 16);
}

TEST(Ply, BigAndLittleEndianAgree) {
    const test::TempFolder folder;
    for (const bool big : {false, true}) {
        std::string body;
        const auto put = [&](auto value) {
            std::array<char, sizeof(value)> bytes{};
            std::memcpy(bytes.data(), &value, sizeof(value));
            if (big) std::reverse(bytes.begin(), bytes.end());
            body.append(bytes.data(), bytes.size());
        };
        put(1.25f);
        put(-2.5);
        put(int16_t{300});
        put(0.5f);
        writeText(folder / "a.ply", std::string("ply\nformat binary_") + (big ? "big" : "little") +
                                        "_endian 1.0\nelement vertex 1\nproperty float x\nproperty double y\nproperty "
                                        "short z\nproperty float radius\nend_header\n" +
                                        body);
        const auto blocks = readAll(folder / "a.ply");
        ASSERT_TRUE(blocks) << blocks.error().line();
        EXPECT_EQ(blocks->front().position[0], glm::dvec3(1.25, -2.5, 300));
        EXPECT_EQ(blocks->front().radius[0], 0.5f);
    }
}

TEST(Ply, EveryTruncatedLengthIsRefusedInOneLine) {
    const test::TempFolder folder;
    test::writePly(folder / "whole.ply", test::bumpySphere(3, 1));
    std::ifstream in(folder / "whole.ply", std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(in)), {});
    for (size_t length = 0; length < whole.size(); ++length) {
        writeText(folder / "cut.ply", whole.substr(0, length));
        const auto blocks = readAll(folder / "cut.ply");
        ASSERT_FALSE(blocks) << "at length " << length;
        EXPECT_EQ(blocks.error().kind, ErrorKind::input);
        EXPECT_EQ(blocks.error().line().find('\n'), std::string::npos);
        EXPECT_NE(blocks.error().line().find("cut.ply"), std::string::npos);
    }
}

TEST(Ply, RefusesLiesAndNonsenseBeforeAllocating) {
    const test::TempFolder folder;
    const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
    for (const std::string& text : std::vector<std::string>{
             "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n" + xyz + "end_header\nabc",
             "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n" + xyz + "end_header\n",
             "ply\nformat ascii 1.0\nelement vertex 99999999999\n" + xyz + "end_header\n1 2 3\n",
             "ply\nformat ascii 1.0\nelement vertex -1\n" + xyz + "end_header\n1 2 3\n",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n1\n",
             std::string("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
             std::string("ply\nformat ascii 1.0\nelement face 0\nend_header\n"),
             std::string("ply\nformat klingon 1.0\nend_header\n"), std::string("ply\nproperty float x\nend_header\n"),
             "ply\nformat ascii 1.0\nelement vertex 1\n" + xyz + "end_header\n1 two 3\n"}) {
        writeText(folder / "a.ply", text);
        const auto blocks = readAll(folder / "a.ply");
        EXPECT_FALSE(blocks) << text;
    }
}

TEST(Ply, NotANumberIsDroppedAndCounted) {
    const test::TempFolder folder;
    auto points = test::bumpySphere(100, 1);
    points[3].position.x = std::nan("");
    points[7].position.z = HUGE_VAL;
    points[8].normal = glm::vec3(std::nanf(""));
    test::writePly(folder / "a.ply", points);
    const auto executor = makeSerialExecutor();
    const BuildReport report = test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
    EXPECT_EQ(report.pointsIn, 100u);
    EXPECT_EQ(report.pointsOut, 98u);
    EXPECT_EQ(report.dropped.at("not_finite"), 2u);
}

}  // namespace
}  // namespace stipple::lod
