#include "engine/scene/open/build_bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "engine/scene/open/mesh_files.h"
#include "engine/scene/surfels.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"

namespace stipple::scene {
namespace {

using Bytes = std::shared_ptr<const ByteSource>;

/// Points of any format, or of a scene.
Result<lod::BuildReport> buildPointBytes(const std::vector<Bytes>& inputs, const Resolve& resolve,
                                         const std::string& output, const OpenSettings& build, Executor& executor,
                                         Progress& progress) {
    STIPPLE_ASSIGN(lod::BuildSettings settings, build.settings());
    // Keys that no file can have: a name may be that of a folder, or hold what patterns do.
    std::map<std::string, Bytes> byKey;
    std::vector<std::string> keys;
    for (const Bytes& input : inputs) {
        keys.push_back(fmt::format("/dev/null/{}", keys.size()));
        byKey[keys.back()] = input;
    }
    settings.open = [&](const std::string& key, const lod::ReadOptions& options) -> Result<lod::PointSource> {
        const Bytes& bytes = byKey.at(key);
        if (!isScene(bytes->path(), lod::fileKindOf(*bytes)))
            return lod::openPointSource(lod::fromBytes(bytes), options);
        const ReadSettings reading = build.reading();
        STIPPLE_ASSIGN(const Scene scene, readScene(*bytes, reading, resolve));
        STIPPLE_ASSIGN(const std::vector<DecodedImage> images, decodeImages(scene, reading.memoryBytes, build.loss));
        return sampleSurfels(scene, images, {build.surfels});
    };
    return lod::buildStore(keys, output, settings, executor, progress);
}

/// PLY with faces; all of them, or none is taken for triangles.
Result<bool> areTriangles(const std::vector<Bytes>& inputs) {
    const ByteSource* without = nullptr;
    size_t with = 0;
    for (const Bytes& input : inputs) {
        STIPPLE_ASSIGN(const lod::PlyFaces faces, lod::plyFaces(*input));
        with += faces.any() ? 1 : 0;
        if (!faces.any() && without == nullptr) without = input.get();
    }
    if (with > 0 && without != nullptr)
        return fail(ErrorKind::usage, "has no faces, others have: points and triangles are stores of their own",
                    without->path(), "build them apart");
    return with > 0;
}

Result<lod::BuildReport> buildTriangleBytes(const std::vector<Bytes>& inputs, const std::string& output,
                                            const OpenSettings& build, Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(const lod::BuildSettings wanted, build.settings());
    const auto held = static_cast<uint64_t>(kReaderShare * static_cast<double>(wanted.memoryBytes));
    const std::string folder =
        build.temp.empty() ? std::filesystem::absolute(output).parent_path().string() : build.temp;
    std::vector<lod::MeshSource> sources;
    for (const Bytes& input : inputs) {
        STIPPLE_ASSIGN(lod::MeshSource one, lod::openPlyMesh(input, held / inputs.size(), folder));
        sources.push_back(std::move(one));
    }
    lod::OpenedMesh all;
    all.source = sources.size() == 1 ? std::move(sources.front()) : lod::joined(std::move(sources));
    STIPPLE_ASSIGN(lod::MeshBuildSettings settings, meshFileSettings(build));
    settings.description.source = std::filesystem::path(inputs.front()->path()).filename().string();
    if (inputs.size() > 1) settings.description.source += fmt::format(" and {} more", inputs.size() - 1);
    return buildOpened(all, held, output, build, std::move(settings), executor, progress);
}

/// Scenes are read as a whole: their arrays, and a copy on the way (measured of files: 3.9 times).
Result<void> checkMemory(const ByteSource& scene, uint64_t memoryBytes) {
    constexpr uint64_t kTimes = 4;
    if (scene.sizeBytes() <= memoryBytes / kTimes) return {};
    return overBudget("a scene is read as a whole, which", kTimes * scene.sizeBytes(), memoryBytes, scene.path());
}

}  // namespace

Result<lod::BuildReport> buildBytes(const std::vector<Bytes>& inputs, const Resolve& resolve, const std::string& output,
                                    const OpenSettings& given, Executor& executor, Progress& progress) {
    OpenSettings build = given;
    build.leftovers = lod::Leftovers::replace;
    for (const Bytes& input : inputs)
        if (lod::fileKindOf(*input) == lod::FileKind::store)
            return fail(ErrorKind::usage, "is built already", input->path(), "write it to a file and open that");
    const ByteSource& first = *inputs.front();
    if (inputs.size() == 1 && lod::isCurveFile(first.path(), lod::fileKindOf(first))) {
        if (build.surfels > 0) return nothingToSample(first.path());
        STIPPLE_ASSIGN(const lod::CurveSource curves, lod::openCurves(inputs.front()));
        return buildCurves(curves, first.path(), output, build, executor, progress);
    }
    const auto points = [&] { return buildPointBytes(inputs, resolve, output, build, executor, progress); };
    for (const Bytes& input : inputs)
        if (inputs.size() > 1 && isScene(input->path(), lod::fileKindOf(*input)))
            return fail(ErrorKind::usage, "a scene is built alone", input->path());
    if (isScene(first.path(), lod::fileKindOf(first))) {
        STIPPLE_TRY(checkMemory(first, build.reading().memoryBytes));
        if (build.surfels > 0) return points();
        STIPPLE_ASSIGN(Scene scene, readScene(first, build.reading(), resolve));
        return buildReadScene(std::move(scene), output, build, points, executor, progress);
    }
    if (build.surfels > 0) return nothingToSample(first.path());
    STIPPLE_ASSIGN(const bool hasFaces, areTriangles(inputs));
    return hasFaces ? buildTriangleBytes(inputs, output, build, executor, progress) : points();
}

}  // namespace stipple::scene
