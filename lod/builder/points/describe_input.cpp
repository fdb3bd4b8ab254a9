#include "lod/builder/points/describe_input.h"

namespace stipple::lod {
namespace {

/// The axis of the format or of the settings; away from the Earth's centre for coordinates that are relative to it.
glm::dvec3 upOf(const PointInput& input, const BuildSettings& settings, const StoreDescription& description) {
    constexpr double kLeastRadius = 6.33e6, kGreatestRadius = 6.40e6;  // metres, sea floor to mountain tops
    const glm::dvec3 centre = 0.5 * (description.boundsMin + description.boundsMax);
    const double radius = glm::length(centre) * description.metresPerUnit;
    const double extent = glm::length(description.boundsMax - description.boundsMin) * description.metresPerUnit;
    const bool isGeocentric =
        radius > kLeastRadius && radius < kGreatestRadius && extent < 1e5 && std::abs(centre.z) > 1e5;
    if (!settings.up && isGeocentric && !input.crs.isDegrees && (input.crs.isGeocentric || input.crs.label().empty()))
        return glm::normalize(centre);
    return axisVector(input.up);
}

}  // namespace

StoreDescription describeInput(const PointInput& input, const BuildSettings& settings) {
    StoreDescription d;
    d.crs = input.crs;
    d.metresPerUnit = input.crs.metresPerUnit;
    d.hasColour = input.hasColour;
    d.isReflectance = input.isReflectance;
    d.pointMaterials = input.materials;
    d.source = input.source;
    const auto& g = input.greatest;
    d.boundsMin = input.origin;
    d.boundsMax = input.origin + input.unit * glm::dvec3(g[0], g[1], g[2]);
    d.up = upOf(input, settings, d);
    return d;
}

}  // namespace stipple::lod
