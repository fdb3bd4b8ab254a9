// Triangles: runs of clusters of what is resident of a mesh, an instance in camera space for each place that vertices
// are counted from. What lights them is their material's.
#include <array>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/kinds/kind.h"
#include "lod/store/mesh_place.h"

namespace stipple::render {

static_assert(static_cast<uint32_t>(lod::Kind::triangles) == shared::kKindTriangles);

namespace {

/// One instance of a mesh in camera space, composed in fp64. `eyeStep`: the lattice point nearest to the eye.
shared::DrawMesh makeDrawMesh(const lod::Hierarchy& h, const lod::Instance& instance, const lod::View& view,
                              const glm::dmat3& cameraFromWorld, lod::MeshPlace& eyeStep) {
    shared::DrawMesh m{};
    const glm::dmat3 axes = cameraFromWorld * instance.rotation;
    const double worldPerStep = instance.scale * h.unit;
    const glm::dvec3 eye =
        (glm::transpose(instance.rotation) * (view.eye - instance.translation) / instance.scale - h.origin) / h.unit;
    // max(low, v) of what is no number is low: cameras may be anywhere.
    const bool isWide = h.rootLog2 > lod::kShortMeshBits;
    const double low = isWide ? -0x1p61 : 0.0, high = isWide ? 0x1p61 : 0x1p30;
    const auto onLattice = [&](double v) { return std::floor(std::max(low, std::min(v, high))); };
    const glm::dvec3 nearest(onLattice(eye.x), onLattice(eye.y), onLattice(eye.z));
    m.axisX = glm::vec3(axes[0] * worldPerStep);
    m.axisY = glm::vec3(axes[1] * worldPerStep);
    m.axisZ = glm::vec3(axes[2] * worldPerStep);
    m.base = glm::vec3(cameraFromWorld * (instance.translation - view.eye +
                                          instance.rotation * (instance.scale * (h.origin + h.unit * nearest))));
    m.normalX = glm::vec3(axes[0]);
    m.normalY = glm::vec3(axes[1]);
    m.normalZ = glm::vec3(axes[2]);
    eyeStep = {static_cast<int64_t>(nearest.x), static_cast<int64_t>(nearest.y), static_cast<int64_t>(nearest.z)};
    m.mirror = 1;
    return m;
}

/// `m` for the vertices of one group.
shared::DrawMesh countedFrom(const lod::Node& group, const lod::MeshPlace& eyeStep, shared::DrawMesh m) {
    const lod::MeshPlace origin = lod::meshOrigin(group);
    const std::array<int*, 3> low{&m.eyeX, &m.eyeY, &m.eyeZ}, high{&m.eyeHighX, &m.eyeHighY, &m.eyeHighZ};
    bool isShort = true;
    for (size_t a = 0; a < 3; ++a) {
        const int64_t eye = eyeStep.at(a) - origin.at(a);
        *low.at(a) = static_cast<int>(static_cast<uint32_t>(eye));
        *high.at(a) = static_cast<int>(eye >> 32);
        // Vertices reach to 2^30, so that no difference overflows.
        isShort = isShort && eye >= -(int64_t{1} << 29) && eye <= int64_t{1} << 30;
    }
    m.places = lod::hasPairs(group) ? shared::kPlacesPaired : isShort ? shared::kPlacesShort : shared::kPlacesFar;
    return m;
}

void add(const lod::Cut& cut, const glm::dmat3& cameraFromWorld, DrawList& out) {
    uint32_t last = ~0u;
    lod::MeshPlace eyeStep{}, origin{};
    bool isPaired = false;
    shared::DrawMesh mesh{};
    for (const lod::CutMeshDraw& draw : cut.meshDraw) {
        const lod::Instance& instance = out.instances[draw.instance];
        const lod::Hierarchy& h = *out.hierarchies[instance.hierarchy];
        const lod::Node& group = lod::meshNode(h, draw.node);
        const bool isNew = draw.instance != last;
        if (isNew) {
            mesh = makeDrawMesh(h, instance, out.view, cameraFromWorld, eyeStep);
            mesh.firstMaterial = out.firstMaterial[instance.hierarchy];
        }
        if (isNew || lod::meshOrigin(group) != origin || lod::hasPairs(group) != isPaired) {
            origin = lod::meshOrigin(group);
            isPaired = lod::hasPairs(group);
            out.meshes.push_back(countedFrom(group, eyeStep, mesh));
            out.meshTextures.push_back({h.textures, out.firstSource + instance.source,
                                        static_cast<uint32_t>(h.nodes.size()), static_cast<uint32_t>(h.tiles.size())});
            last = draw.instance;
        }
        const auto run = static_cast<uint32_t>(out.meshDraws.size());
        out.meshDraws.push_back({static_cast<uint32_t>(out.meshes.size() - 1), draw.firstCluster, draw.clusters,
                                 h.nodes[draw.node].level, draw.errorPixels});
        DrawBatch& batch = out.of(lod::Kind::triangles);
        batch.keys.push_back({out.firstSource + instance.source, draw.chunk});
        for (uint32_t c = 0; c < draw.clusters; ++c) batch.blocks.push_back({run, draw.firstCluster + c});
    }
}

}  // namespace

constinit const DrawnKind trianglesDrawn{.pass = Pass::rasterise,
                                         .isReconstructed = false,
                                         .isLit = [](const DrawSettings& s) { return !s.unlitTriangles; },
                                         .add = add};

}  // namespace stipple::render
