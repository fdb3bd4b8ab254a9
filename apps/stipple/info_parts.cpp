#include "apps/stipple/info_parts.h"

#include <fmt/format.h>

#include <cctype>
#include <nlohmann/json.hpp>

#include "apps/stipple/report.h"
#include "engine/base/text.h"
#include "engine/base/words.h"

namespace stipple::app {
namespace {

std::string keyOf(const std::string& name) {
    std::string key;
    for (const char c : name) key += c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return key;
}

std::string textOf(const lod::Fact& fact) {
    if (const auto* text = std::get_if<std::string>(&fact.value)) return printable(*text);
    if (const auto* count = std::get_if<uint64_t>(&fact.value)) return fmt::format("{}", *count);
    if (const auto* number = std::get_if<double>(&fact.value)) return fmt::format("{:.4g}", *number);
    const auto& v = std::get<glm::dvec3>(fact.value);
    return fmt::format("{:.15g} {:.15g} {:.15g}", v.x, v.y, v.z);
}

}  // namespace

nlohmann::json vectorJson(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

nlohmann::json factsJson(const std::vector<lod::Fact>& facts) {
    nlohmann::json j = nlohmann::json::object();
    for (const lod::Fact& fact : facts) {
        nlohmann::json& value = j[keyOf(fact.name)];
        if (const auto* text = std::get_if<std::string>(&fact.value))
            value = *text;
        else if (const auto* count = std::get_if<uint64_t>(&fact.value))
            value = *count;
        else if (const auto* number = std::get_if<double>(&fact.value))
            value = *number;
        else if (const auto* v = std::get_if<glm::dvec3>(&fact.value))
            value = {v->x, v->y, v->z};
    }
    return j;
}

Result<void> showParts(const InputInfoOptions& o, const lod::Format& format) {
    STIPPLE_ASSIGN(const std::vector<lod::FilePart> parts, format.describe(o.input, o.verify, o.more));
    if (o.json) {
        nlohmann::json j = {
            {"kind", "input"}, {"path", o.input}, {"format", format.name}, {"parts", nlohmann::json::array()}};
        for (const lod::FilePart& part : parts) {
            nlohmann::json one = factsJson(part.facts);
            one["name"] = part.name;
            j["parts"].push_back(one);
        }
        printJson("info", j);
        return {};
    }
    fmt::print("{}: {}, {}\n", printable(o.input), format.name, counted(parts.size(), "part"));
    for (const lod::FilePart& part : parts) {
        fmt::print("  {}\n", printable(part.name));
        for (const lod::Fact& fact : part.facts) fmt::print("    {:15} {}\n", fact.name, textOf(fact));
    }
    return {};
}

}  // namespace stipple::app
