#include "lod/builder/patches/sample_segments.h"

#include <algorithm>
#include <atomic>

#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

constexpr int kMostDenser = 3;           ///< times that a thin segment is sampled twice as densely
constexpr int kMostFiner = 2;            ///< times that one farther off than wanted is
constexpr uint64_t kWorthHalving = 128;  ///< samples of a patch, so that it is halved before that

/// A segment on its way to a patch.
struct Job {
    Segment segment;
    double step = 0;
    int denser = 0;
};

class Sampler {
  public:
    Sampler(const MeshSurface& surface, const SampleSettings& settings, Executor& executor)
        : s_(surface), settings_(settings), executor_(executor), owner_(surface.size(), MeshSurface::kNobody) {}

    SampledSegments run(std::vector<Segment> segments) {
        std::vector<Job> jobs;
        for (Segment& segment : segments) add(std::move(segment), jobs);
        sample(std::move(jobs));
        std::sort(out_.patches.begin(), out_.patches.end(),
                  [](const SegmentPatch& a, const SegmentPatch& b) { return a.first < b.first; });
        std::sort(out_.left.begin(), out_.left.end());
        return std::move(out_);
    }

  private:
    bool isStopped() const { return settings_.isStopped && settings_.isStopped(); }

    void add(Segment segment, std::vector<Job>& jobs) const {
        const double step = settings_.step(segment);
        jobs.push_back({std::move(segment), step, 0});
    }

    void sample(std::vector<Job> jobs) {
        uint32_t number = 0;
        uint64_t done = 0;
        while (!jobs.empty()) {
            for (const Job& job : jobs) {
                for (const uint32_t t : job.segment) owner_[t] = number;
                ++number;
            }
            const uint32_t firstNumber = number - static_cast<uint32_t>(jobs.size());
            std::vector<MeshPatch> made(jobs.size());
            std::atomic<uint64_t> triangles{done};
            executor_.parallelFor(jobs.size(), 1, [&](size_t begin, size_t end) {
                for (size_t k = begin; k < end; ++k) {
                    if (isStopped()) return;
                    made[k] = patchOfTriangles(s_, jobs[k].segment, owner_, firstNumber + static_cast<uint32_t>(k),
                                               jobs[k].step, settings_.closing);
                    triangles += made[k].fit == PatchFit::good ? jobs[k].segment.size() : 0;
                    if (settings_.tell) settings_.tell(triangles);
                }
            });
            if (isStopped()) return;
            std::vector<Job> again;
            for (size_t k = 0; k < jobs.size(); ++k) settle(jobs[k], made[k], again);
            done = triangles;
            jobs = std::move(again);
        }
    }

    /// (Halved, what is far off is a small part of what stays as it is.)
    bool isTooFar(const Job& job, const Patch& p) const {
        return std::max(p.errorToSource, p.errorFromSource) > settings_.wanted && job.denser < kMostFiner;
    }
    static bool isWorthHalving(const Job& job, const Patch& p) {
        return job.segment.size() > 1 && p.samples() > kWorthHalving;
    }

    void settle(Job& job, MeshPatch& made, std::vector<Job>& again) {
        const bool isGood = made.fit == PatchFit::good, isFar = isGood && isTooFar(job, made.patch);
        const bool isHalved = isFar ? job.denser == 0 && isWorthHalving(job, made.patch)
                                    : made.fit == PatchFit::folded && job.segment.size() > 1;
        if (isGood && !isFar) {
            out_.patches.push_back({job.segment.front(), std::move(made), std::move(job.segment), job.step});
        } else if (isHalved) {
            auto [a, b] = halves(s_.elements, job.segment);
            add(std::move(a), again);
            add(std::move(b), again);
        } else if (job.denser < kMostDenser && job.step > 0) {
            again.push_back({std::move(job.segment), 0.5 * job.step, job.denser + 1});
        } else {
            out_.left.insert(out_.left.end(), job.segment.begin(), job.segment.end());
        }
    }

    const MeshSurface& s_;
    const SampleSettings& settings_;
    Executor& executor_;
    std::vector<uint32_t> owner_;
    SampledSegments out_;
};

}  // namespace

uint64_t SampledSegments::samples() const {
    uint64_t sum = 0;
    for (const SegmentPatch& p : patches) sum += p.patch.patch.samples();
    return sum;
}

void SampledSegments::leaveCostly(double most, const std::function<double(uint32_t)>& recordsOf) {
    double before = 0;
    for (const uint32_t t : left) before += recordsOf(t);
    std::vector<PatchCost> costs;
    for (const SegmentPatch& p : patches) {
        costs.push_back({static_cast<double>(p.patch.patch.samples()), 0});
        for (const uint32_t t : p.segment) costs.back().records += recordsOf(t);
    }
    std::vector<SegmentPatch> kept;
    const std::vector<uint8_t> isLeft = costliest(costs, before, most);
    for (size_t k = 0; k < patches.size(); ++k)
        if (isLeft[k] == 0)
            kept.push_back(std::move(patches[k]));
        else
            left.insert(left.end(), patches[k].segment.begin(), patches[k].segment.end());
    patches = std::move(kept);
    std::sort(left.begin(), left.end());
}

void SampledSegments::dress(const MeshSurface& surface, const SampleSettings& settings, Executor& executor) {
    std::vector<uint32_t> owner(surface.size(), MeshSurface::kNobody);
    for (size_t k = 0; k < patches.size(); ++k)
        for (const uint32_t t : patches[k].segment) owner[t] = static_cast<uint32_t>(k);
    executor.parallelFor(patches.size(), 1, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end; ++k) {
            if (settings.isStopped && settings.isStopped()) return;
            SegmentPatch& p = patches[k];
            dressPatch(surface, p.segment, owner, static_cast<uint32_t>(k), p.step, settings.closing,
                       settings.isStopped, p.patch.patch);
        }
    });
}

SampledSegments sampleSegments(const MeshSurface& surface, std::vector<Segment> segments,
                               const SampleSettings& settings, Executor& executor) {
    return Sampler(surface, settings, executor).run(std::move(segments));
}

}  // namespace stipple::lod
