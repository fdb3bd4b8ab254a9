// A window: a Vulkan swapchain that shows a backend's image with an overlay (Dear ImGui) on top. GLFW for input.
#pragma once

#include <array>
#include <functional>
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
    bool isHidden = false;           ///< minimised: nothing is seen of it
    bool isStale = false;            ///< what it showed is lost (uncovered, restored) or was never shown
    uint32_t width = 0, height = 0;  ///< of the framebuffer
    double seconds = 0;              ///< since the last poll; 0 after waiting
    double mouseX = 0, mouseY = 0, mouseDeltaX = 0, mouseDeltaY = 0, scroll = 0;
    bool leftButton = false, rightButton = false, fast = false;
    std::array<bool, kSteerCount> held{};    ///< keys at kSteerPositions
    std::array<bool, kSteerCount> arrows{};  ///< arrows, page down and up
    std::array<char, kSteerCount> names{};   ///< what the keyboard's layout calls the keys of `held`
    std::string pressed;               ///< commands (see commandOf), '\t' for Tab, 27 for Escape, ' '; F1 counts as H
    std::vector<std::string> dropped;  ///< files
};

class Window {
  public:
    static Result<std::unique_ptr<Window>> create(const std::string& title, uint32_t width, uint32_t height,
                                                  bool validation);
    virtual ~Window() = default;
    /// Waits for something to happen, `waitSeconds` at most (0: not at all).
    virtual Input poll(double waitSeconds) = 0;
    /// Shows `image` with what `drawOverlay` draws by ImGui calls. `capture`, if not null, receives the finished
    /// picture. False if it could not be shown now: draw again.
    virtual Result<bool> present(const render::Image& image, const std::function<void()>& drawOverlay,
                                 render::Image* capture) = 0;
    virtual void setTitle(const std::string& title) = 0;
    virtual std::vector<std::string> validationMessages() const = 0;
};

/// Is there a display to open a window on?
bool hasDisplay();

}  // namespace stipple::gpu
