// Devices, and pictures on them.
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "engine/api/devices.h"
#include "engine/api/held.h"
#include "engine/base/process.h"
#include "engine/base/words.h"
#include "engine/image/coverage.h"
#include "engine/render/draw_list.h"
#include "engine/render/frame.h"
#include "engine/render/reconstructions/table.h"
#include "engine/scene/open/scene_facts.h"

namespace stipple::v1 {

Result<Device> Device::open(const std::string& name, unsigned threads) {
    auto held = std::make_shared<Held>();
    held->executor = makeTbbExecutor(static_cast<int>(threads));
    auto backend = makeBackend(name, *held->executor);
    if (!backend) return given(backend.error());
    held->backend = std::move(*backend);
    return Device(std::move(held));
}

std::string Device::name() const { return held_->backend->device(); }

struct Renderer::Held {
    /// Of the settings of the last frame, so that its picture is read once.
    struct Surroundings {
        std::string path;
        double scale = 0;
        std::shared_ptr<const render::Environment> light;
        std::shared_ptr<const render::Backdrop> backdrop;
    };
    std::shared_ptr<Device::Held> device;  // ends last
    Surroundings around;
    scene::OpenedScene scene;
    lod::ColourBy colour;
    std::unique_ptr<render::FrameState> state;
    FrameInfo info;
    ~Held();
};

namespace {

/// A device is one thread's for as long as this lives.
class Turn {
  public:
    explicit Turn(Device::Held& of) : of_(of), isMine_(!of.isBusy.test_and_set(std::memory_order_acquire)) {}
    ~Turn() {
        if (!isMine_) return;
        of_.isBusy.clear(std::memory_order_release);
        of_.isBusy.notify_one();
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    explicit operator bool() const { return isMine_; }

  private:
    Device::Held& of_;
    const bool isMine_;
};

Error busy() {
    return {ErrorKind::usage, "draws for another thread", "device", "one thread at a time may draw on a device"};
}

/// Light from all around, and what is seen behind the scene.
::stipple::Result<void> surround(const RenderSettings& s, Renderer::Held& r, render::DrawSettings& draw) {
    constexpr uint64_t kMemory = uint64_t{2} << 30;
    const auto refuse = [](const std::string& what, const char* where) {
        return fail(::stipple::ErrorKind::usage, what, where);
    };
    for (int c = 0; c < 3; ++c)
        draw.background[c] =
            shared::linearFromSrgb(static_cast<float>(s.background.at(static_cast<size_t>(c))) / 255.0f);
    if (s.environment.empty() && s.environmentIsBackground)
        return refuse("is the picture of environment, which is empty", "environmentIsBackground");
    if (!s.environmentIsBackground) r.around.backdrop.reset();
    if (s.environment.empty()) return {};
    if (!(s.environmentScale >= 0 && s.environmentScale <= 1e6)) return refuse("is 0 to 1e6", "environmentScale");
    Executor& executor = *r.device->executor;
    if (r.around.path != s.environment || r.around.scale != s.environmentScale) {
        Renderer::Held::Surroundings of{s.environment, s.environmentScale, {}, {}};
        STIPPLE_ASSIGN(of.light, scene::openEnvironment(of.path, of.scale, kMemory, executor,
                                                        scene::hasMirrors(r.scene.placed, {})));
        r.around = std::move(of);
    }
    if (s.environmentIsBackground && !r.around.backdrop) {
        STIPPLE_ASSIGN(r.around.backdrop, scene::openBackdrop(r.around.path, r.around.scale, kMemory, executor));
    }
    draw.environment = r.around.light;
    if (s.environmentIsBackground) draw.backdrop = r.around.backdrop;
    return {};
}

::stipple::Result<render::FrameSettings> settingsOf(const RenderSettings& s, Renderer::Held& r) {
    const scene::OpenedScene& scene = r.scene;
    render::FrameSettings out;
    const auto refuse = [](const std::string& what, const char* where) {
        return fail(::stipple::ErrorKind::usage, what, where);
    };
    const render::Reconstruction* mode = render::reconstructionNamed(s.mode);
    if (mode == nullptr) return refuse("there is no mode '" + s.mode + "'", "mode");
    if (!(s.errorPixels > 0) || !std::isfinite(s.errorPixels)) return refuse("must be above 0", "errorPixels");
    if (s.shade != "auto" && s.shade != "lit" && s.shade != "unlit")
        return refuse("is auto, lit or unlit, and not '" + s.shade + "'", "shade");
    if (!(s.windShare >= 0 && s.windShare <= 0.5)) return refuse("is 0 to 0.5", "windShare");
    out.mode = mode->mode;
    out.budgets.errorPixels = s.errorPixels;
    if (s.budgetRecords > 0) out.budgets.records = s.budgetRecords;
    out.wantDepthAndNormal = s.wantDepthAndNormal;
    render::DrawSettings& draw = out.draw;
    draw.lights = scene.lights;
    draw.unlitTriangles = s.shade == "unlit";
    draw.lit = scene::isLit(s.shade, scene.description, r.colour);
    draw.worldUp = scene.description.up;
    draw.wind = {s.windShare, s.seconds, render::windAcross(draw.worldUp)};
    STIPPLE_TRY(surround(s, r, draw));
    const render::EffectWishes wishes{s.effects, s.effectValues};
    STIPPLE_TRY(render::checkWishes(wishes));
    STIPPLE_TRY(
        render::requestEffects(wishes, scene.effects, render::factsOf(scene::storesOf(scene.placed), draw), draw));
    return out;
}

void give(const render::Image& from, Image& to) {
    to.width = from.width;
    to.height = from.height;
    to.rgba.resize(4 * from.rgba.size());
    std::memcpy(to.rgba.data(), from.rgba.data(), to.rgba.size());  // the first byte is red
    to.depth = from.depth;
    to.normal = from.normal;
    to.linear = from.linear;
}

FrameInfo infoOf(const render::FrameState& state) {
    const FrameCounters& c = state.counters;
    FrameInfo info;
    info.isComplete = state.cut.wanted.empty() && !c.budgetTruncated;
    info.errorPixels = c.tauEffectivePixels;
    info.records = c.recordsDrawn;
    info.triangles = c.trianglesDrawn;
    info.nodes = c.nodesDrawn;
    info.residentBytes = c.residentBytes;
    info.milliseconds = c.frameMs;
    return info;
}

/// Why the view has not all that it wants.
::stipple::Result<void> incomplete(const Renderer::Held& r) {
    constexpr const char* kHint = "give more, or take what renderFrame draws";
    const auto over = [](const std::string& what) { return fail(::stipple::ErrorKind::budget, what, "", kHint); };
    const FrameCounters& c = r.state->counters;
    const streaming::Streamer& streamer = *r.state->streamer;
    if (!streamer.failed(true).empty())
        return fail(::stipple::ErrorKind::input, "a part of the scene cannot be read: " + streamer.lastFailure(), "",
                    "renderFrame draws what is there");
    if (c.budgetTruncated) return over("the coarsest level of the scene has more records than budgetRecords");
    return over(fmt::format("of what the view wants {} do not fit into residentBytes, {}: an error of {:.2f} px",
                            counted(r.state->cut.wanted.size(), "chunk"), humanBytes(streamer.residentLimit()),
                            c.tauEffectivePixels));
}

/// `waits`: until nothing is missing.
::stipple::Result<void> draw(Renderer::Held& r, const Camera& camera, uint32_t width, uint32_t height,
                             const RenderSettings& settings, bool waits) {
    constexpr uint32_t kLargest = 16384;
    if (width == 0 || height == 0 || width > kLargest || height > kLargest)
        return fail(::stipple::ErrorKind::usage, "is not a size from 1x1 to 16384x16384",
                    std::to_string(width) + "x" + std::to_string(height));
    STIPPLE_ASSIGN(const scene::Camera eye, taken(camera));
    STIPPLE_ASSIGN(const render::FrameSettings frame, settingsOf(settings, r));
    render::setSway(frame.draw.wind, r.state->hierarchies, r.state->instances, r.state->groups);
    const lod::View view = scene::makeView(eye, width, height, scene::nearPlaneOf(r.scene));
    if (waits) {
        STIPPLE_ASSIGN(const bool isWhole, render::renderUntilComplete(*r.state, view, frame));
        r.info = infoOf(*r.state);
        if (!isWhole || !r.info.isComplete) return incomplete(r);
    } else {
        STIPPLE_TRY(render::renderFrame(*r.state, view, frame));
    }
    r.info = infoOf(*r.state);
    return {};
}

}  // namespace

/// What it keeps on the device goes: not while somebody draws there, whose frame ends soon.
Renderer::Held::~Held() {
    if (!state) return;  // it was never made, by who has the device now
    for (;;) {
        const Turn mine(*device);
        if (mine) {
            state.reset();
            return;
        }
        device->isBusy.wait(true);
    }
}

Renderer::Renderer(std::unique_ptr<Held> held) : held_(std::move(held)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

Result<Renderer> Renderer::create(const Device& device, const Scene& scene, uint64_t residentBytes) {
    const Turn mine(*device.held_);
    if (!mine) return busy();
    auto held = std::make_unique<Held>();
    held->device = device.held_;
    held->scene = scene.held_->opened;
    held->colour = scene.held_->colour;
    streaming::StreamSettings streams;
    streams.residentBytes = residentBytes;
    held->state = render::makeFrameState(held->scene.placed, *held->device->backend, *held->device->executor, streams,
                                         held->scene.groups);
    return Renderer(std::move(held));
}

Result<Image> Renderer::render(const Camera& camera, uint32_t width, uint32_t height, const RenderSettings& settings) {
    Image image;
    if (!held_) return Error{ErrorKind::usage, "was moved from", "renderer", ""};
    const Turn mine(*held_->device);
    if (!mine) return busy();
    if (const auto drawn = draw(*held_, camera, width, height, settings, true); !drawn) return given(drawn.error());
    give(held_->state->image, image);
    return image;
}

Result<FrameInfo> Renderer::renderFrame(const Camera& camera, uint32_t width, uint32_t height, Image& image,
                                        const RenderSettings& settings) {
    if (!held_) return Error{ErrorKind::usage, "was moved from", "renderer", ""};
    const Turn mine(*held_->device);
    if (!mine) return busy();
    if (const auto drawn = draw(*held_, camera, width, height, settings, false); !drawn) return given(drawn.error());
    give(held_->state->image, image);
    return held_->info;
}

FrameInfo Renderer::info() const { return held_ ? held_->info : FrameInfo{}; }

Result<void> writeImage(const std::string& path, const Image& from) {
    const size_t pixels = size_t{from.width} * from.height;
    if (pixels == 0 || from.rgba.size() != 4 * pixels)
        return Error{ErrorKind::usage, "has no pixels, or not four bytes for each", path, ""};
    render::Image image{from.width, from.height, std::vector<uint32_t>(pixels), from.depth, from.normal, from.linear};
    std::memcpy(image.rgba.data(), from.rgba.data(), from.rgba.size());
    if (const auto written = image::writePicture(path, image, {}); !written) return given(written.error());
    return {};
}

}  // namespace stipple::v1
