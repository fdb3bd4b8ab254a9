#include "apps/study/sweep/runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "apps/study/statistics/intervals.h"
#include "apps/study/sweep/shadow_errors.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"

namespace stipple::study {
namespace {

/// All that a run walks through.
struct Run {
    const std::vector<StudyScene>& scenes;
    const Host& host;
    const std::string& device;
    StudyResult& result;
    std::vector<std::unique_ptr<SceneDrawer>> drawers;  ///< by scene
    std::vector<uint8_t> isMeasured;                    ///< cells whose errors are there
    std::unique_ptr<reference::FullScene> full{};       ///< of scene fullOf, for rays
    uint32_t fullOf = 0;

    Result<SceneDrawer*> drawerOf(uint32_t scene) {
        if (!drawers[scene]) {
            STIPPLE_ASSIGN(auto backend, host.backend(device));
            drawers[scene] = std::make_unique<SceneDrawer>(scenes[scene], std::move(backend), host.executor,
                                                           result.settings.residentBytes / scenes.size());
        }
        return drawers[scene].get();
    }
};

CsvRow errorHead() {
    CsvRow head{"cell"};
    for (const ErrorColumn& c : errorColumns()) head.emplace_back(c.name);
    return head;
}

CsvRow rowOf(uint32_t cell, const CellErrors& errors) {
    CsvRow row{std::to_string(cell)};
    for (const ErrorColumn& c : errorColumns()) row.push_back(csvNumber(errors.*c.value));
    return row;
}

uint32_t indexOf(const std::string& text) { return static_cast<uint32_t>(std::strtoul(text.c_str(), nullptr, 10)); }

/// The full detail of a scene, if it is not too much; why not is noted.
std::optional<FullDetail> fullDetailOf(Run& run, uint32_t scene) {
    const StudyScene& s = run.scenes[scene];
    auto shapes = leavesOf(s.placed, run.result.settings.auditShapes, s.against.empty());
    if (shapes) {
        shapes->triangles.insert(shapes->triangles.end(), s.against.begin(), s.against.end());
        return FullDetail(std::move(*shapes));
    }
    run.result.notes.push_back(fmt::format("{}: distances from the full detail were not measured: {} {}", s.name,
                                           shapes.error().where, shapes.error().what));
    return {};
}

/// Views come scene by scene.
Result<const reference::FullScene*> fullSceneOf(Run& run, uint32_t scene) {
    if (!run.full || run.fullOf != scene) {
        run.full.reset();
        STIPPLE_ASSIGN(run.full, reference::readFullScene(run.scenes[scene].placed, run.host.executor));
        run.fullOf = scene;
    }
    return run.full.get();
}

Result<render::Image> traced(Run& run, uint32_t scene, const lod::View& view, uint32_t samples) {
    STIPPLE_ASSIGN(const reference::FullScene* const full, fullSceneOf(run, scene));
    return full->trace(view, {samples, run.scenes[scene].draw}, run.host.executor);
}

/// Whether truths are true: once for each scene and size.
Result<void> checkTruth(Run& run, Journal& truths, const Cell& cell, const ViewTruth& truth) {
    for (const TruthCheck& t : run.result.truths)
        if (t.scene == cell.scene && t.size == cell.size) return {};
    STIPPLE_ASSIGN(const render::Image twice, traced(run, cell.scene, truth.view, 2 * run.result.settings.samples));
    STIPPLE_ASSIGN(const auto difference, reference::compareImages(truth.traced, twice, 4, nullptr));
    run.result.truths.push_back({cell.scene, cell.size, difference.foregroundPsnr});
    return truths.append(
        {{std::to_string(cell.scene), std::to_string(cell.size), csvNumber(difference.foregroundPsnr)}});
}

/// All cells of one view, of which `first` is the first.
Result<void> measureView(Run& run, uint32_t first, const FullDetail* full, SceneDrawer& oracle, Journal& journal,
                         Journal& truths) {
    const StudySettings& s = run.result.settings;
    const std::vector<Cell>& cells = run.result.cells;
    const auto count = static_cast<uint32_t>(cellsOfView(s));
    const Cell& at = cells[first];
    const StudyScene& scene = run.scenes[at.scene];
    ViewTruth truth;
    truth.view = viewOf(scene, s.sizes[at.size], at.view);
    truth.small = smallViewOf(scene, s.sizes[at.size], at.view, s.smallHeight);
    truth.moved = turnedBy(truth.view, kFlickerPixels);
    STIPPLE_ASSIGN(truth.traced, traced(run, at.scene, truth.view, s.samples));
    STIPPLE_ASSIGN(truth.tracedMoved, traced(run, at.scene, truth.moved, s.samples));
    STIPPLE_TRY(checkTruth(run, truths, at, truth));
    STIPPLE_ASSIGN(SceneDrawer* const drawer, run.drawerOf(at.scene));
    const bool isFirst = scene.views[at.view].number == 0 && at.size == 0;
    if (isFirst) {
        STIPPLE_ASSIGN(const reference::FullScene* const detail, fullSceneOf(run, at.scene));
        STIPPLE_ASSIGN(truth.light, lightTruthOf(scene.draw, *detail, truth.view, run.host.executor));
    }
    const CellTools tools{*drawer, isFirst ? &oracle : nullptr, full, run.host.executor, truth};
    render::Image leaves;
    for (uint32_t c = first; c < first + count; ++c) {
        if (c == first || cells[c].mode != cells[c - 1].mode) {
            STIPPLE_ASSIGN(const render::Image* drawn, drawer->draw(truth.view, cells[c].mode, kLeaves));
            leaves = *drawn;
        }
        if (run.isMeasured[c]) continue;
        STIPPLE_TRY(run.host.say("errors", c, cells.size()));
        KeepCrop keep;
        const bool isLookedAt = cells[c].target == cropTarget(s) && !cells[c].hasBudget();
        if (isLookedAt)
            keep = [&](const render::Image& crop) { return image::writeImage(s.output + "/" + cropName(c), crop); };
        STIPPLE_ASSIGN(run.result.errors[c], measureCell(tools, cells[c], leaves, keep));
        if (isLookedAt && truth.light)
            STIPPLE_TRY(auditShadowsOf(*drawer, *truth.light, truth.view, cells[c], run.result.errors[c]));
        STIPPLE_TRY(journal.append({rowOf(c, run.result.errors[c])}));
        run.isMeasured[c] = 1;
    }
    return {};
}

Result<void> measureErrorsOfAll(Run& run) {
    StudyResult& result = run.result;
    const uint64_t cells = result.cells.size();
    STIPPLE_ASSIGN(Journal journal, Journal::open(result.settings.output + "/errors.csv", errorHead(),
                                                  [&](const CsvRow& row) { return indexOf(row[0]) < cells; }));
    STIPPLE_ASSIGN(Journal truths,
                   Journal::open(result.settings.output + "/truths.csv", {"scene", "size", "doubled_db"}));
    for (const CsvRow& row : truths.rows())
        result.truths.push_back({indexOf(row[0]), indexOf(row[1]), numberOf(row[2])});
    for (const CsvRow& row : journal.rows()) {
        const uint32_t cell = indexOf(row[0]);
        for (size_t k = 0; k < errorColumns().size(); ++k)
            result.errors[cell].*errorColumns()[k].value = numberOf(row[k + 1]);
        run.isMeasured[cell] = 1;
    }
    const auto perView = static_cast<uint32_t>(cellsOfView(result.settings));
    std::optional<FullDetail> full;
    std::unique_ptr<SceneDrawer> oracle;
    uint32_t of = ~0u;
    for (uint32_t first = 0; first < cells; first += perView) {
        const Cell& cell = result.cells[first];
        const bool isDone = std::all_of(run.isMeasured.begin() + first, run.isMeasured.begin() + first + perView,
                                        [](uint8_t is) { return is != 0; });
        if (of != cell.scene) {
            of = cell.scene;
            full.reset();
            run.full.reset();
            full = fullDetailOf(run, of);
            oracle = std::make_unique<SceneDrawer>(run.scenes[of], reference::makeReferenceBackend(run.host.executor),
                                                   run.host.executor, result.settings.residentBytes);
        }
        if (isDone) continue;
        STIPPLE_TRY(run.host.say("errors", first, cells));
        STIPPLE_TRY(measureView(run, first, full ? &*full : nullptr, *oracle, journal, truths));
    }
    run.full.reset();
    return {};
}

/// Frames of a cell, everything being there, and the medians of their passes.
Result<Visit> visit(Run& run, uint32_t index, uint32_t block) {
    const Cell& cell = run.result.cells[index];
    const StudySettings& s = run.result.settings;
    STIPPLE_ASSIGN(SceneDrawer* const drawer, run.drawerOf(cell.scene));
    const lod::View view = viewOf(run.scenes[cell.scene], s.sizes[cell.size], cell.view);
    STIPPLE_TRY(drawer->warm(view, cell.mode, cell.target, cell.records));
    Visit v{index, block, {}, {}};
    std::vector<std::pair<std::string, std::vector<double>>> passes;
    for (uint32_t f = 0; f < s.frames; ++f) {
        STIPPLE_TRY(drawer->again(view, cell.mode, cell.target, cell.records));
        v.ms.push_back(drawer->counters().frameMs);
        const auto add = [&](const std::string& name, double ms) {
            const auto at = std::find_if(passes.begin(), passes.end(), [&](const auto& p) { return p.first == name; });
            (at == passes.end() ? passes.emplace_back(name, std::vector<double>()) : *at).second.push_back(ms);
        };
        add("cut", drawer->counters().cutMs);
        for (const render::PassTime& p : drawer->passes()) add(csvName(p.name), p.ms);
    }
    for (auto& [name, ms] : passes) v.passes.emplace_back(name, quantile(ms, 0.5));
    return v;
}

/// What journals have of visits that were finished: all frames are there.
void readVisits(const Journal& times, const Journal& passes, StudyResult& result) {
    std::map<std::pair<uint32_t, uint32_t>, size_t> found;
    for (const CsvRow& row : times.rows()) {
        const auto key = std::pair(indexOf(row[0]), indexOf(row[1]));
        if (!found.count(key)) {
            found[key] = result.visits.size();
            result.visits.push_back({key.second, key.first, {}, {}});
        }
        result.visits[found[key]].ms.push_back(numberOf(row[3]));
    }
    for (const CsvRow& row : passes.rows())
        if (const auto at = found.find({indexOf(row[0]), indexOf(row[1])}); at != found.end())
            result.visits[at->second].passes.emplace_back(row[2], numberOf(row[3]));
}

Result<void> measureTimesOfAll(Run& run) {
    StudyResult& result = run.result;
    const StudySettings& s = result.settings;
    const std::string folder = s.output;
    // A visit's passes are written first and its frames in one piece after them: a visit whose last frame is there is
    // whole, and all others are taken out.
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> frames;
    const CsvRow head{"block", "cell", "frame", "ms"}, passHead{"block", "cell", "pass", "ms"};
    {
        STIPPLE_ASSIGN(const Journal all, Journal::open(folder + "/times.csv", head));
        for (const CsvRow& row : all.rows()) ++frames[{indexOf(row[0]), indexOf(row[1])}];
    }
    const auto isWhole = [&](const CsvRow& row) {
        const auto at = frames.find({indexOf(row[0]), indexOf(row[1])});
        return at != frames.end() && at->second == s.frames && indexOf(row[1]) < result.cells.size();
    };
    STIPPLE_ASSIGN(Journal times, Journal::open(folder + "/times.csv", head, isWhole));
    STIPPLE_ASSIGN(Journal passes, Journal::open(folder + "/passes.csv", passHead, isWhole));
    readVisits(times, passes, result);
    const uint64_t visits = result.cells.size() * s.blocks;
    uint64_t done = 0;
    for (uint32_t block = 0; block < s.blocks; ++block)
        for (const uint32_t cell : orderOf(result.cells.size(), block, s.seed)) {
            STIPPLE_TRY(run.host.say("times", done++, visits));
            if (const auto at = frames.find({block, cell}); at != frames.end() && at->second == s.frames) continue;
            STIPPLE_ASSIGN(const Visit v, visit(run, cell, block));
            std::vector<CsvRow> ofFrames, ofPasses;
            for (size_t f = 0; f < v.ms.size(); ++f)
                ofFrames.push_back(
                    {std::to_string(block), std::to_string(cell), std::to_string(f), csvNumber(v.ms[f])});
            for (const auto& [name, ms] : v.passes)
                ofPasses.push_back({std::to_string(block), std::to_string(cell), name, csvNumber(ms)});
            STIPPLE_TRY(passes.append(ofPasses));
            STIPPLE_TRY(times.append(ofFrames));
            result.visits.push_back(v);
        }
    return {};
}

/// What stores keep of the files that they were built from.
Result<void> auditOriginalsOfAll(Run& run) {
    for (uint32_t scene = 0; scene < run.scenes.size(); ++scene) {
        const StudyScene& s = run.scenes[scene];
        if (s.source.empty() || s.placed.size() != 1) continue;
        STIPPLE_TRY(run.host.say("originals", scene, run.scenes.size()));
        const auto originals = readOriginals(s.source, run.result.settings.auditShapes);
        if (!originals) {
            run.result.notes.push_back(
                fmt::format("{}: points were not held against their file: {}", s.name, originals.error().line()));
            continue;
        }
        STIPPLE_ASSIGN(const KeptAudit audit, auditOriginals(*originals, *s.placed[0].store));
        run.result.kept.push_back({scene, audit});
    }
    return {};
}

/// Of every scene, at the first size, in the first mode.
Result<void> measureArrivalsOfAll(Run& run) {
    StudyResult& result = run.result;
    const StudySettings& s = result.settings;
    STIPPLE_ASSIGN(Journal journal, Journal::open(s.output + "/arrivals.csv", arrivalHead()));
    for (const CsvRow& row : journal.rows()) result.arrivals.push_back(arrivalOf(row));
    for (uint32_t scene = 0; scene < run.scenes.size(); ++scene) {
        STIPPLE_TRY(run.host.say("arrivals", scene, run.scenes.size()));
        const bool isDone = std::any_of(result.arrivals.begin(), result.arrivals.end(),
                                        [&](const ArrivalStep& step) { return step.scene == scene; });
        if (isDone) continue;
        STIPPLE_ASSIGN(SceneDrawer* const complete, run.drawerOf(scene));
        STIPPLE_ASSIGN(auto backend, run.host.backend(run.device));
        SceneDrawer fresh(run.scenes[scene], std::move(backend), run.host.executor, s.residentBytes);
        STIPPLE_ASSIGN(const auto steps, measureArrivals(scene, run.scenes[scene], s.sizes.front(), s.modes.front(),
                                                         cropTarget(s), fresh, *complete));
        std::vector<CsvRow> rows;
        for (const ArrivalStep& step : steps) rows.push_back(arrivalRow(step));
        STIPPLE_TRY(journal.append(rows));
        result.arrivals.insert(result.arrivals.end(), steps.begin(), steps.end());
    }
    return {};
}

}  // namespace

Result<StudyResult> runStudy(const std::vector<StudyScene>& scenes, const StudySettings& settings,
                             const Provenance& provenance, const std::string& device, const Host& host) {
    StudyResult result;
    result.settings = settings;
    result.provenance = provenance;
    result.cells = cellsOf(scenes, settings);
    result.errors.resize(result.cells.size());
    Run run{scenes, host, device, result, {}, std::vector<uint8_t>(result.cells.size(), 0)};
    run.drawers.resize(scenes.size());
    STIPPLE_TRY(auditOriginalsOfAll(run));
    STIPPLE_TRY(measureErrorsOfAll(run));
    STIPPLE_TRY(measureTimesOfAll(run));
    STIPPLE_TRY(measureArrivalsOfAll(run));
    return result;
}

}  // namespace stipple::study
