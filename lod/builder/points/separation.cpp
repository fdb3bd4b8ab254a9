#include "lod/builder/points/separation.h"

#include <fmt/format.h>

#include <algorithm>

namespace stipple::lod {
namespace {

constexpr double kFarMetres = 1e6, kMetresPerDegree = 111320;

double metresPerUnit(const Crs& crs) { return crs.isDegrees ? kMetresPerDegree : crs.metresPerUnit; }

/// Between two boxes; 0 where they touch.
double gap(const Bounds& a, const Bounds& b) {
    return glm::length(glm::max(glm::max(a.least - b.greatest, b.least - a.greatest), glm::dvec3(0)));
}

std::string distanceText(double metres) {
    return metres < 1e4 ? fmt::format("{:.0f} m", metres) : fmt::format("{:.0f} km", metres / 1e3);
}

std::string namesOf(std::vector<std::string> paths) {
    std::sort(paths.begin(), paths.end());
    return paths.size() == 1 ? paths.front() : fmt::format("{} and {} more", paths.front(), paths.size() - 1);
}

/// Files on one side of the widest gap along any axis, the fewer ones.
struct Apart {
    double distance = 0;
    std::vector<std::string> paths;
};
Apart widestGap(std::vector<const PlacedInput*> inputs) {
    Apart widest;
    for (int a = 0; a < 3; ++a) {
        std::sort(inputs.begin(), inputs.end(),
                  [a](const auto* l, const auto* r) { return l->bounds.least[a] < r->bounds.least[a]; });
        double reached = inputs.front()->bounds.greatest[a];
        for (size_t i = 1; i < inputs.size(); ++i) {
            const double distance = inputs[i]->bounds.least[a] - reached;
            reached = std::max(reached, inputs[i]->bounds.greatest[a]);
            if (!(distance > widest.distance)) continue;
            const bool isBelow = 2 * i <= inputs.size();
            widest = {distance, {}};
            for (size_t k = isBelow ? 0 : i; k < (isBelow ? i : inputs.size()); ++k)
                widest.paths.push_back(inputs[k]->info->path);
        }
    }
    return widest;
}

}  // namespace

std::vector<std::string> separationNotes(const std::vector<PlacedInput>& inputs, const Crs& crs,
                                         const std::string& crsPath) {
    std::vector<const PlacedInput*> all;
    std::vector<std::string> unnamed;
    Bounds ofNamed, ofUnnamed;
    for (const PlacedInput& input : inputs) {
        if (input.bounds.isEmpty()) continue;
        all.push_back(&input);
        const bool isNamed = !input.info->crs.label().empty();
        (isNamed ? ofNamed : ofUnnamed).add(input.bounds);
        if (!isNamed) unnamed.push_back(input.info->path);
    }
    if (all.size() < 2) return {};
    if (!unnamed.empty() && !ofNamed.isEmpty()) {
        const double metres = gap(ofNamed, ofUnnamed) * metresPerUnit(crs);
        const std::string where =
            metres > 0 ? fmt::format("{} away from the others", distanceText(metres)) : std::string("among the others");
        return {fmt::format("{}: names no coordinate system; taken to be in {}, as {} is, where its points lie {}",
                            namesOf(unnamed), crs.label(), crsPath, where)};
    }
    const Apart apart = widestGap(all);
    const double metres = apart.distance * metresPerUnit(crs);
    if (metres < kFarMetres) return {};
    return {fmt::format("{}: lies {} away from the rest of the input: are all in one coordinate system?",
                        namesOf(apart.paths), distanceText(metres))};
}

}  // namespace stipple::lod
