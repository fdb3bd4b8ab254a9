// Hard case 34: processors may take denormal numbers as zero (GPUs do, and what is linked with fast-math). Nothing
// hangs on it: the same store, the same pictures.
#include <gtest/gtest.h>
#if defined(__SSE2__)
#include <xmmintrin.h>

#include <limits>

#include "engine/render/reconstructions/table.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// Denormal results and operands are zero, of this thread.
class Flushed {
  public:
    Flushed() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040u); }
    ~Flushed() { _mm_setcsr(before_); }
    Flushed(const Flushed&) = delete;
    Flushed& operator=(const Flushed&) = delete;

  private:
    unsigned before_;
};

TEST(Denormals, AreZeroWhereTheyAreFlushed) {
    volatile float least = std::numeric_limits<float>::min();
    const Flushed flushed;
    EXPECT_EQ(least * 0.5f, 0.0f) << "the control: this test can tell";
}

TEST(Denormals, ChangeNeitherStoresNorPictures) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();  // all in this thread
    auto points = test::bumpySphere(4'000, 1);
    Rng rng(1);
    for (test::TestPoint& p : points) p.colour = rng.below(4) == 0 ? 0 : static_cast<uint32_t>(rng.below(0x1000000));
    // As it is, and so small that products of four of its lengths, and of two, are denormal in fp32.
    for (const double scale : {1.0, 1e-10, 1e-20}) {
        auto scaled = points;
        for (test::TestPoint& p : scaled) p.position *= scale;
        test::writePly(folder / "a.ply", scaled);
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        const std::string bytes = test::slurp(folder / "a.stipple");
        {
            const Flushed flushed;
            (void)test::buildAndOpen(folder / "a.ply", folder / "b.stipple", *executor);
        }
        EXPECT_EQ(test::slurp(folder / "b.stipple"), bytes) << scale;
        lod::View view = test::fitView(*store, 96, 96);
        view.nearPlane = 1e-3 * scale;
        for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor))
            for (const render::Reconstruction& r : render::reconstructions()) {
                SCOPED_TRACE(testing::Message() << name << " " << r.name << " x " << scale);
                const auto drawn = [&, of = backend.get()] {
                    return test::renderView(store, *of, *executor, view, test::drawnAs(r.mode, 1));
                };
                const render::Image plain = drawn();
                size_t covered = 0;
                for (const uint32_t p : plain.rgba) covered += p >> 24 != 0;
                EXPECT_GT(covered, 900u);
                const Flushed flushed;
                const render::Image same = drawn();
                EXPECT_EQ(same.rgba, plain.rgba);
                EXPECT_EQ(same.depth, plain.depth);
                EXPECT_EQ(same.normal, plain.normal);
            }
    }
}

}  // namespace
}  // namespace stipple
#endif
