// The kernels of triangles of every instruction set against the scalar formulas of shaders/shared, value by
// value (see kernel_formula_test.cpp).
#include <array>
#include <vector>

#include "shaders/shared/pack.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using namespace test;

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

/// Grows a cluster until it lies all around the picture, and says which focal length brings it next to the guard.
float growAround(Rng& rng, Cluster& c, const FrameConstants& f) {
    const float grown = exp2(-14.0f) / glm::length(glm::vec3(c.mesh.axisX.x, c.mesh.axisX.y, c.mesh.axisX.z));
    for (vec3* axis : {&c.mesh.axisX, &c.mesh.axisY, &c.mesh.axisZ}) *axis = stretched(*axis, grown);
    c.mesh.base = {uniform(rng, -0.01f, 0.01f), uniform(rng, -0.01f, 0.01f), uniform(rng, 7, 9)};
    float widest = 0;
    for (uint32_t v = 0; v < kClusterVertices; ++v) {
        const vec3 p = placeOf(c, v);
        widest = std::max(widest, std::max(std::abs(p.x), std::abs(p.y)) / lensDepth(frameLens(f), p.z));
    }
    return 0.97f * kGuardPixels / widest;
}

/// Keys of triangles by the signs of three edges at each pixel's centre, in 64 bits.
struct ExactPicture {
    std::vector<uint64_t> keys;
    float farthestCorner = 0;
    size_t away = 0;
    std::array<size_t, 3> boxes{};  ///< up to 8 px wide of those below 40 px, wider of those, other

    /// Counts it by the ways in which it is filled.
    void count(const FrameConstants& f, const std::array<int64_t, 3>& x, const std::array<int64_t, 3>& y) {
        const auto [minX, maxX] = std::minmax_element(x.begin(), x.end());
        const auto [minY, maxY] = std::minmax_element(y.begin(), y.end());
        const auto size = [](int64_t least, int64_t most, int64_t pixels) {  // middles of pixels
            return std::min((most - 128) >> 8, pixels - 1) - std::max<int64_t>((least + 127) >> 8, 0) + 1;
        };
        const int64_t across = size(*minX, *maxX, f.width), down = size(*minY, *maxY, f.height);
        if (across <= 0 || down <= 0) return;
        const bool isSmall = *maxX - *minX < 40 * 256 && *maxY - *minY < 40 * 256;
        boxes.at(!isSmall ? 2 : across > 8 ? 1 : 0)++;
    }

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
        if ((c.vertices[corner[0]].surface & kSurfaceMasked) == 0u) count(f, x, y);
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
        SurfaceMaterial keepsAll{}, keepsNone{};
        keepsAll.alphaCutoff = -1;
        keepsNone.alpha = 1;
        keepsNone.alphaCutoff = 2;
        for (int round = 0; round < 12; ++round) {
            const bool isLarge = round >= 6, isMasked = round % 3 == 2;
            Cluster c = randomCluster(rng);
            f.focal = isLarge ? growAround(rng, c, f) : focal;
            for (MeshVertex& v : c.vertices) v.surface |= isMasked ? kSurfaceMasked : 0u;
            std::fill(keys.begin(), keys.end(), kNoKey);
            expected.keys.assign(pixels, kNoKey);
            std::fill(runs.begin(), runs.end(), uint8_t{0});
            large.clear();
            const cpu::Visibility visibility{keys.data(), runs.data()};
            if (isMasked) {
                k.rasterCluster(f, &keepsNone, c.block(), 256, sink, visibility);
                ASSERT_TRUE(std::all_of(keys.begin(), keys.end(), [](uint64_t key) { return key == kNoKey; }));
            }
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
        EXPECT_GT(expected.farthestCorner, 0.9f * kGuardPixels) << "what edges are made of needs more than 32 bits";
        for (const size_t n : expected.boxes) EXPECT_GT(n, 50u) << "of each way in which they are filled";
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
