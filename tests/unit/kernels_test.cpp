// Every instruction set draws the same bytes: the kernels' formulas are compiled without fused multiplications, so that
// one operation is rounded alike wherever it stands.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class InstructionSets : public testing::TestWithParam<const char*> {};

TEST_P(InstructionSets, DrawTheBytesThatSseDraws) {
    size_t count = 0;
    const cpu::Kernels* const* const all = cpu::availableKernels(count);
    const auto found = std::find_if(all, all + count, [](const auto* k) { return std::string(k->name) == GetParam(); });
    if (found == all + count)
        GTEST_SKIP() << "SKIPPED: this machine has no " << GetParam() << "; its pictures are not compared";
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "a.ply", test::bumpySphere(30'000, 1));
    test::MeshRecipe textured, plain;
    textured.grow.kind = "building";
    textured.grow.triangles = 20'000;
    textured.grow.textureSize = 256;
    plain.grow.kind = "rock";
    plain.grow.triangles = 60'000;
    plain.isTextured = false;
    const std::vector<std::shared_ptr<const lod::Store>> stores{
        test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor),
        test::growMeshStore(textured, folder / "b.stipple", *executor),
        test::growMeshStore(plain, folder / "c.stipple", *executor),
        test::buildCurves(test::curls({}), folder / "d.stipple", *executor)};
    size_t compared = 0, drawn = 0;
    for (const auto& store : stores)
        for (const render::Mode mode : {render::Mode::surface, render::Mode::pullpush, render::Mode::splat,
                                        render::Mode::ewa, render::Mode::points, render::Mode::pullpushExact})
            for (const double tau : {0.25, 1.0, 4.0})
                for (const bool lit : {true, false})
                    for (const bool isOrthographic : {false, true}) {
                        render::FrameSettings settings;
                        settings.mode = mode;
                        settings.budgets.errorPixels = tau;
                        settings.draw.lit = lit;
                        settings.wantDepthAndNormal = true;
                        lod::View view = test::fitView(*store, 400, 300);
                        if (isOrthographic) {  // kernels of their own
                            const double away = glm::length(view.eye);
                            view.isOrthographic = true;
                            view.focalPixels /= away;
                        }
                        const auto draw = [&](const cpu::Kernels* kernels) {
                            const auto backend = cpu::makeCpuBackend(*executor, kernels);
                            return test::renderView(store, *backend, *executor, view, settings);
                        };
                        const render::Image of = draw(*found), sse = draw(all[0]);
                        const std::string what =
                            fmt::format("{} tau {} lit {} orthographic {}", store->path, tau, lit, isOrthographic);
                        EXPECT_TRUE(of.rgba == sse.rgba) << what;
                        EXPECT_TRUE(of.linear == sse.linear) << what;
                        EXPECT_TRUE(of.depth == sse.depth && of.normal == sse.normal) << what;
                        compared += of.rgba.size();
                        drawn += static_cast<size_t>(
                            std::count_if(of.depth.begin(), of.depth.end(), [](float z) { return z > 0; }));
                    }
    EXPECT_GT(compared, 0u);
    EXPECT_GT(drawn, compared / 20);
}
INSTANTIATE_TEST_SUITE_P(Each, InstructionSets, testing::Values("avx2", "avx512"),
                         [](const auto& of) { return std::string(of.param); });

}  // namespace
}  // namespace stipple
