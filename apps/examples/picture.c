/* The same in C: picture_c SCAN PICTURE.png */
#include <stdio.h>
#include <stdlib.h>
#include <stipple/c.h>

int main(int argc, char** argv) {
    enum { WIDTH = 640, HEIGHT = 360 };
    stipple_device* device = NULL;
    stipple_scene* scene = NULL;
    stipple_renderer* renderer = NULL;
    stipple_camera camera;
    double kept = 0;
    unsigned char* rgba = NULL;
    int status;
    if (argc != 3) return fprintf(stderr, "usage: picture_c SCAN PICTURE.png\n"), 2;
    const char* inputs[] = {argv[1]};
    status = stipple_device_open("cpu", &device);
    if (status == 0) status = stipple_scene_open(inputs, 1, &scene);
    if (status == 0) status = stipple_scene_overview(scene, (double)WIDTH / HEIGHT, &camera);
    if (status == 0) status = stipple_renderer_create(device, scene, &renderer);
    /* What was made of them lives on. */
    stipple_device_close(device);
    stipple_scene_close(scene);
    if (status == 0) rgba = malloc((size_t)4 * WIDTH * HEIGHT);
    if (status == 0) status = stipple_render(renderer, &camera, WIDTH, HEIGHT, 1.0, rgba, &kept);
    if (status == 0) status = stipple_write_image(argv[2], WIDTH, HEIGHT, rgba);
    if (status == 0)
        printf("%s: within %.2f pixels\n", argv[2], kept);
    else
        fprintf(stderr, "%s\n", stipple_last_error());
    stipple_renderer_destroy(renderer);
    free(rgba);
    return status;
}
