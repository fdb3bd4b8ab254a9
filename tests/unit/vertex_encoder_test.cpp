// The bytes that stores hold are those of meshoptimizer's own encoder, and its decoder reads them.
#include "lod/store/vertex_encoder.h"

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>

#include "engine/base/rng.h"

namespace stipple::lod {
namespace {

/// Differences between records that need no, two, four and eight bits, some with exceptions, and groups that could go
/// either way.
std::vector<uint8_t> bytesOfKind(int kind, size_t count, size_t stride, Rng& rng) {
    std::vector<uint8_t> bytes(count * stride);
    for (size_t i = 0; i < bytes.size(); ++i) {
        const int before = i >= stride ? bytes[i - stride] : 0;
        const auto small = [&](size_t width) {
            return static_cast<int>(rng.below(width)) - static_cast<int>(width / 2);
        };
        const int any = static_cast<int>(rng.below(256));
        const int value = kind == 0   ? any
                          : kind == 1 ? static_cast<int>(i % stride * 7)
                          : kind == 2 ? before + small(3)
                          : kind == 3 ? (rng.below(8) == 0 ? any : before + small(3))
                          : kind == 4 ? (rng.below(6) == 0 ? any : before + small(15))
                                      : (i / stride / 16 % 2 == 0 ? before : before + small(5 + i % stride));
        bytes[i] = static_cast<uint8_t>(value);
    }
    return bytes;
}

TEST(VertexEncoder, WritesWhatTheLibraryWrites) {
    meshopt_encodeVertexVersion(0);
    Rng rng(3);
    std::vector<uint8_t> scratch;
    for (const size_t stride : {4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 64, 252, 256})
        for (const size_t count : {0, 1, 2, 15, 16, 17, 31, 255, 256, 257, 300, 512, 513, 1000, 5000})
            for (int kind = 0; kind < 6; ++kind) {
                const std::vector<uint8_t> records = bytesOfKind(kind, count, stride, rng);
                std::vector<uint8_t> theirs(meshopt_encodeVertexBufferBound(count, stride));
                theirs.resize(meshopt_encodeVertexBuffer(theirs.data(), theirs.size(), records.data(), count, stride));
                const std::span<const uint8_t> ours = encodeVertices(records.data(), count, stride, scratch);
                // (Later versions choose otherwise where two and four bits take as much.)
                if (MESHOPTIMIZER_VERSION < 230)
                    ASSERT_TRUE(std::equal(ours.begin(), ours.end(), theirs.begin(), theirs.end()))
                        << "stride " << stride << ", " << count << " records, kind " << kind;
                ASSERT_EQ(ours.size(), theirs.size());
                std::vector<uint8_t> back(records.size());
                ASSERT_EQ(meshopt_decodeVertexBuffer(back.data(), count, stride, ours.data(), ours.size()), 0);
                ASSERT_EQ(back, records);
            }
}

}  // namespace
}  // namespace stipple::lod
