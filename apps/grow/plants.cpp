// Branches of branches (after Weber and Penn 1995, much reduced): a stem bends as it grows and bears children at the
// golden angle; the last order bears leaves.
#include "apps/grow/plants.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/process.h"
#include "engine/base/rng.h"

namespace stipple::grow {
namespace {

using glm::dvec3;

constexpr double kGoldenAngle = 2.39996322972865332;

struct Order {
    int children, segments;
    double length;      ///< of the parent's length; of the first order: metres
    double downAngle;   ///< radians from the parent's direction
    double wander, up;  ///< how much it bends at random, and towards the sky (negative: droops), per segment
};
struct Species {
    double radius;                ///< of the trunk, metres
    double bare;                  ///< share of a stem without children
    double taper;                 ///< how much shorter the children towards the tip are
    std::array<Order, 4> orders;  ///< children of the last one are leaves
    double leafLength, leafWidth;
    glm::vec3 bark, leaf;  ///< linear
};

const Species& speciesOf(const std::string& name) {
    static const Species oak{0.32,
                             0.22,
                             0.6,
                             {{{34, 26, 11, 0, 0.05, 0},
                               {22, 14, 0.5, 0.95, 0.16, 0.05},
                               {8, 8, 0.34, 0.9, 0.2, 0.03},
                               {0, 4, 0.4, 0.85, 0.2, 0.02}}},
                             0.085,
                             0.016,
                             {0.13f, 0.095f, 0.07f},
                             {0.07f, 0.16f, 0.03f}};
    static const Species birch{0.16,
                               0.3,
                               0.55,
                               {{{30, 26, 13, 0, 0.04, 0.01},
                                 {18, 12, 0.3, 0.75, 0.12, 0.04},
                                 {9, 8, 0.4, 0.8, 0.14, -0.1},
                                 {0, 5, 0.45, 0.6, 0.14, -0.14}}},
                               0.06,
                               0.02,
                               {0.55f, 0.53f, 0.5f},
                               {0.12f, 0.24f, 0.04f}};
    static const Species spruce{0.24,
                                0.08,
                                0.92,
                                {{{90, 40, 16, 0, 0.015, 0.02},
                                  {16, 12, 0.26, 1.45, 0.04, 0.015},
                                  {6, 5, 0.3, 0.9, 0.06, -0.03},
                                  {0, 4, 0.4, 0.8, 0.06, 0}}},
                                0.1,
                                0.007,
                                {0.1f, 0.065f, 0.045f},
                                {0.02f, 0.07f, 0.03f}};
    return name == "birch" ? birch : name == "spruce" ? spruce : oak;
}

struct Strip {
    std::vector<dvec3> places;
    std::vector<double> radii;
    dvec3 normal{0};  ///< of a leaf
    glm::vec3 colour{1};
};

class Grower {
  public:
    explicit Grower(const PlantOptions& o)
        : species_(speciesOf(o.species)), rng_(o.seed * 7919 + 17), leaves_(o.leaves) {}

    void run() {
        stem(0, dvec3(0), dvec3(0, 1, 0), species_.orders[0].length, species_.radius);
        const double perTwig = static_cast<double>(leaves_) / std::max<double>(1, static_cast<double>(twigs_.size()));
        double owed = 0;
        for (const Strip& twig : twigs_) {
            if (isStopRequested()) return;
            owed += perTwig;
            const int count = static_cast<int>(owed);
            owed -= count;
            for (int k = 0; k < count; ++k) leaf(twig, (k + rng_.uniform()) / count, k);
        }
    }

    std::vector<Strip> wood, foliage;

  private:
    static dvec3 across(const dvec3& d) {
        return glm::normalize(std::abs(d.y) < 0.9 ? glm::cross(d, dvec3(0, 1, 0)) : glm::cross(d, dvec3(1, 0, 0)));
    }
    dvec3 wandered(const dvec3& d, double wander, double up) {
        return glm::normalize(d + wander * dvec3(rng_.normal(), rng_.normal(), rng_.normal()) + dvec3(0, up, 0));
    }

    void stem(size_t level, const dvec3& from, dvec3 direction, double length, double radius) {
        const Order& order = species_.orders.at(level);
        Strip strip;
        strip.colour = species_.bark * static_cast<float>(rng_.uniform(0.85, 1.15));
        std::vector<dvec3> directions;
        dvec3 at = from;
        for (int i = 0; i <= order.segments; ++i) {
            const double u = static_cast<double>(i) / order.segments;
            strip.places.push_back(at);
            strip.radii.push_back(radius *
                                  (level == 0 ? std::pow(1 - 0.97 * u, 0.8) + 0.35 * std::exp(-18 * u) : 1 - 0.8 * u));
            directions.push_back(direction);
            direction = wandered(direction, order.wander, order.up);
            at += direction * (length / order.segments);
        }
        const bool isTwig = level + 1 == species_.orders.size();
        double turn = rng_.uniform(0, 6.28);
        for (int c = 0; !isTwig && c < order.children; ++c, turn += kGoldenAngle) {
            const double u = species_.bare + (1 - species_.bare) * (c + rng_.uniform()) / order.children;
            const auto i = std::min(static_cast<size_t>(u * order.segments), strip.places.size() - 2);
            const double part = u * order.segments - static_cast<double>(i);
            const Order& next = species_.orders.at(level + 1);
            const dvec3 d = directions[i], side = across(d);
            const dvec3 out = side * std::cos(turn) + glm::cross(d, side) * std::sin(turn);
            const double angle = next.downAngle * rng_.uniform(0.8, 1.2);
            const double reach =
                next.length * length * (1 - species_.taper * (level == 0 ? u : 0.6 * u)) * rng_.uniform(0.75, 1.15);
            const double own = glm::mix(strip.radii[i], strip.radii[i + 1], part);
            stem(level + 1, glm::mix(strip.places[i], strip.places[i + 1], part),
                 glm::normalize(d * std::cos(angle) + out * std::sin(angle)), reach,
                 std::min(0.6 * own, 0.016 * reach + 0.001));
        }
        if (isTwig) twigs_.push_back(strip);
        wood.push_back(std::move(strip));
    }

    void leaf(const Strip& twig, double u, int number) {
        const size_t last = twig.places.size() - 1;
        const auto i = std::min(static_cast<size_t>(u * static_cast<double>(last)), last - 1);
        const dvec3 d = glm::normalize(twig.places[i + 1] - twig.places[i]), side = across(d);
        const double turn = number * kGoldenAngle + rng_.uniform(-0.4, 0.4);
        dvec3 out = glm::normalize(d * 0.5 + side * std::cos(turn) + glm::cross(d, side) * std::sin(turn));
        Strip leaf;
        dvec3 at = glm::mix(twig.places[i], twig.places[i + 1], rng_.uniform());
        const double length = species_.leafLength * rng_.uniform(0.7, 1.2);
        constexpr std::array<double, 4> kWidths{0.2, 1, 0.8, 0.05};
        dvec3 normal = dvec3(0, 1, 0) - out.y * out;
        normal = glm::length(normal) > 0.1 ? glm::normalize(normal) : side;
        leaf.normal = glm::normalize(normal + 0.5 * dvec3(rng_.normal(), rng_.normal(), rng_.normal()));
        for (size_t k = 0; k < kWidths.size(); ++k) {
            leaf.places.push_back(at);
            leaf.radii.push_back(species_.leafWidth * kWidths.at(k));
            out = glm::normalize(out - 0.18 * leaf.normal);
            at += out * (length / 3);
        }
        leaf.colour = species_.leaf * glm::vec3(static_cast<float>(rng_.uniform(0.7, 1.5)),
                                                static_cast<float>(rng_.uniform(0.8, 1.25)),
                                                static_cast<float>(rng_.uniform(0.7, 1.3)));
        foliage.push_back(std::move(leaf));
    }

    const Species& species_;
    Rng rng_;
    uint64_t leaves_;
    std::vector<Strip> twigs_;
};

scene::Primitive asLines(const std::vector<Strip>& strips, bool isLeaf) {
    scene::Primitive p;
    p.kind = scene::PrimitiveKind::lines;
    for (const Strip& s : strips) {
        if (isStopRequested()) break;
        const auto first = static_cast<uint32_t>(p.position.size());
        for (size_t i = 0; i < s.places.size(); ++i) {
            p.position.emplace_back(s.places[i]);
            p.radius.push_back(static_cast<float>(s.radii[i]));
            p.colour.emplace_back(s.colour, 1);
            if (isLeaf) p.normal.emplace_back(s.normal);
            if (i > 0)
                p.indices.insert(p.indices.end(),
                                 {first + static_cast<uint32_t>(i) - 1, first + static_cast<uint32_t>(i)});
        }
    }
    return p;
}

/// Rings round the stem, or two edges along the leaf.
scene::Primitive asTriangles(const std::vector<Strip>& strips, bool isLeaf) {
    scene::Primitive p;
    for (const Strip& s : strips) {
        if (isStopRequested()) break;
        const uint32_t sides = isLeaf ? 2 : s.radii[0] > 0.05 ? 12 : s.radii[0] > 0.01 ? 6 : 4;
        const auto first = static_cast<uint32_t>(p.position.size());
        dvec3 x(0);
        for (size_t i = 0; i < s.places.size(); ++i) {
            const dvec3 t =
                glm::normalize(s.places[std::min(i + 1, s.places.size() - 1)] - s.places[i > 0 ? i - 1 : 0]);
            x = isLeaf   ? glm::normalize(glm::cross(s.normal, t))
                : i == 0 ? glm::normalize(std::abs(t.y) < 0.9 ? glm::cross(t, dvec3(0, 1, 0))
                                                              : glm::cross(t, dvec3(1, 0, 0)))
                         : glm::normalize(x - glm::dot(x, t) * t);
            const dvec3 y = glm::cross(t, x);
            for (uint32_t k = 0; k < sides; ++k) {
                const double a = 6.283185307179586 * k / sides;
                const dvec3 out = isLeaf ? (k == 0 ? x : -x) : x * std::cos(a) + y * std::sin(a);
                p.position.emplace_back(s.places[i] + s.radii[i] * out);
                p.normal.emplace_back(isLeaf ? glm::normalize(glm::cross(t, x)) : out);
                p.colour.emplace_back(s.colour, 1);
            }
            if (i == 0) continue;
            const auto base = first + static_cast<uint32_t>(i - 1) * sides;
            for (uint32_t k = 0; k < (isLeaf ? 1 : sides); ++k) {
                const uint32_t a = base + k, b = base + (k + 1) % sides, c = a + sides, d = b + sides;
                p.indices.insert(p.indices.end(), {a, b, d, a, d, c});
            }
        }
    }
    return p;
}

}  // namespace

std::vector<scene::Material> plantMaterials() {
    std::vector<scene::Material> out;
    for (const char* name : {"bark", "leaf"}) {
        scene::Material m;
        m.name = name;
        m.metallic = 0;
        m.roughness = 0.9f;
        m.isDoubleSided = m.name == "leaf";
        out.push_back(m);
    }
    return out;
}

scene::Mesh growPlantMesh(const PlantOptions& o) {
    Grower grower(o);
    grower.run();
    scene::Mesh mesh;
    mesh.name = o.species;
    mesh.primitives = {o.asTriangles ? asTriangles(grower.wood, false) : asLines(grower.wood, false),
                       o.asTriangles ? asTriangles(grower.foliage, true) : asLines(grower.foliage, true)};
    mesh.primitives[0].material = 0;
    mesh.primitives[1].material = 1;
    return mesh;
}

scene::Scene growPlant(const PlantOptions& o) {
    scene::Scene s;
    s.materials = plantMaterials();
    s.meshes.push_back(growPlantMesh(o));
    scene::Node node;
    node.name = o.species;
    node.mesh = 0;
    Rng rng(o.seed + 5);
    constexpr double kSpacing = 7;  // metres
    for (uint32_t k = 0; o.rows > 1 && k < o.rows * o.rows; ++k) {
        glm::dmat4 place(1);
        place = glm::translate(place, dvec3(kSpacing * (k % o.rows + rng.uniform(-0.2, 0.2)), 0,
                                            kSpacing * (double(k / o.rows) + rng.uniform(-0.2, 0.2))));
        place = glm::rotate(place, rng.uniform(0, 6.28), dvec3(0, 1, 0));
        node.instances.push_back(glm::scale(place, dvec3(rng.uniform(0.8, 1.2))));
    }
    s.nodes.push_back(node);
    return s;
}

}  // namespace stipple::grow
