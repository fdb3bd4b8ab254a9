#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "lod/build/strands/strand_work.h"
#include "lod/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

TravellingPoint::TravellingPoint(const StrandPoint& p) {
    const auto step = [](double v) {
        return static_cast<uint32_t>(std::clamp(std::floor(std::ldexp(v, kStepBits) + 0.5), 0.0, 4294967295.0));
    };
    x = step(p.p.x);
    y = step(p.p.y);
    z = step(p.p.z);
    radius = std::bit_cast<float>((std::bit_cast<uint32_t>(p.radius) + 0x80u) & ~0xffu);
    direction = roundedNormal<8>(p.direction);
    colour = p.colour;
}

StrandPoint TravellingPoint::point() const {
    StrandPoint p;
    p.p = glm::dvec3(x, y, z) / std::exp2(kStepBits);
    p.radius = radius;
    p.direction = shared::octDecode(direction);
    p.colour = colour;
    return p;
}

void StrandRuns::put(ByteWriter& to) const {
    constexpr size_t kStride = sizeof(TravellingPoint);
    std::vector<uint8_t> bytes(meshopt_encodeVertexBufferBound(points.size(), kStride));
    bytes.resize(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), points.data(), points.size(), kStride));
    to.put(runs);
    to.put(uint64_t{points.size()});
    to.put(bytes);
}

bool StrandRuns::get(ByteReader& from) {
    std::vector<StrandRun> more;
    uint64_t count = 0, sum = 0;
    std::vector<uint8_t> bytes;
    from.get(more);
    from.get(count);
    from.get(bytes);
    for (const StrandRun& run : more) sum += run.points;
    if (sum != count || count > bytes.size() * 256) return false;
    const size_t old = points.size();
    points.resize(old + count);
    runs.insert(runs.end(), more.begin(), more.end());
    return meshopt_decodeVertexBuffer(points.data() + old, count, sizeof(TravellingPoint), bytes.data(),
                                      bytes.size()) == 0;
}

}  // namespace stipple::lod
