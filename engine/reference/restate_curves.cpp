// Ribbons and tubes once more, in fp64, from the definitions: a segment narrower than the limit is a line of pixels (by
// columns or rows, whichever it crosses more of) and its two ends, a wide ribbon or tube all pixels whose rays meet it
// (curve_rays.h).
#include <algorithm>
#include <cmath>

#include "engine/reference/curve_rays.h"
#include "engine/reference/decode.h"
#include "engine/reference/restate.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

constexpr double kNarrow = 0.5;

/// A place on a segment, in camera space.
struct Place {
    dvec3 c{0};
    double radius = 0;
    dvec3 direction{0};  ///< as stored, between the ends
    dvec3 colour{0};
};

struct TubeView {
    dvec2 perp;
    double depth;
};

/// Normal across the view and depth of a tube's surface at `off` px from its axis.
TubeView tubeAt(const Sample& s, dvec2 off, const lod::View& view) {
    off = s.radius > kNarrow ? off / s.radius : dvec2(0);
    const double sine2 = glm::length(s.axis);
    const double angle = 0.5 * std::atan2(s.axis.y, s.axis.x);
    const dvec2 axis(std::cos(angle), std::sin(angle));
    if (glm::length(off) > 1) off = glm::normalize(off);
    // A mean of a ball (an end that is seen along the axis) and of a cylinder's side.
    const double side = std::min(4 * sine2, 1.0), sine = std::max(std::sqrt(sine2), 0.5);
    const dvec2 across = off - axis * glm::dot(off, axis);
    const double ball = std::sqrt(std::max(0.0, 1 - glm::dot(off, off))),
                 rise = std::sqrt(std::max(0.0, 1 - glm::dot(across, across)));
    const double deeper = glm::mix(1 - ball, (1 - rise) / sine, side);
    return {glm::mix(off, across + s.perp * (rise / sine), side),
            s.depth + deeper * std::max(s.radius, 0.0) / pixelsAt(view, s.depth)};
}

/// How far a narrow tube's surface lies before its axis; `sine2`: between tube and view.
double frontOf(double radius, double sine2, double distance) {
    return std::min(radius * glm::mix(1.0, 1 / std::max(std::sqrt(sine2), 0.5), std::min(4 * sine2, 1.0)),
                    0.9 * distance);
}

class CurveProjector {
  public:
    CurveProjector(const render::DrawList& draws, Level& level) : level_(level), view_(draws.view), f_(draws.frame) {}

    void segment(const Segment& world, const lod::Instance& instance, const render::Bend& bend, uint32_t rank,
                 const dvec3* debugColour) {
        rank_ = rank;
        s_ = world;
        debugColour_ = debugColour;
        const auto toCamera = [&](const dvec3& w) {
            return dvec3(glm::dot(w, view_.right), glm::dot(w, view_.down), glm::dot(w, view_.forward));
        };
        const auto place = [&](const dvec3& p) {
            return toCamera(bend.moved(instance.translation + instance.rotation * (instance.scale * p)) - view_.eye);
        };
        a_ = place(world.a);
        b_ = place(world.b);
        s_.radiusA *= instance.scale;
        s_.radiusB *= instance.scale;
        // Where wind has moved a place and its neighbour.
        const auto direction = [&](const dvec3& p, const dvec3& along) {
            const dvec3 at = instance.translation + instance.rotation * (instance.scale * p);
            const dvec3 d = instance.rotation * along;
            return toCamera(bend.isStill() ? d : bend.moved(at + d) - bend.moved(at));
        };
        s_.directionA = direction(world.a, world.directionA);
        s_.directionB = direction(world.b, world.directionB);
        tangent_ = glm::length(b_ - a_) > 0 ? glm::normalize(b_ - a_) : dvec3(0);
        from_ = 0;
        to_ = 1;
        if (!clip()) {  // a flank may still be seen
            meet();
            return;
        }
        pa_ = imageOf(at(from_).c);
        pb_ = imageOf(at(to_).c);
        halfA_ = halfWidth(from_, s_.directionA);
        halfB_ = halfWidth(to_, s_.directionB);
        const auto seen = [&](const Place& p) { return p.radius * pixelsAt(view_, p.c.z); };
        const bool isWide = std::max(seen(at(from_)), seen(at(to_))) >= double{f_.exactCurves};
        if (isWide)
            meet();
        else
            line();
    }

  private:
    /// Leaves what is before the near plane, and no more than 16,384 px from the middle of the image.
    bool clip() {
        const double reach = 16384 / view_.focalPixels, slope = view_.isOrthographic ? 0 : reach,
                     off = view_.isOrthographic ? reach : 0;
        for (const dvec4& plane : {dvec4(0, 0, 1, -view_.nearPlane), dvec4(1, 0, slope, off), dvec4(-1, 0, slope, off),
                                   dvec4(0, 1, slope, off), dvec4(0, -1, slope, off)}) {
            const double da = glm::dot(plane, dvec4(a_, 1)), db = glm::dot(plane, dvec4(b_, 1));
            if (da < 0 && db < 0) return false;
            if (da < 0) from_ = std::max(from_, da / (da - db));
            if (db < 0) to_ = std::min(to_, da / (da - db));
        }
        return from_ < to_;
    }

    Place at(double t) const {
        Place p;
        p.c = a_ + t * (b_ - a_);
        p.c.z = std::max(p.c.z, view_.nearPlane);
        p.radius = s_.radiusA + t * (s_.radiusB - s_.radiusA);
        p.direction = s_.directionA + t * (s_.directionB - s_.directionA);
        p.colour = debugColour_ ? *debugColour_ : s_.colourA + t * (s_.colourB - s_.colourA);
        return p;
    }
    dvec2 imageOf(const dvec3& c) const { return reference::imageOf(view_, c); }
    double halfWidth(double t, const dvec3& across) const {
        Place p = at(t);
        p.direction = across;
        return halfWidthAt(p);
    }
    /// How far away the eye is from a place; infinitely in orthographic views.
    double distanceTo(const dvec3& c) const { return view_.isOrthographic ? 1e300 : glm::length(c); }
    /// For the order of what is drawn: depth of a tube's surface over its axis / depth of the axis; orthographic: what
    /// it lies before it.
    double nearerAt(double t) const {
        if (!s_.isTube) return view_.isOrthographic ? 0 : 1;
        const Place p = at(t);
        const double d = distanceTo(p.c), along = glm::dot(tangent_, sightOf(view_, p.c));
        const double front = frontOf(p.radius, std::max(1 - along * along, 0.0), d);
        return view_.isOrthographic ? front : 1 - front / d;
    }
    bool isTaken(uint32_t pixel, uint32_t id, double share) const {
        uint32_t h = (pixel * 0x9e3779b1u) ^ (id * 0x85ebca6bu) ^ (f_.coverageSeed * 0xc2b2ae35u);
        h = (h ^ h >> 16) * 0x7feb352du;
        h = (h ^ h >> 15) * 0x846ca68bu;
        h ^= h >> 16;
        return (h >> 8) / 16777216.0 < share;
    }

    void line() {
        const dvec2 d = pb_ - pa_;
        const int major = std::abs(d.x) >= std::abs(d.y) ? 0 : 1, minor = 1 - major;
        const double lo = std::min(pa_[major], pb_[major]), hi = std::max(pa_[major], pb_[major]);
        const int size = static_cast<int>(major == 0 ? view_.width : view_.height);
        const double slope = std::abs(d[major]) > 0 ? d[minor] / d[major] : 0, longer = std::sqrt(1 + slope * slope);
        for (int m = pixelIn(std::ceil(lo - 0.5), size); m < size && m + 0.5 < hi; ++m) {
            const double u = (m + 0.5 - pa_[major]) / d[major], other = pa_[minor] + u * d[minor];
            const double half = halfA_ + u * (halfB_ - halfA_);
            offer(major == 0 ? dvec2(m, other) : dvec2(other, m), u, half, rank_, 2 * half * longer);
        }
        const double length = std::max(std::abs(d.x), std::abs(d.y));
        for (const auto& [p, u, half] : {std::tuple{pa_, 0.0, halfA_}, std::tuple{pb_, 1.0, halfB_}})
            offer(p, u, half, ~rank_, 3.14159265 * half * half * (1 - length / std::max(2 * half, 1e-6)));
    }

    void offer(const dvec2& p, double u, double half, uint32_t id, double share) {
        if (!(p.x >= 0 && p.y >= 0 && p.x < level_.width && p.y < level_.height)) return;
        const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
        const auto pixel = static_cast<uint32_t>(y) * view_.width + static_cast<uint32_t>(x);
        if (half < kNarrow && !isTaken(pixel, id, share)) return;
        const double nearer = nearerAt(from_) + u * (nearerAt(to_) - nearerAt(from_));
        keep(x, y, view_.isOrthographic ? axisDepth(u) - nearer : axisDepth(u) * nearer);
    }
    double axisDepth(double u) const {
        const double za = at(from_).c.z, zb = at(to_).c.z;
        return view_.isOrthographic ? za + u * (zb - za) : 1 / (1 / za + u * (1 / zb - 1 / za));
    }

    /// A filled curve: every pixel whose ray meets it.
    void meet() {
        Segment own = s_;
        own.a = a_;
        own.b = b_;
        if (!own.isTube) {  // as wide as they were, however wind pulls at them
            own.directionA = glm::normalize(own.directionA);
            own.directionB = glm::normalize(own.directionB);
        }
        // Pixels of the cubes around both balls; all where they reach beside the eye.
        dvec2 lo(1e300), hi(-1e300);
        bool isBefore = true;
        for (int k = 0; k < 16; ++k) {
            const double r = k < 8 ? own.radiusA : own.radiusB;
            const dvec3 corner = (k < 8 ? a_ : b_) + r * (2.0 * dvec3(k & 1, k >> 1 & 1, k >> 2 & 1) - 1.0);
            isBefore = isBefore && (view_.isOrthographic || corner.z > view_.nearPlane);
            if (!isBefore) break;
            lo = glm::min(lo, imageOf(corner));
            hi = glm::max(hi, imageOf(corner));
        }
        if (!isBefore) {
            // Nothing of it if both balls lie beyond one side of the picture.
            // (Only in perspective.)
            const dvec2 before = view_.principal() / view_.focalPixels,
                        behind = (dvec2(view_.width, view_.height) - view_.principal()) / view_.focalPixels;
            for (const dvec3& side : {dvec3(1, 0, before.x), dvec3(-1, 0, behind.x), dvec3(0, 1, before.y),
                                      dvec3(0, -1, behind.y), dvec3(0, 0, 1)})
                if (std::max(glm::dot(side, a_) + glm::length(side) * own.radiusA,
                             glm::dot(side, b_) + glm::length(side) * own.radiusB) <= 0)
                    return;
            lo = dvec2(0);
            hi = dvec2(level_.width, level_.height);
        }
        for (int y = pixelIn(lo.y, level_.height); y < level_.height && y <= hi.y; ++y)
            for (int x = pixelIn(lo.x, level_.width); x < level_.width && x <= hi.x; ++x) {
                const ViewRay ray = viewRay(view_, dvec2(x, y) + 0.5);
                CurveHit hit;
                if (!meetsSegment(own, {ray.origin, ray.direction}, view_.nearPlane, hit)) continue;
                Sample& s = level_.ref(x, y);
                if (s.valid && s.key <= hit.t) continue;
                s = {};
                s.valid = true;
                s.key = s.depth = hit.t;
                s.centre = dvec2(x, y) + 0.5;
                s.colour = debugColour_ ? *debugColour_ : glm::mix(own.colourA, own.colourB, hit.place);
                s.perp = dvec2(rotationToZ(ray.sight()) * hit.normal);
                s.radius = 0.25;
                s.thickness = (own.isTube ? 1 : kLeafThickness) * 0.25 / pixelsAt(view_, s.depth);
            }
    }

    /// The sample at a pixel, if it is nearer than what is there by the depth `key`.
    void keep(int x, int y, double key) {
        Sample& s = level_.ref(x, y);
        if (s.valid && s.key <= key) return;
        const dvec2 pixel(x + 0.5, y + 0.5), d = pb_ - pa_;
        const double u = std::clamp(glm::dot(pixel - pa_, d) / std::max(glm::dot(d, d), 1e-8), 0.0, 1.0);
        const double za = at(from_).c.z, zb = at(to_).c.z;
        const double along = view_.isOrthographic ? u : u * za / ((1 - u) * zb + u * za);
        const Place p = at(from_ + along * (to_ - from_));
        const double distance = distanceTo(p.c), pixels = pixelsAt(view_, p.c.z);
        const dvec3 v = sightOf(view_, p.c);
        const double half = halfWidthAt(p);
        s = {};
        s.valid = true;
        s.key = key;
        s.colour = p.colour;
        s.centre = imageOf(p.c);
        const double support = f_.supportScale;
        if (s_.isTube) {
            const dvec3 t = glm::normalize(p.direction);
            const double tv = glm::dot(t, v);
            const dvec2 across = dvec2(rotationToZ(v) * t);
            const double reach = std::min(p.radius / distance, 0.9);
            const double front = frontOf(p.radius, std::max(1 - tv * tv, 0.0), distance);
            s.depth = std::max(p.c.z - front * v.z, view_.nearPlane);
            s.radius = p.radius * pixels / std::sqrt(1 - reach * reach) * support;
            s.isRound = half >= kNarrow;
            s.perp = s.isRound ? tv * across : dvec2(rotationToZ(v) * narrowNormal(t, v));
            if (s.isRound) s.axis = {across.x * across.x - across.y * across.y, 2 * across.x * across.y};
        } else {
            dvec3 n = glm::normalize(glm::cross(tangent_, p.direction));
            if (glm::dot(n, v) > 0) n = -n;
            s.depth = p.c.z;
            s.radius = std::max(p.radius * pixels, kNarrow) * support;
            s.perp = dvec2(rotationToZ(v) * n);
            s.axis = {1, 0};
        }
        if (half < kNarrow) s.centre = pixel;  // as deep as the axis, however its ribbon leans
        s.radius = half < kNarrow ? 0.25 : std::min(s.radius, 16384.0);
        const double facing = 1 - glm::dot(s.perp, s.perp);
        s.thickness = s.radius / pixelsAt(view_, s.depth);
        if (!s_.isTube)
            s.thickness = std::max(p.radius * pixels, kNarrow) * (0.25 + std::sqrt(std::max(0.0, 1 - facing))) /
                          pixelsAt(view_, s.depth);
    }
    /// Half of what is seen across the line that the axis is on the image, px.
    double halfWidthAt(const Place& p) const {
        const dvec3 v = sightOf(view_, p.c);
        const double sine = std::sqrt(std::max(1 - std::pow(glm::dot(tangent_, v), 2), 1e-6));
        const dvec3 normal = glm::cross(tangent_, p.direction);
        const double share =
            s_.isTube ? 1 : std::min(std::abs(glm::dot(normal, v)) / std::max(glm::length(normal), 1e-6) / sine, 1.0);
        // The plane through eye and axis, and how much of its normal lies in the image.
        const double off = glm::cross(v, tangent_).z / sine;
        const double inImage = std::sqrt(std::max({1 - off * off, v.z * v.z, 1e-6}));
        return p.radius * share * pixelsAt(view_, p.c.z) / inImage;
    }
    dvec3 narrowNormal(const dvec3& t, const dvec3& v) const {
        const dvec3 sun(f_.sunDirection);
        dvec3 n = sun - glm::dot(sun, t) * t;
        n -= std::max(glm::dot(n, v), 0.0) * v;
        return glm::dot(n, n) > 1e-6 ? glm::normalize(n) : -v;
    }

    Level& level_;
    const lod::View& view_;
    const shared::FrameConstants& f_;
    Segment s_;
    uint32_t rank_ = 0;
    const dvec3* debugColour_ = nullptr;
    dvec3 a_{0}, b_{0}, tangent_{0};
    double from_ = 0, to_ = 1, halfA_ = 0, halfB_ = 0;
    dvec2 pa_{0}, pb_{0};
};

}  // namespace

void projectCurves(const render::DrawList& draws, const Chunks& chunks, Level& level) {
    CurveProjector projector(draws, level);
    for (Sample& s : level.samples) s.key = s.valid ? s.depth : 0;
    for (size_t d = 0; d < draws.cut.size(); ++d) {
        const lod::CutDraw& cut = draws.cut[d];
        const lod::Instance& instance = draws.instances[cut.instance];
        const lod::Hierarchy& h = *draws.hierarchies[instance.hierarchy];
        if (h.payload(cut.chunk).kind != lod::Kind::curves) continue;
        const render::Bend bend = draws.bends.empty() ? render::Bend{} : draws.bends[d];
        const lod::Node& node = h.nodes[cut.node];
        const lod::Chunk& chunk = chunks.at(uint64_t{draws.firstSource + instance.source} << 32 | cut.chunk);
        const shared::FrameConstants& f = draws.frame;
        const bool isDebug = f.debugView == shared::kDebugLevel || f.debugView == shared::kDebugError;
        const dvec3 colour = isDebug ? debugColour(f, node, cut) : dvec3(0);
        for (uint32_t i = 0; i < cut.count; ++i) {
            const Segment s = decodeSegment(h, node, chunk.segments[i]);
            if (s.errorCode > cut.errorCode && (s.octants & cut.octantMask) == 0) continue;
            // The same in every cut.
            const shared::CurveVertex &va = chunk.segments[i].a, &vb = chunk.segments[i].b;
            const uint32_t rank = va.positionXY * 0x9e3779b1u ^ vb.positionXY * 0x85ebca6bu ^
                                  va.positionZ % 65536 * 0xc2b2ae35u ^ vb.positionZ % 65536 * 0x27d4eb2fu;
            projector.segment(s, instance, bend, rank, isDebug ? &colour : nullptr);
        }
    }
}

void finishTubes(const lod::View& view, Level& level) {
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) {
            Sample& s = level.ref(x, y);
            if (!s.valid || !s.isRound) continue;
            const TubeView seen = tubeAt(s, dvec2(x + 0.5, y + 0.5) - s.centre, view);
            s.perp = seen.perp;
            s.depth = seen.depth;
        }
}

}  // namespace stipple::reference
