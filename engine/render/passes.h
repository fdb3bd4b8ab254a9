// Passes of a frame: their names, and the planes that they read and write (passes.inl). Which of them a frame has is a
// pure function of its reconstruction (reconstructions/), of what it draws and of its effects (effects/).
#pragma once

#include <cstdint>
#include <initializer_list>

namespace stipple::render {

enum class Pass : uint8_t {
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) name,
#include "engine/render/passes.inl"
#undef STIPPLE_PASS
};

/// What passes hand on to each other, besides the draw list and the chunks, which all may read.
enum class Plane : uint8_t {
    visibility,  ///< the nearest of each pixel: depth and draw id
    discList,    ///< wide discs that reach the picture
    filtered,    ///< of pixels that discs were blended at: what they add up to
    texels,      ///< level 0: the winner of each pixel as a splat; of exact pixels, what the pixel shows
    coarse,      ///< the levels above
    smooth,      ///< level 0 of discs so wide that they would show as facets, and the levels above
    surface,     ///< what is seen at each pixel, whoever filled it
    shadows,     ///< what of each light that casts shadows comes to a pixel
    mirrored,    ///< what light adds of the picture's mirror images in smooth surfaces
    behind,      ///< what is seen of a picture behind everything
    image
};

/// A set of planes.
struct Planes {
    uint32_t bits = 0;
    constexpr Planes() = default;
    constexpr Planes(std::initializer_list<Plane> planes) {
        for (const Plane p : planes) bits |= 1u << static_cast<uint32_t>(p);
    }
    constexpr bool has(Plane p) const { return (bits >> static_cast<uint32_t>(p) & 1u) != 0; }
    constexpr bool holds(Planes other) const { return (other.bits & ~bits) == 0; }
};

struct PassInfo {
    Pass pass;
    const char* name;
    Planes reads, writes;
    bool isOfOwnPixel;  ///< reads nothing but its own pixel of what the pass before wrote: may run in the same tile
};
const PassInfo& passInfo(Pass pass);
const char* passName(Pass pass);

}  // namespace stipple::render
