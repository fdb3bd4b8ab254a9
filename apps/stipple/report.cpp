#include "apps/stipple/report.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "engine/base/process.h"

namespace stipple::app {
namespace {

constexpr int kSchemaVersion = 1;

struct Reporting {
    std::string command = "stipple";
    bool asJson = false;
    bool hasAnswered = false;  ///< one object is all that a reader expects
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

}  // namespace

void setReporting(std::string command, bool asJson) { reporting() = {std::move(command), asJson, false}; }

int report(const Error& error) {
    Error told = error;
    told.what = withoutCodes(told.what);
    if (told.kind == ErrorKind::usage)
        told.hint += (told.hint.empty() ? "see " : "; see ") + reporting().command + " --help";
    fmt::print(stderr, "stipple: {}\n", told.line());
    const int code = static_cast<int>(told.kind);
    if (reporting().asJson && !reporting().hasAnswered)
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
    reporting().hasAnswered = true;
    value["schema"] = fmt::format("stipple.{}/{}", kind, kSchemaVersion);
    // (Names of files may be any bytes.)
    fmt::print("{}\n", value.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

nlohmann::json jsonNumber(double value) {
    if (std::isfinite(value)) return value;
    return value > 0 ? "inf" : "nan";
}

}  // namespace stipple::app
