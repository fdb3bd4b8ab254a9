// Cuts through stores of patches, and whether they are closed.
#pragma once

#include "engine/base/rng.h"
#include "lod/store/store.h"
#include "tests/support/patch_shapes.h"

namespace stipple::test {

/// A torus with waves, so that no level is exact.
lod::TriangleMesh wavyTorus(uint32_t around, uint32_t across);
/// Along the middle of the torus' tube.
std::vector<glm::dvec3> insideTorus();

/// Of the patches of a node, of every node; world units.
std::vector<Triangle> trianglesOf(const lod::Store& store, uint32_t node);
std::vector<std::vector<Triangle>> trianglesOfAll(const lod::Store& store);
inline void append(const std::vector<Triangle>& from, std::vector<Triangle>& to) {
    to.insert(to.end(), from.begin(), from.end());
}

/// Of rays from inside, how many meet nothing.
size_t escaping(const std::vector<Triangle>& all, const std::vector<glm::dvec3>& inside, size_t rays, Rng& rng);

/// Nodes of a cut: refined where `isRefined` says so.
template <typename IsRefined>
std::vector<uint32_t> cutOf(const lod::Hierarchy& h, const IsRefined& isRefined) {
    std::vector<uint32_t> cut, stack{0};
    while (!stack.empty()) {
        const uint32_t n = stack.back();
        stack.pop_back();
        const lod::Node& node = h.nodes[n];
        if (node.isLeaf() || !isRefined(n)) {
            cut.push_back(n);
            continue;
        }
        for (int c = 0; c < __builtin_popcount(node.childMask); ++c)
            stack.push_back(node.firstChild + static_cast<uint32_t>(c));
    }
    return cut;
}

}  // namespace stipple::test
