// The kernels of curves and triangles of every instruction set against the scalar formulas of shaders/shared, value by
// value (see kernel_formula_test.cpp).
#include <array>
#include <memory>
#include <vector>

#include "shaders/shared/pack.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using namespace test;

uint32_t wordOf(Rng& rng) { return static_cast<uint32_t>(rng.below(uint64_t{1} << 32)); }
/// Octahedral, of any direction.
uint32_t directionOf(Rng& rng) {
    return static_cast<uint32_t>(rng.below(65535)) | static_cast<uint32_t>(rng.below(65535)) << 16;
}

vec3 stretched(const vec3& v, float by) { return {v.x * by, v.y * by, v.z * by}; }
vec3 plus(const vec3& a, const vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
vec3 minus(const vec3& a, const vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

/// Blocks of all kinds have their ids in places of their own, so that a wrong range is seen.
FrameConstants withRanges(FrameConstants f) {
    f.firstBlock.of[kKindCurves] = 3;
    f.firstBlock.of[kKindTriangles] = 5;
    f.firstBlock.of[kKindPatches] = 9;  // none
    f.firstBlock.of[kKindDiscs] = 9;
    f.sunDirection = glm::normalize(glm::vec3(-0.45f, -0.55f, -0.7f));
    f.exactCurves = 2;
    return f;
}

/// A row of pixels of one kind, resolved.
struct Resolved {
    std::vector<uint64_t> keys;
    std::vector<uint32_t> surface = std::vector<uint32_t>(cpu::kTile);
    std::unique_ptr<cpu::TexelRow> row = std::make_unique<cpu::TexelRow>();

    void resolve(const cpu::Kernels& k, const FrameConstants& f, cpu::ResolveInput in, uint32_t x0, uint32_t y) {
        const cpu::Tables tables = cpu::makeTables();
        const std::array<cpu::ResolveKind, kKindNothing> none{};
        in.ofKind = none.data();
        row->hasTubes = true;
        float largest = 0;
        ASSERT_TRUE(k.resolveRow(f, tables, in, keys.data(), x0, y, static_cast<uint32_t>(keys.size()), *row, largest,
                                 {surface.data(), nullptr, nullptr, nullptr}));
    }
};

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

TEST(KernelFormulas, TexelsOfCurvesAreThoseOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, const FrameConstants& plain) {
        const FrameConstants f = withRanges(plain);
        Rng rng(7);
        std::vector<CurveSegment> segments(kSegmentsPerBlock);
        double worst = 0;
        std::array<size_t, 4> seen{};  // lines, filled and met, each of ribbons and tubes
        size_t passedBy = 0, longRuns = 0;
        for (int round = 0; round < 300; ++round) {
            const DrawNode node = randomNode(rng);
            for (CurveSegment& s : segments) s = randomSegment(rng);
            // A segment is resolved where it is seen; elsewhere formulas are extended beyond what they were made for.
            Resolved r;
            std::vector<CurveSegment> shown;
            const uint32_t y = static_cast<uint32_t>(rng.below(f.height)),
                           x0 = 128 * static_cast<uint32_t>(rng.below(4));
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                uint64_t key = kNoKey;
                shown.emplace_back();
                for (uint32_t lane = 0; lane < kSegmentsPerBlock && key == kNoKey; ++lane) {
                    const uint32_t at =
                        (lane + 37 * (i / (1 + round % 20))) % kSegmentsPerBlock;  // some in a row the same
                    if (!isSeenAt(f, placed(node, segments[at]), x0 + i, y)) continue;
                    shown.back() = segments[at];
                    key = visibilityKey(floatBitsToUint(5.0f), drawId(f.firstBlock.of[kKindCurves], at));
                }
                r.keys.push_back(key);
            }
            for (uint32_t i = 9; i < cpu::kTile; ++i)
                longRuns += r.keys[i] != kNoKey && std::all_of(&r.keys[i - 9], &r.keys[i],
                                                               [&](uint64_t key) { return key == r.keys[i]; })
                                ? 1
                                : 0;
            const std::vector<uint64_t> keys = r.keys;
            if (std::all_of(keys.begin(), keys.end(), [](uint64_t key) { return key == kNoKey; })) continue;
            const cpu::CurveBlock block{segments.data(), &node};
            cpu::ResolveInput in{};
            in.curveBlocks = &block;
            r.resolve(k, f, in, x0, y);
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                if (keys[i] == kNoKey) continue;
                bool isFilledHere = false, isMet = false;
                const Texel t = texelOf(f, node, shown[i], x0, i, y, isFilledHere, isMet);
                const size_t at = cpu::kPad + i;
                if (isFilledHere && !isMet) {  // where the ray passes by
                    worst = std::max(worst, ulpsBetween(r.row->depth[at], keyDepth(keys[i])));
                    ++passedBy;
                    continue;
                }
                seen.at((isTube(shown[i]) ? 2u : 0u) + (isFilledHere ? 1u : 0u))++;
                worst = std::max({worst, farthest(*r.row, at, t), ulpsBetween(r.row->isRound[at], t.isRound),
                                  ulpsBetween(r.row->axisX[at], t.axis.x), ulpsBetween(r.row->axisY[at], t.axis.y)});
            }
        }
        EXPECT_EQ(worst, 0) << "the formulas themselves, without fused multiplications";
        for (const size_t n : seen) EXPECT_GT(n, 20u);
        EXPECT_GT(passedBy, 20u);
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
        f.focal *= f.orthographic != 0 ? 1.0f : 0.25f;
        f.centre = {94.6f, 65.2f};
        Rng rng(9);
        const size_t pixels = size_t{f.width} * f.height;
        std::vector<uint64_t> keys(pixels);
        std::vector<uint8_t> runs(pixels / cpu::Visibility::kRun + 1);
        std::vector<cpu::FilledCurve> wide;
        const cpu::WideSink sink{&wide, [](void* to, const cpu::FilledCurve& s) {
                                     static_cast<std::vector<cpu::FilledCurve>*>(to)->push_back(s);
                                 }};
        size_t covered = 0, unequal = 0, around = 0, shared = 0;
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
            k.fillWide(f, wide.data(), wide.size(), 0, f.height - 1, visibility);
            shared += wide.size();
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
        if (f.orthographic == 0) EXPECT_GT(shared, 0u) << "that are left to all threads";
        EXPECT_EQ(unequal, 0u) << "of " << covered;
    });
}

/// A cluster of triangles of any shape, some of which turn away, before the eye.
struct Cluster {
    std::vector<MeshVertex> vertices;
    std::vector<uint32_t> triangles;
    DrawMesh mesh{};
    cpu::MeshBlock block() const {
        return {vertices.data(),
                triangles.data(),
                &mesh,
                nullptr,
                static_cast<uint32_t>(vertices.size() | triangles.size() << 16),
                0,
                0};
    }
};
Cluster randomCluster(Rng& rng) {
    const auto unit = [](const vec3& v) { return vec3(glm::normalize(glm::vec3(v.x, v.y, v.z))); };
    Cluster c;
    const DrawNode node = randomNode(rng);
    c.mesh.axisX = node.axisX;
    c.mesh.axisY = node.axisY;
    c.mesh.axisZ = node.axisZ;
    c.mesh.normalX = unit(node.axisX);
    c.mesh.normalY = unit(node.axisY);
    c.mesh.normalZ = unit(node.axisZ);
    c.mesh.base = node.base;
    c.mesh.eyeX = c.mesh.eyeY = c.mesh.eyeZ = 32768;
    c.mesh.mirror = 1;
    const auto sometimes = [&](uint32_t flag) { return rng.below(2) == 0 ? flag : 0u; };
    for (uint32_t v = 0; v < kClusterVertices; ++v) {
        const auto place = [&] { return static_cast<int>(rng.below(65536)); };
        const uint32_t surface = sometimes(kSurfaceTwoSided) | sometimes(kSurfaceFlat) | sometimes(kSurfaceUnlit);
        c.vertices.push_back({place(), place(), place(), directionOf(rng), wordOf(rng), uniform(rng, 0, 1),
                              uniform(rng, 0, 1), surface});
    }
    for (uint32_t t = 0; t < kClusterTriangles; ++t)
        c.triangles.push_back(static_cast<uint32_t>(rng.below(kClusterVertices) | rng.below(kClusterVertices) << 8 |
                                                    rng.below(kClusterVertices) << 16));
    return c;
}
vec3 placeOf(const Cluster& c, uint32_t vertex) {
    const MeshVertex& v = c.vertices[vertex];
    return meshPosition(v.x, v.y, v.z, c.mesh);
}

/// Grows a cluster until it lies all around the picture, and far beyond it.
void growAround(Rng& rng, Cluster& c) {
    const float grown = exp2(-14.0f) / glm::length(glm::vec3(c.mesh.axisX.x, c.mesh.axisX.y, c.mesh.axisX.z));
    for (vec3* axis : {&c.mesh.axisX, &c.mesh.axisY, &c.mesh.axisZ}) *axis = stretched(*axis, grown);
    c.mesh.base = {uniform(rng, -0.01f, 0.01f), uniform(rng, -0.01f, 0.01f), uniform(rng, 7, 9)};
}

/// Keys of triangles by the signs of three edges at each pixel's centre, in 64 bits.
struct ExactPicture {
    std::vector<uint64_t> keys;
    float farthestCorner = 0;
    size_t away = 0;

    void draw(const FrameConstants& f, const Cluster& c, uint32_t triangle, uint32_t place) {
        const uint32_t word = c.triangles[triangle];
        const std::array<uint32_t, 3> corner{word & 255u, word >> 8 & 255u, word >> 16 & 255u};
        const Lens lens = frameLens(f);
        std::array<int64_t, 3> x{}, y{};
        std::array<double, 3> linear{};
        for (size_t v = 0; v < 3; ++v) {
            const vec3 p = placeOf(c, corner.at(v));
            ASSERT_GT(p.z, f.nearPlane);
            const float scale = f.focal / lensDepth(lens, p.z);
            const float atX = p.x * scale + f.centre.x, atY = p.y * scale + f.centre.y;
            ASSERT_LT(std::max(std::abs(atX), std::abs(atY)), kGuardPixels) << "none is clipped";
            farthestCorner = std::max({farthestCorner, std::abs(atX), std::abs(atY)});
            x.at(v) = snapPixel(atX);
            y.at(v) = snapPixel(atY);
            linear.at(v) = imageLinear(lens, p.z);
        }
        const auto edge = [&](size_t a, size_t b, int64_t px, int64_t py) {
            return (x.at(b) - x.at(a)) * (py - y.at(a)) - (y.at(b) - y.at(a)) * (px - x.at(a));
        };
        int64_t area = edge(0, 1, x[2], y[2]);
        const bool isAway = area > 0 && (c.vertices[corner[0]].surface & kSurfaceTwoSided) == 0u;
        away += isAway ? 1 : 0;
        if (area == 0 || isAway) return;
        if (area < 0) {
            std::swap(x[1], x[2]);
            std::swap(y[1], y[2]);
            std::swap(linear[1], linear[2]);
            area = -area;
        }
        const auto inside = [&](size_t a, size_t b, int64_t w) {
            return w > 0 ||
                   (w == 0 && isTopLeft(static_cast<int>(x.at(b) - x.at(a)), static_cast<int>(y.at(b) - y.at(a))));
        };
        for (int64_t py = 0; py < f.height; ++py)
            for (int64_t px = 0; px < f.width; ++px) {
                const int64_t w0 = edge(1, 2, 256 * px + 128, 256 * py + 128),
                              w1 = edge(2, 0, 256 * px + 128, 256 * py + 128), w2 = area - w0 - w1;
                if (!inside(1, 2, w0) || !inside(2, 0, w1) || !inside(0, 1, w2)) continue;
                const double at = (double(w0) * linear[0] + double(w1) * linear[1] + double(w2) * linear[2]) /
                                  static_cast<double>(area);
                const auto depth = static_cast<float>(f.orthographic != 0 ? at : 1 / at);
                uint64_t& key = keys[static_cast<size_t>(py) * f.width + static_cast<size_t>(px)];
                key = std::min(key,
                               visibilityKey(floatBitsToUint(depth), drawId(f.firstBlock.of[kKindTriangles], place)));
            }
    }
};

TEST(KernelFormulas, PixelsOfTrianglesAreThoseOfExactEdges) {
    forKernels([](const cpu::Kernels& k, FrameConstants f) {
        f = withRanges(f);
        Rng rng(8);
        const size_t pixels = size_t{f.width} * f.height;
        std::vector<uint64_t> keys(pixels);
        ExactPicture expected;
        std::vector<uint8_t> runs(pixels / cpu::Visibility::kRun + 1);
        std::vector<cpu::LargeTriangle> large;
        const cpu::LargeSink sink{&large, [](void* to, const cpu::LargeTriangle& t) {
                                      static_cast<std::vector<cpu::LargeTriangle>*>(to)->push_back(t);
                                  }};
        double worst = 0;
        size_t covered = 0, other = 0, leftToAll = 0;
        const float focal = f.focal;
        SurfaceMaterial keepsAll{};
        keepsAll.alphaCutoff = -1;
        for (int round = 0; round < 12; ++round) {
            const bool isLarge = round >= 6, isMasked = round % 3 == 2;
            Cluster c = randomCluster(rng);
            if (isLarge) growAround(rng, c);
            f.focal = isLarge ? focal * 120.0f : focal;
            for (MeshVertex& v : c.vertices) v.surface |= isMasked ? kSurfaceMasked : 0u;
            std::fill(keys.begin(), keys.end(), kNoKey);
            expected.keys.assign(pixels, kNoKey);
            std::fill(runs.begin(), runs.end(), uint8_t{0});
            large.clear();
            const cpu::Visibility visibility{keys.data(), runs.data()};
            k.rasterCluster(f, &keepsAll, c.block(), 256, sink, visibility);
            // In bands, as threads share them out.
            for (uint32_t row = 0; row < f.height; row += 7)
                k.rasterLarge(f, large.data(), large.size(), row, std::min(row + 7, f.height) - 1, visibility);
            leftToAll += large.size();
            for (uint32_t t = 0; t < c.triangles.size(); ++t) ASSERT_NO_FATAL_FAILURE(expected.draw(f, c, t, 256 + t));
            for (size_t p = 0; p < pixels; ++p) {
                // Coverage is whole numbers: equal to the last pixel. Of equally near ones rounding picks one.
                const uint64_t exact = expected.keys[p];
                ASSERT_EQ(keys[p] == kNoKey, exact == kNoKey) << p % f.width << ", " << p / f.width;
                if (exact == kNoKey) continue;
                ASSERT_EQ(runs[p >> cpu::Visibility::kRunBits], 1);
                ++covered;
                other += (keys[p] & kDrawIdMask) != (exact & kDrawIdMask);
                worst = std::max(worst, ulpsBetween(keyDepth(keys[p]), keyDepth(exact)));
            }
        }
        EXPECT_LE(worst, 8) << "three products and their sum, against fp64";
        EXPECT_LE(other, covered / 2000);
        EXPECT_GT(covered, 10'000u);
        EXPECT_GT(expected.away, 20u);
        EXPECT_GT(leftToAll, 100u) << "that are left to all threads";
        EXPECT_GT(expected.farthestCorner, kGuardPixels / 4) << "what edges are made of needs more than 32 bits";
        // What clipTriangle leaves, twice: edges of 4 guards, and products of two of them.
        const double edge = 4.0 * double{kGuardPixels} * double{kSubpixel};
        EXPECT_LE(edge * edge, 0x1p52) << "doubles hold them exactly";
        RecordProperty("worst ulps of " + std::string(k.name), std::to_string(worst));
    });
}

/// What pixel (x0 + i, y) shows of a triangle.
Texel texelOf(const FrameConstants& f, const Cluster& c, const SurfaceMaterial& material, uint32_t triangle,
              uint32_t x0, uint32_t i, uint32_t y, float depth) {
    const uint32_t t = c.triangles[triangle];
    const std::array<uint32_t, 3> at{t & 255u, t >> 8 & 255u, t >> 16 & 255u};
    const vec3 a = placeOf(c, at[0]), e1 = minus(placeOf(c, at[1]), a), e2 = minus(placeOf(c, at[2]), a);
    const float inverse = 1.0f / f.focal;
    const PixelRay ray = pixelRay(frameLens(f), (float(i) - (f.centre.x - float(x0) - 0.5f)) * inverse,
                                  (float(y) + 0.5f - f.centre.y) * inverse);
    const vec2 w = triangleWeights(rayDirection(ray), fromRay(ray, a), fromRay(ray, placeOf(c, at[1])),
                                   fromRay(ray, placeOf(c, at[2])));
    const float first = 1.0f - w.x - w.y;
    const std::array<float, 3> weight{first, w.x, w.y};
    vec3 n(0.0f, 0.0f, 0.0f), colour(0.0f, 0.0f, 0.0f);
    for (size_t v = 0; v < 3; ++v) {
        const MeshVertex& vertex = c.vertices[at.at(v)];
        const vec3 own = octDecode(vertex.normal);
        const auto linear = [&](uint32_t shift) {
            return weight.at(v) * linearFromByte(float(vertex.colour >> shift & 255u) * (1.0f / 255.0f));
        };
        n = v == 0 ? stretched(own, weight.at(v)) : plus(n, stretched(own, weight.at(v)));
        const vec3 part(linear(0), linear(8), linear(16));
        colour = v == 0 ? part : plus(colour, part);
    }
    vec3 face(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
    const bool isFlat = (c.vertices[at[0]].surface & kSurfaceFlat) != 0u;
    const DrawMesh& m = c.mesh;
    const vec3 world = plus(plus(stretched(m.normalX, n.x), stretched(m.normalY, n.y)), stretched(m.normalZ, n.z));
    if (!isFlat) face = faceBeside(face, world);
    const vec3 normal = surfaceNormal(isFlat ? face : world, face, rayDirection(ray));
    const vec3 d = rayDirection(ray);
    const float inverseRay = 1.0f / std::sqrt(d.x * d.x + d.y * d.y + 1.0f);
    Texel expected{};
    expected.depth = depth;
    expected.radius = expected.thickness = kTriangleRadius;
    expected.normalPerp = perpFromNormal(normal, vec3(d.x * inverseRay, d.y * inverseRay, inverseRay));
    const vec3 base = material.baseColour;
    expected.colour = {base.x * colour.x, base.y * colour.y, base.z * colour.z};
    return expected;
}

TEST(KernelFormulas, TexelsOfTrianglesAreThoseOfTheFormulas) {
    forKernels([](const cpu::Kernels& k, FrameConstants f) {
        f = withRanges(f);
        Rng rng(9);
        double worst = 0;
        size_t seen = 0, flat = 0, longRuns = 0;
        for (int round = 0; round < 100; ++round) {
            const Cluster c = randomCluster(rng);
            SurfaceMaterial material{};
            material.baseColour = {uniform(rng, 0, 1), uniform(rng, 0, 1), uniform(rng, 0, 1)};
            material.metallic = uniform(rng, 0, 1);
            material.roughness = uniform(rng, 0, 1);
            Resolved r;
            std::vector<uint32_t> shown;
            const uint32_t y = static_cast<uint32_t>(rng.below(f.height)),
                           x0 = 128 * static_cast<uint32_t>(rng.below(4));
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                const bool isSame = i > 0 && rng.below(1 + static_cast<uint64_t>(round) % 20) != 0;
                shown.push_back(isSame ? shown.back() : static_cast<uint32_t>(rng.below(kClusterTriangles)));
                longRuns +=
                    i >= 9 && std::all_of(&shown[i - 9], &shown[i], [&](uint32_t t) { return t == shown[i]; }) ? 1 : 0;
                r.keys.push_back(
                    visibilityKey(floatBitsToUint(6.0f + float(i)), drawId(f.firstBlock.of[kKindTriangles], shown[i])));
            }
            const cpu::MeshBlock block = c.block();
            cpu::ResolveInput in{};
            in.meshBlocks = &block;
            in.materials = &material;
            r.resolve(k, f, in, x0, y);
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                const Texel expected = texelOf(f, c, material, shown[i], x0, i, y, 6.0f + float(i));
                worst = std::max(worst, farthest(*r.row, cpu::kPad + i, expected));
                const uint32_t surface = c.vertices[c.triangles[shown[i]] & 255u].surface;
                const auto byte = [](float v) { return static_cast<uint32_t>(v * 255.0f + 0.5f); };
                const uint32_t word = kPixelTriangle | ((surface & kSurfaceUnlit) != 0u ? kPixelUnlit : 0u) |
                                      byte(material.metallic) | byte(material.roughness) << 8 | 255u << 16;
                ASSERT_EQ(r.surface[i], word);
                ++seen;
                flat += (surface & kSurfaceFlat) != 0u ? 1 : 0;
            }
        }
        EXPECT_EQ(worst, 0) << "the formulas themselves, without fused multiplications";
        EXPECT_GT(seen, 10'000u);
        EXPECT_GT(flat, 1000u);
        EXPECT_GT(longRuns, 1000u) << "pixels of runs that are spread in two steps";
        RecordProperty("worst ulps of " + std::string(k.name), std::to_string(worst));
    });
}

}  // namespace
}  // namespace stipple
