// Versions by meshoptimizer, with and without the borders, and by hand where little is left: two triangles along a leaf
// or a twig.
#include "lod/builder/mesh/parts_versions.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>

#include "lod/primitives/triangle.h"

namespace stipple::lod {
namespace {

constexpr float kAnyError = 1e9f;   ///< the target is a number of triangles
constexpr float kMostArea = 1.5f;   ///< of a version, of the part's
constexpr size_t kMostProbes = 48;  ///< of each surface that are looked at for a cost

/// A part on its own: meshoptimizer looks at all vertices that it is given.
struct Alone {
    std::vector<uint32_t> vertices;  ///< ascending, local of the group
    std::vector<uint32_t> indices;   ///< into vertices
    std::vector<glm::vec3> position;
};

Alone aloneOf(const std::vector<uint32_t>& part, const LocalMesh& local) {
    Alone out;
    out.vertices = part;
    std::sort(out.vertices.begin(), out.vertices.end());
    out.vertices.erase(std::unique(out.vertices.begin(), out.vertices.end()), out.vertices.end());
    for (const uint32_t v : part)
        out.indices.push_back(static_cast<uint32_t>(std::lower_bound(out.vertices.begin(), out.vertices.end(), v) -
                                                    out.vertices.begin()));
    for (const uint32_t v : out.vertices) out.position.push_back(local.position[v] - local.position[out.vertices[0]]);
    return out;
}

/// All vertices lie at edges with one triangle, so that nothing can go while those stay: of most leaves. (False where
/// it would take long to say.)
bool isBorderOnly(const Alone& mesh) {
    constexpr size_t kFew = 64;
    const size_t vertices = mesh.position.size(), corners = mesh.indices.size();
    if (vertices > kFew || corners > 3 * kFew) return false;
    // Vertices of one position are a seam, which is no border.
    for (size_t v = 0; v < vertices; ++v)
        for (size_t w = 0; w < v; ++w)
            if (mesh.position[v] == mesh.position[w]) return false;
    uint64_t onBorder = 0;
    for (size_t i = 0; i < corners; ++i) {
        const uint32_t a = mesh.indices[i], b = mesh.indices[i % 3 == 2 ? i - 2 : i + 1];
        bool isOpen = true;
        for (size_t j = 0; j < corners && isOpen; ++j)
            isOpen = mesh.indices[j] != b || mesh.indices[j % 3 == 2 ? j - 2 : j + 1] != a;
        if (isOpen) onBorder |= uint64_t{1} << a | uint64_t{1} << b;
    }
    return onBorder == ~uint64_t{0} >> (kFew - vertices);
}

/// Largest distance of corners and centres of `from` from `to`; some of them where there are many.
float distanceOf(const Alone& mesh, const std::vector<uint32_t>& from, const std::vector<uint32_t>& to, float enough) {
    float worst = 0;
    // Around each triangle, with room for rounding: what is farther than the nearest so far is not looked at.
    float far2 = 0;
    for (const glm::vec3& p : mesh.position) far2 = std::max(far2, glm::dot(p, p));
    const float slack = 1e-5f * std::sqrt(far2);
    thread_local std::vector<glm::vec4> balls;
    balls.clear();
    for (size_t i = 0; i < to.size(); i += 3) {
        const glm::vec3 &a = mesh.position[to[i]], &b = mesh.position[to[i + 1]], &c = mesh.position[to[i + 2]];
        const glm::vec3 m = (a + b + c) * (1.0f / 3);
        const glm::vec3 da = a - m, db = b - m, dc = c - m;
        balls.emplace_back(
            m, slack + 1.001f * std::sqrt(std::max({glm::dot(da, da), glm::dot(db, db), glm::dot(dc, dc)})));
    }
    const auto look = [&](const glm::vec3& p) {
        float best = 3e38f, reach = 1e19f;
        for (size_t i = 0; i < to.size() && best > worst * worst; i += 3) {
            const glm::vec3 off = p - glm::vec3(balls[i / 3]);
            const float within = reach + balls[i / 3].w;
            if (glm::dot(off, off) > within * within) continue;
            const glm::vec3 &a = mesh.position[to[i]], &b = mesh.position[to[i + 1]], &c = mesh.position[to[i + 2]];
            const glm::vec2 w = closestWeights(p, a, b, c);
            const glm::vec3 d = p - (a + w.x * (b - a) + w.y * (c - a));
            if (glm::dot(d, d) >= best) continue;
            best = glm::dot(d, d);
            reach = 1.001f * std::sqrt(best);
        }
        worst = std::max(worst, std::sqrt(best));
    };
    thread_local std::vector<uint8_t> seen;  // corners are those of several triangles
    seen.assign(mesh.position.size(), 0);
    const size_t triangles = from.size() / 3, step = triangles / kMostProbes + 1;
    for (size_t t = 0; t < triangles && worst <= enough; t += step) {
        glm::vec3 sum(0);
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t v = from[3 * t + k];
            if (seen[v] == 0) look(mesh.position[v]);
            seen[v] = 1;
            sum += mesh.position[v];
        }
        look(sum * (1.0f / 3));
    }
    return worst;
}

float areaOf(const Alone& mesh, const std::vector<uint32_t>& indices) {
    float sum = 0;
    for (size_t i = 0; i < indices.size(); i += 3) {
        const glm::vec3& a = mesh.position[indices[i]];
        sum += 0.5f * glm::length(glm::cross(mesh.position[indices[i + 1]] - a, mesh.position[indices[i + 2]] - a));
    }
    return sum;
}

/// The sum of the normals.
glm::vec3 facingOf(const Alone& mesh, const std::vector<uint32_t>& indices) {
    glm::vec3 sum(0);
    for (size_t i = 0; i < indices.size(); i += 3) {
        const glm::vec3& a = mesh.position[indices[i]];
        sum += glm::cross(mesh.position[indices[i + 1]] - a, mesh.position[indices[i + 2]] - a);
    }
    return sum;
}

/// Two triangles between the ends of a long part, or between its ends and its sides; from both sides where each shows
/// one only.
void addStrips(const Alone& mesh, const PartShape& shape, bool isTwoSided,
               std::vector<std::vector<uint32_t>>& candidates) {
    const glm::vec3 axis(shape.axis);
    const auto along = [&](uint32_t v) { return glm::dot(mesh.position[v], axis); };
    const auto count = static_cast<uint32_t>(mesh.position.size());
    uint32_t low = 0, high = 0;
    for (uint32_t v = 1; v < count; ++v) {
        if (along(v) < along(low)) low = v;
        if (along(v) > along(high)) high = v;
    }
    // What shows both sides is flat: it stays as it faces. Of the rest the side on which it is widest.
    const glm::vec3 middle = 0.5f * (mesh.position[low] + mesh.position[high]);
    const auto across = [&](uint32_t v) {
        const glm::vec3 d = mesh.position[v] - middle;
        return d - glm::dot(d, axis) * axis;
    };
    glm::vec3 side = isTwoSided ? glm::cross(axis, facingOf(mesh, mesh.indices)) : glm::vec3(0);
    for (uint32_t v = 0; v < count && side == glm::vec3(0); ++v) side = across(v);
    if (!isTwoSided) {
        for (uint32_t v = 0; v < count; ++v)
            for (uint32_t w = 0; w < v; ++w) {
                const glm::vec3 d = across(v) - across(w);
                if (glm::dot(d, d) > glm::dot(side, side)) side = d;
            }
    }
    const float span = along(high) - along(low);
    const auto extreme = [&](float sign, float from, float to) {
        uint32_t best = ~0u;
        for (uint32_t v = 0; v < count; ++v) {
            const float t = along(v) - along(low);
            if (t < from * span || t > to * span) continue;
            if (best == ~0u || sign * glm::dot(across(v), side) > sign * glm::dot(across(best), side)) best = v;
        }
        return best;
    };
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
        for (const uint32_t v : {a, b, c, d})
            if (v == ~0u) return;
        if (a == b || a == c || a == d || b == c || b == d || c == d) return;
        std::vector<uint32_t> strip{a, b, c, a, c, d};
        if (!isTwoSided)
            strip.insert(strip.end(), {a, c, b, a, d, c});
        else if (glm::dot(facingOf(mesh, strip), facingOf(mesh, mesh.indices)) < 0)
            for (size_t i = 0; i < strip.size(); i += 3)
                std::swap(strip[i + 1], strip[i + 2]);  // else it is lit from behind
        candidates.push_back(std::move(strip));
    };
    constexpr float kEnd = 0.25f;  // of the length
    const uint32_t right = extreme(1, 0.2f, 0.8f), left = extreme(-1, 0.2f, 0.8f);
    add(extreme(1, 0, kEnd), extreme(1, 1 - kEnd, 1), extreme(-1, 1 - kEnd, 1), extreme(-1, 0, kEnd));
    add(right, high, left, low);  // folded between the sides, as leaves bend
}

}  // namespace

PartShape shapeOf(const std::vector<uint32_t>& indices, const LocalMesh& local) {
    PartShape shape;
    const auto at = [&](uint32_t v) { return glm::dvec3(local.position[v]); };
    for (const uint32_t v : indices) shape.centre += at(v) / static_cast<double>(indices.size());
    glm::dmat3 m(0);
    for (const uint32_t v : indices) m += glm::outerProduct(at(v) - shape.centre, at(v) - shape.centre);
    const double trace = m[0][0] + m[1][1] + m[2][2];
    if (!(trace > 0)) return shape;
    // Squared a few times, the matrix is its longest axis; the inverse's trace would be the shortest, its determinant
    // the product of all three.
    m *= 1 / trace;
    const double product = std::max(glm::determinant(m), 0.0);
    const double pairs = m[0][0] * m[1][1] - m[0][1] * m[1][0] + m[0][0] * m[2][2] - m[0][2] * m[2][0] +
                         m[1][1] * m[2][2] - m[1][2] * m[2][1];
    glm::dmat3 power = m;
    for (int k = 0; k < 8; ++k) {
        power = power * power;
        power *= 1 / (power[0][0] + power[1][1] + power[2][2]);
    }
    size_t column = 0;
    for (size_t k = 1; k < 3; ++k)
        if (power[static_cast<int>(k)][static_cast<int>(k)] > power[static_cast<int>(column)][static_cast<int>(column)])
            column = k;
    shape.axis = glm::normalize(power[static_cast<int>(column)]);
    const double longest = glm::dot(shape.axis, m * shape.axis);
    shape.thickness = pairs > 0 ? std::sqrt(product / pairs / longest) : 0;  // the shortest is about product / pairs
    return shape;
}

std::vector<PartVersion> versionsOf(const std::vector<uint32_t>& part, const PartShape& shape, const LocalMesh& local,
                                    bool isTwoSided) {
    const Alone mesh = aloneOf(part, local);
    std::vector<std::vector<uint32_t>> candidates;
    const size_t triangles = part.size() / 3;
    const bool isAllBorder = isBorderOnly(mesh);
    for (const unsigned options : {unsigned{meshopt_SimplifyLockBorder}, 0u}) {
        if (options != 0 && isAllBorder) continue;
        for (const size_t share : {size_t{2}, size_t{4}}) {
            if (triangles / share < 2) continue;
            std::vector<uint32_t> coarse(part.size());
            coarse.resize(meshopt_simplify(coarse.data(), mesh.indices.data(), part.size(), &mesh.position[0].x,
                                           mesh.position.size(), sizeof(glm::vec3), triangles / share * 3, kAnyError,
                                           options, nullptr));
            if (!coarse.empty() && coarse.size() < part.size()) candidates.push_back(std::move(coarse));
        }
    }
    constexpr size_t kMostForStrip = 64;
    if (triangles <= kMostForStrip && shape.thickness <= kThickPart) addStrips(mesh, shape, isTwoSided, candidates);
    // What bends may be far too wide if it is cut short.
    const float most = kMostArea * areaOf(mesh, mesh.indices);
    std::erase_if(candidates, [&](const auto& c) { return c.size() >= part.size() || areaOf(mesh, c) > most; });
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.size() < b.size(); });
    // From coarse to fine: what is no nearer than a coarser one is not worth its triangles.
    std::vector<PartVersion> out;
    for (auto& c : candidates) {
        const float enough = out.empty() ? 3e38f : out.back().cost;
        float cost = distanceOf(mesh, mesh.indices, c, enough);
        if (cost < enough) cost = std::max(cost, distanceOf(mesh, c, mesh.indices, enough));
        if (cost >= enough) continue;
        for (uint32_t& v : c) v = mesh.vertices[v];
        if (!out.empty() && out.back().indices.size() == c.size()) out.pop_back();
        out.push_back({std::move(c), cost});
    }
    out.push_back({part, 0});
    std::reverse(out.begin(), out.end());
    return out;
}

std::vector<uint32_t> chooseVersions(const std::vector<std::vector<PartVersion>>& parts, size_t target) {
    std::vector<float> costs{0};
    for (const auto& versions : parts)
        for (const PartVersion& v : versions) costs.push_back(v.cost);
    std::sort(costs.begin(), costs.end());
    std::vector<uint32_t> chosen(parts.size());
    const auto sizeAt = [&](float cost) {
        size_t sum = 0;
        for (size_t k = 0; k < parts.size(); ++k) {
            chosen[k] = 0;
            while (chosen[k] + 1 < parts[k].size() && parts[k][chosen[k] + 1].cost <= cost) ++chosen[k];
            sum += parts[k][chosen[k]].indices.size();
        }
        return sum;
    };
    const auto isTooMuch = [&](float cost) { return sizeAt(cost) > target; };
    const auto at = std::partition_point(costs.begin(), costs.end(), isTooMuch);
    sizeAt(at == costs.end() ? costs.back() : *at);
    return chosen;
}

}  // namespace stipple::lod
