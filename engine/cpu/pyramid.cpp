#include "engine/cpu/pyramid.h"

#include <bit>

#include "engine/base/numbers.h"

namespace stipple::cpu {

void Pyramid::resize(uint32_t width, uint32_t height, bool hasMaterials) {
    const bool isSame = hasMaterials == hasMaterials_;
    if (isSame && !levels_.empty() && levels_[0].width == width && levels_[0].height == height) return;
    hasMaterials_ = hasMaterials;
    levels_.clear();
    for (uint32_t w = width, h = height;; w = (w + 1) / 2, h = (h + 1) / 2) {
        levels_.emplace_back();
        levels_.back().resize(w, h, hasMaterials, levels_.size() == 1);
        if (w == 1 && h == 1) break;
    }
}

void Pyramid::setLargestRadius(float radius) {
    levelCount_ = std::min(levels_.size(), toWhole<size_t>(1 + std::ceil(std::log2(std::max(2.0f, 2 * radius)))));
}

void Pyramid::pullPair(const TexelRow& upper, const TexelRow& lower, bool any, uint32_t n, float childSize, Level& to,
                       uint32_t x, uint32_t y, TexelRow& out) {
    if (!any) {
        to.empty(y, x, n);
        return;
    }
    out.hasTubes = upper.hasTubes || lower.hasTubes;
    k_.pullRow(upper, lower, n, childSize, frame_.focal, out);
    to.hold(y, x, n, k_.packRow(out, n, to.planes(y, x)));
}

void Pyramid::pull() {
    for (size_t l = 1; l + 1 < levelCount_; ++l) {
        Level &fine = levels_[l], &coarse = levels_[l + 1];
        forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            if (!fine.mayHoldTile(x0, n, row0, row1) && !coarse.mayHoldParents(x0, n, row0, row1, false)) return;
            thread_local TexelRow upper{}, lower{}, out{};  // what is empty is multiplied by 0, so it must be finite
            upper.hasTubes = lower.hasTubes = out.hasTubes = hasCurves_;
            upper.hasMaterials = lower.hasMaterials = out.hasMaterials = hasMaterials_;
            for (uint32_t y = row0; y < row1; y += 2) {
                bool any = false;
                for (TexelRow* row : {&upper, &lower}) {
                    const uint32_t yy = y + (row == &lower ? 1 : 0);
                    any = (yy < row1 && loadRow(fine, yy, x0, n, *row)) || any;
                    if (yy >= row1) std::fill_n(row->depth + kPad, n, 0.0f);
                    row->depth[kPad + n] = 0;
                }
                pullPair(upper, lower, any, (n + 1) / 2, std::exp2(static_cast<float>(l)), coarse, x0 / 2, y / 2, out);
            }
        });
    }
}

bool Pyramid::loadRow(Level& level, uint32_t y, uint32_t x, uint32_t n, TexelRow& row, bool hasNormals) const {
    const bool isLast = y + 1 == level.height || (y + 1) % kTileRows == 0;  // of the tile: others may be at the next
    if (!isLast) askFor(level, y + 1, x, n, hasNormals);
    const uint32_t held = level.held(y, x, n);
    const RowBits closedUp = level.closedUp(y, x);
    if (!closedUp.isAny()) return loadTexels(level.planes(y, x), held, kPad, n, hasNormals, row);
    alignas(64) static thread_local std::array<std::array<uint32_t, kTile>, 6> words{};
    const auto plane = [&](size_t k) { return words.at(k).data(); };
    const Planes open{reinterpret_cast<float*>(plane(0)), plane(1), plane(2), plane(3), plane(4),
                      hasMaterials_ ? plane(5) : nullptr};
    k_.openUpPacked(level.planesClosedUp(y, x, closedUp.count()), closedUp, hasNormals || hasMaterials_, open);
    return loadTexels(open, held, kPad, n, hasNormals, row);
}

void Pyramid::askFor(Level& level, uint32_t y, uint32_t x, uint32_t n, bool hasNormals) {
    const uint32_t closedUp = level.closedUp(y, x).count();
    const uint32_t groups = closedUp == 0 ? level.held(y, x, n) : (1u << wholeGroups(closedUp) / kTexelGroup) - 1;
    const Planes row = closedUp == 0 ? level.planes(y, x) : level.planesClosedUp(y, x, closedUp);
    for (uint32_t rest = groups; rest != 0; rest &= rest - 1) {
        const Planes from = row.at(static_cast<size_t>(std::countr_zero(rest)) * kTexelGroup);
        __builtin_prefetch(from.depth);
        for (const uint32_t* plane :
             {from.size, from.offset, hasNormals ? from.normal : nullptr, from.colour, from.surface})
            if (plane != nullptr) __builtin_prefetch(plane);
    }
}

bool Pyramid::loadTexels(const Planes& at, uint32_t held, uint32_t to, uint32_t n, bool hasNormals,
                         TexelRow& row) const {
    uint32_t signs = 0;
    for (uint32_t g = 0; hasCurves_ && held >> g != 0; ++g)
        for (uint32_t i = g * kTexelGroup; (held >> g & 1u) != 0 && i < std::min(n, (g + 1) * kTexelGroup); ++i)
            signs |= at.depth[i] > 0 ? at.size[i] : 0u;
    row.hasTubes = (signs & 0x80008000u) != 0;
    k_.unpackRow(at, to, n, held, hasNormals, row);
    if (hasCurves_ && !row.hasTubes) {  // others beside it may have some
        std::fill_n(row.isRound + to, n, 0.0f);
        std::fill_n(row.axisX + to, n, 0.0f);
    }
    return held != 0;
}

bool Pyramid::loadCoarse(Level& level, float size, int y, uint32_t x0, uint32_t n, CoarseRow& out) const {
    TexelRow& row = out.texels;
    row.hasTubes = hasCurves_;
    row.hasMaterials = hasMaterials_;
    const uint32_t c0 = x0 / 2, count = (n + 1) / 2;
    if (y < 0 || y >= static_cast<int>(level.height)) return false;
    const auto line = static_cast<uint32_t>(y);
    bool any = loadRow(level, line, c0, count, row), hasTubes = row.hasTubes;
    const auto loadBeside = [&](bool isInside, uint32_t x, uint32_t to) {
        row.depth[to] = isInside ? 0 : kOutside;
        if (!isInside || !level.mayHold(line, x, 1) || !(*level.planes(line, x).depth > 0)) return;
        any = loadTexels(level.planes(line, x), 1, to, 1, true, row);
        hasTubes = hasTubes || row.hasTubes;
    };
    loadBeside(c0 > 0, c0 - 1, kPad - 1);
    loadBeside(c0 + count < level.width, c0 + count, kPad + count);
    if (!any) return false;
    row.hasTubes = hasTubes;
    if (hasCurves_ && !hasTubes) clearTubes(row);
    k_.coarseDiscs(out, n, (static_cast<float>(c0) + 0.5f) * size - frame_.centre.x,
                   (static_cast<float>(y) + 0.5f) * size - frame_.centre.y, size, frame_.focal);
    return true;
}

void Pyramid::push() {
    for (size_t l = levelCount_; l-- > 1;) {
        if (l + 1 >= levelCount_) continue;
        Level &fine = levels_[l], &coarse = levels_[l + 1];
        forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            if (!fine.mayHoldTile(x0, n, row0, row1) && !coarse.mayHoldParents(x0, n, row0, row1, true)) return;
            pushTile(
                fine, coarse, std::exp2(static_cast<float>(l)), x0, n, row0, row1, false, [](uint32_t) { return ~0u; },
                [&](uint32_t y, const TexelRow&, const TexelRow& row, bool any) {
                    if (!any) return;
                    fine.hold(y, x0, n, k_.packRow(row, n, fine.planes(y, x0)));
                });
        });
    }
}

}  // namespace stipple::cpu
