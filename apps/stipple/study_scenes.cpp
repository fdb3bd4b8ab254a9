#include "apps/stipple/study_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/stipple/build_patches.h"
#include "apps/stipple/calibrate.h"
#include "apps/stipple/calibration.h"
#include "apps/stipple/camera_options.h"
#include "apps/stipple/mode_options.h"
#include "apps/stipple/options.h"
#include "apps/study/sweep/paths.h"
#include "apps/study/sweep/report.h"
#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/image/image_io.h"
#include "engine/scene/open/scene_facts.h"
#include "lod/store/file_kind.h"

namespace stipple::app {
namespace {

namespace fs = std::filesystem;

/// What is studied where nothing else is asked for.
struct Usual {
    std::vector<std::string> sizes;
    std::vector<double> errors;
    std::vector<uint64_t> budgets;
    uint32_t views, blocks, frames, samples;
};
const Usual kQuick{{"640x360"}, {0.5, 1, 2, 4, 8}, {50'000, 200'000, 800'000}, 1, 6, 3, 2};
const Usual kMiddle{{"1280x720"}, {0.5, 1, 2, 4, 8}, {125'000, 500'000, 2'000'000}, 2, 6, 10, 3};
const Usual kFull{{"1280x720", "1920x1080", "3840x2160"},
                  {0.25, 0.5, 1, 2, 4, 8, 16},
                  {500'000, 1'000'000, 2'000'000, 4'000'000, 8'000'000, 16'000'000},
                  4,
                  12,
                  25,
                  4};
/// Where frames cost as their pixels, records and triangles do: two sizes, one camera a path.
const Usual kCalibration{{"640x360", "1280x720"}, {0.5, 1, 2, 4, 8}, {}, 1, 3, 3, 1};
const Usual& usualOf(const StudyOptions& o) {
    return o.calibrate ? kCalibration : o.quick ? kQuick : o.full ? kFull : kMiddle;
}

/// A way to build scenes that is studied beside the usual one.
struct BuildVariant {
    std::string name;
    void (*set)(BuildOptions&);
};
const std::array<BuildVariant, 4> kBuilds{{{"usual", [](BuildOptions&) {}},
                                           {"fine-normals", [](BuildOptions& b) { b.normals = "fine"; }},
                                           {"given-radii", [](BuildOptions& b) { b.radii = "keep"; }},
                                           {"merged", [](BuildOptions& b) { b.duplicates = "merge"; }}}};

Result<study::StudySettings> settingsOf(const StudyOptions& o) {
    const Usual& usual = usualOf(o);
    study::StudySettings s;
    s.output = o.output;
    s.targets = o.errors.empty() ? usual.errors : o.errors;
    std::sort(s.targets.begin(), s.targets.end());
    s.targets.erase(std::unique(s.targets.begin(), s.targets.end()), s.targets.end());
    for (const double t : s.targets)
        if (!(t >= 0.01 && t <= 1000)) return fail(ErrorKind::usage, "are pixels, 0.01 to 1000", "--errors");
    if (o.budgets.empty()) s.budgets = usual.budgets;
    for (const std::string& text : o.budgets) {
        if (text == "none" && o.budgets.size() == 1) break;
        const auto records = parseCount(text);
        if (!records || *records == 0)
            return fail(ErrorKind::usage, "are numbers of records, or none", "--budgets " + text, "e.g. 500k,2M");
        s.budgets.push_back(*records);
    }
    std::sort(s.budgets.begin(), s.budgets.end());
    s.budgets.erase(std::unique(s.budgets.begin(), s.budgets.end()), s.budgets.end());
    for (const std::string& text : o.sizes.empty() ? usual.sizes : o.sizes) {
        STIPPLE_ASSIGN(const glm::uvec2 size, parseSize(text));
        s.sizes.push_back(size);
    }
    for (const render::Reconstruction& r : render::reconstructions())
        if (o.modes.empty() || std::find(o.modes.begin(), o.modes.end(), r.name) != o.modes.end())
            s.modes.push_back(r.mode);
    s.blocks = o.blocks > 0 ? o.blocks : usual.blocks;
    s.frames = o.frames > 0 ? o.frames : usual.frames;
    s.samples = usual.samples;
    s.seed = o.seed;
    s.residentBytes = parseBytes(o.resident);
    if (s.residentBytes == 0) return fail(ErrorKind::usage, "is not a size", "--resident " + o.resident, "e.g. 1G");
    return s;
}

/// Before scenes are built, which may take hours.
Result<void> checkCanBeMade(const std::string& folder) {
    fs::path there = fs::absolute(folder);
    std::error_code error;
    while (!fs::exists(there, error) && there.has_parent_path() && there != there.parent_path())
        there = there.parent_path();
    if (!fs::is_directory(there, error))
        return fail(ErrorKind::output, "is no folder", there.string(), "choose another --output");
    return {};
}

bool holdsPatches(const lod::Hierarchy& h) {
    bool found = false;
    for (uint32_t n = 0; n < h.nodes.size() && !found; ++n)
        h.forEachPayload(n, [&](uint32_t index) { found = found || h.payload(index).kind == lod::Kind::patches; });
    return found;
}

/// The mesh that a store of patches was built from.
Result<void> readAgainst(const std::string& input, const StudyOptions& o, study::StudyScene& s) {
    const bool isPatches = s.placed.size() == 1 && holdsPatches(s.placed.front().store->hierarchy);
    if (!lod::isStoreFile(input) || !isPatches || !hasTriangles(o.against))
        return fail(ErrorKind::usage, "is the mesh that a built scene of patches was built from",
                    "--against " + o.against, "give one SCENE, a .stipple store of patches of a mesh");
    STIPPLE_ASSIGN(const lod::TriangleMesh mesh, readTriangles(o.against, o.build.reading()));
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
        s.against.push_back(
            {mesh.position[mesh.indices[i]], mesh.position[mesh.indices[i + 1]], mesh.position[mesh.indices[i + 2]]});
    s.againstName = printable(fs::path(o.against).filename().string());
    return {};
}

Result<study::StudyScene> studySceneOf(const std::string& input, const StudyOptions& o, Executor& executor) {
    STIPPLE_ASSIGN(OpenedScene opened, scene::openScene({input}, o.build.told(o.quiet || o.json), executor));
    STIPPLE_ASSIGN(const lod::ColourBy colour, scene::applyColours(opened, "auto", "", ""));
    study::StudyScene s;
    s.name = printable(fs::path(input).filename().string());
    if (!scene::isSceneFile(input) && scene::hasPoints(opened.placed)) s.source = input;
    s.hash = sceneHash(opened);
    s.draw.lights = opened.lights;
    s.draw.lit = scene::isLit("auto", opened.description, colour);
    s.draw.worldUp = opened.description.up;
    s.up = opened.description.up;
    s.nearPlane = scene::nearPlaneOf(opened);
    s.outline = opened.outline;
    std::vector<const lod::Store*> seen;
    for (const render::PlacedStore& p : opened.placed)
        if (std::find(seen.begin(), seen.end(), p.store.get()) == seen.end()) {
            seen.push_back(p.store.get());
            s.records += p.store->description.points;
            s.storeBytes += p.store->fileBytes;
        }
    const uint32_t count = o.views > 0 ? o.views : usualOf(o).views;
    if (o.path.empty()) {
        s.views = study::usualViews(s.outline, s.up, count);
    } else {
        STIPPLE_ASSIGN(const scene::CameraPath path, scene::readCameraPath(o.path, s.up));
        s.views = study::viewsOfPath(path, printable(fs::path(o.path).stem().string()), 4 * count);
    }
    s.placed = std::move(opened.placed);
    s.groups = std::move(opened.groups);
    if (!o.against.empty()) STIPPLE_TRY(readAgainst(input, o, s));
    return s;
}

study::Provenance provenanceOf(const Executor& executor, const render::Backend& backend) {
    study::Provenance p;
    p.version = STIPPLE_VERSION;
    p.compiler = __VERSION__;
    p.flags = STIPPLE_FLAGS;
    std::ifstream program("/proc/self/exe", std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(program), {}};
    if (!bytes.empty()) p.program = hexDigits(hashBytes(bytes.data(), bytes.size()));
    p.machine = study::machineNow(executor.threads());
    p.device = fmt::format("{}, {}", backend.name(), backend.device());
    return p;
}

}  // namespace

void StudyOptions::addTo(CLI::App& sub) {
    sub.add_option("SCENE", scenes, "scenes, each studied by itself (built into the cache first)");
    sub.add_flag("--full", full, "three sizes up to 3840x2160, errors from a quarter of a pixel to 16, many frames")
        ->excludes("--quick");
    std::vector<std::string> names;
    for (const render::Reconstruction& r : render::reconstructions()) names.emplace_back(r.name);
    sub.add_option("--modes", modes, "modes to study, with commas (all)")->delimiter(',')->check(oneOf(names));
    sub.add_option("--errors", errors, "errors asked for, pixels, with commas")->delimiter(',')->type_name("PX,PX");
    sub.add_option("--sizes", sizes, "sizes of pictures, with commas")->delimiter(',')->type_name("WxH,WxH");
    sub.add_option("--budgets", budgets,
                   "records drawn at most, with commas: what the first mode shows within them; none: no budgets")
        ->delimiter(',')
        ->type_name("N,N");
    names.clear();
    for (const BuildVariant& v : kBuilds) names.emplace_back(v.name);
    sub.add_option(
           "--builds", builds,
           "how scenes are built, with commas, each scene studied once for each: usual; fine-normals (each from "
           "its own neighbours); given-radii (none are estimated); merged (one point a place)")
        ->delimiter(',')
        ->check(oneOf(names));
    sub.add_option("--views", views, "cameras of each of orbit, dolly, fly-through and grazing")
        ->transform(within(1, 1000));
    sub.add_option("--camera-path", path, "JSON file with a path of your own instead (stipple render --help)")
        ->type_name("FILE");
    sub.add_option("--against", against,
                   "the mesh that a .stipple scene of patches was built from: pictures are audited against it, and not "
                   "against the scene's leaves")
        ->type_name("FILE");
    sub.add_option("--blocks", blocks,
                   "times that everything is drawn again, in another order; below 6 no two times "
                   "can be told apart")
        ->transform(within(1, 1000));
    sub.add_option("--frames", frames, "frames of each visit in a block")->transform(within(1, 10000));
    sub.add_option("--seed", seed, "of the order of frames")
        ->transform(within(uint64_t{0}, uint64_t{1} << 62))
        ->capture_default_str();
    sub.add_option("--device", device, "cpu, gpu, gpu:NAME or auto")->type_name("DEVICE")->capture_default_str();
    sub.add_option("--resident", resident, "memory for what is drawn, bytes, of all scenes together")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
}

Result<void> runCalibration(const StudyOptions& o) {
    catchStopSignals();
    STIPPLE_ASSIGN(const study::StudySettings settings, settingsOf(o));
    if (!o.path.empty()) STIPPLE_TRY(InputFile::open(o.path));
    const auto executor = makeTbbExecutor(o.build.threads);
    Progress progress(!o.quiet && !o.json);
    for (const std::string& input : o.scenes) {
        STIPPLE_ASSIGN(auto backend, makeBackend(o.device, *executor));
        STIPPLE_ASSIGN(const study::StudyScene scene, studySceneOf(input, o, *executor));
        STIPPLE_TRY(calibrate(scene, settings, std::move(backend), *executor, o.json,
                              [&](uint64_t done, uint64_t total) -> Result<void> {
                                  progress.update("calibrate: " + scene.name, done, total);
                                  return checkStopped(scene.name, "nothing was kept of it");
                              }));
    }
    return {};
}

Result<void> runSceneStudy(const StudyOptions& o) {
    catchStopSignals();
    STIPPLE_ASSIGN(study::StudySettings settings, settingsOf(o));
    if (!o.path.empty()) STIPPLE_TRY(InputFile::open(o.path));
    if (!o.against.empty() && (o.scenes.size() != 1 || !o.builds.empty()))
        return fail(ErrorKind::usage, "is of studies of one scene", "--against", "give one SCENE and no --builds");
    STIPPLE_TRY(checkCanBeMade(o.output));
    STIPPLE_TRY(image::checkModule(true));
    const auto executor = makeTbbExecutor(o.build.threads);
    STIPPLE_ASSIGN(const auto backend, makeBackend(o.device, *executor));
    std::vector<study::StudyScene> scenes;
    bool isAnyPoints = false;
    for (const std::string& input : o.scenes)
        for (const std::string& name : o.builds.empty() ? std::vector<std::string>{"usual"} : o.builds) {
            StudyOptions with = o;
            for (const BuildVariant& v : kBuilds)
                if (v.name == name) v.set(with.build);
            STIPPLE_ASSIGN(study::StudyScene scene, studySceneOf(input, with, *executor));
            if (name != "usual") scene.name += " (" + name + ")";
            isAnyPoints = isAnyPoints || scene::hasPoints(scene.placed);
            scenes.push_back(std::move(scene));
        }
    if (!isAnyPoints && o.modes.empty()) settings.modes.resize(1);  // modes are ways of drawing points
    const study::Provenance provenance = provenanceOf(*executor, *backend);
    STIPPLE_TRY(study::claimFolder(scenes, settings, provenance));
    Progress progress(!o.quiet && !o.json);
    progress.plan({{"errors", 0.7}, {"times", 0.3}});
    const study::Host host{*executor, [&](const std::string& device) { return makeBackend(device, *executor); },
                           [&](const std::string& what, uint64_t done, uint64_t total) -> Result<void> {
                               progress.update(what, done, total);
                               return checkStopped(o.output, "the same command goes on from here");
                           }};
    STIPPLE_ASSIGN(const study::StudyResult result, study::runStudy(scenes, settings, provenance, o.device, host));
    const std::vector<study::Summary> all = study::summarise(result);
    STIPPLE_TRY(study::writeStudy(scenes, result, all));
    progress.rest();
    if (o.json)
        printJson("scene-study", study::jsonOfStudy(scenes, result, all));
    else
        fmt::print("{}", study::describeStudy(scenes, result, all));
    return {};
}

}  // namespace stipple::app
