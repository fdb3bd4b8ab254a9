#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "engine/base/numbers.h"
#include "lod/import/curves/curve_readers.h"

namespace stipple::lod {

// Header of 128 bytes, then the arrays that its bits announce: segments of each curve, points, thickness,
// transparency, colours.
Result<void> readHair(const std::function<Cursor(uint64_t)>& open, const std::string& path,
                      const CurveSource::Take& take) {
    struct Header {
        char magic[4];
        uint32_t curves, points, arrays, segments;
        float thickness, transparency, colour[3];
        char info[88];
    } head{};
    static_assert(sizeof(Header) == 128);
    Cursor begin = open(0);
    const uint64_t size = begin.remaining();
    STIPPLE_ASSIGN(const bool hasHead, begin.take(head));
    if (!hasHead || std::memcmp(head.magic, "HAIR", 4) != 0)
        return fail(ErrorKind::input, "is no hair file: the header of 128 bytes that begins with HAIR is missing",
                    path);
    enum : uint32_t { kSegments = 1, kPoints = 2, kThickness = 4, kTransparency = 8, kColours = 16 };
    const auto bytesOf = [&](uint32_t bit, uint64_t count, uint64_t each) {
        return (head.arrays & bit) != 0 ? count * each : 0;
    };
    const uint64_t needed = sizeof(head) + bytesOf(kSegments, head.curves, 2) + bytesOf(kPoints, head.points, 12) +
                            bytesOf(kThickness, head.points, 4) + bytesOf(kTransparency, head.points, 4) +
                            bytesOf(kColours, head.points, 12);
    if ((head.arrays & kPoints) == 0) return fail(ErrorKind::input, "holds no points", path);
    if (size < needed)
        return fail(ErrorKind::input,
                    fmt::format("{} curves of {} points need {} bytes; the file has {}", head.curves, head.points,
                                needed, size),
                    path, "it is not whole");
    uint64_t at = sizeof(head);
    const auto arrayOf = [&](uint32_t bit, uint64_t count, uint64_t bytes) {
        Cursor here = open(at);
        at += bytesOf(bit, count, bytes);
        return here;
    };
    const bool hasSegments = (head.arrays & kSegments) != 0, hasThickness = (head.arrays & kThickness) != 0,
               hasColours = (head.arrays & kColours) != 0;
    Cursor segments = arrayOf(kSegments, head.curves, 2), points = arrayOf(kPoints, head.points, 12),
           thickness = arrayOf(kThickness, head.points, 4);
    arrayOf(kTransparency, head.points, 4);
    Cursor colours = arrayOf(kColours, head.points, 12);
    constexpr uint32_t kBrown = 0x2a4a70;
    const bool hasOwn = head.colour[0] + head.colour[1] + head.colour[2] > 0;
    const uint32_t plain =
        hasOwn ? unitToByte(head.colour[0]) | unitToByte(head.colour[1]) << 8 | unitToByte(head.colour[2]) << 16
               : kBrown;
    constexpr size_t kBlock = 65536;
    CurveSet out;
    out.hasColour = hasColours || hasOwn;
    uint64_t next = 0, blocks = 0;
    for (uint32_t s = 0; s < head.curves; ++s) {
        uint16_t count = static_cast<uint16_t>(std::min(head.segments, 65535u));
        if (hasSegments) STIPPLE_TRY(segments.take(count));
        if (next + count + 1 > head.points)
            return fail(
                ErrorKind::input,
                fmt::format("curve {} of {} needs more than the {} points there are", s + 1, head.curves, head.points),
                path);
        for (uint32_t k = 0; k <= count; ++k, ++next) {  // (the size of the file was checked: all of it is there)
            std::array<float, 3> p{}, c{};
            float wide = head.thickness;
            STIPPLE_TRY(points.take(p));
            if (hasThickness) STIPPLE_TRY(thickness.take(wide));
            if (hasColours) STIPPLE_TRY(colours.take(c));
            out.addVertex({p[0], p[1], p[2]}, 0.5f * wide, glm::vec3(0),
                          hasColours ? unitToByte(c[0]) | unitToByte(c[1]) << 8 | unitToByte(c[2]) << 16 : plain);
        }
        out.endCurve(false);
        if (out.position.size() < kBlock) continue;
        STIPPLE_TRY(take(out));
        ++blocks;
        const bool hasColour = out.hasColour;
        out = {};
        out.hasColour = hasColour;
    }
    return out.curves() > 0 || blocks == 0 ? take(out) : Result<void>();
}

}  // namespace stipple::lod
