#include "tests/support/mode_checks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple::test {
namespace {

std::vector<size_t> pixelsInside(Shape shape, const lod::View& view) {
    std::vector<size_t> out;
    for (uint32_t y = 2; y + 2 < view.height; ++y)
        for (uint32_t x = 2; x + 2 < view.width; ++x) {
            bool isInside = true;
            for (int k = 0; k < 9 && isInside; ++k)
                isInside =
                    meetsShape(shape, view.eye, rayThrough(view, x + 0.5 + 2 * (k % 3 - 1), y + 0.5 + 2 * (k / 3 - 1)));
            if (isInside) out.push_back(size_t{y} * view.width + x);
        }
    return out;
}

/// Pieces from the last to the first, and of tasks what was started last ends first.
class BackwardsExecutor final : public Executor {
  public:
    void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) override {
        const size_t step = std::max<size_t>(grain, 1);
        for (size_t pieces = (count + step - 1) / step; pieces > 0; --pieces)
            body((pieces - 1) * step, std::min(pieces * step, count));
    }
    void run(std::function<void()> task) override { tasks_.push_back(std::move(task)); }
    void wait() override {
        while (!tasks_.empty()) {
            const auto task = std::move(tasks_.back());
            tasks_.pop_back();
            task();
        }
    }
    int threads() const override { return 4; }

  private:
    std::vector<std::function<void()>> tasks_;
};

}  // namespace

std::unique_ptr<Executor> makeBackwardsExecutor() { return std::make_unique<BackwardsExecutor>(); }

size_t InsideView::openIn(const render::FrameSettings& settings) const {
    const render::Image image = draw(settings);
    return static_cast<size_t>(
        std::count_if(pixels.begin(), pixels.end(), [&](size_t i) { return image.depth[i] <= 0; }));
}

void forViewsOfAClosedSurface(int poses, uint32_t size, double nearest,
                              const std::function<void(const InsideView&)>& each) {
    const TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    writePly(folder / "a.ply", samplesOf(Shape::torus, 20'000, 3));
    const auto store = buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    Rng rng(8);
    for (int pose = 0; pose < poses; ++pose) {
        InsideView v;
        v.view = lookAt(*store, rng.uniform(0, 360), rng.uniform(-80, 80), std::exp2(rng.uniform(nearest, 2)), size);
        v.errorPixels = pose % 2 == 0 ? 1 : 1e-4;
        v.pixels = pixelsInside(Shape::torus, v.view);
        v.draw = [&](const render::FrameSettings& settings) {
            return renderView(store, *backend, *executor, v.view, settings);
        };
        each(v);
    }
}

void expectSameForAnyThreads(const render::FrameSettings& settings) {
    const TempFolder folder;
    const auto one = makeTbbExecutor(1), four = makeTbbExecutor(4), backwards = makeBackwardsExecutor();
    writePly(folder / "a.ply", anyDiscs(30'000, 6), true, true);
    const auto store = buildAndOpen(folder / "a.ply", folder / "a.stipple", *four);
    lod::View view = viewFromAbove({0, 0, 0});
    view.width = 333;
    render::Image first;
    for (Executor* executor : {one.get(), four.get(), backwards.get()})
        for (auto& [name, backend] : cpuBackendsAndOracle(*executor)) {
            if (name == "fp64") continue;
            const render::Image image = renderView(store, *backend, *executor, view, settings);
            if (first.rgba.empty()) {
                first = image;
                EXPECT_GT(std::count_if(image.depth.begin(), image.depth.end(), [](float z) { return z > 0; }), 10'000);
            }
            EXPECT_TRUE(image.rgba == first.rgba && image.depth == first.depth && image.normal == first.normal)
                << name << ", " << executor->threads() << " threads"
                << (executor == backwards.get() ? ", backwards" : "");
        }
}

}  // namespace stipple::test
