#include "apps/grow/meshes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "apps/grow/noise.h"
#include "engine/base/process.h"

namespace stipple::grow {
namespace {

constexpr double kTerrainSize = 2000, kTerrainHeight = 260, kRockRadius = 1.5;

/// A grid of n x n cells over (u, v) in [0, 1]^2.
void addGrid(scene::Primitive& p, uint32_t nu, uint32_t nv,
             const std::function<void(double u, double v, glm::dvec3& position, glm::dvec2& uv)>& at,
             const std::function<glm::dvec3(double u, double v)>& normal) {
    const auto base = static_cast<uint32_t>(p.position.size());
    if (p.uv.empty()) p.uv.resize(1);
    for (uint32_t j = 0; j <= nv && !isStopRequested(); ++j)
        for (uint32_t i = 0; i <= nu; ++i) {
            const double u = double(i) / nu, v = double(j) / nv;
            glm::dvec3 x(0);
            glm::dvec2 uv(0);
            at(u, v, x, uv);
            p.position.emplace_back(x);
            p.normal.emplace_back(normal(u, v));
            p.uv[0].emplace_back(uv);
        }
    for (uint32_t j = 0; j < nv && !isStopRequested(); ++j)
        for (uint32_t i = 0; i < nu; ++i) {
            const uint32_t a = base + j * (nu + 1) + i, b = a + 1, c = a + nu + 1, d = c + 1;
            for (const uint32_t k : {a, b, d, a, d, c}) p.indices.push_back(k);
        }
}

double terrainHeight(const Noise& noise, double x, double z) {
    const double ridge = 1 - std::abs(2 * noise.fbm(x * 1.6, 3.1, z * 1.6, 5) - 1);
    const double rolling = noise.fbm(x * 5, 7.7, z * 5, 9);
    return kTerrainHeight * (0.62 * ridge * ridge + 0.38 * rolling);
}

scene::Primitive terrain(const MeshOptions& o) {
    scene::Primitive p;
    const Noise noise(o.seed);
    const auto n = std::max<uint32_t>(4, static_cast<uint32_t>(std::lround(std::sqrt(double(o.triangles) / 2))));
    const auto height = [&](double u, double v) { return terrainHeight(noise, u, v); };
    addGrid(
        p, n, n,
        [&](double u, double v, glm::dvec3& x, glm::dvec2& uv) {
            x = {(u - 0.5) * kTerrainSize, height(u, v), (0.5 - v) * kTerrainSize};
            uv = {u, 1 - v};
        },
        [&](double u, double v) {
            const double e = 0.5 / n;
            const double dx = (height(u + e, v) - height(u - e, v)) / (2 * e * kTerrainSize);
            const double dz = (height(u, v + e) - height(u, v - e)) / (2 * e * kTerrainSize);
            return glm::normalize(glm::dvec3(-dx, 1, dz));
        });
    return p;
}

/// Direction of (u, v) on face `f` of a cube, spread evenly.
glm::dvec3 cubeDirection(int f, double u, double v) {
    const double a = std::tan((u - 0.5) * 1.5707963267948966), b = std::tan((v - 0.5) * 1.5707963267948966);
    const std::array<glm::dvec3, 6> d{glm::dvec3(1, b, -a), glm::dvec3(-1, b, a), glm::dvec3(a, 1, -b),
                                      glm::dvec3(a, -1, b), glm::dvec3(a, b, 1),  glm::dvec3(-a, b, -1)};
    return glm::normalize(d.at(static_cast<size_t>(f)));
}

scene::Primitive rock(const MeshOptions& o) {
    scene::Primitive p;
    const Noise noise(o.seed);
    const auto n = std::max<uint32_t>(2, static_cast<uint32_t>(std::lround(std::sqrt(double(o.triangles) / 12))));
    const auto surface = [&](int f, double u, double v) {
        const glm::dvec3 d = cubeDirection(f, u, v), s = d * 1.3;
        const double coarse = noise.fbm(s.x, s.y, s.z, 3), fine = noise.fbm(s.x * 7, s.y * 7, s.z * 7, 7);
        const double facets = std::abs(2 * noise.fbm(s.x * 2.1 + 9, s.y * 2.1, s.z * 2.1, 2) - 1);
        return d * glm::dvec3(1, 0.72, 0.9) * (kRockRadius * (0.7 + 0.5 * coarse - 0.18 * facets + 0.05 * fine));
    };
    for (int f = 0; f < 6; ++f)
        addGrid(
            p, n, n,
            [&](double u, double v, glm::dvec3& x, glm::dvec2& uv) {
                x = surface(f, u, v);
                uv = {(f % 3 + 0.002 + 0.996 * u) / 3, (f / 3 + 0.002 + 0.996 * (1 - v)) / 2};
            },
            [&](double u, double v) {
                const double e = 0.25 / n;
                const glm::dvec3 du = surface(f, u + e, v) - surface(f, u - e, v),
                                 dv = surface(f, u, v + e) - surface(f, u, v - e);
                return glm::normalize(glm::cross(du, dv));
            });
    return p;
}

/// A flat panel: corner + u * a + v * b, n x n cells.
void addPanel(scene::Primitive& p, const glm::dvec3& corner, const glm::dvec3& a, const glm::dvec3& b, uint32_t n) {
    const glm::dvec3 normal = glm::normalize(glm::cross(a, b));
    const glm::dvec3 side = glm::normalize(a), up = glm::normalize(b);
    addGrid(
        p, n, n,
        [&](double u, double v, glm::dvec3& x, glm::dvec2& uv) {
            x = corner + u * a + v * b;
            uv = {glm::dot(x, side) / 4, -glm::dot(x, up) / 4};  // a texture tile is four metres wide
        },
        [&](double, double) { return normal; });
}

/// A block of flats: every window a recess with its own reveals and a pane of glass.
std::array<scene::Primitive, 2> building(const MeshOptions& o) {
    scene::Primitive walls, glass;
    constexpr int kFloors = 8, kBays = 10, kSides = 4;
    constexpr double kBay = 3, kFloor = 3.2, kDepth = 0.25;
    constexpr double kPanels = double(kFloors) * kBays * kSides * 9 + 2;
    const auto n =
        std::max<uint32_t>(1, static_cast<uint32_t>(std::lround(std::sqrt(double(o.triangles) / (2 * kPanels)))));
    const double width = kBays * kBay, height = kFloors * kFloor;
    for (int s = 0; s < kSides; ++s) {
        const std::array<glm::dvec3, 4> along{glm::dvec3(1, 0, 0), glm::dvec3(0, 0, -1), glm::dvec3(-1, 0, 0),
                                              glm::dvec3(0, 0, 1)};
        const glm::dvec3 a = along.at(static_cast<size_t>(s)), up(0, 1, 0), out = glm::cross(a, up);
        const glm::dvec3 origin = out * (width / 2) - a * (width / 2);
        for (int f = 0; f < kFloors; ++f)
            for (int b = 0; b < kBays; ++b) {
                const glm::dvec3 c = origin + a * (b * kBay) + up * (f * kFloor);
                const double x0 = 0.7, x1 = kBay - 0.7, y0 = 0.9, y1 = kFloor - 0.5;
                const auto at = [&](double x, double y, double in) { return c + a * x + up * y - out * in; };
                addPanel(walls, at(0, 0, 0), a * x0, up * kFloor, n);
                addPanel(walls, at(x1, 0, 0), a * (kBay - x1), up * kFloor, n);
                addPanel(walls, at(x0, 0, 0), a * (x1 - x0), up * y0, n);
                addPanel(walls, at(x0, y1, 0), a * (x1 - x0), up * (kFloor - y1), n);
                addPanel(walls, at(x0, y0, 0), -out * kDepth, up * (y1 - y0), n);  // reveals
                addPanel(walls, at(x1, y0, kDepth), out * kDepth, up * (y1 - y0), n);
                addPanel(walls, at(x0, y0, 0), a * (x1 - x0), -out * kDepth, n);
                addPanel(walls, at(x0, y1, kDepth), a * (x1 - x0), out * kDepth, n);
                addPanel(glass, at(x0, y0, kDepth), a * (x1 - x0), up * (y1 - y0), n);
            }
    }
    addPanel(walls, glm::dvec3(-width / 2, height, width / 2), glm::dvec3(width, 0, 0), glm::dvec3(0, 0, -width), n);
    addPanel(walls, glm::dvec3(-width / 2, 0, -width / 2), glm::dvec3(width, 0, 0), glm::dvec3(0, 0, width), n);
    return {walls, glass};
}

uint32_t rgb(double r, double g, double b) {
    const auto byte = [](double v) { return static_cast<uint32_t>(std::clamp(v, 0.0, 1.0) * 255 + 0.5); };
    return byte(r) | byte(g) << 8 | byte(b) << 16 | 0xff000000u;
}

}  // namespace

Textures growTextures(const MeshOptions& o) {
    Textures t;
    const uint32_t n = o.textureSize;
    t.colour.size = t.normal.size = n;
    t.colour.rgba.resize(size_t{n} * n);
    t.normal.rgba.resize(size_t{n} * n);
    const Noise noise(o.seed + 17), ground(o.seed);
    std::vector<double> relief(size_t{n} * n);
    for (uint32_t y = 0; y < n && !isStopRequested(); ++y)
        for (uint32_t x = 0; x < n; ++x) {
            const double u = (x + 0.5) / n, v = (y + 0.5) / n;
            const size_t i = size_t{y} * n + x;
            const double fine = noise.fbm(u * 40, v * 40, 1.5, 5), coarse = noise.fbm(u * 6, v * 6, 4.5, 4);
            if (o.kind == "terrain") {
                const double e = 1.0 / n, height = terrainHeight(ground, u, v);
                const double slope =
                    std::hypot(terrainHeight(ground, u + e, v) - height, terrainHeight(ground, u, v + e) - height) /
                    (e * kTerrainSize);
                const double grass = std::clamp(1.6 - 2.2 * slope + 0.8 * (coarse - 0.5), 0.0, 1.0);
                const double snow = std::clamp((height / kTerrainHeight - 0.66) * 9 + coarse - 0.5, 0.0, 1.0);
                const double k = 0.7 + 0.6 * (fine - 0.5);
                glm::dvec3 c = glm::mix(glm::dvec3(0.47, 0.42, 0.37), glm::dvec3(0.27, 0.38, 0.16), grass) * k;
                c = glm::mix(c, glm::dvec3(0.93, 0.94, 0.97), snow);
                t.colour.rgba[i] = rgb(c.r, c.g, c.b);
                relief[i] = 0.4 * fine;
            } else if (o.kind == "building") {
                // Bricks of a quarter by an eighth of a metre, joints between them; a tile is four metres.
                const double row = std::floor(v * 32), shift = std::fmod(row, 2.0) * 0.5;
                const double bx = u * 16 + shift, fx = bx - std::floor(bx), fy = v * 32 - row;
                const bool isJoint = fx < 0.05 || fy < 0.1;
                const double tint = 0.8 + 0.4 * noise.at(std::fmod(std::floor(bx), 16.0) * 7.3, row * 3.1, 0.5);
                const double k = tint * (0.85 + 0.3 * fine);
                t.colour.rgba[i] = isJoint ? rgb(0.66, 0.64, 0.6) : rgb(0.62 * k, 0.33 * k, 0.25 * k);
                relief[i] = (isJoint ? 0 : 0.6) + 0.2 * fine;
            } else {
                const double k = 0.45 + 0.35 * coarse + 0.35 * (fine - 0.5),
                             moss = std::clamp(4 * coarse - 2.2, 0.0, 1.0);
                t.colour.rgba[i] = rgb(k * (1 - 0.35 * moss), k * (0.97 - 0.05 * moss), k * (0.9 - 0.55 * moss));
                relief[i] = fine;
            }
        }
    for (uint32_t y = 0; y < n; ++y)
        for (uint32_t x = 0; x < n; ++x) {
            const auto at = [&](uint32_t px, uint32_t py) { return relief[size_t{py % n} * n + px % n]; };
            const double dx = at(x + 1, y) - at(x + n - 1, y), dy = at(x, y + 1) - at(x, y + n - 1);
            const glm::dvec3 m = glm::normalize(glm::dvec3(-dx * 2, dy * 2, 1));
            t.normal.rgba[size_t{y} * n + x] = rgb(m.x * 0.5 + 0.5, m.y * 0.5 + 0.5, m.z * 0.5 + 0.5);
        }
    return t;
}

scene::Scene growMesh(const MeshOptions& o) {
    scene::Scene s;
    s.textures = {{0, scene::Wrap::repeat, scene::Wrap::repeat}, {1, scene::Wrap::repeat, scene::Wrap::repeat}};
    scene::Material m;
    m.name = o.kind;
    m.metallic = 0;
    m.roughness = o.kind == "building" ? 0.85f : 0.95f;
    m.baseColourTexture.texture = 0;
    m.normalTexture.texture = 1;
    s.materials.push_back(m);
    scene::Mesh mesh;
    mesh.name = o.kind;
    if (o.kind == "building") {
        auto [walls, glass] = building(o);
        scene::Material pane;
        pane.name = "glass";
        pane.baseColour = {0.12f, 0.16f, 0.2f, 1};
        pane.metallic = 0.6f;
        pane.roughness = 0.12f;
        s.materials.push_back(pane);
        walls.material = 0;
        glass.material = 1;
        mesh.primitives = {std::move(walls), std::move(glass)};
    } else {
        mesh.primitives.push_back(o.kind == "terrain" ? terrain(o) : rock(o));
        mesh.primitives[0].material = 0;
    }
    s.meshes.push_back(std::move(mesh));
    scene::Node node;
    node.name = o.kind;
    node.mesh = 0;
    s.nodes.push_back(node);
    return s;
}

}  // namespace stipple::grow
