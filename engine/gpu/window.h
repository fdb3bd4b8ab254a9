// A window: a Vulkan swapchain that shows a backend's image with an overlay (Dear ImGui) on top. GLFW for input.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "engine/base/result.h"
#include "engine/render/backend.h"

struct GLFWwindow;

namespace stipple::gpu {

/// What the user did since the last poll. Positions in pixels of the framebuffer.
struct Input {
    bool shouldClose = false;
    uint32_t width = 0, height = 0;  ///< of the framebuffer; 0 while minimised
    double seconds = 0;              ///< since the last poll
    double mouseX = 0, mouseY = 0, mouseDeltaX = 0, mouseDeltaY = 0, scroll = 0;
    bool leftButton = false, rightButton = false;
    bool forward = false, back = false, left = false, right = false, up = false, down = false, fast = false;
    std::string pressed;  ///< keys pressed once: letters and digits, '\t' for Tab, 27 for Escape
};

class Window {
  public:
    static Result<std::unique_ptr<Window>> create(const std::string& title, uint32_t width, uint32_t height,
                                                  bool validation);
    virtual ~Window() = default;
    virtual Input poll() = 0;
    /// Shows `image` with what `drawOverlay` draws by ImGui calls. `capture`, if not null, receives the finished
    /// picture.
    virtual Result<void> present(const render::Image& image, const std::function<void()>& drawOverlay,
                                 render::Image* capture) = 0;
    virtual std::vector<std::string> validationMessages() const = 0;
};

/// Is there a display to open a window on?
bool hasDisplay();

}  // namespace stipple::gpu
