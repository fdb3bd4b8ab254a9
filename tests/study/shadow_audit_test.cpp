// The audit of borders of shadows: over scenes, modes, lights and cameras, against rays through the full detail.
// Violations are counted, and are none where a kind is exact.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/study/audit/shadows.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/patch_shapes.h"
#include "tests/support/shadow_scene.h"

namespace stipple {
namespace {

using namespace test::shadows;
using glm::dvec3;

class ShadowAudits : public testing::Test {
  protected:
    struct Sum {
        study::ShadowAudit all;
        uint64_t halved = 0;  ///< beyond half of what is stated
        void add(const study::ShadowAudit& a) {
            all.lookedAt += a.lookedAt;
            all.dark += a.dark;
            all.wrong += a.wrong;
            all.beyond += a.beyond;
            all.worst = std::max(all.worst, a.worst);
            all.stated = std::max(all.stated, a.stated);
        }
    };
    using Placed = std::vector<render::PlacedStore>;

    static std::vector<lod::View> path() {
        return {viewOf(), viewOf(false, {-2.6, -2.4, 1.4}), viewOf(false, {4.5, 5, 6}), viewOf(true)};
    }
    /// The picture, and what of the light it shows.
    std::unique_ptr<render::FrameState> drawn(const Placed& placed, render::Backend& backend, const lod::View& view,
                                              const render::FrameSettings& settings) {
        auto state = render::makeFrameState(placed, backend, *executor_, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings).value_or(false));
        return state;
    }
    static void withoutShadows(render::DrawSettings& draw) { draw.lights[0].castsShadow = false; }
    static void without(render::DrawSettings& draw) {
        withoutShadows(draw);
        draw.lights[0].colour = glm::vec3(0);
    }

    /// What rays through the full detail say of a view.
    struct Truth {
        lod::View view;
        render::Image open;
        std::vector<double> share;
    };
    std::vector<Truth> truthsOf(const Placed& placed, const render::WorldLight& light) {
        std::vector<Truth> truths;
        for (const lod::View& view : path()) {
            render::FrameSettings settings = under(light), open = settings, dark = settings;
            withoutShadows(open.draw);
            without(dark.draw);
            const auto look = [&](const render::FrameSettings& s) {
                return *reference::trace(placed, view, {1, s.draw}, *executor_);
            };
            const render::Image with = look(settings), unlit = look(dark);
            Truth truth{view, look(open), {}};
            truth.share = study::lightShares({with, truth.open, unlit});
            truths.push_back(std::move(truth));
        }
        return truths;
    }
    Sum audit(const Placed& placed, const render::WorldLight& light, const std::vector<Truth>& truths,
              render::Mode mode, double tau, double texels) {
        Sum sum;
        const auto backend = cpu::makeCpuBackend(*executor_);
        for (const Truth& truth : truths) {
            render::FrameSettings settings = under(light, mode);
            settings.budgets.errorPixels = tau;
            settings.draw.parameters.shadow.texels = texels;
            render::FrameSettings open = settings, dark = settings;
            withoutShadows(open.draw);
            without(dark.draw);
            // (A backend serves one state at a time.)
            const render::Image lit = drawn(placed, *backend, truth.view, open)->image,
                                unlit = drawn(placed, *backend, truth.view, dark)->image;
            const auto state = drawn(placed, *backend, truth.view, settings);
            const auto shown = study::lightShares({state->image, lit, unlit});
            std::vector<double> stated = study::statedBorders(*state, truth.view, truth.open, light);
            sum.add(study::auditShadows(shown, truth.share, stated, truth.view.width));
            for (double& s : stated) s *= 0.5;
            sum.halved += study::auditShadows(shown, truth.share, stated, truth.view.width).beyond;
        }
        return sum;
    }
    void expectKept(const char* what, const Placed& placed, std::initializer_list<render::Mode> modes, double share) {
        for (const render::WorldLight& light : {sun(), spot()}) {
            const std::vector<Truth> truths = truthsOf(placed, light);
            for (const render::Mode mode : modes)
                for (const auto& [tau, texels] : {std::pair{0.5, 1024.0}, {2.0, 256.0}}) {
                    const Sum s = audit(placed, light, truths, mode, tau, texels);
                    std::printf(
                        "%s, %s, %s, %.1f px, %.0f texels: %lu pixels, %lu in shadow, %lu wrong, %lu beyond, "
                        "%lu beyond half; worst %.1f px, %.1f stated\n",
                        what, render::reconstructionOf(mode).name, light.kind == shared::kLightSpot ? "spot" : "sun",
                        tau, texels, static_cast<unsigned long>(s.all.lookedAt), static_cast<unsigned long>(s.all.dark),
                        static_cast<unsigned long>(s.all.wrong), static_cast<unsigned long>(s.all.beyond),
                        static_cast<unsigned long>(s.halved), s.all.worst, s.all.stated);
                    EXPECT_GT(s.all.lookedAt, 20'000u);
                    EXPECT_GT(s.all.dark, 1'000u);
                    EXPECT_LE(s.all.share(), share) << what << " " << render::reconstructionOf(mode).name;
                }
        }
    }

    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
};

/// Of pixels: what may lie beyond in modes that mix discs, of rough scans (discs that stand out of each other shade
/// each other), and of curves that are narrower than a texel, which are lines in maps.
constexpr double kOfPoints = 1e-4;

TEST_F(ShadowAudits, AShiftedBorderIsFoundAndCounted) {
    // A shadow of 20 columns, shown three pixels too far to one side.
    constexpr uint32_t kWidth = 64;
    std::vector<double> traced(size_t{kWidth} * 40, 1), shown(traced);
    for (size_t i = 0; i < traced.size(); ++i) {
        if (i % kWidth >= 20 && i % kWidth < 40) traced[i] = 0;
        if (i % kWidth >= 23 && i % kWidth < 43) shown[i] = 0;
    }
    const auto auditOf = [&](double stated) {
        return study::auditShadows(shown, traced, std::vector<double>(traced.size(), stated), kWidth);
    };
    EXPECT_EQ(auditOf(2.5).beyond, 0u);
    EXPECT_EQ(auditOf(2.5).wrong, size_t{2 * 3 * 40});
    EXPECT_EQ(auditOf(2.5).worst, 3);
    EXPECT_EQ(auditOf(1.5).beyond, size_t{2 * 40});
    EXPECT_EQ(auditOf(0.5).beyond, size_t{2 * 2 * 40});
    EXPECT_EQ(auditOf(0.5).dark, size_t{20 * 40});
    EXPECT_EQ(auditOf(std::nan("")).lookedAt, 0u);
}

TEST_F(ShadowAudits, BordersOfPointsKeepTheirBound) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto ball = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    expectKept("floor and ball as points", {{ball, {}, {}}}, {render::Mode::surface, render::Mode::splat}, 0);
    expectKept("floor and ball as points", {{ball, {}, {}}}, {render::Mode::pullpush, render::Mode::ewa}, kOfPoints);
    std::vector<test::TestPoint> points = floorAndBall(false), rough = test::bumpySphere(40'000, 3);
    for (test::TestPoint& p : rough) p.position = 0.6 * p.position + dvec3(0, 0, 0.7);
    points.insert(points.end(), rough.begin(), rough.end());
    test::writePly(folder_ / "b.ply", points);
    const auto bumps = test::buildAndOpen(folder_ / "b.ply", folder_ / "b.stipple", *executor_);
    expectKept("floor and bumps as points", {{bumps, {}, {}}}, {render::Mode::surface, render::Mode::splat}, kOfPoints);
}

TEST_F(ShadowAudits, BordersOfTrianglesKeepTheirBound) {
    const Placed placed{{triangles(folder_ / "m.stipple", *executor_), {}, {}}};
    expectKept("floor and ball as triangles", placed, {render::Mode::surface}, 0);
    render::WorldLight turned = sun();
    turned.direction = glm::normalize(turned.direction + 0.15 * dvec3(1, 0, 0));
    const Sum control = audit(placed, sun(), truthsOf(placed, turned), render::Mode::surface, 0.5, 1024);
    std::printf("by a sun that stands seven degrees elsewhere: %lu beyond\n",
                static_cast<unsigned long>(control.all.beyond));
    EXPECT_GT(control.all.beyond, 200u) << "the control";
}

TEST_F(ShadowAudits, BordersOfCurvesKeepTheirBound) {
    test::writePly(folder_ / "a.ply", floorAndBall(false), true, true);
    const auto floor = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    test::CurlRecipe recipe;
    recipe.count = 60;
    recipe.radius = 0.03f;
    lod::CurveSet curls = test::curls(recipe);
    for (dvec3& p : curls.position) p = 0.5 * p + dvec3(0, 0, 0.8);
    const auto store = test::buildCurves(curls, folder_ / "c.stipple", *executor_);
    expectKept("floor of points and curls", {{floor, {}, {}}, {store, {}, {}}}, {render::Mode::surface}, kOfPoints);
}

TEST_F(ShadowAudits, BordersOfPatchesKeepTheirBound) {
    test::writePly(folder_ / "a.ply", floorAndBall(false), true, true);
    const auto floor = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    lod::PatchBuildSettings settings;
    settings.leafTriangles = 1500;
    settings.description.materials.resize(1);
    Progress silent(false);
    ASSERT_TRUE(lod::buildPatchStore(lod::sourceOf(test::torusMesh(120, 60)), folder_ / "p.stipple", settings,
                                     *executor_, silent));
    auto opened = lod::openStore(folder_ / "p.stipple");
    ASSERT_TRUE(opened);
    render::PlacedStore torus;
    torus.store = std::make_shared<const lod::Store>(std::move(*opened));
    torus.place.scale = 0.6;
    torus.place.translation = {0, 0, 0.9};
    expectKept("floor of points and a torus of patches", {{floor, {}, {}}, torus}, {render::Mode::surface}, 0);
}

}  // namespace
}  // namespace stipple
