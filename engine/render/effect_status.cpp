#include "engine/render/effect_status.h"

#include <algorithm>
#include <string_view>

#include "engine/render/effects/table.h"

namespace stipple::render {
namespace {

/// Is `label`, or a part of it ("edl", "edl coarse"), a pass of the effect? Backends name dispatches after their
/// passes.
bool isOf(std::string_view label, const Effect& effect) {
    return std::any_of(effect.passes.begin(), effect.passes.end(), [&](Pass pass) {
        const std::string_view name = passName(pass);
        if (label.substr(0, name.size()) != name) return false;
        return label.size() == name.size() || label[name.size()] == ' ' || label[name.size()] == '_';
    });
}

/// Adds the time of what ran under `label`, passes joined by +.
void addTime(const PassTime& time, const Effect& effect, EffectStatus& status) {
    bool any = false, all = true;
    for (std::string_view rest = time.name; !rest.empty();) {
        const size_t end = std::min(rest.find('+'), rest.size());
        const bool is = isOf(rest.substr(0, end), effect);
        any = any || is;
        all = all && is;
        rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    if (any && all) status.ms = status.ms.value_or(0) + time.ms;
    if (any && !all) status.within = time.name;
}

std::string requesterOf(const Effect& effect, const DrawSettings& settings) {
    if (effect.isRequested != nullptr)
        return effect.isRequested(settings) ? (effect.option != nullptr ? effect.option : "the program") : "";
    for (const EffectRequest& r : settings.effects)
        if (r.name == effect.name) return r.by;
    return "";
}

}  // namespace

std::vector<EffectStatus> effectStatus(const FrameState& state, const DrawSettings& settings) {
    const BackendResources held = state.backend->resources();
    std::vector<EffectStatus> out;
    for (size_t e = 0; e < effects().size(); ++e) {
        const Effect& effect = *effects()[e];
        EffectStatus& s = out.emplace_back();
        s.name = effect.name;
        s.isRequested = state.effects.requested.has(e);
        s.calledForBy = requesterOf(effect, settings);
        s.isActive = state.effects.shown.has(e);
        // (Of a frame of layers some are: the settings of the whole do not ask for them.)
        if (s.isActive && s.calledForBy.empty())
            s.calledForBy = effect.option != nullptr ? effect.option : "the program";
        if (e < state.effects.passes.size()) s.passes = state.effects.passes[e];
        if (e < held.effects.size()) s.held = held.effects[e];
        if (effect.before != nullptr) s.held.bytes += effect.before->bytes(state);
        if (!s.isActive) continue;
        if (effect.before != nullptr) s.msBefore = effect.before->ms(state);
        for (const PassTime& time : state.backend->passTimes()) addTime(time, effect, s);
    }
    return out;
}

}  // namespace stipple::render
