// The C interface of the module that links OpenImageIO.
#pragma once

extern "C" {
/// Writes width x height pixels of `channels` floats or bytes (isFloat). 0, or -1 with a text in `error`.
int stippleOiioWrite(const char* path, int width, int height, int channels, int isFloat, const void* pixels,
                     const char* const* names, char* error, int errorBytes);
/// Reads as RGBA bytes. First call with pixels == nullptr for the size. 0, or -1 with a text in `error`.
int stippleOiioRead(const char* path, int* width, int* height, unsigned char* pixels, char* error, int errorBytes);
}
