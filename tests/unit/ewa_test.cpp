// The kernels of shaders/shared/ewa.h against what they stand for: circles seen by a lens, Gaussians that add up to
// one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/render/frame.h"
#include "lod/primitives/record_spacing.h"
#include "shaders/shared/ewa.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;
using namespace shared;

constexpr double kPi = 3.14159265358979;

struct Frame3 {
    dvec3 n, s, t;
};
Frame3 anyFrame(Rng& rng) {
    dvec3 n;
    do n = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
    while (glm::length(n) < 0.1);
    n = glm::normalize(n);
    const dvec3 s = glm::normalize(glm::cross(n, std::abs(n.x) < 0.7 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
    return {n, s, glm::cross(n, s)};
}

TEST(EwaKernels, TheGaussianIsOne) {
    double worst = 0;
    for (int i = 0; i <= 9000; ++i) {
        const double rho2 = i * 1e-3;
        worst = std::max(worst, std::abs(double{gaussian(static_cast<float>(rho2))} - std::exp(-0.5 * rho2)));
    }
    EXPECT_LE(worst, 3.5e-6);
}

/// The image of a disc's rim lies where rho is the support, whatever the lens; without a low-pass.
TEST(EwaKernels, EndAtTheImageOfTheCircle) {
    Rng rng(3);
    double worst = 0;
    size_t checked = 0;
    for (int i = 0; i < 20'000; ++i) {
        const Frame3 f = anyFrame(rng);
        const bool isOrthographic = i % 3 == 0;
        const Lens lens = lensOf(isOrthographic ? 300.0f : 900.0f, isOrthographic);
        const dvec3 c(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(1, 6));
        const double facing = isOrthographic ? f.n.z : glm::dot(f.n, glm::normalize(c));
        const float sigma = static_cast<float>(std::exp2(rng.uniform(-9, -2)));
        if (std::abs(facing) < 0.05) continue;
        const WideDisc d{glm::vec3(c), glm::vec3(f.n), 1.5f * sigma, 0};
        const EwaKernel k = ewaKernel(d, sigma, 2, 0, lens);
        ASSERT_EQ(k.isNear, 0.0f);
        for (int p = 0; p < 8; ++p) {
            const double a = p * kPi / 4;
            const dvec3 at = c + 2.0 * double{sigma} * (std::cos(a) * f.s + std::sin(a) * f.t);
            const double scale = double{lens.focal} / (isOrthographic ? 1 : at.z);
            const double rho =
                std::sqrt(double{ewaRho2(k, static_cast<float>(at.x * scale), static_cast<float>(at.y * scale))});
            // Rounding of places of some thousand pixels: 2e-4 px of the ellipse's shorter axis.
            const double shorter =
                2 * double{sigma} * double{lens.focal} / (isOrthographic ? 1 : c.z) * std::abs(facing);
            worst = std::max(worst, std::abs(rho / 2 - 1) / (1e-4 + 1e-3 / shorter));
            ++checked;
        }
    }
    std::printf("%zu places on rims, worst over its bound %.2f\n", checked, worst);
    EXPECT_GT(checked, 100'000u);
    EXPECT_LE(worst, 1);
}

TEST(EwaKernels, AreFiniteEdgeOnAndAboutTheEye) {
    const Lens lens = lensOf(500, false);
    for (const dvec3& n : {dvec3(1, 0, 0), dvec3(0, 1, 0), dvec3(0.6, 0.8, 0)})
        for (const dvec3& c : {dvec3(0, 0, 2), dvec3(0, 0, 0.01), dvec3(0.1, 0, -0.2), dvec3(0, 0, 0)}) {
            const EwaKernel k = ewaKernel({glm::vec3(c), glm::vec3(n), 0.3f, 0}, 0.2f, 2, 0.5f, lens);
            for (const float v : {k.alongX, k.skew, k.alongY, k.amplitude, k.halfX, k.halfY, k.x, k.y})
                EXPECT_TRUE(std::isfinite(v) || c.z == 0) << c.z;
            if (c.z == 2) EXPECT_EQ(k.amplitude, 0.0f);  // it has no area
            EXPECT_EQ(k.isNear, c.z < 1 ? 1.0f : 0.0f);
        }
}

/// Wherever pixels lie, a kernel sends as much (within 5.6 % at a support of 2, 0.65 % at 3).
TEST(EwaKernels, SendAsMuchWhereverPixelsLie) {
    Rng rng(4);
    for (const float support : {2.0f, 3.0f}) {
        const double end = std::exp(-0.5 * double{support * support});
        const double kept = 1 - 0.5 * double{support * support} * end / (1 - end);
        double worst = 0, unwidened = 0;
        for (int i = 0; i < 40; ++i) {
            const Frame3 f = anyFrame(rng);
            const float sigma = static_cast<float>(std::exp2(rng.uniform(-12, -7)));  // 0.1 to 4 px
            const dvec3 c(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 1);
            if (std::abs(glm::dot(f.n, glm::normalize(c))) < 0.1) continue;
            for (const bool isWidened : {true, false}) {
                const float low = isWidened ? 0.5f : 1e-4f;
                for (int shift = 0; shift < 256; ++shift) {
                    const dvec3 at = c + dvec3(shift % 16, shift / 16, 0) / (16.0 * 500);
                    const EwaKernel k = ewaKernel({glm::vec3(at), glm::vec3(f.n), 1.5f * sigma, 0}, sigma, support, low,
                                                  lensOf(500, false));
                    const double det = 1 / double{k.alongX * k.alongY};  // of the widened ellipse
                    double sum = 0;
                    const auto reaches = [](float half) { return static_cast<int>(half) + 3; };
                    for (int y = -reaches(k.halfY); y <= reaches(k.halfY); ++y)
                        for (int x = -reaches(k.halfX); x <= reaches(k.halfX); ++x) {
                            const float rho2 = ewaRho2(k, std::floor(k.x) + static_cast<float>(x),
                                                       std::floor(k.y) + static_cast<float>(y));
                            sum += double{kernelAt(std::min(rho2, support * support), kernelEnd(support))};
                        }
                    const double off = std::abs(sum / (2 * kPi * std::sqrt(det) * kept) - 1);
                    (isWidened ? worst : unwidened) = std::max(isWidened ? worst : unwidened, off);
                }
            }
        }
        std::printf("support %g: %.2f %% with the low-pass, %.0f %% without\n", double{support}, 100 * worst,
                    100 * unwidened);
        // (Those of the truncated kernel, at a spread of sqrt(1/2) px and more.)
        EXPECT_LE(worst, support > 2.5f ? 0.0065 : 0.056);
        EXPECT_GT(unwidened, 0.5);
    }
}

/// Of a grid that ends at a line, weights with their amplitude add up to what a pixel's Gaussian sees of it.
TEST(EwaKernels, AddUpToTheCoverageOfAHalfPlane) {
    const Lens lens = lensOf(1000, false);
    double worst = 0, withoutAmplitude = 0;
    for (const double spacing : {0.25, 0.5, 1.0, 2.0, 4.0})
        for (const double tilt : {1.0, 0.25, 0.1}) {  // cosine to the view
            const dvec3 n(0, std::sqrt(1 - tilt * tilt), -tilt);
            const double s = spacing / 1000;
            const float sigma = static_cast<float>(0.685 * s);
            const int reach = static_cast<int>(8 / std::min(spacing * tilt, spacing)) + 8;
            std::vector<EwaKernel> kernels;
            for (int j = -reach; j <= reach; ++j)
                for (int i = -2 * reach; i <= 0; ++i) {  // the edge: half a spacing beyond the last
                    const dvec3 along(1, 0, 0), across = glm::cross(n, along);
                    const dvec3 at = dvec3(0, 0, 1) + s * ((i - 0.5) * along + double(j) * across);
                    kernels.push_back(ewaKernel({glm::vec3(at), glm::vec3(n), 1.5f * sigma, 0}, sigma, 3, 0.5f, lens));
                }
            const double width = std::sqrt(0.5 + 0.685 * 0.685 * spacing * spacing);
            for (double x = -3; x <= 3; x += 0.5) {
                double sum = 0, plain = 0;
                for (const EwaKernel& k : kernels) {
                    const double w =
                        double{kernelAt(std::min(ewaRho2(k, static_cast<float>(x), 0), 9.0f), kernelEnd(3))};
                    sum += w * double{k.amplitude * gridWeight(3)};
                    plain += w * double{gridWeight(3)};
                }
                const double truth = 0.5 * std::erfc(x / (std::sqrt(2.0) * width));
                worst = std::max(worst, std::abs(sum - truth));
                withoutAmplitude = std::max(withoutAmplitude, std::abs(plain - truth));
            }
        }
    std::printf("coverage off by %.3f, without amplitudes by %.1f\n", worst, withoutAmplitude);
    EXPECT_LE(worst, 0.05);
    EXPECT_GT(withoutAmplitude, 1);
}

TEST(RecordSpacing, IsThatOfTheGrid) {
    Rng rng(5);
    for (const uint32_t step : {40u, 200u, 1000u})
        for (const double jitter : {0.0, 0.25}) {
            std::vector<PointRecord> records;
            for (uint32_t y = 0; y < 60; ++y)
                for (uint32_t x = 0; x < 60; ++x) {
                    const auto at = [&](uint32_t i) {
                        return static_cast<uint32_t>(1000 + (i + rng.uniform(-jitter, jitter)) * step);
                    };
                    const uint32_t px = at(x), py = at(y);
                    records.push_back({px | py << 16, 500, 0, 0});
                }
            EXPECT_NEAR(lod::recordSpacing(records), step, 0.1 * step) << jitter;
        }
    EXPECT_EQ(lod::recordSpacing({}), 0.0f);
    EXPECT_EQ(lod::recordSpacing(std::vector<PointRecord>(6)), 0.0f);
    EXPECT_EQ(lod::recordSpacing(std::vector<PointRecord>(50)), 0.0f);  // all at one place
}

/// The same median of the same records, each held against all others.
float spacingBySearch(const std::vector<PointRecord>& records) {
    std::vector<int64_t> sixths;
    for (size_t p = 0; p < std::min<size_t>(24, records.size()); ++p) {
        const PointRecord& from = records[(p * 2654435761u + 12345u) % records.size()];
        std::vector<int64_t> squares;
        for (const PointRecord& r : records) {
            const int64_t x = int64_t{shared::recordX(r)} - shared::recordX(from),
                          y = int64_t{shared::recordY(r)} - shared::recordY(from),
                          z = int64_t{shared::recordZ(r)} - shared::recordZ(from);
            squares.push_back(x * x + y * y + z * z);
        }
        std::sort(squares.begin(), squares.end());
        sixths.push_back(squares[6]);
    }
    std::sort(sixths.begin(), sixths.end());
    return std::sqrt(3.14159265f * static_cast<float>(sixths[sixths.size() / 2]) / 6.5f);
}

// In any order and of any number: of blocks that are asked first none may be left out.
TEST(RecordSpacing, IsThatOfASearchThroughAll) {
    Rng rng(7);
    for (const size_t count : {7, 8, 15, 16, 17, 100, 127, 128, 129, 145, 300, 1000})
        for (const bool isOrdered : {false, true})
            for (int set = 0; set < 20; ++set) {
                const double extent = set % 2 == 0 ? 65535 : 3000;
                std::vector<PointRecord> records;
                for (size_t i = 0; i < count; ++i) {
                    const auto at = [&] { return static_cast<uint32_t>(rng.uniform(0, extent)); };
                    const uint32_t x = at(), y = at(), z = set % 4 < 2 ? at() : 100;
                    records.push_back({x | y << 16, z, 0, 0});
                }
                const auto isBefore = [](const PointRecord& a, const PointRecord& b) {
                    return std::pair(a.positionXY >> 28, a.positionXY & 0xffffu) <
                           std::pair(b.positionXY >> 28, b.positionXY & 0xffffu);
                };
                if (isOrdered) std::sort(records.begin(), records.end(), isBefore);
                ASSERT_EQ(lod::recordSpacing(records), spacingBySearch(records)) << count << ", set " << set;
            }
}

/// Eighths of octaves, rounded up: never less, and less than a tenth more.
TEST(RecordSpacing, CodesRoundUp) {
    EXPECT_EQ(lod::spacingCodeUp(0), 0u);
    EXPECT_EQ(lod::spacingCodeUp(std::nanf("")), 0u);
    EXPECT_EQ(lod::spacingOfCode(0), 0.0f);
    EXPECT_EQ(lod::spacingCodeUp(0.7f), 1u);  // one step is the least
    Rng rng(6);
    for (int i = 0; i < 20'000; ++i) {
        const auto steps = static_cast<float>(std::exp2(rng.uniform(0, 17)));
        const uint8_t code = lod::spacingCodeUp(steps);
        EXPECT_GE(lod::spacingOfCode(code), steps);
        EXPECT_LT(lod::spacingOfCode(code), 1.0906f * steps);
        EXPECT_NEAR(double{lod::spacingOfCode(code)}, std::exp2((code - 1) / 8.0), 1e-6 * double{steps});
        EXPECT_EQ(lod::spacingCodeUp(lod::spacingOfCode(code)), code);
    }
}

/// What a build writes is what is drawn; of older stores it is measured once their chunks arrive.
TEST(RecordSpacing, IsToldByStoresAndMeasuredOfOlderOnes) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 20'000, 3));
    const auto built = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    auto older = std::make_shared<lod::Store>(*built);
    for (lod::Node& n : older->hierarchy.nodes) {
        EXPECT_GT(n.spacingCode, 0u);
        n.spacingCode = 0;
    }
    const lod::View view = test::viewFromAbove({0, 0, 0});
    const auto spacings = [&](const std::shared_ptr<const lod::Store>& store) {
        const auto state = render::makeFrameState({store}, *backend, *executor, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, {}));
        std::vector<float> out;
        for (const DrawNode& d : state->draws.of(lod::Kind::points).nodes) out.push_back(d.spacing);
        return out;
    };
    const std::vector<float> told = spacings(built), measured = spacings(older);
    ASSERT_EQ(told.size(), measured.size());
    ASSERT_GT(told.size(), 3u);
    for (size_t i = 0; i < told.size(); ++i) {
        EXPECT_GT(measured[i], 0.0f);
        EXPECT_GE(told[i], measured[i] * 0.99999f);
        EXPECT_LT(told[i], measured[i] * 1.0907f);
    }
}

}  // namespace
}  // namespace stipple
