// Triangles as they come, to a welded mesh: one lattice, every vertex once, nothing degenerate, twice or not finite.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "engine/base/hash.h"
#include "lod/build/mesh/mesh_work.h"
#include "lod/build/morton.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr int kLatticeBits = 24;

bool isFinite(const glm::dvec3& p) { return std::isfinite(p.x + p.y + p.z); }

/// The first of equal items stands for all; `hashOf` and `equal` take indices. Each part of the hashes has a table of
/// its own.
template <typename Hash, typename Equal>
std::vector<uint32_t> firstOfEqual(size_t count, const Hash& hashOf, const Equal& equal, Executor& executor) {
    constexpr size_t kParts = 4;
    size_t slots = 16;
    while (slots < 2 * count / kParts) slots *= 2;
    std::vector<uint32_t> first(count);
    executor.parallelFor(kParts, 1, [&](size_t begin, size_t end) {
        for (size_t part = begin; part < end; ++part) {
            std::vector<uint32_t> table(slots, ~0u);
            size_t mask = slots - 1, used = 0;
            const auto find = [&](uint64_t hash, uint32_t i) -> uint32_t& {
                size_t slot = hash & mask;
                while (table[slot] != ~0u && !equal(table[slot], i)) slot = (slot + 1) & mask;
                return table[slot];
            };
            for (uint32_t i = 0; i < count; ++i) {
                const uint64_t hash = hashOf(i);
                if (hash >> 62 != part) continue;
                uint32_t& entry = find(hash, i);
                if (entry == ~0u) {
                    entry = i;
                    ++used;
                }
                first[i] = entry;
                if (2 * used <= mask) continue;
                const std::vector<uint32_t> old = std::move(table);  // more than its share: twice the room
                table.assign(2 * old.size(), ~0u);
                mask = table.size() - 1;
                for (const uint32_t k : old)
                    if (k != ~0u) find(hashOf(k), k) = k;
            }
        }
    });
    return first;
}

/// Bit by bit: two zeros of different sign are two values.
std::array<uint32_t, 8> wordsOf(const shared::MeshVertex& v) { return std::bit_cast<std::array<uint32_t, 8>>(v); }

uint64_t mix(uint64_t h) {
    h ^= h >> 33;
    h *= 0xff51afd7ed558ccdull;
    h ^= h >> 29;
    h *= 0x9e3779b97f4a7c15ull;
    return h ^ h >> 32;
}

void placeOnLattice(const TriangleMesh& in, WeldedMesh& out, Executor& executor) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : in.position) {
        if (!isFinite(p)) continue;
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    if (lo.x > hi.x) lo = hi = glm::dvec3(0);
    const double extent = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z, 1e-30});
    out.unit = std::exp2(std::floor(std::log2(extent)) + 1 - kLatticeBits);
    // Whole steps from zero, so that coordinates that lie on the lattice stay exact.
    out.origin = glm::floor(lo / out.unit) * out.unit;
    out.vertices.resize(in.position.size());
    const auto place = [&](size_t i, double& rounding) {
        shared::MeshVertex& v = out.vertices[i];
        const glm::dvec3 p = isFinite(in.position[i]) ? in.position[i] : lo;
        const glm::dvec3 q = glm::floor((p - out.origin) / out.unit + 0.5);
        v.x = static_cast<int>(q.x);
        v.y = static_cast<int>(q.y);
        v.z = static_cast<int>(q.z);
        const glm::dvec3 off = glm::abs(out.origin + q * out.unit - p);
        rounding = std::max({rounding, off.x, off.y, off.z});
        const glm::vec3 n = in.normal.empty() ? glm::vec3(0) : in.normal[i];
        const float length = glm::length(n);
        const bool isFlat = !(length > 1e-20f) || !std::isfinite(length);
        v.normal = isFlat ? octEncode({0, 0, 1}) : octEncode(n);
        v.colour = in.colour.empty() ? ~0u : in.colour[i];
        const glm::vec2 uv = in.uv.empty() ? glm::vec2(0) : in.uv[i];
        const bool hasUv = std::isfinite(uv.x + uv.y) && std::abs(uv.x) < 1e6f && std::abs(uv.y) < 1e6f;
        v.u = hasUv ? uv.x : 0.0f;
        v.v = hasUv ? uv.y : 0.0f;
        v.surface = (in.surface.empty() ? 0u : in.surface[i]) | (isFlat ? shared::kSurfaceFlat : 0u);
    };
    constexpr size_t kParts = 64;
    std::array<double, kParts> rounding{};
    executor.parallelFor(kParts, 1, [&](size_t begin, size_t end) {
        for (size_t p = begin; p < end; ++p)
            for (size_t i = p * in.position.size() / kParts; i < (p + 1) * in.position.size() / kParts; ++i)
                place(i, rounding[p]);
    });
    out.rounding = *std::max_element(rounding.begin(), rounding.end());
}

}  // namespace

WeldedMesh weldMesh(TriangleMesh in, Executor& executor) {
    WeldedMesh out;
    placeOnLattice(in, out, executor);
    std::vector<uint8_t> isBad(in.position.size());
    for (size_t i = 0; i < isBad.size(); ++i) isBad[i] = isFinite(in.position[i]) ? 0 : 1;
    std::vector<uint32_t> indices = std::move(in.indices);
    in = {};

    // Equal vertices are one.
    auto& v = out.vertices;
    const std::vector<uint32_t> same = firstOfEqual(
        v.size(), [&](uint32_t i) { return hashBytes(&v[i], sizeof(v[i])); },
        [&](uint32_t a, uint32_t b) { return wordsOf(v[a]) == wordsOf(v[b]); }, executor);
    // Dropped here: what has no area on the lattice.
    const auto cornersDiffer = [&](const uint32_t* t) {
        const glm::dvec3 a(v[t[0]].x, v[t[0]].y, v[t[0]].z), b(v[t[1]].x, v[t[1]].y, v[t[1]].z),
            c(v[t[2]].x, v[t[2]].y, v[t[2]].z);
        return glm::cross(b - a, c - a) != glm::dvec3(0);
    };
    size_t kept = 0;
    for (size_t i = 0; i + 3 <= indices.size(); i += 3) {
        if (isBad[indices[i]] || isBad[indices[i + 1]] || isBad[indices[i + 2]]) {
            ++out.notFinite;
            continue;
        }
        std::array<uint32_t, 3> t{same[indices[i]], same[indices[i + 1]], same[indices[i + 2]]};
        if (!cornersDiffer(t.data())) {
            ++out.degenerate;
            continue;
        }
        // The smallest index first: equal triangles are then equal words, and the winding stays.
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        std::copy(t.begin(), t.end(), indices.begin() + static_cast<ptrdiff_t>(kept));
        kept += 3;
    }
    indices.resize(kept);
    const size_t triangles = kept / 3;
    // Along a Morton curve of the centres, where equal ones stand side by side.
    struct Key {
        uint64_t code;
        uint32_t triangle;
    };
    std::vector<Key> order(triangles);
    executor.parallelFor(triangles, 65536, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const auto &a = v[indices[3 * i]], &b = v[indices[3 * i + 1]], &c = v[indices[3 * i + 2]];
            const auto middle = [](int x, int y, int z) {
                return static_cast<uint32_t>((int64_t{x} + y + z) / 3) >> (kLatticeBits - kMortonBits);
            };
            order[i] = {mortonCode(middle(a.x, b.x, c.x), middle(a.y, b.y, c.y), middle(a.z, b.z, c.z)),
                        static_cast<uint32_t>(i)};
        }
    });
    const auto cornersOf = [&](const Key& k) {
        const uint32_t* t = &indices[3 * size_t{k.triangle}];
        return std::array<uint32_t, 3>{t[0], t[1], t[2]};
    };
    const auto isBefore = [&](const Key& a, const Key& b) {
        if (a.code != b.code) return a.code < b.code;
        const auto ca = cornersOf(a), cb = cornersOf(b);
        return ca != cb ? ca < cb : a.triangle < b.triangle;
    };
    constexpr size_t kPieces = 4;
    const auto edge = [&](size_t p) { return order.begin() + static_cast<ptrdiff_t>(p * order.size() / kPieces); };
    executor.parallelFor(kPieces, 1, [&](size_t begin, size_t end) {
        for (size_t p = begin; p < end; ++p) std::sort(edge(p), edge(p + 1), isBefore);
    });
    executor.parallelFor(2, 1, [&](size_t begin, size_t end) {
        for (size_t p = begin; p < end; ++p)
            std::inplace_merge(edge(2 * p), edge(2 * p + 1), edge(2 * p + 2), isBefore);
    });
    std::inplace_merge(edge(0), edge(2), edge(4), isBefore);
    const auto isSame = [&](const Key& a, const Key& b) { return a.code == b.code && cornersOf(a) == cornersOf(b); };
    order.erase(std::unique(order.begin(), order.end(), isSame), order.end());
    out.duplicate = triangles - order.size();

    // Vertices in the order of their first use, unused ones left out.
    std::vector<uint32_t> place(v.size(), ~0u);
    std::vector<shared::MeshVertex> used;
    out.indices.reserve(order.size() * 3);
    for (const Key& k : order)
        for (size_t c = 0; c < 3; ++c) {
            const uint32_t vertex = indices[3 * size_t{k.triangle} + c];
            if (place[vertex] == ~0u) {
                place[vertex] = static_cast<uint32_t>(used.size());
                used.push_back(v[vertex]);
            }
            out.indices.push_back(place[vertex]);
        }
    v = std::move(used);
    out.position = firstOfEqual(
        v.size(),
        [&](uint32_t i) {
            return mix(static_cast<uint64_t>(v[i].x) +
                       mix(static_cast<uint64_t>(v[i].y) + mix(static_cast<uint64_t>(v[i].z) + 0x9e3779b97f4a7c15ull)));
        },
        [&](uint32_t a, uint32_t b) { return v[a].x == v[b].x && v[a].y == v[b].y && v[a].z == v[b].z; }, executor);
    return out;
}

}  // namespace stipple::lod
