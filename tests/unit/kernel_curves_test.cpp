// The kernels of ribbons and tubes of every instruction set against the scalar formulas of shaders/shared, value by
// value (see kernel_formula_test.cpp).
#include <array>
#include <tuple>
#include <vector>

#include "shaders/shared/pack.h"
#include "shaders/shared/shade.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using namespace test;

CurveSegment randomSegment(Rng& rng) {
    CurveSegment s;
    for (CurveVertex* v : {&s.a, &s.b}) {
        v->positionXY = wordOf(rng);
        v->positionZ = (wordOf(rng) & 0xffffu) | curveRadiusCode(uniform(rng, 0, 1) * uniform(rng, 0, 0.05)) << 16;
        v->direction = directionOf(rng);
        v->colour = wordOf(rng) & 0xffffffu;
    }
    s.a.positionZ |= static_cast<uint32_t>(rng.below(2)) << 31;
    return s;
}
CameraSegment placed(const DrawNode& node, const CurveSegment& s) {
    const auto place = [&](const CurveVertex& v) {
        const auto x = static_cast<float>(v.positionXY & 0xffffu), y = static_cast<float>(v.positionXY >> 16),
                   z = static_cast<float>(v.positionZ & 0xffffu);
        return plus(plus(plus(node.base, stretched(node.axisX, x)), stretched(node.axisY, y)),
                    stretched(node.axisZ, z));
    };
    return {place(s.a),
            place(s.b),
            curveRadius(s.a, node.edge),
            curveRadius(s.b, node.edge),
            nodeDirection(node, octDecode(s.a.direction)),
            nodeDirection(node, octDecode(s.b.direction)),
            isTube(s) ? 1.0f : 0.0f};
}
/// Is a segment seen at a pixel, or just beside it?
bool isSeenAt(const FrameConstants& f, const CameraSegment& s, uint32_t x, uint32_t y) {
    const Lens lens = frameLens(f);
    const ScreenSegment on = projectSegment(s.a, s.b, lens, f.centre.x, f.centre.y, f.nearPlane);
    const float t = (static_cast<float>(y) + 0.5f - on.ya) / (on.yb - on.ya);
    const float wide = std::max(s.radiusA, s.radiusB) * f.focal / lensDepth(lens, std::min(on.za, on.zb)) + 1;
    return on.isThere > 0.5f && t >= 0 && t <= 1 &&
           std::abs(on.xa + t * (on.xb - on.xa) - static_cast<float>(x) - 0.5f) <= wide;
}
/// What a pixel of the row from x0 on shows of a segment. `isFilledHere`: is it filled, `isMet`: does its ray meet it?
Texel texelOf(const FrameConstants& f, const DrawNode& node, const CurveSegment& packed, uint32_t x0, uint32_t i,
              uint32_t y, bool& isFilledHere, bool& isMet) {
    const Lens lens = frameLens(f);
    const CameraSegment s = placed(node, packed);
    const float first = f.centre.x - float(x0) - 0.5f, cx = first - float(i), cy = f.centre.y - float(y) - 0.5f;
    const ScreenSegment on = projectSegment(s.a, s.b, lens, cx, cy, f.nearPlane);
    const CurvePixel seen = curvePixel(s, on, f.supportScale, lens, cx, cy, f.nearPlane, f.sunDirection);
    Texel t = seen.texel;
    float place = seen.place;
    isFilledHere = isFilled(s, on, lens, f.exactCurves) > 0.5f;
    isMet = false;
    if (isFilledHere) {
        const PixelRay ray = pixelRay(lens, -first / f.focal + float(i) * (1.0f / f.focal), -cy / f.focal);
        const FilledPixel hit = isTube(packed) ? tubePixel(s, ray, f.nearPlane) : ribbonPixel(s, ray, f.nearPlane);
        isMet = hit.depth < kNoDepth;
        place = hit.place;
        t.depth = isMet ? hit.depth : t.depth;
        t.radius = 0.25f;
        t.thickness = isTube(packed) ? 0.25f : kLeafThickness * 0.25f;
        t.offset = {0, 0};
        t.normalPerp = isMet ? hit.normalPerp : vec2(0.0f, 0.0f);
        t.isRound = 0;
        t.axis = {0, 0};
    }
    const auto mixed = [&](uint32_t shift) {
        const float a = linearFromByte(float(packed.a.colour >> shift & 255u) * (1.0f / 255.0f)),
                    b = linearFromByte(float(packed.b.colour >> shift & 255u) * (1.0f / 255.0f));
        return a + place * (b - a);
    };
    t.colour = {mixed(0), mixed(8), mixed(16)};
    return t;
}

/// Segments side by side in a row, each where it is seen; elsewhere formulas are extended beyond what they were made
/// for.
struct SeenRow {
    std::vector<CurveSegment> shown;
    std::vector<uint64_t> keys;
    uint32_t x0, y;

    SeenRow(Rng& rng, const FrameConstants& f, const DrawNode& node, const std::vector<CurveSegment>& segments,
            uint32_t length)
        : x0(128 * static_cast<uint32_t>(rng.below(4))), y(static_cast<uint32_t>(rng.below(f.height))) {
        for (uint32_t i = 0; i < cpu::kTile; ++i) {
            uint64_t key = kNoKey;
            shown.emplace_back();
            for (uint32_t lane = 0; lane < kSegmentsPerBlock && key == kNoKey; ++lane) {
                const uint32_t at = (lane + 37 * (i / length)) % kSegmentsPerBlock;  // some in a row the same
                if (!isSeenAt(f, placed(node, segments[at]), x0 + i, y)) continue;
                shown.back() = segments[at];
                key = visibilityKey(floatBitsToUint(5.0f), drawId(f.firstBlock.of[kKindCurves], at));
            }
            keys.push_back(key);
        }
    }
    bool isEmpty() const {
        return std::all_of(keys.begin(), keys.end(), [](uint64_t key) { return key == kNoKey; });
    }
    /// Pixels that show what nine before them show.
    size_t longRuns() const {
        size_t count = 0;
        for (uint32_t i = 9; i < cpu::kTile; ++i)
            count +=
                keys[i] != kNoKey && std::all_of(&keys[i - 9], &keys[i], [&](uint64_t key) { return key == keys[i]; })
                    ? 1
                    : 0;
        return count;
    }
};

/// How far a texel's colour is from one of a debug view, sRGB bytes.
double bytesFrom(const vec3& expected, const cpu::TexelRow& row, size_t at) {
    double worst = 0;
    for (const auto& [a, b] :
         {std::pair{row.red[at], expected.x}, {row.green[at], expected.y}, {row.blue[at], expected.z}})
        worst = std::max(worst, 255.0 * std::abs(double{srgbFromLinear(a)} - double{srgbFromLinear(b)}));
    return worst;
}

TEST(KernelFormulas, TexelsOfCurvesAreThoseOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& plain) {
        FrameConstants f = withRanges(plain);
        Rng rng(7);
        std::vector<CurveSegment> segments(kSegmentsPerBlock);
        double worst = 0, worstDebug = 0;
        std::array<size_t, 4> seen{};  // lines and filled, each of ribbons and tubes
        std::array<size_t, 2> rows{};  // without and with tubes to be reconstructed
        size_t passedBy = 0, longRuns = 0, debug = 0;
        for (int round = 0; round < 300; ++round) {
            DrawNode node = randomNode(rng);
            node.level = static_cast<uint32_t>(rng.below(8));
            node.errorPixels = uniform(rng, 0.1, 8);
            f.debugView = round % 10 == 4 ? kDebugLevel : round % 10 == 9 ? kDebugError : kDebugNone;
            for (CurveSegment& s : segments) s = randomSegment(rng);
            const SeenRow shows(rng, f, node, segments, 1 + static_cast<uint32_t>(round) % 20);
            if (shows.isEmpty()) continue;
            longRuns += shows.longRuns();
            Resolved r;
            r.keys = shows.keys;
            const cpu::CurveBlock block{segments.data(), &node};
            cpu::ResolveInput in{};
            in.curveBlocks = &block;
            ASSERT_NO_FATAL_FAILURE(r.resolve(k, f, in, shows.x0, shows.y));
            bool hasTubes = false;
            float largest = 0;
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                if (shows.keys[i] == kNoKey) continue;
                bool isFilledHere = false, isMet = false;
                Texel t = texelOf(f, node, shows.shown[i], shows.x0, i, shows.y, isFilledHere, isMet);
                const size_t at = cpu::kPad + i;
                if (isFilledHere && !isMet) {  // where the ray passes by
                    t.depth = keyDepth(shows.keys[i]);
                    ++passedBy;
                }
                if (f.debugView != kDebugNone) {
                    worstDebug =
                        std::max(worstDebug, bytesFrom(f.debugView == kDebugLevel ? debugLevelColour(node.level)
                                                                                  : debugErrorColour(node.errorPixels),
                                                       *r.row, at));
                    t.colour = {r.row->red[at], r.row->green[at], r.row->blue[at]};
                    ++debug;
                }
                seen.at((isTube(shows.shown[i]) ? 2u : 0u) + (isFilledHere ? 1u : 0u))++;
                hasTubes = hasTubes || (!isFilledHere && (t.isRound > 0 || t.axis.x > kAllRibbon));
                largest = std::max(largest, t.radius);
                worst = std::max({worst, farthest(*r.row, at, t), ulpsBetween(r.row->isRound[at], t.isRound),
                                  ulpsBetween(r.row->axisX[at], t.axis.x), ulpsBetween(r.row->axisY[at], t.axis.y)});
            }
            EXPECT_EQ(r.row->hasTubes, hasTubes);
            EXPECT_EQ(r.largest, largest);
            rows.at(hasTubes ? 1 : 0)++;
        }
        EXPECT_EQ(worst, 0) << "the formulas themselves, without fused multiplications";
        EXPECT_LE(worstDebug, 0.51) << "the nearest byte";
        for (const size_t n : seen) EXPECT_GT(n, 20u);
        for (const size_t n : rows) EXPECT_GT(n, 2u);
        EXPECT_GT(passedBy, 20u);
        EXPECT_GT(debug, 100u);
        EXPECT_GT(longRuns, 20u) << "of more than nine pixels";
    });
}

/// Segments so wide that they are filled, some of them a hair before others.
std::vector<CurveSegment> filledSegments(Rng& rng, const FrameConstants& f, const DrawNode& node) {
    const Lens lens = frameLens(f);
    std::vector<CurveSegment> segments;
    while (segments.size() < kSegmentsPerBlock) {
        CurveSegment s = randomSegment(rng);
        for (CurveVertex* v : {&s.a, &s.b})
            v->positionZ = (v->positionZ & 0x8000ffffu) | curveRadiusCode(uniform(rng, 0.001, 0.1)) << 16;
        const CameraSegment c = placed(node, s);
        if (isFilled(c, projectSegment(c.a, c.b, lens, f.centre.x, f.centre.y, f.nearPlane), lens, f.exactCurves) <
            0.5f)
            continue;
        segments.push_back(s);
        if (rng.below(4) != 0 || segments.size() == kSegmentsPerBlock) continue;
        s.a.positionZ ^= static_cast<uint32_t>(rng.below(4));
        s.b.positionXY ^= static_cast<uint32_t>(rng.below(4));
        s.a.positionZ ^= static_cast<uint32_t>(rng.below(2)) << 31;
        segments.push_back(s);
    }
    return segments;
}
/// Where the ray of a pixel meets a filled curve, kNoDepth if it does not.
float filledDepth(const FrameConstants& f, const CameraSegment& s, uint32_t x, uint32_t y) {
    const PixelRay ray = pixelRay(frameLens(f), (static_cast<float>(x) + 0.5f - f.centre.x) * (1.0f / f.focal),
                                  (static_cast<float>(y) + 0.5f - f.centre.y) * (1.0f / f.focal));
    if (s.isRound > 0.5f) {
        const Tube tube = tubeOf(s.a, s.b, s.radiusA, s.radiusB);
        return tubeHit(tube, ray, f.nearPlane, isBeforeEye(tube, f.nearPlane) && isShort(tube)).depth;
    }
    const Ribbon ribbon = ribbonOf(s.a, s.b, s.directionA, s.directionB, s.radiusA, s.radiusB);
    return ribbonHit(ribbon, ray, f.nearPlane, kRibbonSlack).depth;
}

// Whichever rows, columns and pixels behind others were left out: what is left is what every ray on its own meets
// first.
TEST(KernelFormulas, PixelsOfFilledCurvesAreThoseOfTheirRays) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& plain) {
        FrameConstants f = withRanges(plain);
        f.width = 190;  // more pixels than the largest curve that one thread fills
        f.height = 130;
        f.focal *= f.orthographic != 0 ? 2.0f : 0.25f;
        f.centre = {94.6f, 65.2f};
        Rng rng(9);
        const size_t pixels = size_t{f.width} * f.height;
        std::vector<uint64_t> keys(pixels);
        std::vector<uint8_t> runs(pixels / cpu::Visibility::kRun + 1);
        std::vector<cpu::FilledCurve> wide;
        const cpu::WideSink sink{&wide, [](void* to, const cpu::FilledCurve& s) {
                                     static_cast<std::vector<cpu::FilledCurve>*>(to)->push_back(s);
                                 }};
        size_t covered = 0, unequal = 0, around = 0;
        std::array<size_t, 2> shared{};  // ribbons, tubes
        for (int round = 0; round < 4; ++round) {
            // A cell of length 1 round a place before the eye, at first round the eye itself.
            DrawNode node = randomNode(rng);
            vec3 corner = {uniform(rng, -1, 1), uniform(rng, -1, 1), round == 0 ? 0.0f : uniform(rng, 1, 3)};
            for (vec3* axis : {&node.axisX, &node.axisY, &node.axisZ}) {
                *axis = stretched(*axis, 1 / node.edge);
                corner = minus(corner, stretched(*axis, 32768));
            }
            node.base = corner;
            node.edge = 1;
            const std::vector<CurveSegment> segments = filledSegments(rng, f, node);
            std::fill(keys.begin(), keys.end(), kNoKey);
            std::fill(runs.begin(), runs.end(), uint8_t{0});
            wide.clear();
            const cpu::Visibility visibility{keys.data(), runs.data()};
            k.drawSegments(f, {segments.data(), &node}, kSegmentsPerBlock, 512, sink, visibility);
            // In bands, as threads share them out.
            for (uint32_t row = 0; row < f.height; row += 7)
                k.fillWide(f, wide.data(), wide.size(), row, std::min(row + 7, f.height) - 1, visibility);
            for (const cpu::FilledCurve& s : wide) shared.at(s.isRound ? 1 : 0)++;
            std::vector<CameraSegment> camera;
            for (const CurveSegment& s : segments) camera.push_back(placed(node, s));
            for (const CameraSegment& s : camera) around += s.a.z < f.nearPlane || s.b.z < f.nearPlane ? 1 : 0;
            for (uint32_t y = 0; y < f.height; ++y)
                for (uint32_t x = 0; x < f.width; ++x) {
                    uint64_t nearest = kNoKey;
                    for (uint32_t s = 0; s < kSegmentsPerBlock; ++s) {
                        const float depth = filledDepth(f, camera[s], x, y);
                        if (depth < kNoDepth)
                            nearest = std::min(nearest, visibilityKey(floatBitsToUint(depth),
                                                                      drawId(f.firstBlock.of[kKindCurves], 512 + s)));
                    }
                    const uint64_t key = keys[size_t{y} * f.width + x];
                    covered += nearest != kNoKey ? 1 : 0;
                    unequal += key != nearest ? 1 : 0;
                    if (key != kNoKey) {
                        EXPECT_EQ(runs[(size_t{y} * f.width + x) >> cpu::Visibility::kRunBits], 1);
                    }
                }
        }
        EXPECT_GT(covered, 12'000u);
        EXPECT_GT(around, 20u) << "that reach behind the eye";
        for (const size_t n : shared) EXPECT_GT(n, 0u) << "that are left to all threads";
        EXPECT_EQ(unequal, 0u) << "of " << covered;
    });
}

/// What a line or an end offers to a pixel.
struct Offer {
    size_t pixel;
    double depth, slack;  ///< slack: what rounding may be off
    uint32_t segment;
    bool isEnd;
    bool isSure;  ///< no rounding decides whether it is there, and at which pixel
};

/// What segments offer that are drawn as lines of one pixel's width, in fp64: to each column of pixels (row, of steep
/// ones) whose middle the axis passes the pixel where it does, and both ends theirs. Of narrower ones some, by chance.
struct ThinPicture {
    const FrameConstants& f;
    std::vector<Offer> offers;
    size_t along = 0, ends = 0;  ///< of one block

    struct End {
        double x, y, half;
        float linear, surface;  ///< of lineDepth
    };
    static double mixed(double a, double b, double place) { return a + place * (b - a); }

    void draw(const DrawNode& node, const CurveSegment& packed, uint32_t segment) {
        const Lens lens = frameLens(f);
        const CameraSegment s = placed(node, packed);
        const ScreenSegment on = projectSegment(s.a, s.b, lens, f.centre.x, f.centre.y, f.nearPlane);
        const auto end = [&](float place, float x, float y, float z, const vec3& direction) -> End {
            const vec3 c = plus(s.a, stretched(minus(s.b, s.a), place));
            const float radius = s.radiusA + place * (s.radiusB - s.radiusA);
            return {x, y, endHalfWidth(s, place, direction, lens, f.nearPlane), imageLinear(lens, z),
                    surfaceStep(lens, {c.x, c.y, std::max(c.z, f.nearPlane)}, segmentTangent(s), radius, s.isRound)};
        };
        const End a = end(on.from, on.xa, on.ya, on.za, s.directionA),
                  b = end(on.to, on.xb, on.yb, on.zb, s.directionB);
        const uint32_t rank = curveRank(packed);
        line(a, b, rank, segment);
        const double longer = std::max(std::abs(a.x - b.x), std::abs(a.y - b.y));
        for (const End* e : {&a, &b}) {
            // A disc as wide as the curve, less what the line has of it.
            const double disc = 3.14159265358979 * e->half * e->half * (1 - longer / (2 * e->half));
            ends += offer(*e, 0, 0, e->half < double{kNarrow} ? disc : 2, ~rank, segment, true) ? 1 : 0;
        }
    }
    void line(const End& a, const End& b, uint32_t rank, uint32_t segment) {
        const bool isSteep = std::abs(b.y - a.y) > std::abs(b.x - a.x);
        const auto u = [&](const End& e) { return isSteep ? e.y : e.x; };
        const End &from = u(b) < u(a) ? b : a, &to = u(b) < u(a) ? a : b;
        const double length = u(to) - u(from), tilt = (isSteep ? to.x - from.x : to.y - from.y) / length;
        const uint32_t pixels = isSteep ? f.height : f.width;
        for (uint32_t p = 0; p < pixels; ++p) {
            const double at = p + 0.5 - u(from), place = at / length;
            if (at < 0 || at >= length) continue;
            ++along;
            End e{mixed(from.x, to.x, place), mixed(from.y, to.y, place), mixed(from.half, to.half, place),
                  static_cast<float>(mixed(double{from.linear}, double{to.linear}, place)),
                  static_cast<float>(mixed(double{from.surface}, double{to.surface}, place))};
            const double largest = std::max(std::abs(double{from.linear}), std::abs(double{to.linear}));
            const double share = e.half < double{kNarrow} ? 2 * e.half * std::sqrt(1 + tilt * tilt) : 2;
            offer(e, 1e-3 + 1e-6 * at, 1e-6 * largest / std::abs(double{e.linear}), share, rank, segment, false);
        }
    }
    /// `margin`: by how much its place may be off, px; `slack`: its depth, relative. False: nothing is offered.
    bool offer(const End& e, double margin, double slack, double share, uint32_t rank, uint32_t segment, bool isEnd) {
        const double depth = double{lineDepth(frameLens(f), e.linear, e.surface, f.nearPlane)};
        const bool isPlain = std::floor(e.x - margin) == std::floor(e.x + margin) &&
                             std::floor(e.y - margin) == std::floor(e.y + margin) && std::abs(e.half - kNarrow) > 1e-4;
        bool isAny = false;
        for (const double y : {e.y - margin, e.y + margin})
            for (const double x : {e.x - margin, e.x + margin}) {
                if (!(x >= 0 && x < f.width && y >= 0 && y < f.height)) continue;
                const auto pixel = static_cast<uint32_t>(y) * f.width + static_cast<uint32_t>(x);
                const double chance = double{coverageThreshold(pixel, rank, f.coverageSeed)};
                if (chance >= share + 1e-4) continue;
                offers.push_back(
                    {pixel, depth, (1e-5 + slack) * depth, segment, isEnd, isPlain && std::abs(chance - share) > 1e-4});
                isAny = true;
            }
        return isAny;
    }
};

/// Segments so narrow that they are drawn as lines.
CurveSegment thinSegment(Rng& rng, const FrameConstants& f, const DrawNode& node) {
    const Lens lens = frameLens(f);
    for (;;) {
        CurveSegment s = randomSegment(rng);
        for (CurveVertex* v : {&s.a, &s.b}) {
            const double pixel = double{lensDepth(lens, node.base.z) / f.focal / node.edge};
            v->positionZ =
                (v->positionZ & 0x8000ffffu) | curveRadiusCode(static_cast<float>(pixel * rng.uniform(0.1, 2))) << 16;
        }
        s.a.colour |= static_cast<uint32_t>(rng.below(320) / 256 * 255) << 24;  // some are too coarse, ...
        s.b.colour |= static_cast<uint32_t>(rng.below(256)) << 24;              // ... of some octants
        const CameraSegment c = placed(node, s);
        const ScreenSegment on = projectSegment(c.a, c.b, lens, f.centre.x, f.centre.y, f.nearPlane);
        const float dx = std::abs(on.xa - on.xb), dy = std::abs(on.ya - on.yb);
        if (isFilled(c, on, lens, f.exactCurves) < 0.5f && std::abs(dx - dy) > 0.01f) return s;
    }
}

/// What is seen of thin curves, counted.
struct ThinCounts {
    size_t lines = 0, ends = 0, unsure = 0, wrong = 0;
    size_t lineFlushes = 0, endFlushes = 0, left = 0;

    /// Takes what was offered out of the keys; none may be left.
    void compare(std::vector<Offer>& offers, const FrameConstants& f, std::vector<uint64_t>& keys,
                 const std::vector<uint8_t>& runs) {
        std::sort(offers.begin(), offers.end(), [](const Offer& a, const Offer& b) {
            return std::tie(a.pixel, a.depth) < std::tie(b.pixel, b.depth);
        });
        for (auto first = offers.begin(); first != offers.end();) {
            const auto last =
                std::find_if(first, offers.end(), [&](const Offer& o) { return o.pixel != first->pixel; });
            uint64_t& key = keys[first->pixel];
            if (!std::all_of(first, last, [](const Offer& o) { return o.isSure; })) {
                ++unsure;
            } else {
                const uint64_t id = key & kDrawIdMask, base = drawId(f.firstBlock.of[kKindCurves], 512);
                const bool isOne = std::any_of(first, last, [&](const Offer& o) {
                    return base + o.segment == id && o.depth - o.slack <= first->depth + first->slack &&
                           std::abs(double{keyDepth(key)} - o.depth) <= o.slack;
                });
                wrong += isOne && runs[first->pixel >> cpu::Visibility::kRunBits] == 1 ? 0 : 1;
                (first->isEnd ? ends : lines)++;
            }
            key = kNoKey;
            first = last;
        }
        offers.clear();
        wrong +=
            static_cast<size_t>(std::count_if(keys.begin(), keys.end(), [](uint64_t key) { return key != kNoKey; }));
    }
};

// Lines are collected over segments, and offered 1,024 pixels and 256 ends at a time.
TEST(KernelFormulas, PixelsOfThinCurvesAreThoseOfTheirAxes) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& plain) {
        FrameConstants f = withRanges(plain);
        Rng rng(13);
        std::vector<uint64_t> keys(size_t{f.width} * f.height, kNoKey);
        const cpu::WideSink sink{nullptr, [](void*, const cpu::FilledCurve&) { ADD_FAILURE() << "none is filled"; }};
        ThinCounts counts;
        for (int round = 0; round < 24; ++round) {
            f.coverageSeed = static_cast<uint32_t>(round);
            const DrawNode node = randomNode(rng);
            std::vector<CurveSegment> segments;
            while (segments.size() < kSegmentsPerBlock) segments.push_back(thinSegment(rng, f, node));
            std::vector<uint8_t> runs(keys.size() / cpu::Visibility::kRun + 1);
            k.drawSegments(f, {segments.data(), &node}, kSegmentsPerBlock, 512, sink, {keys.data(), runs.data()});
            ThinPicture expected{f, {}};
            for (uint32_t s = 0; s < kSegmentsPerBlock; ++s) {
                const bool isFine = segmentErrorCode(segments[s]) <= node.errorCode ||
                                    (segmentOctants(segments[s]) & node.octantMask) != 0;
                if (isFine) expected.draw(node, segments[s], s);
                counts.left += isFine ? 0 : 1;
            }
            counts.lineFlushes += expected.along / 1024;
            counts.endFlushes += expected.ends / 256;
            counts.compare(expected.offers, f, keys, runs);
        }
        EXPECT_EQ(counts.wrong, 0u) << "of " << counts.lines << " of lines, " << counts.ends << " of ends";
        EXPECT_GT(counts.lines, 20'000u);
        EXPECT_GT(counts.ends, 500u);
        EXPECT_GT(counts.lineFlushes, 10u);
        EXPECT_GT(counts.endFlushes, 2u);
        EXPECT_GT(counts.left, 10u) << "that are not fine enough";
        EXPECT_LT(counts.unsure, counts.lines / 20);
    });
}

/// The place of a tube's axis that is nearest to a ray from the eye, 0 to 1, in fp64.
double placeBeside(const vec3& a, const vec3& b, const glm::dvec3& ray) {
    const glm::dvec3 from(a), d = glm::dvec3(b) - from, along = ray / glm::length(ray);
    const glm::dvec3 f = from - glm::dot(from, along) * along, g = d - glm::dot(d, along) * along;
    return std::clamp(-glm::dot(f, g) / glm::dot(g, g), 0.0, 1.0);
}

// Such pixels there are where rounding lets the ray of a texel pass by what that of a pixel has met.
TEST(KernelFormulas, WhereARayPassesATubeByItsPlaceIsBesideIt) {
    Rng rng(14);
    size_t inside = 0;
    for (int i = 0; i < 10'000; ++i) {
        const auto any = [&] { return vec3(uniform(rng, -2, 2), uniform(rng, -2, 2), uniform(rng, 4, 9)); };
        const vec3 a = any(), b = any();
        const float radius = uniform(rng, 0.001, 0.2), other = radius * uniform(rng, 0.5, 1);
        const vec3 on = plus(a, stretched(minus(b, a), uniform(rng, 0, 1)));
        const glm::dvec3 beside = glm::cross(glm::dvec3(on), glm::dvec3(minus(b, a)));
        const glm::dvec3 through = glm::dvec3(on) + 1.2 * double{radius} * glm::normalize(beside);
        const PixelRay ray = pixelRay(lensOf(1, false), static_cast<float>(through.x / through.z),
                                      static_cast<float>(through.y / through.z));
        const TubeHit hit = tubeHit(tubeOf(a, b, radius, other), ray, 0.01f, false);
        if (hit.depth < kNoDepth) continue;
        const double place = placeBeside(a, b, {ray.ex, ray.ey, 1.0});
        EXPECT_NEAR(hit.place, place, 1e-3);
        inside += place > 0.1 && place < 0.9 ? 1 : 0;
    }
    EXPECT_GT(inside, 5'000u);
}

}  // namespace
}  // namespace stipple
