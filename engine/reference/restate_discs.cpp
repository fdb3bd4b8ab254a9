#include "engine/reference/restate_discs.h"

#include <cmath>

#include "lod/primitives/patch_samples.h"
#include "lod/primitives/record_spacing.h"
#include "shaders/shared/material.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

/// Do discs of a node reach only a few of each other's spacings? Where they reach farther none is filled exactly, but
/// in parallel views those that no texel holds.
bool mayBeWide(const lod::Hierarchy& h, const lod::Node& node, std::span<const shared::PointRecord> records,
               const lod::View& view, double scale) {
    double most = 0;
    for (const shared::PointRecord& r : records) most = std::max(most, decodeDisc(h, node, r).radius);
    if (most * std::sqrt(static_cast<double>(records.size())) <= 4 * h.unit * h.cellSize(node)) return true;
    return view.isOrthographic && scale * most * view.focalPixels > 8192;
}

/// Are usual discs of a node, by the mean of their radius codes, wider than eight pixels at the middle of its cell?
bool areFacets(const render::DrawList& draws, const lod::CutDraw& cut, const render::Bend* bend,
               std::span<const shared::PointRecord> records) {
    const lod::View& v = draws.view;
    const lod::Instance& instance = draws.instances[cut.instance];
    const lod::Hierarchy& h = *draws.hierarchies[instance.hierarchy];
    const lod::Node& node = h.nodes[cut.node];
    const auto real = lod::withoutEmpty(records);
    double sum = 0;
    for (const shared::PointRecord& r : real) sum += shared::recordRadiusCode(r);
    const double usual = std::exp2((std::floor(sum / static_cast<double>(real.size()) + 0.5) - 255) / 16);
    dvec3 middle = instance.translation +
                   instance.rotation *
                       (instance.scale *
                        (h.origin + h.unit * (h.recordOrigin(node, h.payload(cut.chunk)) + 0.5 * h.cellSize(node))));
    if (bend) middle = bend->moved(middle);
    const double depth = glm::dot(middle - v.eye, v.forward);
    const double radius =
        usual * instance.scale * h.unit * h.cellSize(node) * cut.radiusScale * draws.frame.supportScale;
    return radius * v.focalPixels > 4 * (v.isOrthographic ? 1 : depth);
}

/// Of the plane of a disc where wind has moved it: three points of it, `reach` apart, moved one by one.
dvec3 bentNormal(const render::Bend& bend, const dvec3& p, const dvec3& n, double reach) {
    if (bend.isStill() || !(glm::length(n) > 0)) return n;
    const dvec3 a = glm::normalize(glm::cross(n, std::abs(n.x) < 0.7 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
    const dvec3 b = glm::cross(n, a), at = bend.moved(p);
    return glm::normalize(glm::cross(bend.moved(p + reach * a) - at, bend.moved(p + reach * b) - at));
}

/// Depth of a disc on a ray, and rho^2 there; infinite where it is not met.
std::pair<double, double> meet(const PlacedDisc& d, const ViewRay& ray, double nearPlane) {
    const double depth = glm::dot(d.normal, d.centre - ray.origin) / glm::dot(d.normal, ray.direction);
    const dvec3 off = ray.at(depth) - d.centre;
    const double rho2 = glm::dot(off, off) / (d.radius * d.radius);
    return depth > nearPlane && rho2 <= 1 ? std::pair(depth, rho2) : std::pair(HUGE_VAL, HUGE_VAL);
}

/// Of a disc that the ray through the pixel of its centre misses: the depth by which it competes there (that of its
/// plane, no nearer than its rim and no more than 64 pixels beyond it, a quarter of its radius behind), and the one
/// that it shows.
struct MissedDisc {
    double competes, shown;
};
MissedDisc missedAt(const PlacedDisc& d, const ViewRay& ray, const lod::View& view) {
    const double reach = d.radius * std::hypot(d.normal.x, d.normal.y);
    const double nearest = std::max(d.centre.z - reach, view.nearPlane), rim = std::max(d.centre.z + reach, nearest);
    const double farthest = rim + 64 / pixelsAt(view, d.centre.z);
    double plane = glm::dot(d.normal, d.centre - ray.origin) / glm::dot(d.normal, ray.direction);
    if (!view.isOrthographic && !(plane > 0)) plane = HUGE_VAL;  // beyond the horizon
    if (std::isnan(plane)) plane = d.centre.z;
    const double competes = std::clamp(plane, nearest, farthest) + 0.25 * d.radius;
    return {competes, std::min(competes, rim)};
}

/// The material of a record: that of the whole picture, its own, or its store's.
std::optional<lod::PointMaterial> materialOf(const render::DrawList& draws, uint32_t hierarchy,
                                             const std::vector<uint16_t>& own, uint32_t record) {
    uint32_t packed = shared::kPlainPoint;
    if (draws.onlyMaterial)
        packed = *draws.onlyMaterial;
    else if (!own.empty())
        packed = own[record];
    else if (hierarchy < draws.pointMaterial.size())
        packed = draws.pointMaterial[hierarchy];
    if (packed == shared::kPlainPoint) return {};
    return lod::PointMaterial{static_cast<float>(packed >> 8) / 255, static_cast<float>(packed & 255u) / 255};
}

bool isLeaf(const PlacedDisc& d) { return (d.flags & shared::kFlagLeaf) != 0; }

}  // namespace

void setMaterial(Sample& s, const std::optional<lod::PointMaterial>& material) {
    s.materialShare = material ? 1 : 0;
    s.metallic = material ? double{material->metallic} : 0;
    s.roughness = material ? double{material->roughness} : 1;
}

Sample shownPixel(const lod::View& view, const dvec2& at, double depth, const dvec3& n, const dvec3& colour,
                  bool isLeaf) {
    Sample s;
    s.valid = true;
    s.depth = s.key = depth;
    s.centre = at;
    s.radius = 0.25;
    s.thickness = (isLeaf ? kLeafThickness : 1) * 0.25 / pixelsAt(view, depth);
    s.perp = dvec2(rotationToZ(viewRay(view, at).sight()) * n);
    s.colour = colour;
    return s;
}

std::vector<PlacedDisc> placedDiscs(const render::DrawList& draws, const Chunks& chunks) {
    const lod::View& v = draws.view;
    const shared::FrameConstants& f = draws.frame;
    std::vector<PlacedDisc> out;
    for (size_t d = 0; d < draws.cut.size(); ++d) {
        const lod::CutDraw& cut = draws.cut[d];
        const lod::Instance& instance = draws.instances[cut.instance];
        const lod::Hierarchy& h = *draws.hierarchies[instance.hierarchy];
        const lod::Node& node = h.nodes[cut.node];
        const lod::Chunk& chunk = chunks.at(uint64_t{draws.firstSource + instance.source} << 32 | cut.chunk);
        const auto& records = chunk.records;
        if (records.empty()) continue;  // of another kind
        // A level of an overview is beside none of the root's own records, nor of another level: all of it has one
        // error.
        const auto codeOf = [&](size_t i) { return shared::recordErrorCode(records[i]); };
        size_t overview = 0;
        while (cut.chunk == 0 && overview < records.size() && codeOf(overview) > node.errorCode) ++overview;
        const bool isOverview = cut.first < overview;
        size_t end = isOverview ? cut.first : records.size();
        while (isOverview && end < overview && codeOf(end) == codeOf(cut.first)) ++end;
        const size_t begin = isOverview ? cut.first : overview;
        const auto alike = std::span(records).subspan(begin, end - begin);
        const bool few = mayBeWide(h, node, alike, v, instance.scale * f.supportScale);
        const double step = h.cellSize(node) / 65536;
        // What the store tells is in eighths of octaves; what it does not tell is measured.
        const uint8_t code = h.payload(cut.chunk).spacingCode;
        const double steps =
            code > 0 ? std::exp2((code - 1) / 8.0) : double{lod::recordSpacing(lod::withoutEmpty(records))};
        const double spacing = h.isStochastic || isOverview ? 0 : instance.scale * h.unit * step * steps;
        const bool isDebug = f.debugView == shared::kDebugLevel || f.debugView == shared::kDebugError;
        const bool isSmooth =
            !isDebug && spacing > 0 && areFacets(draws, cut, draws.bends.empty() ? nullptr : &draws.bends[d], alike);
        for (uint32_t i = cut.first; i < cut.first + cut.count; ++i) {
            Disc disc = decodeDisc(h, node, records[i]);
            disc.radius *= cut.radiusScale;
            if (disc.errorCode > cut.errorCode && !(cut.octantMask >> disc.octant & 1u)) continue;
            dvec3 world = instance.translation + instance.rotation * (instance.scale * disc.position);
            dvec3 nw = instance.rotation * disc.normal;
            if (!draws.bends.empty()) {
                const double reach = instance.scale * disc.radius;
                nw = bentNormal(draws.bends[d], world, nw, reach > 0 ? reach : 1);
                world = draws.bends[d].moved(world);
            }
            world -= v.eye;
            const dvec3 c(glm::dot(world, v.right), glm::dot(world, v.down), glm::dot(world, v.forward));
            dvec3 n(glm::dot(nw, v.right), glm::dot(nw, v.down), glm::dot(nw, v.forward));
            const bool oneSided = (disc.flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) == 0;
            if (oneSided && glm::dot(n, sightOf(v, c)) >= 0) continue;
            if ((disc.flags & shared::kFlagNoNormal) != 0) n = -sightOf(v, c);
            // Squares of 255ths.
            const double weight = chunk.weights.empty() ? 0 : std::pow(chunk.weights[i] / 255.0, 2);
            out.push_back({c, n, instance.scale * disc.radius * f.supportScale,
                           isDebug ? debugColour(f, node, cut) : disc.colour, disc.flags, spacing, weight, isSmooth,
                           few, materialOf(draws, instance.hierarchy, chunk.materials, i)});
        }
    }
    return out;
}

bool isWide(const lod::View& v, const PlacedDisc& d) {
    const double widest = std::max(std::max(v.width, v.height) / 32.0, 32.0);  // px
    if ((d.flags & shared::kFlagScattered) != 0) return false;
    if ((d.flags & shared::kFlagNoNormal) != 0 && d.centre.z <= v.nearPlane) return false;
    return d.radius * v.focalPixels > widest * (v.isOrthographic ? 1 : d.centre.z) &&
           d.centre.z + d.radius > v.nearPlane;
}

void showWide(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    const lod::View& view = draws.view;
    const double nearPlane = view.nearPlane;
    for (int y = 0; y < level.height && !discs.empty(); ++y)
        for (int x = 0; x < level.width; ++x) {
            const dvec2 at(x + 0.5, y + 0.5);
            const ViewRay ray = viewRay(view, at);
            const PlacedDisc* front = nullptr;
            double depth = HUGE_VAL;
            for (const PlacedDisc& d : discs)
                if (const double z = meet(d, ray, nearPlane).first; z < depth) {
                    depth = z;
                    front = &d;
                }
            Sample& s = level.ref(x, y);
            if (!front || (s.valid && s.key <= depth)) continue;
            const double length = glm::length(ray.direction);
            const double facing = std::abs(glm::dot(front->normal, ray.direction)) / length;
            const double apart = 0.25 * front->radius / length / std::max(facing, 0.125);
            double weight = 0, linear = 0, share = 0, metallic = 0, roughness = 0;
            dvec3 n(0), colour(0);
            for (const PlacedDisc& d : discs) {
                const auto [z, rho2] = meet(d, ray, nearPlane);
                if (!(std::abs(z - depth) <= apart)) continue;
                const double k = (1 - rho2) * (1 - rho2) + 1e-4;
                weight += k;
                linear += view.isOrthographic ? k * z : k / z;
                n += (glm::dot(d.normal, ray.direction) > 0 ? -k : k) * d.normal;
                colour += k * d.colour;
                if (!d.material) continue;
                share += k;
                metallic += k * double{d.material->metallic};
                roughness += k * double{d.material->roughness};
            }
            s = shownPixel(view, at, view.isOrthographic ? linear / weight : weight / linear, glm::normalize(n),
                           colour / weight, isLeaf(*front));
            if (!isLeaf(*front)) s.thickness = apart;
            if (share > 0)
                setMaterial(
                    s, lod::PointMaterial{static_cast<float>(roughness / share), static_cast<float>(metallic / share)});
            s.materialShare = share / weight;
        }
}

void showSplats(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    const lod::View& v = draws.view;
    const auto offer = [&](int x, int y, const PlacedDisc& d, bool isCentre) {
        const dvec2 at(x + 0.5, y + 0.5);
        const ViewRay ray = viewRay(v, at);
        double depth = meet(d, ray, v.nearPlane).first;
        double shown = depth;
        if (depth == HUGE_VAL && isCentre) {
            const MissedDisc missed = missedAt(d, ray, v);
            depth = missed.competes;
            shown = missed.shown;
        }
        Sample& s = level.ref(x, y);
        if (depth == HUGE_VAL || (s.valid && s.key <= depth)) return;
        const dvec3 n = glm::dot(d.normal, ray.direction) > 0 ? -d.normal : d.normal;
        s = shownPixel(v, at, shown, n, d.colour, isLeaf(d));
        s.key = depth;
        setMaterial(s, d.material);
        s.isSmooth = d.isSmooth;
    };
    for (PlacedDisc d : discs) {
        const bool isAhead = d.centre.z > v.nearPlane;
        const double stored = d.radius;
        if ((d.flags & shared::kFlagNoNormal) != 0 && !isAhead) continue;
        // A stray point hides no more of the picture than this.
        if ((d.flags & shared::kFlagScattered) != 0)
            d.radius = std::min(d.radius, std::max(v.height / 128.0, 4.0) / pixelsAt(v, std::max(d.centre.z, 1e-300)));
        // All of it lies within its sphere; that is seen within a box of pixels if it is wholly before the eye.
        int x0 = 0, x1 = level.width - 1, y0 = 0, y1 = level.height - 1;
        if (v.isOrthographic || d.centre.z > 1.01 * d.radius) {
            const auto range = [&](double across, double middle, int most, int& first, int& last) {
                const double nearest = d.centre.z - d.radius, farthest = d.centre.z + d.radius;
                const double lo = across - d.radius, hi = across + d.radius;
                const double a = middle + lo * pixelsAt(v, lo < 0 ? nearest : farthest),
                             b = middle + hi * pixelsAt(v, hi > 0 ? nearest : farthest);
                first = a > most ? most + 1 : std::max(0, pixelIn(a, most) - 1);
                last = b < 0 ? -1 : std::min(most, pixelIn(b, most) + 1);
            };
            range(d.centre.x, v.principal().x, level.width - 1, x0, x1);
            range(d.centre.y, v.principal().y, level.height - 1, y0, y1);
        }
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) offer(x, y, d, false);
        // Those that stand alone show it anyway; of others, only the small ones.
        const bool isLoose = (d.flags & (shared::kFlagScattered | shared::kFlagLeaf)) != 0;
        const bool isAlone = isLoose || 2.002 * stored < d.spacing;  // (just as wide: not alone)
        if (!isAhead || (!isAlone && d.radius * pixelsAt(v, d.centre.z) >= std::sqrt(0.5))) continue;
        const dvec2 p = imageOf(v, d.centre);
        if (p.x >= 0 && p.y >= 0 && p.x < level.width && p.y < level.height)
            offer(static_cast<int>(p.x), static_cast<int>(p.y), d, true);
    }
}

}  // namespace stipple::reference
