// A mesh as patches are made of it: welded, in an order of its own, every triangle with its neighbours.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "engine/base/executor.h"
#include "lod/builder/patches/elements.h"
#include "lod/builder/patches/run_tree.h"
#include "lod/primitives/mesh.h"
#include "lod/primitives/patch.h"
#include "lod/primitives/place_look.h"

namespace stipple::lod {

/// In the place of a vertex's material: it is made of others', whose looks it does not know.
constexpr uint32_t kNoMaterial = shared::kSurfaceMaterialMask;

/// A place on a triangle: its height and what is there.
struct SurfaceLook {
    glm::vec3 normal{0};  ///< unit, on the triangle's front side
    uint32_t colour = 0;  ///< sRGB
    uint8_t material = 0;
    uint32_t light = 0;  ///< PatchMap::light
};

struct MeshSurface {
    static constexpr uint32_t kNobody = ~0u;
    TriangleMesh source;                            ///< attributes
    glm::dvec3 middle{0};                           ///< of the source's box: what all places are relative to
    std::vector<glm::dvec3> position;               ///< each once
    std::vector<std::array<uint32_t, 3>> corners;   ///< into `position`, the least first
    std::vector<std::array<uint32_t, 3>> vertices;  ///< the same corners, into `source`
    std::vector<std::array<uint32_t, 3>> across;    ///< the triangle beyond the edge from a corner to the next; kNobody
                                                    ///< where there is none, or more than one
    SurfaceElements elements;                       ///< triangles
    std::vector<float> radius;                      ///< of triangles: balls about their centres that hold them
    RunTree tree;
    PlaceLooks looks;  ///< of materials; empty: vertices say all
    /// Of triangles of kNoMaterial, where looks lie that went with others: at a place (as `position`), towards a
    /// normal.
    std::function<std::optional<SurfaceLook>(const glm::dvec3& place, const glm::vec3& normal)> looksThere;
    /// Maps of its patches: texels along an edge of a cell (1: there are none); 0: so many that they are about
    /// `texelSide` (scene units; 0: none), but no more than 2^mostDensity. And what they hold beside colours.
    uint32_t mapTexels = 1, mostDensity = PatchMap::kMostDensity;
    double texelSide = 0;
    bool hasMapNormals = false, hasMapMaterials = false;
    bool hasLight = false;                    ///< looks say what sends light; else that is added to colours
    bool hasFineNormals = false;              ///< some of it is a mirror
    bool isTwoSided = false;                  ///< some triangles are, or they do not agree on a side
    uint64_t triangles = 0;                   ///< of the source
    std::map<std::string, uint64_t> dropped;  ///< by reason

    size_t size() const { return corners.size(); }
    glm::dvec3 at(size_t triangle, size_t corner) const { return position[corners[triangle][corner]]; }
    /// `b`, `c`: weights of the second and the third corner; `side`: of the square that it stands for, scene units.
    SurfaceLook look(size_t triangle, double b, double c, double side = 0) const;
    /// The nearest triangle and its distance (scene units); `hint`: one that may be near; any that is no farther than
    /// `enough` will do.
    std::pair<double, size_t> nearest(const glm::dvec3& p, size_t hint, double enough = 0) const;
    /// To one triangle.
    double distance(const glm::dvec3& p, size_t triangle) const;
};

/// Triangles that are not finite, have no area or are there twice are dropped and counted. Where neighbours disagree on
/// their front side, all of a component are turned to that of most of its area.
MeshSurface meshSurface(TriangleMesh mesh, Executor& executor);

}  // namespace stipple::lod
