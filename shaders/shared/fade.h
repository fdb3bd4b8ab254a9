// Exponentials and logarithms of multiplications alone, so that loops over them become SIMD and every backend has the
// same: 1 - exp(-x) without its cancellation, log2.
#ifndef STIPPLE_SHARED_FADE_H
#define STIPPLE_SHARED_FADE_H
#include "types.h"
SHARED_BEGIN

// Beyond, 1 - exp(-x) is 1 in fp32.
const float kFadeMost = 17.5f;
// (1 - exp(-u)) / u for 0 <= u <= 0.55: its series.
SHARED_FN float fadeSeries(float u) {
    return 1.0f +
           u * (-0.5f + u * (0.166666667f + u * (-0.0416666667f +
                                                 u * (0.00833333333f + u * (-0.00138888889f + u * 0.000198412698f)))));
}
// 1 - exp(-x) for x >= 0, to 1e-6 of its value however small x is: the series at x / 32, then five doublings, 1 - e^-2u
// = p (2 - p), which make no relative error larger.
SHARED_FN float fade(float x) {
    const float u = min(x, kFadeMost) * 0.03125f;
    float p = u * fadeSeries(u);
    p = p * (2.0f - p);
    p = p * (2.0f - p);
    p = p * (2.0f - p);
    p = p * (2.0f - p);
    return p * (2.0f - p);
}
// (1 - exp(-x)) / x for x >= 0: 1 at 0. The same doublings: of the quotient, each takes 1 - p / 2 of what it was.
SHARED_FN float fadeOver(float x) {
    const float u = min(x, kFadeMost) * 0.03125f;
    float over = fadeSeries(u);
    float p = u * over;
    over = over * (1.0f - 0.5f * p);
    p = p * (2.0f - p);
    over = over * (1.0f - 0.5f * p);
    p = p * (2.0f - p);
    over = over * (1.0f - 0.5f * p);
    p = p * (2.0f - p);
    over = over * (1.0f - 0.5f * p);
    p = p * (2.0f - p);
    over = over * (1.0f - 0.5f * p);
    return x > kFadeMost ? 1.0f / max(x, 1.0f) : over;
}

// log2 of a positive, normal number, to 2e-7 beside what fp32 rounds of the result: the exponent about sqrt(1/2), and
// the series of the inverse hyperbolic tangent.
SHARED_FN float log2Of(float d) {
    const int bits = int(floatBitsToUint(d));
    const int exponent = (bits - 0x3f3504f3) >> 23;
    const float m = uintBitsToFloat(uint(bits - exponent * 8388608));
    const float s = (m - 1.0f) / (m + 1.0f);
    const float s2 = s * s;
    return float(exponent) + s * (2.88539008f + s2 * (0.961796694f + s2 * (0.577078016f + s2 * 0.412198583f)));
}

// 2^x for |x| <= 120, to 2e-7 of its value beside what fp32 rounds of x: the series about the nearest whole number.
SHARED_FN float exp2Of(float x) {
    const float whole = floor(x + 0.5f);
    const float u = (x - whole) * 0.693147181f;
    const float part =
        1.0f +
        u * (1.0f + u * (0.5f + u * (0.166666667f + u * (0.0416666667f + u * (0.00833333333f + u * 0.00138888889f)))));
    return part * uintBitsToFloat(uint(int(whole) + 127) << 23);
}

SHARED_END
#endif
