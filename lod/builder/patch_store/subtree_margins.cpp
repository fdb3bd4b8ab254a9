#include "lod/builder/patch_store/subtree_margins.h"

#include <algorithm>

namespace stipple::lod {
namespace {

struct Box {
    glm::dvec3 lo, hi;
};

Box boxOf(const Frame& frame, const Subtree& a) {
    const Key cell = a.key >> frame.shiftOf(a.level);
    const double edge = frame.cellSize(a.level);
    const glm::dvec3 lo = edge * glm::dvec3(compactBits(cell), compactBits(cell >> 1), compactBits(cell >> 2));
    return {lo, lo + edge};
}

}  // namespace

SubtreeMargins::SubtreeMargins(const Frame& frame, const std::vector<Subtree>& subtrees, double margin) {
    std::vector<Box> boxes;
    boxes.reserve(subtrees.size());
    for (const Subtree& a : subtrees) boxes.push_back(boxOf(frame, a));
    for (uint32_t a = 0; a < subtrees.size(); ++a) {
        first_.push_back(static_cast<uint32_t>(near_.size()));
        for (uint32_t b = 0; b < subtrees.size(); ++b) {
            if (a == b) continue;
            const double reach =
                margin * frame.cellSize(subtrees[b].level) * (subtrees[a].level < subtrees[b].level ? 2 : 1);
            const Box wide{boxes[b].lo - reach, boxes[b].hi + reach};
            if (glm::all(glm::lessThanEqual(wide.lo, boxes[a].hi)) &&
                glm::all(glm::lessThanEqual(boxes[a].lo, wide.hi)))
                near_.push_back({wide.lo, wide.hi, b});
        }
    }
    first_.push_back(static_cast<uint32_t>(near_.size()));
}

}  // namespace stipple::lod
