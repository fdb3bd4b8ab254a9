// The C subset, on top of the C++ headers.
#define STIPPLE_WITHIN
#include <stipple/c.h>
#include <stipple/stipple.h>

#include <algorithm>
#include <cstring>
#include <new>

using namespace stipple;

struct stipple_device {
    v1::Device it;
};
struct stipple_scene {
    v1::Scene it;
};
struct stipple_renderer {
    v1::Renderer it;
};

namespace {

thread_local std::string lastError;

int failed(const v1::Error& error) {
    lastError = error.line();
    return static_cast<int>(error.kind);
}
int refused(const char* what) { return failed({v1::ErrorKind::usage, what, "argument", ""}); }

/// No exception crosses into C.
template <typename Work>
int guarded(const Work& work) {
    try {
        return work();
    } catch (const std::bad_alloc&) {
        return failed({v1::ErrorKind::budget, "there is not enough memory", "stipple", ""});
    } catch (const std::exception& e) {
        return failed({v1::ErrorKind::input, e.what(), "stipple", ""});
    }
}

bool take(const char* const* inputs, unsigned count, std::vector<std::string>& to) {
    if (inputs == nullptr || count == 0) return false;
    for (unsigned i = 0; i < count; ++i) {
        if (inputs[i] == nullptr) return false;
        to.emplace_back(inputs[i]);
    }
    return true;
}

v1::Vec3 vectorOf(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

}  // namespace

const char* stipple_last_error(void) { return lastError.c_str(); }

int stipple_build(const char* const* inputs, unsigned count, const char* store) {
    return guarded([&] {
        std::vector<std::string> names;
        if (!take(inputs, count, names) || store == nullptr) return refused("inputs and store must be given");
        const auto built = v1::build(names, store);
        return built ? 0 : failed(built.error());
    });
}

int stipple_build_bytes(const char* name, const void* bytes, uint64_t count, const char* store) {
    return guarded([&] {
        if (name == nullptr || bytes == nullptr || store == nullptr)
            return refused("name, bytes and store must be given");
        const auto built = v1::buildBytes({{name, bytes, count}}, store);
        return built ? 0 : failed(built.error());
    });
}

int stipple_device_open(const char* name, stipple_device** device) {
    return guarded([&] {
        if (device == nullptr) return refused("there is nowhere to put the device");
        *device = nullptr;
        auto opened = v1::Device::open(name == nullptr ? "auto" : name);
        if (!opened) return failed(opened.error());
        *device = new stipple_device{std::move(*opened)};
        return 0;
    });
}
void stipple_device_close(stipple_device* device) { delete device; }

int stipple_scene_open(const char* const* inputs, unsigned count, stipple_scene** scene) {
    return guarded([&] {
        std::vector<std::string> names;
        if (scene == nullptr || !take(inputs, count, names)) return refused("inputs and scene must be given");
        *scene = nullptr;
        auto opened = v1::Scene::open(names);
        if (!opened) return failed(opened.error());
        *scene = new stipple_scene{std::move(*opened)};
        return 0;
    });
}
int stipple_scene_overview(const stipple_scene* scene, double aspect, stipple_camera* camera) {
    return guarded([&] {
        if (scene == nullptr || camera == nullptr) return refused("scene and camera must be given");
        const v1::Camera c = scene->it.overview(aspect);
        std::copy(c.eye.begin(), c.eye.end(), camera->eye);
        std::copy(c.target.begin(), c.target.end(), camera->target);
        std::copy(c.up.begin(), c.up.end(), camera->up);
        camera->fov_degrees = c.fovDegrees;
        camera->ortho_width = c.orthoWidth;
        return 0;
    });
}
void stipple_scene_close(stipple_scene* scene) { delete scene; }

int stipple_renderer_create(const stipple_device* device, const stipple_scene* scene, stipple_renderer** renderer) {
    return stipple_renderer_create_sized(device, scene, uint64_t{1} << 30, renderer);
}
int stipple_renderer_create_sized(const stipple_device* device, const stipple_scene* scene, uint64_t resident_bytes,
                                  stipple_renderer** renderer) {
    return guarded([&] {
        if (device == nullptr || scene == nullptr || renderer == nullptr)
            return refused("device, scene and renderer must be given");
        *renderer = nullptr;
        auto made = v1::Renderer::create(device->it, scene->it, resident_bytes);
        if (!made) return failed(made.error());
        *renderer = new stipple_renderer{std::move(*made)};
        return 0;
    });
}

int stipple_render(stipple_renderer* renderer, const stipple_camera* camera, uint32_t width, uint32_t height,
                   double error_pixels, uint8_t* rgba, double* kept_pixels) {
    return guarded([&] {
        if (renderer == nullptr || camera == nullptr || rgba == nullptr)
            return refused("renderer, camera and rgba must be given");
        v1::RenderSettings settings;
        settings.errorPixels = error_pixels;
        const v1::Camera c{vectorOf(camera->eye), vectorOf(camera->target), vectorOf(camera->up), camera->fov_degrees,
                           camera->ortho_width};
        const auto image = renderer->it.render(c, width, height, settings);
        if (!image) return failed(image.error());
        std::memcpy(rgba, image->rgba.data(), image->rgba.size());
        if (kept_pixels != nullptr) *kept_pixels = renderer->it.info().errorPixels;
        return 0;
    });
}
void stipple_renderer_destroy(stipple_renderer* renderer) { delete renderer; }

int stipple_write_image(const char* path, uint32_t width, uint32_t height, const uint8_t* rgba) {
    return guarded([&] {
        if (path == nullptr || rgba == nullptr) return refused("path and rgba must be given");
        v1::Image image;
        image.width = width;
        image.height = height;
        image.rgba.assign(rgba, rgba + size_t{4} * width * height);
        const auto written = v1::writeImage(path, image);
        return written ? 0 : failed(written.error());
    });
}
