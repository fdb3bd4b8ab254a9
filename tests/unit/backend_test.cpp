// A backend serves whoever comes, and nobody has to go in a certain order.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/frame_passes.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple::render {
namespace {

class Backends : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(8'000, 1));
        test::writePly(folder_ / "b.ply", test::bumpySphere(9'000, 2));
        a_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        b_ = test::buildAndOpen(folder_ / "b.ply", folder_ / "b.stipple", *executor_);
        test::MeshRecipe recipe;
        recipe.grow.kind = "building";
        recipe.grow.triangles = 3'000;
        recipe.grow.textureSize = 128;
        mesh_ = test::growMeshStore(recipe, folder_ / "c.stipple", *executor_);
    }
    static bool covers(const Image& image) {
        return std::any_of(image.rgba.begin(), image.rgba.end(), [](uint32_t p) { return p >> 24 != 0; });
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::shared_ptr<const lod::Store> a_, b_, mesh_;
};

TEST_F(Backends, ServeManyFrameStatesAtOnce) {
    const auto shared = cpu::makeCpuBackend(*executor_);
    std::vector<std::shared_ptr<const lod::Store>> stores{a_, b_, mesh_, a_};
    std::vector<std::unique_ptr<FrameState>> states;
    for (const auto& store : stores) states.push_back(makeFrameState({store}, *shared, *executor_, {}));
    const auto drawAll = [&] {
        for (size_t i = 0; i < states.size(); ++i) {
            if (!states[i]) continue;
            const lod::View view = test::fitView(*stores[i], 160, 120);
            ASSERT_TRUE(renderUntilComplete(*states[i], view, {}));
            const auto own = cpu::makeCpuBackend(*executor_);
            EXPECT_TRUE(states[i]->image.rgba == test::renderView(stores[i], *own, *executor_, view, {}).rgba) << i;
            EXPECT_TRUE(covers(states[i]->image));
        }
    };
    drawAll();
    drawAll();
    states[1].reset();  // what it gives back is nobody else's
    states[2].reset();
    drawAll();
    EXPECT_EQ(shared->resources().textureTiles, 0u);
}

TEST_F(Backends, GoBeforeOrAfterWhatTheyDrew) {
    const lod::View view = test::fitView(*a_, 160, 120);
    for (const bool executorFirst : {false, true}) {
        auto executor = makeTbbExecutor(2);
        auto backend = cpu::makeCpuBackend(*executor);
        auto state = makeFrameState({a_}, *backend, *executor, {});
        ASSERT_TRUE(renderUntilComplete(*state, view, {}));
        backend.reset();
        const auto drawn = renderFrame(*state, view, {});
        ASSERT_FALSE(drawn);
        EXPECT_EQ(drawn.error().kind, ErrorKind::device);
        if (executorFirst) executor.reset();
        state.reset();
    }
}

TEST_F(Backends, RefuseFramesWhoseExecutorIsGone) {
    const lod::View view = test::fitView(*a_, 160, 120);
    const auto backend = cpu::makeCpuBackend(*executor_);
    auto executor = makeTbbExecutor(2);
    auto state = makeFrameState({a_}, *backend, *executor, {});
    ASSERT_TRUE(renderUntilComplete(*state, view, {}));
    executor.reset();
    const auto frame = renderFrame(*state, view, {}), resident = renderResident(*state, view, {});
    const auto complete = renderUntilComplete(*state, view, {});
    ASSERT_FALSE(frame || resident || complete);
    for (const Error& error : {frame.error(), resident.error(), complete.error()}) {
        EXPECT_EQ(error.kind, ErrorKind::device);
        EXPECT_NE(error.line().find("executor"), std::string::npos) << error.line();
    }
}

TEST_F(Backends, AreWaitedForOnTheExecutorOfTheirScene) {
    // The serial one runs what it was given only when somebody waits for it.
    const auto serial = makeSerialExecutor();
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto state = makeFrameState({a_}, *backend, *serial, {});
    const auto complete = renderUntilComplete(*state, test::fitView(*a_, 160, 120), {});
    ASSERT_TRUE(complete);
    EXPECT_TRUE(*complete);
    EXPECT_TRUE(covers(state->image));
}

TEST_F(Backends, GiveThePictureOfATicketOnce) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto state = makeFrameState({a_}, *backend, *executor_, {});
    ASSERT_TRUE(renderUntilComplete(*state, test::fitView(*a_, 160, 120), {}));
    RenderRequest request;
    request.draws = &state->draws;
    request.passes = passesOf(request.mode, contentOf(state->draws), state->draws.effects);
    const auto first = backend->submit(request), second = backend->submit(request);
    ASSERT_TRUE(first && second);
    EXPECT_LT(first->number, second->number);
    EXPECT_TRUE(backend->isDone(*second));
    Image image;
    EXPECT_FALSE(backend->read(*first, image)) << "given up for the second";
    ASSERT_TRUE(backend->read(*second, image));
    EXPECT_TRUE(image.rgba == state->image.rgba);
    const auto again = backend->read(*second, image);
    ASSERT_FALSE(again);
    EXPECT_NE(again.error().line().find("picture"), std::string::npos);
}

}  // namespace
}  // namespace stipple::render
