// Looks of surfaces whose triangles have gone into simpler ones: what patches of leaves show between their vertices
// (textures, normal maps, materials) as means over cells of a level's step, for the samples of the levels above.
//
//     leaves' samples --> cells of their level's step --halved--> cells of the next level's --> ...
//
// Cells also know which of six ways their surface faces, so that what lies back to back keeps its own. What sends
// light, or is not lit, has a second cell at once behind its own, which holds that.
#pragma once

#include <optional>
#include <vector>

#include "lod/builder/octree/bytes.h"
#include "lod/builder/patches/mesh_surface.h"

namespace stipple::lod {

/// Cells of one step, each once, in an order that hangs on places alone.
class LevelLooks {
  public:
    /// What is seen of a surface at a place (lattice units). `weight`: area, in any unit.
    struct Seen {
        glm::dvec3 place{0};
        SurfaceLook look;
        double weight = 1;
    };
    /// To what is there already.
    void add(const std::vector<Seen>& seen, double step);
    void add(const LevelLooks& other);
    /// The same in cells twice as large.
    LevelLooks halved() const;
    /// Those whose middles lie in [lo, hi).
    LevelLooks within(const glm::dvec3& lo, const glm::dvec3& hi, double step) const;
    /// The mean of the cells around a place of a surface that faces `normal`, in its place; none: there are no such.
    std::optional<SurfaceLook> at(const glm::dvec3& place, const glm::vec3& normal, double step) const;
    bool isEmpty() const { return cells_.empty(); }

    void put(ByteWriter& to) const { to.put(cells_); }
    /// Added to what is there.
    void get(ByteReader& from);

  private:
    struct Cell {
        int64_t x = 0, y = 0, z = 0;
        uint32_t facing = 0;              ///< twice the axis, and 6 where it looks back along it; 1 more: of light
        uint32_t material = 0;            ///< of most of it
        double weight = 0, most = 0;      ///< of all, and of that material; of light: of what is not lit
        glm::dvec3 colour{0}, normal{0};  ///< linear; both times their weight; of light: the emission
        bool isOfLight() const { return facing % 2 != 0; }
    };
    static_assert(std::is_trivially_copyable_v<Cell>);
    static bool isBefore(const Cell& a, const Cell& b);
    void settle();

    std::vector<Cell> cells_;
};

/// What the texels of a patch's map show, or its samples where it has none; `origin`: what its places are relative to.
void addSeen(const Patch& patch, const glm::dvec3& origin, std::vector<LevelLooks::Seen>& seen);

}  // namespace stipple::lod
