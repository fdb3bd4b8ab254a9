// Elevation patches in pictures: what rays meet of the lifted triangles, as the fp64 restatement draws them, and the
// same bytes whoever draws.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_samples.h"
#include "tests/support/backends_here.h"
#include "tests/support/patch_scene.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

using test::PatchScene;

double waves(double x, double y) { return 0.15 * std::sin(5 * x) * std::cos(4 * y + x); }

lod::View viewFrom(const glm::dvec3& eye, const glm::dvec3& at, bool isOrthographic, uint32_t width = 160) {
    lod::View view;
    view.eye = eye;
    view.forward = glm::normalize(at - eye);
    view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 0.9, 0.2)));
    view.down = glm::cross(view.forward, view.right);
    view.width = width;
    view.height = width * 3 / 4;
    view.focalPixels = isOrthographic ? 0.4 * width : 1.1 * width;
    view.nearPlane = 1e-3;
    view.isOrthographic = isOrthographic;
    return view;
}

struct RayHit {
    double depth = HUGE_VAL, slope = 0;  ///< slope: depth a pixel changes at most
};

/// Triangles in camera space, and where their corners are seen.
class Lifted {
  public:
    Lifted(const std::vector<test::Triangle>& triangles, const lod::View& view) : view_(view) {
        for (const test::Triangle& t : triangles) {
            std::array<glm::dvec3, 3> c{};
            for (size_t k = 0; k < 3; ++k) {
                const glm::dvec3 d = t.at(k) - view.eye;
                c.at(k) = {glm::dot(d, view.right), glm::dot(d, view.down), glm::dot(d, view.forward)};
            }
            camera_.push_back(c);
        }
        for (uint32_t y = 0; y < view.height; ++y)
            for (uint32_t x = 0; x < view.width; ++x) hits.push_back(meet({x + 0.5, y + 0.5}));
    }
    std::vector<RayHit> hits;  ///< of the pixels

    /// Brute force: the nearest triangle that the ray through an image point meets, solved as three linear equations.
    RayHit meet(const glm::dvec2& pixel) const {
        const glm::dvec2 off = (pixel - 0.5 * glm::dvec2(view_.width, view_.height)) / view_.focalPixels;
        const glm::dvec3 o = view_.isOrthographic ? glm::dvec3(off, 0) : glm::dvec3(0),
                         d = view_.isOrthographic ? glm::dvec3(0, 0, 1) : glm::dvec3(off, 1);
        RayHit hit;
        for (size_t k = 0; k < camera_.size(); ++k) {
            const auto& [a, b, c] = camera_[k];
            const glm::dmat3 m(b - a, c - a, -d);
            const double det = glm::determinant(m);
            if (det == 0) continue;
            const glm::dvec3 x = glm::inverse(m) * (o - a);
            if (x.x < 0 || x.y < 0 || x.x + x.y > 1 || x.z < view_.nearPlane || x.z >= hit.depth) continue;
            const glm::dvec3 n = glm::normalize(glm::cross(b - a, c - a));
            // The depth of the plane along the image.
            const double scale = view_.isOrthographic ? 1 / view_.focalPixels : x.z / view_.focalPixels;
            hit = {x.z, std::hypot(n.x, n.y) / std::abs(glm::dot(n, d)) * scale};
        }
        return hit;
    }
    /// Pixels to the nearest edge of any triangle.
    double toEdge(const glm::dvec2& pixel) const {
        double nearest = HUGE_VAL;
        for (const auto& c : camera_)
            for (size_t k = 0; k < 3; ++k) {
                const glm::dvec3 &p = c.at(k), &q = c.at((k + 1) % 3);
                if (p.z < view_.nearPlane || q.z < view_.nearPlane) continue;
                const glm::dvec2 a = at(p), b = at(q), e = b - a;
                const double along = std::clamp(glm::dot(pixel - a, e) / std::max(glm::dot(e, e), 1e-30), 0.0, 1.0);
                nearest = std::min(nearest, glm::length(a + along * e - pixel));
            }
        return nearest;
    }

  private:
    glm::dvec2 at(const glm::dvec3& p) const {
        return glm::dvec2(p) * (view_.focalPixels / (view_.isOrthographic ? 1 : p.z)) +
               0.5 * glm::dvec2(view_.width, view_.height);
    }
    const lod::View view_;
    std::vector<std::array<glm::dvec3, 3>> camera_;
};

/// Pixels of the picture that are not what rays meet, though no edge is within `snap` px; of how many seen.
struct Against {
    size_t seen = 0, wrong = 0, nearEdges = 0;
};
Against compareWithRays(const render::Image& image, const Lifted& truth, double snap = 1.0 / 256) {
    Against a;
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            const size_t i = size_t{y} * image.width + x;
            const RayHit& hit = truth.hits[i];
            const bool isSeen = image.rgba[i] >> 24 != 0 && image.depth[i] > 0, isThere = hit.depth < HUGE_VAL;
            a.seen += isThere ? 1 : 0;
            // Corners lie on steps of `snap` px: the plane through them is off by what it falls in sqrt(1/2) of that.
            const double bound = std::ldexp(hit.depth, -20) + hit.slope * std::sqrt(0.5) * snap;
            if (isSeen == isThere && (!isThere || std::abs(double{image.depth[i]} - hit.depth) <= bound)) continue;
            const bool isNearEdge = truth.toEdge({x + 0.5, y + 0.5}) <= snap;
            ++(isNearEdge ? a.nearEdges : a.wrong);
        }
    return a;
}

/// Pixels that two pictures both show, and those where they do not agree.
struct Geometry {
    size_t both = 0, oneSided = 0, depths = 0, normals = 0;
};
Geometry compareGeometry(const render::Image& a, const render::Image& b) {
    Geometry g;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        g.oneSided += (a.depth[i] > 0) != (b.depth[i] > 0) ? 1 : 0;
        if (!(a.depth[i] > 0 && b.depth[i] > 0)) continue;
        ++g.both;
        g.depths += std::abs(a.depth[i] - b.depth[i]) > 1e-3f * std::max(b.depth[i], 0.5f) ? 1 : 0;
        double along = 0;
        for (size_t k = 0; k < 3; ++k) along += double{a.normal[3 * i + k]} * b.normal[3 * i + k];
        g.normals += along < std::cos(3.14159 / 180) ? 1 : 0;
    }
    return g;
}

std::vector<lod::Patch> closedTorus() {
    lod::PatchSettings settings;
    settings.samples = 3000;
    lod::PatchSet set = test::patchesOf(test::torusMesh(80, 30), settings);
    for (lod::Patch& p : set.patches) p.origin += set.middle;
    return set.patches;
}
std::vector<test::Triangle> lifted(const std::vector<lod::Patch>& patches) {
    std::vector<test::Triangle> all;
    for (const lod::Patch& p : patches) {
        const auto own = test::trianglesOf(p, glm::dvec3(0));
        all.insert(all.end(), own.begin(), own.end());
    }
    return all;
}
/// Shrunk into [-1, 1]^3 by a power of two.
std::vector<lod::Patch> within(std::vector<lod::Patch> patches) {
    double most = 0;
    for (const test::Triangle& t : lifted(patches))
        for (const glm::dvec3& p : t) most = std::max({most, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    const int down = std::max(0, static_cast<int>(std::ceil(std::log2(most))));
    for (lod::Patch& p : patches) {
        p.origin =
            glm::dvec3(std::ldexp(p.origin.x, -down), std::ldexp(p.origin.y, -down), std::ldexp(p.origin.z, -down));
        p.step = std::ldexp(p.step, -down);
        p.quantumExponent -= down;
    }
    return patches;
}

class PatchImages : public test::BackendsHere {
  protected:
    /// Every backend against the fp64 restatement. Where patches cross each other either may be the nearer one: no more
    /// than one pixel of `share` in depth and normals.
    void expectRestated(PatchScene& scene, render::Mode mode, const lod::View& view,
                        const render::DrawSettings& settings, const lod::Instance& place, size_t share) {
        const auto oracle = reference::makeReferenceBackend(*executor_);
        const render::Image expected = scene.draw(*oracle, view, mode, settings, place);
        for (const auto& [name, backend] : backends_) {
            const std::string what =
                name + ", " + render::reconstructionOf(mode).name + (view.isOrthographic ? ", orthographic" : "");
            const render::Image image = scene.draw(*backend, view, mode, settings, place);
            const auto d = reference::compareImages(image, expected, 4, nullptr);
            ASSERT_TRUE(d);
            EXPECT_GE(d->psnr, 50) << what;
            EXPECT_LE(d->differingFraction, 0.001) << what;
            const Geometry g = compareGeometry(image, expected);
            EXPECT_GT(g.both, 2000u) << what;
            EXPECT_LE(g.oneSided + g.depths + g.normals, g.both / share)
                << what << ": " << g.oneSided << " + " << g.depths << " + " << g.normals << " of " << g.both;
        }
    }
};

TEST_F(PatchImages, ShowWhatRaysMeetOfTheLiftedTriangles) {
    const glm::dquat turn = glm::normalize(glm::dquat(0.8, 0.3, -0.4, 0.2));
    const std::vector<std::vector<lod::Patch>> scenes{{test::patchOfHeights(41, 37, waves, 0.1, turn)},
                                                      within(closedTorus())};
    for (size_t s = 0; s < scenes.size(); ++s) {
        PatchScene scene(scenes[s]);
        for (const bool isOrthographic : {false, true}) {
            const lod::View view = viewFrom({0.5, 1.4, 1.9}, {0.05, 0, 0}, isOrthographic);
            const Lifted truth(lifted(scenes[s]), view);
            for (const auto& [name, backend] : backends_) {
                const Against a = compareWithRays(scene.draw(*backend, view), truth);
                EXPECT_GT(a.seen, 2000u) << name;
                EXPECT_EQ(a.wrong, 0u) << name << ", scene " << s << ", " << isOrthographic;
                EXPECT_LE(a.nearEdges, a.seen / 100) << name;
            }
        }
    }
}

render::DrawSettings as(uint32_t what) {
    render::DrawSettings settings;
    settings.patchAs = what;
    return settings;
}

// Splats know no steps: a 4096th of a pixel is what fp32 leaves of places.
TEST_F(PatchImages, AsSplatsShowWhatRaysMeetToFloats) {
    const glm::dquat turn = glm::normalize(glm::dquat(0.8, 0.3, -0.4, 0.2));
    const std::vector<lod::Patch> patches{test::patchOfHeights(41, 37, waves, 0.1, turn)};
    PatchScene scene(patches);
    for (const bool isOrthographic : {false, true}) {
        const lod::View view = viewFrom({0.5, 1.4, 1.9}, {0.05, 0, 0}, isOrthographic);
        const Lifted truth(lifted(patches), view);
        for (const auto& [name, backend] : backends_) {
            if (name == "fp64") continue;  // it writes floats, too, but shows nothing at corners alone
            const Against a = compareWithRays(
                scene.draw(*backend, view, render::Mode::pullpush, as(shared::kPatchSplats)), truth, 1.0 / 4096);
            EXPECT_GT(a.seen, 2000u) << name;
            EXPECT_EQ(a.wrong, 0u) << name << ", " << isOrthographic;
            EXPECT_LE(a.nearEdges, a.seen / 1000) << name;
            // Triangles on steps of 1/256 px do not stand that test.
            const Against strips = compareWithRays(scene.draw(*backend, view), truth, 1.0 / 4096);
            EXPECT_GT(strips.wrong, 10u) << name;
        }
    }
}

TEST_F(PatchImages, AsSplatsAreThoseOfTheRestatement) {
    PatchScene torus(within(closedTorus())), few({test::patchOfHeights(4, 3, waves)}),
        holes({test::patchOfHeights(41, 37, waves, 0.1)});
    for (const uint32_t way : {shared::kPatchSplats, shared::kPatchDirect}) {
        render::DrawSettings settings = as(way);
        settings.lit = true;
        for (PatchScene* scene : {&torus, &few, &holes})
            for (const bool isOrthographic : {false, true})
                for (const glm::dvec3& eye :
                     {glm::dvec3(0.5, 1.4, 1.9), glm::dvec3(0.3, 0.25, 0.5)})  // the latter: inside
                    expectRestated(*scene, render::Mode::splat, viewFrom(eye, {0.05, 0, 0}, isOrthographic, 240),
                                   settings, {}, scene == &torus ? 300 : 1000);
    }
}

// A disc at a border shows nothing where its patch draws no cell, and closed surfaces are closed but for single pixels
// beside outlines, where discs of a bent surface part: 1 of 100,000 of the picture's.
TEST_F(PatchImages, AsDirectSplatsEndWhereTheirCellsDo) {
    const std::vector<lod::Patch> holed{test::patchOfHeights(
        41, 37, [](double, double) { return 0; }, 0.2)};
    PatchScene plane(holed), torus(within(closedTorus()));
    const lod::View view = viewFrom({0.2, 0.3, 2.2}, {0, 0, 0}, false, 240);
    const Lifted truth(lifted(holed), view);
    struct Off {
        size_t seen = 0, beyond = 0, open = 0;
    };
    const auto offOf = [&](const render::Image& image) {
        Off off;
        for (size_t i = 0; i < image.depth.size(); ++i) {
            const bool isThere = truth.hits[i].depth < HUGE_VAL;
            off.seen += isThere && image.depth[i] > 0 ? 1 : 0;
            if ((image.depth[i] > 0) == isThere) continue;
            const double x = static_cast<double>(i % image.width) + 0.5, y = static_cast<double>(i / image.width) + 0.5;
            if (truth.toEdge({x, y}) > 1.0 / 256) ++(isThere ? off.open : off.beyond);
        }
        return off;
    };
    for (const auto& [name, backend] : backends_) {
        const auto drawn = [&](uint32_t way) {
            return offOf(plane.draw(*backend, view, render::Mode::splat, as(way)));
        };
        const Off direct = drawn(shared::kPatchDirect);
        EXPECT_GT(direct.seen, 10'000u) << name;
        EXPECT_EQ(direct.beyond, 0u) << name;
        EXPECT_EQ(direct.open, 0u) << name;
        EXPECT_GT(drawn(lod::kPatchesAsSamples).beyond, 500u) << name << ", the control: whole discs";
    }
    size_t inside = 0, open = 0;
    for (int k = 0; k < 24; ++k) {
        const double a = 0.7 * k;
        const lod::View around =
            viewFrom({1.8 * std::cos(a), 1.8 * std::sin(a), 1.4 * std::cos(2.1 * k)}, {0, 0, 0}, false, 400);
        const render::Image strips = torus.draw(usual(), around),
                            discs = torus.draw(usual(), around, render::Mode::splat, as(shared::kPatchDirect));
        for (size_t i = around.width + 1; i + around.width + 1 < strips.depth.size(); ++i) {
            bool isInside = true;
            for (size_t n = 0; n < 9; ++n)
                isInside = isInside && strips.depth[i + (n / 3) * around.width + n % 3 - around.width - 1] > 0;
            inside += isInside ? 1 : 0;
            open += isInside && !(discs.depth[i] > 0) ? 1 : 0;
        }
    }
    EXPECT_GT(inside, 500'000u);
    EXPECT_LE(open, inside / 100'000);
}

/// Nine samples of one height whose normals turn outwards (Ochotta, Hiller & Saupe 2006, Fig 5).
lod::Patch nineSplats() {
    lod::Patch p = test::patchOfHeights(3, 3, [](double, double) { return 0; });
    for (uint32_t s = 0; s < 9; ++s)
        p.normals[s] = lod::roundedNormal(
            glm::vec3(0.5f * (static_cast<float>(s % 3) - 1), 0.5f * (static_cast<float>(s / 3) - 1), 1));
    return p;
}
/// The largest angle between normals of pixels beside each other, degrees.
double largestJump(const render::Image& image) {
    double jump = 0;
    for (uint32_t y = 0; y + 1 < image.height; ++y)
        for (uint32_t x = 0; x + 1 < image.width; ++x)
            for (const size_t step : {size_t{1}, size_t{image.width}}) {
                const size_t i = size_t{y} * image.width + x, j = i + step;
                if (!(image.depth[i] > 0 && image.depth[j] > 0)) continue;
                double along = 0;
                for (size_t k = 0; k < 3; ++k) along += double{image.normal[3 * i + k]} * image.normal[3 * j + k];
                jump = std::max(jump, std::acos(std::min(along, 1.0)) * 180 / 3.14159265);
            }
    return jump;
}

TEST_F(PatchImages, OfNineSplatsTurnSmoothlyWhereInterpolatedCorrectlyAndJumpWhereDirectly) {
    PatchScene scene({nineSplats()});
    lod::View view = viewFrom({0.3, -1.2, 1.6}, {0, 0, 0}, false, 240);
    // Across a cell, 1 unit, normals turn by atan(1/2) at most, along its diagonal by atan(sqrt(1/2)); a pixel is
    // |depth| / focal units across, and 1 / cosine of the slant longer.
    const double unitsPerPixel = 2.6 / view.focalPixels / 0.6, gradient = 35.3 * unitsPerPixel;
    for (const auto& [name, backend] : backends_) {
        const auto jumpOf = [&](uint32_t what) {
            return largestJump(scene.draw(*backend, view, render::Mode::pullpush, as(what)));
        };
        EXPECT_LE(jumpOf(shared::kPatchSplats), 1.5 * gradient) << name;
        EXPECT_LE(jumpOf(shared::kPatchStrips), 1.5 * gradient) << name;
        EXPECT_GE(jumpOf(shared::kPatchDirect), 4 * gradient) << name;
    }
}

TEST_F(PatchImages, AreTheSameBytesOnEveryInstructionSetAndForAnyThreads) {
    PatchScene scene(within(closedTorus()));
    const lod::View view = viewFrom({0.5, 1.4, 1.9}, {0.05, 0, 0}, false, 200);
    const auto one = makeSerialExecutor();
    for (const uint32_t what : {shared::kPatchStrips, shared::kPatchSplats, shared::kPatchDirect}) {
        const auto serial = cpu::makeCpuBackend(*one);
        const render::Image expected = scene.draw(*serial, view, render::Mode::pullpush, as(what));
        for (const auto& [name, backend] : backends_) {
            if (backend->name() != "cpu") continue;
            const render::Image image = scene.draw(*backend, view, render::Mode::pullpush, as(what));
            EXPECT_EQ(image.rgba, expected.rgba) << name << what;
            EXPECT_EQ(image.depth, expected.depth) << name << what;
            EXPECT_EQ(image.normal, expected.normal) << name << what;
        }
    }
}

TEST_F(PatchImages, AsSamplesArePointsOfEveryMode) {
    lod::Patch patch = test::patchOfHeights(61, 57, waves);
    for (uint32_t s = 0; s < patch.colours.size(); ++s)
        patch.colours[s] = 4 * (s % 61) | (4 * (s / 61)) << 8 | 0x400000;
    PatchScene scene({patch});
    const lod::View view = viewFrom({0.5, 1.4, 1.9}, {0.05, 0, 0}, false, 200);
    const render::Image strips = scene.draw(usual(), view);
    render::DrawSettings settings = as(lod::kPatchesAsSamples);
    settings.lit = true;
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Reconstruction& mode : render::reconstructions()) {
        const render::Image expected = scene.draw(*oracle, view, mode.mode, settings);
        for (const auto& [name, backend] : backends_) {
            const render::Image image = scene.draw(*backend, view, mode.mode, settings);
            const auto d = reference::compareImages(image, expected, 4, nullptr);
            ASSERT_TRUE(d);
            EXPECT_GE(d->psnr, 50) << name << ", " << mode.name;
            // Closed, and within half a cell of the surface, where the mode closes surfaces.
            size_t open = 0, off = 0, seen = 0;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                if (!(strips.depth[i] > 0)) continue;
                ++seen;
                open += image.depth[i] > 0 ? 0 : 1;
                off += image.depth[i] > 0 && std::abs(image.depth[i] - strips.depth[i]) > 0.02f ? 1 : 0;
            }
            EXPECT_GT(seen, 5000u);
            if (mode.mode == render::Mode::points)
                EXPECT_GT(open, seen / 4) << "a pixel a sample";
            else
                EXPECT_LE(open, seen / 500) << name << ", " << mode.name << ": at the border alone";
            EXPECT_LE(off, seen / 50) << name << ", " << mode.name;
        }
    }
}

TEST(PatchSamples, AreEachOnceAndInTheirCell) {
    const lod::Patch patch = test::patchOfHeights(50, 23, waves, 0.4);
    PatchScene scene({patch});
    lod::Chunk chunk = scene.chunk();
    const size_t blocks = chunk.patchBlocks.size();
    lod::samplesAsPoints(scene.hierarchy(), 0, chunk);
    EXPECT_EQ(chunk.records.size(), lod::recordsOfSamples(blocks));
    EXPECT_TRUE(chunk.patchBlocks.empty() && chunk.patchPlanes.empty());
    const auto records = lod::withoutEmpty(chunk.records);
    EXPECT_EQ(records.size(), patch.samples());
    size_t atSamples = 0;
    for (const shared::PointRecord& r : records) {
        EXPECT_EQ(shared::recordErrorCode(r), 0u);
        const glm::dvec3 q = glm::dvec3(shared::recordX(r), shared::recordY(r), shared::recordZ(r)) / 32768.0 - 1.0;
        double nearest = HUGE_VAL;
        const lod::PatchSurface surface(patch);
        for (size_t s = 0; s < patch.heights.size(); ++s)
            if (patch.heights[s] != 0) nearest = std::min(nearest, glm::length(surface.position(s) - q));
        atSamples += nearest <= std::sqrt(3.0) / 65536 + 1.0 / 65536 ? 1 : 0;  // half a step each way, and its middle
        EXPECT_LE(nearest, 0.6 * double{patch.step}) << "at borders: in the middle of the quarters of cells";
    }
    size_t inside = 0;
    for (uint32_t j = 1; j + 1 < patch.height; ++j)
        for (uint32_t i = 1; i + 1 < patch.width; ++i)
            inside +=
                patch.hasCell(i - 1, j - 1) && patch.hasCell(i, j - 1) && patch.hasCell(i - 1, j) && patch.hasCell(i, j)
                    ? 1
                    : 0;
    EXPECT_GT(inside, 100u);
    EXPECT_GE(atSamples, inside) << "and some between two cells that meet at the sample alone";
}

// Normals of a texture, or of a crease's other side, say nothing about the cells: a radius of theirs (Eq 1) made discs
// of six steps, upright on the patch.
TEST(PatchSamples, KeepToTheirCellsWhateverTheirNormalsSay) {
    for (const double slope : {0.0, 0.5, 4.0}) {
        const auto fromRidge = [](double x) { return x - 0.4 * std::round(x / 0.4); };
        const auto f = [&](double x, double) { return slope * std::abs(fromRidge(x)) - 0.5; };
        lod::Patch patch = test::patchOfHeights(40, 40, f);
        for (uint32_t s = 0; s < patch.normals.size(); s += 3)
            patch.normals[s] = lod::roundedNormal(glm::normalize(glm::vec3(1, 0.2 * (s % 7), 0.02)));
        PatchScene scene({patch});
        lod::Chunk chunk = scene.chunk();
        lod::samplesAsPoints(scene.hierarchy(), 0, chunk);
        const double step{patch.step}, rounding = std::exp2(1.0 / 16);  // of radii, outwards
        size_t seen = 0;
        for (const shared::PointRecord& r : lod::withoutEmpty(chunk.records)) {
            const double radius = 2 * double{shared::radiusFraction(shared::recordRadiusCode(r))};
            const double x = fromRidge(shared::recordX(r) / 32768.0 - 1);
            EXPECT_LE(radius, std::sqrt(2.0) * step * rounding);
            if (std::abs(x) < 1.1 * step || std::abs(x) > 0.2 - 1.1 * step) continue;
            ++seen;
            const glm::dvec3 face = glm::normalize(glm::dvec3(x > 0 ? -slope : slope, 0, 1));
            const glm::dvec3 normal(shared::octDecode(r.normal));
            EXPECT_LE(radius * glm::length(glm::cross(face, normal)), (0.5 * rounding + 0.01) * step) << slope;
        }
        EXPECT_GT(seen, 300u);
    }
}

// What the test of strips would say of a surface that is off by a quarter of a pixel.
TEST_F(PatchImages, OfASurfaceAQuarterOfAPixelAwayAreNotWhatRaysMeet) {
    std::vector<lod::Patch> patches{test::patchOfHeights(41, 37, waves)};
    PatchScene scene(patches);
    const lod::View view = viewFrom({0.5, 1.4, 1.9}, {0.05, 0, 0}, false);
    patches[0].origin.z += 0.25 * 2.4 / view.focalPixels;
    EXPECT_GT(compareWithRays(scene.draw(usual(), view), Lifted(lifted(patches), view)).wrong, 1000u);
}

TEST_F(PatchImages, AreThoseOfTheRestatementInEveryMode) {
    PatchScene torus(within(closedTorus())), one({test::patchOfHeights(41, 37, waves, 0.1)});
    render::DrawSettings settings;
    settings.lit = true;
    lod::Instance place;
    place.rotation = glm::mat3_cast(glm::normalize(glm::dquat(0.9, 0.1, 0.4, -0.2)));
    place.translation = {0.1, -0.2, 0.05};
    place.scale = 0.9;
    for (PatchScene* scene : {&torus, &one})
        for (const render::Reconstruction& mode : render::reconstructions())
            for (const bool isOrthographic : {false, true})
                for (const glm::dvec3& eye :
                     {glm::dvec3(0.5, 1.4, 1.9), glm::dvec3(0.3, 0.25, 0.5)})  // the latter: inside
                    expectRestated(*scene, mode.mode, viewFrom(eye, {0.05, 0, 0}, isOrthographic, 240), settings, place,
                                   scene == &torus ? 300 : 1000);
}

TEST_F(PatchImages, OfOneCellAndOfAPlaneAtHeightZeroAreWhole) {
    for (const uint32_t side : {2u, 18u}) {
        PatchScene scene({test::patchOfHeights(side, side, [](double, double) { return std::ldexp(1.0, -15) - 1; })});
        lod::View view = viewFrom({0, 0, 3}, {0, 0, -1}, true, 100);
        view.focalPixels = 30;
        const render::Image image = scene.draw(usual(), view);
        const double edge = scene.chunk().patchPlanes[0].step * std::ldexp(1.0, -20) * (side - 1) * view.focalPixels;
        size_t seen = 0;
        for (size_t i = 0; i < image.rgba.size(); ++i) {
            if (image.rgba[i] >> 24 == 0) continue;
            ++seen;
            EXPECT_NEAR(image.depth[i], 4 - std::ldexp(1.0, -15), 1e-6);
        }
        EXPECT_NEAR(static_cast<double>(seen), edge * edge, 4 * edge * 0.5 + 1) << side;
    }
}

TEST_F(PatchImages, TheNearerOfTwoSheetsIsSeenFromBothSides) {
    for (const double apart : {1e-3, 2e-4}) {
        lod::Patch low = test::patchOfHeights(30, 30, waves), high = low;
        high.origin.z += apart;
        for (uint32_t& c : low.colours) c = 0x0000ff;
        for (uint32_t& c : high.colours) c = 0x00ff00;
        PatchScene scene({low, high});
        for (const double side : {1.0, -1.0}) {
            const render::Image image = scene.draw(usual(), viewFrom({0.1, 0.2, side * 2.5}, {0, 0, 0}, false));
            size_t nearer = 0, farther = 0;
            for (const uint32_t c : image.rgba) {
                if (c >> 24 == 0) continue;
                const bool isHigh = (c >> 8 & 255u) > (c & 255u);
                ++(isHigh == (side > 0) ? nearer : farther);
            }
            EXPECT_GT(nearer, 5000u);
            EXPECT_LE(farther, nearer / 100) << "at silhouettes alone";
        }
    }
}

}  // namespace
}  // namespace stipple
