#include "engine/scene/open/scene_facts.h"

#include <algorithm>
#include <map>
#include <set>

#include "engine/render/layers.h"
#include "engine/scene/open/open_scene.h"
#include "engine/scene/outline.h"
#include "lod/store/surfel_weights.h"

namespace stipple::scene {

std::vector<render::WorldLight> lightsOf(const scene::Scene& scene) {
    std::vector<render::WorldLight> lights;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    const std::vector<bool> visible = scene.visibility();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        if (scene.nodes[n].light < 0 || !visible[n]) continue;
        const scene::Light& light = scene.lights[static_cast<size_t>(scene.nodes[n].light)];
        render::WorldLight out;
        out.kind = light.kind == scene::LightKind::directional ? shared::kLightDirectional
                   : light.kind == scene::LightKind::point     ? shared::kLightPoint
                                                               : shared::kLightSpot;
        out.position = glm::dvec3(world[n][3]);
        const glm::dvec3 axis = -glm::dvec3(world[n][2]);
        out.direction = glm::length(axis) > 0 ? glm::normalize(axis) : glm::dvec3(0, -1, 0);
        out.colour = light.colour * light.intensity;
        out.range = light.range;
        out.innerCone = light.innerCone;
        out.outerCone = light.outerCone;
        out.castsShadow = out.kind != shared::kLightPoint;
        lights.push_back(out);
    }
    return lights;
}

std::vector<scene::Camera> camerasOf(const scene::Scene& scene) {
    std::vector<scene::Camera> cameras;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        if (scene.nodes[n].camera < 0) continue;
        const scene::SceneCamera& from = scene.cameras[static_cast<size_t>(scene.nodes[n].camera)];
        if (!(glm::length(glm::dvec3(world[n][2])) > 0)) continue;
        if (from.isOrthographic && !(from.width > 0 || from.height > 0)) continue;
        scene::Camera camera;
        camera.eye = glm::dvec3(world[n][3]);
        camera.target = camera.eye - glm::normalize(glm::dvec3(world[n][2]));
        camera.up = glm::dvec3(world[n][1]);
        camera.fovDegrees = from.fovDegrees;
        if (from.isOrthographic) {
            // What it shows is as large as its node makes it.
            camera.orthoWidth = from.width * glm::length(glm::dvec3(world[n][0]));
            camera.orthoHeight = from.height * glm::length(glm::dvec3(world[n][1]));
            camera.orthoNear = from.nearPlane * glm::length(glm::dvec3(world[n][2]));
            camera.orthoFar = from.farPlane * glm::length(glm::dvec3(world[n][2]));
        }
        cameras.push_back(camera);
    }
    return cameras;
}

lod::StoreDescription describe(const std::vector<render::PlacedStore>& placed) {
    lod::StoreDescription all = placed.front().store->description;
    if (placed.size() == 1 && placed[0].place.rotation == glm::dmat3(1) && placed[0].place.scale == 1 &&
        placed[0].place.translation == glm::dvec3(0))
        return all;
    all.up = {0, 1, 0};
    all.boundsMin = all.focusMin = glm::dvec3(1e300);
    all.boundsMax = all.focusMax = glm::dvec3(-1e300);
    all.points = 0;
    all.isReflectance = std::any_of(placed.begin(), placed.end(), [](const auto& p) { return p.proxies != nullptr; });
    for (const render::PlacedStore& p : placed) {
        const lod::StoreDescription& d = p.store->description;
        for (int corner = 0; corner < 8; ++corner) {
            const auto pick = [&](const glm::dvec3& lo, const glm::dvec3& hi) {
                const glm::dvec3 at((corner & 1) != 0 ? hi.x : lo.x, (corner & 2) != 0 ? hi.y : lo.y,
                                    (corner & 4) != 0 ? hi.z : lo.z);
                return p.place.translation + p.place.rotation * (p.place.scale * at);
            };
            all.boundsMin = glm::min(all.boundsMin, pick(d.boundsMin, d.boundsMax));
            all.boundsMax = glm::max(all.boundsMax, pick(d.boundsMin, d.boundsMax));
            all.focusMin = glm::min(all.focusMin, pick(d.focusMin, d.focusMax));
            all.focusMax = glm::max(all.focusMax, pick(d.focusMin, d.focusMax));
        }
        all.points += d.points;
        all.hasColour = true;  // what is not, is in isReflectance
        all.hasNormals = all.hasNormals || d.hasNormals;
        // Points are lit if any of them need it; triangles always are.
        if (!p.store->hierarchy.isMesh()) all.isReflectance = all.isReflectance || isShaded(d);
        if (all.attributes.empty()) all.attributes = d.attributes;
    }
    return all;
}

std::vector<glm::dvec3> outlineOf(const std::vector<render::PlacedStore>& placed) {
    constexpr size_t kMostRead = 64, kMostPlaced = 4000;
    std::map<const lod::Store*, std::vector<glm::dvec3>> known;
    std::vector<glm::dvec3> all;
    const size_t stride = placed.size() / kMostPlaced + 1;
    for (size_t i = 0; i < placed.size(); i += stride) {
        const render::PlacedStore& p = placed[i];
        auto& own = known[p.store.get()];
        if (own.empty() && placed.size() <= kMostRead) own = scene::outlineOf(*p.store);
        if (own.empty() || placed.size() > kMostRead) {
            const auto corners = scene::cornersOf(p.store->description.focusMin, p.store->description.focusMax);
            own.assign(corners.begin(), corners.end());
        }
        for (const glm::dvec3& at : own) all.push_back(p.place.translation + p.place.rotation * (p.place.scale * at));
    }
    return scene::outermost(all);
}

std::vector<std::shared_ptr<const lod::Store>> storesOf(const std::vector<render::PlacedStore>& placed) {
    std::vector<std::shared_ptr<const lod::Store>> stores;
    std::set<const lod::Store*> known;
    for (const render::PlacedStore& p : placed)
        if (known.insert(p.store.get()).second) stores.push_back(p.store);
    return stores;
}

bool hasPoints(const std::vector<render::PlacedStore>& placed) {
    return std::any_of(placed.begin(), placed.end(), [](const render::PlacedStore& p) {
        return !p.store->hierarchy.isMesh() && !p.store->hierarchy.isCurves;
    });
}

bool takesMaterial(const std::vector<render::PlacedStore>& placed) {
    return std::any_of(placed.begin(), placed.end(), [](const render::PlacedStore& p) {
        return p.store->description.materials.empty() || render::isPlainMesh(p.store->description);
    });
}

bool hasMirrors(const std::vector<render::PlacedStore>& placed, const std::optional<lod::PointMaterial>& given) {
    return (given && given->roughness < render::kMirrorRoughness) ||
           std::any_of(placed.begin(), placed.end(),
                       [](const render::PlacedStore& p) { return render::hasMirrors(p.store->description); });
}

bool hasSurfelWeights(const std::vector<render::PlacedStore>& placed) {
    return std::any_of(placed.begin(), placed.end(),
                       [](const render::PlacedStore& p) { return lod::hasWeights(p.store->hierarchy); });
}

}  // namespace stipple::scene
