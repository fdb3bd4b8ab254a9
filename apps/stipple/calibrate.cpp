#include "apps/stipple/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/calibration.h"
#include "apps/study/statistics/intervals.h"
#include "apps/study/sweep/scene_drawer.h"
#include "engine/base/file.h"

namespace stipple::app {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

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

}  // namespace stipple::app
