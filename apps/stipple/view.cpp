// The window: what the user's hands do, what is drawn for it, and when. Once it is open, what fails becomes a line on
// the screen; only a device that can draw no more ends it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "apps/stipple/overlay.h"
#include "apps/stipple/picture_loader.h"
#include "apps/stipple/render_frames.h"
#include "apps/stipple/scene_opener.h"
#include "apps/stipple/view_session.h"
#include "apps/study/calibration/steady.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/gpu/gpu_backend.h"
#include "engine/image/image_io.h"
#include "engine/render/accumulation.h"
#include "engine/scene/open/cache_folder.h"
#include "engine/scene/open/mesh_files.h"
#include "engine/scene/open/scene_facts.h"

namespace stipple::app {
namespace {

/// The first free name of stipple_001.png, stipple_002.png ... in the current folder; `number`: where to begin, and
/// then what was found.
std::string freePictureName(int& number) {
    for (;; ++number) {
        std::string name = fmt::format("stipple_{:03}.png", number);
        std::error_code error;
        const auto type = std::filesystem::symlink_status(name, error).type();
        // Where nothing can be known, writing says why.
        if (type == std::filesystem::file_type::not_found || type == std::filesystem::file_type::none) return name;
    }
}

class Viewer {
  public:
    Viewer(const ViewOptions& o, gpu::Window& window, Executor& executor, ViewSession& session, ViewSettings& settings,
           Navigation navigation, PathPlayer player)
        : o_(o),
          window_(window),
          executor_(executor),
          session_(session),
          settings_(settings),
          opener_(o.build),
          navigation_(navigation),
          player_(std::move(player)),
          accumulating_(static_cast<uint32_t>(o.accumulate)) {
        if (o.target.ms > 0) steady_.emplace(settings.frame.budgets.errorPixels, o.target.ms);
    }

    Result<void> run() {
        double wait = 0;
        while (!isStopRequested()) {
            const gpu::Input input = window_.poll(wait);
            if (input.shouldClose) return {};
            isStale_ = isStale_ || input.isStale;
            hasChanged_ = hasChanged_ || input.width != width_ || input.height != height_;
            width_ = input.width;
            height_ = input.height;
            if (!takeInput(input)) return {};
            takeOpened();
            const Pace pace = paceOf(activity(input));
            wait = pace.draws ? 0 : pace.waitSeconds;  // what was drawn may have asked for chunks
            if (!pace.draws) continue;
            if (o_.frames > 0 && ++frames_ >= o_.frames) return drawLast(input);
            STIPPLE_TRY(drawNext(input));
        }
        return fail(ErrorKind::interrupted, "interrupted", "stipple view");
    }

  private:
    void tell(const Error& error) {
        report(error);
        notices_.add(printable(error.line()), true, nowSeconds());
        isStale_ = true;
    }
    void tell(const std::string& text) {
        notices_.add(printable(text), false, nowSeconds());
        isStale_ = true;
    }

    /// False: the user is done.
    bool takeInput(const gpu::Input& input) {
        const Motion motion = motionOf(input);
        const bool steers = navigation_.isFlying() && motion.step != glm::dvec3(0);
        const bool drags = motion.turn != glm::dvec2(0) || motion.slide != glm::dvec2(0) || motion.scroll != 0;
        if (player_.isPlaying() && (steers || drags)) pausePath();
        isMoving_ = steers || player_.isPlaying() || settings_.frame.draw.wind.strength > 0 || o_.frames > 0;
        hasChanged_ = hasChanged_ || drags;
        isStale_ = notices_.expire(nowSeconds()) || isStale_ || !input.pressed.empty();
        navigation_.move(motion);
        if (!input.isHidden) {
            player_.advance(input.seconds);
            settings_.frame.draw.wind.seconds += input.seconds;
        }
        if (!input.dropped.empty()) open(input.dropped);
        const KeyRequests asked = applyKeys(input.pressed, settings_);
        hasChanged_ = hasChanged_ || asked.rendersAnew;
        if (asked.pause) togglePath();
        if (asked.fly) toggleFlying();
        if (asked.colours)
            if (const auto done = session_.nextColours(settings_.frame); !done) tell(done.error());
        if (asked.up) turnUp();
        wantsPicture_ = wantsPicture_ || asked.picture;
        return !asked.quit;
    }

    Activity activity(const gpu::Input& input) {
        streaming::Streamer& streamer = *session_.state().streamer;
        const uint32_t inFlight = streamer.counters().inFlight;
        streamer.collect();
        Activity a;
        a.isHidden = input.isHidden;
        a.hasChanged = hasChanged_ || isStale_;
        a.isMoving = isMoving_;
        a.isStreaming = streamer.counters().inFlight > 0;
        a.hasArrived = streamer.counters().inFlight != inFlight || (!a.isStreaming && !streamer.isIdle());
        a.isOpening = opener_.isBusy();
        a.untilNotice = notices_.untilNext(nowSeconds());
        a.hasChanged = a.hasChanged || (a.isOpening && openingText() != shownOpening_);
        const bool isAtRest = !a.hasChanged && !a.isMoving && !a.hasArrived;
        isResting_ = refinement_.isDue(isAtRest);
        isSample_ = accumulating_.isDue(isAtRest && !isResting_ && !a.isStreaming && !a.isOpening);
        a.hasChanged = a.hasChanged || isResting_ || isSample_;
        hasChanged_ = hasChanged_ || a.isMoving || a.hasArrived || isResting_;
        return a;
    }

    std::string openingText() const {
        return opener_.isBusy() ? fmt::format("opening {}: {:.0f} s", opener_.name(), opener_.seconds()) : "";
    }

    void pausePath() {
        navigation_.setCamera(player_.camera());
        player_.pause();
    }
    void togglePath() {
        if (!player_.hasPath()) return tell("there is no camera path: start with --camera-path or --orbit");
        if (player_.isPlaying())
            pausePath();
        else
            player_.toggle();
    }

    double aspect() const { return static_cast<double>(std::max(1u, width_)) / std::max(1u, height_); }

    /// Also what is drawn with depths, to find what is in the middle.
    void toggleFlying() {
        if (player_.isPlaying()) pausePath();
        if (!navigation_.isFlying()) return navigation_.fly();
        render::FrameSettings withDepth = settings_.frame;
        withDepth.wantDepthAndNormal = true;
        withDepth.staysOnDevice = false;
        std::optional<double> depth;
        if (render(withDepth)) depth = depthInTheMiddle(session_.state().image);
        navigation_.orbit(depth, session_.focus());
    }

    void frameScene() {
        if (auto camera = makeCamera(CameraOptions{}, session_.scene(), aspect()); camera) {
            if (navigation_.camera().isOrthographic()) {  // and stays so: as wide as the perspective shows it
                const double height =
                    2 * glm::length(camera->target - camera->eye) * std::tan(0.5 * glm::radians(camera->fovDegrees));
                camera = scene::fitOrthographic(*camera, session_.scene().outline, height * aspect());
            }
            navigation_ = Navigation(*camera, session_.scene().description.up, session_.diagonal());
        }
        hasChanged_ = true;
    }

    void turnUp() {
        player_.pause();
        session_.turnUp(settings_.frame);
        frameScene();
        tell(fmt::format("up is {0} now (--up {0})", static_cast<char>('x' + session_.upAxis())));
    }

    void open(std::vector<std::string> inputs) {
        if (opener_.isBusy()) return tell("still opening " + opener_.name());
        opener_.start(std::move(inputs));
        isStale_ = true;
    }

    void takeOpened() {
        auto opened = opener_.take();
        if (!opened) return;
        hasChanged_ = true;
        if (!*opened) return tell(opened->error());
        if (const auto shown = session_.show(std::move(**opened), ColourOptions{}, settings_.frame); !shown)
            return tell(shown.error());
        player_ = PathPlayer();
        frameScene();
        window_.setTitle("Stipple: " + session_.scene().description.source);
        tell("opened " + opener_.name());
    }

    lod::View view() const {
        return scene::makeView(player_.isPlaying() ? player_.camera() : navigation_.camera(), std::max(1u, width_),
                               std::max(1u, height_), scene::nearPlaneOf(session_.scene()));
    }

    Result<bool> present(const gpu::Input& input, render::Image* capture) {
        shownOpening_ = openingText();
        const char* const hands = player_.isPlaying() ? "path" : navigation_.isFlying() ? "fly" : "orbit";
        const render::FrameState& state = session_.state();
        const gpu::Shown shown = state.onDevice ? gpu::Shown{nullptr, state.backend, *state.onDevice}
                                                : gpu::Shown{&state.image, nullptr, {}};
        return window_.present(
            shown,
            [&] {
                drawOverlay({session_.state(), settings_, session_.legend(), notices_, shownOpening_, hands, shownMs_,
                             accumulating_.count(), accumulating_.most(), input.names});
            },
            capture);
    }

    Result<void> render(const render::FrameSettings& frame) {
        try {
            return render::renderFrame(session_.state(), view(), frame);
        } catch (const std::bad_alloc&) {
            return fail(ErrorKind::budget, "there is not enough memory for this view", "stipple view",
                        "a smaller window, a larger error (keys 1 to 9) or a smaller --resident");
        }
    }

    /// One more frame of what is at rest, of what is resident; then state.image is the mean.
    Result<void> addSample() {
        render::FrameState& state = session_.state();
        const uint32_t number = accumulating_.count();
        const render::Exposure exposure{accumulating_.most(), {}, 0};
        const lod::View seen = render::viewOf([&](double) { return view(); }, number, exposure);
        if (number == 0) sum_.clear();
        try {
            STIPPLE_TRY(render::renderResident(state, seen, render::settingsOf(settings_.frame, number, exposure)));
            sum_.add(state.image, executor_);
        } catch (const std::bad_alloc&) {
            return fail(ErrorKind::budget, "there is not enough memory to smooth the picture", "stipple view",
                        "a smaller window, or --accumulate 1");
        }
        accumulating_.add();
        return {};
    }

    /// Renders if the picture is another one, or not as smooth as it may be, and shows it.
    Result<void> drawNext(const gpu::Input& input) {
        render::FrameState& state = session_.state();
        if (!hasChanged_ && std::exchange(isSample_, false)) {
            if (auto drawn = addSample(); !drawn) {
                if (drawn.error().kind == ErrorKind::device) return drawn;
                tell(drawn.error());
                accumulating_ = Accumulating(1);
                hasChanged_ = true;
            } else if (!accumulating_.isShown()) {
                return {};  // what was shown stays
            }
        }
        if (std::exchange(hasChanged_, false)) {
            accumulating_.clear();
            const bool canWeigh = render::reconstructionOf(settings_.frame.mode).blendsSplats &&
                                  scene::hasSurfelWeights(session_.scene().placed);
            settings_.frame.draw.perSurfel = refinement_.isQuick(canWeigh, !isResting_);
            if (auto drawn = render(settings_.frame); !drawn) {
                if (drawn.error().kind == ErrorKind::device) return drawn;
                tell(drawn.error());
            }
            keepToTarget();
            // Other colours, another scene: what was shown stays until the first of it is there.
            isEmpty_ = state.counters.nodesDrawn == 0 && !state.streamer->isIdle();
        }
        if (accumulating_.count() > 0) sum_.mean(state.image, executor_);
        if (isEmpty_ || (!state.onDevice && state.image.rgba.empty())) {
            isStale_ = false;
            return {};
        }
        if (std::exchange(wantsPicture_, false)) takePicture();
        const double start = nowSeconds();
        STIPPLE_ASSIGN(const bool shown, present(input, nullptr));
        isStale_ = !shown;
        if (shown) loadPictures();
        shownMs_ = session_.state().counters.frameMs + (nowSeconds() - start) * 1e3;
        return {};
    }

    /// With --target-ms: the error of the next frame. Frames while chunks are on their way say nothing of what comes.
    void keepToTarget() {
        if (!steady_) return;
        double& error = settings_.frame.budgets.errorPixels;
        if (error != steadyError_.value_or(error)) {
            steady_.reset();
            return tell(fmt::format("{:g} px of error by hand: --target-ms is over", error));
        }
        const lod::View now = view();
        const bool moved = isMoving_ || now.eye != lastView_.eye || now.forward != lastView_.forward ||
                           now.width != lastView_.width || now.height != lastView_.height ||
                           now.focalPixels != lastView_.focalPixels;
        lastView_ = now;
        if (!session_.state().cut.wanted.empty()) return;
        steady_->step(frameMsOf(session_.state()), moved);
        hasChanged_ = hasChanged_ || error != steady_->error();
        error = steady_->error();
        steadyError_ = error;
    }

    /// With --frames: complete, and as it is shown.
    Result<void> drawLast(const gpu::Input& input) {
        settings_.frame.draw.perSurfel = false;
        STIPPLE_TRY(render::renderUntilComplete(session_.state(), view(), settings_.frame));
        render::Image shot;
        for (int tries = 0; tries < 50 && shot.rgba.empty(); ++tries)
            STIPPLE_TRY(present(input, o_.screenshot.empty() ? nullptr : &shot));
        if (o_.screenshot.empty()) return {};
        if (shot.rgba.empty()) return fail(ErrorKind::device, "the window shows nothing", "--screenshot");
        STIPPLE_TRY(image::writeImage(o_.screenshot, shot));
        fmt::print("{}\n", o_.screenshot);
        FramesPlan plan;
        plan.output = o_.screenshot;
        plan.resident = o_.resident;
        plan.skipBad = o_.build.skipBad;
        Verdict verdict;
        verdict.judge(session_.state(), nullptr);
        return checkVerdict(plan, verdict);
    }

    /// Behind the first frame, so that the first picture need not wait for the 260 libraries.
    void loadPictures() {
        if (pictureLoader_.joinable()) return;
        pictureLoader_ = std::jthread([] {
            try {
                (void)image::checkModule(true);  // what is wrong is said when a picture is taken
            } catch (const std::bad_alloc&) {
            }
        });
    }

    /// Of what is drawn, without what lies over it.
    void takePicture() {
        const render::FrameState& state = session_.state();
        if (state.onDevice) {  // once more, for the host
            render::FrameSettings readable = settings_.frame;
            readable.staysOnDevice = false;
            if (auto drawn = render(readable); !drawn) return tell(drawn.error());
        }
        render::Image picture = state.image;
        for (uint32_t& pixel : picture.rgba) pixel |= 0xff000000u;
        const std::string path = freePictureName(pictures_);
        if (const auto written = image::writeImage(path, picture); !written) return tell(written.error());
        fmt::print("{}\n", path);
        std::fflush(stdout);
        tell(fmt::format("{}: {} x {}{}", path, picture.width, picture.height,
                         state.cut.wanted.empty() ? "" : ", while more detail was on its way"));
    }

    const ViewOptions& o_;
    gpu::Window& window_;
    Executor& executor_;
    ViewSession& session_;
    ViewSettings& settings_;
    SceneOpener opener_;
    Navigation navigation_;
    PathPlayer player_;
    Notices notices_;
    std::optional<study::Steady> steady_;  ///< with --target-ms
    std::optional<double> steadyError_;    ///< that it asked for
    lod::View lastView_;                   ///< that it saw
    Refinement refinement_;                ///< discs that are blended: by their weights while they move
    bool isResting_ = false;               ///< it is due
    Accumulating accumulating_;            ///< at rest
    render::Accumulation sum_;             ///< of what it counts
    bool isSample_ = false;                ///< one is due
    std::string shownOpening_;
    uint32_t width_ = 0, height_ = 0;
    double shownMs_ = 0;  ///< what the last frame took, with showing it
    int frames_ = 0, pictures_ = 1;
    bool hasChanged_ = true;      ///< what is to be rendered
    bool isStale_ = true;         ///< what is shown: the same picture, or what lies over it
    std::jthread pictureLoader_;  ///< loads what writes pictures
    bool isMoving_ = false, wantsPicture_ = false, isEmpty_ = false;
};

/// An orbit of N pictures takes as long as their film would; the path of a file is as fast as it says.
Result<PathPlayer> makePlayer(const ViewOptions& o, const OpenedScene& scene, double aspect) {
    constexpr int kKeys = 120;
    CameraOptions camera = o.camera;
    if (camera.orbit > 0) camera.orbit = kKeys;
    STIPPLE_ASSIGN(std::optional<scene::CameraPath> path, makePath(camera, scene, aspect));
    if (!path) return PathPlayer();
    if (o.camera.orbit <= 0) return PathPlayer(std::move(*path), 1, false);
    path->keys.push_back({static_cast<double>(kKeys), path->keys.front().camera});
    return PathPlayer(std::move(*path), kKeys * path->fps / o.camera.orbit, true);
}

Result<Navigation> makeNavigation(const ViewOptions& o, const ViewSession& session, double aspect) {
    STIPPLE_ASSIGN(const scene::Camera camera, makeCamera(o.camera, session.scene(), aspect));
    return Navigation(camera, o.camera.cameraUp.empty() ? session.scene().description.up : camera.up,
                      session.diagonal());
}

/// A window and what draws for it: on one device if that can do both, so that pictures need not leave it.
struct Stage {
    std::unique_ptr<gpu::Window> window;
    std::unique_ptr<render::Backend> backend;  // ends first
    bool isShared = false;
};
Result<Stage> setStage(const ViewOptions& o, const std::string& title, const glm::uvec2& size, Executor& executor) {
    const std::string name = o.device.starts_with("gpu:") ? o.device.substr(4) : "";
    const bool isGpu = o.device == "gpu" || !name.empty() || (o.device == "auto" && gpu::hasHardwareDevice());
    gpu::WindowSettings settings{title, size.x, size.y, isGpu ? name : "",
                                 std::getenv("STIPPLE_VALIDATION") != nullptr};
    Stage stage;
    auto window = gpu::Window::create(settings);
    if (window && isGpu) {
        stage.window = std::move(*window);
        auto backend = gpu::makeGpuBackendOn(stage.window->device(), scene::CacheFolder::pipelinesPath());
        stage.isShared = backend.has_value();
        if (!backend && o.device == "auto") backend = makeBackend("cpu", executor);
        if (!backend) return tl::unexpected<Error>(backend.error());
        stage.backend = std::move(*backend);
        return stage;
    }
    if (!window && !name.empty()) {  // that device may draw and not show
        settings.deviceName.clear();
        window = gpu::Window::create(settings);
    }
    if (!window) return tl::unexpected<Error>(window.error());
    stage.window = std::move(*window);
    STIPPLE_ASSIGN(stage.backend, makeBackend(o.device, executor));
    return stage;
}

/// Before any work.
Result<void> checkScreenshot(const ViewOptions& o) {
    if (o.screenshot.empty()) return {};
    if (o.frames == 0) return fail(ErrorKind::usage, "is taken of the last of --frames N", "--screenshot", "give both");
    STIPPLE_TRY(image::checkImagePath(o.screenshot));
    std::vector<std::string> inputs = o.inputs;
    inputs.insert(inputs.end(), {o.camera.path, o.environment.path});
    return checkOutputs({{o.screenshot, OutputKind::picture}}, inputs, o.force);
}

Result<void> run(const ViewOptions& o, PictureLoader& pictures) {
    STIPPLE_ASSIGN(const glm::uvec2 size, parseSize(o.size));
    STIPPLE_TRY(o.camera.check());
    STIPPLE_TRY(o.material.check(o.shade));
    STIPPLE_TRY(o.effects.check());
    STIPPLE_TRY(o.sun.check(o.shade));
    STIPPLE_TRY(o.background.check(o.environment));
    STIPPLE_TRY(checkScreenshot(o));
    STIPPLE_TRY(scene::checkInputs(o.inputs));
    if (!gpu::hasDisplay())
        return fail(ErrorKind::device, "there is no display", "stipple view",
                    "use stipple render, or xvfb-run stipple view");
    catchStopSignals();
    const auto executor = makeTbbExecutor(o.build.threads);
    if (!o.screenshot.empty()) STIPPLE_TRY(pictures.start());
    STIPPLE_ASSIGN(OpenedScene scene, scene::openScene(o.inputs, o.build.told(false), *executor));
    if (o.material.material() && !scene::takesMaterial(scene.placed)) return scene::noPointsToLight(o.inputs.front());
    const uint64_t hash = o.target.isAny() ? sceneHash(scene) : 0;
    STIPPLE_ASSIGN(const Stage stage, setStage(o, "Stipple: " + scene.description.source, size, *executor));
    gpu::Window* const window = stage.window.get();
    ViewSettings settings;
    render::FrameSettings& frame = settings.frame;
    o.drawn.applyTo(frame);
    frame.budgets = {o.error, o.budget};
    frame.draw.unlitTriangles = o.shade == "unlit";
    frame.draw.wind.strength = o.wind;
    frame.staysOnDevice = stage.isShared;
    STIPPLE_ASSIGN(frame.draw.environment,
                   scene::openEnvironment(o.environment.path, o.environment.scale, o.build.reading().memoryBytes,
                                          *executor, scene::hasMirrors(scene.placed, o.material.material())));
    STIPPLE_TRY(o.background.applyTo(frame.draw, o.environment, o.build.reading().memoryBytes, *executor));
    ViewSession session(o, *stage.backend, *executor);
    STIPPLE_TRY(session.show(std::move(scene), o.colour, frame));
    const double aspect = static_cast<double>(size.x) / size.y;
    if (o.target.isAny()) {
        STIPPLE_ASSIGN(const scene::Camera first, makeCamera(o.camera, session.scene(), aspect));
        const std::array views{scene::makeView(first, size.x, size.y, scene::nearPlaneOf(session.scene()))};
        const CutLoads loads{session.state(), frame.budgets, views};
        STIPPLE_ASSIGN(const Chosen chosen, chooseError(o.target, loads, o.drawn.mode, hash, *executor));
        frame.budgets.errorPixels = chosen.errorPixels;
        fmt::print("{}\n", chosen.text);
        std::fflush(stdout);
    }
    STIPPLE_ASSIGN(Navigation navigation, makeNavigation(o, session, aspect));
    STIPPLE_ASSIGN(PathPlayer player, makePlayer(o, session.scene(), aspect));
    const auto result = Viewer(o, *window, *executor, session, settings, navigation, std::move(player)).run();
    for (const std::string& message : window->validationMessages()) fmt::print(stderr, "validation: {}\n", message);
    STIPPLE_TRY(result);
    if (!window->validationMessages().empty())
        return fail(ErrorKind::device, "the validation layers complained", "stipple view");
    return {};
}

}  // namespace

void setupView(CLI::App& app, int& status) {
    auto o = std::make_shared<ViewOptions>();
    CLI::App* sub = app.add_subcommand("view", "walk through a scene in a window");
    sub->add_option("SCENE", o->inputs, "a .stipple scene, or scans, meshes, curves (built into the cache first)")
        ->required();
    sub->add_option("--size", o->size, "of the window, pixels")->type_name("WxH")->capture_default_str();
    o->drawn.addTo(*sub, false);  // (any key M may come to ewa: its options stand for when it does)
    o->effects.addTo(*sub);
    sub->add_option("--error", o->error, "tolerated screen-space error, pixels")
        ->transform(positive())
        ->capture_default_str();
    o->target.addTo(*sub);
    sub->add_option(
           "--wind", o->wind,
           "how far tops of plants move at most, share of their height (e.g. 0.03); not neurons, streamlines and hair")
        ->transform(within(0.0, 0.5))
        ->capture_default_str();
    sub->add_option("--budget-points", o->budget, "records drawn at most, e.g. 2M; the error rises to meet it")
        ->transform(within(uint64_t{1}, uint64_t{1'000'000'000'000}))
        ->default_str("2M");
    sub->add_option("--resident", o->resident, "memory for what is drawn, bytes: 512M, 4G (stipple help budgets)")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    sub->add_option("--device", o->device, "auto, cpu, gpu or gpu:NAME")->type_name("DEVICE")->capture_default_str();
    sub->add_option("--shade", o->shade, "auto: unlit where the scan has its own colours, lit by sun and sky otherwise")
        ->check(oneOf({"auto", "lit", "unlit"}))
        ->capture_default_str();
    sub->add_option("--accumulate", o->accumulate,
                    "while nothing changes the picture becomes the mean of N frames, which look through other places "
                    "of its pixels: smooth edges (1: it stays one frame)")
        ->transform(within(1, 4096))
        ->type_name("N")
        ->capture_default_str();
    sub->add_option("--frames", o->frames, "close after N frames (0: when the user does)")
        ->transform(within(0, 1'000'000'000))
        ->capture_default_str();
    sub->add_option("--screenshot", o->screenshot,
                    "with --frames: write what the window shows at last, text included (.png)")
        ->type_name("PICTURE");
    addForce(*sub, o->force);
    o->camera.addTo(*sub);
    o->colour.addTo(*sub);
    o->environment.addTo(*sub);
    o->background.addTo(*sub);
    o->sun.addTo(*sub);
    o->material.addTo(*sub, "all points, instead of their own");
    o->build.addTo(*sub);
    o->build.addCacheTo(*sub);
    sub->footer(keyHelpText());
    sub->callback([o, &status] {
        PictureLoader pictures;
        if (const auto result = run(*o, pictures); !result) status = report(pictures.told(result.error()));
    });
}

}  // namespace stipple::app
