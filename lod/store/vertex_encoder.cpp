// Blocks of up to 256 records; of each block one byte of all records after the other, as differences from the record
// before, the sign last (zigzag); of those groups of 16, each with as many bits a byte as make it short:
//
//     header byte, { for each byte of a record: 2 bits a group, then the groups } for each block, first record
//
//     bits 0: all are zero    1: two bits a byte    2: four    3: eight
//     two and four bits: 3 and 15 mean that the byte follows behind the group
#include "lod/store/vertex_encoder.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "engine/base/check.h"

namespace stipple::lod {
namespace {

constexpr uint8_t kHeader = 0xa0;  ///< version 0
constexpr size_t kGroup = 16, kMostRecords = 256, kBlockBytes = 8192, kLeastTail = 32;

using GroupBytes [[gnu::vector_size(kGroup)]] = uint8_t;
using SignedGroupBytes [[gnu::vector_size(kGroup)]] = int8_t;

/// The same byte of each record of a block.
using BytePlane = std::array<uint8_t, kMostRecords>;

size_t recordsOfBlock(size_t stride) { return std::min(kBlockBytes / stride & ~(kGroup - 1), kMostRecords); }

/// Turns 16 rows of 16 bytes into columns: four times each row is put between the bytes of the one eight below.
void transpose(std::array<GroupBytes, kGroup>& rows) {
    for (int round = 0; round < 4; ++round) {
        std::array<GroupBytes, kGroup> next;
        for (size_t i = 0; i < kGroup / 2; ++i) {
            const GroupBytes a = rows[i], b = rows[i + kGroup / 2];
            next[2 * i] = __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
            next[2 * i + 1] =
                __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
        }
        rows = next;
    }
}

/// Differences of `count` records from `records`, of the bytes that begin at each: `width` of them, at most 16.
/// `before`: those of the record in front of the first.
void takePlanes(const uint8_t* records, size_t count, size_t stride, size_t width, GroupBytes before,
                std::array<BytePlane, kGroup>& planes) {
    for (size_t first = 0; first < count; first += kGroup) {
        std::array<GroupBytes, kGroup> rows{};
        const size_t here = std::min(kGroup, count - first);
        for (size_t r = 0; r < here; ++r) {
            GroupBytes row{};
            if (width == kGroup)
                std::memcpy(&row, records + (first + r) * stride, kGroup);
            else
                std::memcpy(&row, records + (first + r) * stride, width);
            const GroupBytes off = row - before;
            rows[r] = (off + off) ^ reinterpret_cast<GroupBytes>(reinterpret_cast<SignedGroupBytes>(off) < 0);
            before = row;
        }
        transpose(rows);
        for (size_t k = 0; k < width; ++k) std::memcpy(planes[k].data() + first, &rows[k], kGroup);
    }
}

/// How many of the bytes are at least `value`.
size_t countAtLeast(const GroupBytes& group, uint8_t value) {
    const GroupBytes ones = reinterpret_cast<GroupBytes>(group >= value) & 1;
    std::array<uint64_t, 2> halves{};
    std::memcpy(halves.data(), &ones, kGroup);
    return (halves[0] + halves[1]) * 0x0101010101010101u >> 56;
}

/// Eight bytes below 16, the first lowest, as four of two each, whose first is the upper half.
uint32_t byFours(uint64_t bytes) {
    uint64_t pairs = (bytes << 4 | bytes >> 8) & 0x00ff00ff00ff00ffu;
    pairs = (pairs | pairs >> 8) & 0x0000ffff0000ffffu;
    return static_cast<uint32_t>(pairs | pairs >> 16);
}
/// Eight bytes below 4 as two of four each.
uint16_t byTwos(uint64_t bytes) {
    const uint64_t pairs = (bytes << 2 | bytes >> 8) & 0x000f000f000f000fu,
                   fours = (pairs << 4 | pairs >> 16) & 0x000000ff000000ffu;
    return static_cast<uint16_t>(fours | fours >> 24);
}

/// Writes a group and returns what its header says.
uint8_t putGroup(const uint8_t* bytes, uint8_t*& to) {
    GroupBytes group;
    std::memcpy(&group, bytes, kGroup);
    std::array<uint64_t, 2> halves{};
    std::memcpy(halves.data(), bytes, kGroup);
    if ((halves[0] | halves[1]) == 0) return 0;
    const size_t withTwo = 4 + countAtLeast(group, 3), withFour = 8 + countAtLeast(group, 15);
    if (std::min(withTwo, withFour) >= kGroup) {
        std::memcpy(to, bytes, kGroup);
        to += kGroup;
        return 3;
    }
    const bool isTwo = withTwo <= withFour;
    const uint8_t most = isTwo ? 3 : 15;
    const GroupBytes capped = group < most ? group : GroupBytes{} + most;
    std::memcpy(halves.data(), &capped, kGroup);
    if (isTwo) {
        const std::array<uint16_t, 2> packed{byTwos(halves[0]), byTwos(halves[1])};
        std::memcpy(to, packed.data(), sizeof(packed));
        to += sizeof(packed);
    } else {
        const std::array<uint32_t, 2> packed{byFours(halves[0]), byFours(halves[1])};
        std::memcpy(to, packed.data(), sizeof(packed));
        to += sizeof(packed);
    }
    // (Written before it is known whether it counts: what comes next lies over it.)
    for (size_t i = 0; i < kGroup; ++i) {
        *to = bytes[i];
        to += bytes[i] >= most ? 1 : 0;
    }
    return isTwo ? 1 : 2;
}

uint8_t* putPlane(const BytePlane& plane, size_t count, uint8_t* to) {
    const size_t groups = (count + kGroup - 1) / kGroup;
    uint8_t* const headers = to;
    to += (groups + 3) / 4;
    std::fill(headers, to, uint8_t{0});
    for (size_t g = 0; g < groups; ++g)
        headers[g / 4] = static_cast<uint8_t>(headers[g / 4] | putGroup(plane.data() + g * kGroup, to) << g % 4 * 2);
    return to;
}

}  // namespace

std::span<const uint8_t> encodeVertices(const void* records, size_t count, size_t stride,
                                        std::vector<uint8_t>& scratch) {
    STIPPLE_CHECK(stride > 0 && stride <= 256 && stride % 4 == 0, "records are whole words, 256 bytes at most");
    // (A group is written to its end before it is known how long it is.)
    const size_t bound = meshopt_encodeVertexBufferBound(count, stride) + kGroup;
    if (scratch.size() < bound) scratch.resize(bound);
    uint8_t* to = scratch.data();
    *to++ = kHeader;
    const auto* const first = static_cast<const uint8_t*>(records);
    std::array<BytePlane, kGroup> planes;
    const size_t each = recordsOfBlock(stride);
    for (size_t begin = 0; begin < count; begin += each) {
        const size_t here = std::min(each, count - begin);
        for (size_t column = 0; column < stride; column += kGroup) {
            const size_t width = std::min(kGroup, stride - column);
            const uint8_t* const at = first + begin * stride + column;
            GroupBytes before{};
            std::memcpy(&before, begin == 0 ? at : at - stride, width);
            takePlanes(at, here, stride, width, before, planes);
            for (size_t k = 0; k < width; ++k) to = putPlane(planes[k], here, to);
        }
    }
    if (stride < kLeastTail) {
        std::memset(to, 0, kLeastTail - stride);
        to += kLeastTail - stride;
    }
    if (count > 0)
        std::memcpy(to, first, stride);
    else
        std::memset(to, 0, stride);
    to += stride;
    return std::span<const uint8_t>(scratch).first(static_cast<size_t>(to - scratch.data()));
}

}  // namespace stipple::lod
