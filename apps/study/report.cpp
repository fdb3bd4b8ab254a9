// What a study found, as Markdown and JSON.
#include <fmt/format.h>

#include <cmath>

#include "apps/study/mode_name.h"
#include "apps/study/papers.h"
#include "apps/study/study.h"
#include "engine/reference/variants/variants.h"

namespace stipple::study {
namespace {

using render::Mode;

std::string decibels(double v) { return std::isinf(v) ? "same" : fmt::format("{:.1f}", v); }
nlohmann::json numberOf(double v) { return std::isfinite(v) ? nlohmann::json(v) : nlohmann::json("inf"); }
std::string modeHeads() {
    std::string out;
    for (const render::Reconstruction& r : render::reconstructions()) out += fmt::format(" {} |", r.name);
    return out;
}
std::string rule(size_t columns) {
    std::string out = "|";
    for (size_t i = 0; i < columns; ++i) out += "---|";
    return out + "\n";
}

void describeTimes(const SeedsReport& report, std::string& out) {
    const size_t modes = render::reconstructions().size();
    const char* paper = "";
    for (const ModelMeasure& m : report.models) {
        const ModelRow& row = modelRows()[m.row];
        if (row.paper != paper) {
            paper = row.paper;
            out += fmt::format(
                "\n### {}\n\nFrames a second with all records (M records/s) / at an error of one pixel.\n\n"
                "| theirs | points | their fps | ours | device, size |{}\n{}",
                paper, modeHeads(), rule(5 + modes));
        }
        for (const SizeMeasure& s : m.sizes) {
            out += fmt::format("| {} | {} | {} | {}, {} | {}, {} |", row.model, row.points, row.theirs, row.proxy,
                               m.points, s.device, s.size);
            for (const ModeMeasure& t : s.modes)
                out += fmt::format(" {:.1f} ({:.1f}) / {:.1f} |", t.leaves.fps(), t.leaves.millionRecords(),
                                   t.pixel.fps());
            out += "\n";
        }
    }
}

void describeErrors(const SeedsReport& report, std::string& out) {
    out += fmt::format(
        "\n## The three errors that the papers did not measure\n\ndB over the pixels that either picture covers: "
        "implementation (cpu against the fp64 restatement, one pixel) / level of detail (one pixel against the mode's "
        "leaves) / reconstruction (leaves against traced discs, 16 rays a pixel), overlap of silhouettes with the "
        "traced ones. (Discs in one plane are equally deep: which of them pullpush and splat show is left to rounding, "
        "as the checker plane shows.)\n\n| model, points |{}\n{}",
        modeHeads(), rule(1 + render::reconstructions().size()));
    for (const ModelMeasure& m : report.models) {
        out += fmt::format("| {} ({} px), {} |", modelRows()[m.row].model, m.errorSize, m.points);
        for (const render::Reconstruction& r : render::reconstructions()) {
            const Errors& e = m.errors.at(r.mode);
            out += fmt::format(" {} / {} / {}, {:.4f} |", decibels(e.implementation), decibels(e.levelOfDetail),
                               decibels(e.reconstruction), e.overlap);
        }
        out += "\n";
    }
}

void describeOutlines(const SeedsReport& report, std::string& out) {
    if (report.outlines.empty()) return;
    out += fmt::format(
        "\n## A statue's silhouettes and normals, at the leaves\n\nLucy as discs, {} px: overlap (IoU) of the "
        "silhouette with the mesh's, mean distance of the outlines (the area between them over the length; of that, "
        "what is drawn outside of the mesh's), mean angle between normals; then overlap and angle against the traced "
        "discs.\n\n"
        "| spacing | points | what | overlap with the mesh | distance (outside) | normals | overlap with the discs | "
        "normals |\n{}",
        report.outlineSize, rule(8));
    for (const OutlineRow& r : report.outlines)
        out += fmt::format("| {:g} px | {} | {} | {:.4f} | {:.2f} ({:.2f}) px | {:.2f} deg | {:.4f} | {:.2f} deg |\n",
                           r.spacingPixels, r.points, r.what, r.overlap, r.distance, r.outside, r.normal, r.discOverlap,
                           r.discNormal);
}

void describePinholes(const SeedsReport& report, std::string& out) {
    out += fmt::format(
        "\n## Pinholes of a closed surface\n\nA sphere of 9,858 discs (Ochotta, Hiller & Saupe 2006, Fig 6) from {} "
        "random eyes outside it, as near as a 128th of its radius, 64 x 64 px: pixels that stay open, of {} whose rays "
        "pass its middle within 0.97 of the radius.\n\n| mode | open |\n|---|---|\n",
        report.pinholePoses, report.pinholes.looked);
    for (const auto& [mode, open] : report.pinholes.open) out += fmt::format("| {} | {} |\n", nameOf(mode), open);
}

void describeFigures(const SeedsReport& report, std::string& out) {
    out += "\n## Figures\n";
    for (const Figure& f : report.figures) {
        out += fmt::format("\n**{}** ({}). ", f.title, f.source);
        for (size_t i = 0; i < f.panels.size(); ++i) out += (i > 0 ? " | " : "") + f.panels[i];
        out += fmt::format("\n\n![{}]({})\n", f.title, f.file);
    }
    out +=
        "\n## Comparison variants\n\nDrawn in fp64 for pictures and tests only.\n\n| variant | of | where | what it "
        "shows |\n|---|---|---|---|\n";
    for (const reference::Variant& v : reference::variants())
        out += fmt::format("| {} | {} | {} | {} |\n", v.name, nameOf(v.mode), v.source, v.shows);
}

}  // namespace

std::string describeSeeds(const SeedsReport& report) {
    std::string out = fmt::format(
        "# The papers' tables and figures once more\n\n`stipple study --seeds{}`, {:.0f} s; medians of {} frames, the "
        "modes in turn. {}.\n\n## Tables\n",
        report.settings.isQuick ? " --quick" : "", report.seconds, report.settings.rounds,
        describeMachine(report.machine));
    describeTimes(report, out);
    describeErrors(report, out);
    describeOutlines(report, out);
    describePinholes(report, out);
    out += describePatches(report.patches);
    describeFigures(report, out);
    if (!report.missing.empty()) {
        out += "\n## Not made\n\n";
        for (const std::string& m : report.missing) out += "- " + m + "\n";
    }
    return out;
}

nlohmann::json jsonOfSeeds(const SeedsReport& report) {
    nlohmann::json models = nlohmann::json::array(), outlines = nlohmann::json::array(), figures = models, open;
    for (const ModelMeasure& m : report.models) {
        const ModelRow& row = modelRows()[m.row];
        nlohmann::json sizes = nlohmann::json::array(), errors;
        for (const SizeMeasure& s : m.sizes) {
            nlohmann::json modes;
            for (const ModeMeasure& t : s.modes)
                modes[nameOf(t.mode)] = {{"leaves_ms", t.leaves.medianMs},
                                         {"leaves_records", t.leaves.records},
                                         {"pixel_ms", t.pixel.medianMs},
                                         {"pixel_records", t.pixel.records}};
            sizes.push_back({{"device", s.device}, {"size", s.size}, {"modes", modes}});
        }
        for (const auto& [mode, e] : m.errors)
            errors[nameOf(mode)] = {{"implementation_db", numberOf(e.implementation)},
                                    {"level_of_detail_db", numberOf(e.levelOfDetail)},
                                    {"reconstruction_db", numberOf(e.reconstruction)},
                                    {"overlap", e.overlap}};
        models.push_back({{"paper", row.paper},
                          {"model", row.model},
                          {"their_points", row.points},
                          {"their_fps", row.theirs},
                          {"ours", row.proxy},
                          {"points", m.points},
                          {"sizes", sizes},
                          {"errors", errors}});
    }
    for (const OutlineRow& r : report.outlines)
        outlines.push_back({{"spacing_px", r.spacingPixels},
                            {"points", r.points},
                            {"what", r.what},
                            {"overlap", r.overlap},
                            {"distance_px", r.distance},
                            {"normals_degrees", r.normal},
                            {"outside_px", r.outside},
                            {"disc_overlap", r.discOverlap},
                            {"disc_normals_degrees", r.discNormal}});
    for (const auto& [mode, count] : report.pinholes.open) open[nameOf(mode)] = count;
    for (const Figure& f : report.figures)
        figures.push_back({{"file", f.file}, {"source", f.source}, {"title", f.title}, {"panels", f.panels}});
    return {{"quick", report.settings.isQuick},
            {"seconds", report.seconds},
            {"machine",
             {{"processor", report.machine.processor},
              {"threads", report.machine.threads},
              {"load", report.machine.load},
              {"date", report.machine.date}}},
            {"models", models},
            {"outlines", outlines},
            {"pinholes", {{"poses", report.pinholePoses}, {"pixels", report.pinholes.looked}, {"open", open}}},
            {"patches", jsonOfPatches(report.patches)},
            {"figures", figures},
            {"not_made", report.missing}};
}

}  // namespace stipple::study
