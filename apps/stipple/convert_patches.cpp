#include "apps/stipple/convert_patches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/stipple/build_patches.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/base/process.h"
#include "engine/base/words.h"
#include "engine/scene/open/mesh_files.h"
#include "engine/scene/place_looks.h"
#include "engine/scene/triangles.h"
#include "lod/builder/points/input_colours.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/patch_bytes.h"

namespace stipple::app {
namespace {
namespace fs = std::filesystem;

/// What is made patches of: the one or the other.
struct Source {
    lod::TriangleMesh mesh;
    lod::PlaceLooks looks;  ///< of the mesh, from `scene` and `images`
    std::unique_ptr<scene::Scene> scene;
    std::vector<scene::DecodedImage> images;
    std::vector<lod::PointMaterial> materials;  ///< what patches' numbers mean; empty: rough
    lod::PointBlock points;
    bool isMesh = false, isTwoSided = false, isUnlit = false;
};

Error interruptedAt(const std::string& output) {
    return {ErrorKind::interrupted, "interrupted; nothing is written", output, ""};
}

Result<lod::TriangleMesh> collect(const lod::MeshSource& source, const std::string& output) {
    lod::TriangleMesh all;
    const auto goOn = [&]() -> Result<void> {
        if (isStopRequested()) return tl::unexpected(interruptedAt(output));
        return {};
    };
    if (source.survey) STIPPLE_TRY(source.survey([&](uint64_t, uint64_t) { return goOn(); }));
    const auto take = [&](const lod::TriangleMesh& block) -> Result<void> {
        STIPPLE_TRY(goOn());
        lod::append(all, block);
        return {};
    };
    STIPPLE_TRY(source.read(take));
    return all;
}

/// To 8 bits: of files that have 16, unless no value needs them.
void narrowColours(lod::PointBlock& block) {
    if (block.colour16.empty()) return;
    uint64_t any = 0;
    for (const uint64_t c : block.colour16) any |= c;
    const bool isWide = ((any | any >> 16 | any >> 32) & 0xff00u) != 0;
    for (const uint64_t c : block.colour16) block.colour.push_back(lod::narrowed(c, isWide));
    block.colour16 = {};
}
/// Files that declare colours and have none.
bool isBlack(const std::vector<uint32_t>& colours) {
    return std::all_of(colours.begin(), colours.end(), [](uint32_t c) { return (c & 0xffffffu) == 0; });
}

Result<Source> readSource(const PatchConversion& o, std::vector<std::string>& notes) {
    Source out;
    if (scene::isSceneFile(o.input)) {
        STIPPLE_ASSIGN(scene::Scene scene, scene::readScene(o.input, o.build.reading()));
        STIPPLE_ASSIGN(out.mesh, collect(scene::triangleSource(scene, scene::placements(scene)), o.output));
        out.isMesh = !out.mesh.indices.empty();
        if (out.isMesh) {
            STIPPLE_ASSIGN(out.images, scene::decodeImages(scene, o.build.reading().memoryBytes, printLine));
            out.scene = std::make_unique<scene::Scene>(std::move(scene));
            out.looks = scene::placeLooks(*out.scene, out.images);
            out.materials = scene::materialList(*out.scene).list;
            out.isUnlit = scene::isAllUnlit(*out.scene);
            if (scene::hasTextures(*out.scene))
                notes.emplace_back(
                    "textures become colours and normals of samples; --patch-samples N for more of them");
            return out;
        }
    } else if (const auto hasMesh = lod::hasMesh(o.input, o.build.formatOptions()); hasMesh && *hasMesh) {
        STIPPLE_ASSIGN(const lod::OpenedMesh opened, lod::openMesh(o.input, o.build.formatOptions()));
        notes.insert(notes.end(), opened.notes.begin(), opened.notes.end());
        STIPPLE_ASSIGN(out.mesh, collect(opened.source, o.output));
        out.isMesh = true;
        return out;
    }
    STIPPLE_ASSIGN(const lod::PointSource source, scene::openInput(o.input, {}, 0, o.build.reading(), printLine));
    out.isTwoSided = source.info.isTwoSided;
    if (source.info.up == lod::UpAxis::z)
        notes.emplace_back("z is up in this file, and y in glTF: coordinates stay as they are, draw them with --up z");
    lod::PointBlock& all = out.points;
    bool hasColour = true, hasNormal = true;
    STIPPLE_TRY(lod::readPoints(source, [&](const lod::PointBlock& block) -> Result<void> {
        if (isStopRequested()) return tl::unexpected(interruptedAt(o.output));
        const size_t n = std::max(block.position.size(), block.lattice.size());
        for (size_t i = 0; i < n; ++i)
            all.position.push_back(block.lattice.empty()
                                       ? block.position[i]
                                       : glm::dvec3(block.lattice[i]) * source.info.scale + source.info.offset);
        hasColour = hasColour && block.colour.size() + block.colour16.size() == n;
        hasNormal = hasNormal && block.normal.size() == n;
        all.colour.insert(all.colour.end(), block.colour.begin(), block.colour.end());
        all.colour16.insert(all.colour16.end(), block.colour16.begin(), block.colour16.end());
        all.normal.insert(all.normal.end(), block.normal.begin(), block.normal.end());
        return {};
    }));
    narrowColours(all);
    if (!hasColour || isBlack(all.colour)) all.colour.clear();
    out.isUnlit = !all.colour.empty() && !source.info.isReflectance;  // light is in them
    if (!hasNormal) all.normal.clear();
    return out;
}

glm::vec4 linearColour(uint32_t srgb) {
    const auto channel = [&](uint32_t shift) {
        return shared::linearFromSrgb(static_cast<float>(srgb >> shift & 255u) / 255.0f);
    };
    return {channel(0), channel(8), channel(16), 1};
}

/// Primitives of a kind, one for each material.
class ByMaterial {
  public:
    explicit ByMaterial(scene::PrimitiveKind kind) : kind_(kind) {}
    scene::Primitive& of(uint8_t material) {
        auto& [primitive, vertices] = made_[material];
        primitive.kind = kind_;
        primitive.material = material;
        return primitive;
    }
    /// The vertex of a sample in the primitive of a material: made where it is not there yet.
    uint32_t vertexOf(uint8_t material, const lod::PatchCorner& corner, const std::vector<lod::Patch>& patches) {
        scene::Primitive& p = of(material);
        const lod::Patch& patch = patches[corner.patch];
        std::vector<std::vector<uint32_t>>& ofPatches = made_[material].vertices;
        ofPatches.resize(patches.size());
        std::vector<uint32_t>& vertices = ofPatches[corner.patch];
        if (vertices.empty()) vertices.assign(patch.heights.size(), ~0u);
        uint32_t& vertex = vertices[corner.sample];
        if (vertex != ~0u) return vertex;
        vertex = static_cast<uint32_t>(p.position.size());
        const lod::PatchSurface surface(patch);
        p.position.emplace_back(surface.position(corner.sample));
        p.normal.push_back(
            glm::normalize(glm::vec3(surface.frame() * glm::dvec3(shared::octDecode(patch.normals[corner.sample])))));
        p.colour.push_back(linearColour(patch.colours[corner.sample]));
        return vertex;
    }
    void moveTo(std::vector<scene::Primitive>& to) {
        for (auto& [material, made] : made_) to.push_back(std::move(made.primitive));
    }

  private:
    struct Made {
        scene::Primitive primitive;
        std::vector<std::vector<uint32_t>> vertices;  ///< of the samples of each patch; ~0: not there
    };
    scene::PrimitiveKind kind_;
    std::map<uint8_t, Made> made_;
};

/// The samples of all patches as vertices, their cells and the gaps between them as triangles, each with the material
/// of its first corner.
void addTriangles(const lod::PatchSet& set, std::vector<scene::Primitive>& to) {
    ByMaterial made(scene::PrimitiveKind::triangles);
    const auto add = [&](const std::array<lod::PatchCorner, 3>& t) {
        const std::vector<uint8_t>& materials = set.patches[t[0].patch].materials;
        const uint8_t material = materials.empty() ? uint8_t{0} : materials[t[0].sample];
        for (const lod::PatchCorner& c : t)
            made.of(material).indices.push_back(made.vertexOf(material, c, set.patches));
    };
    for (uint32_t k = 0; k < set.patches.size(); ++k)
        lod::PatchSurface(set.patches[k]).triangles([&](size_t a, size_t b, size_t c) {
            const auto corner = [&](size_t s) { return lod::PatchCorner{k, static_cast<uint32_t>(s)}; };
            add({corner(a), corner(b), corner(c)});
        });
    for (const auto& gap : set.gaps) add(gap);
    made.moveTo(to);
}

void addPoints(const lod::PointBlock& left, std::vector<scene::Primitive>& to) {
    ByMaterial made(scene::PrimitiveKind::points);
    for (size_t i = 0; i < left.position.size(); ++i) {
        scene::Primitive& p = made.of(left.material.empty() ? uint8_t{0} : left.material[i]);
        p.indices.push_back(static_cast<uint32_t>(p.position.size()));
        p.position.emplace_back(left.position[i]);
        if (!left.colour.empty()) p.colour.push_back(linearColour(left.colour[i]));
        if (!left.normal.empty())
            p.normal.push_back(hasDirection(left.normal[i]) ? glm::normalize(withoutScale(left.normal[i]))
                                                            : glm::vec3(0, 0, 1));
    }
    made.moveTo(to);
}

scene::Scene sceneOf(const lod::PatchSet& set, const std::vector<lod::PointMaterial>& materials, bool isUnlit) {
    scene::Scene scene;
    scene::Mesh mesh;
    mesh.name = "patches";
    addTriangles(set, mesh.primitives);
    addPoints(set.left, mesh.primitives);
    std::set<int> used;  // of a grid most are not
    for (const scene::Primitive& p : mesh.primitives) used.insert(p.material);
    for (scene::Primitive& p : mesh.primitives)
        p.material = static_cast<int>(std::distance(used.begin(), used.find(p.material)));
    for (const int number : used) {
        const auto k = static_cast<size_t>(number);
        const lod::PointMaterial from = k < materials.size() ? materials[k] : lod::PointMaterial{};
        scene::Material material;
        material.name = used.size() > 1 ? fmt::format("patches {}", k) : "patches";
        material.metallic = from.metallic;
        material.roughness = from.roughness;
        material.optics = from.optics;
        material.isDoubleSided = set.isTwoSided;
        material.isUnlit = isUnlit;
        scene.materials.push_back(material);
    }
    scene.meshes.push_back(std::move(mesh));
    scene::Node node;
    node.name = "patches";
    node.mesh = 0;
    node.local[3] = glm::dvec4(set.middle, 1);
    scene.nodes.push_back(node);
    return scene;
}

/// The most that a place is moved by becoming fp32 about the middle; infinite where that holds one not at all.
double roundingOf(const lod::PatchSet& set) {
    double most = 0;
    const auto add = [&](const glm::dvec3& p) {
        const double moved = glm::distance(glm::dvec3(glm::vec3(p)), p);
        most = moved <= most ? most : std::isfinite(moved) ? moved : std::numeric_limits<double>::infinity();
    };
    for (const lod::Patch& patch : set.patches) {
        const lod::PatchSurface surface(patch);
        for (size_t s = 0; s < patch.heights.size(); ++s)
            if (patch.heights[s] != 0) add(surface.position(s));
    }
    for (const glm::dvec3& p : set.left.position) add(p);
    return most;
}

struct Report {
    double seconds = 0, geometryBytes = 0, allBytes = 0;  ///< bytes a sample
    uint64_t bytes = 0, fileBytes = 0;                    ///< as patches, and as the triangles that are written
};

Report reportOf(const lod::PatchSet& set, double seconds) {
    Report r;
    r.seconds = seconds;
    const lod::PatchBytes encoded = lod::encodePatches(set.patches);
    const auto samples = static_cast<double>(std::max<uint64_t>(set.samples, 1));
    r.bytes = encoded.bytes.size();
    r.geometryBytes = static_cast<double>(encoded.geometry) / samples;
    r.allBytes = static_cast<double>(encoded.bytes.size()) / samples;
    return r;
}

void printAsJson(const PatchConversion& o, const lod::PatchSet& set, const Report& r,
                 const std::vector<std::string>& notes) {
    printJson("convert", {{"points", set.pointsIn},
                          {"triangles", set.trianglesIn},
                          {"dropped", set.dropped},
                          {"patches", set.patches.size()},
                          {"samples", set.samples},
                          {"patch_triangles", set.triangles},
                          {"gap_triangles", set.gaps.size()},
                          {"open_edges", set.openEdges},
                          {"points_left", set.pointsLeft},
                          {"coded_bytes", r.bytes},
                          {"file_bytes", r.fileBytes},
                          {"bytes_a_sample", {{"geometry", r.geometryBytes}, {"all", r.allBytes}}},
                          {"to_source", {{"bound", set.toSource.bound}, {"rms", set.toSource.rms}}},
                          {"from_source", {{"bound", set.fromSource.bound}, {"rms", set.fromSource.rms}}},
                          {"notes", notes},
                          {"written", {o.output}},
                          {"seconds", r.seconds},
                          {"peak_rss_bytes", peakRssBytes()}});
}

void printAsText(const PatchConversion& o, const lod::PatchSet& set, const Report& r, bool isMesh) {
    const uint64_t in = isMesh ? set.trianglesIn : set.pointsIn;
    fmt::print("{}: {} became {} with {} and {}; {} {} points\n", o.input, counted(in, isMesh ? "triangle" : "point"),
               counted(set.patches.size(), "patch", "patches"), counted(set.samples, "sample"),
               counted(set.triangles, "triangle"), counted(set.pointsLeft, "point"),
               isMesh                ? "of vertices are left as"
               : set.pointsLeft == 1 ? "stays one of the"
                                     : "stay");
    fmt::print(
        "  bytes a sample as patches: {:.2f} geometry, {:.2f} with normals and colours ({} in all); as triangles, "
        "which this file has, {}\n",
        r.geometryBytes, r.allBytes, humanBytes(r.bytes), humanBytes(r.fileBytes));
    fmt::print(
        "  from patches to the source: {:.3g} at most, {:.3g} rms; from the source to patches: {:.3g} at most, "
        "{:.3g} rms (units of the file)\n",
        set.toSource.bound, set.toSource.rms, set.fromSource.bound, set.fromSource.rms);
    if (o.fillGaps)
        fmt::print("  {} between patches, {} left open\n", counted(set.gaps.size(), "triangle"),
                   counted(set.openEdges, "edge"));
    for (const auto& [reason, count] : set.dropped) fmt::print("  dropped {}: {}\n", count, reason);
    fmt::print("  {:.2f} s, {:.2f} M {}s/s, peak memory {}\n  {}\n", r.seconds,
               static_cast<double>(in) / r.seconds * 1e-6, isMesh ? "triangle" : "point", humanBytes(peakRssBytes()),
               o.output);
}

}  // namespace

void addPatchOptions(CLI::App& app, bool& patches, PatchConversion& o) {
    app.add_flag("--patches", patches,
                 "elevation patches: heights over tilted planes, written as triangles, with the points that no patch "
                 "fits as points; says how large they are and how far off");
    app.add_option("--cone", o.settings.coneDegrees, "of patches: half the cone of a patch's normals, degrees")
        ->transform(within(5.0, 75.0))
        ->capture_default_str();
    app.add_flag("--overlap", o.overlap, "of patches: each reaches over its neighbours (the default)");
    app.add_flag("--fill-gaps", o.fillGaps, "of patches: they do not overlap, triangles fill the gaps between them");
    app.add_flag("--leave-gaps", o.open)->group("");
    app.add_option("--patch-samples", o.settings.samples,
                   "of patches: samples aimed at (default: as many as points or vertices, of a mesh 20,000 at least)")
        ->transform(within<uint64_t>(1, 1'000'000'000))
        ->type_name("N");
    app.add_flag("--only-points", o.build.onlyPoints, "of what could be triangles take points");
    app.add_option("--threads", o.build.threads, "of patches: threads (0: all cores)")
        ->transform(within(0, 1024))
        ->capture_default_str();
    o.build.addProgressTo(app);
}

Result<void> convertToPatches(const PatchConversion& given) {
    PatchConversion o = given;
    o.settings.closing = o.fillGaps ? lod::PatchClosing::gaps
                         : o.open   ? lod::PatchClosing::open
                                    : lod::PatchClosing::overlap;
    o.settings.isStopped = isStopRequested;
    const std::string extension = fs::path(o.output).extension().string();
    if (extension != ".glb" && extension != ".gltf")
        return fail(ErrorKind::usage, "is no scene: patches are written as triangles", o.output,
                    "write to .glb or .gltf");
    if (o.fillGaps && o.overlap)
        return fail(ErrorKind::usage, "are two ways to close what is between patches", "--fill-gaps and --overlap",
                    "give one of them");
    STIPPLE_TRY(checkOutputs({{o.output}}, {o.input}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    const auto executor = makeTbbExecutor(o.build.threads);
    std::vector<std::string> notes;
    lod::PatchSet set;
    std::vector<lod::PointMaterial> materials;
    bool isMesh = false, isUnlit = false;
    {
        Progress progress(o.build.styleOf(false));
        STIPPLE_ASSIGN(Source source, readSource(o, notes));
        isMesh = source.isMesh;
        isUnlit = source.isUnlit;
        o.settings.isTwoSided = source.isTwoSided;
        o.settings.looks = source.looks;
        materials = source.materials;
        o.settings.hasFineNormals = lod::hasMirrors(materials);
        if (!isMesh && source.points.position.empty()) return fail(ErrorKind::input, "holds no points", o.input);
        progress.plan(isMesh ? std::vector<JobPlan::Stage>{{"patches", 1}}
                             : std::vector<JobPlan::Stage>{{"normals", 0.4}, {"patches", 0.6}});
        set = isMesh ? lod::patchesOfMesh(std::move(source.mesh), o.settings, *executor, progress)
                     : lod::patchesOfPoints(std::move(source.points), o.settings, *executor, progress);
        o.settings.looks = nullptr;  // they are of `source`
        STIPPLE_TRY(checkStopped(o.output));
        for (const std::string& note : notes) progress.say(note);
    }
    if (set.patches.empty() && set.left.position.empty())
        return fail(ErrorKind::input, "holds nothing that could be a patch or a point", o.input);
    const double rounding = roundingOf(set);
    if (!std::isfinite(rounding) || !std::isfinite(set.toSource.bound) || !std::isfinite(set.fromSource.bound))
        return fail(ErrorKind::input, "is too large: fp32 does not hold its places", o.input,
                    "scale it to smaller units");
    set.toSource.bound += rounding;  // triangles between moved corners move no farther
    set.fromSource.bound += rounding;
    Report report = reportOf(set, nowSeconds() - start);
    STIPPLE_TRY(scene::writeGltf(sceneOf(set, materials, isUnlit), o.output));
    for (const fs::path& path : {fs::path(o.output), fs::path(o.output).replace_extension(".bin")})
        if (std::error_code error; (extension == ".gltf" || path == fs::path(o.output)) && fs::exists(path, error))
            report.fileBytes += fs::file_size(path, error);
    if (o.json)
        printAsJson(o, set, report, notes);
    else
        printAsText(o, set, report, isMesh);
    return {};
}

}  // namespace stipple::app
