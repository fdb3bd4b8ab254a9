// Any input to stores that can be drawn: built scenes, scenes of placed stores and meshes, raw files through the cache.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/image/image_io.h"
#include "engine/scene/curves.h"
#include "engine/scene/gltf/container.h"
#include "engine/scene/open/build_bytes.h"
#include "engine/scene/open/builds_of_scene.h"
#include "engine/scene/open/cache.h"
#include "engine/scene/open/mesh_files.h"
#include "engine/scene/open/open_scene.h"
#include "engine/scene/open/proxies.h"
#include "engine/scene/open/scene_facts.h"
#include "engine/scene/outline.h"
#include "engine/scene/triangles.h"
#include "lod/builder/curves/curve_build.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/import.h"
#include "lod/store/colour.h"
#include "lod/store/file_kind.h"
#include "lod/store/nearest.h"

namespace stipple::scene {
namespace fs = std::filesystem;

Result<lod::PointSource> openInput(const std::string& path, const lod::ReadOptions& options, uint64_t surfels,
                                   const ReadSettings& reading, const Say& say, const lod::FormatOptions& more) {
    if (!isSceneFile(path)) return lod::openPointSource(path, options, more);
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(path, reading));
    STIPPLE_ASSIGN(const std::vector<scene::DecodedImage> images, decodeImages(scene, reading.memoryBytes, say));
    return scene::sampleSurfels(scene, images, {surfels});
}

namespace {

/// With every attribute that there is, so that no colour asks for another build.
Result<std::shared_ptr<const lod::Store>> openBuilt(const std::vector<std::string>& inputs, const OpenSettings& build,
                                                    Executor& executor) {
    STIPPLE_ASSIGN(const lod::BuildSettings asked, build.settings());
    lod::BuildSettings settings = asked;
    settings.attributes.clear();
    settings.allAttributes = settings.leaveOutUnlike = !isSceneFile(inputs.front());
    STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> store,
                   openCached(inputs, build, "points", [&](const std::string& path, Progress& progress) {
                       return lod::buildStore(inputs, path, settings, executor, progress);
                   }));
    const std::vector<lod::AttributeInfo>& has = store->description.attributes;
    for (const std::string& name : asked.attributes)
        if (std::none_of(has.begin(), has.end(), [&](const lod::AttributeInfo& a) { return a.name == name; }))
            return fail(ErrorKind::usage, fmt::format("has no attribute '{}'", name), inputs.front(),
                        "stipple info lists them");
    return store;
}

/// A transform as rotation, even scale and translation.
Result<lod::Instance> placeOf(const glm::dmat4& m, const std::string& where) {
    lod::Instance place;
    const glm::dmat3 linear(m);
    place.scale = std::cbrt(std::abs(glm::determinant(linear)));
    place.translation = glm::dvec3(m[3]);
    const glm::dmat3 rotation = linear / std::max(place.scale, 1e-300);
    const glm::dmat3 product = glm::transpose(rotation) * rotation;
    double deviation = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) deviation = std::max(deviation, std::abs(product[c][r] - (c == r ? 1 : 0)));
    if (!(place.scale > 0) || !(deviation < 1e-6) || glm::determinant(linear) < 0)
        return fail(ErrorKind::input, "places a store with uneven scale, shear or a mirror", where,
                    "stores can be moved, turned and scaled evenly");
    // What is no rotation but for rounding is none: records then stay as they are.
    double fromIdentity = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) fromIdentity = std::max(fromIdentity, std::abs(rotation[c][r] - (c == r ? 1 : 0)));
    if (fromIdentity > 1e-12) place.rotation = rotation;
    return place;
}

lod::UpAxis axisNamed(const std::string& up) { return static_cast<lod::UpAxis>(up[0] - 'x'); }

/// What `--up` says, else y, as glTF, OBJ and PLY have it.
glm::dvec3 meshUp(const OpenSettings& build) {
    return lod::axisVector(build.up.empty() ? lod::UpAxis::y : axisNamed(build.up));
}

/// Of the placed meshes of a scene.
Result<lod::MeshBuildSettings> meshSettings(const scene::Scene& scene, const std::vector<scene::Placement>& placed,
                                            const OpenSettings& build) {
    lod::MeshBuildSettings settings;
    settings.description.source = fs::path(scene.path).filename().string();
    settings.description.up = meshUp(build);
    settings.description.materials = scene::surfaceMaterials(scene);
    settings.textures = scene::textureImages(scene);
    STIPPLE_ASSIGN(std::vector<scene::DecodedImage> images,
                   decodeImages(scene, build.reading().memoryBytes, build.loss));
    settings.description.optics = scene::surfaceOptics(scene, placed, images);
    std::vector<size_t> last(images.size());  // texture that uses an image last, and may have it
    for (size_t t = 0; t < settings.textures.size(); ++t)
        if (scene.textures[t].image >= 0) last[static_cast<size_t>(scene.textures[t].image)] = t;
    for (size_t t = 0; t < settings.textures.size(); ++t) {
        if (scene.textures[t].image < 0) continue;
        const auto i = static_cast<size_t>(scene.textures[t].image);
        settings.textures[t].width = images[i].width;
        settings.textures[t].height = images[i].height;
        settings.textures[t].rgba = last[i] == t ? std::move(images[i].rgba) : images[i].rgba;
    }
    return settings;
}

bool holds(const scene::Scene& scene, const scene::Placement& placed, scene::PrimitiveKind kind) {
    const auto& primitives = scene.meshes[static_cast<size_t>(placed.mesh)].primitives;
    return std::any_of(primitives.begin(), primitives.end(), [&](const auto& p) { return p.kind == kind; });
}

lod::CurveBuildSettings curveSettings(const std::string& input) {
    lod::CurveBuildSettings settings;
    settings.description.source = fs::path(input).filename().string();
    return settings;
}

}  // namespace

Result<lod::BuildReport> buildCurves(const lod::CurveSource& raw, const std::string& input, const std::string& output,
                                     const OpenSettings& build, Executor& executor, Progress& progress) {
    lod::CurveBuildSettings settings = curveSettings(input);
    STIPPLE_ASSIGN(settings.limits, build.settings());
    settings.description.isRigid = !raw.isPlant;
    lod::CurveSource turned = raw;
    if (!build.up.empty())
        turned.read = [&raw, up = lod::axisVector(axisNamed(build.up))](const lod::CurveSource::Take& take) {
            return raw.read([&](lod::CurveSet block) {
                block.up = up;
                return take(block);
            });
        };
    return lod::buildCurveStore(lod::cleanSource(turned, build.curveRadius), output, settings, executor, progress);
}

namespace {

Result<lod::BuildReport> buildCurveFile(const std::string& input, const std::string& output, const OpenSettings& build,
                                        Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(const lod::CurveSource curves, lod::openCurves(input));
    return buildCurves(curves, input, output, build, executor, progress);
}

/// Meshes with primitives of a kind: one that stands in several places is to be built once and placed, all others as
/// one.
struct SharedPlaces {
    struct Shared {
        int mesh;
        std::vector<lod::Instance> instances;
    };
    std::vector<Shared> shared;
    std::vector<scene::Placement> once;
};
SharedPlaces sharePlaces(const scene::Scene& scene, scene::PrimitiveKind kind) {
    std::map<int, std::vector<scene::Placement>> byMesh;
    for (const scene::Placement& p : scene::placements(scene))
        if (holds(scene, p, kind)) byMesh[p.mesh].push_back(p);
    SharedPlaces out;
    for (const auto& [mesh, places] : byMesh) {
        std::vector<lod::Instance> instances;
        for (const scene::Placement& p : places)
            if (const auto instance = placeOf(p.world, scene.path)) instances.push_back(*instance);
        if (places.size() == 1 || instances.size() < places.size())  // one of a kind, or skewed or mirrored
            out.once.insert(out.once.end(), places.begin(), places.end());
        else
            out.shared.push_back({mesh, std::move(instances)});
    }
    return out;
}

/// The triangles of a scene.
Result<void> placeTriangles(const scene::Scene& scene, const OpenSettings& build, Executor& executor,
                            std::vector<render::PlacedStore>& placed) {
    const auto make = [&](const std::vector<scene::Placement>& of) {
        return [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
            STIPPLE_ASSIGN(lod::MeshBuildSettings settings, meshSettings(scene, of, build));
            STIPPLE_ASSIGN(settings.limits, build.settings());
            return lod::buildMeshStore(scene::triangleSource(scene, of), path, settings, executor, progress);
        };
    };
    const SharedPlaces places = sharePlaces(scene, scene::PrimitiveKind::triangles);
    for (const auto& [mesh, instances] : places.shared) {
        const std::vector<scene::Placement> own{{mesh, glm::dmat4(1)}};
        STIPPLE_ASSIGN(const std::shared_ptr<const lod::Store> store,
                       openCached({scene.path}, build, fmt::format("mesh {}", mesh), make(own)));
        render::PlacedStore one{store, {}, {}};
        STIPPLE_ASSIGN(one.proxies, meshProxies(scene, own, *store, fmt::format("mesh {}", mesh), build, executor));
        build.together->settle(fmt::format("mesh {}, proxy", mesh));  // what is small has none
        for (const lod::Instance& instance : instances) {
            one.place = instance;
            placed.push_back(one);
        }
    }
    if (places.once.empty()) return {};
    STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> store,
                   openCached({scene.path}, build, "triangles", make(places.once)));
    render::PlacedStore one{store, {}, {}};
    STIPPLE_ASSIGN(one.proxies, meshProxies(scene, places.once, *store, "triangles", build, executor));
    build.together->settle("triangles, proxy");
    placed.push_back(std::move(one));
    return {};
}

/// The ribbons and tubes of a scene. What stands in many places also gets a proxy, and all those
/// together are an instance group.
Result<void> placeCurves(const scene::Scene& scene, const OpenSettings& build, Executor& executor,
                         OpenedScene& opened) {
    const auto open = [&](const SharedModel& model, const std::string& part) {
        return openCached(
            {scene.path}, build, part, [&](const std::string& to, Progress& progress) -> Result<lod::BuildReport> {
                lod::CurveBuildSettings settings = curveSettings(scene.path);
                STIPPLE_ASSIGN(settings.limits, build.settings());
                return lod::buildCurveStore(lod::sourceOf(model->curves()), to, settings, executor, progress);
            });
    };
    const auto modelOf = [&](const std::vector<scene::Placement>& of) {
        return std::make_shared<CurveModel>(
            [of, &scene, radius = build.curveRadius] {
                return lod::cleanCurves(scene::flattenCurves(scene, of), radius);
            },
            executor);
    };
    const SharedPlaces places = sharePlaces(scene, scene::PrimitiveKind::lines);
    GroupBuilder group;
    for (const auto& [mesh, instances] : places.shared) {
        const SharedModel model = modelOf({{mesh, glm::dmat4(1)}});
        const std::string part = fmt::format("curves of mesh {}", mesh);
        STIPPLE_ASSIGN(const std::shared_ptr<const lod::Store> store, open(model, part));
        render::PlacedStore one{store, {}, {}};
        STIPPLE_ASSIGN(one.proxies, curveProxies(model, *store, scene.path, part, build, executor));
        build.together->settle(part + ", proxy");
        const auto first = static_cast<uint32_t>(opened.placed.size());
        for (const lod::Instance& instance : instances) {
            one.place = instance;
            opened.placed.push_back(one);
        }
        group.add(model, first, static_cast<uint32_t>(instances.size()));
    }
    STIPPLE_TRY(group.finish(scene.path, build, executor, opened));
    if (places.once.empty()) return {};
    STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> store, open(modelOf(places.once), "curves"));
    opened.placed.push_back({std::move(store), {}, {}});
    return {};
}

/// Vertices of a kind in those places.
double workOf(const scene::Scene& scene, const std::vector<scene::Placement>& of, scene::PrimitiveKind kind) {
    double work = 1;
    for (const scene::Placement& p : of)
        for (const scene::Primitive& primitive : scene.meshes[static_cast<size_t>(p.mesh)].primitives)
            if (primitive.kind == kind) work += static_cast<double>(primitive.position.size());
    return work;
}

/// What may have to be built of a scene. (Proxies take about as long as what they stand for.)
std::shared_ptr<BuildsOfScene> expectedBuilds(const scene::Scene& scene, bool areTriangles, const OpenSettings& build) {
    std::vector<std::string> notes;
    for (const std::string& note : scene.notes) notes.push_back(fmt::format("{}: {}", scene.path, note));
    auto builds = std::make_shared<BuildsOfScene>(build.progressStyle, build.onProgress, std::move(notes));
    const auto expect = [&](const std::string& part, double work, bool hasProxy) {
        builds->expect(part, work);
        if (hasProxy) builds->expect(part + ", proxy", work);
    };
    const auto expectKind = [&](scene::PrimitiveKind kind, const char* shared, const char* once, bool hasProxy) {
        const SharedPlaces places = sharePlaces(scene, kind);
        for (const auto& [mesh, instances] : places.shared)
            expect(fmt::format("{} {}", shared, mesh), workOf(scene, {{mesh, glm::dmat4(1)}}, kind), true);
        if (!places.once.empty()) expect(once, workOf(scene, places.once, kind), hasProxy);
    };
    if (areTriangles) expectKind(scene::PrimitiveKind::triangles, "mesh", "triangles", true);
    expectKind(scene::PrimitiveKind::lines, "curves of mesh", "curves", false);
    const double points = workOf(scene, scene::placements(scene), scene::PrimitiveKind::points);
    if (points > 1) builds->expect("points", points);
    return builds;
}

/// The stores that a scene's nodes refer to, and its meshes.
Result<void> openSceneFile(const std::string& path, const OpenSettings& options, Executor& executor,
                           OpenedScene& opened) {
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(path, options.reading()));
    OpenSettings build = options;
    build.together = expectedBuilds(scene, build.surfels == 0, build);
    opened.lights = lightsOf(scene);
    opened.cameras = camerasOf(scene);
    opened.effects = {scene.effects.names, scene.effects.values, path};
    std::vector<render::PlacedStore>& placed = opened.placed;
    std::map<std::string, std::shared_ptr<const lod::Store>> open;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    const std::vector<bool> visible = scene.visibility();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        const scene::Node& node = scene.nodes[n];
        if (node.store.empty() || !visible[n]) continue;
        if (open.count(node.store) == 0) {
            STIPPLE_ASSIGN(open[node.store], openStoreFile(node.store, lod::Tables::asNeeded));
        }
        std::vector<glm::dmat4> places = node.instances;
        if (places.empty()) places.emplace_back(1);
        for (const glm::dmat4& place : places) {
            STIPPLE_ASSIGN(const lod::Instance instance,
                           placeOf(world[n] * place, path + ": node '" + node.name + "'"));
            placed.push_back({open[node.store], instance, {}});
        }
    }
    const std::vector<scene::Placement> meshes = scene::placements(scene);
    const auto anyHolds = [&](scene::PrimitiveKind kind) {
        return std::any_of(meshes.begin(), meshes.end(), [&](const auto& p) { return holds(scene, p, kind); });
    };
    if (build.surfels == 0) STIPPLE_TRY(placeTriangles(scene, build, executor, placed));
    STIPPLE_TRY(placeCurves(scene, build, executor, opened));
    if (build.surfels > 0 || anyHolds(scene::PrimitiveKind::points) || placed.empty()) {
        STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> points, openBuilt({path}, build, executor));
        placed.push_back({std::move(points), {}, {}});
    }
    for (const std::string& note : scene.notes) say(build, "note: " + printable(note));
    return {};
}

}  // namespace

Result<lod::MeshBuildSettings> meshFileSettings(const OpenSettings& build) {
    scene::Scene plain;
    return meshSettings(plain, {}, build);
}

namespace {

/// Scene files are read as a whole: is there memory for that? What is asked for suffices for the build that follows.
Result<void> checkSceneMemory(const std::string& path, uint64_t memoryBytes) {
    constexpr uint64_t kTimes = 4;      // the file, its arrays, and a copy of either on the way (measured: 3.9)
    constexpr uint64_t kOfJson = 8;     // a scene's JSON, parsed, and what it names
    constexpr uint64_t kOfBuild = 180;  // MiB: what a build of triangles takes however few they are
    const auto enough = [](uint64_t bytes) { return fmt::format("give --memory {}M", (bytes >> 20) + 1 + kOfBuild); };
    std::error_code error;
    uint64_t bytes = fs::file_size(path, error);
    if (error) return {};  // whoever opens it says why
    if (fs::path(path).extension() == ".gltf") {
        auto c = scene::gltf::readContainer(path, memoryBytes);
        if (!c && c.error().kind == ErrorKind::budget) c.error().hint = enough(kOfJson * bytes);
        if (!c) return tl::unexpected(c.error());
        const nlohmann::json none = nlohmann::json::array();
        const nlohmann::json& buffers = c->json.contains("buffers") ? c->json["buffers"] : none;
        for (const auto& buffer : buffers)
            if (buffer.is_object() && buffer.contains("byteLength") && buffer["byteLength"].is_number_unsigned())
                bytes += std::min(buffer["byteLength"].get<uint64_t>(), uint64_t{1} << 40);
    }
    if (kTimes * bytes <= memoryBytes) return {};
    return fail(ErrorKind::budget,
                fmt::format("a scene file is read as a whole, which takes about {}, but --memory allows {}",
                            humanBytes(kTimes * bytes), humanBytes(memoryBytes)),
                path, enough(kTimes * bytes) + ", or triangles as PLY, which need not fit");
}

/// By this rank: what is wrong with them otherwise, all ranks find alike.
Result<void> areSeen(const std::vector<std::string>& inputs) {
    for (const std::string& input : inputs)
        if (std::error_code error; fs::is_regular_file(input, error)) STIPPLE_TRY(InputFile::open(input));
    return {};
}

/// Scans, or files that all have triangles.
Result<lod::BuildReport> buildFiles(const std::vector<std::string>& inputs, const std::string& output,
                                    const OpenSettings& build, Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(const MeshFiles meshes, findMeshFiles(inputs, build));
    if (meshes.areAll()) {
        if (build.material) return noPointsToLight(inputs.front());
        STIPPLE_ASSIGN(lod::MeshBuildSettings settings, meshFileSettings(build));
        STIPPLE_ASSIGN(lod::BuildReport report,
                       buildMeshFiles(meshes.files, output, build, std::move(settings), executor, progress));
        report.notes.insert(report.notes.begin(), meshes.notes.begin(), meshes.notes.end());
        return report;
    }
    STIPPLE_ASSIGN(const lod::BuildSettings settings, build.settings());
    STIPPLE_ASSIGN(lod::BuildReport report, lod::buildStore(inputs, output, settings, executor, progress));
    if (const std::string note = meshes.note(); !note.empty()) report.notes.push_back(note);
    return report;
}

}  // namespace

Result<lod::BuildReport> buildAny(const std::vector<std::string>& inputs, const std::string& output,
                                  const OpenSettings& build, Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(const lod::BuildSettings settings, build.settings());
    STIPPLE_TRY(agree(build.ranks, areSeen(inputs)));
    for (const std::string& input : inputs)
        if (lod::fileKindOf(input) == lod::FileKind::store)
            return fail(ErrorKind::usage, "is built already", input, "render or view it");
    if (inputs.size() == 1 && lod::isCurveFile(inputs[0]) && build.surfels > 0) return nothingToSample(inputs[0]);
    if (inputs.size() == 1 && lod::isCurveFile(inputs[0]))
        return build.material ? noPointsToLight(inputs[0])
                              : buildCurveFile(inputs[0], output, build, executor, progress);
    if (!isSceneFile(inputs.front())) return buildFiles(inputs, output, build, executor, progress);
    if (build.surfels > 0) return lod::buildStore(inputs, output, settings, executor, progress);
    if (inputs.size() > 1)
        return fail(ErrorKind::usage, "only one scene with meshes can be built at a time", inputs[1]);
    STIPPLE_TRY(checkSceneMemory(inputs.front(), settings.memoryBytes));
    STIPPLE_ASSIGN(scene::Scene scene, scene::readScene(inputs.front(), build.reading()));
    return buildReadScene(
        std::move(scene), output, build, [&] { return lod::buildStore(inputs, output, settings, executor, progress); },
        executor, progress);
}

Result<lod::BuildReport> buildReadScene(scene::Scene scene, const std::string& output, const OpenSettings& build,
                                        const std::function<Result<lod::BuildReport>()>& buildPoints,
                                        Executor& executor, Progress& progress) {
    STIPPLE_ASSIGN(const lod::BuildSettings settings, build.settings());
    const lod::MeshSource triangles = scene::triangleSource(scene, scene::placements(scene));
    const auto counted = [&](scene::PrimitiveKind kind) {
        uint64_t sum = 0;
        for (const scene::Placement& p : scene::placements(scene))
            for (const auto& q : scene.meshes[static_cast<size_t>(p.mesh)].primitives)
                sum += q.kind == kind ? q.indices.size() : 0;
        return sum;
    };
    const uint64_t lines = counted(scene::PrimitiveKind::lines) / 2, points = counted(scene::PrimitiveKind::points);
    if (build.material && (triangles.triangles > 0 || points == 0)) return noPointsToLight(scene.path);
    if (triangles.triangles == 0 && points == 0 && lines > 0)
        return buildCurves(scene::curveSource(scene, scene::placements(scene)), scene.path, output, build, executor,
                           progress);
    if (triangles.triangles == 0) return buildPoints();
    if (lines + points > 0)
        scene.notes.push_back(fmt::format(
            "a store holds one kind of primitive: {} lines and {} points are left out; view the scene file to see all",
            lines, points));
    STIPPLE_ASSIGN(lod::MeshBuildSettings mesh, meshSettings(scene, scene::placements(scene), build));
    mesh.limits = settings;
    STIPPLE_ASSIGN(lod::BuildReport report, lod::buildMeshStore(triangles, output, mesh, executor, progress));
    report.notes.insert(report.notes.begin(), scene.notes.begin(), scene.notes.end());
    return report;
}

namespace {

/// The stores of inputs that are no scene file.
Result<std::shared_ptr<const lod::Store>> openFiles(const std::vector<std::string>& inputs, const OpenSettings& build,
                                                    Executor& executor) {
    if (lod::isStoreFile(inputs.front())) return openStoreFile(inputs.front(), lod::Tables::asNeeded);
    if (inputs.size() == 1 && lod::isCurveFile(inputs[0]) && build.surfels > 0) return nothingToSample(inputs[0]);
    if (inputs.size() == 1 && lod::isCurveFile(inputs[0]))
        return openCached(inputs, build, "curves", [&](const std::string& path, Progress& progress) {
            return buildCurveFile(inputs[0], path, build, executor, progress);
        });
    STIPPLE_ASSIGN(const MeshFiles meshes, findMeshFiles(inputs, build));
    if (meshes.areAll())
        return openCached(inputs, build, "triangles",
                          [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
                              STIPPLE_ASSIGN(lod::MeshBuildSettings settings, meshFileSettings(build));
                              return buildMeshFiles(meshes.files, path, build, std::move(settings), executor, progress);
                          });
    if (const std::string note = meshes.note(); !note.empty()) say(build, "note: " + note);
    return openBuilt(inputs, build, executor);
}

}  // namespace

double nearPlaneOf(const OpenedScene& opened) {
    // Only what no double can tell from the eye: each frame finds its own from what is around the eye.
    return std::max(1e-300, 1e-15 * glm::length(opened.description.boundsMax - opened.description.boundsMin));
}

void turnUp(OpenedScene& scene, lod::UpAxis up) { scene.description.up = lod::axisVector(up); }

Result<void> checkInputs(const std::vector<std::string>& inputs) {
    for (const std::string& input : inputs)
        if (inputs.size() > 1 && (lod::isStoreFile(input) || isSceneFile(input)))
            return fail(ErrorKind::usage, "a built scene and other inputs cannot be mixed", input,
                        "name one scene, or only raw inputs; a .gltf scene can place several stores");
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs, nullptr));
    for (const std::string& file : files)
        if (std::error_code error; !fs::is_directory(file, error)) {
            STIPPLE_ASSIGN(const InputFile opened, InputFile::open(file));
            // (One of many may be passed over.)
            if (files.size() == 1 && opened.sizeBytes() == 0)
                return fail(ErrorKind::input, "is empty", file, "is the download complete?");
        }
    return {};
}

Result<OpenedScene> openScene(const std::vector<std::string>& inputs, const OpenSettings& given, Executor& executor) {
    STIPPLE_TRY(checkInputs(inputs));
    OpenedScene scene;
    // The axis is of the picture: what is in the cache serves any.
    OpenSettings build = given;
    build.kept = std::make_shared<lod::Kept>();  // of this scene
    build.up.clear();
    build.leftovers = lod::Leftovers::goOnOrReplace;
    if (isSceneFile(inputs.front())) {
        STIPPLE_TRY(openSceneFile(inputs.front(), build, executor, scene));
    } else {
        STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> store, openFiles(inputs, build, executor));
        scene.placed.push_back({std::move(store), {}, {}});
    }
    // Points that stand in for meshes are lit. Beside scans that keep their photographed colours they would not be,
    // unless curves have all of them lit.
    const auto isOf = [](bool shaded) {
        return [shaded](const render::PlacedStore& p) {
            return !p.store->hierarchy.isMesh() && isShaded(p.store->description) == shaded;
        };
    };
    const auto any = [&](const auto& is) { return std::any_of(scene.placed.begin(), scene.placed.end(), is); };
    if (any(isOf(false)) && !any(isOf(true)))
        for (render::PlacedStore& p : scene.placed) p.proxies = nullptr;
    scene.description = describe(scene.placed);
    scene.outline = outlineOf(scene.placed);
    if (!given.up.empty())
        turnUp(scene, axisNamed(given.up));
    else if (!isSceneFile(inputs.front()) && looksZUp(scene.description))
        say(build, "note: the scene is flat along z, but y is up, as its format has it; is z up? --up z");
    releaseFreeMemory();
    return scene;
}

Result<std::shared_ptr<const render::Backdrop>> openBackdrop(const std::string& path, double scale,
                                                             uint64_t memoryBytes, Executor& executor) {
    STIPPLE_ASSIGN(render::HdrImage image, image::readHdr(path, memoryBytes));
    return std::make_shared<const render::Backdrop>(
        render::makeBackdrop(std::move(image), static_cast<float>(scale), executor));
}

Result<std::shared_ptr<const render::Environment>> openEnvironment(const std::string& path, double scale,
                                                                   uint64_t memoryBytes, Executor& executor,
                                                                   bool hasMirrors) {
    if (path.empty()) return std::shared_ptr<const render::Environment>();
    STIPPLE_ASSIGN(const render::HdrImage image, image::readHdr(path, memoryBytes));
    return std::make_shared<const render::Environment>(
        render::makeEnvironment(image, static_cast<float>(scale), executor, hasMirrors));
}

}  // namespace stipple::scene
