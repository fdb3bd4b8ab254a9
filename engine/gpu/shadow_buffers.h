// Shadow maps on the device: of each a buffer of its own, which shaders read by its address, copied there once.
#pragma once

#include <map>
#include <memory>

#include "engine/gpu/device.h"
#include "engine/render/draw_list.h"
#include "engine/render/shadow_frame.h"
#include "shaders/shared/shadow_table.h"

namespace stipple::gpu {

/// Of one frame in flight.
class ShadowBuffers {
  public:
    /// The table of a frame; copies maps that are not there yet, and lets go of those that the frame does not have.
    /// Not while the device uses them.
    Result<shared::ShadowTable> prepare(const Device& device, const render::DrawList& draws);
    void clear() { maps_.clear(); }
    uint64_t bytes() const;

  private:
    struct Map {
        std::shared_ptr<const render::ShadowTexels> of;
        Buffer depths, through;
    };
    static Result<Map> copy(const Device& device, const std::shared_ptr<const render::ShadowTexels>& texels);
    std::map<const render::ShadowTexels*, Map> maps_;
};

}  // namespace stipple::gpu
