#include "tests/support/patch_cuts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lod/verify/patches.h"

namespace stipple::test {

lod::TriangleMesh wavyTorus(uint32_t around, uint32_t across) {
    lod::TriangleMesh mesh = torusMesh(around, across);
    for (glm::dvec3& p : mesh.position) p *= 1 + 0.01 * std::sin(23 * p.x) * std::sin(19 * p.y) * std::sin(17 * p.z);
    return mesh;
}

std::vector<Triangle> trianglesOf(const lod::Store& store, uint32_t node) {
    const lod::Hierarchy& h = store.hierarchy;
    std::vector<Triangle> out;
    h.forEachPayload(node, [&](uint32_t chunk) {
        if (lod::kindOf(h, chunk) != lod::Kind::patches) return;
        const auto patches = lod::readPatches(store, chunk);
        ASSERT_TRUE(patches);
        const lod::Node& n = h.nodes[node];
        const glm::dvec3 corner = glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) * h.cellSize(n);
        for (const lod::Patch& patch : *patches)
            for (Triangle t : trianglesOf(patch, corner)) {
                for (glm::dvec3& p : t) p = h.origin + h.unit * p;
                out.push_back(t);
            }
    });
    return out;
}
std::vector<std::vector<Triangle>> trianglesOfAll(const lod::Store& store) {
    std::vector<std::vector<Triangle>> out;
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n) out.push_back(trianglesOf(store, n));
    return out;
}
namespace {

bool meets(const Triangle& t, const glm::dvec3& from, const glm::dvec3& way) {
    const glm::dvec3 e = t[1] - t[0], f = t[2] - t[0], p = glm::cross(way, f);
    const double det = glm::dot(e, p);
    if (det == 0) return false;
    const glm::dvec3 s = from - t[0], q = glm::cross(s, e);
    const double u = glm::dot(s, p) / det, v = glm::dot(way, q) / det;
    return u >= 0 && v >= 0 && u + v <= 1 && glm::dot(f, q) / det > 0;
}
}  // namespace

size_t escaping(const std::vector<Triangle>& all, const std::vector<glm::dvec3>& inside, size_t rays, Rng& rng) {
    size_t out = 0;
    for (size_t k = 0; k < rays; ++k) {
        const glm::dvec3 from = inside[rng.below(inside.size())];
        const glm::dvec3 way = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        out += std::none_of(all.begin(), all.end(), [&](const Triangle& t) { return meets(t, from, way); }) ? 1u : 0u;
    }
    return out;
}
std::vector<glm::dvec3> insideTorus() {
    std::vector<glm::dvec3> out;
    for (int k = 0; k < 64; ++k) {
        const double a = 0.0981747704246810 * k;
        out.emplace_back(std::cos(a), std::sin(a), 0);
    }
    return out;
}

}  // namespace stipple::test
