#include "lod/builder/points/select.h"

#include <bit>

#include "engine/base/lanes.h"
#include "engine/base/wide.h"

namespace stipple::lod {

/// Guesses a threshold and counts: squared distances on a surface are spread evenly, so the count says where to guess
/// next; every third step bisects. With a few too many below the threshold the largest of them are taken away.
STIPPLE_WIDE float smallestAtRank(const int32_t* values, size_t count, size_t rank, float guess) {
    constexpr float kFew = 3;
    const auto* const v = reinterpret_cast<const Anywhere<Lanes>*>(values);
    const size_t vectors = (count + kLanes - 1) / kLanes;
    const auto wanted = static_cast<float>(rank) + 1;
    float lo = 0, hi = 0, below = 0, above = 0;  // at hi there are `above`, more than `rank`
    const auto countUpTo = [&](float threshold) {
        const int32_t limit = std::bit_cast<int32_t>(threshold);
        Lanes sum{};
        for (size_t i = 0; i < vectors; ++i) sum -= v[i].v <= limit;
        int32_t all = 0;
        for (size_t k = 0; k < kLanes; ++k) all += sum[k];
        return static_cast<float>(all);
    };
    const auto largestBelow = [&](int32_t limit) {
        Lanes most{};
        for (size_t i = 0; i < vectors; ++i) {
            const Lanes within = (v[i].v < limit) & v[i].v;
            most = within > most ? within : most;
        }
        return mostOf(most);
    };
    if (guess > 0) {
        const float there = countUpTo(guess);
        (there >= wanted ? hi : lo) = guess;
        (there >= wanted ? above : below) = there;
    }
    if (!(above >= wanted)) {
        hi = std::bit_cast<float>(largestBelow(kNothing));
        above = static_cast<float>(count);
    }
    for (int step = 0; step < 60 && above > wanted + kFew; ++step) {
        const float share = (wanted + 0.75f - below) / (above - below);
        float middle = lo + (step % 3 == 2 ? 0.5f : share) * (hi - lo);
        if (!(middle > lo && middle < hi)) middle = 0.5f * (lo + hi);
        if (!(middle > lo && middle < hi)) break;
        const float there = countUpTo(middle);
        (there >= wanted ? hi : lo) = middle;
        (there >= wanted ? above : below) = there;
    }
    int32_t result = largestBelow(std::bit_cast<int32_t>(hi) + 1);
    while (above > wanted) {
        // How many are equal to the largest? They go together. And which one is the next?
        Lanes equal{}, most{};
        for (size_t i = 0; i < vectors; ++i) {
            const Lanes value = v[i].v, within = (value < result) & value;
            equal -= value == result;
            most = within > most ? within : most;
        }
        int32_t times = 0;
        for (size_t k = 0; k < kLanes; ++k) times += equal[k];
        if (static_cast<float>(times) > above - wanted) break;
        above -= static_cast<float>(times);
        result = mostOf(most);
    }
    return std::bit_cast<float>(result);
}

STIPPLE_WIDE void squaredDistances(const float* __restrict x, const float* __restrict y, const float* __restrict z,
                                   size_t n, const float (&from)[3], int32_t* __restrict out) {
    for (size_t k = 0; k < n; ++k) {
        const float dx = x[k] - from[0], dy = y[k] - from[1], dz = z[k] - from[2];
        out[k] = std::bit_cast<int32_t>(dx * dx + dy * dy + dz * dz);
    }
    for (size_t k = n; k % kLanes != 0; ++k) out[k] = kNothing;
}

}  // namespace stipple::lod
