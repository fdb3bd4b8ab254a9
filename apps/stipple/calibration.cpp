#include "apps/stipple/calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "apps/stipple/options.h"
#include "apps/study/machine.h"
#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/scene/open/cache_folder.h"

namespace stipple::app {
namespace {

/// Of the most expensive of some views.
study::Load loadAt(const CutLoads& of, const std::vector<std::vector<uint8_t>>& all, lod::CutScratch& scratch,
                   const study::CostModel& model, double errorPixels) {
    constexpr size_t kViews = 24;
    const size_t stride = std::max<size_t>(1, of.views.size() / kViews);
    study::Load worst;
    for (size_t i = 0; i < of.views.size(); i += stride) {
        lod::Budgets budgets = of.budgets;
        budgets.errorPixels = errorPixels;
        lod::Cut cut;
        lod::selectCut(of.state.scene(), {all}, of.views[i], budgets, scratch, cut);
        const study::Load load{static_cast<double>(of.views[i].width) * of.views[i].height,
                               static_cast<double>(cut.counters.recordsDrawn),
                               static_cast<double>(cut.counters.trianglesDrawn)};
        if (i == 0 || model.msOf(load) > model.msOf(worst)) worst = load;
    }
    return worst;
}

Result<study::CostModel> modelHere(const std::string& mode, uint64_t scene, const std::string& device, int threads) {
    const std::string path = pathOf(curveHere(scene, device, threads));
    std::ifstream in(path, std::ios::binary);
    if (!in)
        return fail(
            ErrorKind::input, "is not known of this scene on " + device, "what a frame costs",
            fmt::format("run once: stipple study SCENE --calibrate --modes {} (with the same --device; {} threads)",
                        mode, threads));
    std::stringstream text;
    text << in.rdbuf();
    STIPPLE_ASSIGN(const study::Curve curve, study::curveOf(text.str(), path));
    const auto samples = curve.of(mode);
    if (samples.empty())
        return fail(ErrorKind::input, "has no frames in this mode", "the calibration",
                    "run: stipple study SCENE --calibrate --modes " + mode);
    return study::fitCost(samples);
}

}  // namespace

study::Curve curveHere(uint64_t scene, const std::string& device, int threads) {
    const study::Machine machine = study::machineNow(threads);
    return {hexDigits(scene), device, machine.processor, machine.date, STIPPLE_VERSION, threads, {}};
}
std::string pathOf(const study::Curve& curve) {
    const std::string key =
        fmt::format("{}\n{}\n{}\n{}\n{}", curve.scene, curve.device, curve.processor, curve.version, curve.threads);
    return fmt::format("{}/curves/{}.json", scene::CacheFolder::path(), hexDigits(hashBytes(key.data(), key.size())));
}

std::string nameOf(const render::Backend& backend) { return fmt::format("{}, {}", backend.name(), backend.device()); }

void TargetOptions::addTo(CLI::App& sub) {
    auto* const asked = sub.get_option("--error");
    auto* const byError =
        sub.add_option("--target-error", error,
                       "as --error, and says what frames take here (stipple study SCENE --calibrate, once)")
            ->type_name("PX")
            ->excludes(asked)
            ->transform(CLI::Range(0.01, 1000.0));
    sub.add_option("--target-ms", ms, "the smallest error whose frames take no longer, by the same calibration")
        ->type_name("MS")
        ->excludes(asked)
        ->excludes(byError)
        ->transform(CLI::Range(0.1, 100000.0));
}

uint64_t sceneHash(const OpenedScene& opened) {
    uint64_t hash = opened.placed.size();
    const auto add = [&](const auto& value) { hash = hashBytes(&value, sizeof value, hash); };
    for (const render::PlacedStore& p : opened.placed) {
        add(p.store->contentHash);
        add(p.place.rotation);
        add(p.place.translation);
        add(p.place.scale);
    }
    return hash;
}

Result<Chosen> chooseError(const TargetOptions& target, const CutLoads& loads, const std::string& mode, uint64_t scene,
                           const Executor& executor) {
    STIPPLE_ASSIGN(const study::CostModel model,
                   modelHere(mode, scene, nameOf(*loads.state.backend), executor.threads()));
    std::vector<std::vector<uint8_t>> all(loads.state.streamer->residency().drawable.begin(),
                                          loads.state.streamer->residency().drawable.end());
    for (auto& chunks : all) std::fill(chunks.begin(), chunks.end(), uint8_t{1});
    lod::CutScratch scratch;
    const study::LoadAt load = [&](double px) { return loadAt(loads, all, scratch, model, px); };
    Chosen chosen{target.error, 0, ""};
    if (target.ms > 0) {
        const auto error = study::errorWithin(model, load, target.ms);
        if (!error)
            return fail(ErrorKind::budget,
                        fmt::format("is too short: by the calibration a frame takes {:.1f} ms at {:g} px of error",
                                    model.msOf(load(study::kCoarsestPixels)), study::kCoarsestPixels),
                        fmt::format("--target-ms {:g}", target.ms), "a smaller --size, or another --mode");
        chosen.errorPixels = *error;
    }
    chosen.ms = model.msOf(load(chosen.errorPixels));
    chosen.text = fmt::format(
        "{:.3g} px of error: {:.1f} ms a frame by the calibration ({:.1f} to {:.1f} for nine in ten of "
        "its frames)",
        chosen.errorPixels, chosen.ms, chosen.ms * model.low, chosen.ms * model.high);
    return chosen;
}

}  // namespace stipple::app
