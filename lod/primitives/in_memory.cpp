#include "lod/primitives/in_memory.h"

#include <algorithm>
#include <memory>

namespace stipple::lod {

PointSource pointsInMemory(SourceInfo info, PointBlock points) {
    const auto all = std::make_shared<const PointBlock>(std::move(points));
    PointSource source;
    source.info = std::move(info);
    source.info.points = all->position.size();
    source.info.hasColour = !all->colour.empty();
    source.info.hasNormal = !all->normal.empty();
    source.info.hasRadius = !all->radius.empty();
    source.parts = {source.info.points};
    source.openPart = [all](size_t) -> Result<PointReader> {
        return PointReader([all, next = size_t{0}](PointBlock& block, size_t limit) mutable -> Result<size_t> {
            const size_t count = std::min(limit, all->position.size() - next);
            const auto copy = [&](const auto& from, auto& to) {
                if (from.empty()) return;
                to.assign(from.begin() + static_cast<ptrdiff_t>(next),
                          from.begin() + static_cast<ptrdiff_t>(next + count));
            };
            copy(all->position, block.position);
            copy(all->normal, block.normal);
            copy(all->colour, block.colour);
            copy(all->radius, block.radius);
            copy(all->material, block.material);
            next += count;
            return count;
        });
    };
    return source;
}

}  // namespace stipple::lod
