#include "apps/study/outlines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stipple::study {
namespace {

using glm::dvec3;

/// Sums over some views.
struct Sums {
    size_t both = 0, either = 0, outside = 0, edge = 0, discBoth = 0, discEither = 0, normals = 0, discNormals = 0;
    double angle = 0, discAngle = 0;
};

bool isSeen(const render::Image& image, size_t i) { return image.rgba[i] >> 24 >= 128; }

dvec3 normalAt(const render::Image& image, size_t i) {
    return {image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]};
}

double degreesBetween(const dvec3& a, const dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 57.29577951308232;
}

/// Pixels of a silhouette with a neighbour outside: its length, but for corners.
bool isEdge(const render::Image& image, uint32_t x, uint32_t y) {
    const size_t i = size_t{y} * image.width + x;
    if (!isSeen(image, i) || x == 0 || y == 0 || x + 1 == image.width || y + 1 == image.height) return false;
    return !isSeen(image, i - 1) || !isSeen(image, i + 1) || !isSeen(image, i - image.width) ||
           !isSeen(image, i + image.width);
}

void add(const render::Image& image, const render::Image& surface, const render::Image& discs, Sums& s) {
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            const size_t i = size_t{y} * image.width + x;
            const bool own = isSeen(image, i), truth = isSeen(surface, i), disc = isSeen(discs, i);
            s.both += own && truth;
            s.either += own || truth;
            s.outside += own && !truth;
            s.discBoth += own && disc;
            s.discEither += own || disc;
            s.edge += isEdge(surface, x, y);
            if (own && image.depth[i] > 0 && surface.depth[i] > 0) {
                s.angle += degreesBetween(normalAt(image, i), normalAt(surface, i));
                ++s.normals;
            }
            if (own && image.depth[i] > 0 && discs.depth[i] > 0) {
                s.discAngle += degreesBetween(normalAt(image, i), normalAt(discs, i));
                ++s.discNormals;
            }
        }
}

double over(double a, size_t b) { return a / static_cast<double>(std::max<size_t>(b, 1)); }

OutlineRow rowOf(const std::string& what, double spacing, uint64_t points, const Sums& s) {
    return {spacing,
            points,
            what,
            over(static_cast<double>(s.both), s.either),
            over(static_cast<double>(s.either - s.both), s.edge),
            over(static_cast<double>(s.outside), s.edge),
            over(s.angle, s.normals),
            over(static_cast<double>(s.discBoth), s.discEither),
            over(s.discAngle, s.discNormals)};
}

lod::View around(const lod::Store& store, double azimuth, uint32_t size) {
    const lod::StoreDescription& d = store.description;
    const double a = azimuth * 0.017453292519943295;
    const dvec3 u = d.up, first(u.y, u.z, u.x), second = glm::cross(u, first);
    const dvec3 middle = 0.5 * (d.boundsMin + d.boundsMax);
    const dvec3 away = std::cos(a) * first + std::sin(a) * second + 0.2 * u;
    return viewFrom(middle + 1.3 * glm::length(d.boundsMax - d.boundsMin) * away, middle, u, size, size);
}

}  // namespace

Result<std::vector<OutlineRow>> measureOutlines(const Surface& statue, const OutlineSettings& settings,
                                                const MakeBackend& backend, Executor& executor) {
    STIPPLE_ASSIGN(const StorePtr mesh, triangleStore(statue, settings.folder + "/outline_mesh.stipple", executor));
    std::vector<OutlineRow> rows;
    for (const double spacing : settings.spacings) {
        const lod::View first = around(*mesh, 0, settings.size);
        const double pixel =
            glm::length(first.eye - 0.5 * (mesh->description.boundsMin + mesh->description.boundsMax)) /
            first.focalPixels;
        const auto count = static_cast<uint64_t>(statue.area / (spacing * pixel * spacing * pixel));
        STIPPLE_ASSIGN(
            const StorePtr store,
            surfelStore(statue, count, fmt::format("{}/outline_{}.stipple", settings.folder, count), executor));
        STIPPLE_ASSIGN(auto made, backend());
        Drawer drawer(store, std::move(made), executor);
        std::vector<Sums> sums(render::reconstructions().size() + 1);
        for (const double azimuth : settings.azimuths) {
            const lod::View view = around(*mesh, azimuth, settings.size);
            STIPPLE_ASSIGN(const render::Image surface, traceStore(mesh, view, true, 1, executor));
            STIPPLE_ASSIGN(const render::Image discs, traceStore(store, view, true, 1, executor));
            for (size_t m = 0; m + 1 < sums.size(); ++m) {
                const render::Mode mode = render::reconstructions()[m].mode;
                STIPPLE_ASSIGN(const render::Image image, drawer.draw(view, settingsOf(mode, kLeaves, true)));
                add(image, surface, discs, sums[m]);
            }
            add(discs, surface, discs, sums.back());
        }
        for (size_t m = 0; m < sums.size(); ++m)
            rows.push_back(rowOf(m + 1 < sums.size() ? render::reconstructions()[m].name : "traced discs", spacing,
                                 store->description.points, sums[m]));
    }
    return rows;
}

}  // namespace stipple::study
