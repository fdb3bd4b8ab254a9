// A scan in a GLFW and OpenGL window of one's own, drawn with what has come so far: window SCAN [FRAMES [PICTURE.png]]
#include <GLFW/glfw3.h>
#include <stipple/stipple.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace {

int failed(const stipple::Error& error) {
    std::fprintf(stderr, "%s\n", error.line().c_str());
    return static_cast<int>(error.kind);
}

/// The pixels over all of the window.
void show(const stipple::Image& image) {
    glRasterPos2f(-1, 1);
    glPixelZoom(1, -1);  // rows come from the top
    glDrawPixels(static_cast<GLsizei>(image.width), static_cast<GLsizei>(image.height), GL_RGBA, GL_UNSIGNED_BYTE,
                 image.rgba.data());
}

/// What the window shows now.
stipple::Image shown(int width, int height) {
    stipple::Image image;
    image.width = static_cast<uint32_t>(width);
    image.height = static_cast<uint32_t>(height);
    image.rgba.resize(size_t{4} * image.width * image.height);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, image.rgba.data());
    const size_t row = size_t{4} * image.width;
    for (size_t y = 0; 2 * y + 1 < image.height; ++y)
        std::swap_ranges(image.rgba.begin() + static_cast<std::ptrdiff_t>(y * row),
                         image.rgba.begin() + static_cast<std::ptrdiff_t>((y + 1) * row),
                         image.rgba.begin() + static_cast<std::ptrdiff_t>((image.height - 1 - y) * row));
    return image;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) return std::fprintf(stderr, "usage: window SCAN [FRAMES [PICTURE.png]]\n"), 2;
    const int frames = argc > 2 ? std::atoi(argv[2]) : 0;
    if (glfwInit() == 0) return std::fprintf(stderr, "there is no display\n"), 5;
    GLFWwindow* window = glfwCreateWindow(960, 540, "A window of one's own", nullptr, nullptr);
    if (window == nullptr) return std::fprintf(stderr, "there is no OpenGL\n"), 5;
    glfwMakeContextCurrent(window);
    auto device = stipple::Device::open("cpu");
    if (!device) return failed(device.error());
    auto scene = stipple::Scene::open({argv[1]});
    if (!scene) return failed(scene.error());
    auto renderer = stipple::Renderer::create(*device, *scene);
    if (!renderer) return failed(renderer.error());
    stipple::Image image;
    int status = 0;
    for (int f = 0; glfwWindowShouldClose(window) == 0 && (frames == 0 || f < frames); ++f) {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window, &width, &height);
        if (width > 0 && height > 0) {
            const stipple::Camera camera = scene->overview(static_cast<double>(width) / height);
            const auto info =
                renderer->renderFrame(camera, static_cast<uint32_t>(width), static_cast<uint32_t>(height), image);
            if (!info) return failed(info.error());
            glViewport(0, 0, width, height);
            show(image);
            if (argc > 3 && f + 1 == frames)
                if (const auto written = stipple::writeImage(argv[3], shown(width, height)); !written)
                    status = failed(written.error());
        }
        glfwSwapBuffers(window);
        glfwPollEvents();
    }
    glfwTerminate();
    return status;
}
