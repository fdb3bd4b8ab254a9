// Places on surfaces that keep apart from each other (a Poisson-disc sampling, as Cook 1986 and Bridson 2007 have it,
// by darts that are thrown in the order in which they come).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::scene {

/// A place of a surface. Of two pieces of surface neither keeps apart from the other, nor do the sides of a thin wall.
struct SurfacePlace {
    glm::dvec3 at;
    glm::vec3 normal;  ///< unit
    uint64_t piece;
};

/// Takes a place only if no other of its piece that faces alike (by less than 90 degrees) is nearer than `apart`.
class EvenPlaces {
  public:
    /// `apart`: world units, above 0; `count`: of places, about.
    EvenPlaces(double apart, uint64_t count);

    bool isFree(const SurfacePlace& place) const;
    void add(const SurfacePlace& place);

  private:
    static constexpr uint32_t kNone = ~0u;
    size_t slotOf(int64_t x, int64_t y, int64_t z) const;

    double perCell_;
    float apart2_;                 ///< cells are twice as wide as places keep apart
    std::vector<uint32_t> first_;  ///< of the places of each slot of cells, the last that was added
    /// What most are told by lies together; `next`: of the same slot.
    struct Place {
        glm::vec3 at;  ///< from origin_
        uint32_t next;
    };
    struct Surface {
        glm::vec3 normal;
        uint64_t piece;
    };
    glm::dvec3 origin_{0};  ///< the first place
    std::vector<Place> places_;
    std::vector<Surface> surfaces_;
};

}  // namespace stipple::scene
