// Triangles to patches: segments, then a patch of each; what stays thin becomes points.
#include <algorithm>
#include <cmath>

#include "lod/builder/patches/deviation.h"
#include "lod/builder/patches/gaps.h"
#include "lod/builder/patches/sample_segments.h"
#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

class MeshPatches {
  public:
    MeshPatches(const MeshSurface& surface, const PatchSettings& settings, Executor& executor, Progress& progress)
        : s_(surface), settings_(settings), executor_(executor), progress_(progress) {
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
        SampleSettings sampling;
        sampling.closing = settings_.closing;
        sampling.step = [this](const Segment& segment) { return stepOf(segment); };
        sampling.isStopped = settings_.isStopped;
        sampling.tell = [this](uint64_t done) { progress_.update("patches", done, s_.size()); };
        sampled_ = sampleSegments(s_, std::move(segments), sampling, executor_);
        sampled_.dress(s_, sampling, executor_);
        if (settings_.isStopped && settings_.isStopped()) return {};
        finish(out);
        return out;
    }

  private:
    /// As many samples as the segment has elements, for the area of their projections.
    double stepOf(const Segment& segment) const {
        glm::dvec3 sum(0);
        for (const uint32_t t : segment) sum += s_.elements.area[t] * glm::dvec3(s_.elements.normal[t]);
        const double area = glm::length(sum);  // projected along the mean normal
        return std::sqrt(area / (samplesATriangle_ * static_cast<double>(segment.size())));
    }

    void finish(PatchSet& out) {
        double to = 0, toWeight = 0, from = 0, fromWeight = 0;
        for (SegmentPatch& m : sampled_.patches) {
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
        std::vector<uint8_t> isTaken(s_.position.size(), 0);
        const auto put = [&](uint32_t t, double b, double c, const glm::dvec3& at) {
            const SurfaceLook look = s_.look(t, b, c);
            out.left.position.push_back(at);
            out.left.normal.push_back(look.normal);
            out.left.colour.push_back(look.colour);
            out.left.material.push_back(look.material);
        };
        for (const uint32_t t : sampled_.left) {
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
    SampledSegments sampled_;
};

}  // namespace

bool hasMirrors(const std::vector<PointMaterial>& list) {
    constexpr float kSmooth = 0.1f;
    return list != materialGrid() &&
           std::any_of(list.begin(), list.end(), [](const PointMaterial& m) { return m.roughness < kSmooth; });
}

PatchSet patchesOfMesh(TriangleMesh mesh, const PatchSettings& settings, Executor& executor, Progress& progress) {
    MeshSurface surface = meshSurface(std::move(mesh), executor);
    surface.looks = settings.looks;
    surface.hasFineNormals = settings.hasFineNormals;
    surface.mapTexels = settings.looks && settings.maps.texels > 0 ? settings.maps.texels : 1;
    surface.hasMapNormals = settings.maps.detail.hasNormals;
    surface.hasMapMaterials = settings.maps.detail.hasMaterials;
    return MeshPatches(surface, settings, executor, progress).run();
}

}  // namespace stipple::lod
