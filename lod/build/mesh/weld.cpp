// Triangles as they come, to a welded mesh: one lattice, every vertex once, nothing degenerate, twice or not finite.
#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "engine/base/numbers.h"
#include "lod/build/mesh/mesh_work.h"
#include "lod/build/morton.h"
#include "lod/build/points/spacing.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr int kLatticeBits = 24, kMostBits = 30;  ///< with 31, differences would overflow
constexpr size_t kGrain = 16384;

/// Bit by bit: two zeros of different sign are two values. Equal positions stand side by side.
std::array<uint32_t, 8> wordsOf(const shared::MeshVertex& v) { return std::bit_cast<std::array<uint32_t, 8>>(v); }

uint64_t keyOf(int64_t x, int64_t y, int64_t z, int drop) {
    return shortMortonCode(static_cast<uint64_t>(x >> drop), static_cast<uint64_t>(y >> drop),
                           static_cast<uint64_t>(z >> drop));
}

/// Bits that a key leaves out.
int dropOf(const std::vector<shared::MeshVertex>& vertices) {
    uint32_t any = 0;
    for (const shared::MeshVertex& v : vertices) any |= static_cast<uint32_t>(v.x | v.y | v.z);
    return std::max(static_cast<int>(std::bit_width(any)), kLatticeBits) - static_cast<int>(kShortBits);
}

bool hasArea(const shared::MeshVertex& a, const shared::MeshVertex& b, const shared::MeshVertex& c) {
    const auto at = [](const shared::MeshVertex& v) { return glm::dvec3(v.x, v.y, v.z); };
    return glm::cross(at(b) - at(a), at(c) - at(a)) != glm::dvec3(0);
}

}  // namespace

Lattice latticeOf(const MeshSource::Bounds& bounds) {
    Lattice lattice;
    if (bounds.lo.x > bounds.hi.x) return lattice;
    const glm::dvec3 size = bounds.hi - bounds.lo;
    const auto unitOf = [](double extent, int bits) {
        return std::exp2(std::floor(std::log2(std::max(extent, 1e-30))) + 1 - bits);
    };
    const double extent = std::max({size.x, size.y, size.z});
    lattice.unit = unitOf(extent, kLatticeBits);
    // What most vertices are is told apart as it would be without those far out, as well as 30 bits can.
    constexpr double kFar = 16;
    if (const double dense = denseExtent(bounds.sample); dense > 0 && extent > kFar * dense) {
        lattice.unit = std::max(unitOf(dense, kLatticeBits), unitOf(extent, kMostBits));
        lattice.bits = kMostBits;
    }
    // Whole steps from zero, so that coordinates that lie on the lattice stay exact.
    lattice.origin = glm::floor(bounds.lo / lattice.unit) * lattice.unit;
    const glm::dvec3 last = glm::floor((bounds.hi - lattice.origin) / lattice.unit + 0.5);
    lattice.largest = static_cast<uint32_t>(std::max({last.x, last.y, last.z}));
    return lattice;
}

PlacedBlock placeBlock(const TriangleMesh& in, const Lattice& lattice, Executor& executor) {
    PlacedBlock out;
    auto& vertices = out.soup.vertices;
    vertices.resize(in.position.size());
    std::vector<uint8_t> isBad(vertices.size());
    const auto place = [&](size_t i, double& rounding) {
        shared::MeshVertex& v = vertices[i];
        isBad[i] = isFinite(in.position[i]) ? 0 : 1;
        const glm::dvec3 p = isBad[i] ? lattice.origin : in.position[i];
        const glm::dvec3 q = glm::floor((p - lattice.origin) / lattice.unit + 0.5);
        v.x = toWhole<int>(q.x);
        v.y = toWhole<int>(q.y);
        v.z = toWhole<int>(q.z);
        const glm::dvec3 off = glm::abs(lattice.origin + q * lattice.unit - p);
        rounding = std::max({rounding, off.x, off.y, off.z});
        const glm::vec3 n = in.normal.empty() ? glm::vec3(0) : in.normal[i];
        const bool isFlat = !hasDirection(n);
        v.normal = isFlat ? octEncode({0, 0, 1}) : octEncode(n);
        v.colour = in.colour.empty() ? ~0u : in.colour[i];
        const glm::vec2 uv = in.uv.empty() ? glm::vec2(0) : in.uv[i];
        const bool hasUv = std::isfinite(uv.x + uv.y) && std::abs(uv.x) < 1e6f && std::abs(uv.y) < 1e6f;
        v.u = hasUv ? uv.x : 0.0f;
        v.v = hasUv ? uv.y : 0.0f;
        v.surface = (in.surface.empty() ? 0u : in.surface[i]) | (isFlat ? shared::kSurfaceFlat : 0u);
    };
    const size_t parts = vertices.size() / kGrain + 1;
    std::vector<double> rounding(parts);
    executor.parallelFor(parts, 1, [&](size_t begin, size_t end) {
        for (size_t p = begin; p < end; ++p)
            for (size_t i = p * vertices.size() / parts; i < (p + 1) * vertices.size() / parts; ++i)
                place(i, rounding[p]);
    });
    out.rounding = *std::max_element(rounding.begin(), rounding.end());
    out.soup.indices.reserve(in.indices.size());
    for (size_t i = 0; i + 3 <= in.indices.size(); i += 3) {
        const uint32_t* const t = &in.indices[i];
        if ((isBad[t[0]] | isBad[t[1]] | isBad[t[2]]) != 0) {
            ++out.notFinite;
            continue;
        }
        const auto &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
        if (!hasArea(a, b, c)) {
            ++out.degenerate;
            continue;
        }
        out.soup.indices.insert(out.soup.indices.end(), t, t + 3);
        const auto middle = [](int p, int q, int r) { return static_cast<uint32_t>((int64_t{p} + q + r) / 3); };
        out.x.push_back(middle(a.x, b.x, c.x));
        out.y.push_back(middle(a.y, b.y, c.y));
        out.z.push_back(middle(a.z, b.z, c.z));
    }
    return out;
}

WeldedMesh weld(Soup& soup) {
    struct Item {
        uint64_t key;
        uint32_t vertex;
    };
    const auto& v = soup.vertices;
    std::vector<Item> order(v.size());
    const int drop = dropOf(v);
    for (uint32_t i = 0; i < v.size(); ++i) order[i] = {keyOf(v[i].x, v[i].y, v[i].z, drop), i};
    std::sort(order.begin(), order.end(), [&](const Item& a, const Item& b) {
        return a.key != b.key ? a.key < b.key : wordsOf(v[a.vertex]) < wordsOf(v[b.vertex]);
    });
    WeldedMesh out;
    std::vector<uint32_t> place(v.size());
    uint32_t positions = 0;
    for (size_t i = 0; i < order.size(); ++i) {
        const shared::MeshVertex& vertex = v[order[i].vertex];
        const bool isFirst = out.vertices.empty();
        if (isFirst || wordsOf(out.vertices.back()) != wordsOf(vertex)) {
            const bool isSamePlace = !isFirst && out.vertices.back().x == vertex.x &&
                                     out.vertices.back().y == vertex.y && out.vertices.back().z == vertex.z;
            positions += isFirst || isSamePlace ? 0 : 1;
            out.vertices.push_back(vertex);
            out.position.push_back(positions);
        }
        place[order[i].vertex] = static_cast<uint32_t>(out.vertices.size() - 1);
    }
    for (uint32_t& i : soup.indices) i = place[i];
    soup.vertices = out.vertices;
    return out;
}

uint64_t sortTriangles(WeldedMesh& mesh, std::vector<uint32_t>& indices) {
    struct Item {
        uint64_t key;
        std::array<uint32_t, 3> corners;
        bool operator<(const Item& o) const { return std::tie(key, corners) < std::tie(o.key, o.corners); }
        bool operator==(const Item& o) const { return key == o.key && corners == o.corners; }
    };
    std::vector<Item> order(indices.size() / 3);
    const int drop = dropOf(mesh.vertices);
    for (size_t i = 0; i < order.size(); ++i) {
        auto& t = order[i].corners;
        std::copy_n(indices.begin() + static_cast<ptrdiff_t>(3 * i), 3, t.begin());
        // The smallest index first: equal triangles are then equal words, and the winding stays.
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        const auto &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
        order[i].key =
            keyOf((int64_t{a.x} + b.x + c.x) / 3, (int64_t{a.y} + b.y + c.y) / 3, (int64_t{a.z} + b.z + c.z) / 3, drop);
    }
    std::sort(order.begin(), order.end());
    const size_t before = order.size();
    order.erase(std::unique(order.begin(), order.end()), order.end());
    // Vertices in the order of their first use: what is used together lies together.
    std::vector<uint32_t> place(mesh.vertices.size(), ~0u);
    WeldedMesh used;
    indices.clear();
    for (const Item& item : order)
        for (const uint32_t vertex : item.corners) {
            if (place[vertex] == ~0u) {
                place[vertex] = static_cast<uint32_t>(used.vertices.size());
                used.vertices.push_back(mesh.vertices[vertex]);
                used.position.push_back(mesh.position[vertex]);
            }
            indices.push_back(place[vertex]);
        }
    mesh = std::move(used);
    return before - order.size();
}

}  // namespace stipple::lod
