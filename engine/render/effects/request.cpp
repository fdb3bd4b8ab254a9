#include "engine/render/effects/request.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>

#include "engine/render/draw_list.h"
#include "engine/render/effects/table.h"

namespace stipple::render {
namespace {

constexpr const char* kOption = "--effects";

std::vector<std::string> split(const std::string& text, char at) {
    std::vector<std::string> parts(1);
    for (const char c : text)
        if (c == at)
            parts.emplace_back();
        else if (c != ' ')
            parts.back() += c;
    return parts;
}

// The names of all builds, whatever this one leaves out.
#pragma push_macro("STIPPLE_ONLY_LIGHT")
#undef STIPPLE_ONLY_LIGHT
constexpr std::array kNamesOfAllBuilds{
#define STIPPLE_EFFECT(name) #name,
#include "engine/render/effects/effects.inl"
#undef STIPPLE_EFFECT
};
#pragma pop_macro("STIPPLE_ONLY_LIGHT")

std::vector<std::string_view> leftOutOfBuild() {
    std::vector<std::string_view> names;
    for (const char* name : kNamesOfAllBuilds)
        if (effectNamed(name) == nullptr) names.emplace_back(name);
    return names;
}
bool has(std::span<const std::string_view> names, std::string_view name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

/// What options of their own ask for, where no manifest is there to say so.
struct AskedByOption {
    const char *name, *option;
    bool (*isAsked)(const DrawSettings& settings);
    void (*leaveOut)(DrawSettings& settings);
};
constexpr std::array kAskedByOptions{
    AskedByOption{"shadow", "--sun",
                  [](const DrawSettings& s) {
                      return std::any_of(s.lights.begin(), s.lights.end(),
                                         [](const WorldLight& l) { return l.isSun && l.castsShadow; });
                  },
                  [](DrawSettings& s) {
                      for (WorldLight& l : s.lights) l.castsShadow = false;
                  }},
    AskedByOption{"wind", "--wind", [](const DrawSettings& s) { return s.wind.strength > 0; },
                  [](DrawSettings& s) { s.wind.strength = 0; }},
    AskedByOption{"background", "--background environment", [](const DrawSettings& s) { return s.backdrop != nullptr; },
                  [](DrawSettings& s) { s.backdrop.reset(); }}};

/// Is it for a list to ask for it, or to leave it out?
bool isListed(const Effect& e) { return e.isRequested == nullptr || e.leaveOut != nullptr; }

/// A list, taken apart.
struct Wanted {
    bool isScene = false, isAuto = false, isNone = false;  ///< isAuto: isScene, too
    std::vector<const Effect*> named, leftOut;
    static bool has(const std::vector<const Effect*>& of, const Effect* e) {
        return std::find(of.begin(), of.end(), e) != of.end();
    }
    bool leavesOut(const Effect* e) const { return isNone || has(leftOut, e); }
    /// Does nothing in the list speak against it?
    bool permits(const Effect* e) const {
        return !leavesOut(e) && (isScene || has(named, e) || e->isRequested != nullptr);
    }
};

Result<const Effect*> effectIn(const std::string& name) {
    const Effect* const e = effectNamed(name);
    if (e == nullptr && has(leftOutOfBuild(), name))
        return fail(ErrorKind::usage, fmt::format("'{}' is not compiled into this program", name), kOption,
                    "leave it out, or take a build without -DSTIPPLE_EFFECTS=OFF");
    if (e == nullptr)
        return fail(ErrorKind::usage, fmt::format("'{}' is not an effect", name), kOption,
                    "scene, auto, none, or some of: " + effectNames());
    if (!isListed(*e))
        return fail(ErrorKind::usage, fmt::format("'{}' is asked for by {}", name, e->option), kOption,
                    fmt::format("leave it out of the list; a list may have {}", effectNames()));
    return e;
}

Result<Wanted> wantedOf(const std::string& list) {
    Wanted w;
    const std::vector<std::string> words = split(list, ',');
    for (const std::string& word : words) {
        if (word == "scene" || word == "auto") {
            w.isScene = true;
            w.isAuto = w.isAuto || word == "auto";
        } else if (word == "none") {
            w.isNone = true;
        } else {
            const bool isLeftOut = !word.empty() && word.front() == '-';
            STIPPLE_ASSIGN(const Effect* const e, effectIn(isLeftOut ? word.substr(1) : word));
            (isLeftOut ? w.leftOut : w.named).push_back(e);
        }
    }
    if (w.isNone && words.size() > 1)
        return fail(ErrorKind::usage, fmt::format("'{}' asks for none and for some", list), kOption,
                    "take none alone, or leave it out");
    for (const Effect* e : w.named)
        if (Wanted::has(w.leftOut, e))
            return fail(ErrorKind::usage, fmt::format("'{}' asks for {} and leaves it out", list, e->name), kOption,
                        "take one of the two out");
    return w;
}

/// What a parameter may be, for a person.
std::string rangeOf(const Parameter& p) {
    if (!p.words.empty()) {
        std::string all;
        for (const char* word : p.words) all += std::string(all.empty() ? "" : ", ") + word;
        return all;
    }
    return fmt::format("{}{:g} to {:g}", p.count == 3 ? "three numbers with commas, each " : "", p.least, p.most);
}

std::optional<double> numberOf(const std::string& text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
    return value;
}

std::optional<double> valueOf(const Parameter& p, const std::string& text) {
    if (!p.words.empty()) {
        const auto found = std::find(p.words.begin(), p.words.end(), text);
        if (found == p.words.end()) return {};
        return static_cast<double>(found - p.words.begin());
    }
    const auto value = numberOf(text);
    return value && *value >= p.least && *value <= p.most ? value : std::nullopt;
}

/// NAME.PARAMETER=VALUE, taken apart.
struct Setting {
    const Effect* effect = nullptr;
    const Parameter* parameter = nullptr;
    std::array<double, 3> values{};
    void applyTo(DrawSettings& settings) const {
        std::copy_n(values.begin(), parameter->count, parameter->at(settings));
    }
};

std::string parametersOf(const Effect& e) {
    std::string all;
    for (const Parameter& p : e.parameters) all += fmt::format("{}{}.{}", all.empty() ? "" : ", ", e.name, p.name);
    return all.empty() ? fmt::format("{} has none", e.name) : all;
}

Result<Setting> settingOf(const std::string& text) {
    const std::string where = "--set " + text;
    const size_t dot = text.find('.'), equals = text.find('=');
    if (dot == std::string::npos || equals == std::string::npos || equals < dot)
        return fail(ErrorKind::usage, "is not NAME.PARAMETER=VALUE", where, "stipple help effects lists them");
    Setting s;
    STIPPLE_ASSIGN(s.effect, effectIn(text.substr(0, dot)));
    const std::string name = text.substr(dot + 1, equals - dot - 1), value = text.substr(equals + 1);
    const auto& all = s.effect->parameters;
    const auto found = std::find_if(all.begin(), all.end(), [&](const Parameter& p) { return name == p.name; });
    if (found == all.end())
        return fail(ErrorKind::usage, fmt::format("{} has no parameter '{}'", s.effect->name, name), where,
                    parametersOf(*s.effect));
    s.parameter = &*found;
    const std::vector<std::string> parts = split(value, ',');
    bool isGood = parts.size() == found->count;
    for (size_t i = 0; isGood && i < parts.size(); ++i) {
        const auto one = valueOf(*found, parts[i]);
        isGood = one.has_value();
        s.values.at(i) = one.value_or(0);
    }
    if (isGood) return s;
    return fail(ErrorKind::usage,
                fmt::format("'{}' is not what {}.{} may be: {}", value, s.effect->name, name, rangeOf(*found)), where,
                found->summary);
}

/// Each effect once: who asked first.
void request(const Effect& e, const std::string& by, DrawSettings& settings) {
    if (e.isRequested != nullptr) return;  // its own option does
    const bool isKnown = std::any_of(settings.effects.begin(), settings.effects.end(),
                                     [&](const EffectRequest& r) { return r.name == e.name; });
    if (!isKnown) settings.effects.emplace_back(e.name, by);
}

Result<void> checkSettings(const EffectWishes& wishes, const Wanted& wanted) {
    for (const std::string& text : wishes.values) {
        STIPPLE_ASSIGN(const Setting s, settingOf(text));
        if (!wanted.permits(s.effect))
            return fail(ErrorKind::usage, fmt::format("{} is left out by {} {}", s.effect->name, kOption, wishes.list),
                        "--set " + text, fmt::format("ask for {}, or leave --set out", s.effect->name));
    }
    return {};
}

/// What a scene file asks for. In vain: notes.
void takeScene(const SceneWishes& scene, const Wanted& wanted, DrawSettings& settings,
               std::vector<std::string>& notes) {
    const auto say = [&](const Error& error) {
        notes.push_back(fmt::format("{}: what the scene asks of effects is passed over: {}", scene.file, error.what));
    };
    for (const std::string& name : scene.names) {
        const auto e = effectIn(name);
        if (!e)
            say(e.error());
        else if (wanted.permits(*e))
            request(**e, "the scene file", settings);
    }
    for (const std::string& text : scene.values) {
        const auto s = settingOf(text);
        if (!s)
            say(s.error());
        else if (wanted.permits(s->effect))
            s->applyTo(settings);
    }
}

/// Takes back what other options ask for and the list leaves out.
void leaveOut(const EffectWishes& wishes, const Wanted& wanted, DrawSettings& settings,
              std::vector<std::string>& notes) {
    for (const Effect* e : effects()) {
        if (e->leaveOut == nullptr || !wanted.leavesOut(e) || !e->isRequested(settings)) continue;
        e->leaveOut(settings);
        notes.push_back(fmt::format("{} {} leaves {} out, whatever {} says", kOption, wishes.list, e->name, e->option));
    }
}

/// What is requested by name, and an option asks for, too.
void takeOptions(const EffectWishes& wishes, const Wanted& wanted, DrawSettings& settings,
                 std::vector<std::string>& notes) {
    for (const Effect* e : effects()) {
        if (e->isAskedFor == nullptr || !e->isAskedFor(settings)) continue;
        if (wanted.leavesOut(e))
            notes.push_back(
                fmt::format("{} {} leaves {} out, whatever {} says", kOption, wishes.list, e->name, e->option));
        else
            request(*e, e->option, settings);
    }
}

}  // namespace

std::string effectNames() {
    std::string names;
    for (const Effect* e : effects())
        if (isListed(*e)) names += std::string(names.empty() ? "" : ", ") + e->name;
    return names;
}

Result<void> checkWishes(const EffectWishes& wishes) {
    STIPPLE_ASSIGN(const Wanted wanted, wantedOf(wishes.list));
    return checkSettings(wishes, wanted);
}

void takeBack(std::span<const std::string_view> missing, DrawSettings& settings, std::vector<std::string>& notes) {
    for (const AskedByOption& asked : kAskedByOptions) {
        if (!has(missing, asked.name) || !asked.isAsked(settings)) continue;
        asked.leaveOut(settings);
        notes.push_back(fmt::format(
            "{} asks for {}, which is not compiled into this program (-DSTIPPLE_EFFECTS=OFF): pictures are without it",
            asked.option, asked.name));
    }
}

Result<std::vector<std::string>> requestEffects(const EffectWishes& wishes, const SceneWishes& scene,
                                                const SceneFacts& facts, DrawSettings& settings) {
    STIPPLE_ASSIGN(const Wanted wanted, wantedOf(wishes.list));
    STIPPLE_TRY(checkSettings(wishes, wanted));
    std::vector<std::string> notes;
    settings.effects.clear();
    settings.parameters = {};
    settings.parameters.facts = facts;
    leaveOut(wishes, wanted, settings, notes);
    takeBack(leftOutOfBuild(), settings, notes);
    for (const Effect* e : wanted.named) {
        if (e->isRequested != nullptr && !e->isRequested(settings))
            return fail(ErrorKind::usage, fmt::format("{} needs {} to say how much", e->name, e->option),
                        fmt::format("{} {}", kOption, wishes.list), fmt::format("give {}, too", e->option));
        request(*e, kOption, settings);
    }
    takeOptions(wishes, wanted, settings, notes);
    if (wanted.isScene) takeScene(scene, wanted, settings, notes);
    for (const std::string& text : wishes.values) {
        STIPPLE_ASSIGN(const Setting s, settingOf(text));
        s.applyTo(settings);
        request(*s.effect, "--set", settings);
    }
    for (const Effect* e : effects()) {
        if (!wanted.isAuto || wanted.leavesOut(e) || e->calledForBy == nullptr) continue;
        if (const char* by = e->calledForBy(facts)) request(*e, by, settings);
    }
    return notes;
}

}  // namespace stipple::render
