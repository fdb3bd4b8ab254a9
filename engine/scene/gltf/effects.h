// What a scene asks of effects: {"stipple": {"effects": ["fog"], "fog": {"density": 0.01, "colour": [200, 210, 220]}}}
// among the extras of the glTF scene.
#pragma once

#include <nlohmann/json.hpp>

#include "engine/scene/scene.h"

namespace stipple::scene::gltf {

/// Of the scene of the file; what is of another shape is left out, with a note.
void readEffects(const nlohmann::json& root, Scene& scene);
/// The object "stipple"; null where nothing is asked for.
nlohmann::json effectsAsJson(const SceneEffects& effects);

}  // namespace stipple::scene::gltf
