// Ribbons and tubes: polylines with a radius at each vertex. What readers give and the build takes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "engine/base/numbers.h"

namespace stipple::lod {

/// Many polylines; arrays of vertices are as long as `position`, arrays of curves one shorter than `first`.
struct CurveSet {
    std::vector<glm::dvec3> position;
    std::vector<float> radius;       ///< world units; a ribbon's half-width
    std::vector<glm::vec3> normal;   ///< of ribbons, any length; zero: not known
    std::vector<uint32_t> colour;    ///< sRGB
    std::vector<uint32_t> first{0};  ///< first vertex of each curve, and the end
    std::vector<uint8_t> isRibbon;
    bool hasColour = false;  ///< colours of the file's own
    glm::dvec3 up{0, 0, 1};
    std::map<std::string, uint64_t> dropped;     ///< reason -> segments that cleanCurves left out
    std::map<std::string, uint64_t> mended;      ///< what else was odd, and how often
    uint64_t segmentsIn = 0, segmentsAdded = 0;  ///< before cleanCurves, and by it
    std::vector<std::string> notes;
    size_t curves() const { return isRibbon.size(); }
    void addVertex(const glm::dvec3& p, float r, const glm::vec3& n, uint32_t c) {
        position.push_back(p);
        radius.push_back(r);
        normal.push_back(n);
        colour.push_back(c);
    }
    /// Ends the curve whose vertices were added since the last call.
    void endCurve(bool ribbon) {
        first.push_back(static_cast<uint32_t>(position.size()));
        isRibbon.push_back(ribbon ? 1 : 0);
    }
};

struct CurveBounds {
    glm::dvec3 lo{std::numeric_limits<double>::max()}, hi{-lo};  ///< of finite vertices; lo > hi: there are none
    void add(const glm::dvec3& p) {
        if (!isFinite(p)) return;
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    /// The diagonal; 1 of nothing.
    double extent() const { return lo.x <= hi.x ? std::max(glm::length(hi - lo), 1e-300) : 1; }
};

/// Drops what cannot be drawn (single vertices, no length, not finite), repeats, and fills what is missing: radii of
/// `defaultRadius` (0: a 4000th of the extent) where there is none, normals of ribbons by the least turning along the
/// curve. Twists of more than a sixth of a turn between two vertices get vertices of their own. `extent`: of all
/// curves that `in` is a part of; 0: it is all.
CurveSet cleanCurves(CurveSet in, double defaultRadius, double extent = 0);

}  // namespace stipple::lod
