// Value noise on a lattice, from integer hashes only: the same on every machine.
#pragma once

#include <cmath>
#include <cstdint>

namespace stipple::grow {

class Noise {
  public:
    explicit Noise(uint64_t seed) : seed_(static_cast<uint32_t>(seed) * 0x9e3779b9u + 0x7f4a7c15u) {}

    /// In [0, 1], smooth, features about 1 apart.
    double at(double x, double y, double z) const {
        const double fx = std::floor(x), fy = std::floor(y), fz = std::floor(z);
        const double u = fade(x - fx), v = fade(y - fy), w = fade(z - fz);
        const auto ix = static_cast<int32_t>(fx), iy = static_cast<int32_t>(fy), iz = static_cast<int32_t>(fz);
        double sum = 0;
        for (int k = 0; k < 8; ++k)
            sum += ((k & 1) != 0 ? u : 1 - u) * ((k & 2) != 0 ? v : 1 - v) * ((k & 4) != 0 ? w : 1 - w) *
                   corner(ix + (k & 1), iy + (k >> 1 & 1), iz + (k >> 2));
        return sum;
    }
    /// Octaves of it, each half as large and half as strong; in [0, 1].
    double fbm(double x, double y, double z, int octaves) const {
        double sum = 0, weight = 0.5, total = 0;
        for (int o = 0; o < octaves; ++o) {
            sum += weight * at(x, y, z);
            total += weight;
            weight *= 0.5;
            x = 2 * x + 17.3;
            y = 2 * y + 5.7;
            z = 2 * z + 11.1;
        }
        return sum / total;
    }

  private:
    static double fade(double t) { return t * t * t * (t * (6 * t - 15) + 10); }
    double corner(int32_t x, int32_t y, int32_t z) const {
        uint32_t h = seed_ ^ static_cast<uint32_t>(x) * 0x8da6b343u ^ static_cast<uint32_t>(y) * 0xd8163841u ^
                     static_cast<uint32_t>(z) * 0xcb1ab31fu;
        h ^= h >> 16;
        h *= 0x7feb352du;
        h ^= h >> 15;
        h *= 0x846ca68bu;
        h ^= h >> 16;
        return h * (1.0 / 4294967295.0);
    }
    uint32_t seed_;
};

}  // namespace stipple::grow
