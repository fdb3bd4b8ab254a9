// Points to patches: segments of what lies on a surface, then a patch of each; what folds is halved and tried again.
// Points beside all surfaces, and those that no patch fits, stay points.
#include <algorithm>
#include <cmath>
#include <limits>

#include "lod/builder/patches/gaps.h"
#include "lod/builder/patches/point_segments.h"
#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

class PointPatches {
  public:
    PointPatches(const PointSurface& surface, const PatchSettings& settings, Executor& executor, Progress& progress)
        : s_(surface), settings_(settings), executor_(executor), progress_(progress) {
        if (settings.samples > 0)
            samplesAPoint_ =
                static_cast<double>(settings.samples) / static_cast<double>(std::max<size_t>(s_.size(), 1));
    }

    PatchSet run() {
        PatchSet out;
        out.pointsIn = s_.points;
        out.dropped = s_.dropped;
        out.middle = s_.middle;
        out.isTwoSided = settings_.isTwoSided || s_.given.empty();
        SegmentSettings how;
        how.coneCosine = std::cos(settings_.coneDegrees * 3.14159265358979323846 / 180);
        how.isStopped = settings_.isStopped;
        std::vector<Segment> segments = worthIt(connectedComponents(s_.elements));
        segments = splitByCone(s_.elements, std::move(segments), how, executor_);
        segments = mergeByNormals(s_.elements, std::move(segments), how);
        sample(worthIt(std::move(segments)));
        if (settings_.isStopped && settings_.isStopped()) return {};
        finish(out);
        return out;
    }

  private:
    /// The others' points are left.
    std::vector<Segment> worthIt(std::vector<Segment> segments) {
        std::erase_if(segments, [&](const Segment& s) {
            if (s.size() >= kFewestPoints) return false;
            left_.insert(left_.end(), s.begin(), s.end());
            return true;
        });
        return segments;
    }

    void sample(std::vector<Segment> segments) {
        PointSampling how;
        how.closing = settings_.closing;
        how.step = [this](const Segment& s) { return stepOf(s_, s, samplesAPoint_); };
        how.isStopped = settings_.isStopped;
        how.tell = [this](uint64_t done) { progress_.update("patches", done, s_.size()); };
        SampledPoints sampled = samplePoints(s_, std::move(segments), how, executor_);
        made_ = std::move(sampled.patches);
        left_.insert(left_.end(), sampled.left.begin(), sampled.left.end());
    }

    void finish(PatchSet& out) {
        double to = 0, from = 0;
        uint64_t represented = 0;
        for (SampledPoints::Made& m : made_) {
            to += m.patch.toSource;
            from += m.patch.fromSource;
            represented += m.patch.represented;
            out.add(std::move(m.patch.patch));
        }
        const double all = static_cast<double>(std::max<uint64_t>(represented, 1));
        out.toSource.rms = std::sqrt(to / all);
        out.fromSource.rms = std::sqrt(from / all);
        if (settings_.closing == PatchClosing::gaps) {
            fillGaps(out);
            for (const auto& gap : out.gaps)
                out.toSource.bound = std::max(out.toSource.bound, boundToPoints(placesOf(out, gap)));
        }
        std::sort(left_.begin(), left_.end());
        for (const uint32_t i : left_) {
            out.left.position.push_back(s_.elements.centre[i]);
            out.left.colour.push_back(s_.colour.empty() ? kPlainColour : s_.colour[i]);
            if (!s_.given.empty()) out.left.normal.push_back(s_.given[i]);
        }
        out.pointsLeft = left_.size();
    }

    /// From any place of a triangle: by way of a corner, to the point nearest to that.
    double boundToPoints(const std::array<glm::dvec3, 3>& t) const {
        double most = 0, longest = 0;
        for (size_t k = 0; k < 3; ++k) {
            NearPoints::Found near;
            s_.near.find(t.at(k), 1, std::numeric_limits<float>::max(), near);
            if (near.count == 0) return std::numeric_limits<double>::infinity();
            most = std::max(most, glm::distance(t.at(k), s_.elements.centre[near.index[0]]));
            longest = std::max(longest, glm::distance(t.at(k), t.at((k + 1) % 3)));
        }
        return most + longest / std::sqrt(3.0);
    }

    const PointSurface& s_;
    const PatchSettings& settings_;
    Executor& executor_;
    Progress& progress_;
    double samplesAPoint_ = 1;
    std::vector<SampledPoints::Made> made_;
    std::vector<uint32_t> left_;
};

}  // namespace

PatchSet patchesOfPoints(PointBlock points, const PatchSettings& settings, Executor& executor, Progress& progress) {
    const PointSurface surface = pointSurface(std::move(points), settings.isStopped, executor, progress);
    if (settings.isStopped && settings.isStopped()) return {};
    return PointPatches(surface, settings, executor, progress).run();
}

}  // namespace stipple::lod
