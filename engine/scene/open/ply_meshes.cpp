#include "engine/scene/open/ply_meshes.h"

#include <fmt/format.h>

#include <filesystem>

#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"

namespace stipple::scene {
namespace fs = std::filesystem;

std::string PlyMeshes::note() const {
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

Result<PlyMeshes> findPlyMeshes(const std::vector<std::string>& inputs, const OpenSettings& build) {
    PlyMeshes out;
    if (build.onlyPoints) return out;
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs, &out.notes));
    for (const std::string& file : files) {
        const auto faces = lod::plyFaces(file);
        if (!faces && files.size() == 1) return tl::unexpected(faces.error());
        if (faces && faces->any())  // (who opens the others says what is wrong with them)
            out.files.push_back(file);
        else
            ++out.others;
    }
    if (build.surfels > 0 && !out.files.empty())
        return fail(ErrorKind::usage, "samples meshes of glTF and OBJ files, and this is a PLY file with faces",
                    "--surfels with " + out.files.front(),
                    "leave it out to draw triangles, or give --only-points for the vertices");
    if (build.surfels > 0) return nothingToSample(inputs.front());
    return out;
}

Result<lod::BuildReport> buildPlyMeshes(const std::vector<std::string>& files, const std::string& output,
                                        const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                        Progress& progress) {
    STIPPLE_ASSIGN(const lod::BuildSettings wanted, build.settings());
    const std::string folder =
        wanted.tempFolder.empty() ? fs::absolute(output).parent_path().string() : wanted.tempFolder;
    settings.readerShare = 0.25;
    const auto forVertices = static_cast<uint64_t>(settings.readerShare * static_cast<double>(wanted.memoryBytes));
    std::vector<lod::MeshSource> sources;
    for (const std::string& file : files) {
        STIPPLE_ASSIGN(lod::MeshSource source, lod::openPlyMesh(file, forVertices / files.size(), folder));
        sources.push_back(std::move(source));
    }
    settings.description.source = fs::path(files.front()).filename().string();
    if (files.size() > 1) settings.description.source += fmt::format(" and {} more", files.size() - 1);
    settings.limits = wanted;
    settings.limits.memoryBytes -= forVertices;
    return lod::buildMeshStore(sources.size() == 1 ? sources.front() : lod::joined(std::move(sources)), output,
                               settings, executor, progress);
}

}  // namespace stipple::scene
