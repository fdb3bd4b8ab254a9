#include "lod/import/vdb/vdb.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "engine/base/file.h"
#include "engine/base/process.h"
#include "engine/base/words.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"
#include "lod/import/vdb/child.h"
#include "lod/import/vdb/header.h"

namespace stipple::lod {
namespace {

/// While triangles are made of it a voxel takes about so much.
constexpr uint64_t kBytesOfVoxel = 12;
/// Files up to so many voxels are read whole by `info` without being asked to.
constexpr uint64_t kQuickVoxels = 20'000'000;

/// What the program made of a file: a PLY file without a name, and what it says of each grid.
struct Conversion {
    std::shared_ptr<const NamelessFile> ply;
    nlohmann::json answer;
};

Result<void> checkBudget(const VdbChoice& choice, const std::string& path, uint64_t memoryBytes) {
    const uint64_t most = std::max(choice.voxels * (choice.hasLevelSets ? kBytesOfVoxel : 1), choice.memoryBytes);
    if (most <= memoryBytes) return {};
    return fail(ErrorKind::budget,
                fmt::format("has {} voxels, which take about {}, but --memory allows {}", choice.voxels,
                            humanBytes(most), humanBytes(memoryBytes)),
                path, fmt::format("give --memory {}M or more", (most >> 20) + 1));
}

Result<VdbChoice> choose(const std::string& path, const FormatOptions& more) {
    STIPPLE_ASSIGN(const VdbHeader header, readVdbHeader(path));
    return chooseGrids(header, more.part, path);
}

Result<Conversion> convertNow(const std::string& job, const std::string& path, const FormatOptions& more) {
    Conversion out;
    STIPPLE_ASSIGN(out.ply, NamelessFile::create(more.tempFolder));
    STIPPLE_ASSIGN(out.answer,
                   runVdbProgram({{"job", job}, {"path", path}, {"grid", more.part}, {"memory", more.openingBytes}},
                                 *out.ply, path, more.isStopped));
    return out;
}

Result<Conversion> convert(const std::string& job, const std::string& path, const FormatOptions& more) {
    const auto make = [&] { return convertNow(job, path, more); };
    if (!more.kept) return make();
    return more.kept->once<Conversion>(fmt::format("vdb|{}|{}|{}|{}", job, path, fileIdentity(path), more.part), make);
}

/// Beside what is drawn.
std::vector<std::string> leftOutNotes(const VdbChoice& choice, bool isNamed) {
    if (choice.leftOut.empty() || isNamed) return {};
    std::string text;
    for (const std::string& label : choice.leftOut) text += (text.empty() ? "" : ", ") + label;
    return {"left out: " + text};
}

std::string deviationText(const nlohmann::json& d) {
    std::string text = fmt::format(
        "at most {:.3g} units ({:.3g} voxels) from its zero crossing or it from them, {:.3g} ({:.3g}) on average, at "
        "{} "
        "places",
        d["most_units"].get<double>(), d["most_voxels"].get<double>(), d["mean_units"].get<double>(),
        d["mean_voxels"].get<double>(), d["places"].get<uint64_t>());
    if (const auto n = d["unmeasured"].get<uint64_t>(); n > 0) text += fmt::format("; at {} more it leads nowhere", n);
    return text;
}

Result<PointSource> sourceOf(const Conversion& made, const std::string& path, const ReadOptions& options) {
    STIPPLE_ASSIGN(PointSource source, openPly(made.ply->path(), options));
    source.info.path = path;
    source.openPart = [ply = made.ply, open = source.openPart](size_t part) { return open(part); };
    return source;
}

}  // namespace

Result<bool> vdbHasMesh(const std::string& path, const FormatOptions& more) {
    STIPPLE_ASSIGN(const VdbChoice choice, choose(path, more));
    return choice.hasLevelSets && !more.onlyPoints;
}

Result<PointSource> openVdbPoints(const std::string& path, const ReadOptions& options, const FormatOptions& more) {
    STIPPLE_ASSIGN(const VdbChoice choice, choose(path, more));
    STIPPLE_TRY(checkBudget(choice, path, more.openingBytes));
    const std::string job = choice.hasPoints ? "points" : "surfels";
    STIPPLE_ASSIGN(const Conversion made, convert(job, path, more));
    STIPPLE_ASSIGN(PointSource source, sourceOf(made, path, options));
    source.info.format = choice.hasPoints ? "OpenVDB points" : "OpenVDB level set, discs on its surface";
    source.info.notes = leftOutNotes(choice, !more.part.empty());
    if (choice.hasPoints && choice.hasLevelSets)
        source.info.notes.emplace_back("level sets beside points are left out where only points are wanted");
    if (const auto names = made.answer.value("left_out", std::vector<std::string>()); !names.empty())
        source.info.notes.push_back(
            fmt::format("attributes that are not one number a point, or not of every grid, are left out: {}",
                        names.front()) +
            (names.size() > 1 ? fmt::format(" and {} more", names.size() - 1) : ""));
    return source;
}

Result<OpenedMesh> openVdbMesh(const std::string& path, const FormatOptions& more) {
    STIPPLE_ASSIGN(const VdbChoice choice, choose(path, more));
    STIPPLE_TRY(checkBudget(choice, path, more.openingBytes));
    STIPPLE_ASSIGN(const Conversion made, convert("triangles", path, more));
    OpenedMesh out;
    uint64_t triangles = 0;
    for (const auto& grid : made.answer["grids"]) {
        triangles += grid["triangles"].get<uint64_t>();
        out.notes.push_back(fmt::format("level set '{}': {}, {}", grid["grid"].get<std::string>(),
                                        counted(grid["triangles"].get<uint64_t>(), "triangle"),
                                        deviationText(grid["deviation"])));
    }
    if (triangles == 0)
        return fail(ErrorKind::input, "has no surface: no level set of it is 0 anywhere", path,
                    "is it a narrow band of signed distances?");
    for (const std::string& note : leftOutNotes(choice, !more.part.empty())) out.notes.push_back(note);
    if (choice.hasPoints) out.notes.emplace_back("points beside level sets are left out; --only-points takes them");
    const std::string folder =
        more.tempFolder.empty() ? std::filesystem::temp_directory_path().string() : more.tempFolder;
    STIPPLE_ASSIGN(out.source, openPlyMesh(made.ply->path(), more.memoryBytes, folder));
    out.source.identity = [ply = made.ply, identity = fileIdentity(path)] { return identity; };
    return out;
}

Result<std::vector<FilePart>> describeVdb(const std::string& path, bool isWhole, const FormatOptions& more) {
    STIPPLE_ASSIGN(const VdbHeader header, readVdbHeader(path));
    static const std::map<VdbKind, const char*> kKinds{
        {VdbKind::levelSet, "level set"},
        {VdbKind::points, "points"},
        {VdbKind::fog, "fog volume (not drawn)"},
        {VdbKind::unknownClass, "of no class (not drawn, unless --grid names it)"},
        {VdbKind::unknownType, "not drawn"}};
    std::vector<FilePart> parts;
    for (const VdbGrid& g : header.grids) {
        if (!more.part.empty() && g.name != more.part) continue;
        FilePart part{fmt::format("grid '{}'", g.name), {}};
        part.facts = {{"kind", std::string(kKinds.at(g.kind))},
                      {"type", g.valueType + (g.isHalf ? ", of 16 bits in the file" : "")},
                      {"transform", g.transform}};
        if (g.voxels > 0) part.facts.push_back({"voxels", g.voxels});
        if (g.memoryBytes > 0) part.facts.push_back({"memory", humanBytes(g.memoryBytes)});
        if (g.kind == VdbKind::levelSet || g.kind == VdbKind::points || !more.part.empty()) {
            FormatOptions own = more;
            own.part = g.name;
            STIPPLE_ASSIGN(const VdbChoice choice, chooseGrids(header, own.part, path));
            if (isWhole || choice.voxels <= kQuickVoxels) {
                STIPPLE_TRY(checkBudget(choice, path, more.openingBytes));
                const bool isPoints = g.kind == VdbKind::points;
                STIPPLE_ASSIGN(const Conversion made, convert(isPoints ? "points" : "triangles", path, own));
                for (const auto& grid : made.answer["grids"]) {
                    if (isPoints) part.facts.push_back({"points", grid["points"].get<uint64_t>()});
                    if (isPoints) continue;
                    const auto& d = grid["deviation"];
                    part.facts.insert(part.facts.end(), {{"triangles", grid["triangles"].get<uint64_t>()},
                                                         {"deviation", d["most_units"].get<double>()},
                                                         {"in voxels", d["most_voxels"].get<double>()},
                                                         {"mean deviation", d["mean_units"].get<double>()},
                                                         {"mean in voxels", d["mean_voxels"].get<double>()},
                                                         {"measured at", d["places"].get<uint64_t>()},
                                                         {"not measured at", d["unmeasured"].get<uint64_t>()}});
                }
            }
        }
        parts.push_back(std::move(part));
    }
    if (parts.empty()) STIPPLE_TRY(chooseGrids(header, more.part, path));
    return parts;
}

}  // namespace stipple::lod
