#include "apps/stipple/report.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "engine/base/process.h"
#include "engine/base/text.h"

namespace stipple::app {
namespace {

constexpr int kSchemaVersion = 2;

struct Reporting {
    std::string command = "stipple";
    bool asJson = false, hasResult = false;
};
Reporting& reporting() {
    static Reporting of;
    return of;
}

/// By exit code.
const char* nameOf(ErrorKind kind) {
    static constexpr std::array<const char*, 8> kNames{"none",   "other",  "usage",  "input",
                                                       "output", "device", "budget", "interrupted"};
    return kNames.at(static_cast<size_t>(kind));
}

/// Libraries put codes and type names of their own in front of what they say.
std::string withoutCodes(std::string text) {
    constexpr const char* kCode = "[json.exception.";
    for (size_t at = text.find(kCode); at != std::string::npos; at = text.find(kCode)) {
        const size_t end = text.find("] ", at);
        text.erase(at, end == std::string::npos ? end : end + 2 - at);
    }
    if (const size_t at = text.find("std::bad_alloc"); at != std::string::npos) text.replace(at, 14, "out of memory");
    return text;
}

/// Names of files and of what is in them may be any bytes, JSON is UTF-8.
void makeUtf8(nlohmann::json& j) {
    if (j.is_string()) {
        auto& text = j.get_ref<std::string&>();
        text = toUtf8(text);
    } else if (j.is_array()) {
        for (nlohmann::json& item : j) makeUtf8(item);
    } else if (j.is_object()) {
        nlohmann::json clean = nlohmann::json::object();
        for (const auto& [key, value] : j.items()) {
            nlohmann::json& to = clean[toUtf8(key)] = value;
            makeUtf8(to);
        }
        j = std::move(clean);
    }
}

}  // namespace

void setReporting(std::string command, bool asJson) { reporting() = {std::move(command), asJson, false}; }

int report(const Error& error) {
    Error told = error;
    told.what = withoutCodes(told.what);
    if (told.kind == ErrorKind::usage)
        told.hint += (told.hint.empty() ? "see " : "; see ") + reporting().command + " --help";
    Error line = told;
    if (line.where.rfind("stipple ", 0) == 0) line.where.erase(0, 8);  // the line begins with it
    fmt::print(stderr, "stipple: {}\n", printable(line.line()));
    const int code = static_cast<int>(told.kind);
    if (reporting().asJson && !reporting().hasResult)
        printJson("error", {{"error",
                             {{"kind", nameOf(told.kind)},
                              {"what", told.what},
                              {"where", told.where},
                              {"hint", told.hint},
                              {"exit", code}}}});
    return code;
}

Result<void> checkStopped(const std::string& output, const std::string& state) {
    if (!isStopRequested()) return {};
    return fail(ErrorKind::interrupted, "interrupted; " + state, output);
}

void printJson(const std::string& kind, nlohmann::json value) {
    value["schema"] = fmt::format("stipple.{}/{}", kind, kSchemaVersion);
    makeUtf8(value);
    reporting().hasResult = true;
    fmt::print("{}\n", value.dump(2));
}

nlohmann::json jsonNumber(double value) {
    if (std::isfinite(value)) return value;
    return value > 0 ? "inf" : "nan";
}

}  // namespace stipple::app
