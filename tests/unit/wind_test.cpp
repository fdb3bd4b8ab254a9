// --wind bends plants, and nothing else that is made of curves.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/program.h"

namespace stipple {
namespace {

/// One lock of hair, upright, in the format of cyHair: a head of 128 bytes, then three floats a point.
std::string hair() {
    constexpr uint32_t kCurves = 4, kPoints = 9;
    std::string file(128, '\0');
    const auto put = [&](size_t at, auto value) { std::memcpy(file.data() + at, &value, sizeof(value)); };
    std::memcpy(file.data(), "HAIR", 4);
    put(4, kCurves);
    put(8, kCurves * kPoints);
    put(12, 2u);  // points are all that there is
    put(16, kPoints - 1);
    put(20, 0.1f);
    for (const size_t channel : {28u, 32u, 36u}) put(channel, 0.5f);
    for (uint32_t s = 0; s < kCurves; ++s)
        for (uint32_t k = 0; k < kPoints; ++k)
            for (const float value : {float(s), float(k), 0.2f * float(s)}) {
                file.resize(file.size() + 4);
                put(file.size() - 4, value);
            }
    return file;
}

TEST(WindOfTheProgram, BendsPlantsButNeitherNeuronsNorHair) {
    const test::TempFolder folder;
    std::string neuron;
    for (int k = 1; k <= 20; ++k)
        neuron +=
            std::to_string(k) + " 3 0 " + std::to_string(k) + " 0 0.3 " + std::to_string(k == 1 ? -1 : k - 1) + "\n";
    test::spit(folder / "neuron.swc", neuron);
    test::spit(folder / "lock.hair", hair());
    ASSERT_EQ(test::runProgram(folder, "grow tree -o oak.glb --leaves 300").code, 0);
    const auto picture = [&](const std::string& scene, const std::string& wind) {
        const test::Outcome drawn =
            test::runProgram(folder, "render " + scene + " -o a.png --size 120x120 --force --device cpu" + wind);
        EXPECT_EQ(drawn.code, 0) << drawn.err;
        return test::slurp(folder / "a.png");
    };
    const auto bends = [&](const std::string& scene) {
        const std::string calm = picture(scene, "");
        EXPECT_EQ(calm, picture(scene, ""));
        return calm != picture(scene, " --wind 0.3 --time 1.5");
    };
    EXPECT_TRUE(bends("oak.glb"));
    EXPECT_FALSE(bends("neuron.swc"));
    EXPECT_FALSE(bends("lock.hair"));
    // A store says it too.
    ASSERT_EQ(test::runProgram(folder, "build neuron.swc -o neuron.stipple").code, 0);
    ASSERT_EQ(test::runProgram(folder, "build oak.glb -o oak.stipple").code, 0);
    EXPECT_FALSE(bends("neuron.stipple"));
    EXPECT_TRUE(bends("oak.stipple"));
}

}  // namespace
}  // namespace stipple
