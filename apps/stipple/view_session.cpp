#include "apps/stipple/view_session.h"
#include "engine/scene/open/scene_facts.h"

#include <algorithm>
#include <cmath>

#include "engine/base/process.h"
#include "engine/base/units.h"
#include "engine/render/wind.h"
#include "lod/store/materials.h"

namespace stipple::app {

double ViewSession::diagonal() const {
    const double length = glm::length(scene_.description.boundsMax - scene_.description.boundsMin);
    return length > 0 && std::isfinite(length) ? length : 1;
}

/// What is resident is given back first: the new chunks may need its room.
void ViewSession::restart(render::FrameSettings& settings) {
    const lod::StoreDescription& d = scene_.description;
    state_.reset();
    streaming::StreamSettings stream;
    stream.residentBytes = parseBytes(options_.resident);
    options_.drawn.applyTo(scene_.placed);
    state_ = render::makeFrameState(scene_.placed, backend_, executor_, stream, scene_.groups);
    settings.draw.lights = scene_.lights;
    settings.draw.worldUp = d.up;
    settings.draw.wind.towards = render::windAcross(d.up);
    settings.draw.unlitTriangles = options_.shade == "unlit";
    settings.draw.lit = scene::isLit(options_.shade, d, colour_);
    options_.sun.applyTo(settings.draw);
    if (const auto material = options_.material.material()) {
        settings.draw.pointMaterial = lod::packed(*material);
        settings.draw.optics = material->optics;
        settings.draw.lit = true;
    }
    // What could be said was, before the window opened.
    if (const auto asked =
            options_.effects.applyTo(settings.draw, scene_.effects, scene::storesOf(scene_.placed), false);
        !asked)
        report(asked.error());
    render::setSway(settings.draw.wind, state_->hierarchies, state_->instances, state_->groups);
    legend_ = makeLegend(colour_, d);
}

int ViewSession::upAxis() const {
    const glm::dvec3 up = glm::abs(scene_.description.up);
    return up.x > up.y && up.x > up.z ? 0 : up.y > up.z ? 1 : 2;
}

Result<void> ViewSession::show(OpenedScene scene, const ColourOptions& colour, render::FrameSettings& settings) {
    STIPPLE_ASSIGN(colour_, scene::applyColours(scene, colour.what, colour.map, colour.range));
    shown_ = colour;
    std::swap(scene_, scene);  // what was shown lives until its chunks are given back
    ownUpAxis_ = upAxis();
    restart(settings);
    return {};
}

std::vector<std::string> coloursAfter(const lod::ColourBy& now, const lod::StoreDescription& d) {
    std::vector<std::string> names{"plain", "height"};
    if (d.hasNormals) names.emplace_back("normal");
    for (const lod::AttributeInfo& a : d.attributes) names.push_back(a.name);
    auto next = names.begin();
    if (now.mode != lod::ColourMode::own) next = std::find(names.begin(), names.end(), now.title);
    if (next == names.end()) next = names.begin();
    std::rotate(names.begin(), next + 1, names.end());
    return names;
}

Result<void> ViewSession::nextColours(render::FrameSettings& settings) {
    std::vector<lod::ColourBy> before;
    for (const render::PlacedStore& p : scene_.placed) before.push_back(p.colour);
    std::optional<Error> problem;
    for (const std::string& name : coloursAfter(colour_, scene_.description)) {
        const auto colours = scene::applyColours(scene_, name, "", "");
        if (colours && (colours->mode != lod::ColourMode::own || colour_.mode != lod::ColourMode::own)) {
            colour_ = *colours;
            shown_ = {name, "", "", shown_.legend};
            restart(settings);
            return {};
        }
        if (!colours && !problem) problem = colours.error();
    }
    for (size_t i = 0; i < before.size(); ++i) scene_.placed[i].colour = before[i];
    return tl::unexpected<Error>(problem.value_or(Error{ErrorKind::usage, "has no other colours", "the scene", ""}));
}

void ViewSession::turnUp(render::FrameSettings& settings) {
    glm::dvec3 up(0);
    up[nextUpAxis(upAxis(), ownUpAxis_)] = 1;
    scene_.description.up = up;
    settings.draw.worldUp = scene_.description.up;
    settings.draw.wind.towards = render::windAcross(settings.draw.worldUp);
    if (colour_.mode != lod::ColourMode::height) return;  // heights are along it
    if (const auto colours = scene::applyColours(scene_, shown_.what, shown_.map, shown_.range); colours) {
        colour_ = *colours;
        restart(settings);
    }
}

}  // namespace stipple::app
