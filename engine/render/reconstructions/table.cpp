#include "engine/render/reconstructions/table.h"

#include <array>
#include <limits>

namespace stipple::render {
namespace {

constexpr float kAsSet = std::numeric_limits<float>::infinity();

constexpr std::array<Reconstruction, 5> kReconstructions{{
    {Mode::pullpush, "pullpush", "gaps between points are closed by pull and push", true, true, false, false,
     Pass::project, false, kAsSet},
    {Mode::splat, "splat", "every disc exactly, the nearest wins", false, true, true, false, Pass::splat, true, 0.5f},
    {Mode::ewa, "ewa", "discs blended by Gaussian kernels, with a low-pass", false, true, true, true, Pass::ewa, true,
     0.5f},
    {Mode::points, "points", "a pixel a record: surfaces stay open", false, false, false, false, Pass::project, false,
     kAsSet},
    {Mode::pullpushExact, "pullpush-exact",
     "discs kept by a pyramid's texels, drawn exactly: slower, the same as splat", false, true, true, false,
     Pass::exact, true, 0.5f},
}};

}  // namespace

std::span<const Reconstruction> reconstructions() { return kReconstructions; }

const Reconstruction& reconstructionOf(Mode mode) {
    for (const Reconstruction& r : kReconstructions)
        if (r.mode == mode) return r;
    return kReconstructions.front();
}

Mode nextMode(Mode mode) {
    const auto at = static_cast<size_t>(&reconstructionOf(mode) - kReconstructions.data());
    return kReconstructions.at((at + 1) % kReconstructions.size()).mode;
}

const Reconstruction* reconstructionNamed(std::string_view name) {
    for (const Reconstruction& r : kReconstructions)
        if (name == r.name) return &r;
    return nullptr;
}

}  // namespace stipple::render
