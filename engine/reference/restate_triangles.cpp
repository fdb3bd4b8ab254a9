#include "engine/reference/restate_triangles.h"

#include <algorithm>
#include <cmath>

#include "engine/reference/decode.h"

namespace stipple::reference {

using glm::dvec2;
using glm::dvec3;

namespace {
bool isHidden(const Sample& nearest, double depth) { return nearest.valid && nearest.depth <= depth; }
}  // namespace

template <typename Use>
void TriangleProjector::cover(std::array<dvec2, 3> p, const Use& use) const {
    const auto cross = [](const dvec2& a, const dvec2& b) { return a.x * b.y - a.y * b.x; };
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (area == 0) return;
    if (area < 0) std::swap(p[1], p[2]);
    const dvec2 lo = glm::min(p[0], glm::min(p[1], p[2])), hi = glm::max(p[0], glm::max(p[1], p[2]));
    const int right = static_cast<int>(view_.width) - 1, bottom = static_cast<int>(view_.height) - 1;
    if (!(hi.x >= 0 && hi.y >= 0)) return;
    const int x0 = pixelIn(lo.x / 256, right + 1), x1 = pixelIn(hi.x / 256, right),
              y0 = pixelIn(lo.y / 256, bottom + 1), y1 = pixelIn(hi.y / 256, bottom);
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
            const dvec2 centre(x * 256 + 128, y * 256 + 128);
            bool isIn = true;
            for (size_t k = 0; k < 3; ++k) {
                const dvec2 edge = p.at((k + 1) % 3) - p.at(k);
                const double side = cross(edge, centre - p.at(k));
                const bool isTopLeftEdge = edge.y < 0 || (edge.y == 0 && edge.x > 0);
                isIn = isIn && (side > 0 || (side == 0 && isTopLeftEdge));
            }
            if (isIn) use(x, y);
        }
}

void TriangleProjector::triangle(const Corners& c, uint32_t surface, const shared::SurfaceMaterial& material,
                                 const TextureReader& textures, const Whole& of) {
    const dvec3 face = glm::cross(c[1].at - c[0].at, c[2].at - c[0].at);
    const double facing = view_.isOrthographic ? face.z : glm::dot(face, c[0].at);
    if (facing == 0 || (facing > 0 && (surface & shared::kSurfaceTwoSided) == 0)) return;
    // What is in front of the near plane, as a polygon on the screen.
    std::vector<dvec3> polygon;
    for (size_t k = 0; k < 3; ++k) {
        const dvec3 &a = c.at(k).at, &b = c.at((k + 1) % 3).at;
        if (a.z >= view_.nearPlane) polygon.push_back(a);
        if ((a.z >= view_.nearPlane) != (b.z >= view_.nearPlane))
            polygon.push_back(a + (b - a) * ((view_.nearPlane - a.z) / (b.z - a.z)));
    }
    if (polygon.size() < 3) return;
    std::vector<dvec2> snapped;  // in 1/256 pixel
    snapped.reserve(polygon.size());
    for (const dvec3& p : polygon) {
        const dvec2 at = imageOf(view_, p) * 256.0;
        snapped.push_back(isSnapped_ ? glm::floor(at + 0.5) : at);
    }
    for (size_t k = 1; k + 1 < polygon.size(); ++k)
        cover({snapped[0], snapped[k], snapped[k + 1]},
              [&](int x, int y) { pixel(x, y, c, face, surface, material, textures, of); });
}

void TriangleProjector::pixel(int x, int y, const Corners& c, const dvec3& face, uint32_t surface,
                              const shared::SurfaceMaterial& m, const TextureReader& textures, const Whole& of) {
    const ViewRay ray = viewRay(view_, dvec2(x + 0.5, y + 0.5));
    const dvec2 exact = weightsOn(ray, c, face);
    const double wb = std::clamp(exact.x, 0.0, 1.0), wc = std::clamp(exact.y, 0.0, 1.0 - wb), wa = 1 - wb - wc;
    const double depth = (wa * c[0].at + wb * c[1].at + wc * c[2].at).z;
    if (isHidden(level_.ref(x, y), depth)) return;
    Sample hit;
    dvec3 n;
    const double footprint = footprintOn(ray, view_.isOrthographic, 1 / view_.focalPixels, c, face);
    if (surfaceOn(ray.direction, {wb, wc}, footprint, c, face, surface, m, textures, hit, n))
        store(x, y, depth, ray, hit, n, of);
}

void TriangleProjector::place(int x, int y, double depth, const Corners& c, const shared::SurfaceMaterial& m,
                              const TextureReader& textures, const Whole& of) {
    if (isHidden(level_.ref(x, y), depth)) return;
    const ViewRay ray = viewRay(view_, dvec2(x + 0.5, y + 0.5));
    const dvec3 face = glm::cross(c[1].at - c[0].at, c[2].at - c[0].at);
    const double footprint = footprintOn(ray, view_.isOrthographic, 1 / view_.focalPixels, c, face);
    Sample hit;
    dvec3 n;
    if (surfaceOn(ray.direction, weightsOn(ray, c, face), footprint, c, face, shared::kSurfaceTwoSided, m, textures,
                  hit, n))
        store(x, y, depth, ray, hit, n, of);
}

void TriangleProjector::store(int x, int y, double depth, const ViewRay& ray, Sample s, const dvec3& n,
                              const Whole& of) {
    s.valid = true;
    s.isLitAsPoint = of.isLitAsPoint;
    s.depth = depth;
    s.radius = 0.25;
    s.thickness = 0.25 / pixelsAt(view_, depth);
    s.centre = dvec2(x + 0.5, y + 0.5);
    s.perp = dvec2(rotationToZ(ray.sight()) * n);
    const shared::FrameConstants& f = draws_.frame;
    const double t = f.debugView == shared::kDebugLevel
                         ? (of.level % 8) / 7.0
                         : std::clamp((std::log2(std::max(1e-6, of.errorPixels)) + 3) / 6, 0.0, 1.0);
    const auto hat = [&](double middle) { return std::clamp(1.5 - std::abs(4 * t - middle), 0.0, 1.0); };
    if (f.debugView == shared::kDebugLevel || f.debugView == shared::kDebugError) s.colour = {hat(3), hat(2), hat(1)};
    level_.ref(x, y) = s;
}

}  // namespace stipple::reference
