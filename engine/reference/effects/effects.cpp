// The table of effects, and those that are no function of the surface.
#include "engine/reference/effects/effects.h"

#include "engine/render/draw_list.h"

namespace stipple::reference {

/// Places bend where they are decoded.
constinit const RestatedEffect windRestated{};
/// Both are what surface.cpp has of light.
constinit const RestatedEffect lightRestated{};
constinit const RestatedEffect environmentRestated{};

void applyOnSurface(const render::DrawList& draws, Level& level) {
    size_t place = 0;
    for (const RestatedEffect* effect : {
#define STIPPLE_EFFECT(name) &name##Restated,
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT
         }) {
        if (effect->onSurface != nullptr && draws.effects.has(place)) effect->onSurface(draws, level);
        ++place;
    }
}

}  // namespace stipple::reference
