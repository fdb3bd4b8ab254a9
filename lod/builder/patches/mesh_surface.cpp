#include "lod/builder/patches/mesh_surface.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "engine/base/numbers.h"
#include "lod/builder/morton.h"
#include "lod/primitives/patch_map.h"
#include "lod/primitives/primitives.h"
#include "lod/primitives/triangle.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kCrease = 0.866;  ///< cosine between a triangle and its corners, of noise: 30 degrees
constexpr double kSliver = 0.05;   ///< height over longest edge, below which a triangle's own normal says little

/// Which vertices are at one place; sets `position`, none twice, in order.
std::vector<uint32_t> weldVertices(MeshSurface& s) {
    const std::vector<glm::dvec3>& from = s.source.position;
    glm::dvec3 lo(std::numeric_limits<double>::max()), hi(std::numeric_limits<double>::lowest());
    for (const glm::dvec3& p : from)
        if (isFinite(p)) {
            lo = glm::min(lo, p);
            hi = glm::max(hi, p);
        }
    if (lo.x <= hi.x) s.middle = 0.5 * lo + 0.5 * hi;
    std::vector<uint32_t> order(from.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t i) { return std::tie(from[i].x, from[i].y, from[i].z); };
    std::erase_if(order, [&](uint32_t i) { return !isFinite(from[i]); });
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    std::vector<uint32_t> number(from.size(), MeshSurface::kNobody);
    for (size_t k = 0; k < order.size(); ++k) {
        if (k == 0 || key(order[k - 1]) != key(order[k])) s.position.push_back(from[order[k]] - s.middle);
        number[order[k]] = static_cast<uint32_t>(s.position.size() - 1);
    }
    return number;
}

using Look = std::tuple<uint32_t, float, float, float>;
Look lookOf(const TriangleMesh& m, uint32_t v) {
    const glm::vec3 n = m.normal.empty() ? glm::vec3(0) : m.normal[v];
    return {m.colour.empty() ? ~0u : m.colour[v], n.x, n.y, n.z};
}

/// Triangles that are some, with their least corner first, in Morton order of their middles.
void orderTriangles(MeshSurface& s) {
    const std::vector<uint32_t> number = weldVertices(s);
    struct Row {
        uint64_t code;
        std::array<uint32_t, 3> corners, vertices;
    };
    std::vector<Row> rows;
    double extent = 0;
    for (const glm::dvec3& p : s.position) extent = std::max({extent, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    const double scale = extent > 0 ? 2097151.0 / (2 * extent) : 0;
    s.triangles = s.source.indices.size() / 3;
    for (size_t t = 0; t < s.triangles; ++t) {
        Row row{};
        for (size_t k = 0; k < 3; ++k) {
            row.vertices.at(k) = s.source.indices[3 * t + k];
            row.corners.at(k) = number[row.vertices.at(k)];
        }
        const auto [a, b, c] = row.corners;
        if (std::max({a, b, c}) == MeshSurface::kNobody) {
            ++s.dropped["not finite"];
            continue;
        }
        const glm::dvec3 area = glm::cross(s.position[b] - s.position[a], s.position[c] - s.position[a]);
        if (!hasDirection(area)) {
            ++s.dropped["no area"];
            continue;
        }
        const auto first = std::min_element(row.corners.begin(), row.corners.end()) - row.corners.begin();
        std::rotate(row.corners.begin(), row.corners.begin() + first, row.corners.end());
        std::rotate(row.vertices.begin(), row.vertices.begin() + first, row.vertices.end());
        const glm::dvec3 middle = (s.position[a] + s.position[b] + s.position[c]) / 3.0;
        const auto along = [&](int axis) { return toWhole<uint64_t>((middle[axis] + extent) * scale); };
        row.code = shortMortonCode(along(0), along(1), along(2));
        rows.push_back(row);
    }
    const auto looks = [&](const Row& r) {
        return std::array{lookOf(s.source, r.vertices[0]), lookOf(s.source, r.vertices[1]),
                          lookOf(s.source, r.vertices[2])};
    };
    std::sort(rows.begin(), rows.end(), [&](const Row& a, const Row& b) {
        const auto left = std::tie(a.code, a.corners), right = std::tie(b.code, b.corners);
        return left != right ? left < right : looks(a) < looks(b);
    });
    for (size_t k = 0; k < rows.size(); ++k) {
        if (k > 0 && rows[k].corners == rows[k - 1].corners) {
            ++s.dropped["there already"];
            continue;
        }
        s.corners.push_back(rows[k].corners);
        s.vertices.push_back(rows[k].vertices);
    }
}

struct Edge {
    uint32_t lo, hi, triangle;
    uint8_t side;    ///< from that corner on
    bool isForward;  ///< from lo to hi
};

std::vector<Edge> edgesOf(const MeshSurface& s) {
    std::vector<Edge> edges;
    edges.reserve(3 * s.size());
    for (uint32_t t = 0; t < s.size(); ++t)
        for (uint8_t k = 0; k < 3; ++k) {
            const uint32_t a = s.corners[t][k], b = s.corners[t][(k + 1u) % 3];
            edges.push_back({std::min(a, b), std::max(a, b), t, k, a < b});
        }
    std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
        return std::tie(a.lo, a.hi, a.triangle, a.side) < std::tie(b.lo, b.hi, b.triangle, b.side);
    });
    return edges;
}

/// Calls use(first, last) for the edges between the same two places.
template <typename Use>
void forEachEdge(const std::vector<Edge>& edges, const Use& use) {
    for (size_t k = 0, end = 0; k < edges.size(); k = end) {
        for (end = k + 1; end < edges.size() && edges[end].lo == edges[k].lo && edges[end].hi == edges[k].hi;) ++end;
        use(k, end);
    }
}

double areaOf(const MeshSurface& s, size_t t) {
    return 0.5 * glm::length(glm::cross(s.at(t, 1) - s.at(t, 0), s.at(t, 2) - s.at(t, 0)));
}

void turnOver(MeshSurface& s, size_t t) {
    std::swap(s.corners[t][1], s.corners[t][2]);
    std::swap(s.vertices[t][1], s.vertices[t][2]);
}

/// From triangle to triangle over edges of two: turned where they do not agree; then all where most of the area was.
/// (What cannot agree, as on a band with a half turn, stays apart at some edge: normals there are opposite.)
void agreeOnSides(MeshSurface& s) {
    struct Beside {
        uint32_t triangle;
        bool isAgreed;
    };
    std::vector<std::array<Beside, 3>> beside(s.size());
    for (auto& b : beside) b.fill({MeshSurface::kNobody, true});
    bool isAgreed = true;
    const std::vector<Edge> edges = edgesOf(s);
    forEachEdge(edges, [&](size_t first, size_t last) {
        if (last - first != 2) return;
        const Edge &a = edges[first], &b = edges[first + 1];
        const bool agrees = a.isForward != b.isForward;
        beside[a.triangle][a.side] = {b.triangle, agrees};
        beside[b.triangle][b.side] = {a.triangle, agrees};
        isAgreed = isAgreed && agrees;
    });
    if (isAgreed) return;
    s.isTwoSided = true;
    std::vector<uint8_t> turned(s.size(), 2);  // 2: not yet seen
    std::vector<uint32_t> component;
    for (uint32_t from = 0; from < s.size(); ++from) {
        if (turned[from] != 2) continue;
        component.assign(1, from);
        turned[from] = 0;
        double kept = 0, lost = 0;
        for (size_t k = 0; k < component.size(); ++k) {
            const uint32_t t = component[k];
            (turned[t] != 0 ? lost : kept) += areaOf(s, t);
            for (const Beside& b : beside[t]) {
                if (b.triangle == MeshSurface::kNobody || turned[b.triangle] != 2) continue;
                turned[b.triangle] = turned[t] ^ static_cast<uint8_t>(b.isAgreed ? 0 : 1);
                component.push_back(b.triangle);
            }
        }
        for (const uint32_t t : component)
            if ((turned[t] != 0) == (kept >= lost)) turnOver(s, t);
    }
}

void linkTriangles(MeshSurface& s) {
    s.across.assign(s.size(), {MeshSurface::kNobody, MeshSurface::kNobody, MeshSurface::kNobody});
    const std::vector<Edge> edges = edgesOf(s);
    std::vector<std::pair<uint32_t, uint32_t>> pairs;
    forEachEdge(edges, [&](size_t first, size_t last) {
        for (size_t k = first + 1; k < last; ++k) pairs.emplace_back(edges[k - 1].triangle, edges[k].triangle);
        if (last - first != 2) return;
        s.across[edges[first].triangle][edges[first].side] = edges[first + 1].triangle;
        s.across[edges[first + 1].triangle][edges[first + 1].side] = edges[first].triangle;
    });
    setLinks(std::move(pairs), s.elements);
}

/// The mean of those at the corners (of all triangles there, by area), as the surface's own and not the noise of one
/// triangle; but at creases, which are none, only of slivers: their own hang on the rounding of their corners.
void smoothNormals(MeshSurface& s) {
    std::vector<glm::dvec3> sum(s.position.size(), glm::dvec3(0));
    for (size_t t = 0; t < s.size(); ++t)
        for (const uint32_t v : s.corners[t]) sum[v] += s.elements.area[t] * glm::dvec3(s.elements.normal[t]);
    for (glm::dvec3& n : sum)
        if (hasDirection(n)) n = glm::normalize(withoutScale(n));
    for (size_t t = 0; t < s.size(); ++t) {
        double longest = 0;
        glm::dvec3 mean(0);
        for (size_t k = 0; k < 3; ++k) {
            longest = std::max(longest, glm::distance(s.at(t, k), s.at(t, (k + 1) % 3)));
            mean += sum[s.corners[t][k]];
        }
        const double length = glm::length(mean);
        const bool isSliver = s.elements.area[t] <= 0.5 * kSliver * longest * longest;
        if (!(length > 1e-3)) continue;
        if (isSliver || glm::dot(mean / length, glm::dvec3(s.elements.normal[t])) > kCrease)
            s.elements.normal[t] = glm::vec3(mean / length);
    }
}

}  // namespace

namespace {

using Weights = std::array<double, 3>;

/// sRGB of vertices times a linear factor.
uint32_t litColour(const glm::dvec3& srgb, const glm::vec3& factor) {
    uint32_t out = 0;
    for (int a = 0; a < 3; ++a) {
        const float linear = shared::linearFromSrgb(static_cast<float>(srgb[a] / 255)) * factor[a];
        out |= unitToByte(shared::srgbFromLinear(std::clamp(linear, 0.0f, 1.0f))) << (8 * a);
    }
    return out;
}

/// Of the triangle's texture coordinates: where a place lies in them, and how far they go in a step of `side`.
struct PlaceInTexture {
    glm::vec2 uv{0}, d1{0}, d2{0};
    float side = 0;

    PlaceInTexture(const std::array<glm::vec2, 3>& of, const Weights& w, double area2, double side_)
        : d1(of[1] - of[0]), d2(of[2] - of[0]) {
        uv = glm::vec2(w[0] * glm::dvec2(of[0]) + w[1] * glm::dvec2(of[1]) + w[2] * glm::dvec2(of[2]));
        const double uvArea2 = std::abs(double{d1.x} * d2.y - double{d1.y} * d2.x);
        if (area2 > 0) side = static_cast<float>(std::min(std::sqrt(uvArea2 / area2) * side_, 1e6));
    }
};

}  // namespace

SurfaceLook MeshSurface::look(size_t t, double b, double c, double side) const {
    const Weights weights{1 - b - c, b, c};
    const glm::dvec3 e1 = at(t, 1) - at(t, 0), e2 = at(t, 2) - at(t, 0), across2 = glm::cross(e1, e2);
    const glm::dvec3 face = glm::normalize(across2);
    glm::dvec3 normal(0), colour(0);
    for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = vertices[t][k];
        if (!source.normal.empty() && isFinite(source.normal[v]) &&
            (source.surface.empty() || (source.surface[v] & shared::kSurfaceFlat) == 0)) {
            // Of one side, as the triangles are, if they were turned.
            const glm::dvec3 n(source.normal[v]);
            const double length = glm::length(n);
            if (length > 0) normal += weights.at(k) * n * ((glm::dot(n, face) < 0 ? -1.0 : 1.0) / length);
        }
        const uint32_t rgb = source.colour.empty() ? kPlainColour : source.colour[v];
        for (int a = 0; a < 3; ++a) colour[a] += weights.at(k) * static_cast<double>(rgb >> (8 * a) & 255u);
    }
    SurfaceLook out;
    const double length = glm::length(normal);
    out.normal = glm::vec3(length > 1e-6 ? normal / length : face);
    const bool isUnknown = !source.surface.empty() && (source.surface[vertices[t][0]] & kNoMaterial) == kNoMaterial;
    if (looksThere && isUnknown)
        if (const auto there = looksThere(at(t, 0) + b * e1 + c * e2, out.normal)) return *there;
    if (!looks || isUnknown || source.surface.empty() || source.uv.empty()) {
        for (int a = 0; a < 3; ++a) out.colour |= toWhole<uint32_t>(std::clamp(colour[a] + 0.5, 0.0, 255.0)) << (8 * a);
        return out;
    }
    const auto& v = vertices[t];
    const PlaceInTexture place({source.uv[v[0]], source.uv[v[1]], source.uv[v[2]]}, weights, glm::length(across2),
                               side);
    const PlaceLook look = looks(source.surface[v[0]], place.uv, place.side);
    out.colour = litColour(colour, look.colour);
    out.material = look.material;
    const uint32_t light = packLight(look.emission, look.isUnlit);
    if (hasLight)
        out.light = light;
    else
        out.colour = withEmission(out.colour, light);
    if (look.normal == glm::vec3(0, 0, 1)) return out;
    const glm::vec3 bumped = shared::bumpedNormal(out.normal, glm::vec3(e1), glm::vec3(e2), {place.d1.x, place.d1.y},
                                                  {place.d2.x, place.d2.y}, look.normal);
    if (const float n = glm::length(bumped); n > 1e-6f && glm::dot(bumped, glm::vec3(face)) > 0)
        out.normal = bumped / n;
    return out;
}

double MeshSurface::distance(const glm::dvec3& p, size_t t) const {
    const glm::dvec3 a = at(t, 0), b = at(t, 1), c = at(t, 2);
    const glm::dvec2 w = closestWeights(p, a, b, c);
    return glm::distance(p, a + w.x * (b - a) + w.y * (c - a));
}

std::pair<double, size_t> MeshSurface::nearest(const glm::dvec3& p, size_t hint, double enough) const {
    std::pair<double, size_t> best{distance(p, hint), hint};
    double squared = best.first * best.first;
    if (best.first <= enough) return best;
    tree.visit(p, squared, [&](size_t t) {
        const glm::dvec3 off = p - elements.centre[t];
        const double far = (best.first + double{radius[t]}) * (1 + 1e-12);
        if (glm::dot(off, off) > far * far) return;
        const double d = distance(p, t);
        if (!(d < best.first)) return;
        best = {d, t};
        squared = d <= enough ? -1 : d * d;
    });
    return best;
}

MeshSurface meshSurface(TriangleMesh mesh, Executor& executor) {
    MeshSurface s;
    s.source = std::move(mesh);
    orderTriangles(s);
    for (const uint32_t surface : s.source.surface) s.isTwoSided |= (surface & shared::kSurfaceTwoSided) != 0;
    agreeOnSides(s);
    SurfaceElements& e = s.elements;
    e.centre.resize(s.size());
    e.normal.resize(s.size());
    e.area.resize(s.size());
    s.radius.resize(s.size());
    for (size_t t = 0; t < s.size(); ++t) {
        const glm::dvec3 a = s.at(t, 0), b = s.at(t, 1), c = s.at(t, 2);
        e.centre[t] = (a + b + c) / 3.0;
        const glm::dvec3& m = e.centre[t];
        s.radius[t] =
            static_cast<float>(std::max({glm::distance(a, m), glm::distance(b, m), glm::distance(c, m)}) * (1 + 1e-6));
        const glm::dvec3 n = withoutScale(glm::cross(b - a, c - a));
        e.normal[t] = glm::vec3(glm::normalize(n));
        e.area[t] = areaOf(s, t);
    }
    linkTriangles(s);
    smoothNormals(s);
    s.tree = RunTree(
        s.size(),
        [&](size_t t) {
            RunBox box;
            for (size_t k = 0; k < 3; ++k) box.add(s.at(t, k));
            return box;
        },
        executor);
    return s;
}

}  // namespace stipple::lod
