// Elevation patches: exact pixels, lit as triangles are; blocks of cells are blocks of draw ids.
#include "engine/render/patch_planes.h"

#include <algorithm>
#include <cmath>

#include "engine/render/kinds/kind.h"

namespace stipple::render {

static_assert(static_cast<uint32_t>(lod::Kind::patches) == shared::kKindPatches);
static_assert(2 * shared::kPatchCellsAcross * shared::kPatchCellsUp == shared::kPatchTriangles &&
              shared::kPatchTriangles == shared::kBlockLanes);
static_assert(sizeof(shared::PatchBlock) == 4 * shared::kPatchBlockWords);

namespace {

/// An instance of a node whose patches are to be placed.
struct PlacedNode {
    const lod::View& view;
    const lod::Instance& instance;
    const lod::Hierarchy& h;
    glm::dvec3 corner;  ///< of the node's cell, lattice steps
    glm::dmat3 axes;    ///< from the store's directions to those of the camera
    glm::dmat3 bent, bentNormals;
    glm::dvec3 shift;  ///< of what is bent, camera space
};

PlacedNode placedNode(const DrawList& draws, const lod::CutDraw& cut, const Bend& bend) {
    const lod::Instance& instance = draws.instances[cut.instance];
    const lod::Hierarchy& h = *draws.hierarchies[instance.hierarchy];
    const lod::Node& node = h.nodes[cut.node];
    const glm::dmat3 camera = glm::transpose(glm::dmat3(draws.view.right, draws.view.down, draws.view.forward));
    PlacedNode p{draws.view, instance, h, {}, camera * instance.rotation, glm::dmat3(1), glm::dmat3(1), glm::dvec3(0)};
    p.corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
    if (bend.isStill()) return p;
    const glm::dvec3 along = camera * bend.along, up = camera * bend.up;
    p.bent += glm::outerProduct(along, bend.slope * up);
    p.bentNormals = glm::transpose(glm::inverse(p.bent));
    p.shift = along * (bend.slope * glm::dot(bend.up, draws.view.eye) + bend.offset);
    return p;
}

shared::DrawMesh placed(const PlacedNode& node, const lod::PatchPlane& plane) {
    const lod::Instance& instance = node.instance;
    const double worldPerStep = instance.scale * node.h.unit, quantum = std::ldexp(1.0, plane.quantumExponent);
    const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
    const glm::dvec3 steps(plane.step, plane.step, quantum);
    const glm::dvec3 eye =
        (glm::transpose(instance.rotation) * (node.view.eye - instance.translation) / instance.scale - node.h.origin) /
        node.h.unit;
    const glm::dvec3 asked = glm::floor(glm::transpose(frame) * (eye - node.corner - plane.origin) / steps);
    // max(low, v) of what is no number is low: cameras may be anywhere.
    const auto within = [](double v, double most) { return std::max(0.0, std::min(v, most)); };
    const glm::dvec3 nearest(within(asked.x, lod::Patch::kMostSide), within(asked.y, lod::Patch::kMostSide),
                             within(asked.z, 65535));
    const glm::dvec3 place = node.corner + plane.origin + frame * (steps * nearest);
    const glm::dvec3 fromEye = instance.translation - node.view.eye +
                               instance.rotation * (instance.scale * (node.h.origin + node.h.unit * place));
    const glm::dmat3 camera = node.axes * glm::transpose(instance.rotation);
    const glm::dmat3 directions = node.bent * node.axes * frame, normals = node.bentNormals * node.axes * frame;
    shared::DrawMesh m{};
    m.axisX = glm::vec3(directions[0] * (worldPerStep * steps.x));
    m.axisY = glm::vec3(directions[1] * (worldPerStep * steps.y));
    m.axisZ = glm::vec3(directions[2] * (worldPerStep * steps.z));
    m.base = glm::vec3(node.bent * (camera * fromEye) + node.shift);
    m.normalX = glm::vec3(normals[0]);
    m.normalY = glm::vec3(normals[1]);
    m.normalZ = glm::vec3(normals[2]);
    m.eyeX = static_cast<int>(nearest.x);
    m.eyeY = static_cast<int>(nearest.y);
    m.eyeZ = static_cast<int>(nearest.z);
    m.places = shared::kPlacesShort;
    m.mirror = 1;
    return m;
}

}  // namespace

void placePatches(const DrawList& draws,
                  const std::function<const std::vector<lod::PatchPlane>&(streaming::ChunkKey)>& planesOf,
                  std::vector<shared::DrawMesh>& meshes, std::vector<uint32_t>& first) {
    const DrawBatch& batch = draws.of(lod::Kind::patches);
    meshes.clear();
    first.clear();
    for (size_t c = 0; c < draws.cut.size() && first.size() < batch.nodes.size(); ++c) {
        const lod::CutDraw& cut = draws.cut[c];
        const lod::Hierarchy& h = *draws.hierarchies[draws.instances[cut.instance].hierarchy];
        if (lod::kindOf(h, cut.chunk) != lod::Kind::patches) continue;
        const PlacedNode node = placedNode(draws, cut, draws.bends.empty() ? Bend{} : draws.bends[c]);
        const std::vector<lod::PatchPlane>& planes = planesOf(batch.keys[first.size()]);
        first.push_back(static_cast<uint32_t>(meshes.size()));
        for (const lod::PatchPlane& plane : planes) meshes.push_back(placed(node, plane));
    }
}

constinit const DrawnKind patchesDrawn{.pass = Pass::patches,
                                       .isReconstructed = false,
                                       .isLit = [](const DrawSettings& s) { return !s.unlitTriangles; },
                                       .add = nullptr,
                                       .recordsPerBlock = 1};

}  // namespace stipple::render
