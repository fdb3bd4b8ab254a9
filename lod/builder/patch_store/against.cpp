#include "lod/builder/patch_store/against.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/base/queue.h"
#include "lod/builder/morton.h"
#include "lod/builder/patches/mesh_surface.h"
#include "lod/builder/patches/near_points.h"
#include "lod/primitives/patch_samples.h"
#include "lod/verify/patches.h"

namespace stipple::lod {
namespace {

constexpr double kMostSpacings = 6;  ///< that a place of a patch may be from the nearest point, beyond what is stated

/// Places of the source, in lattice units: of each chosen triangle its middle, and one near a corner.
std::vector<glm::dvec3> placesOf(const Hierarchy& h, const MeshSurface& s, uint64_t most) {
    const size_t stride = s.size() / std::max<uint64_t>(most / 2, 1) + 1;
    std::vector<glm::dvec3> out;
    for (size_t t = stride / 2; t < s.size(); t += stride) {
        const glm::dvec3 middle = s.elements.centre[t];
        for (const glm::dvec3& p : {middle, 0.1 * middle + 0.9 * s.at(t, t % 3)})
            out.push_back((s.middle + p - h.origin) / h.unit);
    }
    return out;
}

/// Leaves whose spheres come within reach(leaf) of a place; `most`: none is larger.
template <typename Reach>
std::vector<uint32_t> leavesNear(const Hierarchy& h, const glm::dvec3& p, double most, const Reach& reach) {
    std::vector<uint32_t> out, stack{0};
    while (!stack.empty()) {
        const uint32_t n = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[n];
        if (glm::distance(node.centre, p) > node.radius + (node.isLeaf() ? reach(node) : most)) continue;
        if (node.isLeaf()) out.push_back(n);
        for (int c = 0; c < __builtin_popcount(node.childMask); ++c)
            stack.push_back(node.firstChild + static_cast<uint32_t>(c));
    }
    return out;
}

/// From a place (world units) to the source; `hint`: what was near to the place before.
struct Off {
    double distance = 0, allowed = 0;  ///< allowed: beyond what is stated
};
using ToSource = std::function<Off(const glm::dvec3& p, size_t& hint)>;

class Measuring {
  public:
    /// `places`: of the source, lattice units.
    Measuring(const Store& store, ToSource toSource, std::vector<glm::dvec3> places, uint64_t wanted)
        : store_(store),
          h_(store.hierarchy),
          toSource_(std::move(toSource)),
          places_(std::move(places)),
          wanted_(wanted) {
        double stated = 0;
        for (const Node& n : h_.nodes)
            if (n.isLeaf()) {
                stated = std::max(stated, statedOf(n));
                reach_ = std::max(reach_, reachOf(n));
            }
        out_.stated = stated * h_.unit;
        nearest_.assign(places_.size(), {reach_, 2});
        placesNear_.resize(h_.nodes.size());
        made_.resize(h_.nodes.size());
        for (uint32_t k = 0; k < places_.size(); ++k)
            for (const uint32_t n : leavesNear(h_, places_[k], reach_, [&](const Node& n) { return reachOf(n); }))
                placesNear_[n].push_back(k);
        for (const Node& n : h_.nodes) leaves_ += n.isLeaf() ? 1 : 0;
    }

    Result<AgainstSource> run(Executor& executor) {
        CompletionQueue<Error> errors;
        executor.parallelFor(h_.nodes.size(), 1, [&](size_t begin, size_t end) {
            for (size_t n = begin; n < end; ++n)
                if (h_.nodes[n].isLeaf() && !isStopRequested())
                    if (const auto done = leaf(static_cast<uint32_t>(n)); !done) errors.push(done.error());
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
        if (isStopRequested())
            return fail(ErrorKind::interrupted, "interrupted; not all of it was measured", store_.path);
        for (uint32_t n = 0; n < made_.size(); ++n) {
            const OfLeaf& leaf = made_[n];
            for (size_t i = 0; i < leaf.found.size(); ++i) {
                if (leaf.found[i] >= reachOf(h_.nodes[n])) continue;
                Nearest& nearest = nearest_[placesNear_[n][i]];
                nearest.distance = std::min(nearest.distance, leaf.found[i]);
                nearest.part = std::min(nearest.part, leaf.found[i] / statedOf(h_.nodes[n]));
            }
            out_.toSource = std::max(out_.toSource, leaf.most);
            out_.most = std::max(out_.most, leaf.part);
            out_.placesOfStore += leaf.count;
            out_.far += leaf.far;
        }
        out_.placesOfSource = places_.size();
        for (const Nearest& nearest : nearest_) {
            out_.fromSource = std::max(out_.fromSource, nearest.distance * h_.unit);
            out_.most = std::max(out_.most, nearest.part);
            out_.far += nearest.part > 1 + 1e-9 ? 1 : 0;
        }
        return out_;
    }

  private:
    Result<void> leaf(uint32_t n) {
        STIPPLE_ASSIGN(const NodeSurface surface, NodeSurface::read(store_, n));
        const double stated = statedOf(h_.nodes[n]) * h_.unit;
        double most = 0, part = 0;
        uint64_t count = 0, far = 0;
        size_t hint = 0;
        surface.forPlaces(wanted_ / leaves_ + 1, [&](const glm::dvec3& p) {
            const Off off = toSource_(h_.origin + h_.unit * p, hint);
            most = std::max(most, off.distance);
            part = std::max(part, off.distance / (stated + off.allowed));
            far += off.distance > (stated + off.allowed) * (1 + 1e-9) ? 1 : 0;
            ++count;
        });
        std::vector<double> found;
        for (const uint32_t k : placesNear_[n]) found.push_back(surface.distance(places_[k], reachOf(h_.nodes[n])));
        made_[n] = {most, part, count, far, std::move(found)};
        return {};
    }
    /// Lattice units; not 0.
    double statedOf(const Node& leaf) const { return std::max(h_.errors.decode(leaf.sourceCode), 1e-300); }

    /// How far it is looked for: what is farther is told as that far at least. (One that states nothing has a reach all
    /// the same.)
    double reachOf(const Node& leaf) const { return std::max(2 * statedOf(leaf), leaf.radius / 1024); }

    const Store& store_;
    const Hierarchy& h_;
    ToSource toSource_;
    std::vector<glm::dvec3> places_;
    uint64_t wanted_, leaves_ = 0;
    double reach_ = 0;  ///< the largest, lattice units
    /// Of a place of the source.
    struct Nearest {
        double distance = 0, part = 0;  ///< from the nearest leaf; from one, in parts of what that states, at least
    };
    std::vector<Nearest> nearest_;
    std::vector<std::vector<uint32_t>> placesNear_;
    /// What a leaf has measured.
    struct OfLeaf {
        double most = 0, part = 0;
        uint64_t count = 0, far = 0;
        std::vector<double> found;  ///< of `placesNear_`
    };
    std::vector<OfLeaf> made_;
    AgainstSource out_;
};

}  // namespace

namespace {

Result<void> checkPatches(const Store& store) {
    if (hasPatches(store.hierarchy)) return {};
    return fail(ErrorKind::usage, "holds no patches: what it holds is measured without its source", store.path,
                "leave --against out");
}

/// As far apart as the eight nearest say.
double spacingOf(const NearPoints::Found& near) {
    return near.count < 2 ? 0
                          : std::sqrt(3.14159265358979323846 * static_cast<double>(near.squared[near.count - 1]) /
                                      static_cast<double>(near.count - 1));
}

}  // namespace

Result<AgainstSource> measureAgainst(const Store& store, TriangleMesh source, uint64_t places, Executor& executor) {
    STIPPLE_TRY(checkPatches(store));
    const MeshSurface surface = meshSurface(std::move(source), executor);
    if (surface.size() == 0) return fail(ErrorKind::input, "the source holds no triangle with an area", store.path);
    const ToSource toSource = [&](const glm::dvec3& p, size_t& hint) {
        const auto [distance, triangle] = surface.nearest(p - surface.middle, hint);
        hint = triangle;
        return Off{distance, 0};
    };
    return Measuring(store, toSource, placesOf(store.hierarchy, surface, places), places).run(executor);
}

Result<AgainstSource> measureAgainst(const Store& store, std::vector<glm::dvec3> points, uint64_t places,
                                     Executor& executor) {
    constexpr size_t kNeighbours = 8;
    STIPPLE_TRY(checkPatches(store));
    std::erase_if(points, [](const glm::dvec3& p) { return !isFinite(p); });
    if (points.empty()) return fail(ErrorKind::input, "the source holds no points", store.path);
    const Hierarchy& h = store.hierarchy;
    std::vector<glm::dvec3> chosen;
    for (size_t stride = points.size() / std::max<uint64_t>(places, 1) + 1, i = stride / 2; i < points.size();
         i += stride)
        chosen.push_back((points[i] - h.origin) / h.unit);
    const glm::dvec3 middle = 0.5 * (store.description.boundsMin + store.description.boundsMax);
    // In Morton order, as the search wants them.
    const double scale = std::exp2(21.0 - h.rootLog2) / h.unit;
    std::vector<std::pair<uint64_t, uint32_t>> order;
    for (uint32_t i = 0; i < points.size(); ++i) {
        const glm::dvec3 q = glm::clamp((points[i] - h.origin) * scale, glm::dvec3(0), glm::dvec3(2097151));
        order.emplace_back(
            shortMortonCode(static_cast<uint64_t>(q.x), static_cast<uint64_t>(q.y), static_cast<uint64_t>(q.z)), i);
    }
    std::sort(order.begin(), order.end());
    std::vector<glm::dvec3> sorted;
    for (const auto& [code, i] : order) sorted.push_back(points[i] - middle);
    const NearPoints near(sorted);
    const ToSource toSource = [&](const glm::dvec3& p, size_t&) {
        NearPoints::Found found;
        near.find(p - middle, 1, std::numeric_limits<float>::max(), found);
        const glm::dvec3 q = sorted[found.index[0]];
        const double distance = glm::distance(p - middle, q);
        near.find(q, kNeighbours + 1, std::numeric_limits<float>::max(), found);
        return Off{distance, kMostSpacings * spacingOf(found)};
    };
    return Measuring(store, toSource, std::move(chosen), places).run(executor);
}

}  // namespace stipple::lod
