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
    const char* why;  ///< not
};
constexpr const char* kOfEwa = "it belongs to mode ewa";
constexpr const char* kDrawn = "the reference traces full detail as it stands";
constexpr std::array kOnlyOf{
    OnlyOf{"--lowpass", blends, kOfEwa},        OnlyOf{"--kernel", blends, kOfEwa},
    OnlyOf{"--normalise", blends, kOfEwa},      OnlyOf{"--samples", isTraced, "it belongs to mode reference"},
    OnlyOf{"--budget-points", isDrawn, kDrawn}, OnlyOf{"--wind", isDrawn, kDrawn},
    OnlyOf{"--time", isDrawn, kDrawn},          OnlyOf{"--accumulate", isDrawn, kDrawn},
    OnlyOf{"--debug", isDrawn, kDrawn},
};

}  // namespace

Result<void> checkOfMode(const CLI::App& sub, const std::string& mode) {
    for (const OnlyOf& row : kOnlyOf) {
        const CLI::Option* const option = sub.get_option_no_throw(row.option);
        if (option == nullptr || option->count() == 0 || row.uses(mode)) continue;
        return fail(ErrorKind::usage, fmt::format("does nothing in mode {}: {}", mode, row.why), row.option,
                    fmt::format("leave {} out, or choose another --mode", row.option));
    }
    return {};
}

}  // namespace stipple::app
