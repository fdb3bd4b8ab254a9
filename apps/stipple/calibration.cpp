#include "apps/stipple/calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/stipple/options.h"
#include "apps/study/calibration/curve.h"
#include "apps/study/machine.h"
#include "apps/study/statistics/intervals.h"
#include "apps/study/sweep/scene_drawer.h"
#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/scene/open/cache_folder.h"

namespace stipple::app {
namespace {

namespace fs = std::filesystem;

/// Of a scene on this machine: the program's version counts, too.
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

void printTable(const study::Curve& curve, const std::string& scene, const std::string& path) {
    fmt::print("{} on {}\n{:>16} {:>11} {:>8} {:>9} {:>9} {:>9} {:>9}\n", scene, curve.device, "mode", "size", "px",
               "ms", "to", "records", "triangles");
    const auto& all = curve.samples;
    for (size_t i = 0; i < all.size();) {
        std::vector<double> ms;
        double records = 0, triangles = 0;
        size_t end = i;
        for (; end < all.size() && all[end].mode == all[i].mode && all[end].height == all[i].height &&
               all[end].width == all[i].width && all[end].errorPixels == all[i].errorPixels;
             ++end) {
            ms.push_back(all[end].ms);
            records += all[end].records;
            triangles += all[end].triangles;
        }
        const auto count = static_cast<double>(ms.size());
        fmt::print("{:>16} {:>11} {:>8g} {:>9.2f} {:>9.2f} {:>9.0f} {:>9.0f}\n", all[i].mode,
                   fmt::format("{}x{}", all[i].width, all[i].height), all[i].errorPixels, study::quantile(ms, 0.5),
                   *std::max_element(ms.begin(), ms.end()), records / count, triangles / count);
        i = end;
    }
    fmt::print("kept as {}\n", path);
}

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

Result<void> calibrate(const study::StudyScene& scene, const study::StudySettings& settings,
                       std::unique_ptr<render::Backend> backend, Executor& executor, bool isJson,
                       const std::function<Result<void>(uint64_t done, uint64_t total)>& say) {
    study::Curve curve = curveHere(scene.hash, nameOf(*backend), executor.threads());
    study::SceneDrawer drawer(scene, std::move(backend), executor, settings.residentBytes);
    std::vector<study::Cell> cells;
    for (const render::Mode mode : settings.modes)
        for (uint32_t size = 0; size < settings.sizes.size(); ++size)
            for (const double target : settings.targets)
                for (uint32_t view = 0; view < scene.views.size(); ++view)
                    cells.push_back({0, size, view, mode, target});
    std::vector<std::vector<double>> ms(cells.size());
    curve.samples.resize(cells.size());
    uint64_t done = 0;
    for (uint32_t block = 0; block < settings.blocks; ++block)
        for (const uint32_t c : study::orderOf(cells.size(), block, settings.seed)) {
            STIPPLE_TRY(say(done++, uint64_t{settings.blocks} * cells.size()));
            const study::Cell& cell = cells[c];
            const glm::uvec2 size = settings.sizes[cell.size];
            const lod::View view = study::viewOf(scene, size, cell.view);
            STIPPLE_TRY(drawer.warm(view, cell.mode, cell.target));
            for (uint32_t f = 0; f < settings.frames; ++f) {
                STIPPLE_TRY(drawer.again(view, cell.mode, cell.target));
                ms[c].push_back(drawer.counters().frameMs);
            }
            curve.samples[c] = {render::reconstructionOf(cell.mode).name,
                                size.x,
                                size.y,
                                cell.target,
                                static_cast<double>(drawer.counters().recordsDrawn),
                                static_cast<double>(drawer.counters().trianglesDrawn),
                                study::quantile(ms[c], 0.5)};
        }
    const std::string path = pathOf(curve);
    std::error_code error;
    fs::create_directories(fs::path(path).parent_path(), error);
    const nlohmann::json json = study::jsonOfCurve(curve);
    const std::string text = json.dump(1) + "\n";
    STIPPLE_TRY(writeWholeFile(path, text.data(), text.size()));
    if (isJson)
        printJson("calibration", json);
    else
        printTable(curve, scene.name, path);
    return {};
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
