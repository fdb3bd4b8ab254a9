// Plants in a gale: what bends is drawn alike by every backend, its normals stand on it, and what is stated of errors
// holds of what is bent. (The oracle bends places near by, one by one, and knows no matrix of normals.)
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "tests/support/backends_here.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr double kGale = 0.5;  // the most that --wind takes

class Gale : public test::BackendsHere {
  protected:
    void SetUp() override {
        BackendsHere::SetUp();
        backends_.erase("fp64");
    }

    static lod::View viewFrom(const dvec3& eye, const dvec3& target, double fov) {
        scene::Camera camera;
        camera.eye = eye;
        camera.target = target;
        camera.up = {0, 1, 0};
        camera.fovDegrees = fov;
        return scene::makeView(camera, 320, 240, 0.02);
    }
    static render::FrameSettings inWind(double strength, double tau) {
        render::FrameSettings s;
        s.draw.lit = true;
        s.draw.worldUp = {0, 1, 0};
        s.draw.wind = {strength, 1.3, {1, 0, 0}};
        s.budgets.errorPixels = tau;
        s.wantDepthAndNormal = true;
        return s;
    }
    std::unique_ptr<render::FrameState> drawn(const std::shared_ptr<const lod::Store>& store, render::Backend& backend,
                                              const lod::View& view, const render::FrameSettings& settings) {
        render::PlacedStore placed{store, {}, {}};
        placed.place.translation = {0.5, 0, -0.25};
        auto state = render::makeFrameState(std::vector{placed}, backend, *executor_, {});
        render::setSway(settings.draw.wind, state->hierarchies, state->instances, state->groups);
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings).value_or(false));
        return state;
    }
    /// (A backend serves one state at a time.)
    render::Image imageOf(const std::shared_ptr<const lod::Store>& store, render::Backend& backend,
                          const lod::View& view, const render::FrameSettings& settings,
                          FrameCounters* counters = nullptr) {
        const auto state = drawn(store, backend, view, settings);
        if (counters) *counters = state->counters;
        return state->image;
    }

    struct Figures {
        double psnr = 0;     ///< of what is drawn in either picture
        double degrees = 0;  ///< between normals, mean over pixels of the same depth
        size_t pixels = 0;
    };
    static Figures compare(const render::Image& a, const render::Image& b) {
        Figures f;
        const auto d = reference::compareImages(a, b, 4, nullptr);
        EXPECT_TRUE(d);
        f.psnr = d ? d->foregroundPsnr : 0;
        for (size_t i = 0; i < a.depth.size(); ++i) {
            if (a.depth[i] <= 0 || std::abs(a.depth[i] - b.depth[i]) > 1e-4 * b.depth[i]) continue;
            const dvec3 n(a.normal[3 * i], a.normal[3 * i + 1], a.normal[3 * i + 2]),
                m(b.normal[3 * i], b.normal[3 * i + 1], b.normal[3 * i + 2]);
            f.degrees += 57.29578 * std::acos(std::clamp(glm::dot(glm::normalize(n), glm::normalize(m)), -1.0, 1.0));
            ++f.pixels;
        }
        f.degrees /= static_cast<double>(std::max<size_t>(f.pixels, 1));
        return f;
    }
    /// What a picture must have of the oracle's, dB. Of splats 8 bits are what differs. Pull-push decides by depths
    /// and distances that are equal but for rounding: single pixels of it take the other side, in wind and without
    /// (43 to 62 dB); lines of narrow curves pass a pixel on either side (51 to 62 dB).
    static double leastPsnr(render::Mode mode) {
        return mode == render::Mode::splat ? 58 : mode == render::Mode::points ? 49 : 42;
    }

    /// What every backend makes of a store in all modes, against the oracle.
    void expectAlike(const std::string& what, const std::shared_ptr<const lod::Store>& store, lod::View view,
                     double tau) {
        const auto oracle = reference::makeReferenceBackend(*executor_);
        for (const bool isOrthographic : {false, true}) {
            if (isOrthographic) {  // of the same place the same size
                view.focalPixels /= glm::length(view.eye - dvec3(0, 4, 0));
                view.isOrthographic = true;
            }
            for (const render::Mode mode :
                 {render::Mode::surface, render::Mode::pullpush, render::Mode::splat, render::Mode::points}) {
                render::FrameSettings settings = inWind(kGale, tau);
                settings.mode = mode;
                render::FrameSettings still = settings;
                still.draw.wind.strength = 0;
                const render::Image truth = imageOf(store, *oracle, view, settings),
                                    calm = imageOf(store, *oracle, view, still);  // said beside it
                for (const auto& [name, backend] : backends_) {
                    FrameCounters counters;
                    const Figures f = compare(imageOf(store, *backend, view, settings, &counters), truth),
                                  without = compare(imageOf(store, *backend, view, still), calm);
                    EXPECT_GT(counters.nodesSwaying, 0u);
                    const std::string where = fmt::format("{}, {}, mode {}{}", what, name, static_cast<int>(mode),
                                                          isOrthographic ? ", orthographic" : "");
                    printf("%-48s %.1f dB (%.1f without wind), normals %.4f degrees of %zu pixels\n", where.c_str(),
                           f.psnr, without.psnr, f.degrees, f.pixels);
                    EXPECT_GT(f.pixels, 400u) << where;
                    EXPECT_GE(f.psnr, leastPsnr(mode)) << where;
                    EXPECT_LE(f.degrees, 0.1) << where;
                }
            }
        }
    }
};

TEST_F(Gale, BendsDiscsAndTheirNormalsAlikeEverywhere) {
    const test::Forest forest = test::plantForest(folder_.path(), 1, *executor_);
    expectAlike("discs", forest.afar, viewFrom({60, 30, 60}, {0, 4, 0}, 12), 1);
    // So near that some discs are wide.
    expectAlike("wide discs", forest.afar, viewFrom({9, 5, 9}, {0, 5, 0}, 8), 1);
}

TEST_F(Gale, BendsRibbonsAndTubesAlikeEverywhere) {
    const auto store = test::buildCurves(test::oak(3000), folder_ / "oak.stipple", *executor_, 512);
    expectAlike("curves from afar", store, viewFrom({60, 30, 60}, {0, 4, 0}, 12), 4);
    expectAlike("curves near by", store, viewFrom({9, 5, 9}, {0, 5, 0}, 12), 1);
}

TEST_F(Gale, LeavesTrianglesAsTheyAre) {
    test::MeshRecipe recipe;
    recipe.grow.kind = "rock";
    recipe.grow.triangles = 5'000;
    recipe.isTextured = false;
    const auto store = test::growMeshStore(recipe, folder_ / "rock.stipple", *executor_);
    const lod::View view = test::fitView(*store, 160, 120);
    for (const auto& [name, backend] : backends_) {
        FrameCounters counters;
        const render::Image calm = imageOf(store, *backend, view, inWind(0, 1), &counters);
        EXPECT_GT(counters.trianglesDrawn, 500u);
        const render::Image windy = imageOf(store, *backend, view, inWind(kGale, 1), &counters);
        EXPECT_TRUE(calm.rgba == windy.rgba && calm.depth == windy.depth) << name;
        EXPECT_EQ(counters.nodesSwaying, 0u);
    }
}

#ifndef STIPPLE_ON_GPU
TEST(BentNodes, HaveNormalsThatStandOnWhatIsBent) {
    Rng rng(3);
    const auto any = [&] { return dvec3(rng.normal(), rng.normal(), rng.normal()); };
    double worst = 0, ofTangents = 0;
    for (int k = 0; k < 2000; ++k) {
        // A turned (and sometimes mirrored) store of any unit, bent across any axis.
        const dvec3 x = glm::normalize(any()), y = glm::normalize(glm::cross(x, any())), z = glm::cross(x, y),
                    up = glm::normalize(any()), along = glm::normalize(glm::cross(up, any()));
        const double unit = std::exp2(rng.uniform(-60, 60)), slope = rng.uniform(-1, 1), mirror = k % 3 == 0 ? -1 : 1;
        const auto bent = [&](const dvec3& v) { return v + along * (slope * glm::dot(up, v)); };
        shared::DrawNode node{};
        node.axisX = glm::vec3(bent(unit * x));
        node.axisY = glm::vec3(bent(unit * y));
        node.axisZ = glm::vec3(bent(mirror * unit * z));
        node.octantMask = shared::kNodeBent | shared::kNodeTurned;
        // A plane through the store's origin: two of its directions where they are drawn, and the side of the normal.
        const dvec3 n = glm::normalize(any()), a = glm::normalize(glm::cross(n, any())), b = glm::cross(n, a);
        const auto placed = [&](const dvec3& v) {
            return dvec3(node.axisX) * v.x + dvec3(node.axisY) * v.y + dvec3(node.axisZ) * v.z;
        };
        dvec3 truth = glm::normalize(glm::cross(placed(a), placed(b)));
        if (glm::dot(truth, placed(n)) < 0) truth = -truth;
        const dvec3 got(shared::nodeUnitNormal(node, glm::vec3(n)));
        EXPECT_NEAR(glm::length(got), 1, 1e-5);
        worst = std::max(worst, glm::length(got - truth));
        ofTangents =
            std::max(ofTangents, glm::length(glm::normalize(dvec3(shared::nodeDirection(node, glm::vec3(n)))) - truth));
    }
    EXPECT_LE(worst, 2e-5);
    EXPECT_GT(ofTangents, 0.5) << "the control: normals that follow the places as tangents do";
}

TEST_F(Gale, StaysWithinWhatIsStatedOfIt) {
    const test::Forest forest = test::plantForest(folder_.path(), 1, *executor_);
    const auto cpu = cpu::makeCpuBackend(*executor_);
    for (const auto& store : {forest.curves, forest.afar})
        for (const double strength : {0.03, kGale}) {
            // Orthographic: what is allowed is the same everywhere.
            lod::View view = viewFrom({60, 30, 60}, {0, 4, 0}, 12);
            view.isOrthographic = true;
            view.focalPixels = 14;
            render::FrameSettings settings = inWind(strength, 2);
            size_t judged = 0;
            double most = 0, farthest = 0, calm = 0;
            for (int k = 0; k < 24; ++k) {
                settings.draw.wind.seconds = 0.7 * k;
                const auto state = drawn(store, *cpu, view, settings);
                const lod::Instance& instance = state->instances[0];
                const lod::Hierarchy& h = *state->hierarchies[0];
                const double height = 2 * instance.scale * h.unit * h.nodes[0].radius;
                for (const lod::CutDraw& draw : state->cut.draw) {
                    const render::Bend bend =
                        render::bendOf(settings.draw.wind, h, instance, draw.node, view, {0, 1, 0});
                    // No farther than the spheres grew.
                    Rng rng(static_cast<uint64_t>(k) * 1000 + draw.node);
                    const dvec3 inside =
                        h.nodes[draw.node].centre +
                        h.nodes[draw.node].radius * glm::normalize(dvec3(rng.normal(), rng.normal(), rng.normal()));
                    const dvec3 p = instance.translation + instance.scale * (h.origin + h.unit * inside);
                    EXPECT_LE(glm::length(bend.moved(p) - p), instance.sway * (1 + 1e-9));
                    farthest = std::max(farthest, glm::length(bend.moved(p) - p) / height);
                    // An error of the calm tree is longer in the wind, and still what was asked for.
                    const double step = instance.scale * h.unit;
                    double error = step * h.errors.decode(std::min(draw.errorCode, lod::ErrorScale::kLargest));
                    if (h.isStochastic) {  // of discs their radius; those of a node drawn whole are what there is
                        const lod::Node& node = h.nodes[draw.node];
                        if (draw.count == node.records) continue;
                        error = step * h.errors.smallest * std::exp2(node.errorCode / 8.0) *
                                std::sqrt(static_cast<double>(node.records) / draw.count);
                    }
                    if (!(error > 0)) continue;
                    const double longest = 0.5 * std::abs(bend.slope) + std::sqrt(1 + 0.25 * bend.slope * bend.slope);
                    most = std::max(most, error * longest * view.focalPixels);
                    calm = std::max(calm, error * view.focalPixels);
                    ++judged;
                }
            }
            printf("%s, wind %.2f: errors up to %.3f px (%.3f px without it), moved by %.3f of the height\n",
                   store == forest.afar ? "discs" : "curves", strength, most, calm, farthest);
            EXPECT_GT(judged, 20u);
            EXPECT_LE(most, 2 * (1 + 1e-9));
            EXPECT_GT(farthest, 0.2 * strength) << "it does blow";
        }
}
#endif

}  // namespace
}  // namespace stipple
