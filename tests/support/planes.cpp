#include "tests/support/planes.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "engine/base/hash.h"

namespace stipple::test {

std::vector<float> Planes::plane(const std::string& name) const {
    const auto at = std::find(names.begin(), names.end(), name);
    std::vector<float> out;
    if (at == names.end()) return out;
    for (auto i = static_cast<size_t>(at - names.begin()); i < values.size(); i += names.size())
        out.push_back(values[i]);
    return out;
}

Planes readPlanes(const std::string& path) {
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    const auto in = OIIO::ImageInput::open(path, &config);
    if (!in) throw std::runtime_error(path + ": " + OIIO::geterror());
    const OIIO::ImageSpec& spec = in->spec();
    Planes out;
    out.width = static_cast<uint32_t>(spec.width);
    out.height = static_cast<uint32_t>(spec.height);
    out.isFloat = spec.format.is_floating_point();
    out.names = spec.channelnames;
    const size_t count = size_t{out.width} * out.height * out.names.size();
    if (out.isFloat) {
        out.values.resize(count);
        if (!in->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, out.values.data()))
            throw std::runtime_error(path + ": " + in->geterror());
        return out;
    }
    std::vector<uint8_t> bytes(count);
    if (!in->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, bytes.data()))
        throw std::runtime_error(path + ": " + in->geterror());
    out.values.assign(bytes.begin(), bytes.end());
    return out;
}

namespace {
void write(const std::string& path, uint32_t width, uint32_t height, int channels, OIIO::TypeDesc type,
           const void* values) {
    const auto out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), channels, type);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    if (!out || !out->open(path, spec) || !out->write_image(type, values) || !out->close())
        throw std::runtime_error(path + ": " + (out ? out->geterror() : OIIO::geterror()));
}
}  // namespace

void writeBytes(const std::string& path, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba) {
    write(path, width, height, 4, OIIO::TypeDesc::UINT8, rgba.data());
}

void writeFloats(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& rgb) {
    write(path, width, height, 3, OIIO::TypeDesc::FLOAT, rgb.data());
}

uint64_t hashPlanes(const Planes& planes) {
    uint64_t hash = (uint64_t{planes.width} << 32) + planes.height + (planes.isFloat ? 1u << 31 : 0u);
    for (const std::string& name : planes.names) hash = hashBytes(name.data(), name.size(), hash);
    return hashBytes(planes.values.data(), planes.values.size() * sizeof(float), hash);
}

PlanesDiffer comparePlanes(const Planes& a, const Planes& b) {
    PlanesDiffer out;
    if (a.width != b.width || a.height != b.height || a.names != b.names || a.isFloat != b.isFloat) {
        out.areAlike = false;
        return out;
    }
    const size_t channels = a.names.size(), colours = std::min<size_t>(channels, 3);
    double squares = 0, white = a.isFloat ? 1e-30 : 255;
    for (size_t i = 0; i < a.values.size(); i += channels) {
        out.pixels += std::memcmp(&a.values[i], &b.values[i], channels * sizeof(float)) != 0 ? 1 : 0;
        for (size_t c = 0; c < channels; ++c) {
            const double x = double{a.values[i + c]}, y = double{b.values[i + c]}, off = std::abs(x - y);
            if (off > out.largest || std::isnan(off)) {
                out.largest = off;
                out.largestIn = a.names[c];
            }
            if (c >= colours) continue;
            squares += off * off;
            if (a.isFloat) white = std::max({white, x, y});
        }
    }
    const double count = static_cast<double>(a.values.size()) / static_cast<double>(channels);
    out.psnr = 10 * std::log10(white * white * count * static_cast<double>(colours) / squares);
    return out;
}

}  // namespace stipple::test
