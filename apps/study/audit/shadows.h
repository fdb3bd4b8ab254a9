// The audit of shadows: which pixels a light comes to, as a picture shows it and as rays through the full detail have
// it. A pixel is wrong where the two differ; it is beyond what is stated where no pixel of the traced picture within
// that distance is as it is shown (a border that is off by less has one).
#pragma once

#include <cstdint>
#include <vector>

#include "engine/render/frame.h"

namespace stipple::study {

/// Three pictures of one view: with the light and its shadows, without shadows, without the light; linear and depth.
struct LightPictures {
    const render::Image &with, &open, &dark;
};
/// What of the light comes to each pixel, 0 to 1; -1: it does not fall there at all.
std::vector<double> lightShares(const LightPictures& pictures);

struct ShadowAudit {
    uint64_t lookedAt = 0;  ///< pixels that the light falls on in both pictures, at an angle that a bound is stated for
    uint64_t dark = 0;      ///< of those, in the traced shadow
    uint64_t wrong = 0, beyond = 0;
    double worst = 0;   ///< px, of wrong ones from the nearest that is as they are shown; at most kShadowReach
    double stated = 0;  ///< px, the greatest of a wrong one
    uint64_t worstPixel = 0;
    double share() const { return lookedAt > 0 ? static_cast<double>(beyond) / static_cast<double>(lookedAt) : 0; }
};
/// Distances are not followed beyond that, px.
inline constexpr int kShadowReach = 48;
/// Both borders are known to a pixel.
inline constexpr double kBorderPixels = 1;

/// `shown`, `traced`: shares, row by row of pictures so wide. `stated`: px, of each pixel; not a number: nothing is
/// stated there (grazing light), and it is not looked at.
ShadowAudit auditShadows(const std::vector<double>& shown, const std::vector<double>& traced,
                         const std::vector<double>& stated, uint32_t width);

/// What a frame states of the borders of its (first) light's shadows, px, of each pixel: by the maps that it used.
/// `traced`: depths and normals of the full detail. Not a number where the surface faces the light by less than a
/// fifth, where nothing is there, or where the frame shows something else.
std::vector<double> statedBorders(const render::FrameState& state, const lod::View& view, const render::Image& traced,
                                  const render::WorldLight& light);

}  // namespace stipple::study
