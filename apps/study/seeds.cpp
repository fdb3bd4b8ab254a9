// The straight line of `stipple study --seeds`: models, figures, outlines, pinholes, then what is written of them.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "apps/study/papers.h"
#include "apps/study/study.h"
#include "engine/base/process.h"
#include "engine/reference/reference.h"
#include "lod/builder/build_version.h"

namespace stipple::study {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kQuickPoints = 300'000;

/// Names of devices to be timed: the cpu, and a real gpu if there is one.
Result<std::vector<std::string>> devicesOf(const Host& host) {
    std::vector<std::string> devices{"cpu"};
    STIPPLE_ASSIGN(const auto best, host.backend("auto"));
    if (best->name() == "gpu") devices.emplace_back("auto");
    return devices;
}

Result<StorePtr> storeOf(const ModelRow& row, const std::string& data, const std::string& folder, Executor& executor) {
    if (row.file[0] == '\0') return pointStore(checkerPlane(253, 8), folder + "/checker_64009.stipple", executor);
    STIPPLE_ASSIGN(const Surface surface, readSurface(data + "/" + row.file, folder));
    const std::string name = fs::path(row.file).stem().string();
    return surfelStore(surface, row.points, fmt::format("{}/{}_{}.stipple", folder, name, row.points), executor);
}

lod::View viewOf(const ModelRow& row, const lod::Store& store, uint32_t size) {
    if (row.file[0] == '\0') return viewFrom({0, -1.02, 0.25}, {0, 0, -0.12}, {0, 0, 1}, size, size);
    return fittedView(store, size, size);
}

Result<void> measureTimes(const ModelRow& row, const StorePtr& store, const SeedsReport& report, const Host& host,
                          ModelMeasure& out) {
    const bool isLit = row.file[0] != '\0';
    for (const std::string& device : report.devices) {
        STIPPLE_ASSIGN(auto backend, host.backend(device));
        Drawer drawer(store, std::move(backend), host.executor);
        for (const uint32_t size : row.sizes) {
            const lod::View view = viewOf(row, *store, size);
            STIPPLE_ASSIGN(const auto leaves, timeModes(drawer, view, kLeaves, isLit, report.settings.rounds));
            STIPPLE_ASSIGN(const auto pixel, timeModes(drawer, view, 1, isLit, report.settings.rounds));
            SizeMeasure s{device, size, {}};
            for (const render::Reconstruction& r : render::reconstructions())
                s.modes.push_back({r.mode, leaves.at(r.mode), pixel.at(r.mode)});
            out.sizes.push_back(std::move(s));
        }
    }
    return {};
}

Result<void> measureModelErrors(const ModelRow& row, const StorePtr& store, const Host& host, ModelMeasure& out) {
    const bool isLit = row.file[0] != '\0';
    const lod::View view = viewOf(row, *store, out.errorSize);
    STIPPLE_ASSIGN(auto backend, host.backend("cpu"));
    Drawer drawer(store, std::move(backend), host.executor);
    Drawer oracle(store, reference::makeReferenceBackend(host.executor), host.executor);
    STIPPLE_ASSIGN(const render::Image traced, traceStore(store, view, isLit, 4, host.executor));
    for (const render::Reconstruction& r : render::reconstructions()) {
        STIPPLE_ASSIGN(const Errors errors, measureErrors({drawer, oracle, traced}, view, r.mode, isLit));
        out.errors[r.mode] = errors;
    }
    return {};
}

Result<ModelMeasure> measureModel(size_t index, const SeedsReport& report, const std::string& folder,
                                  const Host& host) {
    const ModelRow& row = modelRows()[index];
    STIPPLE_ASSIGN(const StorePtr store, storeOf(row, report.settings.dataFolder, folder, host.executor));
    ModelMeasure out;
    out.row = index;
    out.points = store->description.points;
    out.errorSize = report.settings.isQuick ? 192 : 384;
    STIPPLE_TRY(measureTimes(row, store, report, host, out));
    STIPPLE_TRY(measureModelErrors(row, store, host, out));
    return out;
}

Result<void> measureStatue(const std::string& folder, const Host& host, SeedsReport& report) {
    const auto statue = readSurface(report.settings.dataFolder + "/01_meshes/misc/lucy.ply", folder);
    if (!statue) {
        report.missing.push_back("outlines: " + statue.error().line());
        return {};
    }
    OutlineSettings settings;
    settings.folder = folder;
    if (report.settings.isQuick) {
        settings.size = 400;
        settings.azimuths = {20};
    }
    report.outlineSize = settings.size;
    STIPPLE_ASSIGN(report.outlines, measureOutlines(
                                        *statue, settings, [&] { return host.backend("cpu"); }, host.executor));
    return {};
}

Result<void> measurePinholes(const std::string& folder, const Host& host, SeedsReport& report) {
    report.pinholePoses = report.settings.isQuick ? 300 : 10'000;
    STIPPLE_ASSIGN(const StorePtr store, pointStore(unitSphere(9'858), folder + "/sphere_9858.stipple", host.executor));
    STIPPLE_ASSIGN(auto backend, host.backend("cpu"));
    Drawer drawer(store, std::move(backend), host.executor);
    STIPPLE_ASSIGN(report.pinholes, countPinholes(drawer, report.pinholePoses, 64));
    return {};
}

Result<void> writeText(const std::string& path, const std::string& text) {
    std::ofstream out(path, std::ios::binary);
    out << text;
    out.close();
    if (!out) return fail(ErrorKind::output, "cannot be written", path);
    return {};
}

}  // namespace

Result<SeedsReport> studySeeds(const SeedsSettings& settings, const Host& host) {
    const double start = nowSeconds();
    SeedsReport report;
    report.settings = settings;
    report.machine = machineNow(host.executor.threads());
    std::error_code error;
    if (!settings.dataFolder.empty() && !fs::is_directory(settings.dataFolder, error))
        return fail(ErrorKind::input, "is no folder", settings.dataFolder,
                    "name the folder of the models, or leave --data out");
    // What an older build has made is not measured as if it were this one's.
    const std::string folder = fmt::format("{}/models-{}", settings.output, lod::kBuildVersion);
    fs::create_directories(folder, error);
    if (error) return fail(ErrorKind::output, "cannot be made: " + error.message(), folder, "choose another --output");
    STIPPLE_ASSIGN(report.devices, devicesOf(host));
    const size_t rows = modelRows().size(), steps = rows + 15 + patchRows().size();
    for (size_t i = 0; i < rows; ++i) {
        STIPPLE_TRY(host.say(modelRows()[i].model, i, steps));
        if (settings.isQuick && modelRows()[i].points > kQuickPoints) continue;
        auto measured = measureModel(i, report, folder, host);
        if (measured)
            report.models.push_back(std::move(*measured));
        else if (measured.error().kind == ErrorKind::input)
            report.missing.push_back(std::string(modelRows()[i].model) + ": " + measured.error().line());
        else
            return tl::unexpected(measured.error());
    }
    size_t step = rows;
    const FigureTools tools{settings.dataFolder,
                            folder,
                            settings.isQuick,
                            host.executor,
                            [&] { return host.backend("cpu"); },
                            [&](const std::string& what) { return host.say(what, step++, steps); }};
    STIPPLE_ASSIGN(report.figures, drawFigures(tools, report.missing));
    const PatchTools patches{settings.dataFolder,
                             folder,
                             settings.isQuick,
                             settings.rounds,
                             host.executor,
                             [&] { return host.backend("cpu"); },
                             [&](const std::string& what) { return host.say(what, step++, steps); }};
    STIPPLE_ASSIGN(report.patches, measurePatches(patches, report.missing));
    STIPPLE_TRY(host.say("outlines", steps - 2, steps));
    STIPPLE_TRY(measureStatue(folder, host, report));
    STIPPLE_TRY(host.say("pinholes", steps - 1, steps));
    STIPPLE_TRY(measurePinholes(folder, host, report));
    report.seconds = nowSeconds() - start;
    STIPPLE_TRY(writeText(settings.output + "/index.md", describeSeeds(report)));
    STIPPLE_TRY(writeText(settings.output + "/seeds.json", jsonOfSeeds(report).dump(2) + "\n"));
    return report;
}

}  // namespace stipple::study
