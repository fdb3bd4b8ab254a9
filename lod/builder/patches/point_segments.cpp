#include "lod/builder/patches/point_segments.h"

#include <algorithm>
#include <atomic>

#include "lod/builder/patches/segments.h"

namespace stipple::lod {

SampledPoints samplePoints(const PointSurface& surface, std::vector<Segment> segments, const PointSampling& settings,
                           Executor& executor) {
    SampledPoints out;
    const auto isStopped = [&] { return settings.isStopped && settings.isStopped(); };
    std::atomic<uint64_t> done{0};
    while (!segments.empty()) {
        std::erase_if(segments, [&](const Segment& s) {
            if (s.size() >= kFewestPoints) return false;
            out.left.insert(out.left.end(), s.begin(), s.end());
            return true;
        });
        std::vector<PointPatch> made(segments.size());
        executor.parallelFor(segments.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) {
                if (isStopped()) return;
                made[k] = patchOfPoints(surface, segments[k], settings.step(segments[k]), settings.closing);
                if (!made[k].isFolded && settings.tell) settings.tell(done += segments[k].size());
            }
        });
        if (isStopped()) return {};
        std::vector<Segment> again;
        for (size_t k = 0; k < segments.size(); ++k) {
            if (made[k].isFolded) {
                auto [a, b] = halves(surface.elements, segments[k]);
                again.push_back(std::move(a));
                again.push_back(std::move(b));
                continue;
            }
            out.left.insert(out.left.end(), made[k].left.begin(), made[k].left.end());
            if (made[k].patch.width > 0) out.patches.push_back({segments[k].front(), std::move(made[k])});
        }
        segments = std::move(again);
    }
    std::sort(out.patches.begin(), out.patches.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::sort(out.left.begin(), out.left.end());
    return out;
}

void SampledPoints::leaveCostly(double most) {
    std::vector<PatchCost> costs;
    for (const Made& m : patches)
        costs.push_back({static_cast<double>(m.patch.patch.samples()), static_cast<double>(m.patch.segment.size())});
    std::vector<Made> kept;
    const std::vector<uint8_t> isLeft = costliest(costs, static_cast<double>(left.size()), most);
    for (size_t k = 0; k < patches.size(); ++k)
        if (isLeft[k] == 0)
            kept.push_back(std::move(patches[k]));
        else
            left.insert(left.end(), patches[k].patch.segment.begin(), patches[k].patch.segment.end());
    patches = std::move(kept);
    std::sort(left.begin(), left.end());
    left.erase(std::unique(left.begin(), left.end()), left.end());  // (some of a segment were left before)
}

}  // namespace stipple::lod
