// What a block of the estimates sees, by window cell.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <utility>
#include <vector>

#include "lod/builder/points/surface_fit.h"

namespace stipple::lod {

/// Places around a block, first in the order they came, then by window cell. Cells are numbered x first, `across` to an
/// edge, with a layer around the block's own.
class Seen {
  public:
    struct Place {
        uint32_t cell;
        glm::vec3 at;  ///< in window cells from the block's centre
    };
    void clear() { places_.clear(); }
    void add(uint32_t cell, const glm::vec3& at) { places_.push_back({cell, at}); }
    size_t size() const { return places_.size(); }
    const Place& operator[](size_t i) const { return places_[i]; }

    /// Sorts what was added by its cell, of `cells`.
    void index(size_t cells) {
        first_.assign(cells + 1, 0);
        for (const Place& p : places_) ++first_[p.cell + 1];
        for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        next_.assign(first_.begin(), first_.end());
        for (auto* axis : {&x_, &y_, &z_}) axis->resize(places_.size());
        for (const Place& p : places_) {
            const uint32_t to = next_[p.cell]++;
            x_[to] = p.at.x;
            y_[to] = p.at.y;
            z_[to] = p.at.z;
        }
    }

    /// The places of a cell and its neighbours; of more than `most` in three cells only some.
    void gather(size_t cell, uint32_t across, uint32_t most, Neighbourhood& to) const {
        std::array<std::pair<uint32_t, uint32_t>, 9> runs;
        size_t all = 0;
        for (size_t row = 0; row < 9; ++row) {  // three cells in x lie side by side
            const size_t first = cell + (row / 3 * across + row % 3) * across - (across + 1) * across - 1;
            runs.at(row) = {first_[first], first_[first + 3]};
            all += runs.at(row).second - runs.at(row).first;
        }
        to.resize(all);
        float *x = to.x.data(), *y = to.y.data(), *z = to.z.data();
        for (const auto& [begin, end] : runs) {
            const uint32_t stride = (end - begin) / most + 1;  // many lie at one place
            for (uint32_t k = begin; k < end; k += stride) {
                *x++ = x_[k];
                *y++ = y_[k];
                *z++ = z_[k];
            }
        }
        to.count = static_cast<size_t>(x - to.x.data());
    }

  private:
    std::vector<Place> places_;
    std::vector<float> x_, y_, z_;  ///< by cell
    std::vector<uint32_t> first_, next_;
};

}  // namespace stipple::lod
