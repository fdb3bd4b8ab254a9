#include "lod/builder/weights/measure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "shaders/shared/surfel_weight.h"

namespace stipple::lod {
namespace {

constexpr float kSupport = 2;
constexpr int kRounds = 3;
constexpr float kAlike = 0.5f;  // cosine between normals of one surface

float reachOf(const Surfel& s) { return s.radius * (kSupport / shared::kOpaqueSigmas); }

/// Surfels by cells of a cubic grid whose cells are so large.
class Cells {
  public:
    Cells(std::span<const Surfel> surfels, float size) : size_(size) {
        keys_.reserve(surfels.size());
        for (uint32_t i = 0; i < surfels.size(); ++i) keys_.emplace_back(keyOf(cellOf(surfels[i].place)), i);
        std::sort(keys_.begin(), keys_.end());
    }
    /// Calls use(i) for all that may lie within `reach` of `place`.
    template <typename Use>
    void forNear(const glm::vec3& place, float reach, const Use& use) const {
        const glm::i64vec3 first = cellOf(place - reach), last = cellOf(place + reach);
        // Cells of a row lie next to each other.
        for (int64_t z = first.z; z <= last.z; ++z)
            for (int64_t y = first.y; y <= last.y; ++y) {
                const uint64_t end = keyOf({last.x, y, z});
                auto at = std::lower_bound(keys_.begin(), keys_.end(), std::pair(keyOf({first.x, y, z}), 0u));
                for (; at != keys_.end() && at->first <= end; ++at) use(at->second);
            }
    }

  private:
    glm::i64vec3 cellOf(const glm::vec3& p) const {
        constexpr float kMost = 1048575;  // cells beyond share the last
        const glm::vec3 cell = glm::clamp(glm::floor(p / size_), -kMost, kMost);
        return {static_cast<int64_t>(cell.x), static_cast<int64_t>(cell.y), static_cast<int64_t>(cell.z)};
    }
    static uint64_t keyOf(const glm::i64vec3& c) {
        const auto bits = [](int64_t v) { return static_cast<uint64_t>(v + 1048576); };
        return bits(c.z) << 42 | bits(c.y) << 21 | bits(c.x);
    }
    std::vector<std::pair<uint64_t, uint32_t>> keys_;
    float size_;
};

/// Grids for all reaches: each surfel looks in that whose cells are about as large as what it reaches.
class Grids {
  public:
    explicit Grids(std::span<const Surfel> surfels) : surfels_(surfels) {}
    const Cells& of(float reach) {
        int octave = 0;
        std::frexp(std::max(reach, 1e-30f), &octave);
        const auto known = grids_.find(octave);
        if (known != grids_.end()) return known->second;
        return grids_.try_emplace(octave, surfels_, std::ldexp(1.0f, octave)).first->second;
    }

  private:
    std::span<const Surfel> surfels_;
    std::map<int, Cells> grids_;
};

/// The kernel of `of` at the centre of `at`; 0 where that is no part of its surface.
float kernelBetween(const Surfel& of, const Surfel& at, float end) {
    const glm::vec3 apart = at.place - of.place;
    const bool hasNormal = of.normal != glm::vec3(0);
    const float height = hasNormal ? glm::dot(apart, of.normal) : 0.0f;
    if (hasNormal && at.normal != glm::vec3(0)) {
        const float alike = glm::dot(of.normal, at.normal);
        if ((of.isTwoSided || at.isTwoSided ? std::abs(alike) : alike) < kAlike) return 0;
    }
    if (std::abs(height) > of.radius * (of.isLeaf ? shared::kLeafShare : shared::kSurfaceShare)) return 0;
    const float sigma = of.radius / shared::kOpaqueSigmas;
    const float rho2 = (glm::dot(apart, apart) - height * height) / (sigma * sigma);
    return rho2 < kSupport * kSupport ? shared::kernelAt(std::max(rho2, 0.0f), end) : 0.0f;
}

/// What kernels of a grid add up to at its centres, where their mean is 1.
float gridCentre() {
    const float end = shared::kernelEnd(kSupport);
    float sum = 0;
    for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x) {
            const auto rho2 = static_cast<float>(x * x + y * y) / 0.469225f;  // sigma: 0.685 of the spacing
            sum += rho2 < kSupport * kSupport ? shared::kernelAt(rho2, end) : 0.0f;
        }
    return sum * shared::gridWeight(kSupport);
}

}  // namespace

std::vector<float> surfelWeights(std::span<const Surfel> surfels) {
    if (surfels.empty()) return {};
    struct Pair {
        uint32_t of;
        float kernel;
    };
    Grids grids(surfels);
    const float end = shared::kernelEnd(kSupport);
    std::vector<std::vector<Pair>> at(surfels.size());
    for (uint32_t of = 0; of < surfels.size(); ++of) {
        const float reach = reachOf(surfels[of]);
        grids.of(reach).forNear(surfels[of].place, reach, [&](uint32_t i) {
            if (const float k = kernelBetween(surfels[of], surfels[i], end); k > 0) at[i].push_back({of, k});
        });
    }
    const float wanted = gridCentre();
    std::vector<float> weights(surfels.size(), 1.0f), sums(surfels.size());
    for (int round = 0; round < kRounds; ++round) {
        for (size_t i = 0; i < surfels.size(); ++i) {
            sums[i] = 0;
            for (const Pair& p : at[i]) sums[i] += weights[p.of] * p.kernel;
        }
        for (size_t i = 0; i < surfels.size(); ++i)
            weights[i] = std::min(weights[i] * wanted / std::max(sums[i], 1e-6f), 1.0f);
    }
    return weights;
}

uint8_t weightCode(float weight) {
    return static_cast<uint8_t>(std::clamp(std::round(255 * std::sqrt(weight > 0 ? weight : 0.0f)), 1.0f, 255.0f));
}

}  // namespace stipple::lod
