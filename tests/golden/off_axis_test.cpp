// Views whose axis does not go through the middle of the picture: samples of pixels and of lenses. Each backend draws
// them as the oracle does, and a shift of whole pixels moves the picture by as many.
#include <gtest/gtest.h>

#include "engine/reference/reference.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

class OffAxis : public test::BackendsHere {
  protected:
    void SetUp() override {
        BackendsHere::SetUp();
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 3));
        test::MeshRecipe recipe;
        recipe.grow.kind = "rock";
        recipe.grow.triangles = 4'000;
        recipe.isTextured = false;
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        const auto curves = test::buildCurves(test::curls({.count = 60, .radius = 0.06f}), folder_ / "b.stipple",
                                              *executor_),
                   mesh = test::growMeshStore(recipe, folder_ / "c.stipple", *executor_);
        placed_ = {{store_, {}, {}}, {curves, {}, {}}, {mesh, {}, {}}};
        placed_[1].place.translation = {1.5, 0, 0};
        const double size = glm::length(mesh->description.boundsMax - mesh->description.boundsMin);
        placed_[2].place.scale = 2 / size;
        placed_[2].place.translation = {-1.5, 0, 0};
    }
    lod::View view(bool isOrthographic) const {
        lod::View v = test::fitView(*store_, 160, 120);
        if (!isOrthographic) return v;
        v.isOrthographic = true;
        v.focalPixels /= glm::length(v.eye - 0.5 * (store_->description.boundsMin + store_->description.boundsMax));
        return v;
    }
    render::Image drawn(render::Backend& backend, const lod::View& v, render::Mode mode) {
        return test::draw(placed_, backend, *executor_, v, test::drawnAs(mode));
    }
    /// Share of the pixels with a channel more than 4 of 255 apart.
    static double unlike(const render::Image& a, const render::Image& b) {
        size_t count = 0;
        for (size_t i = 0; i < a.rgba.size(); ++i) {
            bool isUnlike = false;
            for (uint32_t shift = 0; shift < 32; shift += 8)
                isUnlike = isUnlike || std::abs(int(a.rgba[i] >> shift & 255u) - int(b.rgba[i] >> shift & 255u)) > 4;
            count += isUnlike ? 1 : 0;
        }
        return double(count) / double(a.rgba.size());
    }
    std::shared_ptr<const lod::Store> store_;
    std::vector<render::PlacedStore> placed_;
};

TEST_F(OffAxis, IsWhatTheOracleDraws) {
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Reconstruction& mode : render::reconstructions())
        for (const bool isOrthographic : {false, true}) {
            lod::View v = view(isOrthographic);
            const render::Image middle = drawn(*oracle, v, mode.mode);
            v.shift = {-21.37, 13.81};
            const render::Image truth = drawn(*oracle, v, mode.mode);
            EXPECT_GT(unlike(middle, truth), 0.1) << "(the shift is seen)";
            // Rounding decides a pixel here and there.
            for (auto& [name, backend] : backends_)
                EXPECT_LE(unlike(drawn(*backend, v, mode.mode), truth), 1e-3)
                    << name << ", mode " << mode.name << (isOrthographic ? ", orthographic" : "");
        }
}

TEST_F(OffAxis, WholePixelsMoveThePicture) {
    placed_.erase(placed_.begin() + 1);  // where curves narrower than a pixel are seen is a matter of the pixel
    constexpr int kRight = 11, kDown = -6;
    for (const bool isOrthographic : {false, true}) {
        lod::View v = view(isOrthographic);
        const render::Image still = drawn(usual(), v, render::Mode::splat);
        v.shift = {kRight, kDown};
        const render::Image moved = drawn(usual(), v, render::Mode::splat);
        size_t unlike = 0, lit = 0;
        for (uint32_t y = 10; y + 10 < v.height; ++y)
            for (uint32_t x = 10; x + 15 < v.width; ++x) {
                const size_t from = size_t{y} * v.width + x,
                             to = size_t(int(y) + kDown) * v.width + size_t(int(x) + kRight);
                lit += still.rgba[from] >> 24 != 0 ? 1 : 0;
                unlike += still.rgba[from] != moved.rgba[to] ? 1 : 0;
            }
        EXPECT_GT(lit, 1000u);
        EXPECT_LE(unlike, lit / 500) << "(outlines that rounding decides)";
    }
}

}  // namespace
}  // namespace stipple
