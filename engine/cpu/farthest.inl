// How far the farthest of a tile's pixels is (hidden_nodes.h). Included by kernels.inl, once per instruction set.

void farthestOf(const uint64_t* keys, size_t stride, uint32_t rows, uint32_t n, uint32_t* farthest) {
    constexpr uint32_t kEdge = 16, kOpen = uint32_t(kNoKey >> 32);
    alignas(64) uint32_t most[kTile];  // upper halves of keys: depth, and a bit of the id
    const uint32_t tiles = (n + kEdge - 1) / kEdge;
    for (size_t x = 0; x < kTile; ++x) most[x] = 0;
    for (uint32_t y = 0; y < rows; ++y) {
        const uint64_t* __restrict const row = keys + y * stride;
#pragma GCC ivdep
        for (size_t x = 0; x < n; ++x) {
            const auto upper = uint32_t(row[x] >> 32);
            most[x] = upper > most[x] ? upper : most[x];
        }
        if ((y & (y + 1)) != 0 && y + 1 != rows) continue;  // after 1, 2, 4, 8 rows, and all
        uint32_t nearest = kOpen;
        for (uint32_t t = 0; t < tiles; ++t) {
            uint32_t of = 0;
            for (size_t x = 0; x < kEdge; ++x) of = most[t * kEdge + x] > of ? most[t * kEdge + x] : of;
            farthest[t] = of >> 1;
            nearest = of < nearest ? of : nearest;
        }
        if (nearest == kOpen) return;  // all have an open pixel
    }
}
