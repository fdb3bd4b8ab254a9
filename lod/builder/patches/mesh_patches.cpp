// Triangles to patches: segments, then a patch of each; what folds is halved and tried again, what is thin is sampled
// more densely, and what stays thin becomes points.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "lod/builder/patches/deviation.h"
#include "lod/builder/patches/gaps.h"
#include "lod/builder/patches/mesh_patch.h"
#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

constexpr int kMostDenser = 3;  ///< times that a thin segment is sampled twice as densely

/// A segment on its way to a patch.
struct Job {
    Segment segment;
    double step = 0;
    int denser = 0;
};

class MeshPatches {
  public:
    MeshPatches(const MeshSurface& surface, const PatchSettings& settings, Executor& executor, Progress& progress)
        : s_(surface), settings_(settings), executor_(executor), progress_(progress), owner_(surface.size(), ~0u) {
        const double vertices = static_cast<double>(surface.position.size());
        const double wanted = settings.samples > 0 ? static_cast<double>(settings.samples)
                                                   : std::max(vertices, static_cast<double>(kFewestSamples));
        samplesATriangle_ = wanted / static_cast<double>(std::max<size_t>(surface.size(), 1));
    }

    PatchSet run() {
        PatchSet out;
        out.trianglesIn = s_.triangles;
        out.dropped = s_.dropped;
        out.middle = s_.middle;
        out.isTwoSided = s_.isTwoSided;
        SegmentSettings how;
        how.coneCosine = std::cos(settings_.coneDegrees * 3.14159265358979323846 / 180);
        how.isStopped = settings_.isStopped;
        std::vector<Segment> segments = splitByCone(s_.elements, connectedComponents(s_.elements), how, executor_);
        segments = mergeByNormals(s_.elements, std::move(segments), how);
        std::vector<Job> jobs;
        for (Segment& segment : segments) add(std::move(segment), jobs);
        sample(std::move(jobs));
        if (settings_.isStopped && settings_.isStopped()) return {};
        finish(out);
        return out;
    }

  private:
    struct Made {
        uint32_t first;  ///< element
        MeshPatch patch;
    };

    /// As many samples as the segment has elements, for the area of their projections.
    void add(Segment segment, std::vector<Job>& jobs) const {
        Job job;
        glm::dvec3 sum(0);
        for (const uint32_t t : segment) sum += s_.elements.area[t] * glm::dvec3(s_.elements.normal[t]);
        const double area = glm::length(sum);  // projected along the mean normal
        job.step = std::sqrt(area / (samplesATriangle_ * static_cast<double>(segment.size())));
        job.segment = std::move(segment);
        jobs.push_back(std::move(job));
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
                    if (settings_.isStopped && settings_.isStopped()) return;
                    made[k] = patchOfTriangles(s_, jobs[k].segment, owner_, firstNumber + static_cast<uint32_t>(k),
                                               jobs[k].step, settings_.closing);
                    triangles += made[k].fit == PatchFit::good ? jobs[k].segment.size() : 0;
                    progress_.update("patches", triangles, s_.size());
                }
            });
            if (settings_.isStopped && settings_.isStopped()) return;
            std::vector<Job> again;
            for (size_t k = 0; k < jobs.size(); ++k) settle(jobs[k], made[k], again);
            done = triangles;
            jobs = std::move(again);
        }
    }

    void settle(Job& job, MeshPatch& made, std::vector<Job>& again) {
        if (made.fit == PatchFit::good) {
            made_.push_back({job.segment.front(), std::move(made)});
        } else if (made.fit == PatchFit::folded && job.segment.size() > 1) {
            auto [a, b] = halves(s_.elements, job.segment);
            add(std::move(a), again);
            add(std::move(b), again);
        } else if (job.denser < kMostDenser && job.step > 0) {
            again.push_back({std::move(job.segment), 0.5 * job.step, job.denser + 1});
        } else {
            left_.insert(left_.end(), job.segment.begin(), job.segment.end());
        }
    }

    void finish(PatchSet& out) {
        std::sort(made_.begin(), made_.end(), [](const Made& a, const Made& b) { return a.first < b.first; });
        double to = 0, toWeight = 0, from = 0, fromWeight = 0;
        for (Made& m : made_) {
            to += m.patch.toSource;
            toWeight += m.patch.toSourceWeight;
            from += m.patch.fromSource;
            fromWeight += m.patch.fromSourceWeight;
            out.add(std::move(m.patch.patch));
        }
        out.toSource.rms = toWeight > 0 ? std::sqrt(to / toWeight) : 0;
        out.fromSource.rms = fromWeight > 0 ? std::sqrt(from / fromWeight) : 0;
        if (settings_.closing == PatchClosing::gaps) {
            fillGaps(out);
            for (const auto& gap : out.gaps) {
                const auto places = placesOf(out, gap);
                const size_t near = s_.nearest(places[0], 0).second;
                out.toSource.bound = boundToSource(s_, places, near, out.toSource.bound);
            }
        }
        leavePoints(out);
    }

    /// The corners and middles of triangles that no patch stands for, each once.
    void leavePoints(PatchSet& out) {
        std::sort(left_.begin(), left_.end());
        std::vector<uint8_t> isTaken(s_.position.size(), 0);
        const auto put = [&](uint32_t t, double b, double c, const glm::dvec3& at) {
            const SurfaceLook look = s_.look(t, b, c);
            out.left.position.push_back(at);
            out.left.normal.push_back(look.normal);
            out.left.colour.push_back(look.colour);
        };
        for (const uint32_t t : left_) {
            for (size_t k = 0; k < 3; ++k) {
                uint8_t& taken = isTaken[s_.corners[t][k]];
                if (taken == 0) put(t, k == 1 ? 1 : 0, k == 2 ? 1 : 0, s_.at(t, k));
                out.pointsLeft += taken == 0 ? 1 : 0;
                taken = 1;
            }
            put(t, 1.0 / 3, 1.0 / 3, s_.elements.centre[t]);
        }
    }

    const MeshSurface& s_;
    const PatchSettings& settings_;
    Executor& executor_;
    Progress& progress_;
    double samplesATriangle_ = 1;
    std::vector<uint32_t> owner_;
    std::vector<Made> made_;
    std::vector<uint32_t> left_;
};

}  // namespace

PatchSet patchesOfMesh(TriangleMesh mesh, const PatchSettings& settings, Executor& executor, Progress& progress) {
    const MeshSurface surface = meshSurface(std::move(mesh), executor);
    return MeshPatches(surface, settings, executor, progress).run();
}

}  // namespace stipple::lod
