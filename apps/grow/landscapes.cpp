#include "apps/grow/landscapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "apps/grow/meshes.h"
#include "apps/grow/noise.h"
#include "apps/grow/plants.h"
#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::grow {
namespace {

using glm::dvec3;

/// Ground as a grid of triangles; heights are those of the triangles, so that what stands on it touches it.
class Ground {
  public:
    /// `size`: edge, metres; `relief`: height of the hills; the middle is level and at height 0.
    Ground(uint64_t seed, double size, double relief, double cell)
        : noise_(seed),
          size_(size),
          relief_(relief),
          cells_(std::clamp<uint32_t>(static_cast<uint32_t>(size / cell), 8, 1200)) {
        level_ = raw(0, 0);
    }

    double size() const { return size_; }

    double at(double x, double z) const {
        const double cell = size_ / cells_;
        const double u = std::clamp((x + 0.5 * size_) / cell, 0.0, cells_ - 1e-9),
                     v = std::clamp((z + 0.5 * size_) / cell, 0.0, cells_ - 1e-9);
        const double i = std::floor(u), j = std::floor(v), fu = u - i, fv = v - j;
        const auto h = [&](double a, double b) { return corner(a, b); };
        // The diagonal of each cell leads from (0, 0) to (1, 1).
        return fu > fv ? h(i, j) + fu * (h(i + 1, j) - h(i, j)) + fv * (h(i + 1, j + 1) - h(i + 1, j))
                       : h(i, j) + fv * (h(i, j + 1) - h(i, j)) + fu * (h(i + 1, j + 1) - h(i, j + 1));
    }

    scene::Primitive mesh(const glm::vec3& low, const glm::vec3& high) const {
        scene::Primitive p;
        const double cell = size_ / cells_;
        for (uint32_t j = 0; j <= cells_; ++j)
            for (uint32_t i = 0; i <= cells_; ++i) {
                const double x = i * cell - 0.5 * size_, z = j * cell - 0.5 * size_;
                const double dx = (corner(i + 1.0, j) - corner(i - 1.0, j)) / (2 * cell),
                             dz = (corner(i, j + 1.0) - corner(i, j - 1.0)) / (2 * cell);
                p.position.emplace_back(dvec3(x, corner(i, j), z));
                p.normal.emplace_back(glm::normalize(dvec3(-dx, 1, -dz)));
                const auto tint = static_cast<float>(noise_.fbm(x * 0.35, 4.2, z * 0.35, 5));
                p.colour.emplace_back(glm::mix(low, high, tint), 1);
            }
        for (uint32_t j = 0; j < cells_; ++j)
            for (uint32_t i = 0; i < cells_; ++i) {
                const uint32_t a = j * (cells_ + 1) + i, b = a + 1, c = a + cells_ + 1, d = c + 1;
                for (const uint32_t k : {a, d, b, a, c, d}) p.indices.push_back(k);
            }
        return p;
    }

    /// Upright, on the ground, turned and scaled.
    glm::dmat4 place(double x, double z, double turn, double scale) const {
        glm::dmat4 m = glm::translate(glm::dmat4(1), dvec3(x, at(x, z), z));
        m = glm::rotate(m, turn, dvec3(0, 1, 0));
        return glm::scale(m, dvec3(scale));
    }
    /// The same, but leaning as the ground does.
    glm::dmat4 lay(double x, double z, double turn, double scale, double reach) const {
        const double dx = (at(x + reach, z) - at(x - reach, z)) / (2 * reach),
                     dz = (at(x, z + reach) - at(x, z - reach)) / (2 * reach);
        const dvec3 up = glm::normalize(dvec3(-dx, 1, -dz)), side = glm::normalize(glm::cross(up, dvec3(0, 0, 1)));
        glm::dmat4 m(glm::dvec4(side, 0), glm::dvec4(up, 0), glm::dvec4(glm::cross(side, up), 0),
                     glm::dvec4(x, at(x, z), z, 1));
        m = glm::rotate(m, turn, dvec3(0, 1, 0));
        return glm::scale(m, dvec3(scale));
    }
    const Noise& noise() const { return noise_; }

  private:
    double raw(double x, double z) const {
        return relief_ * (noise_.fbm(x / 700 + 3, 1.5, z / 700 + 8, 5) - 0.5) * 2 +
               0.4 * noise_.fbm(x / 9, 6.5, z / 9, 3);
    }
    double corner(double i, double j) const {
        const double cell = size_ / cells_;
        return raw(i * cell - 0.5 * size_, j * cell - 0.5 * size_) - level_;
    }

    Noise noise_;
    double size_, relief_, level_ = 0;
    uint32_t cells_;
};

int addMesh(scene::Scene& s, scene::Mesh mesh) {
    s.meshes.push_back(std::move(mesh));
    return static_cast<int>(s.meshes.size()) - 1;
}

void addNode(scene::Scene& s, const std::string& name, int mesh, std::vector<glm::dmat4> instances = {}) {
    scene::Node node;
    node.name = name;
    node.mesh = mesh;
    node.instances = std::move(instances);
    s.nodes.push_back(std::move(node));
}

void addGround(scene::Scene& s, const Ground& ground, const glm::vec3& low, const glm::vec3& high) {
    scene::Material m;
    m.name = "ground";
    m.metallic = 0;
    m.roughness = 1;
    s.materials.push_back(m);
    scene::Mesh mesh;
    mesh.name = "ground";
    mesh.primitives.push_back(ground.mesh(low, high));
    mesh.primitives[0].material = static_cast<int>(s.materials.size()) - 1;
    const int number = addMesh(s, std::move(mesh));
    addNode(s, "ground", number);
}

/// A ribbon or tube that rises from `foot`, bends over and gets thinner.
void addBlade(scene::Primitive& p, Rng& rng, const dvec3& foot, double height, double width, double bend,
              const glm::vec3& colour, bool isRibbon) {
    constexpr uint32_t kJoints = 4;
    const double turn = rng.uniform(0, 6.283185307179586);
    const dvec3 aside(std::cos(turn), 0, std::sin(turn)), across(-aside.z, 0, aside.x);
    const auto first = static_cast<uint32_t>(p.position.size());
    for (uint32_t k = 0; k <= kJoints; ++k) {
        const double u = static_cast<double>(k) / kJoints;
        p.position.emplace_back(foot + dvec3(0, height * (u - 0.25 * bend * u * u), 0) +
                                aside * (height * bend * u * u));
        p.radius.push_back(static_cast<float>(0.5 * width * (isRibbon ? 1 - 0.92 * u * u : 1 - 0.4 * u)));
        const dvec3 along = glm::normalize(dvec3(0, 1 - 0.5 * bend * u, 0) + aside * (2 * bend * u));
        if (isRibbon) p.normal.emplace_back(glm::normalize(glm::cross(across, along)));
        p.colour.emplace_back(colour * static_cast<float>(0.45 + 0.55 * u), 1);  // less light reaches the foot
        if (k > 0) p.indices.insert(p.indices.end(), {first + k - 1, first + k});
    }
}

/// A flower: its petals are short ribbons round the tip of a stalk.
void addFlower(scene::Primitive& stalks, scene::Primitive& petals, Rng& rng, const dvec3& foot,
               const glm::vec3& colour) {
    const double height = rng.uniform(0.25, 0.5), bend = rng.uniform(0, 0.15);
    addBlade(stalks, rng, foot, height, 0.004, bend, {0.12f, 0.25f, 0.04f}, false);
    const dvec3 tip(stalks.position.back());
    constexpr int kPetals = 7;
    for (int k = 0; k < kPetals; ++k) {
        const double a = 6.283185307179586 * k / kPetals + rng.uniform(-0.1, 0.1);
        const dvec3 out(std::cos(a), 0.25, std::sin(a));
        const auto first = static_cast<uint32_t>(petals.position.size());
        constexpr std::array<double, 3> kWidths{0.003, 0.007, 0.002};
        for (uint32_t j = 0; j < 3; ++j) {
            petals.position.emplace_back(tip + out * (0.012 * j));
            petals.radius.push_back(static_cast<float>(kWidths.at(j)));
            petals.normal.emplace_back(glm::normalize(dvec3(-0.25 * out.x, 1, -0.25 * out.z)));
            petals.colour.emplace_back(colour * static_cast<float>(rng.uniform(0.85, 1.1)), 1);
            if (j > 0) petals.indices.insert(petals.indices.end(), {first + j - 1, first + j});
        }
    }
}

constexpr double kPatch = 1.5;  ///< metres

scene::Mesh growPatch(uint64_t seed) {
    constexpr int kBlades = 2600, kFlowers = 14;
    static constexpr std::array<glm::vec3, 4> kFlowerColours{
        glm::vec3(0.85f, 0.8f, 0.75f), glm::vec3(0.8f, 0.55f, 0.02f), glm::vec3(0.55f, 0.03f, 0.05f),
        glm::vec3(0.25f, 0.15f, 0.6f)};
    Rng rng(seed * 77 + 5);
    scene::Mesh mesh;
    mesh.name = "grass";
    scene::Primitive grass, stalks, petals;
    grass.kind = stalks.kind = petals.kind = scene::PrimitiveKind::lines;
    const auto anywhere = [&] {
        return dvec3(rng.uniform(-0.6, 0.6) * kPatch, -0.02, rng.uniform(-0.6, 0.6) * kPatch);
    };
    for (int k = 0; k < kBlades; ++k)
        addBlade(grass, rng, anywhere(), rng.uniform(0.12, 0.38), rng.uniform(0.004, 0.008), rng.uniform(0.1, 0.7),
                 glm::vec3(0.1f, 0.24f, 0.03f) * static_cast<float>(rng.uniform(0.7, 1.6)), true);
    const glm::vec3 colour = kFlowerColours.at(seed % kFlowerColours.size());
    for (int k = 0; k < kFlowers; ++k) addFlower(stalks, petals, rng, anywhere(), colour);
    mesh.primitives = {stalks, grass, petals};
    mesh.primitives[0].material = 0;
    mesh.primitives[1].material = mesh.primitives[2].material = 1;
    return mesh;
}

/// Patches of grass over a square round (cx, cz), where `isThere`.
template <typename IsThere>
void addGrass(scene::Scene& s, const Ground& ground, uint64_t seed, double cx, double cz, double edge,
              const IsThere& isThere) {
    constexpr uint64_t kPatches = 4;
    Rng rng(seed + 99);
    std::array<std::vector<glm::dmat4>, kPatches> places;
    const auto count = static_cast<int>(edge / kPatch);
    for (int j = 0; j < count; ++j)
        for (int i = 0; i < count; ++i) {
            const double x = cx + (i + 0.5 + rng.uniform(-0.2, 0.2)) * kPatch - 0.5 * edge,
                         z = cz + (j + 0.5 + rng.uniform(-0.2, 0.2)) * kPatch - 0.5 * edge;
            const double turn = rng.uniform(0, 6.283185307179586), scale = rng.uniform(0.8, 1.25);
            // Kinds of flowers grow together.
            const double kind =
                kPatches * 1.6 * (ground.noise().fbm(x / 14, 2.5, z / 14, 2) - 0.2) + rng.uniform(-0.4, 0.4);
            if (isThere(x, z))
                places.at(static_cast<size_t>(std::clamp(kind, 0.0, kPatches - 1.0)))
                    .push_back(ground.lay(x, z, turn, scale, 0.5 * kPatch));
        }
    for (uint64_t k = 0; k < kPatches; ++k) {
        if (places.at(k).empty()) continue;
        const int mesh = addMesh(s, growPatch(seed + k));
        addNode(s, "grass", mesh, std::move(places.at(k)));
    }
}

}  // namespace

scene::Scene growForest(const LandscapeOptions& o) {
    static constexpr std::array<const char*, 3> kSpecies{"oak", "birch", "spruce"};
    constexpr double kClearing = 14;
    scene::Scene s;
    s.materials = plantMaterials();
    const auto across = static_cast<uint64_t>(std::ceil(std::sqrt(static_cast<double>(o.trees))));
    const double wood = static_cast<double>(across) * o.spacing;
    const Ground ground(o.seed, wood + 60, std::min(60.0, 0.05 * wood), 4);
    addGround(s, ground, {0.045f, 0.04f, 0.02f}, {0.06f, 0.09f, 0.025f});
    Rng rng(o.seed * 31 + 7);
    std::vector<std::vector<glm::dmat4>> places(kSpecies.size() * o.variants);
    for (uint64_t k = 0; k < o.trees; ++k) {
        double x = (static_cast<double>(k % across) + rng.uniform(0.1, 0.9)) * o.spacing - 0.5 * wood,
               z = (static_cast<double>(k / across) + rng.uniform(0.1, 0.9)) * o.spacing - 0.5 * wood;
        if (const double d = std::hypot(x, z); d < kClearing && d > 0) {
            x *= kClearing / d;
            z *= kClearing / d;
        }
        const double kind = 4.2 * (ground.noise().fbm(x / 160, 9.5, z / 160, 3) - 0.15) + rng.uniform(-0.5, 0.5);
        const auto species = static_cast<size_t>(std::clamp(kind, 0.0, kSpecies.size() - 0.01));
        const double turn = rng.uniform(0, 6.283185307179586), scale = rng.uniform(0.75, 1.25);
        glm::dmat4 place = ground.place(x, z, turn, scale);
        place[3].y -= 0.1;  // the foot of the trunk is in the ground on the low side too
        places[species * o.variants + rng.below(o.variants)].push_back(place);
    }
    for (size_t k = 0; k < places.size(); ++k) {
        if (places[k].empty() || isStopRequested()) continue;
        PlantOptions plant;
        plant.species = kSpecies.at(k / o.variants);
        plant.leaves = o.leaves;
        plant.seed = o.seed * 100 + k;
        plant.asTriangles = o.asTriangles;
        const int mesh = addMesh(s, growPlantMesh(plant));
        addNode(s, plant.species, mesh, std::move(places[k]));
    }
    return s;
}

scene::Scene growMeadow(const LandscapeOptions& o) {
    scene::Scene s;
    s.materials = plantMaterials();
    const Ground ground(o.seed, o.meadow + 8, 4, 0.5);
    addGround(s, ground, {0.05f, 0.045f, 0.02f}, {0.07f, 0.1f, 0.03f});
    addGrass(s, ground, o.seed, 0, 0, o.meadow, [](double, double) { return true; });
    return s;
}

namespace {

/// A ball of radius 1 that stands on the ground.
scene::Mesh growBall(const char* name, int material) {
    constexpr uint32_t kAround = 128, kUp = kAround / 2;
    constexpr double kPi = 3.14159265358979323846;
    scene::Primitive p;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i <= kAround; ++i) {
            const double a = 2 * kPi * i / kAround, b = kPi * j / kUp;
            p.normal.emplace_back(std::cos(a) * std::sin(b), std::cos(b), std::sin(a) * std::sin(b));
            p.position.push_back(p.normal.back() + glm::vec3(0, 1, 0));
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(p.position.size() - 1), c = d - 1, upper = d - (kAround + 1),
                       left = upper - 1;
            p.indices.insert(p.indices.end(), {left, upper, d, left, d, c});
        }
    p.material = material;
    scene::Mesh mesh;
    mesh.name = name;
    mesh.primitives.push_back(std::move(p));
    return mesh;
}

/// Two balls of glass and two mirrors in the grass.
void addBalls(scene::Scene& s, const Ground& ground) {
    scene::Material glass, mirror;
    glass.name = "glass";
    glass.metallic = glass.roughness = 0;
    glass.optics = *lod::opticsNamed("glass");
    glass.optics.thickness = 2;
    glass.optics.attenuationDistance = 3;
    glass.optics.attenuationColour = {0.8f, 0.95f, 0.9f};
    mirror.name = "mirror";
    mirror.baseColour = {0.95f, 0.93f, 0.88f, 1};
    mirror.roughness = 0;
    for (const auto& [material, x] : {std::pair{&glass, -6.0}, {&mirror, 6.0}}) {
        s.materials.push_back(*material);
        const int mesh = addMesh(s, growBall(material->name.c_str(), static_cast<int>(s.materials.size()) - 1));
        addNode(s, material->name.c_str(), mesh, {ground.place(x, 24, 0, 2), ground.place(0.6 * x, 29, 0, 1.2)});
    }
}

/// From the south-west, 35 degrees high; over the sky's light.
void addSun(scene::Scene& s) {
    scene::Light sun;
    sun.kind = scene::LightKind::directional;
    sun.colour = {1, 0.95f, 0.85f};
    sun.intensity = 3;
    s.lights.push_back(sun);
    scene::Node node;
    node.name = "sun";
    node.light = 0;
    const double kTurn = -0.9, kHigh = 0.61;
    node.local = glm::rotate(glm::rotate(glm::dmat4(1), kTurn, dvec3(0, 1, 0)), -kHigh, dvec3(1, 0, 0));
    s.nodes.push_back(node);
}

}  // namespace

scene::Scene growDemo(const LandscapeOptions& o, const std::string& store) {
    constexpr double kScan = 16;  ///< metres round the middle that the scan covers
    scene::Scene s;
    s.materials = plantMaterials();
    const Ground ground(o.seed, 160, 5, 1);
    addGround(s, ground, {0.05f, 0.045f, 0.02f}, {0.07f, 0.1f, 0.03f});
    addGrass(s, ground, o.seed, 0, 34, 44, [](double, double z) { return z > kScan; });
    Rng rng(o.seed + 3);
    for (const char* species : {"oak", "birch", "spruce"}) {
        PlantOptions plant;
        plant.species = species;
        plant.leaves = o.leaves;
        plant.seed = o.seed + s.meshes.size();
        const int mesh = addMesh(s, growPlantMesh(plant));
        std::vector<glm::dmat4> places;
        for (int row = 0; row < 6; ++row)
            for (int k = 0; k < 3; ++k) {
                const double x = (species[0] == 'o'   ? -62
                                  : species[0] == 'b' ? -36
                                                      : 30) +
                                 9.0 * k + rng.uniform(-1, 1),
                             z = -24 + 9.0 * row + rng.uniform(-1, 1);
                places.push_back(ground.place(x, z, rng.uniform(0, 6.283185307179586), rng.uniform(0.8, 1.15)));
            }
        addNode(s, species, mesh, std::move(places));
    }
    // The boulder brings its own textures.
    MeshOptions rock;
    rock.triangles = 200'000;
    scene::Scene boulder = growMesh(rock);
    s.textures = boulder.textures;
    s.materials.push_back(boulder.materials.at(0));
    for (scene::Primitive& p : boulder.meshes.at(0).primitives) p.material = static_cast<int>(s.materials.size()) - 1;
    const int mesh = addMesh(s, std::move(boulder.meshes.at(0)));
    addNode(s, "boulder", mesh, {ground.place(-14, 24, 0.4, 1.6), ground.place(-19, 27, 2.1, 0.9)});
    addBalls(s, ground);
    scene::Node scan;
    scan.name = "scan";
    scan.store = store;
    // A scan has z up.
    scan.local = glm::rotate(glm::translate(glm::dmat4(1), dvec3(0, ground.at(0, 0) + 0.05, 0)), -1.5707963267948966,
                             dvec3(1, 0, 0));
    s.nodes.push_back(scan);
    addSun(s);
    // Effects where they belong: shadows of that sun, air between the rows and the far trees, creases of bark and
    // grass, what mirrors show of the picture, light that rolls off. Glass calls for its own itself.
    s.effects.names = {"shadow", "fog", "occlusion", "reflection", "tone"};
    s.effects.values = {"fog.density=0.0012",   "fog.kind=air",      "fog.colour=176,190,206",
                        "occlusion.radius=0.6", "tone.exposure=1.6", "tone.curve=filmic"};
    return s;
}

std::string demoWalk() {
    return R"({
  "fps": 1,
  "keys": [
    {"t": 0, "eye": [30, 13, 62], "target": [0, 3, 6], "up": [0, 1, 0], "fov": 55},
    {"t": 1, "eye": [0, 4, 40], "target": [0, 2, 24], "up": [0, 1, 0], "fov": 55},
    {"t": 2, "eye": [8, 3, 31], "target": [1, 3.2, 27], "up": [0, 1, 0], "fov": 45},
    {"t": 3, "eye": [-24, 5, 14], "target": [-40, 4, -10], "up": [0, 1, 0], "fov": 60},
    {"t": 4, "eye": [-46, 3, -30], "target": [-46, 60, -38], "up": [0, 0, 1], "fov": 50},
    {"t": 5, "eye": [-10, 30, -60], "target": [-10, 90, -75], "up": [0, 0, 1], "fov": 50},
    {"t": 6, "eye": [14, 7, -38], "target": [0, 3, 6], "up": [0, 1, 0], "fov": 55}
  ]
}
)";
}

}  // namespace stipple::grow
