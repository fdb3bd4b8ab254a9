// Triangles as they come, to a welded mesh: one lattice, every vertex once, nothing degenerate, twice or not finite.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <tuple>

#include "engine/base/numbers.h"
#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/morton.h"
#include "lod/primitives/octahedral.h"

namespace stipple::lod {
namespace {

constexpr int kLatticeBits = 24;
constexpr size_t kGrain = 16384;

/// Bit by bit: two zeros of different sign are two values. Equal positions stand side by side.
std::array<uint32_t, 8> wordsOf(const shared::MeshVertex& v) { return std::bit_cast<std::array<uint32_t, 8>>(v); }

/// Keys of vertices along a Morton curve: of those of a wide lattice within their own extent.
class CurveKeys {
  public:
    explicit CurveKeys(const LatticeVertices& vertices) {
        uint64_t any = 0;
        if (vertices.high.empty()) {
            for (const shared::MeshVertex& v : vertices.low) any |= static_cast<uint32_t>(v.x | v.y | v.z);
            drop_ = std::max(static_cast<int>(std::bit_width(any)), kLatticeBits) - static_cast<int>(kShortBits);
            return;
        }
        Steps lo(std::numeric_limits<int64_t>::max()), hi(std::numeric_limits<int64_t>::min());
        for (size_t i = 0; i < vertices.size(); ++i) {
            lo = glm::min(lo, vertices.at(i));
            hi = glm::max(hi, vertices.at(i));
        }
        first_ = lo;
        for (int a = 0; a < 3; ++a) any |= static_cast<uint64_t>(hi[a]) - static_cast<uint64_t>(lo[a]);
        drop_ = std::max(static_cast<int>(std::bit_width(any)) - static_cast<int>(kShortBits), 0);
    }
    uint64_t of(const Steps& at) const {
        const auto along = [&](int a) { return static_cast<uint64_t>(at[a] - first_[a]) >> drop_; };
        return shortMortonCode(along(0), along(1), along(2));
    }

  private:
    Steps first_{0};
    int drop_ = 0;  ///< bits that a key leaves out
};

bool hasArea(const Steps& a, const Steps& b, const Steps& c) {
    return glm::cross(glm::dvec3(b - a), glm::dvec3(c - a)) != glm::dvec3(0);
}

/// Below 2^40 the number itself, then 2^40 for each octave: monotone, to 2^-40 of it.
int64_t inLogarithms(int64_t v) {
    constexpr int kLinear = 40;
    const uint64_t size = v < 0 ? 0 - static_cast<uint64_t>(v) : static_cast<uint64_t>(v);
    const int octave = static_cast<int>(std::bit_width(size)) - 1 - kLinear;  // from 2^40 on: 0
    if (octave < 0) return v;
    const auto key = static_cast<int64_t>((size >> octave) + (static_cast<uint64_t>(octave) << kLinear));
    return v < 0 ? -key : key;
}
Steps inLogarithms(const Steps& v) { return {inLogarithms(v.x), inLogarithms(v.y), inLogarithms(v.z)}; }

}  // namespace

glm::u64vec3 keyPlace(const Steps& at, const Lattice& lattice) {
    return lattice.isWide() ? glm::u64vec3(inLogarithms(at) - lattice.firstKey) : glm::u64vec3(at);
}

PlacedBlock placeBlock(const TriangleMesh& in, const Lattice& lattice, Executor& executor, Placed what) {
    PlacedBlock out;
    out.given = in.indices.size() / 3;
    auto& vertices = out.soup.vertices.low;
    auto& high = out.soup.vertices.high;
    vertices.resize(in.position.size());
    if (lattice.isWide()) high.resize(vertices.size());
    constexpr uint8_t kNotFinite = 1, kTooFar = 2;
    std::vector<uint8_t> isBad(vertices.size());
    const auto place = [&](size_t i, double& rounding) {
        shared::MeshVertex& v = vertices[i];
        isBad[i] = !isFinite(in.position[i]) ? kNotFinite : lattice.reaches(in.position[i]) ? 0 : kTooFar;
        const glm::dvec3 p = isBad[i] ? lattice.origin : in.position[i];
        const glm::dvec3 q = glm::floor((p - lattice.origin) / lattice.unit + 0.5);
        const Steps at(toWhole<int64_t>(q.x), toWhole<int64_t>(q.y), toWhole<int64_t>(q.z));
        v.x = static_cast<int>(static_cast<uint32_t>(at.x));
        v.y = static_cast<int>(static_cast<uint32_t>(at.y));
        v.z = static_cast<int>(static_cast<uint32_t>(at.z));
        if (!high.empty()) high[i] = glm::ivec3(at >> int64_t{32});
        const glm::dvec3 off = glm::abs(lattice.origin + q * lattice.unit - p);
        rounding = std::max({rounding, off.x, off.y, off.z});
        if (what == Placed::positions) return;
        const glm::vec3 n = in.normal.empty() ? glm::vec3(0) : in.normal[i];
        const bool isFlat = !hasDirection(n);
        v.normal = isFlat ? octEncode({0, 0, 1}) : octEncode(n);
        v.colour = in.colour.empty() ? ~0u : in.colour[i];
        const glm::vec2 uv = in.uv.empty() ? glm::vec2(0) : in.uv[i];
        const bool hasUv = std::isfinite(uv.x + uv.y) && std::abs(uv.x) < 1e6f && std::abs(uv.y) < 1e6f;
        v.u = hasUv ? uv.x : 0.0f;
        v.v = hasUv ? uv.y : 0.0f;
        v.surface = (in.surface.empty() ? 0u : in.surface[i]) | (isFlat ? shared::kSurfaceFlat : 0u);
    };
    const size_t parts = vertices.size() / kGrain + 1;
    std::vector<double> rounding(parts);
    executor.parallelFor(parts, 1, [&](size_t begin, size_t end) {
        for (size_t p = begin; p < end; ++p)
            for (size_t i = p * vertices.size() / parts; i < (p + 1) * vertices.size() / parts; ++i)
                place(i, rounding[p]);
    });
    out.rounding = *std::max_element(rounding.begin(), rounding.end());
    out.soup.indices.reserve(in.indices.size());
    for (size_t i = 0; i + 3 <= in.indices.size(); i += 3) {
        const uint32_t* const t = &in.indices[i];
        if (const int bad = isBad[t[0]] | isBad[t[1]] | isBad[t[2]]; bad != 0) {
            ++((bad & kNotFinite) != 0 ? out.notFinite : out.tooFar);
            continue;
        }
        const Steps a = out.soup.vertices.at(t[0]), b = out.soup.vertices.at(t[1]), c = out.soup.vertices.at(t[2]);
        if (!hasArea(a, b, c)) {
            ++out.degenerate;
            continue;
        }
        out.soup.indices.insert(out.soup.indices.end(), t, t + 3);
        const glm::u64vec3 middle = keyPlace((a + b + c) / int64_t{3}, lattice);
        out.x.push_back(static_cast<uint32_t>(middle.x));
        out.y.push_back(static_cast<uint32_t>(middle.y));
        out.z.push_back(static_cast<uint32_t>(middle.z));
        if (lattice.isWide()) out.high.push_back(highOf({middle.x, middle.y, middle.z}));
    }
    return out;
}

Result<void> forPlacedBlocks(const MeshSource& source, const Lattice& lattice, Executor& executor, Placed what,
                             uint64_t unplaced, const std::function<Result<void>(PlacedBlock& block)>& use) {
    TriangleMesh block;
    PlacedBlock next;
    std::unique_ptr<Executor::Beside> placing;  // ends before what it writes to
    const auto taken = [&] {
        placing->wait();
        placing.reset();
        return std::move(next);
    };
    uint64_t number = 0;
    STIPPLE_TRY(source.read([&](const TriangleMesh& read) -> Result<void> {
        if (number++ < unplaced) {
            PlacedBlock known;
            known.given = read.indices.size() / 3;
            return use(known);
        }
        if (executor.threads() == 1) {
            PlacedBlock only = placeBlock(read, lattice, executor, what);
            return use(only);
        }
        std::optional<PlacedBlock> before;
        if (placing != nullptr) before = taken();
        block = read;  // the source goes on with its own
        placing = executor.beside([&] { next = placeBlock(block, lattice, executor, what); });
        return before ? use(*before) : Result<void>();
    }));
    if (placing == nullptr) return {};
    PlacedBlock last = taken();
    return use(last);
}

WeldedMesh weld(Soup& soup) {
    struct Item {
        uint64_t key;
        uint32_t vertex;
    };
    const LatticeVertices& v = soup.vertices;
    std::vector<Item> order(v.size());
    const CurveKeys keys(v);
    for (uint32_t i = 0; i < v.size(); ++i) order[i] = {keys.of(v.at(i)), i};
    const auto highOf = [&](uint32_t i) {
        return v.high.empty() ? std::array<int, 3>{} : std::array<int, 3>{v.high[i].x, v.high[i].y, v.high[i].z};
    };
    const bool isWide = !v.high.empty();
    std::sort(order.begin(), order.end(), [&](const Item& a, const Item& b) {
        if (a.key != b.key) return a.key < b.key;
        if (isWide && v.high[a.vertex] != v.high[b.vertex]) return highOf(a.vertex) < highOf(b.vertex);
        return wordsOf(v.low[a.vertex]) < wordsOf(v.low[b.vertex]);
    });
    WeldedMesh out;
    std::vector<uint32_t> place(v.size());
    uint32_t positions = 0;
    for (size_t i = 0; i < order.size(); ++i) {
        const uint32_t vertex = order[i].vertex;
        const size_t last = out.vertices.size() - 1;
        const bool isFirst = i == 0;
        const bool isSamePlace = !isFirst && out.vertices.at(last) == v.at(vertex);
        if (!isSamePlace || wordsOf(out.vertices.low[last]) != wordsOf(v.low[vertex])) {
            positions += isFirst || isSamePlace ? 0 : 1;
            out.vertices.add(v, vertex);
            out.position.push_back(positions);
        }
        place[vertex] = static_cast<uint32_t>(out.vertices.size() - 1);
    }
    for (uint32_t& i : soup.indices) i = place[i];
    soup.vertices = out.vertices;
    return out;
}

uint64_t sortTriangles(WeldedMesh& mesh, std::vector<uint32_t>& indices) {
    struct Item {
        uint64_t key;
        std::array<uint32_t, 3> corners;
        bool operator<(const Item& o) const { return std::tie(key, corners) < std::tie(o.key, o.corners); }
        bool operator==(const Item& o) const { return key == o.key && corners == o.corners; }
    };
    std::vector<Item> order(indices.size() / 3);
    const CurveKeys keys(mesh.vertices);
    for (size_t i = 0; i < order.size(); ++i) {
        auto& t = order[i].corners;
        std::copy_n(indices.begin() + static_cast<ptrdiff_t>(3 * i), 3, t.begin());
        // The smallest index first: equal triangles are then equal words, and the winding stays.
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        order[i].key = keys.of((mesh.at(t[0]) + mesh.at(t[1]) + mesh.at(t[2])) / int64_t{3});
    }
    std::sort(order.begin(), order.end());
    const size_t before = order.size();
    order.erase(std::unique(order.begin(), order.end()), order.end());
    // Vertices in the order of their first use: what is used together lies together.
    std::vector<uint32_t> place(mesh.vertices.size(), ~0u);
    WeldedMesh used;
    indices.clear();
    for (const Item& item : order)
        for (const uint32_t vertex : item.corners) {
            if (place[vertex] == ~0u) {
                place[vertex] = static_cast<uint32_t>(used.vertices.size());
                used.vertices.add(mesh.vertices, vertex);
                used.position.push_back(mesh.position[vertex]);
            }
            indices.push_back(place[vertex]);
        }
    mesh = std::move(used);
    return before - order.size();
}

}  // namespace stipple::lod
