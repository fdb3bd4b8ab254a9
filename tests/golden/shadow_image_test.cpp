// Shadows: their borders are where closed forms have them, to the error that is stated; every backend shows what the
// fp64 restatement shows; maps that hold are kept; what cannot be meant costs nothing but a picture without it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "engine/render/effects/effect.h"
#include "engine/render/shadow_frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr double kRadius = 0.5;
const dvec3 kBall(0.1, -0.1, 0.9);
const dvec3 kTowardsSun = glm::normalize(dvec3(0.5, 0.3, 1));

/// A floor of 4 x 4 at z = 0 and a ball above it.
std::vector<test::TestPoint> floorAndBall(bool hasBall = true, double lower = 0) {
    std::vector<test::TestPoint> points;
    constexpr int kAcross = 200;
    for (int y = 0; y < kAcross; ++y)
        for (int x = 0; x < kAcross; ++x)
            points.push_back(
                {{4 * (x + 0.5) / kAcross - 2, 4 * (y + 0.5) / kAcross - 2, 0}, {0, 0, 1}, 0xc0c0c0, 0.02f});
    constexpr size_t kBallPoints = 15'000;
    for (size_t i = 0; hasBall && i < kBallPoints; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / kBallPoints,
                     a = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
        const dvec3 n(r * std::cos(a), r * std::sin(a), z);
        points.push_back({kBall - dvec3(0, 0, lower) + kRadius * n, glm::vec3(n), 0x4080c0, 0.02f});
    }
    return points;
}

void addBall(scene::Primitive& mesh) {
    constexpr uint32_t kAround = 128, kUp = 64;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i <= kAround; ++i) {
            const double a = 2 * M_PI * i / kAround, b = M_PI * j / kUp;
            const dvec3 n(std::cos(a) * std::sin(b), std::sin(a) * std::sin(b), std::cos(b));
            mesh.position.emplace_back(kBall + kRadius * n);
            mesh.normal.emplace_back(n);
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(mesh.position.size() - 1), c = d - 1, up = d - (kAround + 1);
            for (const uint32_t k : {up - 1, up, d, up - 1, d, c}) mesh.indices.push_back(k);
        }
}

std::shared_ptr<const lod::Store> triangles(const std::string& path, Executor& executor) {
    scene::Scene scene;
    scene.path = "floor";
    scene::Primitive mesh;
    addBall(mesh);
    const auto first = static_cast<uint32_t>(mesh.position.size());
    for (const dvec3 p : {dvec3(-2, -2, 0), dvec3(2, -2, 0), dvec3(2, 2, 0), dvec3(-2, 2, 0)}) {
        mesh.position.emplace_back(p);
        mesh.normal.emplace_back(0, 0, 1);
    }
    for (const uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh.indices.push_back(first + k);
    mesh.material = 0;
    scene.materials.resize(1);
    scene.materials[0].isDoubleSided = true;
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {std::move(mesh)};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(scene);
    Progress silent(false);
    EXPECT_TRUE(
        lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), path, build, executor, silent));
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

lod::View viewOf(bool isOrthographic = false, const dvec3& eye = {2.2, -3.2, 2.6}) {
    scene::Camera camera;
    camera.eye = eye;
    camera.target = {-0.3, -0.1, 0.2};
    camera.up = {0, 0, 1};
    camera.fovDegrees = 45;
    lod::View view = scene::makeView(camera, 256, 192, 1e-3);
    if (isOrthographic) {
        view.isOrthographic = true;
        view.focalPixels /= 4.5;
    }
    return view;
}

render::WorldLight sun(float size = 0) {
    render::WorldLight light;
    light.kind = shared::kLightDirectional;
    light.direction = -kTowardsSun;
    light.colour = glm::vec3(2.3f);
    light.castsShadow = true;
    light.size = size;
    return light;
}
render::WorldLight spot() {
    render::WorldLight light;
    light.kind = shared::kLightSpot;
    light.position = kBall + 3.0 * kTowardsSun;
    light.direction = -kTowardsSun;
    light.colour = glm::vec3(25);
    light.innerCone = 0.45f;
    light.outerCone = 0.5f;
    light.castsShadow = true;
    return light;
}

render::FrameSettings under(const render::WorldLight& light, render::Mode mode = render::Mode::splat) {
    render::FrameSettings settings;
    settings.mode = mode;
    settings.draw.lit = true;
    settings.draw.lights = {light};
    settings.draw.effects.emplace_back("shadow");
    settings.draw.parameters.shadow.texels = 256;
    settings.budgets.errorPixels = 0.5;
    settings.wantDepthAndNormal = true;
    return settings;
}

std::unique_ptr<render::FrameState> drawn(const std::shared_ptr<const lod::Store>& store, render::Backend& backend,
                                          Executor& executor, const lod::View& view,
                                          const render::FrameSettings& settings) {
    auto state = render::makeFrameState({store}, backend, executor, {});
    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
    return state;
}

/// What of the light comes to each pixel, from three pictures: with shadows, without, and without the light.
struct Mask {
    std::vector<double> share;
    std::unique_ptr<render::FrameState> state;
};
Mask maskOf(const std::shared_ptr<const lod::Store>& store, render::Backend& backend, Executor& executor,
            const lod::View& view, render::FrameSettings settings) {
    Mask mask;
    mask.state = drawn(store, backend, executor, view, settings);
    settings.draw.lights[0].castsShadow = false;
    const auto open = drawn(store, backend, executor, view, settings);
    settings.draw.lights[0].colour = glm::vec3(0);
    const auto dark = drawn(store, backend, executor, view, settings);
    for (size_t i = 0; i < open->image.depth.size(); ++i) {
        const double all = double{open->image.linear[3 * i]} - double{dark->image.linear[3 * i]};
        mask.share.push_back(
            all > 1e-3 ? (double{mask.state->image.linear[3 * i]} - double{dark->image.linear[3 * i]}) / all : -1);
    }
    return mask;
}

dvec3 placeOf(const lod::View& view, size_t i, double depth) {
    const double x = (double(i % view.width) + 0.5 - 0.5 * view.width) / view.focalPixels,
                 y = (double(i / view.width) + 0.5 - 0.5 * view.height) / view.focalPixels;
    return view.isOrthographic ? view.eye + view.right * x + view.down * y + view.forward * depth
                               : view.eye + depth * (view.right * x + view.down * y + view.forward);
}

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
/// Pixels of the floor that the mask has on the wrong side of the border, or beside its own: distances on the picture.
Border borderOf(const Mask& mask, const lod::View& view, const render::WorldLight& light, const dvec3& ball = kBall) {
    Border border;
    const render::Image& image = mask.state->image;
    const render::ShadowMaps& maps = *mask.state->draws.shadowMaps;
    for (size_t i = 0; i + view.width < mask.share.size(); ++i) {
        if (!(image.depth[i] > 0) || mask.share[i] < 0) continue;
        const dvec3 p = placeOf(view, i, double{image.depth[i]});
        if (std::abs(p.z) > 1e-3 || std::abs(p.x) > 1.9 || std::abs(p.y) > 1.9) continue;
        const double apart = fromBorder(p, light, ball);
        const bool isWrong = (apart < 0) != (mask.share[i] < 0.5);
        if (!isWrong) continue;
        const double distance = glm::length(p - view.eye);
        const double offAxis = view.isOrthographic ? 1 : glm::dot(p - view.eye, view.forward) / distance;
        const dvec3 l = light.kind == shared::kLightDirectional ? -light.direction : glm::normalize(light.position - p);
        const auto used = std::find_if(maps.maps.begin(), maps.maps.end(), [&](const render::ShadowMapOf& m) {
            return view.isOrthographic || distance <= m.of.reach;
        });
        EXPECT_TRUE(used != maps.maps.end());
        if (used == maps.maps.end()) continue;
        const double deep = used->of.view.isOrthographic ? 1 : glm::dot(p - used->of.view.eye, used->of.view.forward);
        const double error = used->casterError * deep, texel = deep / used->of.view.focalPixels,
                     surface = maps.surfaceError / view.focalPixels * (view.isOrthographic ? 1 : distance);
        border.errors.push_back(render::shadowErrorPixels(view, distance, offAxis, l.z, std::abs(apart), 0, 0));
        border.stated.push_back(render::shadowErrorPixels(view, distance, offAxis, l.z, error, texel, error + surface));
    }
    return border;
}

using ShadowBackends = test::BackendsHere;

TEST_F(ShadowBackends, BordersAreWhereTheClosedFormHasThem) {
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
                const size_t shaded = static_cast<size_t>(
                    std::count_if(mask.share.begin(), mask.share.end(), [](double s) { return s >= 0 && s < 0.1; }));
                EXPECT_GT(shaded, 500u);
                const Border border = borderOf(mask, view, light);
                std::printf("%zu of %zu in shadow; %zu on the wrong side, the farthest %.2f of what is stated\n",
                            shaded, mask.share.size(), border.errors.size(), border.worst());
                EXPECT_LE(border.beyond(), 0.01);
                EXPECT_GT(border.beyond(0.01), 0.1) << "the control: a hundredth of what is stated would not hold";
                // Nothing but the ball's shadow is dark: no acne, and no light beneath it.
                EXPECT_LT(border.errors.size(), shaded / 4);
            }
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

TEST_F(ShadowBackends, FallInScenesOfAnySize) {
    const auto shown = [&](double size) {
        std::vector<test::TestPoint> points = floorAndBall();
        for (test::TestPoint& p : points) {
            p.position *= size;
            p.radius *= static_cast<float>(size);
        }
        test::writePly(folder_ / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        lod::View view = viewOf();
        view.eye *= size;
        view.nearPlane *= size;
        render::WorldLight lamp = spot();
        lamp.position *= size;
        lamp.colour *= static_cast<float>(size * size);
        lamp.size = static_cast<float>(0.2 * size);
        render::FrameSettings settings = under(sun(0.1f));
        settings.draw.lights.push_back(lamp);
        return std::move(drawn(store, usual(), *executor_, view, settings)->image);
    };
    const render::Image usualSize = shown(1);
    for (const double size : {0x1p-30, 0x1p+50}) EXPECT_GE(test::drawnPsnr(shown(size), usualSize), 50) << size;
}
#endif

TEST_F(ShadowBackends, ShowWhatTheOracleShows) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto cloud = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
               mesh = triangles(folder_ / "b.stipple", *executor_),
               curves =
                   test::buildCurves(test::curls({.count = 60, .radius = 0.05f}), folder_ / "c.stipple", *executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    backends_.erase("fp64");
    struct Look {
        std::shared_ptr<const lod::Store> store;
        render::WorldLight light;
        render::Mode mode;
        bool isOrthographic;
    };
    using enum render::Mode;
    std::vector<Look> looks{{mesh, sun(), splat, false},
                            {mesh, sun(0.2f), splat, true},
                            {cloud, sun(0.5f), surface, false},
                            {curves, sun(), splat, false},
                            {cloud, spot(), splat, true}};
    for (const render::Mode mode : {surface, pullpush, splat, ewa, pullpushExact, points})
        looks.push_back({cloud, mode == splat ? sun(0.2f) : sun(), mode, mode == pullpush});
    for (const Look& look : looks) {
        const lod::View view = viewOf(look.isOrthographic);
        const render::FrameSettings settings = under(look.light, look.mode);
        render::FrameSettings open = settings;
        open.draw.lights[0].castsShadow = false;
        const auto truth = drawn(look.store, *oracle, *executor_, view, settings),
                   control = drawn(look.store, *oracle, *executor_, view, open);
        for (auto& [name, backend] : backends_) {
            SCOPED_TRACE(testing::Message() << name << ", " << render::reconstructionOf(look.mode).name
                                            << (look.isOrthographic ? ", orthographic" : ""));
            const auto shown = drawn(look.store, *backend, *executor_, view, settings);
            const double db = test::drawnPsnr(shown->image, truth->image);
            std::printf("%-8s %-14s %5.1f dB (without: %.1f)\n", name.c_str(), render::reconstructionOf(look.mode).name,
                        db, test::drawnPsnr(control->image, truth->image));
            for (size_t m = 0; m < truth->draws.shadowMaps->maps.size(); ++m) {
                const auto &x = *shown->draws.shadowMaps->maps[m].texels, &y = *truth->draws.shadowMaps->maps[m].texels;
                size_t holes = 0, off = 0;
                for (size_t t = 0; t < x.depth.size(); ++t) {
                    if (std::isinf(x.depth[t]) != std::isinf(y.depth[t])) ++holes;
                    else if (!std::isinf(x.depth[t]) && std::abs(x.depth[t] - y.depth[t]) > 1e-3) ++off;
                }
                std::printf("   map %zu: %zu holes %zu off; ", m, holes, off);
            }
            for (size_t i = 0; i < shown->image.depth.size(); ++i)
                if (std::abs(shown->image.linear[3*i] - truth->image.linear[3*i]) > 0.1)
                    std::printf("[%zu,%zu: %.3f %.3f depth %.5f %.5f] ", i % view.width, i / view.width, double{shown->image.linear[3*i]}, double{truth->image.linear[3*i]}, double{shown->image.depth[i]}, double{truth->image.depth[i]});
            std::printf("\n");
            EXPECT_GE(db, 50);
            const auto d = reference::compareImages(shown->image, truth->image, 4, nullptr);
            ASSERT_TRUE(d);
            EXPECT_LE(d->differingFraction, 0.001);
            EXPECT_LE(test::drawnPsnr(control->image, truth->image), 35) << "the control";
        }
    }
}

#ifndef STIPPLE_ON_GPU
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

TEST_F(ShadowBackends, MapsThatHoldAreKept) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const render::FrameSettings settings = under(sun());
    const auto state = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_GT(state->counters.shadowMaps, 0u);
    EXPECT_EQ(state->counters.shadowMapsDrawn, state->counters.shadowMaps);
    const auto texelsOf = [](const render::FrameState& of) {
        std::vector<std::shared_ptr<const render::ShadowTexels>> texels;
        for (const auto& map : of.draws.shadowMaps->maps) texels.push_back(map.texels);
        return texels;
    };
    const auto first = texelsOf(*state);
    const render::Image image = state->image;
    // Both still; then the camera moves by less than a texel, and turns.
    ASSERT_TRUE(render::renderFrame(*state, viewOf(), settings));
    EXPECT_EQ(state->counters.shadowMapsDrawn, 0u);
    EXPECT_TRUE(state->image.rgba == image.rgba);
    lod::View moved = viewOf(false, dvec3(2.2, -3.2, 2.6) + dvec3(0.0004, 0.0003, -0.0002));
    ASSERT_TRUE(render::renderFrame(*state, moved, settings));
    EXPECT_EQ(state->counters.shadowMapsDrawn, 0u);
    EXPECT_TRUE(texelsOf(*state) == first) << "the same maps";
    // Whoever begins there has the same texels, bit by bit: shadows do not swim.
    const auto other = drawn(store, usual(), *executor_, moved, settings);
    const auto again = texelsOf(*other);
    ASSERT_EQ(again.size(), first.size());
    for (size_t m = 0; m < first.size(); ++m) EXPECT_TRUE(again[m]->depth == first[m]->depth) << "map " << m;
    EXPECT_TRUE(other->image.rgba == state->image.rgba) << "pictures do not remember what was drawn before";
    // The control: far away the maps are others.
    moved.eye += dvec3(3, 0, 0);
    ASSERT_TRUE(render::renderFrame(*state, moved, settings));
    EXPECT_GT(state->counters.shadowMapsDrawn, 0u);
}

#ifndef STIPPLE_ON_GPU
TEST_F(ShadowBackends, CostNothingWhereNothingCastsOrNothingIsLit) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    render::FrameSettings without = under(sun()), unasked = under(sun()), unlit = under(sun()), lamp = under(sun());
    without.draw.lights[0].castsShadow = false;
    unasked.draw.effects.clear();
    unlit.draw.lit = false;
    unlit.draw.unlitTriangles = true;
    lamp.draw.lights[0].kind = shared::kLightPoint;
    lamp.draw.lights[0].position = {0, 0, 5};
    const uint64_t before = usual().resources().effectBytes;
    const auto open = drawn(store, usual(), *executor_, viewOf(), without);
    for (const render::FrameSettings& settings : {without, unasked, unlit, lamp}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), settings);
        EXPECT_EQ(state->counters.shadowMaps, 0u);
        EXPECT_FALSE(state->shadows && !state->shadows->kept.empty());
        EXPECT_FALSE(state->draws.shadowMaps);
        EXPECT_EQ(usual().resources().effectBytes, before);
        EXPECT_LE(state->counters.passes, open->counters.passes);
    }
    // On and off again: the same picture and the same bytes.
    auto state = render::makeFrameState({store}, usual(), *executor_, {});
    for (int k = 0; k < 3; ++k) {
        ASSERT_TRUE(render::renderUntilComplete(*state, viewOf(), under(sun())));
        EXPECT_GT(usual().resources().effectBytes, before) << "the control";
        EXPECT_EQ(state->counters.passes, open->counters.passes + 1);
        ASSERT_TRUE(render::renderUntilComplete(*state, viewOf(), without));
        for (uint32_t f = 0; f < render::kEffectHold; ++f)
            ASSERT_TRUE(render::renderResident(*state, viewOf(), without));
        EXPECT_EQ(usual().resources().effectBytes, before);
        EXPECT_TRUE(state->image.rgba == open->image.rgba);
    }
}

TEST_F(ShadowBackends, SurviveLightsThatCannotBeMeant) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const auto isFinite = [](const render::Image& image) {
        return std::all_of(image.linear.begin(), image.linear.end(), [](float v) { return std::isfinite(v); });
    };
    render::WorldLight nowhere = sun(), unreal = sun(), closed = spot(), inside = spot(), wide = spot();
    nowhere.direction = dvec3(0);
    unreal.direction = dvec3(std::nan(""), 0, 1);
    closed.outerCone = 0;
    inside.position = kBall + dvec3(0, 0, -0.45);
    wide.outerCone = 1.5707f;
    for (const render::WorldLight& light : {nowhere, closed}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), under(light));
        EXPECT_EQ(state->counters.shadowLightsLeft, 1u);
        EXPECT_EQ(state->counters.shadowMaps, 0u);
        EXPECT_TRUE(isFinite(state->image));
    }
    EXPECT_EQ(drawn(store, usual(), *executor_, viewOf(), under(unreal))->counters.shadowLightsLeft, 1u);
    for (const render::WorldLight& light : {inside, wide}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), under(light));
        EXPECT_EQ(state->counters.shadowLightsLeft, 0u);
        EXPECT_TRUE(isFinite(state->image));
    }
    render::FrameSettings crowd = under(spot());
    crowd.draw.lights.assign(10'000, spot());
    for (render::WorldLight& light : crowd.draw.lights) light.colour *= 1e-4f;
    lod::View small = viewOf();
    small.width = small.height = 16;
    const auto state = drawn(store, usual(), *executor_, small, crowd);
    EXPECT_EQ(state->counters.shadowMaps, uint64_t{shared::kMostShadowLights});
    EXPECT_EQ(state->counters.shadowLightsLeft, 10'000 - uint64_t{shared::kMostShadowLights});
    EXPECT_TRUE(isFinite(state->image));
}

TEST_F(ShadowBackends, BecomeCoarserFirstWhereTheBudgetIsSmall) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    render::FrameSettings settings = under(sun());
    const auto whole = drawn(store, usual(), *executor_, viewOf(), settings);
    const auto errorOf = [](const render::FrameState& state) {
        double most = 0;
        for (const auto& map : state.draws.shadowMaps->maps) most = std::max(most, map.casterError);
        return most;
    };
    settings.budgets.records = whole->counters.recordsDrawn + 24'000;
    const auto tight = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_EQ(tight->counters.recordsDrawn, whole->counters.recordsDrawn) << "what is seen comes first";
    EXPECT_GT(errorOf(*tight), errorOf(*whole));
    EXPECT_GT(tight->counters.shadowMaps, 0u);
    settings.budgets.records = 500;
    const auto least = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_GT(least->counters.recordsDrawn, 0u) << "still a picture";
}

TEST_F(ShadowBackends, PenumbrasWidenWithTheDistanceOfWhatCasts) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    test::writePly(folder_ / "b.ply", floorAndBall(true, 0.35), true, true);
    const auto high = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
               low = test::buildAndOpen(folder_ / "b.ply", folder_ / "b.stipple", *executor_);
    // Pixels of the floor that the light comes to in part.
    const auto partly = [&](const std::shared_ptr<const lod::Store>& store, float size) {
        const Mask mask = maskOf(store, usual(), *executor_, viewOf(), under(sun(size)));
        size_t count = 0;
        for (size_t i = 0; i < mask.share.size(); ++i) {
            const float depth = mask.state->image.depth[i];
            if (!(depth > 0) || std::abs(placeOf(viewOf(), i, double{depth}).z) > 1e-3) continue;
            count += mask.share[i] > 0.1 && mask.share[i] < 0.9 ? 1 : 0;
        }
        return count;
    };
    const size_t hard = partly(high, 0), small = partly(high, 0.1f), large = partly(high, 0.3f),
                 near = partly(low, 0.3f);
    std::printf("pixels in penumbra: %zu, %zu, %zu; %zu of what is near\n", hard, small, large, near);
    EXPECT_GT(small, 2 * hard);
    EXPECT_GT(large, 2 * small);
    EXPECT_LT(near, large - large / 8) << "nearer what casts they are narrower";
}
#endif

TEST_F(ShadowBackends, LeavesLetLightOfTheirColourThrough) {
    // A ribbon, green, over the floor.
    test::writePly(folder_ / "a.ply", floorAndBall(false), true, true);
    const auto floor = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    lod::CurveSet leaf;
    leaf.hasColour = true;
    for (const double x : {-1.0, 0.0, 1.0}) leaf.addVertex({x, 0, 0.5}, 0.3f, {0, 0, 1}, 0x00c000);
    leaf.endCurve(true);
    const auto store = test::buildCurves(lod::cleanCurves(std::move(leaf), 0), folder_ / "b.stipple", *executor_);
    const lod::View view = viewOf();
    const auto draw = [&](bool casts) {
        render::FrameSettings settings = under(sun());
        settings.draw.lights[0].castsShadow = casts;
        auto state = render::makeFrameState({floor, store}, usual(), *executor_, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        return state;
    };
    const auto with = draw(true), without = draw(false);
    // The middle of the ribbon's shadow.
    const dvec3 at = -dvec3(kTowardsSun.x, kTowardsSun.y, 0) * (0.5 / kTowardsSun.z), d = at - view.eye;
    const double z = glm::dot(d, view.forward);
    const auto px = static_cast<size_t>(glm::dot(d, view.right) / z * view.focalPixels + 0.5 * view.width),
               py = static_cast<size_t>(glm::dot(d, view.down) / z * view.focalPixels + 0.5 * view.height),
               i = py * view.width + px;
    const auto change = [&](size_t c) {
        return double{with->image.linear[3 * i + c]} / double{without->image.linear[3 * i + c]};
    };
    std::printf("red %.3f, green %.3f, blue %.3f of the light\n", change(0), change(1), change(2));
    EXPECT_LT(change(0), 0.5);
    EXPECT_GT(change(1), change(0) + 0.15) << "green light comes through";
    EXPECT_LT(change(1), 0.9);
}

}  // namespace
}  // namespace stipple
