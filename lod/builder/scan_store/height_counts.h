// How high points lie, counted in steps of the extent: percentiles that hang neither on the order of the points nor on
// who counts them.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

/// Heights of places in a box, along an axis; percentiles are at most a 65,536th of the box's height too high or too
/// low.
class HeightCounts {
  public:
    /// The box is `origin` + `unit` * [0, `greatest`]; `up`: unit length, world units.
    HeightCounts(const glm::dvec3& origin, double unit, const std::array<uint64_t, 3>& greatest, const glm::dvec3& up)
        : alongStep_(unit * up), base_(glm::dot(up, origin)) {
        double low = 0, high = 0;
        for (int a = 0; a < 3; ++a) {
            const double reach = alongStep_[a] * static_cast<double>(greatest[static_cast<size_t>(a)]);
            low += std::min(reach, 0.0);
            high += std::max(reach, 0.0);
        }
        low_ = low;
        step_ = (high - low) / kSteps;
    }
    /// From any thread.
    template <typename Place>
    void add(const Place& place) {
        const double height = alongStep_.x * static_cast<double>(place[0]) +
                              alongStep_.y * static_cast<double>(place[1]) +
                              alongStep_.z * static_cast<double>(place[2]);
        const double at = step_ > 0 ? (height - low_) / step_ : 0;
        counts_[static_cast<size_t>(std::clamp(at, 0.0, kSteps - 1.0))].fetch_add(1, std::memory_order_relaxed);
    }
    /// The height, world units, that a share of the points stay below (0 to 1).
    double below(double share) const {
        uint64_t all = 0, sum = 0;
        for (const auto& count : counts_) all += count;
        for (size_t k = 0; k < counts_.size(); ++k)
            if (sum += counts_[k]; static_cast<double>(sum) > share * static_cast<double>(all))
                return base_ + low_ + (static_cast<double>(k) + 0.5) * step_;
        return base_;
    }

  private:
    static constexpr double kSteps = 65536;
    glm::dvec3 alongStep_;
    double base_, low_ = 0, step_ = 0;
    std::vector<std::atomic<uint64_t>> counts_ = std::vector<std::atomic<uint64_t>>(static_cast<size_t>(kSteps));
};

}  // namespace stipple::lod
