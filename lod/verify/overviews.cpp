#include "lod/verify/overviews.h"

#include <fmt/format.h>

#include "lod/store/overview_levels.h"
#include "lod/verify/fault.h"

namespace stipple::lod {

OverviewLevels::OverviewLevels(const Store& store) : store_(store) {
    const Hierarchy& h = store.hierarchy;
    if (h.nodes.empty() || h.overviewOf(h.nodes[0]) == 0) return;
    const Result<Chunk> chunk = readDrawnChunk(store, 0, true);
    if (!chunk) return;
    const auto overview = std::span(chunk->records).first(overviewOf(h, h.nodes[0], *chunk));
    forEachOverviewLevel(overview, [&](size_t begin, size_t end) {
        addDiscs(h, h.nodes[0], *chunk, begin, end, 1, levels_.emplace_back());
    });
}

Result<uint64_t> OverviewLevels::measure(uint32_t leaf, const Chunk& chunk, uint64_t most) const {
    if (levels_.empty()) return 0;
    const Hierarchy& h = store_.hierarchy;
    const Node& node = h.nodes[leaf];
    const size_t first = leaf == 0 ? overviewOf(h, node, chunk) : 0;
    std::vector<Disc> discs;
    addDiscs(h, node, chunk, first, chunk.records.size(), 1, discs);
    const size_t stride = discs.size() / std::max<uint64_t>(most, 1) + 1;
    std::vector<size_t> before(levels_.size(), 0);  // of each level the disc that was near enough
    uint64_t measured = 0;
    for (size_t i = 0; i < discs.size(); i += stride, ++measured)
        for (size_t l = 0; l < levels_.size(); ++l) {
            const std::vector<Disc>& level = levels_[l];
            if (level.front().code >= ErrorScale::kLargest) continue;
            const double error = h.errors.decode(level.front().code),
                         enough = error * (1 + 1e-5) + 1e-6 * h.cellSize(h.nodes[0]);
            const double off = farthestPlace(discs[i], 1, 4, enough, [&](const glm::dvec3& place) {
                double least = distanceOf(place, level[before[l]], true);
                for (size_t k = 0; k < level.size() && least > enough; ++k) {
                    const double distance = distanceOf(place, level[k], true);
                    if (distance >= least) continue;
                    least = distance;
                    before[l] = k;
                }
                return least;
            });
            if (off > enough)
                return wrong(store_, leaf,
                             fmt::format("a place of a leaf's disc is {:.6g} lattice units off the overview's level of "
                                         "{} records, whose error says {:.6g}",
                                         off, level.size(), error));
        }
    return measured;
}

}  // namespace stipple::lod
