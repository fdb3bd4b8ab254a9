#include "engine/render/pruning.h"

#include <algorithm>
#include <cmath>

#include "lod/cut/view.h"
#include "lod/primitives/kinds.h"
#include "lod/store/chunk.h"
#include "lod/store/pruning.h"
#include "lod/store/store.h"

namespace stipple::render {
namespace {

/// Adds the segments that a draw shows.
class CurvePruning {
  public:
    CurvePruning(const lod::Hierarchy& h, const lod::Instance& instance, const lod::View& view, PrunedShares& shares)
        : h_(h), view_(lod::makeLocalView(h, instance, view)), shares_(shares) {}

    void add(const lod::CutDraw& draw, const lod::Chunk& chunk) {
        const lod::Node& node = h_.nodes[draw.node];
        const lod::Payload& payload = h_.payload(draw.chunk);
        const double step = std::exp2(payload.stepShift), edge = h_.cellSize(node),
                     kept = h_.isCurves ? lod::keptShare(node) : 1;
        // What the build may have thinned out, and made wider by what went.
        const double thin = kept < 1 ? lod::kThinCurve * edge / kept : 0;
        const glm::dvec3 base = h_.recordOrigin(node, payload);
        const auto placeOf = [&](const shared::CurveVertex& v) {
            return base + step * glm::dvec3(v.positionXY & 0xffffu, v.positionXY >> 16, v.positionZ & 0xffffu);
        };
        for (size_t i = 0; i < std::min<size_t>(draw.count, chunk.segments.size()); ++i) {
            const shared::CurveSegment& s = chunk.segments[i];
            if (shared::segmentErrorCode(s) > draw.errorCode && (shared::segmentOctants(s) & draw.octantMask) == 0)
                continue;
            const glm::dvec3 a = placeOf(s.a), b = placeOf(s.b), middle = 0.5 * (a + b) - view_.eye;
            const double radius =
                0.5 * edge * (double{shared::curveRadius(s.a, 1.0f)} + double{shared::curveRadius(s.b, 1.0f)});
            const double depth = glm::dot(middle, view_.forward);
            if (!(depth > view_.nearPlane) || view_.isBeside(middle, radius)) continue;
            const glm::dvec3 sight = view_.isOrthographic ? view_.forward : glm::normalize(middle), along = b - a;
            const double length = glm::length(along), perPixel = view_.focal / (view_.isOrthographic ? 1 : depth);
            if (!(length > 0)) continue;
            const double sine = glm::length(glm::cross(along / length, sight));
            double half = radius * perPixel;
            if (s.a.positionZ >> 31 == 0) {  // a ribbon: what is seen of it depends on how it faces the eye
                const glm::dvec3 across =
                    glm::dvec3(shared::octDecode(s.a.direction)) + glm::dvec3(shared::octDecode(s.b.direction));
                const glm::dvec3 n = glm::cross(along, across);
                const double size = glm::length(n);
                half *= size > 0 ? std::min(std::abs(glm::dot(n, sight)) / (size * std::max(sine, 1e-3)), 1.0) : 1.0;
            }
            const double area = 2 * half * length * sine * perPixel;
            shares_.curveArea += area;
            if (half < double{shared::kNarrow})
                shares_.narrowArea += area;
            else if (radius <= thin)
                shares_.thinnedArea += area;
        }
    }

  private:
    const lod::Hierarchy& h_;
    lod::LocalView view_;
    PrunedShares& shares_;
};

}  // namespace

Result<PrunedShares> measurePruning(const FrameState& state, const lod::View& view) {
    PrunedShares shares;
    for (const lod::CutDraw& draw : state.cut.draw) {
        const lod::Instance& instance = state.instances[draw.instance];
        const lod::Hierarchy& h = *state.hierarchies[instance.hierarchy];
        if (h.isStochastic) shares.discs += draw.count;
        if (lod::kindOf(h, draw.chunk) != lod::Kind::curves) continue;
        STIPPLE_ASSIGN(const lod::Chunk chunk, lod::readChunk(*state.stores[instance.hierarchy], draw.chunk));
        CurvePruning(h, instance, view, shares).add(draw, chunk);
    }
    return shares;
}

}  // namespace stipple::render
