#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "lod/import/strands/strand_readers.h"

namespace stipple::lod {

// Header of 128 bytes, then the arrays that its bits announce: segments of each strand, points, thickness,
// transparency, colours.
Result<StrandSet> readHair(const std::vector<uint8_t>& bytes, const std::string& path) {
    struct Header {
        char magic[4];
        uint32_t strands, points, arrays, segments;
        float thickness, transparency, colour[3];
        char info[88];
    } head{};
    static_assert(sizeof(Header) == 128);
    if (bytes.size() < sizeof(head) || std::memcmp(bytes.data(), "HAIR", 4) != 0)
        return fail(ErrorKind::input, "is no hair file: the header of 128 bytes that begins with HAIR is missing",
                    path);
    std::memcpy(&head, bytes.data(), sizeof(head));
    enum : uint32_t { kSegments = 1, kPoints = 2, kThickness = 4, kTransparency = 8, kColours = 16 };
    const auto bytesOf = [&](uint32_t bit, uint64_t count, uint64_t size) {
        return (head.arrays & bit) != 0 ? count * size : 0;
    };
    const uint64_t needed = sizeof(head) + bytesOf(kSegments, head.strands, 2) + bytesOf(kPoints, head.points, 12) +
                            bytesOf(kThickness, head.points, 4) + bytesOf(kTransparency, head.points, 4) +
                            bytesOf(kColours, head.points, 12);
    if ((head.arrays & kPoints) == 0) return fail(ErrorKind::input, "holds no points", path);
    if (bytes.size() < needed)
        return fail(ErrorKind::input,
                    fmt::format("{} strands of {} points need {} bytes; the file has {}", head.strands, head.points,
                                needed, bytes.size()),
                    path, "it is not whole");
    size_t at = sizeof(head);
    const auto take = [&](uint32_t bit, uint64_t count, uint64_t size) {
        const uint8_t* here = (head.arrays & bit) != 0 ? bytes.data() + at : nullptr;
        at += bytesOf(bit, count, size);
        return here;
    };
    const uint8_t *segments = take(kSegments, head.strands, 2), *points = take(kPoints, head.points, 12),
                  *thickness = take(kThickness, head.points, 4);
    take(kTransparency, head.points, 4);
    const uint8_t* colours = take(kColours, head.points, 12);
    const auto number = [](const uint8_t* from, size_t i) {
        float v = 0;
        std::memcpy(&v, from + 4 * i, 4);
        return v;
    };
    const auto byteOf = [](float v) {
        return static_cast<uint32_t>(std::clamp(v == v ? v : 0.0f, 0.0f, 1.0f) * 255.0f + 0.5f);
    };
    constexpr uint32_t kBrown = 0x2a4a70;
    StrandSet out;
    out.hasColour = colours != nullptr || head.colour[0] + head.colour[1] + head.colour[2] > 0;
    const uint32_t plain = head.colour[0] + head.colour[1] + head.colour[2] > 0
                               ? byteOf(head.colour[0]) | byteOf(head.colour[1]) << 8 | byteOf(head.colour[2]) << 16
                               : kBrown;
    uint64_t next = 0;
    for (uint32_t s = 0; s < head.strands; ++s) {
        uint16_t count = static_cast<uint16_t>(std::min(head.segments, 65535u));
        if (segments) std::memcpy(&count, segments + 2 * size_t{s}, 2);
        if (next + count + 1 > head.points)
            return fail(ErrorKind::input,
                        fmt::format("strand {} of {} needs more than the {} points there are", s + 1, head.strands,
                                    head.points),
                        path);
        for (uint32_t k = 0; k <= count; ++k, ++next) {
            const uint32_t c = colours
                                   ? byteOf(number(colours, 3 * next)) | byteOf(number(colours, 3 * next + 1)) << 8 |
                                         byteOf(number(colours, 3 * next + 2)) << 16
                                   : plain;
            out.addVertex({number(points, 3 * next), number(points, 3 * next + 1), number(points, 3 * next + 2)},
                          0.5f * (thickness ? number(thickness, next) : head.thickness), glm::vec3(0), c);
        }
        out.endStrand(false);
    }
    return out;
}

}  // namespace stipple::lod
