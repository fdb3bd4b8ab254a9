#include "engine/render/effects/table.h"

#include <algorithm>
#include <array>

#include "engine/render/draw_list.h"

namespace stipple::render {

#define STIPPLE_EFFECT(name) extern const Effect name##Effect;
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT

namespace {

constexpr std::array kEffects{
#define STIPPLE_EFFECT(name) &name##Effect,
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT
};
static_assert(kEffects.size() <= 32, "EffectSet");

template <typename Holds>
EffectSet setOf(const Holds& holds) {
    EffectSet set;
    for (size_t e = 0; e < kEffects.size(); ++e)
        if (holds(e)) set.add(e);
    return set;
}

bool isRequestedBy(const Effect& effect, const DrawSettings& settings) {
    if (effect.isRequested) return effect.isRequested(settings);
    return std::any_of(settings.effects.begin(), settings.effects.end(),
                       [&](const EffectRequest& r) { return r.name == effect.name; });
}

}  // namespace

std::span<const Effect* const> effects() { return kEffects; }

const Effect* effectNamed(std::string_view name) {
    for (const Effect* e : kEffects)
        if (name == e->name) return e;
    return nullptr;
}

std::optional<size_t> effectOfPass(Pass pass) {
    for (size_t e = 0; e < kEffects.size(); ++e)
        if (const auto of = kEffects.at(e)->passes; std::find(of.begin(), of.end(), pass) != of.end()) return e;
    return {};
}

EffectSet allEffects() {
    return setOf([](size_t) { return true; });
}

EffectSet effectsOfScene(const EffectScene& scene) {
    return setOf([&](size_t e) { return kEffects.at(e)->ofScene(scene); });
}

bool isRequested(std::string_view name, const DrawSettings& settings) {
    const Effect* const effect = effectNamed(name);
    return effect != nullptr && isRequestedBy(*effect, settings);
}

EffectSet requestedEffects(EffectSet scene, const DrawSettings& settings) {
    return setOf([&](size_t e) { return scene.has(e) && isRequestedBy(*kEffects.at(e), settings); });
}

EffectSet effectsOfFrame(EffectSet requested, const FrameContent& content, const DrawSettings& settings,
                         const DrawList& draws, std::span<const uint64_t> nodes) {
    return setOf([&](size_t e) {
        return requested.has(e) && kEffects.at(e)->ofFrame({content, settings, draws, nodes.empty() ? 0 : nodes[e]});
    });
}

}  // namespace stipple::render
