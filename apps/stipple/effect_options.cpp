#include "apps/stipple/effect_options.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/stipple/options.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/render/draw_list.h"
#include "engine/render/effects/table.h"

namespace stipple::app {

void EffectOptions::addTo(CLI::App& sub) {
    sub.add_option("--effects", list,
                   fmt::format("scene (what its file asks for), auto (that, and what the scene calls for), none, or "
                               "some of {}; scene or auto among them: these, too; -NAME: not this one (stipple help "
                               "effects)",
                               render::effectNames()))
        ->type_name("scene|auto|none|LIST")
        ->capture_default_str();
    sub.add_option("--set", values, "a parameter of an effect, which asks for it, too: NAME.PARAMETER=VALUE")
        ->type_name("SETTING")
        ->allow_extra_args(false);
}

Result<void> EffectOptions::applyTo(render::DrawSettings& settings, const render::SceneWishes& scene,
                                    std::span<const std::shared_ptr<const lod::Store>> stores, bool isQuiet) const {
    STIPPLE_ASSIGN(const std::vector<std::string> notes,
                   render::requestEffects(*this, scene, render::factsOf(stores, settings), settings));
    for (const std::string& note : notes)
        if (!isQuiet) fmt::print(stderr, "note: {}\n", printable(note));
    return {};
}

nlohmann::json effectsJson(const std::vector<render::EffectStatus>& status) {
    nlohmann::json out = nlohmann::json::array();
    for (const render::EffectStatus& s : status) {
        nlohmann::json j{{"name", s.name},
                         {"requested", s.isRequested},
                         {"called_for_by", s.calledForBy.empty() ? nlohmann::json() : nlohmann::json(s.calledForBy)},
                         {"active", s.isActive},
                         {"passes", s.passes},
                         {"pipelines", s.held.pipelines},
                         {"bytes", s.held.bytes},
                         {"ms", s.ms         ? nlohmann::json(*s.ms)
                                : s.isActive ? nlohmann::json()
                                             : nlohmann::json(0)}};
        if (!s.within.empty()) j["within"] = s.within;
        if (s.msBefore > 0) j["ms_before"] = s.msBefore;
        out.push_back(std::move(j));
    }
    return out;
}

std::string effectsText(const std::vector<render::EffectStatus>& status) {
    std::string all;
    for (const render::EffectStatus& s : status) {
        if (s.calledForBy.empty()) continue;
        std::string of = s.isActive ? "" : ": not in this view";
        if (s.ms) of = fmt::format(" {:.2f} ms", *s.ms);
        if (s.msBefore > 0) of += fmt::format(", {:.1f} ms before the frame", s.msBefore);
        if (s.held.bytes > 0) of += fmt::format(", {}", humanBytes(s.held.bytes));
        all += fmt::format("{}{} ({}){}", all.empty() ? "" : "; ", s.name, s.calledForBy, of);
    }
    return all;
}

}  // namespace stipple::app
