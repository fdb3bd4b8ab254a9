// A small counter-seeded generator: the same numbers on every machine and every standard library (std distributions
// differ between libraries, so none is used).
#pragma once

#include <cmath>
#include <cstdint>

namespace stipple {

/// SplitMix64 (Steele, Lea, Flood 2014).
class Rng {
  public:
    explicit Rng(uint64_t seed) : state_(seed) {}
    uint64_t next() {
        uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
        return z ^ (z >> 31);
    }
    double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }  ///< in [0, 1)
    double uniform(double lo, double hi) { return lo + (hi - lo) * uniform(); }
    uint64_t below(uint64_t n) { return n == 0 ? 0 : next() % n; }
    /// Standard normal (Box-Muller, one of the pair).
    double normal() {
        const double u = 1.0 - uniform();
        return std::sqrt(-2.0 * std::log(u)) * std::cos(6.283185307179586 * uniform());
    }

  private:
    uint64_t state_;
};

}  // namespace stipple
