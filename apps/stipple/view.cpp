#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "apps/stipple/common.h"
#include "apps/stipple/legend.h"
#include "apps/stipple/navigation.h"
#include "engine/base/process.h"
#include "engine/gpu/window.h"
#include "engine/image/image_io.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"

namespace stipple::app {
namespace {

struct Options {
    std::vector<std::string> inputs;
    std::string size = "1280x720", device = "auto", screenshot, resident = "1G", shade = "auto";
    double error = 1, wind = 0;
    uint64_t budget = 2'000'000;
    int frames = 0;
    BuildOptions build;
    ColourOptions colour;
    EnvironmentOptions environment;
};

constexpr std::array<const char*, 5> kDebugNames{"none", "level", "screen-space error", "holes", "normals"};

void drawOverlay(const render::FrameState& state, const render::FrameSettings& settings,
                 const std::vector<render::PassTime>& passes, double frameSeconds, bool flying) {
    const FrameCounters& c = state.counters;
    ImGui::SetNextWindowPos(ImVec2(10, 10));
    ImGui::SetNextWindowBgAlpha(0.7f);
    ImGui::Begin("stipple", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoNav);
    ImGui::Text("%s: %s", state.backend->name().c_str(), state.backend->device().c_str());
    ImGui::Text("%.1f ms a frame, %.1f ms with the window", c.frameMs, frameSeconds * 1e3);
    for (const render::PassTime& p : passes) ImGui::Text("  %-8s %6.2f ms", p.name.c_str(), p.ms);
    ImGui::Text("delivered error %.2f px (asked for %.2f)", c.tauEffectivePixels, settings.budgets.errorPixels);
    ImGui::Text("%llu nodes, %llu missing, %u chunks on their way", static_cast<unsigned long long>(c.nodesDrawn),
                static_cast<unsigned long long>(c.nodesMissing), static_cast<unsigned>(c.requestsInFlight));
    const float used =
        static_cast<float>(c.recordsDrawn + c.trianglesDrawn) / static_cast<float>(settings.budgets.records);
    ImGui::ProgressBar(
        used, ImVec2(300, 0),
        fmt::format("{:.2f} M points, {:.2f} M triangles of {:.2f} M", static_cast<double>(c.recordsDrawn) * 1e-6,
                    static_cast<double>(c.trianglesDrawn) * 1e-6, static_cast<double>(settings.budgets.records) * 1e-6)
            .c_str());
    ImGui::Text("resident %s", humanBytes(c.residentBytes).c_str());
    ImGui::Text("debug view: %s", kDebugNames.at(settings.draw.debugView));
    if (c.failures > 0) ImGui::TextColored(ImVec4(1, 0.4f, 0.3f, 1), "%s", state.streamer->lastFailure().c_str());
    ImGui::Separator();
    ImGui::TextUnformatted(flying ? "fly: W A S D Q E, drag to look, wheel: speed, Shift: faster"
                                  : "orbit: drag, right drag: move, wheel: nearer");
    ImGui::TextUnformatted(
        "F fly/orbit  M mode  V debug view  L light  C colours  [1-9] error  P picture  Tab overlay  Esc quit");
    ImGui::End();
}

void drawLegendOverlay(const Legend& legend) {
    if (legend.entries.empty()) return;
    ImGui::SetNextWindowPos(ImVec2(10, ImGui::GetIO().DisplaySize.y - 10), ImGuiCond_Always, ImVec2(0, 1));
    ImGui::SetNextWindowBgAlpha(0.7f);
    ImGui::Begin("legend", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoNav);
    ImGui::TextUnformatted(legend.title.c_str());
    const auto swatch = [](uint32_t rgb, float width, float height) {
        const ImVec2 at = ImGui::GetCursorScreenPos();
        ImGui::GetWindowDrawList()->AddRectFilled(at, ImVec2(at.x + width, at.y + height), rgb | 0xff000000u);
    };
    if (legend.bar.empty())
        for (const LegendEntry& e : legend.entries) {
            swatch(e.rgb, 13, 13);
            ImGui::Indent(20);
            ImGui::TextUnformatted(e.label.c_str());
            ImGui::Unindent(20);
        }
    else {
        ImGui::Dummy(ImVec2(1, 6));
        const ImVec2 start = ImGui::GetCursorPos();
        for (size_t j = legend.bar.size(); j-- > 0;) {
            swatch(legend.bar[j], 13, 1);
            ImGui::SetCursorPosY(ImGui::GetCursorPosY() + 1);
        }
        const float step = static_cast<float>(legend.bar.size()) / static_cast<float>(legend.entries.size() - 1);
        for (size_t i = 0; i < legend.entries.size(); ++i) {
            const float up = step * static_cast<float>(legend.entries.size() - 1 - i);
            ImGui::SetCursorPos(ImVec2(start.x + 20, start.y + up - 7));
            ImGui::TextUnformatted(legend.entries[i].label.c_str());
        }
    }
    ImGui::End();
}

/// Own colours, height, normals, then every attribute, and round again.
std::string nextColour(const lod::ColourBy& now, const lod::StoreDescription& d) {
    std::vector<std::string> names{"auto", "height"};
    if (d.hasNormals) names.emplace_back("normal");
    for (const lod::AttributeInfo& a : d.attributes) names.push_back(a.name);
    size_t at = 0;
    for (size_t i = 0; i < names.size(); ++i)
        if (now.mode != lod::ColourMode::own && names[i] == now.title) at = i;
    return names[(at + 1) % names.size()];
}

/// What the keys change. True if a picture is asked for.
bool applyKeys(const std::string& pressed, render::FrameSettings& settings, Navigation& navigation, bool& overlay) {
    bool picture = false;
    for (const char key : pressed) {
        if (key == 'F') navigation.toggleFly();
        if (key == 'M')
            settings.mode = settings.mode == render::Mode::pullpush ? render::Mode::points : render::Mode::pullpush;
        if (key == 'V')
            settings.draw.debugView = (settings.draw.debugView + 1) % static_cast<uint32_t>(kDebugNames.size());
        if (key == 'L') {
            settings.draw.lit = !settings.draw.lit;
            settings.draw.unlitTriangles = !settings.draw.lit;
        }
        if (key == '\t') overlay = !overlay;
        if (key == 'P') picture = true;
        if (key >= '1' && key <= '9') settings.budgets.errorPixels = 0.25 * std::exp2(key - '1');
    }
    return picture;
}

Result<void> run(const Options& o) {
    STIPPLE_ASSIGN(const glm::uvec2 size, parseSize(o.size));
    if (!o.screenshot.empty()) STIPPLE_TRY(image::checkImagePath(o.screenshot));
    if (!gpu::hasDisplay())
        return fail(ErrorKind::device, "there is no display", "stipple view",
                    "use stipple render, or xvfb-run stipple view");
    const auto executor = makeTbbExecutor(o.build.threads);
    STIPPLE_ASSIGN(OpenedScene scene, openScene(o.inputs, o.build, *executor, true));
    const lod::StoreDescription& d = scene.description;
    STIPPLE_ASSIGN(const std::unique_ptr<render::Backend> backend, makeBackend(o.device, *executor));
    STIPPLE_ASSIGN(
        const std::unique_ptr<gpu::Window> window,
        gpu::Window::create("Stipple: " + d.source, size.x, size.y, std::getenv("STIPPLE_VALIDATION") != nullptr));
    streaming::StreamSettings stream;
    stream.residentBytes = std::max<uint64_t>(1, parseBytes(o.resident));
    STIPPLE_ASSIGN(lod::ColourBy colour, applyColours(scene, o.colour.what, o.colour.map, o.colour.range));
    auto state = render::makeFrameState(scene.placed, *backend, *executor, stream, scene.crowds);
    Legend legend = makeLegend(colour, d);
    render::FrameSettings settings;
    settings.budgets = {o.error, o.budget};
    settings.draw.unlitTriangles = o.shade == "unlit";
    settings.draw.lights = scene.lights;
    STIPPLE_ASSIGN(settings.draw.environment, openEnvironment(o.environment.path, o.environment.scale, *executor));
    settings.draw.lit = o.shade == "lit" || (o.shade == "auto" && isShaded(d) && colour.mode == lod::ColourMode::own);
    settings.draw.worldUp = d.up;
    settings.draw.wind = {o.wind, 0, render::windAcross(d.up)};
    render::setSway(settings.draw.wind, state->hierarchies, state->instances);
    const double diagonal = std::max(1e-300, glm::length(d.boundsMax - d.boundsMin));
    Navigation navigation(scene::fitCamera(d.focusMin, d.focusMax, d.up, static_cast<double>(size.x) / size.y),
                          diagonal);
    bool overlay = true;
    int pictures = 0;
    for (int frame = 0;; ++frame) {
        const gpu::Input input = window->poll();
        const bool last = o.frames > 0 && frame + 1 >= o.frames;
        if (input.shouldClose) break;
        if (input.width == 0 || input.height == 0) continue;
        const bool picture = applyKeys(input.pressed, settings, navigation, overlay);
        if (input.pressed.find('C') != std::string::npos) {
            STIPPLE_ASSIGN(colour, applyColours(scene, nextColour(colour, d), "", ""));
            legend = makeLegend(colour, d);
            state.reset();  // gives back what is resident
            state = render::makeFrameState(scene.placed, *backend, *executor, stream, scene.crowds);
            render::setSway(settings.draw.wind, state->hierarchies, state->instances);
            settings.draw.lit = o.shade == "lit" || (colour.mode == lod::ColourMode::own && isShaded(d));
        }
        navigation.move(input);
        settings.draw.wind.seconds += input.seconds;
        const lod::View view = scene::makeView(navigation.camera(), input.width, input.height, 1e-6 * diagonal);
        if (last) {
            STIPPLE_TRY(render::renderUntilComplete(*state, view, settings, *executor));
        } else {
            STIPPLE_TRY(render::renderFrame(*state, view, settings));
        }
        render::Image shot;
        const bool wantShot = picture || (last && !o.screenshot.empty());
        STIPPLE_TRY(window->present(
            state->image,
            [&] {
                if (overlay) drawOverlay(*state, settings, backend->passTimes(), input.seconds, navigation.isFlying());
                if (overlay) drawLegendOverlay(legend);
            },
            wantShot ? &shot : nullptr));
        if (wantShot && !shot.rgba.empty()) {
            const std::string path =
                last && !o.screenshot.empty() ? o.screenshot : fmt::format("stipple_{:03}.png", ++pictures);
            STIPPLE_TRY(image::writeImage(path, shot));
            fmt::print("{}\n", path);
        }
        if (last) break;
    }
    for (const std::string& message : window->validationMessages()) fmt::print(stderr, "validation: {}\n", message);
    if (!window->validationMessages().empty())
        return fail(ErrorKind::device, "the validation layers complained", "stipple view");
    return {};
}

}  // namespace

void setupView(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("view", "walk through a scene in a window");
    sub->add_option("SCENE", o->inputs, "a .stipple scene, or scans (built into the cache first)")->required();
    sub->add_option("--size", o->size, "of the window, pixels")->capture_default_str();
    sub->add_option("--error", o->error, "tolerated screen-space error, pixels")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    sub->add_option("--wind", o->wind, "how far tops of plants move at most, share of their height (e.g. 0.03)")
        ->check(CLI::Range(0.0, 0.5))
        ->capture_default_str();
    sub->add_option("--budget-points", o->budget, "records drawn at most")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    sub->add_option("--resident", o->resident, "memory for resident chunks")->capture_default_str();
    sub->add_option("--device", o->device, "auto, cpu, gpu or gpu:NAME")->capture_default_str();
    sub->add_option("--shade", o->shade, "auto: unlit where the scan has colours")
        ->check(CLI::IsMember({"auto", "lit", "unlit"}))
        ->capture_default_str();
    sub->add_option("--frames", o->frames, "close after N frames (0: when the user does)")->capture_default_str();
    sub->add_option("--screenshot", o->screenshot, "with --frames: write what the last frame shows");
    o->colour.addTo(*sub);
    o->environment.addTo(*sub);
    o->build.addTo(*sub);
    o->build.addCacheTo(*sub);
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
