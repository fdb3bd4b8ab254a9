#include "engine/render/reconstructions/table.h"

#include <array>
#include <limits>

namespace stipple::render {
namespace {

constexpr float kAsSet = std::numeric_limits<float>::infinity();

constexpr std::array<Reconstruction, 6> kReconstructions{{
    {.mode = Mode::surface,
     .name = "surface",
     .summary = "every disc exactly, the nearest wins; colours and normals of wide ones by pull and push",
     .hasPyramid = false,
     .closesGaps = true,
     .fillsSplats = true,
     .blendsSplats = false,
     .smoothsSplats = true,
     .points = Pass::splat,
     .pointsAreLast = true,
     .exactCurves = 0.5f},
    {.mode = Mode::pullpush,
     .name = "pullpush",
     .summary = "gaps between points are closed by pull and push: fast, but not all pixels lie within the error",
     .hasPyramid = true,
     .closesGaps = true,
     .fillsSplats = false,
     .blendsSplats = false,
     .smoothsSplats = false,
     .points = Pass::project,
     .pointsAreLast = false,
     .exactCurves = kAsSet},
    {.mode = Mode::splat,
     .name = "splat",
     .summary = "every disc exactly, the nearest wins",
     .hasPyramid = false,
     .closesGaps = true,
     .fillsSplats = true,
     .blendsSplats = false,
     .smoothsSplats = false,
     .points = Pass::splat,
     .pointsAreLast = true,
     .exactCurves = 0.5f},
    {.mode = Mode::ewa,
     .name = "ewa",
     .summary = "discs blended by Gaussian kernels, with a low-pass; those on borders of triangles, with these",
     .hasPyramid = false,
     .closesGaps = true,
     .fillsSplats = true,
     .blendsSplats = true,
     .smoothsSplats = false,
     .points = Pass::ewa,
     .pointsAreLast = true,
     .exactCurves = 0.5f},
    {.mode = Mode::points,
     .name = "points",
     .summary = "a pixel a record: surfaces stay open",
     .hasPyramid = false,
     .closesGaps = false,
     .fillsSplats = false,
     .blendsSplats = false,
     .smoothsSplats = false,
     .points = Pass::project,
     .pointsAreLast = false,
     .exactCurves = kAsSet},
    {.mode = Mode::pullpushExact,
     .name = "pullpush-exact",
     .summary = "discs kept by a pyramid's texels, drawn exactly: slower, the same as splat",
     .hasPyramid = false,
     .closesGaps = true,
     .fillsSplats = true,
     .blendsSplats = false,
     .smoothsSplats = false,
     .points = Pass::exact,
     .pointsAreLast = true,
     .exactCurves = 0.5f},
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
