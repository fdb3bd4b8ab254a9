#include "apps/stipple/effect_walk.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace stipple::app {

void EffectWalk::look(size_t picture, const std::vector<render::EffectStatus>& status) {
    for (const render::EffectStatus& s : status) {
        const auto shown = shown_.find(s.name);
        if (s.isActive == (shown != shown_.end())) continue;
        // Who called for what is gone may not be known any more.
        changes_.push_back({picture, s.name, s.isActive ? s.calledForBy : shown->second, s.isActive});
        if (s.isActive)
            shown_[s.name] = s.calledForBy;
        else
            shown_.erase(shown);
    }
}

nlohmann::json changesJson(const std::vector<EffectChange>& changes) {
    nlohmann::json out = nlohmann::json::array();
    for (const EffectChange& c : changes)
        out.push_back({{"picture", c.picture},
                       {"effect", c.effect},
                       {"change", c.came ? "came" : "went"},
                       {"called_for_by", c.calledForBy}});
    return out;
}

std::string changesText(const std::vector<EffectChange>& changes) {
    std::string all;
    for (const EffectChange& c : changes)
        all += fmt::format("picture {}: {} {} ({})\n", c.picture, c.effect, c.came ? "came" : "went", c.calledForBy);
    return all;
}

}  // namespace stipple::app
