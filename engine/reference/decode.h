// Records decoded in fp64, from the description of the format alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <optional>

#include "lod/cut/cut.h"
#include "lod/primitives/point_material.h"
#include "lod/store/hierarchy.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/record.h"

namespace stipple::reference {

/// A ray of camera space: `origin` + t `direction`, whose z is 1, so that t is the depth.
struct ViewRay {
    glm::dvec3 origin{0}, direction{0, 0, 1};
    glm::dvec3 at(double depth) const { return origin + depth * direction; }
    glm::dvec3 sight() const { return glm::normalize(direction); }
};
/// Through an image point, px from the upper left corner.
inline ViewRay viewRay(const lod::View& view, const glm::dvec2& point) {
    const glm::dvec2 off = (point - view.principal()) / view.focalPixels;
    if (view.isOrthographic) return {{off.x, off.y, 0}, {0, 0, 1}};
    return {{0, 0, 0}, {off.x, off.y, 1}};
}
/// Pixels of a world unit across the view, at a depth.
inline double pixelsAt(const lod::View& view, double depth) {
    return view.isOrthographic ? view.focalPixels : view.focalPixels / depth;
}
/// Where a place of camera space is seen, and the unit direction in which.
inline glm::dvec2 imageOf(const lod::View& view, const glm::dvec3& c) {
    return pixelsAt(view, c.z) * glm::dvec2(c) + view.principal();
}
inline glm::dvec3 sightOf(const lod::View& view, const glm::dvec3& c) {
    return view.isOrthographic ? glm::dvec3(0, 0, 1) : glm::normalize(c);
}

struct Disc {
    glm::dvec3 position{0};  ///< world
    glm::dvec3 normal{0};    ///< world; zero: none
    double radius = 0;       ///< world
    glm::dvec3 colour{0};    ///< linear
    uint32_t flags = 0, errorCode = 0, octant = 0;
    std::optional<lod::PointMaterial> material;  ///< only where it was read
};

inline double decodeSrgb(uint32_t byte) {
    const double s = byte / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
inline uint32_t encodeSrgb(double l) {
    if (!(l > 0)) return 0;
    if (l >= 1) return 255;
    const double s = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    return static_cast<uint32_t>(std::lround(s * 255.0));
}

inline glm::dvec3 decodeDirection(uint32_t code) {
    glm::dvec3 n((code % 65536) / 32767.0 - 1, (code / 65536) / 32767.0 - 1, 0);
    n.z = 1 - std::abs(n.x) - std::abs(n.y);
    if (n.z < 0) n = {(1 - std::abs(n.y)) * (n.x >= 0 ? 1 : -1), (1 - std::abs(n.x)) * (n.y >= 0 ? 1 : -1), n.z};
    return glm::normalize(n);
}

inline Disc decodeDisc(const lod::Hierarchy& h, const lod::Node& node, const shared::PointRecord& r) {
    Disc d;
    const double cell = std::ldexp(1.0, static_cast<int>(h.rootLog2) - node.level);
    const double step = cell / (h.isStochastic ? 32768 : 65536), margin = h.isStochastic ? 0.5 : 0;
    const glm::dvec3 q(r.positionXY % 65536, static_cast<double>(r.positionXY / 65536), r.positionZRadiusError % 65536);
    glm::dvec3 lattice = (glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) - margin) * cell + q * step;
    if (step > 1 && !h.isStochastic) lattice += glm::dvec3((step - 1) / 2);
    d.position = h.origin + h.unit * lattice;
    const uint32_t radiusCode = r.positionZRadiusError / 65536 % 256;
    d.errorCode = r.positionZRadiusError / 16777216;
    d.radius = h.unit * cell * std::exp2((radiusCode - 255.0) / 16.0);
    d.octant = (q.x >= 32768 ? 1u : 0u) + (q.y >= 32768 ? 2u : 0u) + (q.z >= 32768 ? 4u : 0u);
    d.flags = r.colour / 16777216;
    d.colour = {decodeSrgb(r.colour % 256), decodeSrgb(r.colour / 256 % 256), decodeSrgb(r.colour / 65536 % 256)};
    if ((d.flags & shared::kFlagNoNormal) == 0) {
        d.normal = decodeDirection(r.normal);
    }
    return d;
}

/// A segment of a ribbon or tube.
struct Segment {
    glm::dvec3 a{0}, b{0};  ///< world
    double radiusA = 0, radiusB = 0;
    glm::dvec3 directionA{0}, directionB{0};  ///< across a ribbon, along a tube
    glm::dvec3 colourA{0}, colourB{0};        ///< linear
    bool isTube = false;
    uint32_t errorCode = 0, octants = 0;
};

inline Segment decodeSegment(const lod::Hierarchy& h, const lod::Node& node, const shared::CurveSegment& from) {
    const double cell = std::ldexp(1.0, static_cast<int>(h.rootLog2) - node.level), step = cell / 32768;
    const auto place = [&](const shared::CurveVertex& v) {
        const glm::dvec3 q(v.positionXY % 65536, static_cast<double>(v.positionXY / 65536), v.positionZ % 65536);
        return h.origin + h.unit * ((glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) - 0.5) * cell + q * step);
    };
    const auto radius = [&](const shared::CurveVertex& v) {  // the upper 15 bits of an fp32 without sign
        const uint32_t code = v.positionZ / 65536 % 32768;
        const auto exponent = static_cast<int>(code / 128);
        const double mantissa = exponent == 0 ? code % 128 / 128.0 : 1 + code % 128 / 128.0;
        return h.unit * cell * std::ldexp(mantissa, std::max(exponent, 1) - 127);
    };
    const auto colour = [](const shared::CurveVertex& v) {
        return glm::dvec3(decodeSrgb(v.colour % 256), decodeSrgb(v.colour / 256 % 256),
                          decodeSrgb(v.colour / 65536 % 256));
    };
    return {place(from.a),
            place(from.b),
            radius(from.a),
            radius(from.b),
            decodeDirection(from.a.direction),
            decodeDirection(from.b.direction),
            colour(from.a),
            colour(from.b),
            from.a.positionZ / 65536 / 32768 != 0,
            from.a.colour / 16777216,
            from.b.colour / 16777216};
}

/// Share of the light on its far side that a leaf sends through.
constexpr double kThroughLeaf = 0.6;

/// Light of the scene's sun and sky on a white surface with eye-facing camera-space normal n; `occlusion`: how much of
/// the sky's gets there.
inline double lightOn(const glm::dvec3& n, const shared::FrameConstants& f, bool isLeaf, double occlusion = 1) {
    const double towards = glm::dot(n, glm::dvec3(f.sunDirection));
    return 0.75 * (towards > 0 ? towards
                   : isLeaf    ? -kThroughLeaf * towards
                               : 0.0) +
           occlusion * (0.25 + 0.15 * glm::dot(n, glm::dvec3(f.skyDirection)));
}

}  // namespace stipple::reference
