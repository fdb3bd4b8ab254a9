#include "engine/image/oiio_module.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <new>
#include <string>
#include <vector>

namespace {
int report(const std::string& text, char* error, int errorBytes) {
    std::snprintf(error, static_cast<size_t>(errorBytes), "%s", text.c_str());
    return -1;
}
}  // namespace

extern "C" int stippleOiioEncode(const char* path, int width, int height, int channels, int isFloat, const void* pixels,
                                 const char* const* names, void (*sink)(void*, const void*, unsigned long), void* user,
                                 char* error, int errorBytes) {
    try {
        const OIIO::TypeDesc type = isFloat ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8;
        OIIO::ImageSpec spec(width, height, channels, type);
        spec.channelnames.assign(names, names + channels);
        spec.alpha_channel = channels > 3 ? 3 : -1;
        spec.attribute("oiio:UnassociatedAlpha", 1);
        spec.attribute("oiio:ColorSpace", isFloat ? "Linear" : "sRGB");
        spec.attribute("png:compressionLevel", 3);
        spec.attribute("compression", "zip");
        spec.attribute("DateTime", "");  // or the same picture would have other bytes every second
        const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
        if (!out) return report(OIIO::geterror(), error, errorBytes);
        OIIO::Filesystem::IOVecOutput file;
        if (!out->set_ioproxy(&file)) return report("this format cannot be encoded in memory", error, errorBytes);
        if (!out->open(path, spec) || !out->write_image(type, pixels) || !out->close())
            return report(out->geterror(), error, errorBytes);
        sink(user, file.buffer().data(), file.buffer().size());
        return 0;
    } catch (const std::bad_alloc&) {
        return kStippleOiioNoMemory;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}

namespace {

/// Calls use(first pixel, values, number of pixels) from top to bottom, with the first `channels` channels; a few rows
/// at a time (of tiled files as many as a tile is high), so that nothing else of the picture's size is held here.
template <typename T, typename Use>
bool forRows(OIIO::ImageInput& in, OIIO::TypeDesc type, int channels, const Use& use) {
    const OIIO::ImageSpec& spec = in.spec();
    const int step = spec.tile_height > 0 ? spec.tile_height : 16;
    const auto width = static_cast<size_t>(spec.width);
    std::vector<T> rows(width * static_cast<size_t>(channels) * static_cast<size_t>(std::min(step, spec.height)));
    for (int y = 0; y < spec.height; y += step) {
        const int first = spec.y + y, last = spec.y + std::min(y + step, spec.height);
        const bool isRead =
            spec.tile_width > 0
                ? in.read_tiles(0, 0, spec.x, spec.x + spec.width, first, last, 0, 1, 0, channels, type, rows.data())
                : in.read_scanlines(0, 0, first, last, 0, 0, channels, type, rows.data());
        if (!isRead) return false;
        use(static_cast<size_t>(y) * width, rows.data(), width * static_cast<size_t>(last - first));
    }
    return true;
}

/// The size of a picture; where there is room for its pixels already, it must be the one that the room was made for:
/// files change.
bool tellSize(const OIIO::ImageSpec& spec, bool hasRoom, int* width, int* height) {
    if (hasRoom) return *width == spec.width && *height == spec.height;
    *width = spec.width;
    *height = spec.height;
    return true;
}
constexpr const char* kChanged = "it changed while it was read";

/// Opens a file, or bytes under a file's name (whose ending is tried first, then every format that knows what they
/// begin with).
class Opened {
  public:
    Opened(const char* path, const void* bytes, unsigned long count, OIIO::ImageSpec config)
        : memory_(const_cast<void*>(bytes), count) {
        OIIO::Filesystem::IOProxy* proxy = bytes != nullptr ? &memory_ : nullptr;
        if (proxy != nullptr) config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);  // of some it is asked so
        in_ = OIIO::ImageInput::open(path, &config, proxy);
        if (in_) return;
        problem_ = OIIO::geterror();
        if (bytes == nullptr) return;
        const std::string format = OIIO::Filesystem::extension(path, false);
        if (const auto reader = OIIO::ImageInput::create(format); reader && reader->supports("ioproxy") == 0)
            problem_ = std::string(reader->format_name()) + " " + kStippleOiioFilesOnly;
        OIIO::geterror();  // where there is no such format
    }
    OIIO::ImageInput* get() const { return in_.get(); }
    const std::string& problem() const { return problem_; }

  private:
    OIIO::Filesystem::IOMemReader memory_;
    std::unique_ptr<OIIO::ImageInput> in_;
    std::string problem_;
};

/// The rest of both ways to read: size, then RGBA bytes.
int readRgba(OIIO::ImageInput* in, int* width, int* height, unsigned char* pixels, char* error, int errorBytes) {
    const OIIO::ImageSpec& spec = in->spec();
    if (!tellSize(spec, pixels != nullptr, width, height)) return report(kChanged, error, errorBytes);
    if (pixels == nullptr) return 0;
    const int channels = std::min(spec.nchannels, 4);
    const bool isRead = forRows<unsigned char>(
        *in, OIIO::TypeDesc::UINT8, channels, [&](size_t first, const unsigned char* raw, size_t count) {
            for (size_t i = 0; i < count; ++i)
                for (int c = 0; c < 4; ++c) {
                    const int from = channels >= 3 ? c : c < 3 ? 0 : channels == 2 ? 1 : 4;
                    pixels[(first + i) * 4 + static_cast<size_t>(c)] =
                        from < channels ? raw[i * static_cast<size_t>(channels) + static_cast<size_t>(from)] : 255;
                }
        });
    return isRead ? 0 : report(in->geterror(), error, errorBytes);
}

}  // namespace

extern "C" int stippleOiioRead(const char* path, const void* bytes, unsigned long byteCount, int* width, int* height,
                               unsigned char* pixels, char* error, int errorBytes) {
    try {
        OIIO::ImageSpec config;
        config.attribute("oiio:UnassociatedAlpha", 1);
        const Opened in(path, bytes, byteCount, config);
        if (!in.get()) return report(in.problem(), error, errorBytes);
        return readRgba(in.get(), width, height, pixels, error, errorBytes);
    } catch (const std::bad_alloc&) {
        return kStippleOiioNoMemory;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}

extern "C" int stippleOiioDecode(const char* format, const void* bytes, unsigned long count, int* width, int* height,
                                 unsigned char* pixels, char* error, int errorBytes) {
    try {
        OIIO::ImageSpec config;
        config.attribute("oiio:UnassociatedAlpha", 1);
        OIIO::Filesystem::IOMemReader memory(const_cast<void*>(bytes), count);
        const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::create(format);
        if (!in) return report(OIIO::geterror(), error, errorBytes);
        OIIO::ImageSpec spec;
        if (!in->set_ioproxy(&memory)) return report("this format cannot be decoded in memory", error, errorBytes);
        if (!in->open(format, spec, config)) return report(in->geterror(), error, errorBytes);
        return readRgba(in.get(), width, height, pixels, error, errorBytes);
    } catch (const std::bad_alloc&) {
        return kStippleOiioNoMemory;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}

extern "C" int stippleOiioReadFloat(const char* path, const void* bytes, unsigned long byteCount, int* width,
                                    int* height, float* pixels, char* error, int errorBytes) {
    try {
        const Opened opened(path, bytes, byteCount, {});
        OIIO::ImageInput* const in = opened.get();
        if (!in) return report(opened.problem(), error, errorBytes);
        const OIIO::ImageSpec& spec = in->spec();
        if (!tellSize(spec, pixels != nullptr, width, height)) return report(kChanged, error, errorBytes);
        if (!pixels) return 0;
        const auto channels = static_cast<size_t>(std::min(spec.nchannels, 3));
        const bool isRead = forRows<float>(
            *in, OIIO::TypeDesc::FLOAT, static_cast<int>(channels), [&](size_t first, const float* raw, size_t count) {
                for (size_t i = 0; i < count; ++i)
                    for (size_t c = 0; c < 3; ++c)
                        pixels[3 * (first + i) + c] = raw[i * channels + (channels >= 3 ? c : 0)];
            });
        if (!isRead) return report(in->geterror(), error, errorBytes);
        return 0;
    } catch (const std::bad_alloc&) {
        return kStippleOiioNoMemory;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}
