#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>

#include "engine/base/numbers.h"
#include "lod/import/curves/curve_readers.h"

namespace stipple::lod {
namespace {

template <typename T>
T valueAt(const std::vector<uint8_t>& bytes, size_t at) {
    T v;
    std::memcpy(&v, bytes.data() + at, sizeof(v));
    return v;
}

}  // namespace

// Header of 1000 bytes (TrackVis, version 2), then for each track its number of points, the points with their scalars,
// and its properties.
Result<void> readTrk(Cursor from, const std::string& path, const CurveSource::Take& take) {
    constexpr size_t kHeader = 1000, kBlock = 65536;
    size_t available = 0;
    STIPPLE_ASSIGN(const uint8_t* first, from.peek(kHeader, available));
    if (available < kHeader || std::memcmp(first, "TRACK", 5) != 0)
        return fail(ErrorKind::input, "is no TrackVis file: the header of 1000 bytes that begins with TRACK is missing",
                    path, "a .gz file has to be unpacked first");
    const std::vector<uint8_t> head(first, first + kHeader);
    if (valueAt<int32_t>(head, 996) != static_cast<int32_t>(kHeader))
        return fail(ErrorKind::input, "has another byte order than this machine", path);
    const int scalars = valueAt<int16_t>(head, 36), properties = valueAt<int16_t>(head, 238);
    if (scalars < 0 || properties < 0)
        return fail(ErrorKind::input, fmt::format("claims {} scalars and {} properties", scalars, properties), path);
    glm::dvec3 voxel(0);
    glm::dmat4 toWorld(1);
    for (int a = 0; a < 3; ++a) voxel[a] = double{valueAt<float>(head, 12 + 4 * static_cast<size_t>(a))};
    const bool hasMatrix = valueAt<float>(head, 440 + 60) != 0 && voxel.x > 0 && voxel.y > 0 && voxel.z > 0;
    for (int r = 0; hasMatrix && r < 4; ++r)
        for (int c = 0; c < 4; ++c)
            toWorld[c][r] = double{valueAt<float>(head, 440 + 4 * static_cast<size_t>(4 * r + c))};
    from.skip(kHeader);
    CurveSet out;
    out.hasColour = true;
    const size_t pointBytes = 4 * (3 + static_cast<size_t>(scalars)), rest = 4 * static_cast<size_t>(properties);
    uint64_t tracks = 0, blocks = 0;
    while (from.remaining() > 0) {
        const std::string where = fmt::format("track {}, at byte {}", ++tracks, from.offset());
        int32_t count = 0;
        STIPPLE_ASSIGN(const bool hasCount, from.take(count));
        if (!hasCount) return fail(ErrorKind::input, where + ": the file ends within it", path);
        const uint64_t left = from.remaining();
        if (count < 0 || left < rest || static_cast<uint64_t>(count) > (left - rest) / pointBytes)
            return fail(ErrorKind::input, fmt::format("{}: {} points do not fit into the file", where, count), path,
                        "it is not whole");
        const size_t begin = out.position.size();
        for (int32_t k = 0; k < count; ++k) {
            STIPPLE_ASSIGN(const uint8_t* bytes, from.peek(pointBytes, available));
            std::array<float, 3> q{};
            std::memcpy(q.data(), bytes, sizeof(q));
            glm::dvec3 p(q[0], q[1], q[2]);
            if (hasMatrix) p = glm::dvec3(toWorld * glm::dvec4(p / voxel - 0.5, 1));
            out.addVertex(p, 0, glm::vec3(0), 0);
            from.skip(pointBytes);
        }
        from.skipFar(rest);
        // Red, green and blue say how much a streamline runs along x, y and z.
        for (size_t i = begin; i < out.position.size(); ++i) {
            const glm::dvec3 d =
                out.position[std::min(i + 1, out.position.size() - 1)] - out.position[i > begin ? i - 1 : begin];
            const glm::dvec3 c = glm::length(d) > 0 ? glm::abs(glm::normalize(d)) : glm::dvec3(0.5);
            for (int a = 0; a < 3; ++a)
                out.colour[i] |= toWhole<uint32_t>(std::isfinite(c[a]) ? 40 + 215 * c[a] : 128) << (8 * a);
        }
        out.endCurve(false);
        if (out.position.size() < kBlock) continue;
        STIPPLE_TRY(take(out));
        ++blocks;
        out = {};
        out.hasColour = true;
    }
    return out.curves() > 0 || blocks == 0 ? take(out) : Result<void>();
}

}  // namespace stipple::lod
