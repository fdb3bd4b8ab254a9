// The nearest of many points that lie in Morton order: a tree of boxes over runs of eight, eight children a node, in
// fp32 about a middle (what is nearest is so up to that rounding), eight lanes at once.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

class NearPoints {
  public:
    static constexpr size_t kMost = 24;
    struct Found {
        size_t count = 0;
        std::array<float, kMost> squared;   ///< ascending
        std::array<uint32_t, kMost> index;  ///< of equally far ones the least first
    };
    NearPoints() = default;
    explicit NearPoints(const std::vector<glm::dvec3>& points);
    /// The `most` nearest points to `p` that are not farther than sqrt(limit).
    void find(const glm::dvec3& p, size_t most, float limit, Found& found) const;

  private:
    struct alignas(32) Node {      ///< boxes of eight children, empty ones turned inside out
        float lo[3][8], hi[3][8];  // NOLINT: as it lies in memory
    };
    struct alignas(32) Leaf {
        float at[3][8];  // NOLINT
    };
    static void search(const NearPoints& tree, const float (&p)[3], size_t most, float limit, Found& found);

    size_t count_ = 0;
    std::vector<Leaf> leaves_;
    std::vector<std::vector<Node>> levels_;  ///< over leaves first
};

}  // namespace stipple::lod
