// Which of the texels of a group are something: a bit each. Loops that make one number of many lanes are what compilers
// make worst: GCC 12 moves each mask of AVX-512 to a general register and back. Included by kernels.inl.
constexpr uint32_t kWholeGroup = (1u << kTexelGroup) - 1u;

#if defined(__AVX512F__)
struct GroupInts {
    __m512i all;
};
[[gnu::always_inline]] inline GroupInts groupInts(const float* v) { return {_mm512_loadu_si512(v)}; }
[[gnu::always_inline]] inline GroupInts largerOf(GroupInts a, GroupInts b) {
    return {_mm512_maskz_max_epi32(0xffff, a.all, b.all)};  // (_mm512_max_epi32 starts with what GCC 12 warns of)
}
[[gnu::always_inline]] inline bool isAnyAboveZero(GroupInts v) {
    return _mm512_cmpgt_epi32_mask(v.all, _mm512_setzero_si512()) != 0;
}
[[gnu::always_inline]] inline uint32_t equalBits(const DrawNode* const* v, const DrawNode* to) {
    const __m512i same = _mm512_set1_epi64(reinterpret_cast<long long>(to));
    return uint32_t{_mm512_cmpeq_epi64_mask(_mm512_loadu_si512(v), same)} |
           uint32_t{_mm512_cmpeq_epi64_mask(_mm512_loadu_si512(v + 8), same)} << 8;
}
#elif defined(__AVX2__)
struct GroupInts {
    __m256i low, high;
};
[[gnu::always_inline]] inline GroupInts groupInts(const float* v) {
    const auto* const at = reinterpret_cast<const __m256i*>(v);
    return {_mm256_loadu_si256(at), _mm256_loadu_si256(at + 1)};
}
[[gnu::always_inline]] inline GroupInts largerOf(GroupInts a, GroupInts b) {
    return {_mm256_max_epi32(a.low, b.low), _mm256_max_epi32(a.high, b.high)};
}
[[gnu::always_inline]] inline bool isAnyAboveZero(GroupInts v) {
    const __m256i most = _mm256_max_epi32(v.low, v.high);
    return _mm256_movemask_epi8(_mm256_cmpgt_epi32(most, _mm256_setzero_si256())) != 0;
}
[[gnu::always_inline]] inline uint32_t equalBits(const DrawNode* const* v, const DrawNode* to) {
    const __m256i same = _mm256_set1_epi64x(reinterpret_cast<long long>(to));
    uint32_t bits = 0;
    for (uint32_t i = 0; i < kTexelGroup; i += 4) {
        const __m256i four = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(v + i));
        bits |= static_cast<uint32_t>(_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpeq_epi64(four, same)))) << i;
    }
    return bits;
}
#elif defined(__SSE4_1__)
struct GroupInts {
    __m128i of[4];
};
[[gnu::always_inline]] inline GroupInts groupInts(const float* v) {
    const auto* const at = reinterpret_cast<const __m128i*>(v);
    return {{_mm_loadu_si128(at), _mm_loadu_si128(at + 1), _mm_loadu_si128(at + 2), _mm_loadu_si128(at + 3)}};
}
[[gnu::always_inline]] inline GroupInts largerOf(GroupInts a, GroupInts b) {
    return {{_mm_max_epi32(a.of[0], b.of[0]), _mm_max_epi32(a.of[1], b.of[1]), _mm_max_epi32(a.of[2], b.of[2]),
             _mm_max_epi32(a.of[3], b.of[3])}};
}
[[gnu::always_inline]] inline bool isAnyAboveZero(GroupInts v) {
    const __m128i most = _mm_max_epi32(_mm_max_epi32(v.of[0], v.of[1]), _mm_max_epi32(v.of[2], v.of[3]));
    return _mm_movemask_epi8(_mm_cmpgt_epi32(most, _mm_setzero_si128())) != 0;
}
[[gnu::always_inline]] inline uint32_t equalBits(const DrawNode* const* v, const DrawNode* to) {
    const __m128i same = _mm_set1_epi64x(reinterpret_cast<long long>(to));
    uint32_t bits = 0;
    for (uint32_t i = 0; i < kTexelGroup; i += 2) {
        const __m128i two = _mm_loadu_si128(reinterpret_cast<const __m128i*>(v + i));
        bits |= static_cast<uint32_t>(_mm_movemask_pd(_mm_castsi128_pd(_mm_cmpeq_epi64(two, same)))) << i;
    }
    return bits;
}
#else
struct GroupInts {
    int32_t of[kTexelGroup];
};
[[gnu::always_inline]] inline GroupInts groupInts(const float* v) {
    GroupInts g;
    __builtin_memcpy(g.of, v, sizeof g.of);
    return g;
}
[[gnu::always_inline]] inline GroupInts largerOf(GroupInts a, GroupInts b) {
    for (size_t i = 0; i < kTexelGroup; ++i) a.of[i] = a.of[i] < b.of[i] ? b.of[i] : a.of[i];
    return a;
}
[[gnu::always_inline]] inline bool isAnyAboveZero(GroupInts v) {
    int32_t any = 0;
    for (size_t i = 0; i < kTexelGroup; ++i) any |= v.of[i] > 0 ? 1 : 0;
    return any != 0;
}
[[gnu::always_inline]] inline uint32_t equalBits(const DrawNode* const* v, const DrawNode* to) {
    uint32_t bits = 0;
    for (uint32_t i = 0; i < kTexelGroup; ++i) bits |= (v[i] == to ? 1u : 0u) << i;
    return bits;
}
#endif

/// Not 0 where a value is above it. (As whole numbers: of comparisons of floats that are joined GCC makes no SIMD.)
[[gnu::always_inline]] inline int aboveZero(float value) {
    const int bits = __builtin_bit_cast(int, value);
    return bits > 0 ? bits : 0;
}
template <typename... Rest>
[[gnu::always_inline]] inline GroupInts largestOf(GroupInts first, Rest... rest) {
    ((first = largerOf(first, rest)), ...);
    return first;
}
/// Of the groups of kTexelGroup texels of a row, those in which one of the rows holds any: a bit each.
template <typename... Depths>
[[gnu::always_inline]] inline uint32_t groupsHeld(uint32_t n, const Depths* __restrict... depths) {
    uint32_t held = 0;
    const uint32_t whole = n / kTexelGroup;
    for (uint32_t group = 0; group < whole; ++group)
        held |= (isAnyAboveZero(largestOf(groupInts(depths + group * kTexelGroup)...)) ? 1u : 0u) << group;
    int rest = 0;
    for (size_t i = size_t{whole} * kTexelGroup; i < n; ++i) rest |= (aboveZero(depths[i]) | ...);
    return held | (rest != 0 ? 1u : 0u) << whole;
}
/// Of `groups`, those in which one of the values is above 0; others are not read.
[[gnu::always_inline]] inline uint32_t groupsHeldOf(uint32_t groups, uint32_t n, const float* __restrict values) {
    uint32_t held = 0;
    for (uint32_t rest = groups; rest != 0u; rest &= rest - 1u) {
        const auto group = uint32_t(__builtin_ctz(rest));
        const float* const first = values + group * kTexelGroup;
        const uint32_t count = n - group * kTexelGroup;
        int any = 0;
        if (count >= kTexelGroup)
            any = isAnyAboveZero(groupInts(first)) ? 1 : 0;
        else
            for (size_t i = 0; i < count; ++i) any |= aboveZero(first[i]);
        held |= (any != 0 ? 1u : 0u) << group;
    }
    return held;
}
/// Calls use(first, last) for groups side by side: what is the same for all texels is read once for all of them.
template <typename Use>
[[gnu::always_inline]] inline void forGroups(uint32_t groups, uint32_t n, const Use& use) {
    while (groups != 0u) {
        const auto first = uint32_t(__builtin_ctz(groups));
        const auto count = uint32_t(__builtin_ctz(~(groups >> first)));
        const uint32_t last = (first + count) * kTexelGroup;
        use(size_t{first} * kTexelGroup, size_t{last < n ? last : n});
        groups &= ~0u << (first + count);
    }
}
