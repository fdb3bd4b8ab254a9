#include "apps/stipple/mode_options.h"

#include <fmt/format.h>

#include <array>

#include "apps/stipple/options.h"
#include "engine/render/reconstructions/table.h"
#include "lod/primitives/patch_samples.h"

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
    OnlyOf{"--aperture", isDrawn, kDrawn},      OnlyOf{"--shutter", isDrawn, kDrawn},
    OnlyOf{"--fade", isDrawn, kDrawn},          OnlyOf{"--debug", isDrawn, kDrawn},
    OnlyOf{"--patch-as", isDrawn, kDrawn},      OnlyOf{"--interpolate", isDrawn, kDrawn},
    OnlyOf{"--hidden", isDrawn, kDrawn},
};

}  // namespace

void ModeOptions::addTo(CLI::App& sub, bool hasReference) {
    std::vector<std::string> names;
    std::string help;
    for (const render::Reconstruction& r : render::reconstructions()) {
        names.emplace_back(r.name);
        help += fmt::format("{}{} ({})", help.empty() ? "" : ", ", r.name, r.summary);
    }
    if (hasReference) {
        names.emplace_back("reference");
        help += ", or reference (traced full detail)";
    }
    sub.add_option("--mode", mode, help)->check(oneOf(names))->capture_default_str();
    sub.add_option("--lowpass", lowPass,
                   "of mode ewa: variance of the pixel's Gaussian, 0.25 to 4 px^2 (0.25 is sharper, and flickers more)")
        ->transform(within(0.25, 4.0))
        ->capture_default_str();
    sub.add_option(
           "--kernel", kernel,
           "of mode ewa: where the discs' Gaussians end, in standard deviations: 2, or 3 (even smoother, slower)")
        ->check(CLI::Validator(
            [](const std::string& text) {
                return text == "2" || text == "3" ? std::string() : fmt::format("'{}' is neither 2 nor 3", text);
            },
            "2|3"))
        ->capture_default_str();
    sub.add_option("--patch-as", patchAs,
                   "elevation patches as strips (triangles), splats (cells that rays meet), samples (points of the "
                   "mode), or auto: strips")
        ->check(oneOf({"strips", "splats", "samples", "auto"}))
        ->capture_default_str();
    sub.add_option("--interpolate", interpolate,
                   "of patches as splats: correct (on the cell's triangles), or direct (below the discs of samples, "
                   "which jumps where they meet)")
        ->check(oneOf({"correct", "direct"}))
        ->capture_default_str();
    sub.add_option(
           "--hidden", hidden,
           "points behind others that hide all of their node: skip (the picture is the same, to the bit; within "
           "a budget they are not refined, either, and the rest is finer), or draw")
        ->check(oneOf({"skip", "draw"}))
        ->capture_default_str();
    sub.add_option(
           "--refract", refract,
           "what is seen through glass: environment (what is all around), screen (also what is behind it on the "
           "picture), object (bent twice; where that cannot be: screen)")
        ->check(oneOf({"environment", "screen", "object"}))
        ->capture_default_str();
    sub.add_option("--opacity", opacity,
                   "of everything: below 1 what is behind each body shows through it (0 to 1; materials that are "
                   "transparent are, without it)")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
}

void ModeOptions::addNormaliseTo(CLI::App& sub) {
    sub.add_option("--normalise", normalise,
                   "of mode ewa: pixel (each is divided by what its weights add up to) or surfel (by weights of "
                   "surfels: stipple build --surfel-weights)")
        ->check(oneOf({"pixel", "surfel"}))
        ->capture_default_str();
}

void ModeOptions::applyTo(render::FrameSettings& settings) const {
    if (const render::Reconstruction* of = render::reconstructionNamed(mode)) settings.mode = of->mode;
    settings.draw.lowPass = static_cast<float>(lowPass);
    settings.draw.kernelSupport = static_cast<float>(kernel);
    settings.draw.refract = refract == "object"   ? shared::kRefractObject
                            : refract == "screen" ? shared::kRefractScreen
                                                  : shared::kRefractEnvironment;
    settings.draw.opacity = static_cast<float>(opacity);
    settings.mayHideNodes = settings.leavesHiddenCoarse = hidden == "skip";
    settings.draw.perSurfel = normalise == "surfel";
    settings.draw.patchAs = patchAs == "samples"      ? lod::kPatchesAsSamples
                            : patchAs != "splats"     ? shared::kPatchStrips
                            : interpolate == "direct" ? shared::kPatchDirect
                                                      : shared::kPatchSplats;
}

void ModeOptions::applyTo(std::vector<render::PlacedStore>& placed) const {
    for (render::PlacedStore& p : placed) p.patchesAreSamples = patchAs == "samples";
}

Result<void> checkOfMode(const CLI::App& sub, const std::string& mode) {
    for (const OnlyOf& row : kOnlyOf) {
        const CLI::Option* const option = sub.get_option_no_throw(row.option);
        if (option == nullptr || option->count() == 0 || row.uses(mode)) continue;
        return fail(ErrorKind::usage, fmt::format("does nothing in mode {}: {}", mode, row.why), row.option,
                    fmt::format("leave {} out, or choose another --mode", row.option));
    }
    const CLI::Option *const interpolated = sub.get_option_no_throw("--interpolate"), *const drawnAs =
                                                                                          sub.get_option_no_throw(
                                                                                              "--patch-as");
    if (interpolated != nullptr && interpolated->count() > 0 && drawnAs->as<std::string>() != "splats")
        return fail(ErrorKind::usage, "is of patches that are drawn as splats", "--interpolate",
                    "give --patch-as splats, too");
    return {};
}

}  // namespace stipple::app
