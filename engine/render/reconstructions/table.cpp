#include "engine/render/reconstructions/table.h"

#include <array>
#include <limits>

namespace stipple::render {
namespace {

constexpr float kAsSet = std::numeric_limits<float>::infinity();

constexpr std::array<Reconstruction, 3> kReconstructions{{
    {Mode::pullpush, "pullpush", "gaps between points are closed by pull and push", true, true, false, kAsSet},
    {Mode::splat, "splat", "every disc exactly, the nearest wins", false, true, true, 0.5f},
    {Mode::points, "points", "a pixel a record: surfaces stay open", false, false, false, kAsSet},
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

std::vector<Pass> passesOf(Mode mode, const FrameContent& content) {
    const Reconstruction& r = reconstructionOf(mode);
    std::vector<Pass> passes{Pass::clear};
    if (content.hasPoints && !r.fillsSplats) passes.push_back(Pass::project);
    if (content.hasPoints && content.hasWideDiscs && r.hasPyramid) passes.push_back(Pass::discs);
    if (content.hasStrands) passes.push_back(Pass::strands);
    if (content.hasTriangles) passes.push_back(Pass::rasterise);
    if (content.hasPoints && r.fillsSplats) passes.push_back(Pass::splat);
    passes.push_back(Pass::resolve);
    // Triangles keep their exact pixels: only splats are reconstructed.
    if (r.hasPyramid && (content.hasPoints || content.hasStrands)) {
        passes.push_back(Pass::pull);
        passes.push_back(Pass::push);
    }
    passes.push_back(Pass::surface);
    if (content.isLit) passes.push_back(Pass::light);
    passes.push_back(Pass::output);
    return passes;
}

}  // namespace stipple::render
