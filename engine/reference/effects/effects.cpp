// The table of effects, and those that are no function of the surface.
#include "engine/reference/effects/effects.h"

#include <array>

#include "engine/render/draw_list.h"

namespace stipple::reference {

/// How opaque what a pixel shows is, surface.cpp says.
constinit const RestatedEffect transparencyRestated{};
/// Both are what surface.cpp has of light.
constinit const RestatedEffect lightRestated{};
constinit const RestatedEffect environmentRestated{};

namespace {

constexpr std::array kRestated{
#define STIPPLE_EFFECT(name) &name##Restated,
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT
};

}  // namespace

void applyOnSurface(const render::DrawList& draws, Level& level) {
    for (size_t e = 0; e < kRestated.size(); ++e)
        if (kRestated.at(e)->onSurface != nullptr && draws.effects.has(e)) kRestated.at(e)->onSurface(draws, level);
}

glm::dvec3 behindAll(const render::DrawList& draws, const glm::dvec2& pixel) {
    for (size_t e = 0; e < kRestated.size(); ++e)
        if (kRestated.at(e)->behind != nullptr && draws.effects.has(e)) return kRestated.at(e)->behind(draws, pixel);
    return glm::dvec3(draws.frame.background);
}

glm::dvec3 applyOnSent(const render::DrawList& draws, const glm::dvec3& sent, const glm::dvec2& pixel, double depth) {
    glm::dvec3 arriving = sent;
    for (size_t e = 0; e < kRestated.size(); ++e)
        if (kRestated.at(e)->onSent != nullptr && draws.effects.has(e))
            arriving = kRestated.at(e)->onSent(draws, arriving, pixel, depth);
    return arriving;
}

}  // namespace stipple::reference
