// A scan to a picture: picture SCAN PICTURE.png
#include <stipple/stipple.h>

#include <cstdio>

int main(int argc, char** argv) {
    if (argc != 3) return std::fprintf(stderr, "usage: picture SCAN PICTURE.png\n"), 2;
    const auto failed = [](const stipple::Error& error) {
        std::fprintf(stderr, "%s\n", error.line().c_str());
        return static_cast<int>(error.kind);
    };
    auto device = stipple::Device::open("cpu");
    if (!device) return failed(device.error());
    auto scene = stipple::Scene::open({argv[1]});
    if (!scene) return failed(scene.error());
    auto renderer = stipple::Renderer::create(*device, *scene);
    if (!renderer) return failed(renderer.error());
    const auto image = renderer->render(scene->overview(1280.0 / 720), 1280, 720);
    if (!image) return failed(image.error());
    if (const auto written = stipple::writeImage(argv[2], *image); !written) return failed(written.error());
    std::printf("%s: within %.2f pixels\n", argv[2], renderer->info().errorPixels);
    return 0;
}
