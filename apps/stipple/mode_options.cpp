#include "apps/stipple/mode_options.h"

#include <fmt/format.h>

#include <array>

#include "engine/render/reconstructions/table.h"

namespace stipple::app {
namespace {

bool isTraced(const std::string& mode) { return mode == "reference"; }
bool isDrawn(const std::string& mode) { return !isTraced(mode); }
bool blends(const std::string& mode) {
    const render::Reconstruction* of = render::reconstructionNamed(mode);
    return of != nullptr && of->blendsSplats;
}

struct OnlyOf {
    const char* option;
    bool (*uses)(const std::string& mode);
    const char* modes;  ///< in words
};
constexpr const char* kDrawn = "modes that draw a cut; the reference traces full detail as it stands";
constexpr std::array kOnlyOf{
    OnlyOf{"--lowpass", blends, "mode ewa"},
    OnlyOf{"--kernel", blends, "mode ewa"},
    OnlyOf{"--samples", isTraced, "mode reference"},
    OnlyOf{"--error", isDrawn, kDrawn},
    OnlyOf{"--budget-points", isDrawn, kDrawn},
    OnlyOf{"--curve-exact", isDrawn, kDrawn},
    OnlyOf{"--wind", isDrawn, kDrawn},
    OnlyOf{"--accumulate", isDrawn, kDrawn},
    OnlyOf{"--debug", isDrawn, kDrawn},
    OnlyOf{"--no-wait", isDrawn, kDrawn},
};

}  // namespace

Result<void> checkOfMode(const CLI::App& sub, const std::string& mode) {
    for (const OnlyOf& row : kOnlyOf) {
        const CLI::Option* const option = sub.get_option_no_throw(row.option);
        if (option == nullptr || option->count() == 0 || row.uses(mode)) continue;
        return fail(ErrorKind::usage, fmt::format("is of {}, and this is mode {}", row.modes, mode), row.option,
                    fmt::format("leave {} out, or choose another --mode", row.option));
    }
    return {};
}

}  // namespace stipple::app
