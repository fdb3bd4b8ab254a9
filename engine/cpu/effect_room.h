// Memory that only effects need: it comes with the first frame that needs it, and goes some frames after the last.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/base/huge_buffer.h"
#include "engine/render/effects/table.h"

namespace stipple::cpu {

/// The surface buffer, where rows are kept between passes: a plane for each word, so that loops over neighbours are
/// loops over numbers that lie side by side.
struct KeptSurface {
    HugeBuffer<float> depth;      ///< linear, world units; 0: nothing
    HugeBuffer<uint32_t> normal;  ///< octahedral, camera space; only of frames some later pass of which reads normals
    HugeBuffer<uint32_t> colour;  ///< packColour
    HugeBuffer<uint32_t> material;
    size_t pixels = 0;
    uint64_t serial = 0;  ///< of what it holds: no two frames, of whatever backend, have the same
    static constexpr uint64_t kBytesOfPixel = 16;
    uint64_t bytes() const { return pixels * kBytesOfPixel; }
    void resize(size_t to) {
        if (to == pixels) return;
        depth.assign(to, 0);
        normal.assign(to, 0);
        colour.assign(to, 0);
        material.assign(to, 0);
        pixels = to;
    }
    void release() { *this = KeptSurface(); }
    /// It is filled anew.
    void renew() {
        static std::atomic<uint64_t> last{0};
        serial = ++last;
    }
};

/// Planes of effects, by the effect's place in the table.
class EffectRoom {
  public:
    static constexpr size_t kPlanes = 8;  ///< of one effect

    void* at(size_t effect, size_t plane, size_t bytes) {
        rooms_.resize(render::effects().size());
        HugeVector<uint64_t>& room = rooms_.at(effect).planes.at(plane);
        const size_t words = (bytes + 7) / 8;
        if (room.size() != words) room = HugeVector<uint64_t>(words);
        return room.data();
    }
    uint64_t bytesOf(size_t effect) const {
        uint64_t bytes = 0;
        if (effect < rooms_.size())
            for (const auto& plane : rooms_[effect].planes) bytes += plane.size() * 8;
        return bytes;
    }
    /// A frame with these effects begins: what others have had for too long is given back.
    void begin(render::EffectSet shown) {
        for (size_t e = 0; e < rooms_.size(); ++e) {
            Room& room = rooms_[e];
            room.idle = shown.has(e) ? 0 : room.idle + 1;
            if (room.idle >= render::kEffectHold) room = Room();
        }
    }

  private:
    struct Room {
        std::array<HugeVector<uint64_t>, kPlanes> planes;
        uint32_t idle = 0;  ///< frames
    };
    std::vector<Room> rooms_;
};

}  // namespace stipple::cpu
