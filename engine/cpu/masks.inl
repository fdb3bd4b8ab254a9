// Which of the texels of a group are something, and which keys side by side lie before others, a bit each; and
// values that are closed up by such bits, and opened up again. Loops that make one number of many lanes are what
// compilers make worst: GCC 12 moves each mask of AVX-512 to a general register and back. Included by kernels.inl.
constexpr uint32_t kWholeGroup = (1u << kTexelGroup) - 1u;

#if defined(__AVX512VL__)
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

#if defined(__AVX2__) && !defined(__AVX512VL__)
/// Of each set of eight lanes the numbers of those that are in it, a byte each, closed up. (BMI2 has instructions for
/// that, which take hundreds of cycles before Zen 3.)
struct ClosedUp {
    uint64_t of[256] = {};
    constexpr ClosedUp() {
        for (uint32_t set = 0; set < 256; ++set)
            for (uint32_t lane = 0, count = 0; lane < 8; ++lane)
                if ((set >> lane & 1u) != 0u) of[set] |= uint64_t{lane} << 8u * count++;
    }
};
constexpr ClosedUp kClosedUp;
/// Writes eight lanes, first those of the set.
[[gnu::always_inline]] inline void storeClosedUp(__m256i all, uint32_t set, uint32_t* to) {
    const __m256i from = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kClosedUp.of[set])));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(all, from));
}
#endif

/// Which of a group's keys, or of its first `lanes`, are those of something: a bit each.
#if defined(__AVX512VL__)
[[gnu::always_inline]] inline uint32_t shownBits(const uint64_t* keys, uint32_t lanes) {
    const __m512i none = _mm512_set1_epi64(static_cast<long long>(kNoKey));
    const uint32_t all = kWholeGroup >> (kTexelGroup - lanes);
    const auto low = static_cast<__mmask8>(all), high = static_cast<__mmask8>(all >> 8);
    return uint32_t{_mm512_mask_cmpneq_epi64_mask(low, _mm512_maskz_loadu_epi64(low, keys), none)} |
           uint32_t{_mm512_mask_cmpneq_epi64_mask(high, _mm512_maskz_loadu_epi64(high, keys + 8), none)} << 8;
}
#elif defined(__AVX2__)
[[gnu::always_inline]] inline uint32_t shownBits(const uint64_t* keys, uint32_t lanes) {
    const __m256i none = _mm256_set1_epi64x(static_cast<long long>(kNoKey));
    uint32_t bits = 0, i = 0;
    for (; i + 4 <= lanes; i += 4) {
        const __m256i four = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(keys + i));
        const int same = _mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpeq_epi64(four, none)));
        bits |= (static_cast<uint32_t>(same) ^ 15u) << i;
    }
    for (; i < lanes; ++i) bits |= (keys[i] != kNoKey ? 1u : 0u) << i;
    return bits;
}
#else
[[gnu::always_inline]] inline uint32_t shownBits(const uint64_t* keys, uint32_t lanes) {
    uint32_t bits = 0;
    for (uint32_t i = 0; i < lanes; ++i) bits |= (keys[i] != kNoKey ? 1u : 0u) << i;
    return bits;
}
#endif
/// Writes `first` + k for each k of a group that is in the set, and may write all of the group.
[[gnu::always_inline]] inline void storeNumbers(uint32_t set, uint32_t first, uint32_t* to) {
#if defined(__AVX512VL__)
    const __m512i all = _mm512_maskz_add_epi32(0xffff, _mm512_set1_epi32(static_cast<int>(first)),
                                               _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(static_cast<__mmask16>(set), all));
#else
    for (; set != 0u; set &= set - 1u) *to++ = first + uint32_t(__builtin_ctz(set));
#endif
}

/// Values that are closed up, each in its place of a group: those where the set has a bit, 0 in the others. All of the
/// group are written; up to a group is read.
#if defined(__AVX512VL__)
struct OpenGroup {
    __mmask16 there;
};
[[gnu::always_inline]] inline OpenGroup openGroup(uint32_t set) { return {static_cast<__mmask16>(set)}; }
template <typename T>
[[gnu::always_inline]] inline void openUp(OpenGroup s, const T* from, T* to) {
    _mm512_storeu_si512(to, _mm512_maskz_expand_epi32(s.there, _mm512_loadu_si512(from)));
}
#elif defined(__AVX2__)
/// Of each set of eight lanes: for those that are in it how many are before them, for others a negative number; a byte
/// each.
struct OpenPlaces {
    uint64_t of[256] = {};
    constexpr OpenPlaces() {
        for (uint32_t set = 0; set < 256; ++set)
            for (uint32_t lane = 0, count = 0; lane < 8; ++lane)
                of[set] |= uint64_t{(set >> lane & 1u) != 0u ? count++ : 0x80u} << 8u * lane;
    }
};
constexpr OpenPlaces kOpenPlaces;
struct OpenGroup {
    __m256i low, high;
    size_t ofLow;
};
[[gnu::always_inline]] inline OpenGroup openGroup(uint32_t set) {
    const auto of = [](uint32_t eight) {
        return _mm256_cvtepi8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kOpenPlaces.of[eight])));
    };
    return {of(set & 0xffu), of(set >> 8), size_t(__builtin_popcount(set & 0xffu))};
}
template <typename T>
[[gnu::always_inline]] inline void openUp(const OpenGroup& s, const T* from, T* to) {
    const auto eight = [](const T* of, __m256i places, T* out) {
        const __m256i read = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(of)),
                      all = _mm256_permutevar8x32_epi32(read, places);
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_andnot_si256(_mm256_srai_epi32(places, 31), all));
    };
    eight(from, s.low, to);
    eight(from + s.ofLow, s.high, to + 8);
}
#else
struct OpenGroup {
    uint32_t set;
};
[[gnu::always_inline]] inline OpenGroup openGroup(uint32_t set) { return {set}; }
template <typename T>
[[gnu::always_inline]] inline void openUp(OpenGroup s, const T* from, T* to) {
    for (uint32_t i = 0; i < kTexelGroup; ++i) to[i] = T{};
    for (uint32_t rest = s.set; rest != 0u; rest &= rest - 1u) to[__builtin_ctz(rest)] = *from++;
}
#endif

/// Writes `first` + k for each k < lanes (1 to 8) whose key is no less than `least`, closed up, and says how many they
/// are; all eight of `to` may be written. (Reads what other threads may be writing: either is right, if no key is torn.
/// It is assumed that lanes of 8 aligned bytes come whole.)
#if defined(__AVX512VL__) && !defined(__SANITIZE_THREAD__)
[[gnu::always_inline]] inline uint32_t keepFrom(const uint64_t* keys, uint32_t lanes, uint64_t least, uint32_t first,
                                                uint32_t* to) {
    const __mmask8 there = static_cast<__mmask8>(0xffu >> (8u - lanes));
    const __m512i read = _mm512_maskz_loadu_epi64(there, keys);
    const __mmask8 kept = _mm512_mask_cmpge_epu64_mask(there, read, _mm512_set1_epi64(static_cast<long long>(least)));
    const __m256i all = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(first)),
                                         _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_maskz_compress_epi32(kept, all));
    return static_cast<uint32_t>(__builtin_popcount(kept));
}
#elif defined(__AVX2__) && !defined(__SANITIZE_THREAD__)
[[gnu::always_inline]] inline uint32_t keepFrom(const uint64_t* keys, uint32_t lanes, uint64_t least, uint32_t first,
                                                uint32_t* to) {
    // (Compared as signed numbers: the upper bit is turned.)
    const __m256i upper = _mm256_set1_epi64x(static_cast<long long>(uint64_t{1} << 63)),
                  from = _mm256_xor_si256(_mm256_set1_epi64x(static_cast<long long>(least)), upper);
    uint32_t kept = 0;
    for (uint32_t k = 0; k < lanes; k += 4) {
        const __m256i there = _mm256_cmpgt_epi64(_mm256_set1_epi64x(static_cast<long long>(lanes - k)),
                                                 _mm256_setr_epi64x(0, 1, 2, 3));
        const __m256i read = _mm256_maskload_epi64(reinterpret_cast<const long long*>(keys + k), there);
        const __m256i isKept = _mm256_andnot_si256(_mm256_cmpgt_epi64(from, _mm256_xor_si256(read, upper)), there);
        kept |= static_cast<uint32_t>(_mm256_movemask_pd(_mm256_castsi256_pd(isKept))) << k;
    }
    const __m256i numbers = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(first)),
                                             _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    storeClosedUp(numbers, kept, to);
    return static_cast<uint32_t>(__builtin_popcount(kept));
}
#else
[[gnu::always_inline]] inline uint32_t keepFrom(const uint64_t* keys, uint32_t lanes, uint64_t least, uint32_t first,
                                                uint32_t* to) {
    uint32_t count = 0;
    for (uint32_t k = 0; k < lanes; ++k) {
        to[count] = first + k;
        count += __atomic_load_n(keys + k, __ATOMIC_RELAXED) >= least ? 1u : 0u;
    }
    return count;
}
#endif

/// A depth, as bits: nothing is there. No depth of a surface has them.
constexpr uint32_t kPassedBy = ~0u;

/// Which of up to 16 depths side by side lie before what their pixels show: a bit each.
#if defined(__AVX512VL__) && !defined(__SANITIZE_THREAD__)
[[gnu::always_inline]] inline uint32_t inFront(const uint64_t* keys, uint32_t lanes, const uint32_t* depth,
                                               uint64_t id) {
    uint32_t bits = 0;
    for (uint32_t first = 0; first < lanes; first += 8) {
        const uint32_t some = lanes - first < 8 ? lanes - first : 8;
        const __m256i d = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(depth + first));
        const auto there = static_cast<__mmask8>(
            (0xffu >> (8u - some)) & _mm256_cmpneq_epi32_mask(d, _mm256_set1_epi32(static_cast<int>(kPassedBy))));
        const __m512i bitsOfDepth = _mm512_maskz_cvtepu32_epi64(0xff, d),
                      key = _mm512_or_si512(_mm512_maskz_slli_epi64(0xff, bitsOfDepth, kDrawIdBits),
                                            _mm512_set1_epi64(static_cast<long long>(id)));
        const __m512i read = _mm512_maskz_loadu_epi64(there, keys + first);
        bits |= uint32_t{_mm512_mask_cmplt_epu64_mask(there, key, read)} << first;
    }
    return bits;
}
#elif defined(__AVX2__) && !defined(__SANITIZE_THREAD__)
[[gnu::always_inline]] inline uint32_t inFront(const uint64_t* keys, uint32_t lanes, const uint32_t* depth,
                                               uint64_t id) {
    // (Compared as signed numbers: the upper bit is turned.)
    const __m256i upper = _mm256_set1_epi64x(static_cast<long long>(uint64_t{1} << 63)),
                  ids = _mm256_xor_si256(_mm256_set1_epi64x(static_cast<long long>(id)), upper),
                  places = _mm256_setr_epi64x(0, 1, 2, 3);
    uint32_t bits = 0;
    for (uint32_t first = 0; first < lanes; first += 4) {
        const __m128i d = _mm_loadu_si128(reinterpret_cast<const __m128i*>(depth + first));
        const __m256i isSome = _mm256_andnot_si256(
            _mm256_cvtepi32_epi64(_mm_cmpeq_epi32(d, _mm_set1_epi32(static_cast<int>(kPassedBy)))),
            _mm256_cmpgt_epi64(_mm256_set1_epi64x(static_cast<long long>(lanes - first)), places));
        if (_mm256_testz_si256(isSome, isSome) != 0) continue;
        const __m256i key = _mm256_xor_si256(_mm256_slli_epi64(_mm256_cvtepu32_epi64(d), int(kDrawIdBits)), ids);
        const __m256i read = _mm256_maskload_epi64(reinterpret_cast<const long long*>(keys + first), isSome);
        const __m256i isBefore =
            _mm256_and_si256(_mm256_cmpgt_epi64(_mm256_xor_si256(read, upper), key), isSome);
        bits |= static_cast<uint32_t>(_mm256_movemask_pd(_mm256_castsi256_pd(isBefore))) << first;
    }
    return bits;
}
#else
[[gnu::always_inline]] inline uint32_t inFront(const uint64_t* keys, uint32_t lanes, const uint32_t* depth,
                                               uint64_t id) {
    uint32_t bits = 0;
    for (uint32_t k = 0; k < lanes; ++k) {
        const bool isBefore = visibilityKey(depth[k], id) < __atomic_load_n(keys + k, __ATOMIC_RELAXED);
        bits |= (depth[k] != kPassedBy && isBefore ? 1u : 0u) << k;
    }
    return bits;
}
#endif

/// Which records claim a pixel is as good as random: they are closed up without branches.
#if defined(__AVX512VL__)
void findClaims(const ProjectedBlock& block, uint32_t count, Claims& to) {
    const __m512i wide = _mm512_set1_epi32(static_cast<int>(kWidePixel));
    __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i += 16) {
        const auto there = static_cast<__mmask16>(count - i < 16 ? (1u << (count - i)) - 1u : 0xffffu);
        const __m512i pixel = _mm512_load_si512(block.pixel + i);
        const __mmask16 claims = _mm512_mask_cmplt_epu32_mask(there, pixel, wide);
        _mm512_storeu_si512(to.pixel + n, _mm512_maskz_compress_epi32(claims, pixel));
        _mm512_storeu_si512(to.depth + n, _mm512_maskz_compress_epi32(claims, _mm512_load_si512(block.depth + i)));
        _mm512_storeu_si512(to.lane + n, _mm512_maskz_compress_epi32(claims, lanes));
        lanes = _mm512_maskz_add_epi32(0xffff, lanes, _mm512_set1_epi32(16));
        n += static_cast<uint32_t>(__builtin_popcount(claims));
    }
    to.count = n;
    for (uint32_t k = 0; k < Claims::kAhead; ++k) to.pixel[n + k] = to.pixel[0];
}
#elif defined(__AVX2__)
void findClaims(const ProjectedBlock& block, uint32_t count, Claims& to) {
    const auto load = [](const uint32_t* v) { return _mm256_load_si256(reinterpret_cast<const __m256i*>(v)); };
    __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i += 8) {
        const uint32_t there = count - i < 8 ? (1u << (count - i)) - 1u : 0xffu;
        const __m256i pixel = load(block.pixel + i);
        // (What is no pixel has the upper bit.)
        const uint32_t claims = ~static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(pixel))) & there;
        storeClosedUp(pixel, claims, to.pixel + n);
        storeClosedUp(load(block.depth + i), claims, to.depth + n);
        storeClosedUp(lanes, claims, to.lane + n);
        lanes = _mm256_add_epi32(lanes, _mm256_set1_epi32(8));
        n += static_cast<uint32_t>(__builtin_popcount(claims));
    }
    to.count = n;
    for (uint32_t k = 0; k < Claims::kAhead; ++k) to.pixel[n + k] = to.pixel[0];
}
#else
void findClaims(const ProjectedBlock& block, uint32_t count, Claims& to) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        to.pixel[n] = block.pixel[i];
        to.depth[n] = block.depth[i];
        to.lane[n] = i;
        n += block.pixel[i] < kWidePixel ? 1u : 0u;
    }
    to.count = n;
    for (uint32_t k = 0; k < Claims::kAhead; ++k) to.pixel[n + k] = to.pixel[0];
}
#endif
