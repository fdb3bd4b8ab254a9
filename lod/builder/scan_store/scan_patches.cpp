#include "lod/builder/scan_store/scan_patches.h"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"
#include "lod/builder/patches/point_segments.h"
#include "lod/builder/patches/segments.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kRounding = 1e-4;  ///< steps

/// The points within and beside the node as elements of their own, links among them.
struct Members {
    std::vector<uint32_t> points;  ///< ascending
    SurfaceElements elements;
};

Members membersOf(const PointSurface& s, const std::vector<Lies>& lies) {
    Members m;
    std::vector<uint32_t> number(s.size(), 0);
    for (uint32_t i = 0; i < s.size(); ++i) {
        if (lies[i] == Lies::apart || s.isSurface[i] == 0) continue;
        number[i] = static_cast<uint32_t>(m.points.size());
        m.points.push_back(i);
    }
    const auto isMember = [&](uint32_t i) { return lies[i] != Lies::apart && s.isSurface[i] != 0; };
    SurfaceElements& e = m.elements;
    e.firstLink.push_back(0);
    for (const uint32_t i : m.points) {
        e.centre.push_back(s.elements.centre[i]);
        e.normal.push_back(s.elements.normal[i]);
        e.area.push_back(s.elements.area[i]);
        for (const uint32_t other : s.elements.links(i))
            if (isMember(other)) e.link.push_back(number[other]);
        e.firstLink.push_back(static_cast<uint32_t>(e.link.size()));
    }
    return m;
}

}  // namespace

std::vector<Segment> segmentsOfScan(const PointSurface& s, const std::vector<Lies>& lies, const ScanSettings& settings,
                                    Executor& executor) {
    const Members m = membersOf(s, lies);
    SegmentSettings how;
    how.isStopped = settings.isStopped;
    how.coneCosine = std::cos(settings.coneDegrees * 3.14159265358979323846 / 180);
    std::vector<Segment> segments = connectedComponents(m.elements);
    std::erase_if(segments, [](const Segment& segment) { return segment.size() < kFewestPoints; });
    segments = mergeByNormals(m.elements, splitByCone(m.elements, std::move(segments), how, executor), how);
    for (Segment& segment : segments)
        for (uint32_t& i : segment) i = m.points[i];
    return segments;
}

ScanPatches patchesOfScan(const PointSurface& s, const std::vector<Lies>& lies, std::vector<Segment> segments,
                          const glm::dvec3& corner, const ScanSettings& settings, Executor& executor) {
    constexpr uint32_t kNone = ~0u;
    std::vector<uint32_t> owner(s.size(), kNone);  // the patch that stands for a point
    for (const Segment& segment : segments)
        for (const uint32_t i : segment) owner[i] = 0;
    PointSampling how;
    how.isStopped = settings.isStopped;
    how.step = [&](const Segment& segment) {
        return std::max(stepOf(s, segment, settings.samplesAPoint), settings.leastStep);
    };
    SampledPoints sampled = samplePoints(s, std::move(segments), how, executor);
    sampled.leaveCostly(settings.mostSamples);
    for (const uint32_t i : sampled.left) owner[i] = kNone;
    ScanPatches out;
    for (uint32_t i = 0; i < s.size(); ++i)
        if (lies[i] == Lies::within && owner[i] == kNone) out.left.push_back(i);
    for (SampledPoints::Made& made : sampled.patches) {
        Patch& p = made.patch.patch;
        out.toPoints = std::max(out.toPoints, p.errorToSource);
        // (The file has steps and turns in fp32.)
        out.fromPoints = std::max(out.fromPoints, p.errorFromSource + kRounding * double{p.step});
        std::vector<uint8_t> isOwn(p.heights.size(), 0);
        for (size_t k = 0; k < isOwn.size(); ++k) {
            const uint32_t near = made.patch.nearest[k];
            isOwn[k] = near != PointPatch::kNoPoint && lies[near] == Lies::within && made.patch.isOfSegment(near);
        }
        p.origin += s.middle - corner;
        out.patches.push_back(std::move(p));
        out.isOwn.push_back(std::move(isOwn));
    }
    return out;
}

PointBlock samplesFor(const ScanPatches& made, const glm::dvec3& corner, double step) {
    constexpr double kRounding = 1024;
    PointBlock out;
    for (size_t n = 0; n < made.patches.size(); ++n) {
        const Patch& p = made.patches[n];
        const PatchSurface surface(p);
        const auto stride = static_cast<uint32_t>(std::clamp(std::round(step / double{p.step}), 1.0, 4096.0));
        for (uint32_t j = 0; j < p.height; j += stride)
            for (uint32_t i = 0; i < p.width; i += stride) {
                const size_t at = p.at(i, j);
                if (p.heights[at] == 0 || made.isOwn[n][at] == 0) continue;
                out.position.push_back(glm::round((corner + surface.position(at)) * kRounding) / kRounding);
                out.normal.emplace_back(surface.frame() * glm::dvec3(shared::octDecode(p.normals[at])));
                out.colour.push_back(p.colours[at]);
            }
    }
    return out;
}

}  // namespace stipple::lod
