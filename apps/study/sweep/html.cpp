// report.html: text, tables, charts and crops in one file.
#include <fmt/format.h>

#include "apps/study/mode_name.h"
#include "apps/study/plots/svg.h"
#include "apps/study/plots/vega.h"
#include "apps/study/statistics/compare.h"
#include "apps/study/sweep/report.h"

namespace stipple::study {
namespace {

constexpr const char* kStyle =
    "body{font:15px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#222;background:#fff}"
    "table{border-collapse:collapse;margin:1em 0;font-size:13px}td,th{border:1px solid #ddd;padding:.25em .6em;"
    "text-align:right}td:first-child,th:first-child{text-align:left}figure{margin:1.2em 0}svg,img{max-width:100%;"
    "height:auto}details{font-size:13px;color:#555}pre{white-space:pre-wrap;max-height:20em;overflow:auto}"
    ".bad{color:#b00020;font-weight:bold}.good{color:#00703c}figcaption{font-size:13px;color:#555}";

std::string cell(double value, int decimals) {
    return std::isnan(value) ? "-" : std::isinf(value) ? "same" : fmt::format("{:.{}f}", value, decimals);
}

std::string figure(const std::string& svg, const nlohmann::json& vega) {
    return fmt::format(
        "<figure>{}<details><summary>Vega-Lite specification with the data</summary><pre>{}</pre></details></figure>\n",
        svg, escaped(vega.dump()));
}

std::string mainTable(const Panel& panel) {
    std::string out =
        "<table><tr><th>mode<th>asked, px<th>stated<th>ms<th>95 % band<th>p95<th>p99<th>px p99<th>px max<th>beyond"
        "<th>detail dB<th>backend dB<th>leaves dB<th>PSNR<th>SSIM<th>FLIP<th>IoU<th>edge px<th>holes<th>spill"
        "<th>depth p99<th>normals<th>pop<th>faded<th>flicker<th>MB</tr>\n";
    for (const Summary* s : panel) {
        const CellErrors& e = s->errors;
        out += fmt::format(
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{} - {}<td>{}<td>{}<td>{}<td>{}<td{}>{}<td>{}<td>{}<td>{}<td>{}<td>{}"
            "<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>\n",
            nameOf(s->of.mode), shortNumber(s->of.target), cell(e.stated, 2), cell(s->ms.middle, 2), cell(s->ms.low, 2),
            cell(s->ms.high, 2), cell(s->p95.middle, 2), cell(s->p99.middle, 2), cell(e.lodP99, 3), cell(e.lodMost, 2),
            e.beyond > 0 ? " class=bad" : "", cell(e.beyond, 0), cell(e.lodDecibels, 1), cell(e.backendDecibels, 1),
            cell(e.leavesDecibels, 1), cell(e.psnrForeground, 2), cell(e.ssim, 4), cell(e.flipMean, 4),
            cell(e.overlap, 4), cell(e.boundary, 2), cell(e.holes, 0), cell(e.spill, 0), cell(e.depthP99, 5),
            cell(e.normalMean, 2), cell(e.popP999, 0), cell(e.popFaded, 0), cell(e.flickerMean, 2),
            cell(e.bytes / 1e6, 2));
    }
    return out + "</table>\n";
}

std::string shadowViolations(const Panel& panel) {
    double pixels = 0, beyond = 0, most = 0, stated = 0;
    for (const Summary* s : panel) {
        const CellErrors& e = s->errors;
        if (!(e.shadowPixels > 0)) continue;
        pixels += e.shadowPixels;
        beyond += e.shadowBeyond;
        most = std::max(most, e.shadowMost);
        stated = std::max(stated, e.shadowStated);
    }
    if (!(pixels > 0)) return "";
    return fmt::format(
        "<p class={}>Shadows: {:.0f} of {:.0f} pixels that a light falls on are wrong by more than is stated of their "
        "borders (the farthest wrong one {:.1f} px, {:.1f} stated at most).</p>\n",
        beyond > 0 ? "bad" : "good", beyond, pixels, most, stated);
}

std::string violations(const Panel& panel) {
    double beyond = 0, audited = 0;
    for (const Summary* s : panel) {
        beyond += std::isnan(s->errors.beyond) ? 0 : s->errors.beyond;
        audited += std::isnan(s->errors.audited) ? 0 : s->errors.audited;
    }
    if (!(audited > 0)) return "<p>Distances from the full detail were not measured.</p>\n";
    return fmt::format(
               "<p class={}>{:.0f} of {:.0f} pixels are farther from the full detail than stated and half a "
               "pixel.</p>\n",
               beyond > 0 ? "bad" : "good", beyond, audited) +
           shadowViolations(panel);
}

std::string atFixed(const Panel& panel, const StudySettings& settings) {
    std::string out = "<h3>Time at fixed error, error at fixed time</h3>\n<table><tr><th>mode";
    const std::vector<double> decibels{25, 30, 35, 40}, times{5, 10, 20, 50};
    for (const double d : decibels) out += fmt::format("<th>ms for {} dB", d);
    for (const double t : times) out += fmt::format("<th>dB in {} ms", t);
    out += "</tr>\n";
    for (const render::Mode mode : settings.modes) {
        out += fmt::format("<tr><td>{}", nameOf(mode));
        for (const double d : decibels) {
            const Summary* s = quickestWith(panel, mode, d);
            out += s ? fmt::format("<td>{} (at {} px)", cell(s->ms.middle, 1), shortNumber(s->of.target)) : "<td>-";
        }
        for (const double t : times) {
            const Summary* s = bestWithin(panel, mode, t);
            out += s ? fmt::format("<td>{} (at {} px)", cell(s->errors.psnrForeground, 1), shortNumber(s->of.target))
                     : "<td>-";
        }
        out += "</tr>\n";
    }
    return out + "</table>\n";
}

std::string listOf(const char* title, const std::vector<std::string>& lines, const char* none) {
    std::string out = fmt::format("<h3>{}</h3>\n", title);
    if (lines.empty()) return out + fmt::format("<p>{}</p>\n", none);
    out += "<ul>\n";
    for (const std::string& line : lines) out += "<li>" + escaped(line) + "\n";
    return out + "</ul>\n";
}

std::string alikeList(const Panel& panel) {
    std::vector<std::string> lines;
    for (const Alike& a : alikeOf(panel))
        lines.push_back(
            fmt::format("{} and {} at {} px: not distinguishable in time ({}; ratio {:.3f}, between {:.3f} and {:.3f})",
                        nameOf(a.a->of.mode), nameOf(a.b->of.mode), shortNumber(a.a->of.target),
                        a.a->visits.size() < 6 ? "too few visits" : "95 %", a.ratio.middle, a.ratio.low, a.ratio.high));
    return listOf("Not distinguishable", lines, "All modes can be told apart by their times.");
}

std::string base64(const std::string& bytes) {
    static const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k)
            group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (size_t k = 0; k < 4; ++k) out += i + k <= bytes.size() ? digits[group >> (18 - 6 * k) & 63u] : '=';
    }
    return out;
}

std::string crops(const Panel& panel, const StudyResult& result, const std::vector<StudyScene>& scenes,
                  const std::function<std::string(uint32_t)>& crop) {
    std::string out = fmt::format(
        "<h3>Where pictures at {} px are worst</h3>\n<p>Of each mode the camera farthest from the truth, 48 px of it: "
        "drawn, traced, and what is seen of the difference (FLIP).</p>\n",
        shortNumber(cropTarget(result.settings)));
    for (const Summary* s : panel) {
        if (s->worst == ~0u) continue;
        const std::string png = crop(s->worst);
        if (png.empty()) continue;
        const PathView& v = scenes[s->of.scene].views[result.cells[s->worst].view];
        out += fmt::format(
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}, {2} {3}: {4} dB of the "
            "foreground</figcaption></figure>\n",
            nameOf(s->of.mode), base64(png), escaped(v.path), v.number,
            cell(result.errors[s->worst].psnrForeground, 1));
    }
    return out;
}

std::string budgetTable(const std::vector<const Summary*>& budgets) {
    if (budgets.empty()) return "";
    std::string out =
        "<h3>Within budgets of records</h3>\n<table><tr><th>at most<th>drawn<th>mode<th>asked, px<th>stated<th>px p99"
        "<th>beyond<th>ms<th>95 % band<th>PSNR<th>FLIP<th>MB</tr>\n";
    for (const Summary* s : budgets) {
        const CellErrors& e = s->errors;
        out +=
            fmt::format("<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td{}>{}<td>{}<td>{} - {}<td>{}<td>{}<td>{}</tr>\n",
                        s->of.records, cell(e.records + e.triangles, 0), nameOf(s->of.mode), shortNumber(s->of.target),
                        cell(e.stated, 2), cell(e.lodP99, 3), e.beyond > 0 ? " class=bad" : "", cell(e.beyond, 0),
                        cell(s->ms.middle, 2), cell(s->ms.low, 2), cell(s->ms.high, 2), cell(e.psnrForeground, 2),
                        cell(e.flipMean, 4), cell(e.bytes / 1e6, 2));
    }
    return out + "</table>\n";
}

std::string arrivalTable(const StudyResult& result, uint32_t scene) {
    const auto facts = arrivalFacts(result.arrivals, scene);
    if (facts.empty()) return "";
    std::string out = fmt::format(
        "<h3>From a cold start, and after jumps</h3>\n<p>{} at {} px, frame after frame, files in the system's cache; "
        "dB "
        "against the frame with all that it wants.</p>\n<table><tr><th>event<th>s to a picture<th>s to 30 dB<th>MB to "
        "30 "
        "dB<th>s to all<th>MB</tr>\n",
        nameOf(result.settings.modes.front()), shortNumber(cropTarget(result.settings)));
    for (const ArrivalFacts& f : facts)
        out += fmt::format("<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>\n", escaped(f.event), cell(f.firstSeconds, 3),
                           cell(f.goodSeconds, 3), cell(f.goodBytes / 1e6, 1),
                           f.isComplete ? cell(f.completeSeconds, 3) : "-", cell(f.allBytes / 1e6, 1));
    return out + "</table>\n";
}

std::string panelOf(const Panel& panel, const std::vector<const Summary*>& budgets, const StudyResult& result,
                    const std::vector<StudyScene>& scenes, const std::function<std::string(uint32_t)>& crop) {
    const StudyScene& scene = scenes[panel.front()->of.scene];
    const glm::uvec2 size = result.settings.sizes[panel.front()->of.size];
    std::string out = fmt::format("<h2>{}, {} x {}</h2>\n", escaped(scene.name), size.x, size.y);
    for (const TruthCheck& t : result.truths) {
        if (t.scene != panel.front()->of.scene || t.size != panel.front()->of.size) continue;
        double best = 0;
        for (const Summary* s : panel)
            if (std::isfinite(s->errors.psnrForeground)) best = std::max(best, s->errors.psnrForeground);
        const bool isTrue = t.decibels >= best + 10;
        out += fmt::format(
            "<p>Truth: {0} x {0} rays a pixel; with {1} x {1} it changes by {2} dB, the best picture is {3} dB "
            "off{4}.</p>\n",
            result.settings.samples, 2 * result.settings.samples, cell(t.decibels, 1), cell(best, 1),
            isTrue ? ""
                   : ": <span class=bad>less than 10 dB apart, so that the best pictures' figures are partly the "
                     "truth's own</span>");
    }
    out += violations(panel);
    for (const KeptOf& k : result.kept)
        if (k.scene == panel.front()->of.scene && panel.front()->of.size == 0)
            out += fmt::format("<p class={}>{}.</p>\n", k.audit.beyond() > 0 ? "bad" : "good",
                               escaped("Points: " + describeKept(k.audit)));
    const std::string name = fmt::format("s{}-{}x{}", panel.front()->of.scene, size.x, size.y);
    for (const Chart& chart : chartsOf(panel, budgets, result, name)) out += figure(drawChart(chart), vegaOf(chart));
    const BarChart bars = passesOf(panel, result, name);
    out += figure(drawBars(bars), vegaOf(bars));
    out += atFixed(panel, result.settings) + alikeList(panel) + budgetTable(budgets);
    if (panel.front()->of.size == 0) out += arrivalTable(result, panel.front()->of.scene);
    out +=
        listOf("Where it loses", lossesOf(panel), "Nowhere by more than 3 dB, and no pixel is beyond what is stated.");
    return out + "<h3>All figures</h3>\n" + mainTable(panel) + crops(panel, result, scenes, crop);
}

}  // namespace

std::string htmlOf(const std::vector<StudyScene>& scenes, const StudyResult& result, const std::vector<Summary>& all,
                   const std::function<std::string(uint32_t)>& crop) {
    const Provenance& p = result.provenance;
    const StudySettings& s = result.settings;
    std::string out = fmt::format(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>What accuracy costs</title>"
        "<style>{}</style></head><body>\n<h1>What accuracy costs in time</h1>\n<p>{}. {}. stipple {}, {} ({}).</p>\n"
        "<p>{} cells, each {} times {} frames in blocks of any order (seed {}). Bands: 95 % of bootstraps over blocks. "
        "Pop: change of pixels, of 255, at p99.9, where the cut is that of a camera 9 % farther away and the camera is "
        "not; faded: the same of means of {} frames over which levels fade, small pictures of the first camera of each "
        "path. Flicker: by how much more a turn of a quarter of a pixel changes pixels than it changes the truth, of "
        "255. "
        "Cells of several cameras together: dB of the mean square, the greatest of px, sums of counts, else "
        "means.</p>\n",
        kStyle, escaped(describeMachine(p.machine)), escaped(p.device), escaped(p.version), escaped(p.compiler),
        escaped(p.flags), result.cells.size(), s.blocks, s.frames, s.seed, kFadeFrames);
    for (const StudyScene& scene : scenes)
        out += fmt::format("<p>{}: {} records, {:.1f} MB, content {:016x}</p>\n", escaped(scene.name), scene.records,
                           static_cast<double>(scene.storeBytes) / 1e6, scene.hash);
    if (!result.notes.empty()) out += listOf("Not measured", result.notes, "");
    for (const Panel& panel : panelsOf(all))
        out += panelOf(panel, budgetsOf(all, panel.front()->of.scene, panel.front()->of.size), result, scenes, crop);
    return out + "</body></html>\n";
}

}  // namespace stipple::study
