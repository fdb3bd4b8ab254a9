// The C interface of the module that links OpenImageIO.
#pragma once

/// What the text of an error ends in where a format cannot be read from memory.
constexpr const char* kStippleOiioFilesOnly = "is a format that is read from files only";

extern "C" {
/// Encodes width x height pixels of `channels` floats or bytes (isFloat) in the format of `path`'s extension and gives
/// the bytes of the file to `sink`. (OpenImageIO's own file writing does not notice a full disk.) 0, or -1 with a text
/// in `error`.
int stippleOiioEncode(const char* path, int width, int height, int channels, int isFloat, const void* pixels,
                      const char* const* names, void (*sink)(void* user, const void* bytes, unsigned long count),
                      void* user, char* error, int errorBytes);
/// What the reading calls give instead of 0: an error with a text, or that there is not enough memory.
enum { kStippleOiioFailed = -1, kStippleOiioNoMemory = -2 };
/// Decodes an encoded image in memory as RGBA bytes; `format` is "png", "jpeg" or "webp". Calls as stippleOiioRead.
int stippleOiioDecode(const char* format, const void* bytes, unsigned long count, int* width, int* height,
                      unsigned char* pixels, char* error, int errorBytes);
/// Reads as RGB floats, linear as the file has them. As stippleOiioRead.
int stippleOiioReadFloat(const char* path, const void* bytes, unsigned long count, int* width, int* height,
                         float* pixels, char* error, int errorBytes);
/// Reads as RGBA bytes: the file at `path`, or, where `bytes` is not null, what a file of that name would hold. First
/// call with pixels == nullptr for the size. 0, or -1 with a text in `error`.
int stippleOiioRead(const char* path, const void* bytes, unsigned long count, int* width, int* height,
                    unsigned char* pixels, char* error, int errorBytes);
}
