// How light becomes the numbers of a picture of 8 bits, and how the picture says so.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/render/backend.h"

namespace stipple::image {

/// Primaries are those of BT.709 in both, full range; `rec709` is for those who cut films of it.
enum class Transfer : uint8_t { srgb, rec709 };

/// The value 0 to 1 that BT.709 gives light 0 to 1 (ITU-R BT.709-6, item 1.2): 4.5 L below 0.018, else
/// 1.099 L^0.45 - 0.099.
double rec709FromLinear(double light);

/// For each byte of sRGB that of BT.709. Within 1.07 of what the light itself would be: half a step of sRGB, which is
/// at most 1.125 of BT.709's (where it is white), and half of its own.
std::array<uint8_t, 256> rec709FromSrgb();

/// The colours of `image.rgba`, from sRGB; alpha stays.
void encodeRec709(render::Image& image);

/// A whole PNG of sRGB is said to be of BT.709: chunk cICP (PNG, third edition, 11.3.2.6; ITU-T H.273: primaries 1,
/// transfer 1, no matrix, full range) and, for those who do not know it, the nearest power in gAMA, instead of sRGB.
void tagRec709(std::vector<char>& png);

}  // namespace stipple::image
