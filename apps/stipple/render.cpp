#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "apps/stipple/background_options.h"
#include "apps/stipple/calibration.h"
#include "apps/stipple/camera_options.h"
#include "apps/stipple/common.h"
#include "apps/stipple/effect_options.h"
#include "apps/stipple/exposure_options.h"
#include "apps/stipple/legend.h"
#include "apps/stipple/mode_options.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "apps/stipple/picture_loader.h"
#include "apps/stipple/render_frames.h"
#include "apps/stipple/sun_options.h"
#include "engine/base/file.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/base/words.h"
#include "engine/image/coverage.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/open/mesh_files.h"
#include "engine/scene/open/scene_facts.h"
#include "lod/store/materials.h"

namespace stipple::app {
namespace {

struct RenderCommand {
    std::vector<std::string> inputs;
    std::string output, size = "1280x720", device = "auto", shade = "auto";
    std::string debug = "none", resident = "1G", transfer = "srgb";
    double error = 1, curveExact = 2, wind = 0, seconds = 0;
    ModeOptions drawn;
    int frames = 1, samples = 4;
    uint64_t budget = 0;
    bool noWait = false, json = false, quiet = false, force = false, alpha = false;
    TargetOptions target;
    CameraOptions camera;
    ExposureOptions exposure;
    BuildOptions build;
    ColourOptions colour;
    EnvironmentOptions environment;
    BackgroundOptions background;
    SunOptions sun;
    MaterialOptions material;
    EffectOptions effects;
};

bool closesGaps(const std::string& mode) {
    const render::Reconstruction* of = render::reconstructionNamed(mode);
    return !of || of->closesGaps;
}

image::PictureFormat formatOf(const RenderCommand& o) {
    return {o.alpha, o.transfer == "rec709" ? image::Transfer::rec709 : image::Transfer::srgb};
}

/// What can be found out before a scene is built, which may take hours.
Result<void> checkArguments(const RenderCommand& o) {
    STIPPLE_TRY(o.camera.check());
    STIPPLE_TRY(o.exposure.check(o.camera, o.wind > 0));
    STIPPLE_TRY(o.material.check(o.shade));
    STIPPLE_TRY(o.effects.check());
    STIPPLE_TRY(o.sun.check(o.shade));
    if (o.target.isAny() && o.drawn.mode == "reference")
        return fail(ErrorKind::usage, "traces the full detail, whatever it takes", "--mode reference",
                    "leave out --target-ms and --target-error");
    if (!(o.error > 0)) return fail(ErrorKind::usage, "must be larger than 0", "--error");
    STIPPLE_TRY(o.background.check(o.environment));
    if (o.transfer == "rec709" && std::filesystem::path(o.output).extension() != ".png")
        return fail(ErrorKind::usage, "only a .png has colours that are encoded; an .exr has light itself",
                    "--transfer rec709", "leave it out, or write a .png");
    if (parseBytes(o.resident) == 0)
        return fail(ErrorKind::usage, "is not a size", "--resident " + o.resident, "e.g. 1G");
    for (const std::string& file : {o.camera.path, o.environment.path})
        if (!file.empty()) STIPPLE_TRY(InputFile::open(file));
    return {};
}

Result<render::FrameSettings> makeSettings(const RenderCommand& o, const lod::StoreDescription& d, const Shot& shot,
                                           const lod::ColourBy& colour, const std::vector<render::WorldLight>& lights) {
    render::FrameSettings s;
    s.draw.lights = lights;
    o.drawn.applyTo(s);
    s.budgets.errorPixels = o.error;
    if (o.budget > 0) s.budgets.records = o.budget;
    s.draw.unlitTriangles = o.shade == "unlit";
    s.draw.lit = scene::isLit(o.shade, d, colour);
    if (const auto material = o.material.material()) {
        s.draw.pointMaterial = lod::packed(*material);
        s.draw.optics = material->optics;
        s.draw.lit = true;
    }
    s.draw.worldUp = shot.worldUp;
    o.sun.applyTo(s.draw);
    s.draw.exactCurves = static_cast<float>(o.curveExact);
    s.draw.wind = {o.wind, o.seconds, render::windAcross(shot.worldUp)};
    static const std::array<const char*, 5> names{"none", "level", "error", "holes", "normals"};
    s.draw.debugView = static_cast<uint32_t>(std::find(names.begin(), names.end(), o.debug) - names.begin());
    s.wantDepthAndNormal = std::filesystem::path(o.output).extension() == ".exr";
    return s;
}

double quantile(std::vector<double> values, double q) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[static_cast<size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

nlohmann::json countersJson(const FrameCounters& c) {
    return {{"nodes_visited", c.nodesVisited},
            {"nodes_culled", c.nodesCulled},
            {"nodes_missing", c.nodesMissing},
            {"nodes_hidden", c.nodesHidden},
            {"records_hidden", c.recordsHidden},
            {"nodes_left_coarse", c.nodesLeftCoarse},
            {"nodes_seen_coarse", c.nodesSeenCoarse},
            {"records_tested", c.recordsTested},
            {"proxies", c.proxies},
            {"group_members", c.groupMembers},
            {"nodes_swaying", c.nodesSwaying},
            {"shadow_maps", c.shadowMaps},
            {"shadow_maps_drawn", c.shadowMapsDrawn},
            {"shadow_lights_left", c.shadowLightsLeft},
            {"cut_evaluations", c.cutEvaluations},
            {"passes", c.passes},
            {"blocks", c.blocks},
            {"requests", c.requests},
            {"uploads", c.uploads},
            {"evictions", c.evictions},
            {"failures", c.failures},
            {"refused", c.refused},
            {"budget_truncated", c.budgetTruncated},
            {"tau_target_px", c.budgetTruncated ? jsonNumber(INFINITY) : jsonNumber(c.tauTargetPixels)},
            {"cut_ms", c.cutMs}};
}

/// Before anything is read.
Result<void> checkPictures(const RenderCommand& o) {
    STIPPLE_TRY(image::checkImagePath(o.output));
    std::vector<std::string> inputs = o.inputs;
    inputs.insert(inputs.end(), {o.camera.path, o.environment.path});
    // An orbit of one picture, or a path with one key, writes the name itself.
    std::vector<Output> outputs{{o.output, OutputKind::picture}};
    if (!o.camera.path.empty() || o.camera.orbit > 0) {
        STIPPLE_TRY(outputTarget(numbered(o.output, 0)));
        for (Output& picture : numberedPictures(o.output)) outputs.push_back(std::move(picture));
    }
    return checkOutputs(outputs, inputs, o.force);
}

/// Before any work; what is drawn for its time is drawn alone, and a build before it is not begun in vain.
Result<void> startLoading(const RenderCommand& o, PictureLoader& pictures) {
    const bool isTimed = (o.frames > 1 && o.camera.path.empty()) || o.target.isAny();
    if (!isTimed) return pictures.start();
    return image::checkModule(isAddressSpaceLimited() || !lod::isStoreFile(o.inputs.front()));
}

/// What goes beside the error because it is not in it; nothing where nothing is stochastic.
std::string pruningText(const render::PrunedShares& pruned) {
    std::vector<std::string> parts;
    const auto addShare = [&](double share, const char* of) {
        if (share > 0) parts.push_back(fmt::format("{:.3g} % of the curves' area ({})", 100 * share, of));
    };
    addShare(pruned.narrowShare(), "narrower than a pixel");
    addShare(pruned.thinnedShare(), "wider for others left out");
    if (pruned.discs > 0) parts.push_back(fmt::format("{} discs of proxies of plants", pruned.discs));
    return parts.empty() ? "" : fmt::format(" (beside it, stochastic: {})", fmt::join(parts, ", "));
}

/// The delivered error, in words.
std::string errorText(const Verdict& verdict, const std::string& mode) {
    const double error = verdict.tauEffectivePixels;
    return (std::isfinite(error) ? fmt::format("{:.2f} px error", error) : "no stated error") +
           (!closesGaps(mode) ? " of each, gaps between them stay open" : "");
}

/// `--mode reference`: rays against the full detail.
Result<void> runTraced(const RenderCommand& o, const OpenedScene& scene, const Shot& shot,
                       const render::FrameSettings& settings, const Legend& legend, Executor& executor,
                       Written& written) {
    const reference::TraceSettings trace{static_cast<uint32_t>(o.samples), settings.draw};
    const auto rays = static_cast<uint64_t>(o.samples) * static_cast<uint64_t>(o.samples);
    nlohmann::json pictures = nlohmann::json::array();
    std::vector<double> frames;
    size_t empty = 0;
    for (size_t i = 0; i < shot.views.size(); ++i) {
        const std::string name = shot.views.size() > 1 ? numbered(o.output, i) : o.output;
        const double start = nowSeconds();
        STIPPLE_ASSIGN(render::Image traced, reference::trace(scene.placed, shot.views[i], trace, executor));
        const double seconds = nowSeconds() - start;
        const bool isEmpty = showsNothing(traced);
        empty += isEmpty ? 1 : 0;
        drawLegend(legend, traced);
        STIPPLE_TRY(image::writePicture(name, traced, formatOf(o)));
        ++written.pictures;
        frames.push_back(1e3 * seconds);
        pictures.push_back({{"path", name}, {"seconds", seconds}, {"shows_nothing", isEmpty}});
        if (!o.quiet && !o.json)
            fmt::print("{}: full detail, traced with {} a pixel, {:.1f} s\n", name, counted(rays, "ray"), seconds);
    }
    if (o.json)
        printJson("render", {{"backend", "trace"},
                             {"device", "fp64 rays against the full detail"},
                             {"mode", o.drawn.mode},
                             {"width", shot.views.front().width},
                             {"height", shot.views.front().height},
                             {"samples_per_pixel", rays},
                             {"frames", frames.size()},
                             {"frame_ms", {{"median", quantile(frames, 0.5)}, {"p95", quantile(frames, 0.95)}}},
                             {"seconds", std::accumulate(frames.begin(), frames.end(), 0.0) / 1e3},
                             {"tau_eff_px", 0},
                             {"complete", true},
                             {"incomplete_pictures", 0},
                             {"empty_pictures", empty},
                             {"pictures", pictures},
                             {"peak_rss_bytes", peakRssBytes()}});
    if (!o.quiet) sayEmpty(empty, shot.views.size(), o.output);
    return {};
}

nlohmann::json materialJson(const MaterialOptions& of) {
    const auto material = of.material();
    if (!material) return {};
    return {{"roughness", material->roughness}, {"metallic", material->metallic}};
}

/// Blocks of elevation patches that the last cut draws.
uint64_t patchBlocksOf(const render::FrameState& state) {
    uint64_t blocks = 0;
    for (const lod::CutDraw& draw : state.cut.draw) blocks += draw.triangles > 0 ? draw.count : 0;
    return blocks;
}
/// How patches are drawn, in words.
std::string patchAsText(const ModeOptions& drawn) {
    if (drawn.patchAs == "splats") return drawn.interpolate == "direct" ? "direct splats" : "splats";
    return drawn.patchAs == "samples" ? "samples" : "strips";
}
/// What the last frame drew, in words.
std::string drawnText(const render::FrameState& state, const ModeOptions& drawn) {
    const FrameCounters& c = state.counters;
    const uint64_t blocks = patchBlocksOf(state), ofPatches = blocks * shared::kPatchTriangles;
    const uint64_t triangles = c.trianglesDrawn - std::min(c.trianglesDrawn, ofPatches);
    std::vector<std::string> parts;
    if (c.recordsDrawn > 0) parts.push_back(counted(c.recordsDrawn, "record"));
    if (triangles > 0) parts.push_back(counted(triangles, "triangle"));
    if (blocks > 0)
        parts.push_back(fmt::format(
            "{} of patches as {}{}", counted(blocks, "block"), patchAsText(drawn),
            drawn.patchAs == "samples" ? "" : fmt::format(" ({} at most)", counted(ofPatches, "triangle"))));
    return parts.empty() ? counted(0, "record") : fmt::format("{}", fmt::join(parts, ", "));
}

/// The result, as text or JSON.
void tell(const RenderCommand& o, const render::FrameState& state, const render::DrawSettings& settings,
          const Verdict& verdict, const Timings& timings, const glm::uvec2& size, const Written& written) {
    const size_t views = written.of;
    const FrameCounters& c = state.counters;
    if (o.json) {
        nlohmann::json passes = nlohmann::json::array();
        for (size_t i = 0; i < timings.passNames.size(); ++i)
            passes.push_back({{"name", timings.passNames[i]}, {"ms", quantile(timings.passes[i], 0.5)}});
        const nlohmann::json j = {
            {"backend", state.backend->name()},
            {"device", state.backend->device()},
            {"mode", o.drawn.mode},
            {"normalise", o.drawn.mode == "ewa" ? nlohmann::json(o.drawn.normalise) : nlohmann::json()},
            {"point_material", materialJson(o.material)},
            {"width", size.x},
            {"height", size.y},
            {"frames", timings.frames.size()},
            {"accumulated", o.exposure.samples()},
            {"frame_ms", {{"median", quantile(timings.frames, 0.5)}, {"p95", quantile(timings.frames, 0.95)}}},
            {"passes", passes},
            {"effects", effectsJson(render::effectStatus(state, settings))},
            {"effect_changes", changesJson(written.walk.changes())},
            {"records_drawn", c.recordsDrawn},
            {"triangles_drawn", c.trianglesDrawn},
            {"patch_blocks_drawn", patchBlocksOf(state)},
            {"patch_as", patchBlocksOf(state) > 0 ? nlohmann::json(patchAsText(o.drawn)) : nlohmann::json()},
            {"nodes_drawn", c.nodesDrawn},
            {"closes_gaps", closesGaps(o.drawn.mode)},
            {"tau_eff_px", jsonNumber(verdict.tauEffectivePixels)},
            {"nodes_around_eye", verdict.leavesAround},
            {"stochastic",
             {{"narrow_curves", verdict.pruned.narrowShare()},
              {"thinned_curves", verdict.pruned.thinnedShare()},
              {"discs", verdict.pruned.discs}}},
            {"complete", verdict.isComplete()},
            {"incomplete_pictures", verdict.incomplete},
            {"empty_pictures", verdict.empty},
            {"worst_picture", verdict.worst},
            {"worst_picture_path", views > 1 ? numbered(o.output, verdict.worst) : o.output},
            {"bytes_streamed", c.bytesStreamed},
            {"resident_bytes", c.residentBytes},
            {"peak_rss_bytes", peakRssBytes()},
            {"first_image_ms", timings.firstImageMs},
            {"complete_ms", timings.completeMs},
            {"counters", countersJson(c)}};
        printJson("render", j);
    } else if (!o.quiet && views > 1) {
        fmt::print("{} pictures; the worst is {}: {}{}, {:.1f} ms a frame on {}\n", views,
                   numbered(o.output, verdict.worst), errorText(verdict, o.drawn.mode), pruningText(verdict.pruned),
                   quantile(timings.frames, 0.5), state.backend->device());
        fmt::print("{}", changesText(written.walk.changes()));
    } else if (!o.quiet) {
        fmt::print("{}: {}, {}{}, {:.1f} ms a frame on {}\n", o.output, drawnText(state, o.drawn),
                   errorText(verdict, o.drawn.mode), pruningText(verdict.pruned), quantile(timings.frames, 0.5),
                   state.backend->device());
    }
}

/// Lights that would cast shadows and get none.
void sayShadows(const render::FrameState& state) {
    if (const uint64_t left = state.counters.shadowLightsLeft; left > 0)
        fmt::print(stderr, "note: lights without shadows: {} (the first {} cast them, with a direction and a cone)\n",
                   left, shared::kMostShadowLights);
}

Result<void> checkWeights(const RenderCommand& o, const OpenedScene& scene) {
    if (o.drawn.normalise != "surfel" || scene::hasSurfelWeights(scene.placed)) return {};
    return fail(ErrorKind::usage, "no store of the scene has weights of surfels", "--normalise surfel",
                "build it with: stipple build --surfel-weights, or take --normalise pixel");
}

Result<void> run(const RenderCommand& o, PictureLoader& pictures, Written& written) {
    catchStopSignals();
    STIPPLE_TRY(checkPictures(o));
    STIPPLE_ASSIGN(const glm::uvec2 size, parseSize(o.size));
    STIPPLE_TRY(checkArguments(o));
    const auto executor = makeTbbExecutor(o.build.threads);
    STIPPLE_ASSIGN(const std::unique_ptr<render::Backend> backend, makeBackend(o.device, *executor));
    STIPPLE_TRY(startLoading(o, pictures));
    STIPPLE_ASSIGN(OpenedScene scene, scene::openScene(o.inputs, o.build.told(o.quiet), *executor));
    STIPPLE_TRY(checkWeights(o, scene));
    const uint64_t hash = o.target.isAny() ? sceneHash(scene) : 0;
    if (o.material.material() && !scene::takesMaterial(scene.placed)) return scene::noPointsToLight(o.inputs.front());
    const lod::StoreDescription& description = scene.description;
    STIPPLE_ASSIGN(const Shot shot, makeShot(o.camera, o.frames, scene, size));
    written.of = shot.views.size();
    if (!shot.note.empty() && !o.quiet) fmt::print(stderr, "note: {}\n", printable(shot.note));
    STIPPLE_ASSIGN(const lod::ColourBy colour, scene::applyColours(scene, o.colour.what, o.colour.map, o.colour.range));
    STIPPLE_ASSIGN(render::FrameSettings settings, makeSettings(o, description, shot, colour, scene.lights));
    STIPPLE_ASSIGN(settings.draw.environment,
                   scene::openEnvironment(o.environment.path, o.environment.scale, o.build.reading().memoryBytes,
                                          *executor, scene::hasMirrors(scene.placed, o.material.material())));
    STIPPLE_TRY(o.background.applyTo(settings.draw, o.environment, o.build.reading().memoryBytes, *executor));
    if (o.alpha) settings.draw.background = glm::vec3(0);  // what is not covered adds nothing
    const Legend legend = o.colour.legend ? makeLegend(colour, description) : Legend{};
    STIPPLE_TRY(o.effects.applyTo(settings.draw, scene.effects, scene::storesOf(scene.placed), o.quiet));
    if (o.drawn.mode == "reference") return runTraced(o, scene, shot, settings, legend, *executor, written);
    streaming::StreamSettings stream;
    stream.residentBytes = parseBytes(o.resident);
    STIPPLE_ASSIGN(const render::Exposure exposure, o.exposure.exposure(shot));
    o.drawn.applyTo(scene.placed);
    auto state = render::makeFrameState(scene.placed, *backend, *executor, stream, scene.groups);
    render::setSway(settings.draw.wind, state->hierarchies, state->instances, state->groups);
    if (o.target.isAny()) {
        const CutLoads loads{*state, settings.budgets, shot.views};
        STIPPLE_ASSIGN(const Chosen c, chooseError(o.target, loads, o.drawn.mode, hash, *executor));
        settings.budgets.errorPixels = c.errorPixels;
        if (!o.quiet && !o.json) fmt::print("{}\n", c.text);
    }
    const FramesPlan plan{&shot,          o.output, o.resident,      o.frames, exposure,
                          executor.get(), o.noWait, o.build.skipBad, o.quiet,  !o.quiet && !o.json,
                          formatOf(o),    &legend};
    Timings timings;
    Verdict verdict;
    STIPPLE_TRY(runFrames(plan, settings, *state, timings, written, verdict));
    if (shot.views.size() == 1) {
        STIPPLE_TRY(checkStopped(o.output));
        drawLegend(legend, state->image);
        STIPPLE_TRY(image::writePicture(o.output, state->image, formatOf(o)));
    }
    tell(o, *state, settings.draw, verdict, timings, size, written);
    if (!o.quiet) sayShadows(*state);
    if (!o.quiet) sayEmpty(verdict.empty, shot.views.size(), o.output);
    if (!o.quiet && verdict.leavesAround > 0)
        fmt::print(stderr,
                   "note: the eye is within what {} of patches cover{}: how far those are from what they were "
                   "built from is not in the error\n",
                   counted(verdict.leavesAround, "node"), verdict.leavesAround == 1 ? "s" : "");
    if (o.budget > 0) sayIfUseless(plan, settings, *state, verdict);
    return checkVerdict(plan, verdict);
}

/// Wherever it was interrupted: what is there now.
Error toldOf(Error error, const RenderCommand& o, const Written& written) {
    if (error.kind != ErrorKind::interrupted) return error;
    error.where = o.output;
    if (error.hint == "nothing was written") error.hint.clear();  // of a build inside
    error.what = written.pictures == 0
                     ? std::string("interrupted; nothing is written")
                     : fmt::format("interrupted; {} of {} pictures are written", written.pictures, written.of);
    return error;
}

/// How inputs that are not built yet are built.
void addReading(CLI::App& sub, RenderCommand& o) {
    addUpOption(sub, o.build.up);
    sub.add_option("--memory", o.build.memory, "memory that the build may use, bytes (stipple help budgets)")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    sub.add_option("--temp", o.build.temp,
                   "folder for temporary files of a build that does not fit in memory (default: the cache)")
        ->type_name("FOLDER");
    sub.add_option("--attributes", o.build.attributes, "attributes that must be there; all are kept")
        ->type_name("NAMES")
        ->capture_default_str();
    o.build.addCacheTo(sub);
    o.build.addOutliersTo(sub);
    sub.add_option("--surfels", o.build.surfels, "turn meshes into that many samples, e.g. 1M; 0: keep triangles")
        ->transform(within(uint64_t{0}, uint64_t{200'000'000}))
        ->capture_default_str();
    sub.add_option("--curve-radius,--strand-radius", o.build.curveRadius,
                   "radius of curves that have none, file units (0: a 4000th of the extent)")
        ->transform(within(0.0, 1e300));
    o.build.addFormatsTo(sub);
    addSceneFileOptions(sub, o.build.allowOutside, o.build.repair);
    sub.add_flag("--skip-bad", o.build.skipBad, "go on past corrupt chunks and files, and say what was lost");
    sub.add_option("--threads", o.build.threads, "threads (0: all cores)")
        ->transform(within(0, 1024))
        ->capture_default_str();
}

/// What is behind the scene, and how colours are written.
void addPictureTo(CLI::App& sub, RenderCommand& o) {
    sub.add_flag("--alpha", o.alpha, "no background: how much of a pixel is covered goes into the alpha channel")
        ->excludes(o.background.addTo(sub));
    sub.add_option("--transfer", o.transfer, "how colours of a .png are encoded, which it says itself")
        ->check(oneOf({"srgb", "rec709"}))
        ->capture_default_str();
}

}  // namespace

void setupRender(CLI::App& app, int& status) {
    auto o = std::make_shared<RenderCommand>();
    CLI::App* sub = app.add_subcommand("render", "draw pictures without a window");
    sub->add_option("SCENE", o->inputs, "a .stipple scene, or scans, meshes, curves (built into the cache first)")
        ->required();
    sub->add_option("-o,--output", o->output, "the picture (.png, .exr); several views give NAME_0000.png ...")
        ->type_name("PICTURE")
        ->required();
    sub->add_option("--size", o->size, "width x height, pixels")->type_name("WxH")->capture_default_str();
    o->camera.addTo(*sub);
    sub->add_option("--frames", o->frames, "frames of the path, or repetitions of one view for timing")
        ->transform(within(1, 1000000))
        ->excludes("--orbit")
        ->capture_default_str();
    o->drawn.addTo(*sub, true);
    sub->add_option("--error", o->error, "tolerated screen-space error, pixels")
        ->transform(positive())
        ->capture_default_str();
    o->target.addTo(*sub);
    sub->add_option("--budget-points", o->budget,
                    "records drawn at most, e.g. 1M; the error rises to meet it (0: no limit)")
        ->transform(within(uint64_t{0}, uint64_t{1'000'000'000'000}))
        ->capture_default_str();
    sub->add_option("--resident", o->resident, "memory for what is drawn, bytes: 512M, 4G (stipple help budgets)")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    sub->add_option("--device", o->device, "auto, cpu, gpu, gpu:NAME or reference (fp64 restatement)")
        ->type_name("DEVICE")
        ->capture_default_str();
    sub->add_option("--shade", o->shade, "auto: unlit where the scan has its own colours, lit by sun and sky otherwise")
        ->check(oneOf({"auto", "lit", "unlit"}))
        ->capture_default_str();
    addPictureTo(*sub, *o);
    sub->add_option("--debug", o->debug, "draw what the engine did instead of colours")
        ->check(oneOf({"none", "level", "error", "holes", "normals"}))
        ->capture_default_str();
    sub->add_option(
           "--wind", o->wind,
           "how far tops of plants move at most, share of their height (e.g. 0.03); not neurons, streamlines and hair")
        ->transform(within(0.0, 0.5))
        ->capture_default_str();
    sub->add_option("--time", o->seconds, "of the wind, seconds; a path adds its own")
        ->needs(sub->get_option("--wind"))
        ->transform(within(-1e9, 1e9))
        ->capture_default_str();
    o->drawn.addNormaliseTo(*sub);
    sub->add_option("--curve-exact,--strand-exact", o->curveExact,
                    "half-width in pixels from which ribbons and tubes are filled exactly instead of reconstructed")
        ->transform(within(0.5, 1e9))
        ->capture_default_str();
    o->exposure.addTo(*sub);
    sub->add_option("--samples", o->samples, "mode reference: rays per pixel along each axis")
        ->transform(within(1, 64))
        ->capture_default_str();
    sub->add_flag("--no-wait", o->noWait, "draw what is loaded at once, instead of waiting for the complete cut");
    sub->add_flag("--json", o->json, "print what was drawn and measured as JSON (stipple help json)");
    sub->add_flag("--quiet", o->quiet, "neither progress nor notes");
    addForce(*sub, o->force);
    o->build.addProgressTo(*sub);
    o->colour.addTo(*sub);
    o->material.addTo(*sub, "all points, instead of their own");
    o->environment.addTo(*sub);
    o->effects.addTo(*sub);
    o->sun.addTo(*sub);
    addReading(*sub, *o);
    sub->callback([o, sub, &status] {
        PictureLoader pictures;
        Written written;
        auto result = checkOfMode(*sub, o->drawn.mode);
        if (result) result = run(*o, pictures, written);
        if (!result) status = report(toldOf(pictures.told(result.error()), *o, written));
    });
}

}  // namespace stipple::app
