// A window: a Vulkan swapchain that shows what a backend drew with an overlay (Dear ImGui) on top: from where it lies
// if the window's own device has drawn it, else copied there. GLFW for input.
#pragma once

#include <array>
#include <functional>
#include <glm/vec2.hpp>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "engine/gpu/keys.h"
#include "engine/render/backend.h"

struct GLFWwindow;

namespace stipple::gpu {

/// What the user did since the last poll. Positions in pixels of the framebuffer.
struct Input {
    bool shouldClose = false;
    bool isHidden = false;                 ///< minimised: nothing is seen of it
    bool isStale = false;                  ///< what it showed is lost (uncovered, restored) or was never shown
    uint32_t width = 0, height = 0;        ///< of the framebuffer
    double seconds = 0;                    ///< since the last poll; 0 after waiting
    glm::dvec2 leftDrag{0}, rightDrag{0};  ///< how far the pointer went while a button was down
    double scroll = 0;
    bool fast = false;
    std::array<bool, kSteerCount> held{};    ///< keys at kSteerPositions that are down, or were for a moment
    std::array<bool, kSteerCount> arrows{};  ///< arrows, page down and up
    std::array<char, kSteerCount> names{};   ///< what the keyboard's layout calls the keys of `held`
    std::string pressed;               ///< commands (see commandOf), '\t' for Tab, 27 for Escape, ' '; F1 counts as H
    std::vector<std::string> dropped;  ///< files
};

class Device;

struct WindowSettings {
    std::string title;
    uint32_t width = 0, height = 0;
    std::string deviceName;   ///< part of a name; empty: the first device, real ones before software
    bool validation = false;  ///< core and synchronization validation; messages are kept
};

/// What a window shows: a picture in memory, or a frame that the window's device has been told to draw and keep
/// (RenderRequest::staysOnDevice).
struct Shown {
    const render::Image* image = nullptr;
    const render::Backend* backend = nullptr;  ///< null: the image
    render::Ticket ticket;
};

class Window {
  public:
    static Result<std::unique_ptr<Window>> create(const WindowSettings& settings);
    virtual ~Window() = default;
    /// What shows; a backend on it need not copy what it draws. It outlives the window where others hold it.
    virtual std::shared_ptr<Device> device() const = 0;
    /// Waits for something to happen, `waitSeconds` at most (0: not at all).
    virtual Input poll(double waitSeconds) = 0;
    /// Shows `shown` with what `drawOverlay` draws by ImGui calls. `capture`, if not null, receives the finished
    /// picture. False if it could not be shown now: draw again.
    virtual Result<bool> present(const Shown& shown, const std::function<void()>& drawOverlay,
                                 render::Image* capture) = 0;
    virtual void setTitle(const std::string& title) = 0;
    virtual std::vector<std::string> validationMessages() const = 0;
};

/// Is there a display to open a window on?
bool hasDisplay();

}  // namespace stipple::gpu
