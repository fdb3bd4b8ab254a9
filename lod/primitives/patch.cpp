#include "lod/primitives/patch.h"

#include <algorithm>

#include "engine/base/numbers.h"

namespace stipple::lod {

size_t Patch::samples() const {
    return heights.size() - static_cast<size_t>(std::count(heights.begin(), heights.end(), uint16_t{0}));
}

size_t Patch::drawnCells() const {
    return cells.size() - static_cast<size_t>(std::count(cells.begin(), cells.end(), uint8_t{0}));
}

namespace {

std::string mapFault(const Patch& p) {
    const PatchMap& m = p.map;
    if (m.density > PatchMap::kMostDensity) return "has a map of too many texels a cell";
    const size_t all = (size_t{p.width - 1} << m.density) * (size_t{p.height - 1} << m.density) +
                       ((size_t{p.width - 1} + (p.height - 1)) << m.density) + 1;
    const size_t texels = m.density == 0 ? 0 : all;
    const bool isWhole = m.colours.size() == texels && (m.normals.empty() || m.normals.size() == texels) &&
                         (m.light.empty() || m.light.size() == all);
    return isWhole ? "" : "has a map of another size than its sides say";
}

}  // namespace

std::string patchFault(const Patch& p) {
    if (p.width < 2 || p.height < 2 || p.width > Patch::kMostSide || p.height > Patch::kMostSide)
        return "has sides of none, one or too many samples";
    const size_t samples = size_t{p.width} * p.height, cells = size_t{p.width - 1} * (p.height - 1);
    if (p.heights.size() != samples || p.normals.size() != samples || p.colours.size() != samples ||
        p.cells.size() != cells || (!p.materials.empty() && p.materials.size() != samples))
        return "has arrays of other sizes than its sides say";
    if (const std::string fault = mapFault(p); !fault.empty()) return fault;
    const float length = glm::dot(p.turn, p.turn);
    if (!isFinite(p.origin) || !(length > 0.99f && length < 1.01f)) return "has a plane that is none";
    // Squares of lengths are finite and none of them vanishes, in fp32.
    constexpr double kMostOrigin = 1e18;
    constexpr float kLeastStep = 1e-15f, kMostStep = 1e15f;
    constexpr int32_t kLeastExponent = -60, kMostExponent = 40;
    if (glm::length(p.origin) > kMostOrigin || !(p.step >= kLeastStep) || p.step > kMostStep ||
        p.quantumExponent < kLeastExponent || p.quantumExponent > kMostExponent)
        return "has a step that is too small or too large";
    if (!(p.errorToSource >= 0) || !(p.errorFromSource >= 0) || !std::isfinite(p.errorToSource + p.errorFromSource))
        return "has errors that are none";
    std::vector<uint8_t> used(samples, 0);
    for (uint32_t j = 0; j + 1 < p.height; ++j)
        for (uint32_t i = 0; i + 1 < p.width; ++i)
            if (p.hasCell(i, j))
                for (const size_t s : {p.at(i, j), p.at(i + 1, j), p.at(i, j + 1), p.at(i + 1, j + 1)}) used[s] = 1;
    for (size_t s = 0; s < samples; ++s)
        if ((p.heights[s] != 0) != (used[s] != 0)) return "has a sample without a cell, or a cell without a sample";
    return "";
}

}  // namespace stipple::lod
