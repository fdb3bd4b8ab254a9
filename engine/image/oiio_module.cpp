#include "engine/image/oiio_module.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstdio>
#include <memory>
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
        const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
        if (!out) return report(OIIO::geterror(), error, errorBytes);
        OIIO::Filesystem::IOVecOutput file;
        if (!out->set_ioproxy(&file)) return report("this format cannot be encoded in memory", error, errorBytes);
        if (!out->open(path, spec) || !out->write_image(type, pixels) || !out->close())
            return report(out->geterror(), error, errorBytes);
        sink(user, file.buffer().data(), file.buffer().size());
        return 0;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}

namespace {

/// The rest of both ways to read: size, then RGBA bytes.
int readRgba(OIIO::ImageInput* in, int* width, int* height, unsigned char* pixels, char* error, int errorBytes) {
    if (!in) return report(OIIO::geterror(), error, errorBytes);
    const OIIO::ImageSpec& spec = in->spec();
    *width = spec.width;
    *height = spec.height;
    if (pixels == nullptr) return 0;
    const int channels = spec.nchannels;
    const size_t count = static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height);
    std::vector<unsigned char> raw(count * static_cast<size_t>(channels));
    if (!in->read_image(0, 0, 0, channels, OIIO::TypeDesc::UINT8, raw.data()))
        return report(in->geterror(), error, errorBytes);
    for (size_t i = 0; i < count; ++i)
        for (int c = 0; c < 4; ++c) {
            const int from = channels >= 3 ? c : c < 3 ? 0 : channels == 2 ? 1 : 4;
            pixels[i * 4 + static_cast<size_t>(c)] =
                from < channels ? raw[i * static_cast<size_t>(channels) + static_cast<size_t>(from)] : 255;
        }
    return 0;
}

}  // namespace

extern "C" int stippleOiioRead(const char* path, int* width, int* height, unsigned char* pixels, char* error,
                               int errorBytes) {
    try {
        OIIO::ImageSpec config;
        config.attribute("oiio:UnassociatedAlpha", 1);
        const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::open(path, &config);
        return readRgba(in.get(), width, height, pixels, error, errorBytes);
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
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}

extern "C" int stippleOiioReadFloat(const char* path, int* width, int* height, float* pixels, char* error,
                                    int errorBytes) {
    try {
        const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::open(path);
        if (!in) return report(OIIO::geterror(), error, errorBytes);
        const OIIO::ImageSpec& spec = in->spec();
        *width = spec.width;
        *height = spec.height;
        if (!pixels) return 0;
        std::vector<float> all(static_cast<size_t>(spec.width) * spec.height * spec.nchannels);
        if (!in->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, all.data()))
            return report(in->geterror(), error, errorBytes);
        const size_t channels = static_cast<size_t>(spec.nchannels);
        for (size_t i = 0; i < static_cast<size_t>(spec.width) * spec.height; ++i)
            for (size_t c = 0; c < 3; ++c) pixels[3 * i + c] = all[i * channels + (channels >= 3 ? c : 0)];
        return 0;
    } catch (const std::exception& e) {
        return report(e.what(), error, errorBytes);
    }
}
