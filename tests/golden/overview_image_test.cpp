// What is small in the picture is drawn as a level of its overview (lod/builder/points/overview.h): a few discs, on
// every backend those of the oracle, seen from all sides, in all modes, and in the colour of what they stand for.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/reference/decode.h"
#include "engine/reference/reference.h"
#include "tests/support/backends_here.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr render::Mode kModes[] = {render::Mode::pullpush, render::Mode::splat, render::Mode::ewa, render::Mode::points,
                                   render::Mode::surface};

class OverviewImages : public test::BackendsHere {
  protected:
    void SetUp() override {
        BackendsHere::SetUp();
        points_ = test::bumpySphere(5'000, 3);  // normals of one side
        test::writePly(folder_ / "a.ply", points_);
        for (const uint32_t leafRecords : {512u, 8192u})
            stores_.push_back(test::buildAndOpen(
                folder_ / "a.ply", folder_ / (std::to_string(leafRecords) + ".stipple"), *executor_, leafRecords));
    }
    /// The sphere, so many pixels across, in the middle of a picture of 33 x 33.
    static lod::View viewFrom(const dvec3& side, double pixels) {
        lod::View view;
        view.eye = 100.0 * side;
        view.forward = -side;
        view.right = glm::normalize(glm::cross(view.forward, dvec3(0.1, 1, 0.2)));
        view.down = glm::cross(view.forward, view.right);
        view.width = view.height = 33;
        view.focalPixels = 0.5 * pixels * 100;
        return view;
    }
    static std::vector<dvec3> sides() {
        std::vector<dvec3> all;
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z)
                    if (x != 0 || y != 0 || z != 0) all.push_back(glm::normalize(dvec3(x, y, z)));
        return all;
    }
    static size_t shown(const render::Image& image) {
        size_t count = 0;
        for (const uint32_t pixel : image.rgba) count += pixel >> 24 != 0 ? 1 : 0;
        return count;
    }
    /// Of the pixels that both show, the share whose depths are a third of a pixel apart (a hundredth of the radius, a
    /// ten-thousandth of the distance: texels round to less), or normals two degrees.
    static double differing(const render::Image& a, const render::Image& b) {
        double count = 0, off = 0;
        for (size_t i = 0; i < a.depth.size(); ++i) {
            if (!(a.depth[i] > 0) || !(b.depth[i] > 0)) continue;
            const glm::vec3 na(a.normal[3 * i], a.normal[3 * i + 1], a.normal[3 * i + 2]),
                nb(b.normal[3 * i], b.normal[3 * i + 1], b.normal[3 * i + 2]);
            ++count;
            off += std::abs(a.depth[i] - b.depth[i]) > 1e-2f || glm::dot(na, nb) < 0.9994f ? 1 : 0;
        }
        return count > 0 ? off / count : 1;
    }
    /// Mean of what is shown, linear.
    static dvec3 meanColour(const render::Image& image) {
        dvec3 sum(0);
        double count = 0;
        for (const uint32_t pixel : image.rgba) {
            if (pixel >> 24 == 0) continue;
            ++count;
            for (int k = 0; k < 3; ++k) sum[k] += reference::decodeSrgb(pixel >> (8 * k) & 255u);
        }
        return sum / count;
    }
    std::vector<test::TestPoint> points_;
    std::vector<std::shared_ptr<const lod::Store>> stores_;  ///< of an inner root, and of one that is a leaf
};

TEST_F(OverviewImages, AreThereFromAllSides) {
    for (const auto& store : stores_)
        for (const render::Mode mode : kModes) {
            const render::FrameSettings settings = test::drawnAs(mode, 1);
            for (const dvec3& side : sides())
                for (const auto& [name, backend] : backends_) {
                    FrameCounters counters;
                    const render::Image image =
                        test::renderView(store, *backend, *executor_, viewFrom(side, 0.4), settings, &counters);
                    SCOPED_TRACE(testing::Message() << name << ", mode " << static_cast<int>(mode) << ", from "
                                                    << side.x << " " << side.y << " " << side.z);
                    ASSERT_GE(shown(image), 1u);
                    ASSERT_LE(shown(image), mode == render::Mode::ewa ? 9u : 4u);
                    ASSERT_LE(counters.recordsTested, 6u);
                }
        }
}

TEST_F(OverviewImages, AreThoseOfTheOracle) {
    const auto oracle = reference::makeReferenceBackend(*executor_);
    lod::View view = viewFrom(glm::normalize(dvec3(1, 2, 3)), 60);
    view.width = view.height = 96;
    for (const auto& store : stores_)
        for (const double tau : {12.0, 20.0, 40.0})
            for (const render::Mode mode : {render::Mode::pullpush, render::Mode::ewa, render::Mode::surface}) {
                const render::FrameSettings settings = test::drawnAs(mode, tau);
                FrameCounters counters;
                const render::Image expected = test::renderView(store, *oracle, *executor_, view, settings, &counters);
                ASSERT_LT(counters.recordsTested, store->hierarchy.ownRecordsOf(store->hierarchy.nodes[0]));
                ASSERT_GT(shown(expected), 1000u);
                for (const auto& [name, backend] : backends_) {
                    SCOPED_TRACE(testing::Message() << name << ", mode " << static_cast<int>(mode) << ", tau " << tau);
                    const render::Image image = test::renderView(store, *backend, *executor_, view, settings);
                    const auto off = reference::compareImages(image, expected, 4, nullptr);
                    ASSERT_TRUE(off);
                    EXPECT_LE(off->differingFraction, 0.004);
                    EXPECT_GE(off->silhouetteIou, 0.99);
                    // (Discs of an overview cross: along these lines rounding says which is in front.)
                    EXPECT_LE(differing(image, expected), 0.02) << "in depth or normal";
                }
            }
}

TEST_F(OverviewImages, KeepTheColourOfWhatTheyStandFor) {
    dvec3 mean(0);
    for (const test::TestPoint& p : points_)
        for (int k = 0; k < 3; ++k) mean[k] += reference::decodeSrgb(p.colour >> (8 * k) & 255u);
    mean /= static_cast<double>(points_.size());
    for (const auto& store : stores_)
        for (const auto& [name, backend] : backends_)
            for (const double pixels : {0.4, 1.5, 4.0}) {
                dvec3 sum(0);
                for (const dvec3& side : sides())
                    sum += meanColour(test::renderView(store, *backend, *executor_, viewFrom(side, pixels),
                                                       test::drawnAs(render::Mode::pullpush, 1, false)));
                const dvec3 off = glm::abs(sum / static_cast<double>(sides().size()) - mean);
                EXPECT_LT(std::max({off.x, off.y, off.z}), 0.04) << name << ", " << pixels << " px";
            }
}

TEST_F(OverviewImages, OfTowersAreThereFromAbove) {
    // Its roof is a sixtieth of what its walls show: of the coarsest level it has no face, and walls are edges.
    std::vector<test::TestPoint> points;
    Rng rng(3);
    for (int side = 0; side < 4; ++side)
        for (int i = 0; i < 800; ++i) {
            const double along = rng.uniform(-0.1, 0.1), up = rng.uniform(-4, 4), sign = side % 2 == 0 ? 1 : -1;
            const dvec3 p = side < 2 ? dvec3(0.1 * sign, along, up) : dvec3(along, 0.1 * sign, up);
            points.push_back({p, side < 2 ? glm::vec3(sign, 0, 0) : glm::vec3(0, sign, 0), 0x808080, 0.03f});
        }
    test::writePly(folder_ / "t.ply", points, true, true);
    const auto store = test::buildAndOpen(folder_ / "t.ply", folder_ / "t.stipple", *executor_, 512);
    for (const bool isOrthographic : {false, true})
        for (const auto& [name, backend] : backends_) {
            lod::View view = viewFrom({0, 0, 1}, 0.4);
            view.isOrthographic = isOrthographic;
            if (isOrthographic) view.focalPixels /= 100;
            FrameCounters counters;
            const render::Image image = test::renderView(store, *backend, *executor_, view,
                                                         test::drawnAs(render::Mode::pullpush, 4), &counters);
            EXPECT_GE(shown(image), 1u) << name;
            EXPECT_LE(counters.recordsTested, 6u);
        }
}

TEST_F(OverviewImages, CoverWhatTheirRecordsCovered) {
    // A meadow of 400 of them, seen by what is allowed and by a tenth of that, which all of their records are drawn
    // for.
    for (const auto& store : stores_) {
        std::vector<render::PlacedStore> placed;
        for (int x = 0; x < 20; ++x)
            for (int y = 0; y < 20; ++y) {
                render::PlacedStore p;
                p.store = store;
                p.place.translation = {5.7 * x - 54, 5.7 * y - 54, 0.3 * ((x * 7 + y * 3) % 5)};
                placed.push_back(p);
            }
        lod::View view = viewFrom({0, 0, 1}, 0.4);
        view.width = view.height = 64;
        view.eye *= 10;  // (so that none is far off the axis)
        view.focalPixels *= 10;
        for (const auto& [name, backend] : backends_) {
            SCOPED_TRACE(name);
            FrameCounters few, all;
            const auto settings = [](double tau) { return test::drawnAs(render::Mode::points, tau); };
            const size_t one = shown(test::draw(placed, *backend, *executor_, view, settings(1), &few)),
                         whole = shown(test::draw(placed, *backend, *executor_, view, settings(0.01), &all));
            EXPECT_LE(few.recordsTested, 2400u);
            EXPECT_GT(all.recordsTested, 100'000u);
            // (A pixel each, where all records of those that lie across a border of pixels claim two or more.)
            EXPECT_GE(one, 380u);
            EXPECT_LE(one, whole);
        }
    }
}

}  // namespace
}  // namespace stipple
