// A function that is compiled twice, for processors with AVX2 and for all, and chosen when the program starts; the
// values are the same. Not under sanitizers, nor where the compiler cannot.
#pragma once

#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(__clang__)
#define STIPPLE_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define STIPPLE_WIDE
#endif
