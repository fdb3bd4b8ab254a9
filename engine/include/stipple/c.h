/* The same for C: open, draw, write. Calls return 0, or the number of an ErrorKind with a line in stipple_last_error(),
   which is the calling thread's own. NULL is refused, not followed; what is closed last lets go of the rest. */
#ifndef STIPPLE_C_H
#define STIPPLE_C_H

#include <stdint.h>
#if defined(__GNUC__)
#define STIPPLE_C_API __attribute__((visibility("default")))
#else
#define STIPPLE_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct stipple_device stipple_device;
typedef struct stipple_scene stipple_scene;
typedef struct stipple_renderer stipple_renderer;

typedef struct stipple_camera {
    double eye[3], target[3], up[3];
    double fov_degrees; /* vertical */
    double ortho_width; /* above 0: orthographic */
} stipple_camera;

STIPPLE_C_API const char* stipple_last_error(void);

STIPPLE_C_API int stipple_build(const char* const* inputs, unsigned count, const char* store);
/* Of one input in memory; name: "scan.ply", whose ending says the format where the bytes do not. What a scene names
   beside itself is missing. */
STIPPLE_C_API int stipple_build_bytes(const char* name, const void* bytes, uint64_t count, const char* store);

STIPPLE_C_API int stipple_device_open(const char* name, stipple_device** device);
STIPPLE_C_API void stipple_device_close(stipple_device* device);

STIPPLE_C_API int stipple_scene_open(const char* const* inputs, unsigned count, stipple_scene** scene);
STIPPLE_C_API int stipple_scene_overview(const stipple_scene* scene, double aspect, stipple_camera* camera);
STIPPLE_C_API void stipple_scene_close(stipple_scene* scene);

STIPPLE_C_API int stipple_renderer_create(const stipple_device* device, const stipple_scene* scene,
                                          stipple_renderer** renderer);
/* resident_bytes: of what it keeps on the device (the other has 1 GiB). Where that does not suffice for a view,
   stipple_render gives the error of a budget. */
STIPPLE_C_API int stipple_renderer_create_sized(const stipple_device* device, const stipple_scene* scene,
                                                uint64_t resident_bytes, stipple_renderer** renderer);
/* rgba: 4 * width * height bytes, rows from the top. error_pixels: tolerated; what the picture keeps comes back in
   kept_pixels, unless that is NULL. */
STIPPLE_C_API int stipple_render(stipple_renderer* renderer, const stipple_camera* camera, uint32_t width,
                                 uint32_t height, double error_pixels, uint8_t* rgba, double* kept_pixels);
STIPPLE_C_API void stipple_renderer_destroy(stipple_renderer* renderer);

/* .png */
STIPPLE_C_API int stipple_write_image(const char* path, uint32_t width, uint32_t height, const uint8_t* rgba);

#ifdef __cplusplus
}
#endif
#endif
