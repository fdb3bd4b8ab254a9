// Stores and scenes.
#include "engine/api/held.h"
#include "engine/scene/open/cache.h"
#include "engine/scene/open/scene_facts.h"

namespace stipple::v1 {

Result<Store> Store::open(const std::string& path) {
    auto opened = scene::openStoreFile(path, lod::Tables::asNeeded);
    if (!opened) return given(opened.error());
    return Store(std::make_shared<const Held>(Held{std::move(*opened)}));
}

std::string Store::primitive() const {
    const lod::Store& s = *held_->store;
    if (s.description.patches.patches > 0) return "patch";
    return s.hierarchy.isMesh() ? "triangle" : s.hierarchy.isCurves ? "segment" : "point";
}
uint64_t Store::primitives() const { return held_->store->description.points; }
uint64_t Store::records() const { return held_->store->description.records; }
uint64_t Store::nodes() const { return held_->store->hierarchy.nodes.size(); }
Vec3 Store::boundsMin() const { return given(held_->store->description.boundsMin); }
Vec3 Store::boundsMax() const { return given(held_->store->description.boundsMax); }
Vec3 Store::up() const { return given(held_->store->description.up); }
double Store::rounding() const { return held_->store->description.roundingUnits; }
std::string Store::crs() const {
    const lod::Crs& crs = held_->store->description.crs;
    return crs.name.empty() && crs.epsg == 0 ? std::string() : crs.label();
}

namespace {

/// Colours as points have them where nobody asks.
::stipple::Result<std::shared_ptr<Scene::Held>> withColours(scene::OpenedScene opened) {
    auto held = std::make_shared<Scene::Held>(Scene::Held{std::move(opened), {}});
    STIPPLE_ASSIGN(held->colour, scene::applyColours(held->opened, "auto", "", ""));
    return held;
}

::stipple::Result<lod::Instance> instanceOf(const Place& place) {
    lod::Instance out;
    out.scale = place.scale;
    out.translation = v1::taken(place.translation);
    glm::dmat3 rows;
    for (int r = 0; r < 3; ++r) rows[r] = v1::taken(place.rotation.at(static_cast<size_t>(r)));
    out.rotation = glm::transpose(rows);
    const glm::dmat3 product = rows * glm::transpose(rows);
    double deviation = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) deviation = std::max(deviation, std::abs(product[c][r] - (c == r ? 1 : 0)));
    const double far = glm::length(out.translation);
    if (!(place.scale > 0) || !std::isfinite(place.scale) || !std::isfinite(far) || !(deviation < 1e-9) ||
        glm::determinant(rows) < 0)
        return fail(::stipple::ErrorKind::usage, "is no rotation with an even scale above 0", "place of a store");
    return out;
}

}  // namespace

Result<Scene> Scene::open(const std::vector<std::string>& inputs, const OpenSettings& s) {
    if (inputs.empty()) return Error{ErrorKind::usage, "there is nothing to open", "inputs", ""};
    scene::OpenSettings settings = openSettings(s.memoryBytes, s.threads, s.surfels, s.listener);
    if (s.cacheBytes > 0) settings.cacheLimit = std::to_string(s.cacheBytes);
    const auto executor = makeTbbExecutor(static_cast<int>(s.threads));
    auto opened = scene::openScene(inputs, settings, *executor);
    if (!opened) return given(opened.error());
    auto held = withColours(std::move(*opened));
    if (!held) return given(held.error());
    return Scene(std::move(*held));
}

Result<Scene> Scene::of(const std::vector<std::pair<Store, Place>>& placed) {
    if (placed.empty()) return Error{ErrorKind::usage, "there is nothing to place", "stores", ""};
    scene::OpenedScene opened;
    for (const auto& [store, place] : placed) {
        auto instance = instanceOf(place);
        if (!instance) return given(instance.error());
        render::PlacedStore one;
        one.store = store.held_->store;
        one.place = std::move(*instance);
        opened.placed.push_back(std::move(one));
    }
    opened.description = scene::describe(opened.placed);
    if (placed.size() == 1) opened.description.up = placed.front().first.held_->store->description.up;
    opened.outline = scene::outlineOf(opened.placed);
    auto held = withColours(std::move(opened));
    if (!held) return given(held.error());
    return Scene(std::move(*held));
}

Vec3 Scene::boundsMin() const { return given(held_->opened.description.boundsMin); }
Vec3 Scene::boundsMax() const { return given(held_->opened.description.boundsMax); }
Vec3 Scene::up() const { return given(held_->opened.description.up); }
uint64_t Scene::primitives() const {
    uint64_t sum = 0;
    for (const render::PlacedStore& p : held_->opened.placed) sum += p.store->description.points;
    return sum;
}
std::vector<Camera> Scene::cameras() const {
    std::vector<Camera> out;
    for (const scene::Camera& camera : held_->opened.cameras) out.push_back(given(camera));
    return out;
}
Camera Scene::overview(double aspect) const {
    const scene::OpenedScene& o = held_->opened;
    return given(scene::fitCamera(o.outline, o.description.up, aspect > 0 && std::isfinite(aspect) ? aspect : 1));
}

Result<void> Scene::colourBy(const std::string& what, const std::string& map) {
    auto by = scene::applyColours(held_->opened, what, map, "");
    if (!by) return given(by.error());
    held_->colour = *by;
    return {};
}

}  // namespace stipple::v1
