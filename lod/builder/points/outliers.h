// Points that are none: invalid returns at the origin, and few points far outside of all others (birds, dust, values
// that stand for "nothing").
//
//   dense box    along each axis what lies between the 2nd and the 98th percentile of the places of a sample. Places,
//                not points: a million returns at one place count once. Whether a place is in the sample hangs on its
//                coordinates only, so that neither the order of the input nor threads nor memory show.
//   far          outside of the dense box, along some axis by more than four times its extent there and half its
//                largest extent. Ordinary scans have no such points, and cost nothing but a comparison of bounds.
//   at origin    far, and exactly at (0, 0, 0).
//   isolated     far, with fewer than 16 places in its cube (a 16th of the dense box's largest extent wide) and the 26
//                around it. A distant tower is far, but not isolated.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "lod/builder/octree/bytes.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// Squares and sums of coordinates up to here are numbers, too.
inline constexpr double kFarthestPlace = 1e150;
inline bool isPlace(const glm::dvec3& p) {
    return std::abs(p.x) <= kFarthestPlace && std::abs(p.y) <= kFarthestPlace && std::abs(p.z) <= kFarthestPlace;
}

struct Bounds {
    glm::dvec3 least{1e300}, greatest{-1e300};
    bool isEmpty() const { return !(least.x <= greatest.x); }
    void add(const glm::dvec3& p) {
        least = glm::min(least, p);
        greatest = glm::max(greatest, p);
    }
    void add(const Bounds& b) {
        least = glm::min(least, b.least);
        greatest = glm::max(greatest, b.greatest);
    }
};

/// The places of a part of the input that are in the sample; each once.
class PlaceSample {
  public:
    /// About `kPlaces` of `points`.
    explicit PlaceSample(uint64_t points = 0);
    static double shareOf(uint64_t points) {
        return std::min(1.0, kPlaces / static_cast<double>(std::max<uint64_t>(points, 1)));
    }
    template <typename V>
    void add(const V& p) {  // glm::ivec3 or glm::dvec3, as the file has them
        if (isTaken(p)) keep(glm::dvec3(p));
    }
    std::vector<glm::dvec3> take();

  private:
    static constexpr double kPlaces = 16384;
    static uint64_t mixed(uint64_t x, uint64_t y, uint64_t z) {
        uint64_t h = x * 0x9e3779b97f4a7c15ull + y * 0xc2b2ae3d27d4eb4full + z * 0x165667b19e3779f9ull;
        h ^= h >> 29;
        h *= 0xbf58476d1ce4e5b9ull;
        return h >> 32;
    }
    bool isTaken(const glm::ivec3& p) const {
        return mixed(static_cast<uint32_t>(p.x), static_cast<uint32_t>(p.y), static_cast<uint32_t>(p.z)) < share_;
    }
    bool isTaken(const glm::dvec3& p) const;
    void keep(const glm::dvec3& p);
    uint64_t share_ = 0;  ///< of 2^32
    size_t unique_ = 0;
    std::vector<glm::dvec3> places_;
};

/// The far points of some of the input, in cubes. (Of more than kMostCubes there are fewer, larger ones.)
class FarCubes {
  public:
    FarCubes() = default;
    FarCubes(const glm::dvec3& corner, double size) : corner_(corner), size_(size) {}
    void add(const glm::dvec3& p);
    void addAtOrigin() { ++atOrigin_; }
    void add(const FarCubes& other);
    void save(ByteWriter& to) const;
    void load(ByteReader& from);

    /// When all are there:
    void findIsolated();
    bool isIsolated(const glm::dvec3& p) const;
    uint64_t atOrigin() const { return atOrigin_; }
    uint64_t isolated() const { return isolated_; }
    Bounds boundsOfRest() const;  ///< of what is not isolated
    Bounds boundsOfIsolated() const;

  private:
    static constexpr size_t kMostCubes = 8192, kManyPlaces = 16;
    using Key = std::array<double, 3>;
    struct Cube {
        uint64_t points = 0;
        Bounds bounds;
        std::vector<glm::dvec3> places;  ///< different ones, kManyPlaces at most
        bool isIsolated = false;
        void addPlace(const glm::dvec3& p);
    };
    Key keyOf(const glm::dvec3& p) const;
    void merge(const Key& key, const Cube& cube);
    void coarsen();
    size_t placesAround(const Key& key) const;

    glm::dvec3 corner_{0};
    double size_ = 1;
    uint64_t atOrigin_ = 0, isolated_ = 0;
    std::map<Key, Cube> cubes_;
};

/// In the coordinates that all inputs share.
class Outliers {
  public:
    Outliers() = default;
    /// `places`: of the samples of all parts. `origin`: of the world, `tolerance`: so near it is exactly there.
    Outliers(std::vector<glm::dvec3> places, const glm::dvec3& origin, double tolerance);
    /// May some of it be far?
    bool reaches(const Bounds& bounds) const;
    bool isFar(const glm::dvec3& p) const {
        return isKnown_ && (p.x < far_.least.x || p.y < far_.least.y || p.z < far_.least.z || p.x > far_.greatest.x ||
                            p.y > far_.greatest.y || p.z > far_.greatest.z);
    }
    /// For each who gathers far points, with `gather`.
    FarCubes empty() const { return {dense_.least, cubeSize_}; }
    void gather(const glm::dvec3& p, FarCubes& cubes) const;
    void conclude(FarCubes all);
    bool isOutlier(const glm::dvec3& p) const;

    bool any() const { return count() > 0; }
    uint64_t count() const { return cubes_.atOrigin() + cubes_.isolated(); }
    const FarCubes& cubes() const { return cubes_; }
    /// What lies outside is far.
    const Bounds& farBox() const { return far_; }
    /// Of the farthest one from the dense box, along one axis.
    double farthest() const;
    void save(ByteWriter& to) const;
    void load(ByteReader& from);

  private:
    bool isAtOrigin(const glm::dvec3& p) const;
    bool isKnown_ = false;
    Bounds dense_, far_;
    double cubeSize_ = 1, tolerance_ = 0;
    glm::dvec3 origin_{0};
    FarCubes cubes_;
};

}  // namespace stipple::lod
