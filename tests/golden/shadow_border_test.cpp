// Shadows: their borders are where closed forms and traced rays have them, to the error that is stated.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "engine/render/shadow_frame.h"
#include "tests/support/backends_here.h"
#include "tests/support/shadow_scene.h"

namespace stipple {
namespace {

using namespace test::shadows;
using glm::dvec3;

/// How far a place of the floor is from the border of the ball's shadow, across the light's ray: inside below 0.
double fromBorder(const dvec3& p, const render::WorldLight& light, const dvec3& ball) {
    if (light.kind == shared::kLightDirectional) return glm::length(glm::cross(p - ball, light.direction)) - kRadius;
    const dvec3 ray = glm::normalize(p - light.position);
    const double apart = glm::length(glm::cross(ball - light.position, ray)) - kRadius;
    return apart * glm::length(p - light.position) / glm::dot(ball - light.position, ray);
}

struct Border {
    std::vector<double> errors, stated;  ///< pixels
    double worst() const {
        double most = 0;
        for (size_t i = 0; i < errors.size(); ++i) most = std::max(most, errors[i] / stated[i]);
        return most;
    }
    /// Of how many the error is larger than the stated one.
    double beyond(double times = 1) const {
        double count = 0;
        for (size_t i = 0; i < errors.size(); ++i) count += errors[i] > times * stated[i] ? 1 : 0;
        return count / double(errors.size());
    }
};
/// Of pixels of the floor: how far they are from the border (inside below 0), what comes to them, and the error that is
/// stated there, pixels of the picture.
struct FloorPixel {
    double apart, share, stated;
};
/// `texels`: so many count as one.
std::vector<FloorPixel> floorOf(const Mask& mask, const lod::View& view, const render::WorldLight& light,
                                const dvec3& ball, double texels = 1) {
    std::vector<FloorPixel> floor;
    const render::Image& image = mask.state->image;
    const render::ShadowMaps& maps = *mask.state->draws.shadowMaps;
    for (size_t i = 0; i + view.width < mask.share.size(); ++i) {
        if (!(image.depth[i] > 0) || mask.share[i] < 0) continue;
        const dvec3 p = placeOf(view, i, double{image.depth[i]});
        if (std::abs(p.z) > 1e-3 || std::abs(p.x) > 1.9 || std::abs(p.y) > 1.9) continue;
        const double apart = fromBorder(p, light, ball), distance = glm::length(p - view.eye);
        const double offAxis = view.isOrthographic ? 1 : glm::dot(p - view.eye, view.forward) / distance;
        const dvec3 l = light.kind == shared::kLightDirectional ? -light.direction : glm::normalize(light.position - p);
        const auto used = std::find_if(maps.maps.begin(), maps.maps.end(), [&](const render::ShadowMapOf& m) {
            return view.isOrthographic || distance <= m.of.reach;
        });
        EXPECT_TRUE(used != maps.maps.end());
        if (used == maps.maps.end()) continue;
        const double deep = used->of.view.isOrthographic ? 1 : glm::dot(p - used->of.view.eye, used->of.view.forward);
        const double error = used->casterError * deep, texel = texels * deep / used->of.view.focalPixels,
                     surface = maps.surfaceError / view.focalPixels * (view.isOrthographic ? 1 : distance);
        const auto pixels = [&](double world, double ofTexel, double bias) {
            return render::shadowErrorPixels(view, distance, offAxis, l.z, world, ofTexel, bias);
        };
        floor.push_back({std::copysign(pixels(std::abs(apart), 0, 0), apart), mask.share[i],
                         pixels(error, texel, error + surface)});
    }
    return floor;
}

/// Pixels of the floor that the mask has on the wrong side of the border, or beside its own: distances on the picture.
Border borderOf(const Mask& mask, const lod::View& view, const render::WorldLight& light, const dvec3& ball = kBall) {
    Border border;
    for (const FloorPixel& p : floorOf(mask, view, light, ball)) {
        if ((p.apart < 0) == (p.share < 0.5)) continue;
        border.errors.push_back(std::abs(p.apart));
        border.stated.push_back(p.stated);
    }
    return border;
}

struct ShadowBackends : test::BackendsHere {
    /// Calls use(mask, view, light): the ball over the floor as points and as triangles, in views of both kinds, under
    /// a sun and a spot.
    template <typename Use>
    void forMasks(const Use& use) {
        test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
        const auto points = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
                   mesh = triangles(folder_ / "b.stipple", *executor_);
        for (const bool isOrthographic : {false, true})
            for (const auto& store : {points, mesh})
                for (const render::WorldLight& light : {sun(), spot()}) {
                    SCOPED_TRACE(testing::Message() << (isOrthographic ? "orthographic, " : "perspective, ")
                                                    << (store == mesh ? "triangles, " : "points, ")
                                                    << (light.kind == shared::kLightSpot ? "spot" : "sun"));
                    const lod::View view = viewOf(isOrthographic);
                    const Mask mask = maskOf(store, usual(), *executor_, view, under(light));
                    ASSERT_TRUE(mask.state->draws.shadowMaps);
                    use(mask, view, light);
                }
    }
};

TEST_F(ShadowBackends, BordersAreWhereTheClosedFormHasThem) {
    forMasks([](const Mask& mask, const lod::View& view, const render::WorldLight& light) {
        const size_t shaded = static_cast<size_t>(
            std::count_if(mask.share.begin(), mask.share.end(), [](double s) { return s >= 0 && s < 0.1; }));
        EXPECT_GT(shaded, 500u);
        const Border border = borderOf(mask, view, light);
        std::printf("%zu of %zu in shadow; %zu on the wrong side, the farthest %.2f of what is stated\n", shaded,
                    mask.share.size(), border.errors.size(), border.worst());
        EXPECT_LE(border.beyond(), 0.01);
        EXPECT_GT(border.beyond(0.01), 0.1) << "the control: a hundredth of what is stated would not hold";
        // Nothing but the ball's shadow is dark: no acne, and no light beneath it.
        EXPECT_LT(border.errors.size(), shaded / 4);
    });
}

// Beyond the stated error (of four texels that are weighed the farthest has its corner less than 1.5 texels away on
// each axis) floors are lit or dark all through: no halo about the
// shadow, none beside the ball's silhouette, no specks of light in it.
TEST_F(ShadowBackends, NothingIsBesideTheRim) {
    const double kTexels = 1.5 * std::sqrt(2.0);
    constexpr double kLeast = 1e-3;
    forMasks([&](const Mask& mask, const lod::View& view, const render::WorldLight& light) {
        size_t beside = 0, within = 0, nearer = 0;
        const std::vector<FloorPixel> floor = floorOf(mask, view, light, kBall, kTexels);
        for (const FloorPixel& p : floor) {
            const double off = p.apart < 0 ? p.share : std::abs(1 - p.share), away = std::abs(p.apart);
            beside += away > p.stated && off > kLeast ? 1 : 0;
            nearer += away > 0.1 * p.stated && off > kLeast ? 1 : 0;
            within += p.apart < -p.stated ? 1 : 0;
        }
        std::printf("%zu pixels of the floor, %zu well within the shadow; %zu are neither lit nor dark\n", floor.size(),
                    within, beside);
        EXPECT_GT(floor.size(), 5'000u);
        EXPECT_GT(within, 200u);
        EXPECT_EQ(beside, 0u);
        EXPECT_GT(nearer, 50u) << "the control: a tenth of what is stated would not hold";
    });
}

#ifndef STIPPLE_ON_GPU
TEST_F(ShadowBackends, BordersKeepTheirBoundUnderALowSunFromCoarseCutsAndMaps) {
    constexpr double kLower = 0.35;
    test::writePly(folder_ / "a.ply", floorAndBall(true, kLower), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    for (const double upward : {0.7, 0.3, 0.22})
        for (const auto& [texels, error] : {std::pair(256.0, 0.5), {64.0, 0.5}, {256.0, 4.0}, {1024.0, 0.25}}) {
            render::WorldLight light = sun();
            const double aside = std::sqrt((1 - upward * upward) / 2);
            light.direction = dvec3(-aside, -aside, -upward);
            SCOPED_TRACE(testing::Message() << upward << " upward, " << texels << " texels, " << error << " px");
            render::FrameSettings settings = under(light);
            settings.draw.parameters.shadow.texels = texels;
            settings.budgets.errorPixels = error;
            const Mask mask = maskOf(store, usual(), *executor_, viewOf(), settings);
            const Border border = borderOf(mask, viewOf(), light, kBall - dvec3(0, 0, kLower));
            std::printf(
                "%.2f upward, %4.0f texels, %.2f px: %zu on the wrong side, the farthest %.2f of what is stated\n",
                upward, texels, error, border.errors.size(), border.worst());
            EXPECT_FALSE(border.errors.empty());
            EXPECT_LE(border.beyond(), 0.01);
        }
}

/// Pixels at which what the light comes to begins or ends, where both sides face the light by a fifth at least.
std::vector<uint8_t> bordersIn(const std::vector<double>& share, const std::vector<double>& facing, uint32_t width) {
    std::vector<uint8_t> border(share.size());
    for (size_t i = 0; i + width < share.size(); ++i)
        for (const size_t next : {i + 1, i + width})
            if (share[i] >= 0 && share[next] >= 0 && (share[i] < 0.5) != (share[next] < 0.5) && facing[i] >= 0.2 &&
                facing[next] >= 0.2)
                border[i] = 1;
    return border;
}

TEST_F(ShadowBackends, BordersAreWhereTracedRaysHaveThem) {
    std::vector<test::TestPoint> points = floorAndBall(false), rough = test::bumpySphere(40'000, 3);
    for (test::TestPoint& p : rough) p.position = 0.6 * p.position + dvec3(0, 0, 0.7);
    points.insert(points.end(), rough.begin(), rough.end());
    test::writePly(folder_ / "a.ply", points);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const lod::View view = viewOf();
    const render::FrameSettings settings = under(sun());
    const Mask mask = maskOf(store, usual(), *executor_, view, settings);
    reference::TraceSettings traced;
    traced.samplesPerAxis = 1;
    traced.draw = settings.draw;
    const auto look = [&](bool casts, bool shines) {
        traced.draw.lights[0].castsShadow = casts;
        traced.draw.lights[0].colour = glm::vec3(shines ? 2.3f : 0.0f);
        return *reference::trace({{store, {}, {}}}, view, traced, *executor_);
    };
    const render::Image with = look(true, true), open = look(false, true), dark = look(false, false);
    std::vector<double> share, facing;
    for (size_t i = 0; i < open.depth.size(); ++i) {
        const double all = double{open.linear[3 * i]} - double{dark.linear[3 * i]};
        share.push_back(all > 1e-3 ? (double{with.linear[3 * i]} - double{dark.linear[3 * i]}) / all : -1);
        facing.push_back(
            glm::dot(kTowardsSun, dvec3(open.normal[3 * i], open.normal[3 * i + 1], open.normal[3 * i + 2])));
    }
    const std::vector<uint8_t> shown = bordersIn(mask.share, facing, view.width),
                               truth = bordersIn(share, facing, view.width);
    const render::ShadowMaps& maps = *mask.state->draws.shadowMaps;
    constexpr int kReach = 12;
    size_t count = 0, beyond = 0, hundredth = 0;
    for (int y = kReach; y + kReach < static_cast<int>(view.height); ++y)
        for (int x = kReach; x + kReach < static_cast<int>(view.width); ++x) {
            const auto at = [&](int px, int py) {
                return static_cast<size_t>(py) * view.width + static_cast<size_t>(px);
            };
            const size_t i = at(x, y);
            if (shown[i] == 0) continue;
            double nearest = kReach;
            for (int dy = -kReach; dy <= kReach; ++dy)
                for (int dx = -kReach; dx <= kReach; ++dx)
                    if (truth[at(x + dx, y + dy)] != 0) nearest = std::min(nearest, std::hypot(dx, dy));
            const dvec3 p = placeOf(view, i, double{open.depth[i]});
            const double distance = glm::length(p - view.eye),
                         offAxis = glm::dot(p - view.eye, view.forward) / distance;
            const auto used = std::find_if(maps.maps.begin(), maps.maps.end(),
                                           [&](const render::ShadowMapOf& m) { return distance <= m.of.reach; });
            ASSERT_TRUE(used != maps.maps.end());
            const double surface = maps.surfaceError / view.focalPixels * distance,
                         stated = render::shadowErrorPixels(view, distance, offAxis, facing[i], used->casterError,
                                                            1 / used->of.view.focalPixels, used->casterError + surface);
            constexpr double kPixel = 1.0;  // both borders are known to a pixel
            ++count;
            beyond += nearest > stated + kPixel ? 1 : 0;
            hundredth += nearest > 0.01 * stated + kPixel ? 1 : 0;
        }
    std::printf("%zu pixels of borders, %zu farther from traced ones than stated, %zu than a hundredth\n", count,
                beyond, hundredth);
    EXPECT_GT(count, 100u);
    EXPECT_LE(beyond, count / 100);
    EXPECT_GT(hundredth, count / 50) << "the control";
}
#endif

}  // namespace
}  // namespace stipple
