// The lattice of a mesh: as fine as most of it asks for, however far away the rest is.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/numbers.h"
#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/points/spacing.h"

namespace stipple::lod {
namespace {

constexpr int kLatticeBits = 24;
constexpr double kFar = 16;  ///< times what most vertices span: that is far out
/// Steps in the spacing where vertices lie densest: as many, where the lattice of the whole has fewer than the fewest.
constexpr double kFewestSteps = 256, kSteps = 32768;

/// A power of two of which `extent` has 2^bits at most.
double unitOf(double extent, int bits) { return std::exp2(std::floor(std::log2(std::max(extent, 1e-30))) + 1 - bits); }

/// Places once each: vertices of faces that share none lie where others do.
std::vector<glm::dvec3> different(std::vector<glm::dvec3> places) {
    const auto before = [](const glm::dvec3& a, const glm::dvec3& b) {
        return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
    };
    std::sort(places.begin(), places.end(), before);
    places.erase(std::unique(places.begin(), places.end()), places.end());
    return places;
}

/// Coordinates around zero, and what most of them span.
void makeWide(const MeshSource::Bounds& bounds, Lattice& lattice) {
    const DenseBox box = denseBox(bounds.sample);
    lattice.origin = glm::floor(box.middle / lattice.unit) * lattice.unit;
    lattice.bits = kWideMeshBits;
    lattice.focusLow = box.lo;
    lattice.focusHigh = box.hi;
    const auto steps = [&](const glm::dvec3& p) {
        const glm::dvec3 q = glm::floor((p - lattice.origin) / lattice.unit + 0.5);
        return Steps(toWhole<int64_t>(q.x), toWhole<int64_t>(q.y), toWhole<int64_t>(q.z));
    };
    lattice.firstKey = glm::i64vec3(0);
    const glm::i64vec3 first(keyPlace(steps(bounds.lo), lattice)), last(keyPlace(steps(bounds.hi), lattice));
    lattice.firstKey = first;
    for (int a = 0; a < 3; ++a)
        lattice.largestKey = std::max(lattice.largestKey, static_cast<uint64_t>(last[a] - first[a]));
}

/// Fewest steps in what most vertices span, and in the spacing where they lie densest: beyond, nothing is a surface.
struct Fewest {
    double inExtent, inSpacing;
};
constexpr Fewest kRuined{1024, 16}, kKept{1 << 17, 1024};  ///< kept: where something is left out

/// How far a lattice of all bits reaches from the middle of most vertices; infinite where nothing is known of them.
double reachOf(double dense, double spacing, const Fewest& fewest) {
    double coarsest = std::numeric_limits<double>::infinity();
    if (dense > 0) coarsest = dense / fewest.inExtent;
    if (spacing > 0) coarsest = std::min(coarsest, spacing / fewest.inSpacing);
    return coarsest * std::exp2(double{kWideMeshBits} - 4);
}

}  // namespace

Lattice latticeOf(const MeshSource::Bounds& all, bool tellsAllApart) {
    Lattice lattice;
    if (all.lo.x > all.hi.x) return lattice;
    MeshSource::Bounds bounds = all;
    std::erase_if(bounds.sample, [](const glm::dvec3& p) { return !isPlace(p); });
    bounds.lo = glm::clamp(bounds.lo, lattice.reachLow, lattice.reachHigh);
    bounds.hi = glm::clamp(bounds.hi, lattice.reachLow, lattice.reachHigh);
    // What most vertices are is told apart as it would be without those far out; so are small objects far from each
    // other.
    const double dense = denseExtent(bounds.sample);
    const double spacing = tellsAllApart ? denseSpacing(different(bounds.sample), all.share()) : 0;
    const DenseBox most = denseBox(bounds.sample);
    double reach = reachOf(dense, spacing, kRuined);
    if (glm::any(glm::lessThan(bounds.lo, most.middle - reach)) ||
        glm::any(glm::greaterThan(bounds.hi, most.middle + reach))) {
        reach = reachOf(dense, spacing, kKept);
        lattice.reachLow = most.middle - reach;
        lattice.reachHigh = most.middle + reach;
        bounds.lo = glm::clamp(bounds.lo, lattice.reachLow, lattice.reachHigh);
        bounds.hi = glm::clamp(bounds.hi, lattice.reachLow, lattice.reachHigh);
    }
    const glm::dvec3 size = bounds.hi - bounds.lo;
    const double extent = std::max({size.x, size.y, size.z});
    lattice.unit = unitOf(extent, kLatticeBits);
    if (dense > 0 && extent > kFar * dense) lattice.unit = unitOf(dense, kLatticeBits);
    if (spacing > 0 && spacing < kFewestSteps * lattice.unit) lattice.unit = unitOf(spacing / kSteps, 0);
    lattice.unit = std::max(lattice.unit, unitOf(extent, static_cast<int>(kWideMeshBits) - 1));
    if (extent >= lattice.unit * std::exp2(kShortMeshBits)) {
        makeWide(bounds, lattice);
        return lattice;
    }
    if (lattice.unit < unitOf(extent, kLatticeBits)) lattice.bits = kShortMeshBits;
    // Whole steps from zero, so that coordinates that lie on the lattice stay exact.
    lattice.origin = glm::floor(bounds.lo / lattice.unit) * lattice.unit;
    const glm::dvec3 last = glm::floor((bounds.hi - lattice.origin) / lattice.unit + 0.5);
    lattice.largestKey = toWhole<uint64_t>(std::max({last.x, last.y, last.z}));
    return lattice;
}

}  // namespace stipple::lod
