// What the restating backend knows of effects.
#pragma once

#include "engine/reference/restate.h"
#include "engine/render/effects/effect.h"
#include "shaders/shared/tone.h"

namespace stipple::reference {

struct RestatedEffect {
    /// On reconstructed surfaces, before light (Stage::surface). Null: nothing there.
    void (*onSurface)(const render::DrawList& draws, Level& level) = nullptr;
    /// On what a pixel sends (Stage::lit); `depth`: there. Null: nothing there.
    glm::dvec3 (*onSent)(const render::DrawList& draws, const glm::dvec3& sent, const glm::dvec2& pixel,
                         double depth) = nullptr;
    /// What is seen where nothing is drawn, instead of the background. Null: that.
    glm::dvec3 (*behind)(const render::DrawList& draws, const glm::dvec2& pixel) = nullptr;
};
#define STIPPLE_EFFECT(name) extern const RestatedEffect name##Restated;
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT

/// tone.cpp
glm::dvec3 tonedLight(const shared::ToneConstants& tone, const glm::dvec3& sent);

/// Those of the frame, in their order.
void applyOnSurface(const render::DrawList& draws, Level& level);
glm::dvec3 behindAll(const render::DrawList& draws, const glm::dvec2& pixel);
glm::dvec3 applyOnSent(const render::DrawList& draws, const glm::dvec3& sent, const glm::dvec2& pixel, double depth);

}  // namespace stipple::reference
