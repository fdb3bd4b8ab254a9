#include "engine/scene/gltf/effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "engine/scene/gltf/json_tools.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

/// As --set has it: a word, a number, or several with commas.
std::optional<std::string> valueText(const json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_number()) return fmt::format("{}", value.get<double>());
    if (!value.is_array()) return {};
    std::string all;
    for (const json& one : value) {
        if (!one.is_number()) return {};
        all += fmt::format("{}{}", all.empty() ? "" : ",", one.get<double>());
    }
    return all;
}

}  // namespace

void readEffects(const json& root, Scene& scene) {
    const json& scenes = arrayOf(root, "scenes");
    const size_t which = root.value("scene", size_t{0});
    if (which >= scenes.size()) return;
    const json extras = scenes[which].value("extras", json());
    if (!extras.is_object() || !extras.contains("stipple")) return;
    const json& asked = extras["stipple"];
    const auto leaveOut = [&](const std::string& what) {
        scene.notes.push_back(fmt::format("extras.stipple of the scene: {} is left out", what));
    };
    if (!asked.is_object()) return leaveOut("what is no object");
    for (const auto& [key, value] : asked.items()) {
        if (key == "effects") {
            if (!value.is_array()) leaveOut("'effects', which is no list of names,");
            for (const json& name : value.is_array() ? value : json::array())
                if (name.is_string())
                    scene.effects.names.push_back(name.get<std::string>());
                else
                    leaveOut("an effect that is no name");
            continue;
        }
        if (!value.is_object()) {
            leaveOut(fmt::format("'{}', which is no object,", key));
            continue;
        }
        for (const auto& [parameter, of] : value.items())
            if (const auto text = valueText(of))
                scene.effects.values.push_back(fmt::format("{}.{}={}", key, parameter, *text));
            else
                leaveOut(fmt::format("'{}.{}'", key, parameter));
    }
}

json effectsAsJson(const SceneEffects& effects) {
    json out;
    for (const std::string& name : effects.names) out["effects"].push_back(name);
    for (const std::string& text : effects.values) {
        const size_t dot = text.find('.'), equals = text.find('=');
        if (dot == std::string::npos || equals == std::string::npos || equals < dot) continue;
        json& to = out[text.substr(0, dot)][text.substr(dot + 1, equals - dot - 1)];
        const std::string value = text.substr(equals + 1);
        const json numbers = json::parse("[" + value + "]", nullptr, false);
        if (numbers.is_discarded() || numbers.empty() ||
            !std::all_of(numbers.begin(), numbers.end(), [](const json& n) { return n.is_number(); }))
            to = value;
        else
            to = numbers.size() == 1 ? numbers.front() : numbers;
    }
    return out;
}

}  // namespace stipple::scene::gltf
