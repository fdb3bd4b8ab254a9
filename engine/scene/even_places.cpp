#include "engine/scene/even_places.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stipple::scene {

EvenPlaces::EvenPlaces(double apart, uint64_t count)
    : perCell_(0.5 / apart),
      apart2_(static_cast<float>(apart * apart)),
      first_(std::bit_ceil(std::clamp<uint64_t>(count / 2, 64, uint64_t{1} << 28)), kNone) {}

size_t EvenPlaces::slotOf(int64_t x, int64_t y, int64_t z) const {
    uint64_t h = static_cast<uint64_t>(x) * 0x9e3779b97f4a7c15u + static_cast<uint64_t>(y) * 0xc2b2ae3d27d4eb4fu +
                 static_cast<uint64_t>(z) * 0x165667b19e3779f9u;
    h ^= h >> 32;
    h *= 0xd6e8feb86659fd93u;
    h ^= h >> 32;
    return static_cast<size_t>(h) & (first_.size() - 1);
}

bool EvenPlaces::isFree(const SurfacePlace& place) const {
    // What is nearer than half a cell lies in this one (seen first: most that are too near do), or in those beside the
    // nearer of its sides.
    const glm::dvec3 cell = place.at * perCell_, corner = glm::floor(cell - 0.5), within = glm::floor(cell) - corner;
    const int64_t x = static_cast<int64_t>(corner.x), y = static_cast<int64_t>(corner.y),
                  z = static_cast<int64_t>(corner.z),
                  own = static_cast<int64_t>(within.x + 2 * within.y + 4 * within.z);
    const glm::vec3 at(place.at - origin_);
    for (int64_t k = 0; k < 8; ++k) {
        const int64_t side = k ^ own;
        const size_t slot = slotOf(x + (side & 1), y + (side >> 1 & 1), z + (side >> 2));
        for (uint32_t i = first_[slot]; i != kNone; i = places_[i].next) {
            const glm::vec3 off = places_[i].at - at;
            if (glm::dot(off, off) < apart2_ && surfaces_[i].piece == place.piece &&
                glm::dot(surfaces_[i].normal, place.normal) > 0)
                return false;
        }
    }
    return true;
}

void EvenPlaces::add(const SurfacePlace& place) {
    const glm::dvec3 cell = glm::floor(place.at * perCell_);
    const size_t slot =
        slotOf(static_cast<int64_t>(cell.x), static_cast<int64_t>(cell.y), static_cast<int64_t>(cell.z));
    if (places_.empty()) origin_ = place.at;
    places_.push_back({glm::vec3(place.at - origin_), first_[slot]});
    surfaces_.push_back({place.normal, place.piece});
    first_[slot] = static_cast<uint32_t>(places_.size() - 1);
}

}  // namespace stipple::scene
