#define GLFW_INCLUDE_VULKAN
#include "engine/gpu/window.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_impl_glfw.h>
#include <imgui_impl_vulkan.h>

#include <algorithm>
#include <cstring>

#include "engine/base/process.h"
#include "engine/gpu/device.h"
#include "engine/gpu/swapchain.h"

namespace stipple::gpu {
namespace {

std::string lastGlfwError() {
    const char* text = nullptr;
    glfwGetError(&text);
    return text ? text : "unknown";
}

struct InputState {
    double scroll = 0;
    std::string pressed;
};

void onScroll(GLFWwindow* window, double, double y) {
    static_cast<InputState*>(glfwGetWindowUserPointer(window))->scroll += y;
}
void onKey(GLFWwindow* window, int key, int, int action, int) {
    if (action != GLFW_PRESS) return;
    auto* state = static_cast<InputState*>(glfwGetWindowUserPointer(window));
    if (key >= GLFW_KEY_0 && key <= GLFW_KEY_Z) state->pressed += static_cast<char>(key);
    if (key == GLFW_KEY_TAB) state->pressed += '\t';
    if (key == GLFW_KEY_ESCAPE) state->pressed += char{27};
}

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

    Result<void> open(const std::string& title, uint32_t width, uint32_t height, bool validation) {
        if (!glfwInit())
            return fail(ErrorKind::device, "no window can be opened: " + lastGlfwError(), "display",
                        "use stipple render, or run under a display (xvfb-run)");
        glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
        window_ = glfwCreateWindow(static_cast<int>(width), static_cast<int>(height), title.c_str(), nullptr, nullptr);
        if (!window_)
            return fail(ErrorKind::device, "no window can be opened: " + lastGlfwError(), "display",
                        "use stipple render");
        glfwSetWindowUserPointer(window_, &inputState_);
        glfwSetScrollCallback(window_, onScroll);
        glfwSetKeyCallback(window_, onKey);
        uint32_t count = 0;
        const char** extensions = glfwGetRequiredInstanceExtensions(&count);
        if (!extensions)
            return fail(ErrorKind::device, "Vulkan cannot present here: " + lastGlfwError(), "display",
                        "apt-get install mesa-vulkan-drivers");
        STIPPLE_ASSIGN(
            device_,
            Device::create({"", validation, {extensions, extensions + count}, {VK_KHR_SWAPCHAIN_EXTENSION_NAME}}));
        if (const VkResult r = glfwCreateWindowSurface(device_->instance, window_, nullptr, &surface_); r != VK_SUCCESS)
            return vulkanError(r, "no surface");
        STIPPLE_ASSIGN(swapchain_, Swapchain::create(*device_, surface_));
        STIPPLE_TRY(swapchain_->resize(width, height));
        return setupImgui();
    }

    Input poll() override {
        inputState_.scroll = 0;
        inputState_.pressed.clear();
        glfwPollEvents();
        Input in;
        int w = 0, h = 0;
        glfwGetFramebufferSize(window_, &w, &h);
        in.width = static_cast<uint32_t>(w);
        in.height = static_cast<uint32_t>(h);
        const double now = nowSeconds();
        in.seconds = lastPoll_ > 0 ? now - lastPoll_ : 0;
        lastPoll_ = now;
        glfwGetCursorPos(window_, &in.mouseX, &in.mouseY);
        in.mouseDeltaX = in.mouseX - lastX_;
        in.mouseDeltaY = in.mouseY - lastY_;
        lastX_ = in.mouseX;
        lastY_ = in.mouseY;
        const bool overlayWantsMouse = ImGui::GetIO().WantCaptureMouse;
        const auto key = [&](int k) { return glfwGetKey(window_, k) == GLFW_PRESS; };
        in.leftButton = !overlayWantsMouse && glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS;
        in.rightButton = !overlayWantsMouse && glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_RIGHT) == GLFW_PRESS;
        in.scroll = overlayWantsMouse ? 0 : inputState_.scroll;
        in.forward = key(GLFW_KEY_W);
        in.back = key(GLFW_KEY_S);
        in.left = key(GLFW_KEY_A);
        in.right = key(GLFW_KEY_D);
        in.up = key(GLFW_KEY_E);
        in.down = key(GLFW_KEY_Q);
        in.fast = key(GLFW_KEY_LEFT_SHIFT);
        in.pressed = inputState_.pressed;
        in.shouldClose = glfwWindowShouldClose(window_) != 0 || in.pressed.find(char{27}) != std::string::npos;
        return in;
    }

    Result<void> present(const render::Image& image, const std::function<void()>& drawOverlay,
                         render::Image* capture) override {
        ImGui_ImplVulkan_NewFrame();
        ImGui_ImplGlfw_NewFrame();
        ImGui::NewFrame();
        drawOverlay();
        ImGui::Render();
        return swapchain_->present(
            image, [](VkCommandBuffer c) { ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), c); }, capture);
    }

    std::vector<std::string> validationMessages() const override { return device_->messages(); }

  private:
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
    std::unique_ptr<Device> device_;
    VkSurfaceKHR surface_ = VK_NULL_HANDLE;
    std::unique_ptr<Swapchain> swapchain_;
    VkDescriptorPool imguiPool_ = VK_NULL_HANDLE;
    InputState inputState_;
    double lastPoll_ = 0, lastX_ = 0, lastY_ = 0;
    bool imguiReady_ = false;
};

}  // namespace

Result<std::unique_ptr<Window>> Window::create(const std::string& title, uint32_t width, uint32_t height,
                                               bool validation) {
    auto window = std::make_unique<WindowImpl>();
    STIPPLE_TRY(window->open(title, width, height, validation));
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
