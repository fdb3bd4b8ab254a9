#include "lod/builder/patch_store/node_patches.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "lod/builder/patch_store/discs.h"
#include "lod/builder/patch_store/division.h"
#include "lod/builder/patches/sample_segments.h"
#include "lod/builder/patches/segments.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kFinest = 0.25, kCoarsest = 1.5;      ///< steps of leaves, in those of their level
constexpr double kCoarsestTried = 4;                   ///< likewise, where there are too many samples
constexpr double kMostSamples = 4, kFewSamples = 256;  ///< of leaves: for each triangle; that are always worth it
constexpr double kAsked = 1.1;                         ///< of the samples asked for, that are good enough
constexpr double kLooser = 1.7, kLoosest = 1;          ///< bounds that patches want, where there are too many
constexpr double kSmallPatch = 12;                     ///< samples of the smallest patches
constexpr int kMostTries = 5;                          ///< of a step
constexpr int kTightenings = 3;                        ///< halvings between bounds of too many and of few enough
constexpr double kUnited = 0.25;                       ///< cells of discs of inner nodes, in steps
constexpr double kMostDisc = 0.5;                      ///< edges of what a disc covers, in steps
constexpr double kWanted = 0.5, kWantedOfLeaf = 0.6;   ///< bounds of patches that are good enough, in steps

void addTo(TriangleMesh& mesh, const Soup& soup, const glm::dvec3& corner) {
    const auto first = static_cast<uint32_t>(mesh.position.size());
    for (size_t v = 0; v < soup.vertices.size(); ++v) {
        const shared::MeshVertex& from = soup.vertices.low[v];
        mesh.position.push_back(glm::dvec3(soup.vertices.at(v)) - corner);
        mesh.normal.emplace_back(glm::vec3(shared::octDecode(from.normal)));
        mesh.colour.push_back(from.colour & 0xffffffu);
        mesh.surface.push_back(from.surface);
        mesh.uv.emplace_back(from.u, from.v);
    }
    for (const uint32_t i : soup.indices) mesh.indices.push_back(first + i);
}

class NodePatcher {
  public:
    NodePatcher(const Soup& own, const AroundNode& around, const glm::dvec3& corner, Executor& executor)
        : corner_(corner), executor_(executor) {
        TriangleMesh mesh;
        addTo(mesh, own, corner);
        ownVertices_ = mesh.position.size();
        addTo(mesh, around.within, corner);
        segmentVertices_ = mesh.position.size();
        addTo(mesh, around.beyond, corner);
        s_ = meshSurface(std::move(mesh), executor);
    }

    NodePatches run(const NodeSettings& settings) {
        NodePatches out;
        s_.looks = settings.looks;
        s_.hasFineNormals = settings.hasFineNormals;
        if (settings.below != nullptr && !settings.below->isEmpty())
            s_.looksThere = [this, &settings](const glm::dvec3& place, const glm::vec3& normal) {
                return settings.below->at(corner_ + s_.middle + place, normal, settings.belowStep);
            };
        SegmentSettings how;
        how.coneCosine = std::cos(settings.coneDegrees * 3.14159265358979323846 / 180);
        how.isStopped = isStopped_ = settings.isStopped;
        const SurfaceElements elements = inSegments();
        std::vector<Segment> segments = connectedComponents(elements);
        std::erase_if(segments, [&](const Segment& s) { return !isInSegment(s.front()); });
        segments = mergeByNormals(elements, splitByCone(elements, std::move(segments), how, executor_), how);
        s_.mapTexels = settings.maps.texels;
        s_.texelSide = settings.maps.sourceTexel;
        s_.mostDensity = static_cast<uint32_t>(std::countr_zero(settings.maps.most));
        s_.hasMapNormals = settings.maps.hasNormals;
        s_.hasMapMaterials = settings.maps.hasMaterials;
        s_.hasLight = settings.maps.hasLight;
        double step = settings.step;
        SampledSegments sampled = settings.samplesATriangle > 0 ? sampledLeaf(segments, settings, step)
                                                                : sampledAt(segments, step, kWanted * step);
        sampled.dress(s_, samplingAt(step, 0), executor_);
        for (SegmentPatch& made : sampled.patches) {
            Patch& p = made.patch.patch;
            p.origin += s_.middle;
            out.error = std::max({out.error, p.errorToSource, p.errorFromSource});
            out.patches.push_back(std::move(p));
        }
        for (const uint32_t t : sampled.left) {
            if (s_.vertices[t][0] >= ownVertices_) continue;  // another node's
            ++out.trianglesLeft;
            cover({s_.at(t, 0), s_.at(t, 1), s_.at(t, 2)}, {glm::dvec2(0), glm::dvec2(1, 0), glm::dvec2(0, 1)}, t,
                  kMostDisc * step, out.left);
        }
        for (const LeftDisc& d : out.left) out.error = std::max(out.error, double{d.radius});
        if (settings.samplesATriangle == 0)
            out.error = std::max(out.error, uniteDiscs(out.left, kUnited * settings.step));
        return out;
    }

  private:
    SampleSettings samplingAt(double step, double wanted) const {
        SampleSettings sampling;
        sampling.step = [step](const Segment&) { return step; };
        sampling.wanted = wanted;
        sampling.isStopped = isStopped_;
        return sampling;
    }
    SampledSegments sampledAt(const std::vector<Segment>& segments, double step, double wanted) const {
        return sampleSegments(s_, segments, samplingAt(step, wanted), executor_);
    }

    /// Of a leaf. Where there are too many samples, the bound that patches want goes first, then the step, then what is
    /// costliest stands for itself; where a number is asked for, the step is sought that gives it.
    SampledSegments sampledLeaf(const std::vector<Segment>& segments, const NodeSettings& settings,
                                double& step) const {
        double area = 0, triangles = 0;
        for (size_t t = 0; t < s_.size(); ++t) {
            if (s_.vertices[t][0] >= ownVertices_) continue;
            area += s_.elements.area[t];
            ++triangles;
        }
        const double aim = std::max(settings.samplesATriangle * triangles, 1.0);
        const double most = settings.isAsked ? kAsked * aim : std::max(kMostSamples * triangles, kFewSamples);
        step = std::clamp(std::sqrt(area / aim), settings.step * kFinest, settings.step * kCoarsest);
        const double least = settings.isAsked && aim >= kFewSamples ? aim / kAsked : 0;
        // In steps. (Where there are so many segments, nobody asks for more.)
        double wanted = kWantedOfLeaf;
        const auto loosen = [&] {
            wanted = wanted < kLoosest ? kLooser * wanted : std::numeric_limits<double>::infinity();
        };
        while (static_cast<double>(segments.size()) * kSmallPatch > most && wanted < kLoosest) loosen();
        SampledSegments made = sampledAt(segments, step, wanted * step);
        double tooTight = 0;  // bound that asked for too many at this step
        for (int tries = 0; tries < kMostTries; ++tries) {
            const auto samples = static_cast<double>(made.samples());
            if (samples <= most && samples >= least) break;
            const bool isLoose = !std::isfinite(wanted);
            tooTight = samples > most ? wanted : 0;
            if (samples > most && (tries > 0 || !settings.isAsked)) loosen();
            if (settings.isAsked || isLoose) {
                const double times = samples / (settings.isAsked ? aim : 0.9 * most);
                const double next = std::clamp(step * std::clamp(std::sqrt(times), 0.5, 2.0), settings.step * kFinest,
                                               settings.step * kCoarsestTried);
                if (next == step && isLoose) break;
                step = next;
            }
            made = sampledAt(segments, step, wanted * step);
        }
        if (!settings.isAsked) tighten(segments, step, tooTight, wanted, most, made);
        if (!settings.isAsked) made.leaveCostly(most, [&](uint32_t t) { return discsOver(t, kMostDisc * step); });
        return made;
    }

    /// Between a bound that asks for too many samples and the looser one that was taken there is a better one.
    void tighten(const std::vector<Segment>& segments, double step, double tooTight, double taken, double most,
                 SampledSegments& made) const {
        if (!(tooTight > 0) || !std::isfinite(tooTight) || static_cast<double>(made.samples()) > most) return;
        taken = std::min(taken, kLooser * tooTight);
        for (int tries = 0; tries < kTightenings; ++tries) {
            const double between = std::sqrt(tooTight * taken);
            SampledSegments other = sampledAt(segments, step, between * step);
            const bool isGood = static_cast<double>(other.samples()) <= most;
            (isGood ? taken : tooTight) = between;
            if (isGood) made = std::move(other);
        }
    }

    /// As many as `cover` takes.
    double discsOver(uint32_t t, double step) const {
        double longest = 0, discs = 1;
        for (size_t k = 0; k < 3; ++k) longest = std::max(longest, glm::distance(s_.at(t, k), s_.at(t, (k + 1) % 3)));
        for (; longest > step; longest *= 0.5) discs *= 4;
        return discs;
    }

    bool isInSegment(uint32_t t) const { return s_.vertices[t][0] < segmentVertices_; }

    /// What is farther around has no neighbours: it becomes no part of a segment.
    SurfaceElements inSegments() const {
        SurfaceElements e;
        e.centre = s_.elements.centre;
        e.normal = s_.elements.normal;
        e.area = s_.elements.area;
        e.firstLink.push_back(0);
        for (uint32_t t = 0; t < s_.size(); ++t) {
            if (isInSegment(t))
                for (const uint32_t other : s_.elements.links(t))
                    if (isInSegment(other)) e.link.push_back(other);
            e.firstLink.push_back(static_cast<uint32_t>(e.link.size()));
        }
        return e;
    }

    /// A disc about the middle, and of large triangles one of each quarter. `weights`: of the second and third corner.
    void cover(const std::array<glm::dvec3, 3>& t, const std::array<glm::dvec2, 3>& weights, uint32_t triangle,
               double step, std::vector<LeftDisc>& out) const {
        const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0;
        double radius = 0, longest = 0;
        for (size_t k = 0; k < 3; ++k) {
            radius = std::max(radius, glm::distance(middle, t.at(k)));
            longest = std::max(longest, glm::distance(t.at(k), t.at((k + 1) % 3)));
        }
        if (longest > step) {
            const auto half = [](const auto& a, const auto& b) { return 0.5 * (a + b); };
            const glm::dvec3 ab = half(t[0], t[1]), bc = half(t[1], t[2]), ca = half(t[2], t[0]);
            const auto& w = weights;
            const glm::dvec2 wab = half(w[0], w[1]), wbc = half(w[1], w[2]), wca = half(w[2], w[0]);
            cover({t[0], ab, ca}, {w[0], wab, wca}, triangle, step, out);
            cover({ab, t[1], bc}, {wab, w[1], wbc}, triangle, step, out);
            cover({ca, bc, t[2]}, {wca, wbc, w[2]}, triangle, step, out);
            cover({ab, bc, ca}, {wab, wbc, wca}, triangle, step, out);
            return;
        }
        const glm::dvec2 w = (weights[0] + weights[1] + weights[2]) / 3.0;
        const SurfaceLook look = s_.look(triangle, w.x, w.y);
        out.push_back({corner_ + s_.middle + middle, look.normal, static_cast<float>(radius * (1 + 1e-6)), look.colour,
                       look.material, look.light});
    }

    glm::dvec3 corner_;
    Executor& executor_;
    MeshSurface s_;
    std::function<bool()> isStopped_;
    size_t ownVertices_ = 0, segmentVertices_ = 0;
};

}  // namespace

void AroundNode::add(const Soup& from, double error, const glm::dvec3& lo, double cell) {
    const double step = cell / kPatchCells;
    SoupPart toWithin(from, within), toBeyond(from, beyond);
    for (size_t t = 0; t < from.indices.size() / 3; ++t) {
        const glm::dvec3 p(middleOf(from, t));
        const glm::dvec3 off = glm::max(glm::max(lo - p, p - (lo + cell)), glm::dvec3(0));
        const double far = std::max({off.x, off.y, off.z});
        if (far > kPatchAround * step) continue;
        (far <= kPatchReach * step ? toWithin : toBeyond).add(t);
        surfaceError = std::max(surfaceError, error);
    }
}

NodePatches patchesOfNode(const Soup& own, const AroundNode& around, const glm::dvec3& corner,
                          const NodeSettings& settings, Executor& executor) {
    return NodePatcher(own, around, corner, executor).run(settings);
}

}  // namespace stipple::lod
