// The nearest of many points that lie in Morton order: a tree of boxes over runs of eight, eight children a node, in
// fp32 about a middle (what is nearest is so up to that rounding), eight lanes at once. Many places that lie near each
// other look among the same runs, which are found once for all of them.
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

    /// Runs of which some points may lie within sqrt(limit) of a place in a box, ascending; of more than kMostRuns of
    /// them, none are kept.
    struct Runs {
        static constexpr size_t kMostRuns = 128;
        size_t count = 0;
        bool isWhole = false;  ///< those are all
        std::array<uint32_t, kMostRuns> run;
    };
    void runsNear(const glm::dvec3& lo, const glm::dvec3& hi, float limit, Runs& runs) const;
    /// What the other `find` says, of a place in the box of the runs and a limit that is not larger than theirs.
    void find(const Runs& runs, const glm::dvec3& p, size_t most, float limit, Found& found) const;

  private:
    struct alignas(32) Node {      ///< boxes of eight children, empty ones turned inside out
        float lo[3][8], hi[3][8];  // NOLINT: as it lies in memory
    };
    struct alignas(32) Leaf {
        float at[3][8];  // NOLINT
    };
    struct Box32 {
        float lo[3], hi[3];  // NOLINT
    };
    static void search(const NearPoints& tree, const float (&p)[3], size_t most, float limit, Found& found);
    static void searchRuns(const NearPoints& tree, const Box32& box, float limit, Runs& runs);
    static void searchAmong(const NearPoints& tree, const Runs& runs, const float (&p)[3], size_t most, float limit,
                            Found& found);

    size_t count_ = 0;
    std::vector<Leaf> leaves_;
    std::vector<std::vector<Node>> levels_;  ///< over leaves first
};

}  // namespace stipple::lod
