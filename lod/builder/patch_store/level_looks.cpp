#include "lod/builder/patch_store/level_looks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "engine/base/numbers.h"
#include "lod/primitives/patch_map.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

uint32_t facingOf(const glm::vec3& n) {
    const glm::vec3 a = glm::abs(n);
    const uint32_t axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
    return 2 * (axis + (n[static_cast<int>(axis)] < 0 ? 3u : 0u));
}
/// Cosine between the way that a cell faces and a normal.
double cosineOf(uint32_t facing, const glm::vec3& n) {
    const uint32_t way = facing / 2;
    return (way >= 3 ? -1.0 : 1.0) * static_cast<double>(n[static_cast<int>(way % 3)]);
}

}  // namespace

bool LevelLooks::isBefore(const Cell& a, const Cell& b) {
    return std::tie(a.z, a.y, a.x, a.facing) < std::tie(b.z, b.y, b.x, b.facing);
}

/// One of each. Of equals the first comes first, so the order in which they were added counts for rounding alone.
void LevelLooks::settle() {
    std::stable_sort(cells_.begin(), cells_.end(), isBefore);
    size_t kept = 0;
    for (size_t i = 0, end = 0; i < cells_.size(); i = end) {
        Cell sum = cells_[i];
        std::array<double, 256> ofMaterial{};
        for (end = i; end < cells_.size() && !isBefore(cells_[i], cells_[end]); ++end) {
            const Cell& c = cells_[end];
            ofMaterial.at(c.material) += c.most;
            if (end == i) continue;
            sum.weight += c.weight;
            sum.colour += c.colour;
            sum.normal += c.normal;
        }
        const auto most = std::max_element(ofMaterial.begin(), ofMaterial.end());
        sum.material = static_cast<uint32_t>(most - ofMaterial.begin());
        sum.most = *most;
        cells_[kept++] = sum;
    }
    cells_.resize(kept);
}

void LevelLooks::add(const std::vector<Seen>& seen, double step) {
    for (const Seen& s : seen) {
        const glm::dvec3 at = glm::floor(s.place / step);
        Cell c;
        c.x = toWhole<int64_t>(at.x);
        c.y = toWhole<int64_t>(at.y);
        c.z = toWhole<int64_t>(at.z);
        c.facing = facingOf(s.look.normal);
        c.material = s.look.material;
        c.weight = c.most = s.weight;
        c.normal = s.weight * glm::dvec3(s.look.normal);
        for (int a = 0; a < 3; ++a)
            c.colour[a] =
                s.weight * double{shared::linearFromSrgb(static_cast<float>(s.look.colour >> (8 * a) & 255u) / 255.0f)};
        cells_.push_back(c);
        if (s.look.light == 0) continue;
        ++c.facing;
        c.material = 0;
        c.most = keepsColour(s.look.light) ? s.weight : 0;
        c.normal = glm::dvec3(0);
        c.colour = s.weight * glm::dvec3(emissionOf(s.look.light));
        cells_.push_back(c);
    }
    settle();
}

void LevelLooks::add(const LevelLooks& other) {
    cells_.insert(cells_.end(), other.cells_.begin(), other.cells_.end());
    settle();
}

LevelLooks LevelLooks::halved() const {
    LevelLooks out = *this;
    for (Cell& c : out.cells_) {
        c.x >>= 1;
        c.y >>= 1;
        c.z >>= 1;
    }
    out.settle();
    return out;
}

LevelLooks LevelLooks::within(const glm::dvec3& lo, const glm::dvec3& hi, double step) const {
    LevelLooks out;
    for (const Cell& c : cells_) {
        const glm::dvec3 middle =
            step * (glm::dvec3(static_cast<double>(c.x), static_cast<double>(c.y), static_cast<double>(c.z)) + 0.5);
        if (glm::all(glm::lessThanEqual(lo, middle)) && glm::all(glm::lessThan(middle, hi))) out.cells_.push_back(c);
    }
    return out;
}

std::optional<SurfaceLook> LevelLooks::at(const glm::dvec3& place, const glm::vec3& normal, double step) const {
    // Trilinear between the middles of the eight cells around it; where those are none, all within two steps; and, for
    // slivers, whose normals may be any, those that face any way.
    const glm::dvec3 q = place / step - 0.5, low = glm::floor(q);
    for (const auto& [reach, facesAny] : {std::pair{1.0, false}, {2.0, false}, {2.0, true}}) {
        glm::dvec3 colour(0), sum(0), emission(0);
        double weights = 0, unlit = 0;
        std::array<double, 256> ofMaterial{};
        const auto first = static_cast<int64_t>(reach) - 1, last = static_cast<int64_t>(reach);
        for (int64_t k = -first; k <= last; ++k)
            for (int64_t j = -first; j <= last; ++j) {
                Cell from;
                from.x = toWhole<int64_t>(low.x) - first;
                from.y = toWhole<int64_t>(low.y) + j;
                from.z = toWhole<int64_t>(low.z) + k;
                auto c = std::lower_bound(cells_.begin(), cells_.end(), from, isBefore);
                for (; c != cells_.end() && c->z == from.z && c->y == from.y && c->x <= from.x + first + last; ++c) {
                    const glm::dvec3 off(q.x - static_cast<double>(c->x), q.y - static_cast<double>(c->y),
                                         q.z - static_cast<double>(c->z));
                    const glm::dvec3 near = glm::max(glm::dvec3(0), reach - glm::abs(off));
                    const double w =
                        near.x * near.y * near.z * (facesAny ? 1.0 : std::max(0.0, cosineOf(c->facing, normal)));
                    if (!(w > 0)) continue;
                    if (c->isOfLight()) {
                        const double own = w / (c == cells_.begin() ? *c : *(c - 1)).weight;  // of the surface's
                        emission += own * c->colour;
                        unlit += own * c->most;
                        continue;
                    }
                    // Each cell as much as the next: that one holds more samples says nothing of its colour.
                    weights += w;
                    colour += w / c->weight * c->colour;
                    sum += w / c->weight * c->normal;
                    ofMaterial.at(c->material) += w * c->most / c->weight;
                }
            }
        if (!(weights > 1e-9)) continue;
        SurfaceLook out;
        out.normal = glm::length(sum) > 1e-6 ? glm::vec3(glm::normalize(sum)) : normal;
        for (int a = 0; a < 3; ++a)
            out.colour |= unitToByte(shared::srgbFromLinear(static_cast<float>(std::min(colour[a] / weights, 1.0))))
                          << (8 * a);
        out.light = packLight(glm::vec3(emission / weights), unlit >= 0.5 * weights);
        out.material =
            static_cast<uint8_t>(std::max_element(ofMaterial.begin(), ofMaterial.end()) - ofMaterial.begin());
        return out;
    }
    return {};
}

namespace {

/// Of the texels of a drawn cell, but for those that are its right and upper neighbours'.
void addCell(const Patch& p, const MapLevel& map, uint32_t i, uint32_t j, const glm::dvec3& origin,
             const glm::dmat3& frame, std::vector<LevelLooks::Seen>& seen) {
    const uint32_t k = 1u << p.map.density;
    const double side = double{p.step} / k;
    const std::array<size_t, 4> corner{p.at(i, j), p.at(i + 1, j), p.at(i, j + 1), p.at(i + 1, j + 1)};
    for (uint32_t y = 0; y < k; ++y)
        for (uint32_t x = 0; x < k; ++x) {
            const double u = static_cast<double>(x) / k, v = static_cast<double>(y) / k;
            const std::array<double, 4> w{(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
            double height = 0;
            glm::dvec3 normal(0);
            size_t most = 0;
            for (size_t c = 0; c < 4; ++c) {
                height += w.at(c) * p.heights[corner.at(c)];
                normal += w.at(c) * glm::dvec3(shared::octDecode(p.normals[corner.at(c)]));
                if (w.at(c) > w.at(most)) most = c;
            }
            const size_t t = map.at(i * k + x, j * k + y);
            if (!map.normals.empty()) normal = glm::dvec3(shared::octDecode(map.normals[t]));
            const uint8_t ofSample = p.materials.empty() ? uint8_t{0} : p.materials[corner.at(most)];
            const auto material = p.map.hasMaterials ? static_cast<uint8_t>(map.colours[t] >> 24) : ofSample;
            const glm::dvec3 onPlane((i + u) * double{p.step}, (j + v) * double{p.step}, p.quantum() * height);
            seen.push_back({origin + p.origin + frame * onPlane,
                            {glm::vec3(glm::normalize(frame * normal)), map.colours[t] & 0xffffffu, material,
                             map.light.empty() ? 0u : map.light[t]},
                            side * side});
        }
}

}  // namespace

void addSeen(const Patch& p, const glm::dvec3& origin, std::vector<LevelLooks::Seen>& seen) {
    const PatchSurface surface(p);
    if (p.map.density > 0) {
        const MapLevel map = mapOf(p);
        for (uint32_t j = 0; j + 1 < p.height; ++j)
            for (uint32_t i = 0; i + 1 < p.width; ++i)
                if (p.hasCell(i, j)) addCell(p, map, i, j, origin, surface.frame(), seen);
        return;
    }
    for (size_t s = 0; s < p.heights.size(); ++s) {
        if (p.heights[s] == 0) continue;
        const glm::vec3 normal(surface.frame() * glm::dvec3(shared::octDecode(p.normals[s])));
        const uint8_t material = p.materials.empty() ? uint8_t{0} : p.materials[s];
        seen.push_back({origin + surface.position(s),
                        {normal, p.colours[s], material, p.map.light.empty() ? 0u : p.map.light[s]},
                        double{p.step} * double{p.step}});
    }
}

void LevelLooks::get(ByteReader& from) {
    LevelLooks read;
    from.get(read.cells_);
    for (Cell& c : read.cells_) c.material = std::min(c.material, 255u);
    add(read);
}

}  // namespace stipple::lod
