// Which effects are asked for: by a person (auto, none, a list), by a scene file, by what the scene is made of.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/result.h"
#include "engine/render/effects/facts.h"

namespace stipple::render {

struct DrawSettings;

struct EffectWishes {
    /// scene (what its file asks for), auto (that, and what it is made of calls for), none, or names with commas, scene
    /// or auto among them or not; -NAME: not this one.
    std::string list = "scene";
    std::vector<std::string> values;  ///< NAME.PARAMETER=VALUE; they ask for their effect, too
};
/// Of a scene file (glTF: `extras.stipple` of the scene): heard under `scene` and `auto`.
struct SceneWishes {
    std::vector<std::string> names, values;
    std::string file;
};

/// What can be found out without a scene. Errors: names and parameters that do not exist, values that are not what they
/// may be, requests that contradict each other.
Result<void> checkWishes(const EffectWishes& wishes);
/// Puts into `settings` what is to be requested of frames, and its parameters. `settings` says already what other
/// options ask for (light, wind, environment); that of effects that are left out is taken back. The result: notes for a
/// person. Errors as above; what a scene file asks in vain is a note.
Result<std::vector<std::string>> requestEffects(const EffectWishes& wishes, const SceneWishes& scene,
                                                const SceneFacts& facts, DrawSettings& settings);

/// Of effects that are not in this program (`missing`: their names) what options of their own ask for: taken back, with
/// a note each. Part of `requestEffects`.
void takeBack(std::span<const std::string_view> missing, DrawSettings& settings, std::vector<std::string>& notes);

/// For a person: the names that a list may have, with commas.
std::string effectNames();

}  // namespace stipple::render
