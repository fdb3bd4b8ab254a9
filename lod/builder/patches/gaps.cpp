// The border of all patches is a set of directed edges, each of one triangle. A border vertex v near a border edge from
// a to b makes the triangle (b, a, v): that edge becomes an inner one, the two others become border, or inner where
// their other side is border. Nearest first (distance of v from the edge, then ids), as long as a triangle
//
//   is no wider than kReach steps, and faces as the normals at its corners do;
//   gives no directed edge twice (every edge has two triangles at most);
//   neither crosses another triangle nor lies over one of the same side (small holes that this leaves are closed by
//   what crosses nothing).
//
// What is looked at are only triangles at the border: to lie over others, a triangle has to lie over those first. Holes
// within one patch are closed as those between two.
#include "lod/builder/patches/gaps.h"

#include "shaders/shared/record.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

namespace stipple::lod {
namespace {

constexpr double kReach = 4;        ///< steps: longest side
constexpr double kFacing = 0.2;     ///< cosine between a triangle and the normals at its corners
constexpr double kOver = 1;         ///< steps: what lies nearer over another, on the same side, lies over it
constexpr double kTouching = 1e-6;  ///< steps: what overlaps by less does not
constexpr uint32_t kSmallHole = 16, kNoHole = ~0u;  ///< edges
constexpr size_t kMostCandidates = 16;              ///< of an edge

using Corners = std::array<uint32_t, 3>;
uint64_t edgeKey(uint32_t from, uint32_t to) { return uint64_t{from} << 32 | to; }

struct Vertex {
    glm::dvec3 at;
    glm::dvec3 normal;
    double step;
    PatchCorner corner;
    uint32_t borderEdges = 0;
};

/// Things by their place, in cubes.
class Cubes {
  public:
    explicit Cubes(double size) : size_(size) {}
    void add(const glm::dvec3& lo, const glm::dvec3& hi, uint32_t item) {
        if (!areFew(lo, hi))
            large_.push_back(item);
        else
            forCubes(lo, hi, [&](uint64_t cube) { items_[cube].push_back(item); });
    }
    template <typename Use>
    void visit(const glm::dvec3& lo, const glm::dvec3& hi, const Use& use) const {
        for (const uint32_t item : large_) use(item);
        if (!areFew(lo, hi)) {
            std::vector<uint32_t> all;
            for (const auto& [cube, items] : items_) all.insert(all.end(), items.begin(), items.end());
            std::sort(all.begin(), all.end());
            all.erase(std::unique(all.begin(), all.end()), all.end());
            for (const uint32_t item : all) use(item);
            return;
        }
        forCubes(lo, hi, [&](uint64_t cube) {
            if (const auto found = items_.find(cube); found != items_.end())
                for (const uint32_t item : found->second) use(item);
        });
    }

  private:
    static constexpr double kMostCubes = 65'536;  ///< that are walked; of what is larger, all is looked at
    bool areFew(const glm::dvec3& lo, const glm::dvec3& hi) const {
        const glm::dvec3 n = glm::floor(hi / size_) - glm::floor(lo / size_) + 1.0;
        return n.x * n.y * n.z <= kMostCubes;
    }
    template <typename Use>
    void forCubes(const glm::dvec3& lo, const glm::dvec3& hi, const Use& use) const {
        const auto low = glm::floor(lo / size_), high = glm::floor(hi / size_);
        for (double z = low.z; z <= high.z; ++z)
            for (double y = low.y; y <= high.y; ++y)
                for (double x = low.x; x <= high.x; ++x) {
                    const auto part = [](double v) { return static_cast<uint64_t>(static_cast<int64_t>(v)); };
                    use(part(x) * 0x9e3779b97f4a7c15ull ^ part(y) * 0xc2b2ae3d27d4eb4full ^
                        part(z) * 0x165667b19e3779f9ull);
                }
    }
    double size_;
    std::unordered_map<uint64_t, std::vector<uint32_t>> items_;
    std::vector<uint32_t> large_;
};

double distanceToSegment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 e = b - a;
    const double length = glm::dot(e, e);
    return glm::distance(p, a + (length > 0 ? std::clamp(glm::dot(p - a, e) / length, 0.0, 1.0) : 0.0) * e);
}

using Places = std::array<glm::dvec3, 3>;
glm::dvec3 crossOf(const Places& t) { return glm::cross(t[1] - t[0], t[2] - t[0]); }

/// Does the open segment from p to q pass through the inside of t?
bool passes(const glm::dvec3& p, const glm::dvec3& q, const Places& t) {
    const glm::dvec3 n = crossOf(t);
    const double from = glm::dot(n, p - t[0]), to = glm::dot(n, q - t[0]);
    if (!(from * to < 0)) return false;
    const glm::dvec3 at = p + (from / (from - to)) * (q - p);
    for (size_t k = 0; k < 3; ++k)
        if (!(glm::dot(n, glm::cross(t.at((k + 1) % 3) - t.at(k), at - t.at(k))) > 0)) return false;
    return true;
}

/// Do they overlap as seen along the first one's normal? (Their sides as axes; what only touches does not.)
bool overlap(const Places& a, const Places& b, const glm::dvec3& normal, double touching) {
    for (const Places* sides : {&a, &b})
        for (size_t k = 0; k < 3; ++k) {
            const glm::dvec3 side = sides->at((k + 1) % 3) - sides->at(k);
            const glm::dvec3 axis = glm::cross(side, normal);
            const double length = glm::length(axis);
            if (!(length > 0)) continue;
            double lowA = 1e300, highA = -1e300, lowB = 1e300, highB = -1e300;
            for (size_t i = 0; i < 3; ++i) {
                const double x = glm::dot(axis, a.at(i)) / length, y = glm::dot(axis, b.at(i)) / length;
                lowA = std::min(lowA, x);
                highA = std::max(highA, x);
                lowB = std::min(lowB, y);
                highB = std::max(highB, y);
            }
            if (highA <= lowB + touching || highB <= lowA + touching) return false;
        }
    return true;
}

class GapFiller {
  public:
    explicit GapFiller(PatchSet& set) : set_(set), nearVertices_(cubeSize(set)), nearTriangles_(cubeSize(set)) {}

    void run() {
        for (uint32_t p = 0; p < set_.patches.size(); ++p) addBorder(p);
        for (uint32_t v = 0; v < vertices_.size(); ++v) nearVertices_.add(vertices_[v].at, vertices_[v].at, v);
        fill();
        findSmallHoles();
        fill();
        set_.openEdges = border_.size();
        set_.triangles += set_.gaps.size();
    }

  private:
    struct Candidate {
        double distance;
        uint32_t from, to, vertex;
        bool operator<(const Candidate& o) const {  // the least on top
            return std::tie(distance, from, to, vertex) > std::tie(o.distance, o.from, o.to, o.vertex);
        }
    };

    void fill() {
        std::vector<uint64_t> first(border_.begin(), border_.end());
        std::sort(first.begin(), first.end());
        for (const uint64_t edge : first) offer(edge);
        while (!queue_.empty()) {
            const Candidate c = queue_.top();
            queue_.pop();
            if (isPossible(c)) insert(c);
        }
    }

    /// What hangs together of the border in few edges is a hole that the rules left over; within it only crossing
    /// triangles are refused from now on. (The border of the source itself is longer.)
    void findSmallHoles() {
        std::vector<uint32_t> parent(vertices_.size()), edges(vertices_.size(), 0);
        for (uint32_t v = 0; v < parent.size(); ++v) parent[v] = v;
        const auto find = [&](uint32_t v) {
            while (parent[v] != v) v = parent[v] = parent[parent[v]];
            return v;
        };
        for (const uint64_t edge : border_) {
            const uint32_t a = find(static_cast<uint32_t>(edge >> 32)), b = find(static_cast<uint32_t>(edge));
            parent[std::max(a, b)] = std::min(a, b);
        }
        for (const uint64_t edge : border_) ++edges[find(static_cast<uint32_t>(edge))];
        hole_.assign(vertices_.size(), kNoHole);
        for (uint32_t v = 0; v < hole_.size(); ++v)
            if (vertices_[v].borderEdges > 0 && edges[find(v)] <= kSmallHole) hole_[v] = find(v);
    }
    bool isInHole(uint32_t v) const { return !hole_.empty() && hole_[v] != kNoHole; }

    static double cubeSize(const PatchSet& set) {
        double size = 1e-300;
        for (const Patch& p : set.patches) size = std::max(size, 2 * double{p.step});
        return size;
    }

    /// A patch's border edges and vertices, and its triangles that have one of them.
    void addBorder(uint32_t p) {
        const Patch& patch = set_.patches[p];
        const PatchSurface surface(patch);
        std::vector<uint64_t> directed;
        surface.triangles([&](size_t a, size_t b, size_t c) {
            const Corners t{static_cast<uint32_t>(a), static_cast<uint32_t>(b), static_cast<uint32_t>(c)};
            for (size_t k = 0; k < 3; ++k) directed.push_back(edgeKey(t.at(k), t.at((k + 1) % 3)));
        });
        std::sort(directed.begin(), directed.end());
        std::vector<uint32_t> number(patch.heights.size(), ~0u);
        const auto vertexOf = [&](uint32_t sample) {
            if (number[sample] == ~0u) {
                number[sample] = static_cast<uint32_t>(vertices_.size());
                const glm::dvec3 normal = surface.frame() * glm::dvec3(shared::octDecode(patch.normals[sample]));
                vertices_.push_back({surface.position(sample), normal, double{patch.step}, {p, sample}});
            }
            return number[sample];
        };
        for (const uint64_t edge : directed) {
            const auto from = static_cast<uint32_t>(edge >> 32), to = static_cast<uint32_t>(edge);
            if (std::binary_search(directed.begin(), directed.end(), edgeKey(to, from))) continue;
            const uint32_t a = vertexOf(from), b = vertexOf(to);
            border_.insert(edgeKey(a, b));
            ++vertices_[a].borderEdges;
            ++vertices_[b].borderEdges;
        }
        surface.triangles([&](size_t a, size_t b, size_t c) {
            if (number[a] == ~0u && number[b] == ~0u && number[c] == ~0u) return;
            const Corners t{number[a], number[b], number[c]};
            for (size_t k = 0; k < 3; ++k)
                if (t.at(k) != ~0u && t.at((k + 1) % 3) != ~0u) edges_.insert(edgeKey(t.at(k), t.at((k + 1) % 3)));
            addTriangle({surface.position(a), surface.position(b), surface.position(c)}, t);
        });
    }

    void addTriangle(const Places& places, const Corners& corners) {
        const glm::dvec3 lo = glm::min(places[0], glm::min(places[1], places[2])),
                         hi = glm::max(places[0], glm::max(places[1], places[2]));
        nearTriangles_.add(lo, hi, static_cast<uint32_t>(triangles_.size()));
        triangles_.push_back(places);
        corners_.push_back(corners);
    }

    Places placesOf(const Candidate& c) const {
        return {vertices_[c.to].at, vertices_[c.from].at, vertices_[c.vertex].at};
    }

    void offer(uint64_t edge) {
        const auto from = static_cast<uint32_t>(edge >> 32), to = static_cast<uint32_t>(edge);
        const Vertex &a = vertices_[from], &b = vertices_[to];
        const double reach = kReach * std::max(a.step, b.step);
        const glm::dvec3 lo = glm::min(a.at, b.at) - reach, hi = glm::max(a.at, b.at) + reach;
        std::vector<Candidate> found;
        nearVertices_.visit(lo, hi, [&](uint32_t v) {
            if (v == from || v == to || vertices_[v].borderEdges == 0) return;
            const Candidate c{distanceToSegment(vertices_[v].at, a.at, b.at), from, to, v};
            if (glm::distance(vertices_[v].at, a.at) > reach || glm::distance(vertices_[v].at, b.at) > reach) return;
            if (!hole_.empty() && (!isInHole(from) || hole_[v] != hole_[from])) return;
            const glm::dvec3 n = crossOf(placesOf(c)), mean = a.normal + b.normal + vertices_[v].normal;
            const double facing = isInHole(from) ? -1 : kFacing;
            if (glm::length(n) > 0 && glm::dot(n, mean) >= facing * glm::length(n) * glm::length(mean))
                found.push_back(c);
        });
        std::sort(found.begin(), found.end(), [](const Candidate& x, const Candidate& y) { return y < x; });
        found.erase(std::unique(found.begin(), found.end(),
                                [](const Candidate& x, const Candidate& y) { return x.vertex == y.vertex; }),
                    found.end());
        if (found.size() > kMostCandidates) found.resize(kMostCandidates);
        for (const Candidate& c : found) queue_.push(c);
    }

    bool isPossible(const Candidate& c) const {
        if (!border_.contains(edgeKey(c.from, c.to)) || vertices_[c.vertex].borderEdges == 0) return false;
        for (const auto& [a, b] : {std::pair{c.from, c.vertex}, std::pair{c.vertex, c.to}}) {
            // The edge must be new, or the other side of one that is border.
            if (edges_.contains(edgeKey(a, b))) return false;
            if (edges_.contains(edgeKey(b, a)) && !border_.contains(edgeKey(b, a))) return false;
        }
        return !meetsOthers(c);
    }

    bool meetsOthers(const Candidate& c) const {
        const Places own = placesOf(c);
        const Corners ids{c.to, c.from, c.vertex};
        const glm::dvec3 cross = crossOf(own);
        const glm::dvec3 normal = cross / glm::length(cross);
        const double step = vertices_[c.from].step;
        const glm::dvec3 lo = glm::min(own[0], glm::min(own[1], own[2])) - 0.01 * step,
                         hi = glm::max(own[0], glm::max(own[1], own[2])) + 0.01 * step;
        bool meets = false;
        nearTriangles_.visit(lo, hi, [&](uint32_t t) {
            if (meets) return;
            const Places& other = triangles_[t];
            double least = 1e300;
            for (const glm::dvec3& p : other) least = std::min(least, std::abs(glm::dot(normal, p - own[0])));
            const bool isSameSide = glm::dot(normal, crossOf(other)) > 0;
            if (isSameSide && least < kOver * step && !isInHole(c.from)) {
                meets = overlap(own, other, normal, kTouching * step);
                return;
            }
            size_t shared = 0;
            for (const uint32_t v : corners_[t]) shared += v == ids[0] || v == ids[1] || v == ids[2] ? 1 : 0;
            for (size_t k = 0; k < 3 && !meets && shared < 2; ++k)
                meets =
                    passes(own.at(k), own.at((k + 1) % 3), other) || passes(other.at(k), other.at((k + 1) % 3), own);
        });
        return meets;
    }

    void insert(const Candidate& c) {
        const Corners ids{c.to, c.from, c.vertex};
        set_.gaps.push_back({vertices_[ids[0]].corner, vertices_[ids[1]].corner, vertices_[ids[2]].corner});
        const Places places = placesOf(c);
        addTriangle(places, ids);
        takeBorder(edgeKey(c.from, c.to));
        edges_.insert(edgeKey(c.to, c.from));
        for (const auto& [a, b] : {std::pair{c.from, c.vertex}, std::pair{c.vertex, c.to}}) {
            edges_.insert(edgeKey(a, b));
            if (border_.contains(edgeKey(b, a))) {
                takeBorder(edgeKey(b, a));
                continue;
            }
            border_.insert(edgeKey(a, b));
            ++vertices_[a].borderEdges;
            ++vertices_[b].borderEdges;
            offer(edgeKey(a, b));
        }
    }
    void takeBorder(uint64_t edge) {
        border_.erase(edge);
        --vertices_[static_cast<uint32_t>(edge >> 32)].borderEdges;
        --vertices_[static_cast<uint32_t>(edge)].borderEdges;
    }

    PatchSet& set_;
    std::vector<Vertex> vertices_;  ///< of borders
    std::vector<Places> triangles_;
    std::vector<Corners> corners_;  ///< of triangles; ~0: no border vertex
    Cubes nearVertices_, nearTriangles_;
    std::vector<uint32_t> hole_;                   ///< of vertices, by one of it; empty: not yet looked for
    std::unordered_set<uint64_t> border_, edges_;  ///< directed
    std::priority_queue<Candidate> queue_;
};

}  // namespace

void fillGaps(PatchSet& set) { GapFiller(set).run(); }

std::array<glm::dvec3, 3> placesOf(const PatchSet& set, const std::array<PatchCorner, 3>& gap) {
    std::array<glm::dvec3, 3> out;
    for (size_t k = 0; k < 3; ++k) out.at(k) = PatchSurface(set.patches[gap.at(k).patch]).position(gap.at(k).sample);
    return out;
}

}  // namespace stipple::lod
