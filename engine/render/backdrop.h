// An HDR picture (equirectangular, y up) as what is seen behind everything: the texels of shaders/shared/background.h.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/environment.h"
#include "lod/cut/cut.h"
#include "shaders/shared/background.h"

namespace stipple::render {

struct DrawSettings;

struct Backdrop {
    uint32_t width = 0, height = 0, levels = 0;  ///< `width`, `height`: of level 0; each next has half of both
    std::array<uint32_t, shared::kBackdropLevels> first{};  ///< texel of each level
    std::vector<uint32_t> texels;
    float scale = 1;
    glm::vec3 mean{0};  ///< of its light from all directions, scale included
};

/// What is no number in the picture, or below 0, is 0, and what is above 60,000 is that (as makeEnvironment has it).
/// Pictures wider than 8192 are made smaller. Texels keep their light to a 512th of its largest part.
Backdrop makeBackdrop(HdrImage image, float scale, Executor& executor);

/// Does a frame show one?
bool showsBackdrop(const DrawSettings& settings);
/// `settings` have a backdrop. Exposure and curve are those of effect tone, where `settings` ask for it.
shared::BackgroundConstants backgroundConstants(const DrawSettings& settings, const glm::dmat3& cameraFromWorld,
                                                const lod::View& view);

/// What is behind what is drawn, at each pixel of a picture: one colour, or a backdrop without tone.
class Behind {
  public:
    Behind() = default;
    Behind(const glm::vec3& colour) : colour_(colour) {}  // NOLINT(google-explicit-constructor): a colour is one
    /// That of a frame; `settings` live longer.
    Behind(const DrawSettings& settings, const lod::View& view);
    bool isBackdrop() const { return backdrop_ != nullptr; }
    glm::vec3 at(size_t pixel) const;

  private:
    glm::vec3 colour_{0};
    const Backdrop* backdrop_ = nullptr;
    shared::BackgroundConstants constants_{};
    lod::View view_{};
};

}  // namespace stipple::render
