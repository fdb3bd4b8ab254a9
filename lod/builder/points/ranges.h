// What a store says of its points' values: ranges and percentiles, from samples that hang on the order of the points.
#pragma once

#include <map>

#include "lod/builder/octree/bytes.h"
#include "lod/builder/points/outliers.h"
#include "lod/builder/points/points.h"
#include "lod/store/description.h"

namespace stipple::lod {

/// Values of some points, and the least and greatest of all.
struct Sampled {
    bool any = false;
    double least = 0, greatest = 0;
    std::vector<double> values;
    void add(double value, bool isSampled) {
        if (!(value - value == 0)) return;  // not a number
        least = any ? std::min(least, value) : value;
        greatest = any ? std::max(greatest, value) : value;
        any = true;
        if (isSampled) values.push_back(value);
    }
    void add(const Sampled& other);
    /// The value that a share of the samples stay below (0 to 1).
    double below(double share) const;
    void save(ByteWriter& to) const {
        to.put(any);
        to.put(least);
        to.put(greatest);
        to.put(values);
    }
    void load(ByteReader& from) {
        from.get(any);
        from.get(least);
        from.get(greatest);
        from.get(values);
    }
    void sort() { std::sort(values.begin(), values.end()); }
};

class ValueRanges {
  public:
    ValueRanges() = default;
    /// `points`: of the whole cloud; about 65,536 are sampled. `up`: unit length.
    ValueRanges(const Frame& frame, uint64_t points, const glm::dvec3& up);
    /// Points [begin, end), the first of which is number `number` of the whole order.
    void add(const Frame& frame, const Points& points, size_t begin, size_t end, uint64_t number);
    void add(const ValueRanges& other);
    void save(ByteWriter& to) const;
    void load(ByteReader& from);
    /// `within`: what lies outside of it is no part of the focus; lattice units.
    void describe(const Frame& frame, const Bounds& within, StoreDescription& description);

  private:
    uint64_t stride_ = 1;
    glm::dvec3 up_{0, 0, 1};
    Sampled height_;
    std::array<Sampled, 3> axes_;
    std::vector<Sampled> attributes_;
    std::vector<std::map<uint64_t, uint64_t>> counts_;  ///< of 8-bit categories
    std::vector<uint64_t> withoutData_;                 ///< points, of each attribute
};

}  // namespace stipple::lod
