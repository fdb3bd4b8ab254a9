#include "engine/cpu/hidden_nodes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "engine/cpu/frame.h"

namespace stipple::cpu {
namespace {

/// Of what kernels add up in fp32: far more than their rounding, in shares of all that is added.
constexpr double kRounding = 0x1p-20;
/// Pixels around what is computed here in fp64.
constexpr double kAroundPixels = 1.5;
/// Discs are no larger than so many times what their codes say, rounding and normals that are not quite unit included.
constexpr double kRadiusMargin = 1.01;
/// Depths where a ray meets a disc go through reciprocals.
constexpr double kDepthMargin = 1 - 0x1p-18;

uint64_t hashOfNode(streaming::ChunkKey key, uint32_t instance) {
    uint64_t h = (uint64_t{key.source} << 32 | key.chunk) * 0x9e3779b97f4a7c15u;
    h = (h ^ h >> 29 ^ instance) * 0xbf58476d1ce4e5b9u;
    h = (h ^ h >> 32) * 0x94d049bb133111ebu;
    return h ^ h >> 31;
}

struct Range {
    double low, high;
    void add(double x) {
        low = std::min(low, x);
        high = std::max(high, x);
    }
};

/// Camera space along one axis: where the box of the records begins, what its edges add, how far rounding may be off.
struct Axis {
    double base;
    std::array<double, 3> edge;
    double off;
    double at(uint32_t corner) const {
        double sum = base;
        for (uint32_t k = 0; k < 3; ++k) sum += (corner >> k & 1) != 0 ? edge[k] : 0;
        return sum;
    }
};
Axis axisOf(double base, const std::array<double, 3>& steps, const render::NodeBounds& b) {
    Axis a{base, {}, std::abs(base)};
    for (size_t k = 0; k < 3; ++k) {
        a.base += steps[k] * b.low[k];
        a.edge[k] = steps[k] * static_cast<double>(b.high[k] - b.low[k]);
        a.off += std::abs(steps[k]) * std::max(b.low[k], b.high[k]);
    }
    a.off *= kRounding;
    return a;
}

/// The pixels of a row or column that hold what lies there, within the picture.
void pixelsOf(const Range& range, uint32_t size, bool besideToo, int& first, int& last) {
    const double most = static_cast<double>(size) - 1;
    const double low = range.low - kAroundPixels, high = range.high + kAroundPixels;
    first = static_cast<int>(std::floor(std::clamp(low, 0.0, besideToo ? most : most + 1)));
    last = static_cast<int>(std::floor(std::clamp(high, besideToo ? 0.0 : -1.0, most)));
}

}  // namespace

NodeReach reachOf(const shared::FrameConstants& f, const shared::DrawNode& node, const render::NodeBounds& bounds,
                  bool areDiscs, bool besideToo) {
    NodeReach reach;
    if (!areDiscs && (node.octantMask & shared::kNodeWide) != 0) return reach;
    const Axis x = axisOf(node.base.x, {node.axisX.x, node.axisY.x, node.axisZ.x}, bounds),
               y = axisOf(node.base.y, {node.axisX.y, node.axisY.y, node.axisZ.y}, bounds),
               z = axisOf(node.base.z, {node.axisX.z, node.axisY.z, node.axisZ.z}, bounds);
    const double radius = areDiscs ? kRadiusMargin * double{bounds.radius} * double{f.supportScale} : 0;
    const bool isOrthographic = f.orthographic != 0;
    Range across{HUGE_VAL, -HUGE_VAL}, down = across;
    double nearest = HUGE_VAL;
    for (uint32_t corner = 0; corner < 8; ++corner) {
        const double cx = x.at(corner), cy = y.at(corner), cz = z.at(corner);
        const double before = cz - radius - z.off, behind = cz + radius + z.off;
        nearest = std::min(nearest, before);
        // Discs that are not wholly before the eye have kernels of their own, which need not be known here.
        if (!(before > double{f.nearPlane} && (isOrthographic || before > radius))) return reach;
        // All of a sphere about the corner, in a box: images of boxes end at those of their corners.
        for (const double depth : {before, behind}) {
            const double scale = double{f.focal} / (isOrthographic ? 1 : depth);
            for (const double side : {-1.0, 1.0}) {
                across.add((cx + side * (radius + x.off)) * scale + double{f.centre.x});
                down.add((cy + side * (radius + y.off)) * scale + double{f.centre.y});
            }
        }
    }
    constexpr double kFarthest = 1e30;  // beyond it fp32 may overflow
    if (!(nearest < kFarthest)) return reach;
    const auto depth = static_cast<float>(nearest * kDepthMargin);
    if (!(depth > f.nearPlane) || !std::isfinite(across.low + across.high + down.low + down.high)) return reach;
    reach.nearest = shared::floatBitsToUint(depth);
    pixelsOf(across, f.width, besideToo, reach.firstX, reach.lastX);
    pixelsOf(down, f.height, besideToo, reach.firstY, reach.lastY);
    reach.isKnown = true;
    return reach;
}

void HiddenNodes::Marks::clear(size_t nodes) {
    constexpr size_t kBitsOfNode = 32;  // so that hardly any is taken for another
    words.assign(std::bit_ceil(std::max<size_t>(nodes * kBitsOfNode / 64, 1)), 0);
}

void HiddenNodes::take(const render::DrawBatch& points, uint8_t state, std::vector<uint32_t>& blocks) const {
    blocks.clear();
    for (uint32_t b = 0; b < points.blocks.size(); ++b)
        if (states_[points.blocks[b].node] == state) blocks.push_back(b);
}

std::span<const uint32_t> HiddenNodes::begin(const Frame& frame, bool mayHide) {
    const render::DrawBatch& points = frame.draws->points();
    counts_ = {};
    states_.assign(points.nodes.size(), kDrawn);
    isTested_ = mayHide && frame.draws->pointBounds.size() == points.nodes.size() &&
                (hasMarks_ || frame.tellsHiddenNodes || --untilTest_ == 0);
    // What is told must not hang on frames before: everything is drawn first then, and all is held against all.
    if (isTested_ && hasMarks_ && !frame.tellsHiddenNodes)
        for (size_t n = 0; n < states_.size(); ++n)
            if (points.records[n] >= kLeastRecords && marks_.has(hashOfNode(points.keys[n], points.instances[n])))
                states_[n] = kHeld;
    take(points, kDrawn, blocks_);
    return blocks_;
}

/// The farthest depth of each tile. Where a tile has an open pixel that is told by the first few of its rows.
void HiddenNodes::measure(Frame& frame) {
    const uint32_t width = frame.constants.width, height = frame.constants.height;
    columns_ = (width + kTilePixels - 1) / kTilePixels;
    const uint32_t rows = (height + kTilePixels - 1) / kTilePixels;
    farthest_.resize(size_t{columns_} * rows);
    frame.executor.parallelFor(rows, 2, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row) {
            const uint32_t y0 = static_cast<uint32_t>(row) * kTilePixels;
            for (uint32_t x0 = 0; x0 < width; x0 += kTile) {
                const uint32_t n = std::min(kTile, width - x0), tiles = (n + kTilePixels - 1) / kTilePixels;
                uint32_t* const farthest = farthest_.data() + row * columns_ + x0 / kTilePixels;
                const size_t first = size_t{y0} * width + x0;
                if (frame.isSeen(first, n))
                    frame.k.farthestOf(frame.visibility.data() + first, width, std::min(kTilePixels, height - y0), n,
                                       farthest);
                else
                    std::fill_n(farthest, tiles, shared::keyDepthBits(shared::kNoKey));
            }
        }
    });
}

bool HiddenNodes::isBehind(const NodeReach& reach) const {
    if (!reach.isKnown) return false;
    for (int y = reach.firstY / int{kTilePixels}; y <= reach.lastY / int{kTilePixels}; ++y)
        for (int x = reach.firstX / int{kTilePixels}; x <= reach.lastX / int{kTilePixels}; ++x)
            if (farthest_[static_cast<size_t>(y) * columns_ + static_cast<size_t>(x)] >= reach.nearest) return false;
    return true;
}

std::span<const uint32_t> HiddenNodes::rest(Frame& frame, bool areDiscs) {
    if (!isTested_) return {};
    measure(frame);
    const render::DrawBatch& points = frame.draws->points();
    behind_.assign(states_.size(), 0);
    frame.executor.parallelFor(states_.size(), 64, [&](size_t begin, size_t end) {
        for (size_t n = begin; n < end; ++n) {
            if (points.records[n] < kLeastRecords) continue;
            render::NodeBounds bounds = frame.draws->pointBounds[n];
            const auto isHidden = [&](bool grow) {
                return isBehind(reachOf(frame.constants, points.nodes[n], bounds, areDiscs || grow, frame.hasPyramid));
            };
            if (!isHidden(false)) continue;
            // What a record stands for is within its error of its disc, and reaches no farther than a disc.
            bounds.radius = 2 * bounds.radius + bounds.error / std::min(frame.constants.supportScale, 1.0f);
            // (The means of wide discs, which make fronts smooth, are also of discs behind.)
            const bool isInMeans = frame.hasSmooth && (points.nodes[n].octantMask & shared::kNodeSmooth) != 0;
            behind_[n] = !isInMeans && isHidden(true) ? kWholeBehind : kBehind;
        }
    });
    uint64_t all = 0, behind = 0;
    marks_.clear(states_.size());
    whole_.clear();
    for (size_t n = 0; n < states_.size(); ++n) {
        const uint32_t count = points.records[n];
        all += count;
        if (behind_[n] == kWholeBehind) whole_.push_back(static_cast<uint32_t>(n));
        if (behind_[n] != kBefore) {
            behind += count;
            marks_.mark(hashOfNode(points.keys[n], points.instances[n]));
            counts_.nodes += states_[n] == kHeld ? 1 : 0;
            counts_.records += states_[n] == kHeld ? count : 0;
        } else if (states_[n] == kHeld) {
            states_[n] = kSeen;
        }
    }
    hasMarks_ = static_cast<double>(behind) > kLeastShare * static_cast<double>(all);
    untilTest_ = kRest;
    take(points, kSeen, late_);
    return late_;
}

}  // namespace stipple::cpu
