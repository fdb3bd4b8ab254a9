// Pixels of a row that show the same: what it is is looked up once. Included by kernels.inl.

/// Runs of pixels of one id: places in the row's list, and behind the last of them where it ends.
struct PixelRuns {
    uint32_t count = 0;
    alignas(64) uint32_t first[kTile + 1];
};
void findRuns(const WinningPixels& p, PixelRuns& to) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < p.count; ++i) {
        to.first[count] = i;
        count += i == 0 || p.id[i] != p.id[i - 1] ? 1u : 0u;
    }
    to.first[count] = p.count;
    to.count = count;
}

constexpr size_t kSpread = 8;  ///< entries that are written at once: as many lie behind the last of an array
/// Entries of such an array: whole lines of 64 bytes, so that each of an array of them is aligned.
constexpr size_t kSpreadRow = (kTile + kSpread + 15) / 16 * 16;
/// `value` into the next of them. (Of a loop GCC makes eight stores.)
template <typename T>
[[gnu::always_inline]] inline void spread(T value, T* to) {
    typedef T Eight __attribute__((vector_size(kSpread * sizeof(T))));
    const Eight all = value - Eight{};  // (-0 may become 0, which is as good to all that read them)
    __builtin_memcpy(to, &all, sizeof all);
}
