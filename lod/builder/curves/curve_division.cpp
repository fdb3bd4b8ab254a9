// Pieces that grow: a piece is no longer than a quarter of the way to the nearest vertex. A cell with anything else in
// it that is divided on has that within its diagonal, so that the piece fits into its octants.
#include "lod/builder/curves/curve_division.h"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"

namespace stipple::lod {
namespace {

constexpr double kShareOfWay = 0.25;

TravellingPoint between(const CurvePoint& before, const CurvePoint& after, double u) {
    CurvePoint q = after;
    q.p = glm::mix(before.p, after.p, u);
    q.radius = static_cast<float>((1 - u) * before.radius + u * after.radius);
    const glm::vec3 d = glm::mix(before.direction, after.direction, static_cast<float>(u));
    q.direction = glm::length(d) > 1e-3f ? glm::normalize(d) : before.direction;
    q.colour = 0;
    for (uint32_t shift = 0; shift < 24; shift += 8)
        q.colour |= static_cast<uint32_t>(
                        std::lround((1 - u) * (before.colour >> shift & 255u) + u * (after.colour >> shift & 255u)))
                    << shift;
    return TravellingPoint(q);
}

}  // namespace

bool CurveDivision::isEmpty(const Place& cell, uint32_t up) const {
    const uint64_t last = (uint64_t{1} << (frame_.keyLevels - up)) - 1;
    for (uint64_t k = 0; k < 27; ++k) {
        const Place at{cell[0] + k % 3, cell[1] + k / 3 % 3, cell[2] + k / 9};  // one too far each
        if (std::any_of(at.begin(), at.end(), [&](uint64_t c) { return c == 0 || c > last + 1; })) continue;
        const Key first = mortonCode(at[0] - 1, at[1] - 1, at[2] - 1) << (3 * up), end = first + (Key{1} << (3 * up));
        const auto found = std::lower_bound(vertices_.begin(), vertices_.end(), first);
        if (found != vertices_.end() && *found < end) return false;
    }
    return true;
}

double CurveDivision::reachAt(const glm::dvec3& p) const {
    const uint32_t drop = frame_.rootLog2 - frame_.keyLevels;
    const auto whole = [](double v) { return toWhole<uint64_t>(std::max(std::floor(v), 0.0)); };
    const Place at{whole(p.x), whole(p.y), whole(p.z)};
    uint32_t up = 0;  // levels whose cells around `p` hold no vertex
    for (; up < frame_.keyLevels; ++up)
        if (!isEmpty({at[0] >> (drop + up), at[1] >> (drop + up), at[2] >> (drop + up)}, up)) break;
    return up > 0 ? frame_.cellSize(frame_.keyLevels - (up - 1)) : 0;
}

bool CurveDivision::divide(const TravellingPoint& a, const TravellingPoint& b,
                           std::vector<TravellingPoint>& ends) const {
    ends.clear();
    const CurvePoint before = a.point(), after = b.point();
    const double length = glm::length(after.p - before.p), shortest = longest(frame_.cellSize(frame_.keyLevels));
    const double even = std::max(1.0, std::ceil(length / shortest));
    if (even <= kMostEven) {
        const auto pieces = toWhole<uint32_t>(even);
        for (uint32_t k = 1; k < pieces; ++k) ends.push_back(between(before, after, static_cast<double>(k) / pieces));
    } else {
        for (double done = shortest; done < length;) {
            const double u = done / length;
            ends.push_back(between(before, after, u));
            const double way = std::min({reachAt(glm::mix(before.p, after.p, u)), done, length - done});
            done += std::max(shortest, kShareOfWay * way);
        }
    }
    ends.push_back(b);
    return even > kMostEven;
}

}  // namespace stipple::lod
