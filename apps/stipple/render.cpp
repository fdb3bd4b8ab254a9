#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "apps/stipple/camera_options.h"
#include "apps/stipple/common.h"
#include "apps/stipple/legend.h"
#include "engine/base/process.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"

namespace stipple::app {
namespace {

struct Options {
    std::vector<std::string> inputs;
    std::string output, size = "1280x720", mode = "pullpush", device = "auto", shade = "auto", background = "24,26,30";
    std::string debug = "none", resident = "1G";
    double error = 1, strandExact = 2, wind = 0, seconds = 0;
    int frames = 1, samples = 4, accumulate = 1;
    uint64_t budget = 0;
    bool noWait = false, json = false, quiet = false;
    CameraOptions camera;
    BuildOptions build;
    ColourOptions colour;
    EnvironmentOptions environment;
};

Result<render::FrameSettings> makeSettings(const Options& o, const lod::StoreDescription& d, const Shot& shot,
                                           const lod::ColourBy& colour, const std::vector<render::WorldLight>& lights) {
    render::FrameSettings s;
    s.draw.lights = lights;
    s.mode = o.mode == "points" ? render::Mode::points : render::Mode::pullpush;
    s.budgets.errorPixels = o.error;
    if (o.budget > 0) s.budgets.records = o.budget;
    s.draw.unlitTriangles = o.shade == "unlit";
    s.draw.lit = o.shade == "lit" || (o.shade == "auto" && isShaded(d) && colour.mode == lod::ColourMode::own);
    s.draw.worldUp = shot.worldUp;
    s.draw.exactStrands = static_cast<float>(o.strandExact);
    s.draw.wind = {o.wind, o.seconds, render::windAcross(shot.worldUp)};
    STIPPLE_ASSIGN(const glm::dvec3 background, parseVector(o.background, "--background"));
    for (int c = 0; c < 3; ++c) {
        if (!(background[c] >= 0 && background[c] <= 255))
            return fail(ErrorKind::usage, "channels are 0 to 255", "--background");
        s.draw.background[c] = shared::linearFromSrgb(static_cast<float>(background[c]) / 255.0f);
    }
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
            {"records_tested", c.recordsTested},
            {"stand_ins", c.standIns},
            {"crowd_members", c.crowdMembers},
            {"nodes_swaying", c.nodesSwaying},
            {"cut_evaluations", c.cutEvaluations},
            {"passes", c.passes},
            {"blocks", c.blocks},
            {"requests", c.requests},
            {"uploads", c.uploads},
            {"evictions", c.evictions},
            {"failures", c.failures},
            {"refused", c.refused},
            {"budget_truncated", c.budgetTruncated},
            {"tau_target_px", c.tauTargetPixels},
            {"cut_ms", c.cutMs}};
}

/// out.png -> out_0007.png
std::string numbered(const std::string& path, size_t index) {
    const std::filesystem::path p(path);
    return (p.parent_path() / fmt::format("{}_{:04}{}", p.stem().string(), index, p.extension().string())).string();
}

struct Timings {
    std::vector<double> frames;
    std::vector<std::string> passNames;
    std::vector<std::vector<double>> passes;
    double firstImageMs = 0, completeMs = 0;
    void add(double frameMs, const std::vector<render::PassTime>& times) {
        frames.push_back(frameMs);
        passNames.clear();
        passes.resize(times.size());
        for (size_t i = 0; i < times.size(); ++i) {
            passNames.push_back(times[i].name);
            passes[i].push_back(times[i].ms);
        }
    }
};

Result<void> runFrames(const Options& o, const Shot& shot, const render::FrameSettings& settings,
                       render::FrameState& state, Executor& executor, Timings& timings, bool& complete) {
    // The first image: as soon as the root is there, whatever is missing.
    const lod::View& first = shot.views.front();
    while (!state.streamer->residency().drawable[0][0]) {
        state.streamer->collect();
        state.streamer->upload();
        if (state.streamer->residency().drawable[0][0]) break;
        if (state.streamer->counters().failures > 0) return fail(ErrorKind::input, state.streamer->lastFailure());
        if (state.streamer->counters().refused > 0)
            return fail(ErrorKind::budget, "the first chunk does not fit", "--resident " + o.resident,
                        "give more memory");
        lod::selectCut(state.scene(), state.streamer->residency(), first, settings.budgets, state.scratch, state.cut);
        state.streamer->request(state.cut);
        if (state.cut.wanted.empty() && state.streamer->isIdle()) break;  // it is not in view
        std::this_thread::yield();
    }
    STIPPLE_TRY(render::renderFrame(state, first, settings));
    timings.firstImageMs = millisecondsSinceProcessStart();
    for (size_t i = 0; i < shot.views.size(); ++i) {
        render::FrameSettings frame = settings;
        if (!shot.seconds.empty()) frame.draw.wind.seconds += shot.seconds[i];
        if (o.noWait) {
            if (i > 0) STIPPLE_TRY(render::renderFrame(state, shot.views[i], frame));
            complete = state.cut.wanted.empty();
        } else {
            STIPPLE_ASSIGN(complete, render::renderUntilComplete(state, shot.views[i], frame, executor));
        }
        if (i == 0) timings.completeMs = millisecondsSinceProcessStart();
        timings.add(state.counters.frameMs, state.backend->passTimes());
        if (shot.views.size() > 1) {
            STIPPLE_TRY(image::writeImage(numbered(o.output, i), state.image));
            if (!o.quiet && !o.json) fmt::print("{}\n", numbered(o.output, i));
        }
    }
    if (shot.views.size() == 1)
        for (int f = 1; f < o.frames; ++f) {  // one view again and again, for timing
            STIPPLE_TRY(render::renderFrame(state, first, settings));
            timings.add(state.counters.frameMs, state.backend->passTimes());
        }
    return {};
}

/// The mean of `count` frames whose strands narrower than a pixel take other pixels each time.
Result<void> accumulate(int count, const lod::View& view, render::FrameSettings settings, render::FrameState& state) {
    if (count <= 1) return {};
    std::vector<float> sum(state.image.linear.size()), coverage(state.image.rgba.size());
    for (int f = 0; f < count; ++f) {
        settings.draw.coverageSeed = static_cast<uint32_t>(f);
        STIPPLE_TRY(render::renderFrame(state, view, settings));
        for (size_t i = 0; i < sum.size(); ++i) sum[i] += std::clamp(state.image.linear[i], 0.0f, 1.0f);
        for (size_t i = 0; i < coverage.size(); ++i) coverage[i] += state.image.rgba[i] >> 24 != 0 ? 1.0f : 0.0f;
    }
    const float share = 1.0f / static_cast<float>(count);
    for (size_t i = 0; i < coverage.size(); ++i) {
        state.image.rgba[i] = static_cast<uint32_t>(coverage[i] * share * 255.0f + 0.5f) << 24;
        for (size_t c = 0; c < 3; ++c) {
            state.image.linear[3 * i + c] = sum[3 * i + c] * share;
            state.image.rgba[i] |= static_cast<uint32_t>(shared::srgbFromLinear(sum[3 * i + c] * share) * 255.0f + 0.5f)
                                   << (8 * c);
        }
    }
    return {};
}

Result<void> run(const Options& o) {
    STIPPLE_TRY(image::checkImagePath(o.output));
    STIPPLE_ASSIGN(const glm::uvec2 size, parseSize(o.size));
    STIPPLE_TRY(o.camera.check());
    if (!(o.error > 0)) return fail(ErrorKind::usage, "must be larger than 0", "--error");
    const auto executor = makeTbbExecutor(o.build.threads);
    STIPPLE_ASSIGN(const std::unique_ptr<render::Backend> backend, makeBackend(o.device, *executor));
    STIPPLE_ASSIGN(OpenedScene scene, openScene(o.inputs, o.build, *executor, !o.quiet));
    const lod::StoreDescription& description = scene.description;
    STIPPLE_ASSIGN(const Shot shot, makeShot(o.camera, o.frames, scene, size));
    STIPPLE_ASSIGN(const lod::ColourBy colour, applyColours(scene, o.colour.what, o.colour.map, o.colour.range));
    STIPPLE_ASSIGN(render::FrameSettings settings, makeSettings(o, description, shot, colour, scene.lights));
    STIPPLE_ASSIGN(settings.draw.environment, openEnvironment(o.environment.path, o.environment.scale, *executor));
    if (o.mode == "reference" && colour.mode != lod::ColourMode::own)
        return fail(ErrorKind::usage, "traced pictures have the scene's own colours", "--mode reference",
                    "leave --colour out, or use --device reference");
    if (o.mode == "reference") {
        const double start = nowSeconds();
        reference::TraceSettings trace{static_cast<uint32_t>(o.samples), settings.draw};
        for (size_t i = 0; i < shot.views.size(); ++i) {
            STIPPLE_ASSIGN(const render::Image traced, reference::trace(scene.placed, shot.views[i], trace, *executor));
            STIPPLE_TRY(image::writeImage(shot.views.size() > 1 ? numbered(o.output, i) : o.output, traced));
        }
        if (o.json)
            fmt::print("{}\n", nlohmann::json{{"backend", "trace"},
                                              {"samples_per_pixel", o.samples * o.samples},
                                              {"seconds", nowSeconds() - start}}
                                   .dump(2));
        return {};
    }
    streaming::StreamSettings stream;
    stream.residentBytes = parseBytes(o.resident);
    if (stream.residentBytes == 0)
        return fail(ErrorKind::usage, "is not a size", "--resident " + o.resident, "e.g. 1G");
    settings.wantDepthAndNormal = settings.wantDepthAndNormal || o.accumulate > 1;
    auto state = render::makeFrameState(scene.placed, *backend, *executor, stream, scene.crowds);
    render::setSway(settings.draw.wind, state->hierarchies, state->instances);
    const Legend legend = o.colour.legend ? makeLegend(colour, description) : Legend{};
    Timings timings;
    bool complete = false;
    STIPPLE_TRY(runFrames(o, shot, settings, *state, *executor, timings, complete));
    if (shot.views.size() == 1) {
        STIPPLE_TRY(accumulate(o.accumulate, shot.views.front(), settings, *state));
        drawLegend(legend, state->image);
        STIPPLE_TRY(image::writeImage(o.output, state->image));
    }
    const FrameCounters& c = state->counters;
    if (!complete && !o.noWait && !o.quiet)
        fmt::print(stderr, "note: {} chunks that this view wants are missing ({}); delivered error {:.2f} px\n",
                   c.nodesMissing, c.failures ? state->streamer->lastFailure() : "the limit of --resident is reached",
                   c.tauEffectivePixels);
    if (o.json) {
        nlohmann::json passes = nlohmann::json::array();
        for (size_t i = 0; i < timings.passNames.size(); ++i)
            passes.push_back({{"name", timings.passNames[i]}, {"ms", quantile(timings.passes[i], 0.5)}});
        const nlohmann::json j = {
            {"backend", backend->name()},
            {"device", backend->device()},
            {"mode", o.mode},
            {"width", size.x},
            {"height", size.y},
            {"frames", timings.frames.size()},
            {"frame_ms", {{"median", quantile(timings.frames, 0.5)}, {"p95", quantile(timings.frames, 0.95)}}},
            {"passes", passes},
            {"records_drawn", c.recordsDrawn},
            {"triangles_drawn", c.trianglesDrawn},
            {"nodes_drawn", c.nodesDrawn},
            {"tau_eff_px", c.tauEffectivePixels},
            {"complete", complete},
            {"bytes_streamed", c.bytesStreamed},
            {"resident_bytes", c.residentBytes},
            {"peak_rss_bytes", peakRssBytes()},
            {"first_image_ms", timings.firstImageMs},
            {"complete_ms", timings.completeMs},
            {"counters", countersJson(c)}};
        fmt::print("{}\n", j.dump(2));
    } else if (!o.quiet && shot.views.size() == 1) {
        const std::string drawn = c.trianglesDrawn == 0 ? fmt::format("{} records", c.recordsDrawn)
                                  : c.recordsDrawn == 0
                                      ? fmt::format("{} triangles", c.trianglesDrawn)
                                      : fmt::format("{} records, {} triangles", c.recordsDrawn, c.trianglesDrawn);
        fmt::print("{}: {}, {:.2f} px error, {:.1f} ms a frame on {}\n", o.output, drawn, c.tauEffectivePixels,
                   quantile(timings.frames, 0.5), backend->device());
    }
    return {};
}

}  // namespace

void setupRender(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("render", "draw pictures without a window");
    sub->add_option("SCENE", o->inputs, "a .stipple scene, or scans (built into the cache first)")->required();
    sub->add_option("-o,--output", o->output, "the picture (.png, .exr); a path gives NAME_0000.png ...")->required();
    sub->add_option("--size", o->size, "width x height, pixels")->capture_default_str();
    o->camera.addTo(*sub);
    sub->add_option("--frames", o->frames, "frames of the path, or repetitions of one view for timing")
        ->check(CLI::Range(1, 1000000))
        ->excludes("--orbit")
        ->capture_default_str();
    sub->add_option("--mode", o->mode, "pullpush, points, or reference (traced full detail)")
        ->check(CLI::IsMember({"pullpush", "points", "reference"}))
        ->capture_default_str();
    sub->add_option("--error", o->error, "tolerated screen-space error, pixels")->capture_default_str();
    sub->add_option("--budget-points", o->budget, "records drawn at most; the error rises to meet it (0: no limit)")
        ->capture_default_str();
    sub->add_option("--resident", o->resident, "memory for resident chunks")->capture_default_str();
    sub->add_option("--device", o->device, "auto, cpu, gpu, gpu:NAME or reference (fp64 restatement)")
        ->capture_default_str();
    sub->add_option("--shade", o->shade, "auto: unlit where the scan has colours")
        ->check(CLI::IsMember({"auto", "lit", "unlit"}))
        ->capture_default_str();
    sub->add_option("--background", o->background, "R,G,B 0 to 255")->capture_default_str();
    sub->add_option("--debug", o->debug, "debug view")
        ->check(CLI::IsMember({"none", "level", "error", "holes", "normals"}))
        ->capture_default_str();
    sub->add_option("--wind", o->wind, "how far tops of plants move at most, share of their height (e.g. 0.03)")
        ->check(numberBetween(0.0, 0.5))
        ->capture_default_str();
    sub->add_option("--time", o->seconds, "of the wind, seconds; a path adds its own")
        ->check(numberBetween(-1e9, 1e9))
        ->capture_default_str();
    sub->add_option("--strand-exact", o->strandExact,
                    "half-width in pixels from which ribbons and tubes are filled exactly instead of reconstructed")
        ->check(numberBetween(0.5, 1e9))
        ->capture_default_str();
    sub->add_option("--accumulate", o->accumulate,
                    "the mean of N frames: smooth coverage of strands narrower than a pixel")
        ->check(CLI::Range(1, 4096))
        ->capture_default_str();
    sub->add_option("--samples", o->samples, "mode reference: rays per pixel along each axis")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    sub->add_flag("--no-wait", o->noWait, "do not wait for the complete cut");
    sub->add_flag("--json", o->json, "print measurements as JSON");
    sub->add_flag("--quiet", o->quiet, "no progress");
    o->colour.addTo(*sub);
    o->environment.addTo(*sub);
    auto* group = sub->add_option_group("building", "for inputs that are not built yet");
    addUpOption(*group, o->build.up);
    group->add_option("--memory", o->build.memory, "memory that the build may use")->capture_default_str();
    group->add_option("--attributes", o->build.attributes, "attributes that must be there; all are kept")
        ->capture_default_str();
    o->build.addCacheTo(*group);
    o->build.addOutliersTo(*group);
    group->add_option("--surfels", o->build.surfels, "turn meshes into that many samples; 0: keep triangles")
        ->check(CLI::Range(uint64_t{0}, uint64_t{200'000'000}))
        ->capture_default_str();
    group
        ->add_option("--strand-radius", o->build.strandRadius,
                     "radius of strands that have none, file units (0: a 4000th of the extent)")
        ->check(numberBetween(0.0, 1e300));
    group->add_flag("--only-points", o->build.onlyPoints, "of a PLY mesh take the vertices, as points");
    group->add_flag("--repair", o->build.repair,
                    "pass over faults of a glTF file that change nothing that is drawn, and count them");
    group->add_flag("--skip-bad", o->build.skipBad, "go on past corrupt chunks and files, and say what was lost");
    group->add_option("--threads", o->build.threads, "threads (0: all cores)")
        ->check(CLI::Range(0, 1024))
        ->capture_default_str();
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
