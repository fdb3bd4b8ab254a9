// "Not measured" is no measurement: what a file declares as no data, what is not a number, and the 1.8e308 that many
// programs write, are left out of ranges, means and colours, and are drawn in grey.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "engine/image/image_io.h"
#include "lod/store/store.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/program.h"

namespace stipple {
namespace {

using test::Outcome;
using test::runProgram;
using test::TempFolder;

constexpr int kSide = 200, kPoints = kSide * kSide;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

// Of point i; not a number: nothing was measured.
double canopyOf(int i) { return i % 10 == 0 ? kNothing : i % 31; }
double countOf(int i) { return i % 7 == 0 ? kNothing : 5 + i % 13; }
double deviationOf(int i) { return i % 5 == 0 || i % 11 == 0 ? kNothing : 1 + (i % 17) / 17.0; }

template <typename T>
void put(std::vector<uint8_t>& to, size_t at, T value) {
    std::memcpy(to.data() + at, &value, sizeof(value));
}

/// A descriptor of the extra bytes record (LAS 1.4, table 24).
std::vector<uint8_t> descriptor(uint8_t type, uint8_t options, const char* name, double scale = 0) {
    std::vector<uint8_t> d(192);
    d[2] = type;
    d[3] = options;
    std::memcpy(d.data() + 4, name, std::strlen(name));
    if (scale > 0) put(d, 112, scale);
    return d;
}

/// A plane with three attributes: fp32 whose no-data is declared as -9999, a scaled i16 whose no-data is the stored -1,
/// and fp64 of which nothing is declared.
void writePlane(const std::string& path) {
    test::LazSpec spec;
    spec.format = 7;
    spec.version = 3;
    spec.extraBytes = 4 + 2 + 8;
    const size_t bytes = test::lazRecordBytes(spec);
    std::vector<uint8_t> records(kPoints * bytes);
    for (int i = 0; i < kPoints; ++i) {
        uint8_t* const p = records.data() + static_cast<size_t>(i) * bytes;
        const std::array<int32_t, 3> xyz{i % kSide * 10, i / kSide * 10, 0};
        std::memcpy(p, xyz.data(), 12);
        p[14] = 0x11;
        const std::array<uint16_t, 3> rgb{0x1000, 0x8000, 0xf000};
        std::memcpy(p + 30, rgb.data(), 6);
        const auto canopy = static_cast<float>(std::isnan(canopyOf(i)) ? -9999 : canopyOf(i));
        const auto count = static_cast<int16_t>(std::isnan(countOf(i)) ? -1 : countOf(i) * 100);
        const double deviation = !std::isnan(deviationOf(i)) ? deviationOf(i)
                                 : i % 5 == 0                ? 1.7976931348623157e308
                                                             : kNothing;
        std::memcpy(p + 36, &canopy, 4);
        std::memcpy(p + 40, &count, 2);
        std::memcpy(p + 42, &deviation, 8);
    }
    std::vector<uint8_t> extra = descriptor(9, 1, "canopy");
    put(extra, 40, -9999.0);
    const std::vector<uint8_t> deviation = descriptor(10, 0, "deviation");
    std::vector<uint8_t> count = descriptor(4, 1 | 8, "count", 0.01);
    put(count, 40, int64_t{-1});
    extra.insert(extra.end(), count.begin(), count.end());
    extra.insert(extra.end(), deviation.begin(), deviation.end());
    std::vector<uint8_t> record(54);
    std::memcpy(record.data() + 2, "LASF_Spec", 9);
    put(record, 18, uint16_t{4});
    put(record, 20, static_cast<uint16_t>(extra.size()));
    record.insert(record.end(), extra.begin(), extra.end());
    Rng rng(1);
    std::vector<uint8_t> file = test::encodeLas(spec, records, false, rng);
    file.insert(file.begin() + 375, record.begin(), record.end());
    put(file, 96, static_cast<uint32_t>(375 + record.size()));
    put(file, 100, uint32_t{1});
    test::spit(path, std::string(file.begin(), file.end()));
}

struct Truth {
    double least = 1e9, greatest = -1e9;
    int without = 0;
};
template <typename ValueOf>
Truth truthOf(const ValueOf& valueOf) {
    Truth t;
    for (int i = 0; i < kPoints; ++i) {
        const double v = valueOf(i);
        t.without += std::isnan(v) ? 1 : 0;
        if (std::isnan(v)) continue;
        t.least = std::min(t.least, v);
        t.greatest = std::max(t.greatest, v);
    }
    return t;
}

nlohmann::json attributeOf(const nlohmann::json& info, const std::string& name) {
    for (const auto& a : info["attributes"])
        if (a["name"] == name) return a;
    return {};
}

TEST(NoData, IsNoPartOfARangeOfAFileOrScene) {
    const TempFolder folder;
    writePlane(folder / "a.las");
    const Outcome built = runProgram(folder, "build a.las -o a.stipple --attributes all --quiet");
    ASSERT_EQ(built.code, 0) << built.err;
    for (const char* input : {"a.las", "a.stipple"}) {
        const auto info = nlohmann::json::parse(runProgram(folder, std::string("info ") + input + " --json").out);
        for (const auto& [name, truth] : {std::pair{"canopy", truthOf(canopyOf)},
                                          {"count", truthOf(countOf)},
                                          {"deviation", truthOf(deviationOf)}}) {
            SCOPED_TRACE(std::string(input) + ", " + name);
            const auto a = attributeOf(info, name);
            ASSERT_TRUE(a.contains("least")) << info;
            EXPECT_NEAR(a["least"].get<double>(), truth.least, 1e-6);
            EXPECT_NEAR(a["greatest"].get<double>(), truth.greatest, 1e-6);
            EXPECT_EQ(a.value("points_without_data", -1), truth.without);
        }
        const std::string text = runProgram(folder, std::string("info ") + input).out;
        EXPECT_NE(text.find(std::to_string(truthOf(canopyOf).without) + " points without data"), std::string::npos)
            << text;
    }
    EXPECT_EQ(runProgram(folder, "info a.stipple --verify").code, 0);
}

TEST(NoData, IsNoPartOfWhatCoarseRecordsSay) {
    const TempFolder folder;
    writePlane(folder / "a.las");
    ASSERT_EQ(runProgram(folder, "build a.las -o a.stipple --attributes all --quiet").code, 0);
    const auto store = lod::openStore(folder / "a.stipple");
    ASSERT_TRUE(store);
    size_t index = 0;
    while (store->description.attributes[index].name != "canopy") ++index;
    size_t coarse = 0;
    for (uint32_t n = 0; n < store->hierarchy.nodes.size(); ++n) {
        const auto stored = lod::readAttribute(*store, n, index);
        ASSERT_TRUE(stored);
        for (size_t at = 0; at < stored->size(); at += 4) {
            float v = 0;
            std::memcpy(&v, stored->data() + at, 4);
            coarse += store->hierarchy.nodes[n].isLeaf() ? 0 : 1;
            ASSERT_TRUE(v == -9999 || (v >= 0 && v <= 30)) << v << " at level " << store->hierarchy.nodes[n].level;
        }
    }
    EXPECT_GT(coarse, 100u);
}

struct Differing {
    uint32_t least = ~0u, greatest = 0, pixels = 0;
};

TEST(NoData, IsGreyBesideALegendOfWhatWasMeasured) {
    const TempFolder folder;
    writePlane(folder / "a.las");
    for (const char* what : {"canopy", "deviation"}) {
        SCOPED_TRACE(what);
        const std::string render = std::string("render a.las --quiet --size 640x400 --mode points --colour ") + what;
        const Outcome plain = runProgram(folder, render + " -o a.png");
        ASSERT_EQ(plain.code, 0) << plain.err;
        ASSERT_EQ(runProgram(folder, render + " -o b.png --legend").code, 0);
        const auto a = image::readImage(folder / "a.png"), b = image::readImage(folder / "b.png");
        ASSERT_TRUE(a && b);
        size_t grey = 0, coloured = 0;
        for (const uint32_t c : a->rgba) {
            const int red = c & 255u, green = c >> 8 & 255u, blue = c >> 16 & 255u;
            grey += red == 0x80 && green == 0x80 && blue == 0x80 ? 1 : 0;
            coloured += std::max({red, green, blue}) - std::min({red, green, blue}) > 40 ? 1 : 0;
        }
        EXPECT_GT(grey, 100u);
        EXPECT_GT(coloured, 1000u);
        Differing legend;
        for (uint32_t i = 0; i < a->rgba.size(); ++i) {
            if (a->rgba[i] == b->rgba[i]) continue;
            legend.least = std::min(legend.least, i % a->width);
            legend.greatest = std::max(legend.greatest, i % a->width);
            ++legend.pixels;
        }
        EXPECT_GT(legend.pixels, 1000u);
        EXPECT_LT(legend.greatest, 200u) << "labels of a few digits";
        // The grey stands in it too, a swatch of 14 x 10 pixels at least.
        size_t swatch = 0;
        for (uint32_t i = 0; i < a->rgba.size(); ++i)
            swatch += a->rgba[i] != b->rgba[i] && (b->rgba[i] & 0xffffffu) == 0x808080u ? 1 : 0;
        EXPECT_GE(swatch, 100u);
    }
}

}  // namespace
}  // namespace stipple
