// What effects are told beyond whether they are asked for: a struct for each that has parameters (effect.h, Parameter).
#pragma once

#include <array>
#include <string>
#include <utility>

#include "engine/render/effects/facts.h"

namespace stipple::render {

/// An effect that is asked for by its name, and who did.
struct EffectRequest {
    std::string name;
    std::string by;  ///< for a person: "--effects", "the scene file", "points without normals"
    EffectRequest(std::string of, std::string who = "the program") : name(std::move(of)), by(std::move(who)) {}
    EffectRequest(const char* of) : EffectRequest(std::string(of)) {}
    bool operator==(const EffectRequest&) const = default;
};

/// Eye-dome lighting. `where` 0: what keeps its colours, and points of scenes whose points lack normals; 1: everything.
struct EdlSettings {
    double strength = 100, radius = 1.4, scales = 1, where = 0;
};

/// Fog. `colour`: sRGB, 0 to 255; negative: the background's. `kind` 0: grey; 1: air, which takes blue out first.
struct FogSettings {
    double density = 0;  ///< 1 / world unit, at height `base`
    double height = 0;   ///< by which it thins out to 1 / e, world units; 0: even
    double base = 0;     ///< along the scene's up, world units
    std::array<double, 3> colour{-1, -1, -1};
    double kind = 0;
};

/// From light to what a screen is sent. `curve` 0: none, light above 1 is cut off; 1: filmic. `metering` 0: none; 1:
/// the mean of what is seen becomes middle grey, and `exposure` counts from there.
struct ToneSettings {
    double exposure = 1, curve = 0, metering = 0;
};

/// Ambient occlusion. `radius`: world units; 0: by the scene. `detail` 0: of every second pixel both ways; 1: of all.
struct OcclusionSettings {
    double radius = 0, detail = 0;
};

/// Shadows. `texels`: of maps, along an edge.
struct ShadowSettings {
    double texels = 1024;
};

/// Reflections of the screen. `distance`: world units; 0: by the scene. `steps`: of the longest rays.
struct ReflectionSettings {
    double distance = 0, steps = 48;
};

/// Of all effects.
struct EffectParameters {
    SceneFacts facts;  ///< of the scene that is drawn, where somebody said
    EdlSettings edl;
    FogSettings fog;
    ToneSettings tone;
    OcclusionSettings occlusion;
    ShadowSettings shadow;
    ReflectionSettings reflection;
};

}  // namespace stipple::render
