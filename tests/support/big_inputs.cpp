#include "tests/support/big_inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "tests/support/support.h"

namespace stipple::test {
namespace {

template <typename T>
void put(std::string& to, const T& value) {
    to.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

}  // namespace

void writeGround(const std::string& path, int edge, unsigned seed, bool withNormals) {
    std::string text = fmt::format(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float "
        "z\n{}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        edge * edge, withNormals ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
        2 * (edge - 1) * (edge - 1));
    const auto along = [&](int i) { return 100 * std::pow(i / (edge - 1.0), 3); };
    for (int j = 0; j < edge; ++j)
        for (int i = 0; i < edge; ++i) {
            const double x = along(i), z = along(j);
            put(text, std::array<float, 3>{float(x), float(std::sin(x) * std::cos(0.7 * z) + 0.05 * std::sin(40 * x)),
                                           float(z)});
            if (withNormals) put(text, std::array<float, 3>{float(-std::cos(x)), 1, float(0.3 * std::sin(z))});
        }
    std::vector<std::array<int32_t, 3>> faces;
    for (int j = 0; j + 1 < edge; ++j)
        for (int i = 0; i + 1 < edge; ++i) {
            const int a = j * edge + i;
            faces.push_back({a, a + edge, a + 1});
            faces.push_back({a + 1, a + edge, a + edge + 1});
        }
    if (seed != 0) std::shuffle(faces.begin(), faces.end(), std::mt19937(seed));
    for (const auto& f : faces) {
        text.push_back(3);
        put(text, f);
    }
    spit(path, text);
}

void writeLawn(const std::string& path, uint32_t curves) {
    constexpr uint32_t kSegments = 20;
    std::string text = "HAIR";
    put(text, curves);
    put(text, curves * (kSegments + 1));
    put(text, uint32_t{2});
    put(text, kSegments);
    put(text, std::array<float, 5>{0.004f, 0, 0.3f, 0.5f, 0.2f});
    text.resize(128);
    Rng rng(11);
    for (uint32_t s = 0; s < curves; ++s) {
        const double size = s % 2 == 0 ? 50 : 2, x = size * rng.uniform(), z = size * rng.uniform();
        const double turn = rng.uniform(0, 6.28), length = rng.uniform(0.3, 1);
        for (uint32_t k = 0; k <= kSegments; ++k) {
            const double t = k / double(kSegments);
            put(text, std::array<float, 3>{float(x + length * t * t * std::sin(turn)), float(2 * length * t),
                                           float(z + length * t * t * std::cos(turn) + 0.03 * std::sin(9 * t))});
        }
    }
    spit(path, text);
}

}  // namespace stipple::test
