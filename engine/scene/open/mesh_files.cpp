#include "engine/scene/open/mesh_files.h"

#include <fmt/format.h>

#include <filesystem>

#include "lod/import/import.h"

namespace stipple::scene {
namespace fs = std::filesystem;

std::string MeshFiles::note() const {
    if (files.empty() || others == 0) return "";
    return fmt::format(
        "{} {} faces, which are left out: only their vertices stand beside the points of {} other file{}; build them "
        "apart to keep triangles",
        files.size() == 1 ? files.front() : fmt::format("{} files", files.size()), files.size() == 1 ? "has" : "have",
        others, others == 1 ? "" : "s");
}

tl::unexpected<Error> nothingToSample(const std::string& input) {
    return fail(ErrorKind::usage, "samples meshes of glTF and OBJ files, and this has none", "--surfels with " + input,
                "leave it out: points and curves are drawn as they are");
}

tl::unexpected<Error> noPointsToLight(const std::string& input) {
    return fail(ErrorKind::usage, "are of what has no materials, and of that this has none",
                "--material, --roughness, --metallic with " + input, "leave them out: its triangles have their own");
}

Result<MeshFiles> findMeshFiles(const std::vector<std::string>& inputs, const OpenSettings& build) {
    MeshFiles out;
    const lod::FormatOptions more = build.formatOptions();
    if (more.onlyPoints) return out;
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs, &out.notes));
    for (const std::string& file : files) {
        const auto hasMesh = lod::hasMesh(file, more);
        if (!hasMesh && files.size() == 1) return tl::unexpected(hasMesh.error());
        if (hasMesh && *hasMesh)  // (who opens the others says what is wrong with them)
            out.files.push_back(file);
        else
            ++out.others;
    }
    if (build.surfels > 0 && !out.files.empty())
        return fail(ErrorKind::usage, "samples meshes of glTF and OBJ files, and this is one of another format",
                    "--surfels with " + out.files.front(),
                    "leave it out to draw triangles, or give --only-points for points");
    if (build.surfels > 0) return nothingToSample(inputs.front());
    return out;
}

Result<lod::OpenedMesh> openMeshes(const std::vector<std::string>& files, const lod::FormatOptions& more) {
    lod::FormatOptions each = more;
    each.memoryBytes /= files.size();
    lod::OpenedMesh all;
    std::vector<lod::MeshSource> sources;
    for (const std::string& file : files) {
        STIPPLE_ASSIGN(lod::OpenedMesh one, lod::openMesh(file, each));
        for (const std::string& note : one.notes) all.notes.push_back(fmt::format("{}: {}", file, note));
        sources.push_back(std::move(one.source));
    }
    all.source = sources.size() == 1 ? std::move(sources.front()) : lod::joined(std::move(sources));
    return all;
}

Result<lod::BuildReport> buildMeshFiles(const std::vector<std::string>& files, const std::string& output,
                                        const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                        Progress& progress) {
    STIPPLE_ASSIGN(const lod::BuildSettings wanted, build.settings());
    const auto forReader = static_cast<uint64_t>(kReaderShare * static_cast<double>(wanted.memoryBytes));
    lod::FormatOptions more = build.formatOptions();
    if (more.tempFolder.empty()) more.tempFolder = fs::absolute(output).parent_path().string();
    more.memoryBytes = forReader;
    STIPPLE_ASSIGN(const lod::OpenedMesh mesh, openMeshes(files, more));
    settings.description.source = fs::path(files.front()).filename().string();
    if (files.size() > 1) settings.description.source += fmt::format(" and {} more", files.size() - 1);
    return buildOpened(mesh, forReader, output, build, std::move(settings), executor, progress);
}

Result<lod::BuildReport> buildOpened(const lod::OpenedMesh& mesh, uint64_t held, const std::string& output,
                                     const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                     Progress& progress) {
    STIPPLE_ASSIGN(settings.limits, build.settings());
    settings.readerShare = kReaderShare;
    settings.limits.memoryBytes -= held;
    STIPPLE_ASSIGN(lod::BuildReport report, lod::buildMeshStore(mesh.source, output, settings, executor, progress));
    report.notes.insert(report.notes.begin(), mesh.notes.begin(), mesh.notes.end());
    return report;
}

}  // namespace stipple::scene
