#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/base/numbers.h"
#include "lod/builder/curves/curve_work.h"
#include "lod/builder/octree/packed.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

TravellingPoint::TravellingPoint(const CurvePoint& p) {
    constexpr double kLast = 0x1p53 - 1;
    static_assert(kPlaceBits == 53);
    const auto step = [kLast](double v) {
        return toWhole<uint64_t>(std::clamp(std::floor(std::ldexp(v, kStepBits) + 0.5), 0.0, kLast));
    };
    const Place place{step(p.p.x), step(p.p.y), step(p.p.z)};
    x = static_cast<uint32_t>(place[0]);
    y = static_cast<uint32_t>(place[1]);
    z = static_cast<uint32_t>(place[2]);
    high = highOf(place);
    radius = std::bit_cast<float>((std::bit_cast<uint32_t>(p.radius) + 0x80u) & ~0xffu);
    direction = roundedNormal<16>(p.direction);
    colour = p.colour;
}

CurvePoint TravellingPoint::point() const {
    CurvePoint p;
    const Place place = steps();
    p.p = glm::dvec3(place[0], place[1], place[2]) / std::exp2(kStepBits);
    p.radius = radius;
    p.direction = shared::octDecode(direction);
    p.colour = colour;
    return p;
}

namespace {

/// Places as steps along the curve, and back: the codec stores how a value differs
/// from the one before, and along a curve steps differ less than places.
void toSteps(const std::vector<CurveRun>& runs, size_t firstRun, std::vector<TravellingPoint>& points, size_t at,
             bool isBack) {
    std::array<uint32_t, 3> start{};
    for (size_t r = firstRun; r < runs.size(); ++r) {
        std::array<uint32_t, 3> last = start;
        for (uint32_t k = 0; k < runs[r].points; ++k, ++at) {
            const std::array<uint32_t*, 3> now{&points[at].x, &points[at].y, &points[at].z};
            for (size_t a = 0; a < 3; ++a) {
                const uint32_t place = isBack ? *now.at(a) + last.at(a) : *now.at(a);
                *now.at(a) = isBack ? place : place - last.at(a);
                last.at(a) = place;
            }
            if (k == 0) start = last;
        }
    }
}

}  // namespace

void CurveRuns::put(ByteWriter& to) const {
    putPacked(runs, to);
    std::vector<TravellingPoint> steps = points;
    toSteps(runs, 0, steps, 0, false);
    putPacked(steps, to);
}

bool CurveRuns::get(ByteReader& from) {
    const size_t oldRuns = runs.size(), oldPoints = points.size();
    if (!getPacked(from, runs) || !getPacked(from, points)) return false;
    uint64_t sum = 0;
    for (size_t r = oldRuns; r < runs.size(); ++r) sum += runs[r].points;
    if (sum != points.size() - oldPoints) return false;
    toSteps(runs, oldRuns, points, oldPoints, true);
    return true;
}

}  // namespace stipple::lod
