#include "lod/primitives/kinds.h"

#include <array>

#include "lod/cut/frame.h"

namespace stipple::lod {
namespace {

// ---- how nodes hang together

std::span<const uint32_t> parentOf(const Hierarchy& h, uint32_t node) {
    return {&h.nodes[node].parent, node == 0 ? 0u : 1u};
}
std::span<const uint32_t> parentsOfGroup(const Hierarchy& h, uint32_t node) {
    const MeshGroup& g = h.groups[node];
    return std::span(h.parents).subspan(g.firstParent, g.parents);
}

constexpr ShapeTraits kTree{"octree", parentOf, costOfTree, emitTree},
    kStochastic{"stochastic", parentOf, costOfStochastic, emitStochastic},
    kGraph{"graph", parentsOfGroup, costOfGraph, emitGraph};

}  // namespace

const KindTraits& traitsOf(Kind kind) {
    static constexpr std::array kTraits{
#define STIPPLE_KIND(name) &name##Kind,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
    };
    return *kTraits.at(static_cast<size_t>(kind));
}

const ShapeTraits& shapeOf(const Hierarchy& h) { return h.isGraph ? kGraph : h.isStochastic ? kStochastic : kTree; }

uint64_t decodedBytes(const Hierarchy& h, uint32_t chunk) {
    if (h.isTile(chunk)) return uint64_t{shared::kTileEdge} * shared::kTileEdge * sizeof(uint32_t);
    return traitsOf(kindOf(h, chunk)).decodedBytes(h, chunk);
}

}  // namespace stipple::lod
