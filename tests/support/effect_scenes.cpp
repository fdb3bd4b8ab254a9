#include "tests/support/effect_scenes.h"

#include "engine/render/effects/table.h"
#include "engine/render/wind.h"
#include "engine/scene/camera.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple::test {

std::vector<render::PlacedStore> effectStores(const std::string& folder, Executor& executor) {
    writePly(folder + "/points.ply", bumpySphere(6'000, 1));
    MeshRecipe house;
    house.grow.kind = "building";
    house.grow.triangles = 2'000;
    house.grow.textureSize = 64;
    std::vector<render::PlacedStore> placed{
        {buildAndOpen(folder + "/points.ply", folder + "/points.stipple", executor), {}, {}},
        {buildCurves(curls({}), folder + "/plants.stipple", executor), {}, {}},
        {growMeshStore(house, folder + "/house.stipple", executor), {}, {}}};
    for (size_t i = 0; i < placed.size(); ++i) {
        const lod::StoreDescription& d = placed[i].store->description;
        placed[i].place.scale = 2.5 / glm::length(d.boundsMax - d.boundsMin);
        placed[i].place.translation = glm::dvec3(1.6 * (static_cast<double>(i) - 1), 0, 0) -
                                      placed[i].place.scale * 0.5 * (d.boundsMin + d.boundsMax);
    }
    return placed;
}

lod::View effectView(uint32_t width, uint32_t height, bool away) {
    scene::Camera camera;
    camera.eye = {0.4, 1.2, 5};
    camera.target = away ? glm::dvec3(0.4, 1.2, 50) : glm::dvec3(0);
    camera.up = {0, 1, 0};
    camera.fovDegrees = 50;
    return scene::makeView(camera, width, height, 0.02);
}

namespace {

std::shared_ptr<const render::Environment> sky(Executor& executor) {
    static const auto kSky = std::make_shared<const render::Environment>(
        render::makeEnvironment({8, 4, std::vector<float>(96, 0.5f)}, 1, executor));
    return kSky;
}

/// Darker towards the ground.
std::shared_ptr<const render::Backdrop> dusk(Executor& executor) {
    static const auto kDusk = [&] {
        render::HdrImage image{64, 32, {}};
        for (uint32_t y = 0; y < image.height; ++y)
            image.rgb.insert(image.rgb.end(), size_t{3} * image.width, 0.5f - 0.01f * static_cast<float>(y));
        return std::make_shared<const render::Backdrop>(render::makeBackdrop(std::move(image), 1, executor));
    }();
    return kDusk;
}

/// A sun over the viewer's left shoulder.
render::WorldLight lampThatCasts() {
    render::WorldLight light;
    light.kind = shared::kLightDirectional;
    light.direction = glm::normalize(glm::dvec3(0.6, -0.5, -0.8));
    light.castsShadow = true;
    return light;
}

}  // namespace

void addEffect(const std::string& name, Executor& executor, render::DrawSettings& s) {
    if (name == "light") {
        s.unlitTriangles = false;
    } else if (name == "environment") {
        s.unlitTriangles = false;
        s.environment = sky(executor);
    } else if (name == "background") {
        s.backdrop = dusk(executor);
    } else if (name == "wind") {
        s.wind = {0.3, 1.5, {1, 0, 0}};
    } else {
        s.effects.emplace_back(name);
    }
    if (name == "occlusion") s.unlitTriangles = false;
    if (name == "shadow") {
        s.unlitTriangles = false;
        s.lights = {lampThatCasts()};
        s.parameters.shadow.texels = 128;
    }
    if (name == "reflection") s.unlitTriangles = false;  // the house has panes
    if (name == "fog") s.parameters.fog.density = 0.1;
    if (name == "tone") s.parameters.tone = {1.5, 1};
}

bool isOfNothing(const std::string& name) { return name == "background"; }

bool addUselessly(const std::string& name, Executor& executor, render::DrawSettings& s) {
    if (name == "background") {
        s.backdrop = dusk(executor);
        s.debugView = shared::kDebugLevel;
        return true;
    }
    if (name == "light") {
        s.unlitTriangles = false;
        s.debugView = shared::kDebugLevel;
        return true;
    }
    s.effects.emplace_back(name);
    if (name == "shadow") {  // nothing casts
        s.unlitTriangles = false;
        s.lights = {lampThatCasts()};
        s.lights[0].castsShadow = false;
        return true;
    }
    if (name == "edl") {
        s.lit = true;
        s.unlitTriangles = false;
        return true;
    }
    if (name == "reflection") {  // nothing that is lit is smooth
        s.lit = true;
        return true;
    }
    if (name == "fog") s.parameters.fog.density = 1e-6;
    return name == "fog" || name == "tone" || name == "occlusion";
}

std::vector<size_t> listedEffects() {
    std::vector<size_t> out;
    for (size_t e = 0; e < render::effects().size(); ++e)
        if (std::string("refraction") != render::effects()[e]->name &&
            std::string("transparency") != render::effects()[e]->name)
            out.push_back(e);
    return out;
}

}  // namespace stipple::test
