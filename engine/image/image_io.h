// Pictures in and out, through OpenImageIO, which is loaded at the first use: its 260 libraries cost 0.4 s.
#pragma once

#include <string>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/result.h"
#include "engine/image/transfer.h"
#include "engine/render/backend.h"

namespace stipple::image {

/// By extension: .png (8 bit) or .exr (linear colour, depth, normal), both with the image's alpha as it is (see
/// coverage.h). Whole or not at all.
/// `transfer`: of PNG, whose colours are encoded so here, from sRGB, and said to be.
Result<void> writeImage(const std::string& path, const render::Image& image, Transfer transfer = Transfer::srgb);
/// The bytes that writeImage would write to `path`.
Result<std::vector<char>> encodeImage(const std::string& path, const render::Image& image,
                                      Transfer transfer = Transfer::srgb);
/// Memory that reading a picture may take, where nobody says. The size that a picture claims is checked against it, and
/// against the bytes that are there, before anything is allocated.
constexpr uint64_t kPictureMemory = uint64_t{4} << 30;
/// 8-bit RGBA; files without alpha are opaque.
Result<render::Image> readImage(const std::string& path, uint64_t memoryBytes = kPictureMemory);
/// The same of bytes from anywhere, which are read as a whole; what their name ends in says the format where they do
/// not. A format that is read from files only is refused by its name.
Result<render::Image> readImage(const ByteSource& file, uint64_t memoryBytes = kPictureMemory);
/// Decodes an image that stands in memory (PNG, JPEG, ...); `name` is for messages.
Result<render::Image> decodeImage(const std::vector<uint8_t>& bytes, const std::string& name,
                                  uint64_t memoryBytes = kPictureMemory);
/// Linear floats, e.g. of .hdr and .exr.
Result<render::HdrImage> readHdr(const std::string& path, uint64_t memoryBytes = kPictureMemory);
Result<render::HdrImage> readHdr(const ByteSource& file, uint64_t memoryBytes = kPictureMemory);
/// Is there what reads and writes pictures? Where `load` is given, by loading it.
Result<void> checkModule(bool load);
/// Can this extension be written? An error that names those that can, if not.
Result<void> checkImagePath(const std::string& path);

}  // namespace stipple::image
