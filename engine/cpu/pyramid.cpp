#include "engine/cpu/pyramid.h"

#include "engine/base/numbers.h"

namespace stipple::cpu {

void Pyramid::resize(uint32_t width, uint32_t height, bool hasMaterials) {
    const bool isSame = hasMaterials == hasMaterials_;
    if (isSame && !levels_.empty() && levels_[0].width == width && levels_[0].height == height) return;
    hasMaterials_ = hasMaterials;
    levels_.clear();
    for (uint32_t w = width, h = height;; w = (w + 1) / 2, h = (h + 1) / 2) {
        levels_.emplace_back();
        levels_.back().resize(w, h, hasMaterials);
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
    to.hold(y, x, n);
    out.hasTubes = upper.hasTubes || lower.hasTubes;
    k_.pullRow(upper, lower, n, childSize, frame_.focal, out);
    k_.packRow(out, n, to.planes().at(size_t{y} * to.width + x));
}

void Pyramid::pull() {
    for (size_t l = 1; l + 1 < levelCount_; ++l) {
        Level &fine = levels_[l], &coarse = levels_[l + 1];
        const Planes from = fine.planes();
        forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            if (!fine.mayHoldTile(x0, n, row0, row1) && !coarse.mayHoldParents(x0, n, row0, row1, false)) return;
            TexelRow upper{}, lower{}, out{};  // what is empty is multiplied by 0, so it must be finite
            upper.hasTubes = lower.hasTubes = out.hasTubes = hasCurves_;
            upper.hasMaterials = lower.hasMaterials = out.hasMaterials = hasMaterials_;
            for (uint32_t y = row0; y < row1; y += 2) {
                bool any = false;
                for (TexelRow* row : {&upper, &lower}) {
                    const uint32_t yy = y + (row == &lower ? 1 : 0);
                    any = (yy < row1 && loadRow(fine, from, yy, x0, n, kPad, *row)) || any;
                    if (yy >= row1) std::fill_n(row->depth + kPad, n, 0.0f);
                    row->depth[kPad + n] = 0;
                }
                pullPair(upper, lower, any, (n + 1) / 2, std::exp2(static_cast<float>(l)), coarse, x0 / 2, y / 2, out);
            }
        });
    }
}

bool Pyramid::loadRow(const Level& level, const Planes& planes, uint32_t y, uint32_t x, uint32_t n, uint32_t first,
                      TexelRow& row) const {
    const Planes at = planes.at(size_t{y} * level.width + x);
    const bool mayHold = level.mayHold(y, x, n);
    uint32_t anyThere = 0, signs = 0;
    for (uint32_t i = 0; mayHold && i < n; ++i) anyThere |= at.depth[i] > 0 ? 1u : 0u;
    for (uint32_t i = 0; hasCurves_ && anyThere != 0 && i < n; ++i) signs |= at.depth[i] > 0 ? at.size[i] : 0u;
    const bool any = anyThere != 0;
    row.hasTubes = (signs & 0x80008000u) != 0;
    if (any)
        k_.unpackRow(at, first, n, row);
    else
        std::fill_n(row.depth + first, n, 0.0f);
    if (hasCurves_ && !row.hasTubes) {  // others beside it may have some
        std::fill_n(row.isRound + first, n, 0.0f);
        std::fill_n(row.axisX + first, n, 0.0f);
    }
    return any;
}

bool Pyramid::loadCoarse(const Level& level, const Planes& planes, float size, int y, uint32_t x0, uint32_t n,
                         TexelRow& scratch, ExpandedRow& out) const {
    const uint32_t c0 = x0 / 2, count = (n + 1) / 2;
    if (y < 0 || y >= static_cast<int>(level.height)) return false;
    const uint32_t before = c0 > 0 ? 1 : 0, after = c0 + count < level.width ? 1 : 0;
    scratch.depth[kPad - 1] = kOutside;  // overwritten below where there is a neighbour
    scratch.depth[kPad + count] = kOutside;
    if (!loadRow(level, planes, static_cast<uint32_t>(y), c0 - before, count + before + after, kPad - before, scratch))
        return false;
    k_.expandRow(scratch, n, (static_cast<float>(c0) + 0.5f) * size - frame_.centre.x,
                 (static_cast<float>(y) + 0.5f) * size - frame_.centre.y, size, frame_.focal, out.nearest, out.beside);
    out.nearest.hasTubes = scratch.hasTubes;
    if (hasCurves_ && !scratch.hasTubes)
        for (TexelRow* row : {&out.nearest, &out.beside}) clearTubes(*row);
    return true;
}

void Pyramid::push() {
    for (size_t l = levelCount_; l-- > 1;) {
        if (l + 1 >= levelCount_) continue;
        Level &fine = levels_[l], &coarse = levels_[l + 1];
        const Planes planes = fine.planes();
        forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            if (!fine.mayHoldTile(x0, n, row0, row1) && !coarse.mayHoldParents(x0, n, row0, row1, true)) return;
            pushTile(fine, coarse, std::exp2(static_cast<float>(l)), x0, n, row0, row1,
                     [&](uint32_t y, const TexelRow&, const TexelRow& row, bool any) {
                         if (!any) return;
                         fine.hold(y, x0, n);
                         k_.packRow(row, n, planes.at(size_t{y} * fine.width + x0));
                     });
        });
    }
}

}  // namespace stipple::cpu
