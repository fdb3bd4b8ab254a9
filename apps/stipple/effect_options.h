// Which effects are drawn, on the command line: --effects and --set.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "engine/render/effect_status.h"
#include "engine/render/effects/request.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct EffectOptions : render::EffectWishes {
    void addTo(CLI::App& sub);
    /// What is not known before: see render::checkWishes.
    Result<void> check() const { return render::checkWishes(*this); }
    /// Requests what is asked for of frames of `state`; once `settings` say all else. Notes are told unless `isQuiet`.
    Result<void> applyTo(render::DrawSettings& settings, const render::SceneWishes& scene,
                         std::span<const std::shared_ptr<const lod::Store>> stores, bool isQuiet) const;
};

/// Of all effects of the table, after a frame: name, requested, calledForBy, active, passes, pipelines, bytes, ms.
nlohmann::json effectsJson(const std::vector<render::EffectStatus>& status);
/// One line of those that are drawn or asked for in vain, for a person; empty where there are none.
std::string effectsText(const std::vector<render::EffectStatus>& status);

}  // namespace stipple::app
