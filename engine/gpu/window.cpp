#define GLFW_INCLUDE_VULKAN
#include "engine/gpu/window.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_impl_glfw.h>
#include <imgui_impl_vulkan.h>

#ifdef STIPPLE_WITH_X11
#include <X11/Xlib.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/vec2.hpp>
#include <string_view>
#include <utility>

#include "engine/base/process.h"
#include "engine/gpu/device.h"
#include "engine/gpu/gpu_backend.h"
#include "engine/gpu/swapchain.h"

namespace stipple::gpu {
namespace {

std::string lastGlfwError() {
    const char* text = nullptr;
    glfwGetError(&text);
    return text ? text : "unknown";
}

/// The position (see Steer) of a key, or of an arrow; kSteerCount: another key.
size_t steerOf(int key) {
    const size_t position = kSteerPositions.find(static_cast<char>(key));
    return key <= GLFW_KEY_Z && position != std::string_view::npos ? position : kSteerCount;
}
constexpr std::array<int, kSteerCount> kArrows{GLFW_KEY_UP,    GLFW_KEY_LEFT,      GLFW_KEY_DOWN,
                                               GLFW_KEY_RIGHT, GLFW_KEY_PAGE_DOWN, GLFW_KEY_PAGE_UP};
size_t arrowOf(int key) {
    return static_cast<size_t>(std::find(kArrows.begin(), kArrows.end(), key) - kArrows.begin());
}

/// What events said since the last poll: what is over by then counts too.
struct InputState {
    double scroll = 0;
    glm::dvec2 pointer{0}, leftDrag{0}, rightDrag{0};  ///< units of the window
    std::array<bool, kSteerCount> held{}, arrows{};
    bool isIconified = false, isStale = true;
    std::string pressed;
    std::vector<std::string> dropped;
};
InputState& stateOf(GLFWwindow* window) { return *static_cast<InputState*>(glfwGetWindowUserPointer(window)); }

std::string_view printedOn(int key, int scancode) {
    const char* const name = glfwGetKeyName(key, scancode);
    return name ? name : "";
}

/// With Ctrl, Alt or Super a key is somebody else's command, not ours.
constexpr int kForeign = GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER;

void onScroll(GLFWwindow* window, double, double y) { stateOf(window).scroll += y; }
void onKey(GLFWwindow* window, int key, int scancode, int action, int modifiers) {
    if (action != GLFW_PRESS || (modifiers & kForeign) != 0) return;
    if (const size_t steer = steerOf(key); steer < kSteerCount) stateOf(window).held[steer] = true;
    if (const size_t arrow = arrowOf(key); arrow < kSteerCount) stateOf(window).arrows[arrow] = true;
    std::string& pressed = stateOf(window).pressed;
    if (key >= GLFW_KEY_KP_0 && key <= GLFW_KEY_KP_9) pressed += static_cast<char>('0' + key - GLFW_KEY_KP_0);
    if (key == GLFW_KEY_TAB) pressed += '\t';
    if (key == GLFW_KEY_ESCAPE) pressed += char{27};
    if (key == GLFW_KEY_SPACE) pressed += ' ';
    if (key == GLFW_KEY_F1) pressed += 'H';
    if (key > GLFW_KEY_SPACE && key <= GLFW_KEY_WORLD_2)
        if (const char command = commandOf(key, printedOn(key, scancode)); command != 0) pressed += command;
}
void onPointer(GLFWwindow* window, double x, double y) {
    InputState& state = stateOf(window);
    const glm::dvec2 moved = glm::dvec2(x, y) - state.pointer;
    if (glfwGetMouseButton(window, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS) state.leftDrag += moved;
    if (glfwGetMouseButton(window, GLFW_MOUSE_BUTTON_RIGHT) == GLFW_PRESS) state.rightDrag += moved;
    state.pointer = {x, y};
}
void onDrop(GLFWwindow* window, int count, const char** paths) {
    stateOf(window).dropped.insert(stateOf(window).dropped.end(), paths, paths + count);
}
void onIconify(GLFWwindow* window, int iconified) { stateOf(window).isIconified = iconified != 0; }
void onRefresh(GLFWwindow* window) { stateOf(window).isStale = true; }

#ifdef STIPPLE_WITH_X11
/// Xlib ends the program by default, e.g. where one that dragged a file here is gone when it is answered.
int onXError(Display*, XErrorEvent*) { return 0; }
#endif

class WindowImpl final : public Window {
  public:
    ~WindowImpl() override {
        if (device_) {
            vkDeviceWaitIdle(device_->device);
            if (imguiReady_) {
                ImGui_ImplVulkan_Shutdown();
                ImGui_ImplGlfw_Shutdown();
            }
            if (ImGui::GetCurrentContext()) ImGui::DestroyContext();
            vkDestroyDescriptorPool(device_->device, imguiPool_, nullptr);
            swapchain_.reset();
            if (surface_ != VK_NULL_HANDLE) vkDestroySurfaceKHR(device_->instance, surface_, nullptr);
            device_.reset();
        }
        if (window_) glfwDestroyWindow(window_);
        glfwTerminate();
    }

    Result<void> open(const WindowSettings& settings) {
        if (!glfwInit())
            return fail(ErrorKind::device, "no window can be opened: " + lastGlfwError(), "display",
                        "use stipple render, or run under a display (xvfb-run)");
        glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
        window_ = glfwCreateWindow(static_cast<int>(settings.width), static_cast<int>(settings.height),
                                   settings.title.c_str(), nullptr, nullptr);
        if (!window_)
            return fail(ErrorKind::device, "no window can be opened: " + lastGlfwError(), "display",
                        "use stipple render");
#ifdef STIPPLE_WITH_X11
        XSetErrorHandler(onXError);  // after GLFW, which sets its own while it makes a window
#endif
        glfwSetWindowUserPointer(window_, &inputState_);
        glfwGetCursorPos(window_, &inputState_.pointer.x, &inputState_.pointer.y);
        glfwSetScrollCallback(window_, onScroll);
        glfwSetKeyCallback(window_, onKey);
        glfwSetCursorPosCallback(window_, onPointer);
        glfwSetDropCallback(window_, onDrop);
        glfwSetWindowIconifyCallback(window_, onIconify);
        glfwSetWindowRefreshCallback(window_, onRefresh);
        uint32_t count = 0;
        const char** extensions = glfwGetRequiredInstanceExtensions(&count);
        if (!extensions)
            return fail(ErrorKind::device, "Vulkan cannot present here: " + lastGlfwError(), "display",
                        "apt-get install mesa-vulkan-drivers");
        STIPPLE_ASSIGN(device_, Device::create({settings.deviceName,
                                                settings.validation,
                                                {extensions, extensions + count},
                                                {VK_KHR_SWAPCHAIN_EXTENSION_NAME}}));
        if (const VkResult r = glfwCreateWindowSurface(device_->instance, window_, nullptr, &surface_); r != VK_SUCCESS)
            return vulkanError(r, "no surface");
        STIPPLE_ASSIGN(swapchain_, Swapchain::create(*device_, surface_));
        STIPPLE_TRY(swapchain_->resize(settings.width, settings.height));
        return setupImgui();
    }

    Input poll(double waitSeconds) override {
        inputState_.scroll = 0;
        inputState_.leftDrag = inputState_.rightDrag = {0, 0};
        inputState_.held = inputState_.arrows = {};
        inputState_.pressed.clear();
        inputState_.dropped.clear();
        if (waitSeconds > 0)
            glfwWaitEventsTimeout(waitSeconds);
        else
            glfwPollEvents();
        Input in;
        const double now = nowSeconds();
        in.seconds = lastPoll_ > 0 && waitSeconds <= 0 ? now - lastPoll_ : 0;
        lastPoll_ = now;
        readMouse(in);
        readKeys(in);
        // An iconified window keeps its size under X11; other systems say 0 x 0.
        in.isHidden = inputState_.isIconified || in.width == 0 || in.height == 0 ||
                      glfwGetWindowAttrib(window_, GLFW_VISIBLE) == GLFW_FALSE;
        if (in.isHidden) inputState_.isStale = true;
        in.isStale = std::exchange(inputState_.isStale, in.isHidden);
        in.shouldClose = glfwWindowShouldClose(window_) != 0;
        return in;
    }

    std::shared_ptr<Device> device() const override { return device_; }

    Result<bool> present(const Shown& shown, const std::function<void()>& drawOverlay,
                         render::Image* capture) override {
        STIPPLE_ASSIGN(const ShownPixels pixels, pixelsOf(shown));
        fitImgui(pixels);
        ImGui_ImplVulkan_NewFrame();
        ImGui_ImplGlfw_NewFrame();
        // Twice: the first time finds how large the text is, and what is new is not shown yet. With frames drawn only
        // when something changes, there may be no next one for it to appear in.
        ImGui::NewFrame();
        drawOverlay();
        ImGui::EndFrame();
        ImGui::GetIO().DeltaTime = 1e-3f;
        ImGui::NewFrame();
        drawOverlay();
        ImGui::Render();
        return swapchain_->present(
            pixels, [](VkCommandBuffer c) { ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), c); }, capture);
    }

    void setTitle(const std::string& title) override { glfwSetWindowTitle(window_, title.c_str()); }

    std::vector<std::string> validationMessages() const override { return device_->messages(); }

  private:
    Result<ShownPixels> pixelsOf(const Shown& shown) const {
        if (shown.backend == nullptr)
            return ShownPixels{shown.image->rgba.data(), VK_NULL_HANDLE, shown.image->width, shown.image->height};
        const std::optional<DevicePicture> drawn = pictureOf(*shown.backend, shown.ticket);
        if (!drawn || drawn->device != device_.get()) return render::noSuchPicture(shown.ticket);
        return ShownPixels{nullptr, drawn->pixels, drawn->width, drawn->height};
    }

    /// Pixels of the framebuffer for one unit of the window's coordinates: not 1 where the system scales windows.
    glm::dvec2 pixelsPerUnit(int framebufferWidth, int framebufferHeight) const {
        int w = 0, h = 0;
        glfwGetWindowSize(window_, &w, &h);
        return {w > 0 ? static_cast<double>(framebufferWidth) / w : 1.0,
                h > 0 ? static_cast<double>(framebufferHeight) / h : 1.0};
    }

    void readMouse(Input& in) {
        int w = 0, h = 0;
        glfwGetFramebufferSize(window_, &w, &h);
        in.width = static_cast<uint32_t>(w);
        in.height = static_cast<uint32_t>(h);
        const glm::dvec2 scale = pixelsPerUnit(w, h);
        const bool overlayWantsMouse = ImGui::GetIO().WantCaptureMouse;  // only where something can be clicked
        if (!overlayWantsMouse) {
            in.leftDrag = scale * inputState_.leftDrag;
            in.rightDrag = scale * inputState_.rightDrag;
        }
        in.scroll = overlayWantsMouse ? 0 : inputState_.scroll;
    }

    void readKeys(Input& in) {
        const auto key = [&](int k) { return glfwGetKey(window_, k) == GLFW_PRESS; };
        const auto either = [&](int left, int right) { return key(left) || key(right); };
        const bool foreign = either(GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL) ||
                             either(GLFW_KEY_LEFT_ALT, GLFW_KEY_RIGHT_ALT) ||
                             either(GLFW_KEY_LEFT_SUPER, GLFW_KEY_RIGHT_SUPER);
        for (size_t i = 0; i < kSteerCount; ++i) {
            const int position = kSteerPositions[i];
            in.held[i] = inputState_.held[i] || (!foreign && key(position));
            in.arrows[i] = inputState_.arrows[i] || (!foreign && key(kArrows[i]));
            in.names[i] = nameOf(position, printedOn(position, 0));
        }
        in.fast = either(GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT);
        in.pressed = inputState_.pressed;
        in.dropped = inputState_.dropped;
    }

    /// Letters of the size that the desktop asks for. ImGui counts in the window's units, fonts are made in pixels.
    void scaleImgui() {
        float x = 1, y = 1;
        glfwGetWindowContentScale(window_, &x, &y);
        contentScale_ = std::clamp(x, 0.5f, 8.0f);
        ImFontConfig font;
        font.SizePixels = std::round(13 * contentScale_);
        ImGui::GetIO().Fonts->AddFontDefault(&font);
    }

    /// Smaller letters where the window is too small for what they say, but never below those of a plain screen.
    void fitImgui(const ShownPixels& shown) {
        const float fits = std::min(static_cast<float>(shown.width) / 640, static_cast<float>(shown.height) / 400);
        const float wanted = std::clamp(fits, std::min(1.0f, contentScale_), contentScale_);
        const auto pixels =
            static_cast<float>(pixelsPerUnit(static_cast<int>(shown.width), static_cast<int>(shown.height)).x);
        ImGui::GetIO().FontGlobalScale = wanted / contentScale_ / pixels;
    }

    Result<void> setupImgui() {
        const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4};
        VkDescriptorPoolCreateInfo pool{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
        pool.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
        pool.maxSets = 4;
        pool.poolSizeCount = 1;
        pool.pPoolSizes = &size;
        if (const VkResult r = vkCreateDescriptorPool(device_->device, &pool, nullptr, &imguiPool_); r != VK_SUCCESS)
            return vulkanError(r, "no descriptor pool");
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;
        scaleImgui();
        ImGui_ImplGlfw_InitForVulkan(window_, true);
        ImGui_ImplVulkan_InitInfo info{};
        info.Instance = device_->instance;
        info.PhysicalDevice = device_->physical;
        info.Device = device_->device;
        info.QueueFamily = device_->queueFamily;
        info.Queue = device_->queue;
        info.DescriptorPool = imguiPool_;
        info.MinImageCount = 2;
        info.ImageCount = 2;
        info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
        ImGui_ImplVulkan_Init(&info, swapchain_->renderPass());
        imguiReady_ = true;
        STIPPLE_TRY(swapchain_->runOnce([](VkCommandBuffer c) { ImGui_ImplVulkan_CreateFontsTexture(c); }));
        ImGui_ImplVulkan_DestroyFontUploadObjects();
        return {};
    }

    GLFWwindow* window_ = nullptr;
    std::shared_ptr<Device> device_;
    VkSurfaceKHR surface_ = VK_NULL_HANDLE;
    std::unique_ptr<Swapchain> swapchain_;
    VkDescriptorPool imguiPool_ = VK_NULL_HANDLE;
    InputState inputState_;
    float contentScale_ = 1;
    double lastPoll_ = 0;
    bool imguiReady_ = false;
};

}  // namespace

Result<std::unique_ptr<Window>> Window::create(const WindowSettings& settings) {
    auto window = std::make_unique<WindowImpl>();
    STIPPLE_TRY(window->open(settings));
    return window;
}

bool hasDisplay() {
    const auto isSet = [](const char* name) {
        const char* value = std::getenv(name);
        return value && *value;
    };
    return isSet("DISPLAY") || isSet("WAYLAND_DISPLAY");
}

}  // namespace stipple::gpu
