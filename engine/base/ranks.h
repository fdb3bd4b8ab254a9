// Several processes that do one job together.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/result.h"

namespace stipple {

/// All processes call the same functions in the same order, each from its main thread.
class Ranks {
  public:
    virtual ~Ranks() = default;
    virtual int rank() const = 0;  ///< 0 to count - 1
    virtual int count() const = 0;
    /// What every rank gives, in order of the ranks; waits for all.
    virtual std::vector<std::vector<uint8_t>> gather(const std::vector<uint8_t>& mine) = 0;
    /// Sums element by element over all ranks; as many elements on each.
    virtual void addUp(std::vector<uint32_t>& values) = 0;
};

/// Is number `i` of something this rank's to do? Without ranks everything is.
inline bool isOwnOf(const Ranks* ranks, size_t i) {
    return ranks == nullptr || i % static_cast<size_t>(ranks->count()) == static_cast<size_t>(ranks->rank());
}
/// Waits for all ranks; the first error of any of them is everybody's. Without ranks: `mine`.
Result<void> agree(Ranks* ranks, const Result<void>& mine);

}  // namespace stipple
