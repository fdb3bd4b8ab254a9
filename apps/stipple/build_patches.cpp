#include "apps/stipple/build_patches.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/options.h"
#include "engine/base/hash.h"
#include "engine/base/words.h"
#include "engine/scene/open/mesh_files.h"
#include "engine/scene/place_looks.h"
#include "engine/scene/triangles.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/builder/scan_store/scan_store_build.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"

namespace stipple::app {
namespace fs = std::filesystem;

void bakeMaterials(const scene::Scene& scene, lod::TriangleMesh& mesh) {
    for (size_t v = 0; v < mesh.colour.size(); ++v) {
        const size_t m = mesh.surface[v] & shared::kSurfaceMaterialMask;
        if (m >= scene.materials.size()) continue;
        uint32_t out = mesh.colour[v] & 0xff000000u;
        for (int k = 0; k < 3; ++k) {
            const float linear = shared::linearFromSrgb(static_cast<float>(mesh.colour[v] >> (8 * k) & 255u) / 255.0f);
            out |= unitToByte(shared::srgbFromLinear(linear * scene.materials[m].baseColour[k])) << (8 * k);
        }
        mesh.colour[v] = out;
    }
}

nlohmann::json patchCountsJson(const lod::PatchCounts& of) {
    if (of.patches + of.discs == 0) return {};
    return {{"patches", of.patches}, {"samples", of.samples}, {"left", of.left}, {"discs", of.discs}};
}

namespace {

tl::unexpected<Error> noTriangles(const std::string& input) {
    return fail(ErrorKind::input, "holds no triangles", input, "patches are made of triangles or points");
}

Result<lod::PatchBuildSettings> settingsOf(const BuildOptions& build) {
    lod::PatchBuildSettings settings;
    STIPPLE_ASSIGN(settings.limits, build.settings());
    settings.coneDegrees = build.patches.coneDegrees;
    settings.samples = build.patches.samples;
    if (build.patches.texels != "auto") settings.maps.texels = static_cast<uint32_t>(std::stoul(build.patches.texels));
    if (build.material) settings.description.pointMaterials = {*build.material};
    settings.description.up =
        lod::axisVector(build.up.empty() ? lod::UpAxis::y : static_cast<lod::UpAxis>(build.up[0] - 'x'));
    return settings;
}

Result<lod::BuildReport> ofScans(const std::vector<std::string>& inputs, const std::string& output,
                                 const BuildOptions& build, Executor& executor, Progress& progress) {
    if (build.material)
        return fail(ErrorKind::usage, "is of meshes", "--patches of a scan with a material",
                    "leave it out here, and give it when drawing");
    lod::ScanBuildSettings settings;
    STIPPLE_ASSIGN(settings.points, build.settings());
    settings.coneDegrees = build.patches.coneDegrees;
    settings.samples = build.patches.samples;
    return lod::buildScanStore(inputs, output, settings, executor, progress);
}

Result<lod::BuildReport> ofMeshes(const std::vector<std::string>& files, const std::string& output,
                                  const BuildOptions& build, Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(lod::PatchBuildSettings settings, settingsOf(build));
    settings.readerShare = 0.25;
    const auto forReader =
        static_cast<uint64_t>(settings.readerShare * static_cast<double>(settings.limits.memoryBytes));
    lod::FormatOptions more = build.formatOptions();
    if (more.tempFolder.empty()) more.tempFolder = fs::absolute(output).parent_path().string();
    more.memoryBytes = forReader;
    STIPPLE_ASSIGN(const lod::OpenedMesh mesh, scene::openMeshes(files, more));
    settings.description.source = fs::path(files.front()).filename().string();
    if (files.size() > 1) settings.description.source += fmt::format(" and {} more", files.size() - 1);
    settings.limits.memoryBytes -= forReader;
    STIPPLE_ASSIGN(lod::BuildReport report, lod::buildPatchStore(mesh.source, output, settings, executor, progress));
    report.notes.insert(report.notes.begin(), mesh.notes.begin(), mesh.notes.end());
    return report;
}

/// What a scene's materials and textures say, in memory as long as the build.
struct Looks {
    std::vector<scene::DecodedImage> images;
    uint64_t imageBytes = 0, identity = 0;
    lod::PlaceLooks looks;  ///< empty: all has one material, no textures, and is lit by others' light alone
    lod::TextureDetail detail;
};

Result<Looks> looksOf(const scene::Scene& scene, const scene::MaterialList& materials, uint64_t memoryBytes) {
    Looks out;
    if (!scene::hasTextures(scene) && materials.list.size() < 2 && !scene::hasLight(scene)) return out;
    STIPPLE_ASSIGN(out.images, scene::decodeImages(scene, memoryBytes, printLine));
    for (const scene::DecodedImage& image : out.images) {
        const uint64_t bytes = image.rgba.size() * sizeof(uint32_t);
        out.imageBytes += bytes;
        out.identity = out.identity * 31 + hashBytes(image.rgba.data(), bytes);
    }
    for (const lod::PointMaterial& m : materials.list)
        for (const char c : lod::identityOf(m)) out.identity = out.identity * 31 + static_cast<unsigned char>(c);
    for (const scene::Material& m : scene.materials)
        for (const char c : fmt::format("{},{},{},{}", m.isUnlit, m.emissive.x, m.emissive.y, m.emissive.z))
            out.identity = out.identity * 31 + static_cast<unsigned char>(c);
    out.looks = scene::placeLooks(scene, out.images);
    out.detail = scene::textureDetail(scene, out.images);
    return out;
}

Result<lod::BuildReport> ofScene(const std::string& input, const std::string& output, const BuildOptions& build,
                                 Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(lod::PatchBuildSettings settings, settingsOf(build));
    STIPPLE_ASSIGN(scene::Scene scene, scene::readScene(input, build.reading()));
    lod::MeshSource source = scene::triangleSource(scene, scene::placements(scene));
    if (source.triangles == 0) return noTriangles(input);
    settings.description.source = fs::path(input).filename().string();
    const scene::MaterialList materials = scene::materialList(scene);
    STIPPLE_ASSIGN(const Looks looks, looksOf(scene, materials, settings.limits.memoryBytes));
    settings.looks = looks.looks;
    settings.maps.detail = looks.detail;
    settings.maps.detail.hasLight = looks.detail.hasLight && !build.material;  // which says how all of it is lit
    settings.looksIdentity = looks.identity;
    settings.readerShare = static_cast<double>(looks.imageBytes) / static_cast<double>(settings.limits.memoryBytes);
    settings.limits.memoryBytes -= looks.imageBytes;
    if (!build.material && (settings.maps.detail.hasLight ||
                            !(materials.list.size() == 1 && materials.list.front() == lod::PointMaterial{})))
        settings.description.pointMaterials = materials.list;
    if (!settings.looks)
        source.read = [plain = source.read, &scene](const lod::MeshSource::Take& take) {
            return plain([&](const lod::TriangleMesh& block) {
                lod::TriangleMesh baked = block;
                bakeMaterials(scene, baked);
                for (uint32_t& surface : baked.surface) surface &= ~shared::kSurfaceMaterialMask;
                return take(baked);
            });
        };
    STIPPLE_ASSIGN(lod::BuildReport report, lod::buildPatchStore(source, output, settings, executor, progress));
    if (!build.material && materials.hasMixedOptics())
        report.notes.emplace_back("some of it is glass and some is not: patches of one store are opaque then");
    report.notes.insert(report.notes.begin(), scene.notes.begin(), scene.notes.end());
    return report;
}

Result<lod::TriangleMesh> collect(const lod::MeshSource& source) {
    lod::TriangleMesh all;
    if (source.survey) STIPPLE_TRY(source.survey([](uint64_t, uint64_t) { return Result<void>(); }));
    STIPPLE_TRY(source.read([&](const lod::TriangleMesh& block) -> Result<void> {
        const auto first = static_cast<uint32_t>(all.position.size());
        all.position.insert(all.position.end(), block.position.begin(), block.position.end());
        for (const uint32_t i : block.indices) all.indices.push_back(first + i);
        return {};
    }));
    return all;
}

}  // namespace

Result<lod::TriangleMesh> readTriangles(const std::string& input, const scene::ReadSettings& reading) {
    lod::MeshSource source;
    scene::Scene scene;
    if (scene::isSceneFile(input)) {
        STIPPLE_ASSIGN(scene, scene::readScene(input, reading));
        source = scene::triangleSource(scene, scene::placements(scene));
    } else {
        STIPPLE_ASSIGN(lod::OpenedMesh mesh,
                       lod::openMesh(input, {.memoryBytes = reading.memoryBytes, .openingBytes = reading.memoryBytes}));
        source = std::move(mesh.source);
    }
    STIPPLE_ASSIGN(lod::TriangleMesh all, collect(source));
    if (all.indices.empty()) return noTriangles(input);
    return all;
}

bool hasTriangles(const std::string& input) {
    if (scene::isSceneFile(input)) return true;
    const auto hasMesh = lod::hasMesh(input, {});
    return hasMesh && *hasMesh;
}

Result<std::vector<glm::dvec3>> readPlaces(const std::string& input, const scene::ReadSettings& reading) {
    std::vector<glm::dvec3> all;
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs({input}, nullptr));
    for (const std::string& file : files) {
        STIPPLE_ASSIGN(const lod::PointSource source, scene::openInput(file, {}, 0, reading, printLine));
        STIPPLE_TRY(lod::readPoints(source, [&](const lod::PointBlock& block) -> Result<void> {
            all.insert(all.end(), block.position.begin(), block.position.end());
            for (const glm::ivec3& p : block.lattice)
                all.push_back(glm::dvec3(p) * source.info.scale + source.info.offset);
            return {};
        }));
    }
    return all;
}

void addPatchBuildOptions(CLI::App& app, PatchBuildOptions& o) {
    CLI::Option* const patches = app.add_flag(
        "--patches", o.isAsked,
        "of meshes and scans: elevation patches, heights over tilted planes, in a few bytes a sample; triangles "
        "that no patch fits become discs, points stay points");
    app.add_option("--cone", o.coneDegrees, "of patches: half the cone of a patch's normals, degrees")
        ->transform(within(5.0, 75.0))
        ->needs(patches)
        ->capture_default_str();
    app.add_flag("--overlap", o.overlap, "of patches: each reaches over its neighbours (the default)")->needs(patches);
    app.add_flag("--fill-gaps", o.fillGaps)->group("");  // (said why not)
    app.add_option("--patch-samples", o.samples,
                   "of patches: samples of the finest level, about (default: one a vertex or point, and where the "
                   "shape asks for more, up "
                   "to four a triangle or two a point)")
        ->transform(within<uint64_t>(1, 100'000'000'000))
        ->needs(patches)
        ->type_name("N");
    app.add_option(
           "--patch-texels", o.texels,
           "of patches of textured meshes: texels of their maps along an edge of a cell: 1 (no maps: colours of "
           "the samples alone), 2, 4, 8, or as many as the textures hold")
        ->transform(CLI::IsMember({"auto", "1", "2", "4", "8"}))
        ->needs(patches)
        ->type_name("K")
        ->capture_default_str();
}

Result<lod::BuildReport> buildPatches(const std::vector<std::string>& inputs, const std::string& output,
                                      const BuildOptions& build, Executor& executor, Progress& progress) {
    if (build.patches.fillGaps)
        return fail(ErrorKind::usage, "is not for stores, whose levels only an overlap closes", "--fill-gaps",
                    "leave it out; convert --patches --fill-gaps writes a scene");
    if (build.ranks != nullptr)
        return fail(ErrorKind::usage, "does not go with --mpi", "--patches", "build it in one process");
    if (build.surfels > 0 || build.surfelWeights)
        return fail(ErrorKind::usage, "is of surfaces", "--patches with --surfels or --surfel-weights",
                    "leave one of them out");
    if (scene::isSceneFile(inputs.front())) {
        if (inputs.size() > 1)
            return fail(ErrorKind::usage, "only one scene with meshes can be built at a time", inputs[1]);
        return ofScene(inputs.front(), output, build, executor, progress);
    }
    STIPPLE_ASSIGN(const scene::MeshFiles meshes, scene::findMeshFiles(inputs, build));
    if (!meshes.areAll()) return ofScans(inputs, output, build, executor, progress);
    STIPPLE_ASSIGN(lod::BuildReport report, ofMeshes(meshes.files, output, build, executor, progress));
    report.notes.insert(report.notes.begin(), meshes.notes.begin(), meshes.notes.end());
    return report;
}

}  // namespace stipple::app
