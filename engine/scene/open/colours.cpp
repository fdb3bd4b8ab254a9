// What colours of a scene stand for.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "engine/scene/open/open_scene.h"

namespace stipple::scene {
bool isLit(const std::string& shade, const lod::StoreDescription& d, const lod::ColourBy& colour) {
    if (shade != "auto") return shade == "lit";
    if (colour.mode == lod::ColourMode::own) return isShaded(d);
    return colour.mode == lod::ColourMode::height || colour.isCategorical;
}

namespace {

/// Heights of a placed store along the scene's up, in the store's own units: of all stores together, unless `isGiven`.
void alignHeights(const OpenedScene& scene, const render::PlacedStore& p, bool isGiven, lod::ColourBy& by) {
    const lod::StoreDescription& all = scene.description;
    const glm::dvec3 up = glm::transpose(p.place.rotation) * all.up;
    const bool isAlone = scene.placed.size() == 1 && glm::length(up - p.store->description.up) < 1e-6;
    by.up = up;
    if (!isGiven && !isAlone) {
        by.low = 1e300;
        by.high = -1e300;
        for (const glm::dvec3& at : scene.outline) {
            by.low = std::min(by.low, glm::dot(all.up, at));
            by.high = std::max(by.high, glm::dot(all.up, at));
        }
    }
    if (isAlone) return;
    const double base = glm::dot(all.up, p.place.translation);
    by.low = (by.low - base) / p.place.scale;
    by.high = (by.high - base) / p.place.scale;
    if (by.low == by.high) by.high = by.low + 1;
}

}  // namespace

Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range) {
    std::optional<lod::ColourBy> first;
    std::optional<Error> problem;
    std::map<const lod::Store*, int> places;
    for (const render::PlacedStore& p : scene.placed) ++places[p.store.get()];
    for (render::PlacedStore& p : scene.placed) {
        const lod::Hierarchy& h = p.store->hierarchy;
        const bool isSurface = h.isMesh() || h.isCurves;
        if (isSurface && what != "auto" && what != "plain" && what != "rgb") {
            const char* const kind = h.isMesh() ? "triangles" : "ribbons and tubes";
            if (!problem)
                problem = Error{ErrorKind::usage, fmt::format("{} cannot be coloured by '{}'", kind, what), "--colour",
                                h.isMesh() ? "--surfels N makes points of them" : "leave --colour out"};
            continue;
        }
        // Stores that stand in many places share their records only if those keep their own colours.
        const bool isPlain = what == "auto" && (isSurface || places[p.store.get()] > 1);
        auto by = lod::parseColourBy(isPlain ? "plain" : what, map, range, p.store->description);
        if (!by) problem = problem ? problem : by.error();
        if (by && by->mode == lod::ColourMode::height) alignHeights(scene, p, !range.empty(), *by);
        p.colour = by.value_or(lod::ColourBy{});
        if (by && !first) first = *by;
    }
    if (!first) return tl::unexpected(*problem);
    return *first;
}

}  // namespace stipple::scene
