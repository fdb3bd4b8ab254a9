#include "apps/study/sweep/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "apps/study/mode_name.h"
#include "apps/study/plots/svg.h"
#include "apps/study/plots/vega.h"
#include "engine/base/hash.h"

namespace stipple::study {
namespace {

using nlohmann::json;

json numberJson(double v) {
    if (std::isfinite(v)) return v;
    return std::isnan(v) ? json() : json(v > 0 ? "inf" : "-inf");
}
json intervalJson(const Interval& i) { return {{"low", i.low}, {"median", i.middle}, {"high", i.high}}; }

Result<void> writeText(const std::string& path, const std::string& text) {
    std::ofstream out(path, std::ios::binary);
    out << text;
    out.close();
    if (!out) return fail(ErrorKind::output, "cannot be written", path);
    return {};
}

json errorsJson(const CellErrors& e) {
    json out;
    for (const ErrorColumn& c : errorColumns()) out[c.name] = numberJson(e.*c.value);
    return out;
}

json provenanceJson(const Provenance& p) {
    return {{"version", p.version},   {"compiler", p.compiler},           {"flags", p.flags},
            {"program", p.program},   {"processor", p.machine.processor}, {"threads", p.machine.threads},
            {"load", p.machine.load}, {"date", p.machine.date},           {"device", p.device}};
}

json originalsJson(const std::vector<StudyScene>& scenes, const StudyResult& result) {
    json out = json::array();
    for (const KeptOf& k : result.kept)
        out.push_back({{"scene", scenes[k.scene].name},
                       {"points", k.audit.points},
                       {"records", k.audit.records},
                       {"places_beyond", k.audit.placeBeyond},
                       {"rounding", k.audit.worstRounding},
                       {"rounding_stated", k.audit.statedRounding},
                       {"normals", k.audit.normals},
                       {"normals_beyond", k.audit.normalBeyond},
                       {"normal_deg_most", k.audit.worstNormal},
                       {"normal_deg_stated", kNormalDegrees},
                       {"colours", k.audit.colours},
                       {"colours_beyond", k.audit.colourBeyond}});
    return out;
}

json arrivalsJson(const std::vector<StudyScene>& scenes, const StudyResult& result) {
    json out = json::array();
    for (uint32_t scene = 0; scene < scenes.size(); ++scene)
        for (const ArrivalFacts& f : arrivalFacts(result.arrivals, scene))
            out.push_back({{"scene", scenes[scene].name},
                           {"event", f.event},
                           {"first_seconds", numberJson(f.firstSeconds)},
                           {"seconds_to_30_db", numberJson(f.goodSeconds)},
                           {"bytes_to_30_db", numberJson(f.goodBytes)},
                           {"seconds", f.completeSeconds},
                           {"bytes", f.allBytes},
                           {"is_complete", f.isComplete}});
    return out;
}

}  // namespace

std::string rowsCsv(const std::vector<StudyScene>& scenes, const StudyResult& result) {
    CsvRow head{"scene",    "width",           "height", "path",  "view",  "mode",
                "error_px", "records_at_most", "cell",   "block", "frame", "ms"};
    for (const ErrorColumn& c : errorColumns()) head.emplace_back(c.name);
    std::string out = csvLine(head);
    for (const Visit& v : result.visits) {
        const Cell& c = result.cells[v.cell];
        const StudyScene& scene = scenes[c.scene];
        const glm::uvec2 size = result.settings.sizes[c.size];
        for (size_t f = 0; f < v.ms.size(); ++f) {
            CsvRow row{csvName(scene.name),
                       std::to_string(size.x),
                       std::to_string(size.y),
                       csvName(scene.views[c.view].path),
                       std::to_string(scene.views[c.view].number),
                       nameOf(c.mode),
                       csvNumber(c.target),
                       c.hasBudget() ? std::to_string(c.records) : "",
                       std::to_string(v.cell),
                       std::to_string(v.block),
                       std::to_string(f),
                       csvNumber(v.ms[f])};
            for (const ErrorColumn& e : errorColumns()) row.push_back(csvNumber(result.errors[v.cell].*e.value));
            out += csvLine(row);
        }
    }
    return out;
}

json jsonOfStudy(const std::vector<StudyScene>& scenes, const StudyResult& result, const std::vector<Summary>& all) {
    const StudySettings& s = result.settings;
    json list = json::array(), budgets = json::array(), of = json::array(), truths = json::array();
    for (const StudyScene& scene : scenes)
        of.push_back({{"name", scene.name},
                      {"content", hexDigits(scene.hash)},
                      {"records", scene.records},
                      {"bytes", scene.storeBytes},
                      {"views", scene.views.size()},
                      {"audited_against", scene.against.empty() ? "leaves" : scene.againstName}});
    for (const TruthCheck& t : result.truths)
        truths.push_back({{"scene", t.scene}, {"size", t.size}, {"doubled_db", numberJson(t.decibels)}});
    uint64_t beyond = 0, audited = 0, shadowPixels = 0, shadowBeyond = 0;
    for (const Summary& a : all) {
        if (a.errors.shadowPixels > 0) {
            shadowPixels += static_cast<uint64_t>(a.errors.shadowPixels);
            shadowBeyond += static_cast<uint64_t>(a.errors.shadowBeyond);
        }
        json passes;
        for (const auto& [name, ms] : a.passes) passes[name] = ms;
        const glm::uvec2 size = s.sizes[a.of.size];
        json row = {{"scene", scenes[a.of.scene].name},
                    {"width", size.x},
                    {"height", size.y},
                    {"mode", nameOf(a.of.mode)},
                    {"error_px", a.of.target},
                    {"ms", intervalJson(a.ms)},
                    {"p95_ms", intervalJson(a.p95)},
                    {"p99_ms", intervalJson(a.p99)},
                    {"passes_ms", passes},
                    {"errors", errorsJson(a.errors)}};
        if (a.of.hasBudget()) row["records_at_most"] = a.of.records;
        (a.of.hasBudget() ? budgets : list).push_back(row);
        if (std::isnan(a.errors.audited)) continue;
        beyond += static_cast<uint64_t>(a.errors.beyond);
        audited += static_cast<uint64_t>(a.errors.audited);
    }
    return {
        {"provenance", provenanceJson(result.provenance)},
        {"scenes", of},
        {"plan",
         {{"cells", result.cells.size()},
          {"blocks", s.blocks},
          {"frames", s.frames},
          {"samples", s.samples},
          {"seed", s.seed},
          {"targets_px", s.targets}}},
        {"truth", truths},
        {"audit",
         {{"pixels", audited}, {"beyond", beyond}, {"shadow_pixels", shadowPixels}, {"shadow_beyond", shadowBeyond}}},
        {"configurations", list},
        {"budgets", budgets},
        {"originals", originalsJson(scenes, result)},
        {"arrivals", arrivalsJson(scenes, result)},
        {"not_measured", result.notes}};
}

std::string describeKept(const KeptAudit& k) {
    std::string out = fmt::format(
        "of {} points of its file {} are farther from their records than their leaves round by "
        "({:.2g} at most, {:.2g} stated)",
        k.points, k.placeBeyond, k.worstRounding, k.statedRounding);
    if (k.normals > 0)
        out += fmt::format("; of {} normals {} are more than {} degrees off ({:.3f} at most)", k.normals,
                           k.normalBeyond, kNormalDegrees, k.worstNormal);
    if (k.colours > 0) out += fmt::format("; of {} colours {} are not those of the file", k.colours, k.colourBeyond);
    return out;
}

std::string describeStudy(const std::vector<StudyScene>& scenes, const StudyResult& result,
                          const std::vector<Summary>& all) {
    std::string out;
    for (const Panel& panel : panelsOf(all)) {
        const glm::uvec2 size = result.settings.sizes[panel.front()->of.size];
        out += fmt::format("{}, {} x {}\n{:>16} {:>6} {:>9} {:>19} {:>8} {:>8} {:>8} {:>8}\n",
                           scenes[panel.front()->of.scene].name, size.x, size.y, "mode", "px", "ms", "95 %", "px p99",
                           "beyond", "dB", "FLIP");
        for (const Summary* s : panel)
            out += fmt::format("{:>16} {:>6} {:>9.2f} {:>8.2f} to {:>7.2f} {:>8.3f} {:>8.0f} {:>8.2f} {:>8.4f}\n",
                               nameOf(s->of.mode), shortNumber(s->of.target), s->ms.middle, s->ms.low, s->ms.high,
                               s->errors.lodP99, s->errors.beyond, s->errors.psnrForeground, s->errors.flipMean);
    }
    for (const Summary& s : all)
        if (s.of.hasBudget())
            out += fmt::format("{}, {} within {} records: {} px stated, {:.2f} dB, {:.2f} ms\n",
                               scenes[s.of.scene].name, nameOf(s.of.mode), s.of.records, shortNumber(s.errors.stated),
                               s.errors.psnrForeground, s.ms.middle);
    for (const KeptOf& k : result.kept) out += scenes[k.scene].name + ": " + describeKept(k.audit) + "\n";
    for (uint32_t scene = 0; scene < scenes.size(); ++scene)
        for (const ArrivalFacts& f : arrivalFacts(result.arrivals, scene))
            out += fmt::format("{}, {}: {:.2f} s and {:.1f} MB to 30 dB, {:.2f} s and {:.1f} MB to {}\n",
                               scenes[scene].name, f.event, f.goodSeconds, f.goodBytes / 1e6, f.completeSeconds,
                               f.allBytes / 1e6, f.isComplete ? "all" : "where it was stopped");
    for (const std::string& note : result.notes) out += "note: " + note + "\n";
    return out + fmt::format("report: {}/report.html\n", result.settings.output);
}

Result<void> writeStudy(const std::vector<StudyScene>& scenes, const StudyResult& result,
                        const std::vector<Summary>& all) {
    const std::string& folder = result.settings.output;
    STIPPLE_TRY(writeText(folder + "/rows.csv", rowsCsv(scenes, result)));
    STIPPLE_TRY(writeText(folder + "/study.json", jsonOfStudy(scenes, result, all).dump(2) + "\n"));
    std::error_code error;
    std::filesystem::create_directories(folder + "/plots", error);
    for (const Panel& panel : panelsOf(all)) {
        const glm::uvec2 size = result.settings.sizes[panel.front()->of.size];
        const std::string name = fmt::format("s{}-{}x{}", panel.front()->of.scene, size.x, size.y);
        const auto write = [&](const auto& chart, const std::string& svg) -> Result<void> {
            STIPPLE_TRY(writeText(fmt::format("{}/plots/{}.svg", folder, chart.name), svg));
            return writeText(fmt::format("{}/plots/{}.vl.json", folder, chart.name), vegaOf(chart).dump(1) + "\n");
        };
        const auto budgets = budgetsOf(all, panel.front()->of.scene, panel.front()->of.size);
        for (const Chart& chart : chartsOf(panel, budgets, result, name)) STIPPLE_TRY(write(chart, drawChart(chart)));
        const BarChart bars = passesOf(panel, result, name);
        STIPPLE_TRY(write(bars, drawBars(bars)));
    }
    const auto crop = [&](uint32_t cell) {
        std::ifstream in(folder + "/" + cropName(cell), std::ios::binary);
        std::stringstream bytes;
        bytes << in.rdbuf();
        return bytes.str();
    };
    return writeText(folder + "/report.html", htmlOf(scenes, result, all, crop));
}

}  // namespace stipple::study
