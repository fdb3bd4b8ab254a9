#include "lod/builder/lattice.h"

#include <algorithm>
#include <cmath>

namespace stipple::lod {
namespace {

/// Rounds a value that is whole but for its own rounding (scales are decimal fractions in binary, offsets are large).
bool snap(double& value) {
    const double whole = std::round(value);
    if (std::abs(value - whole) > 1e-6 * std::max(1.0, std::abs(whole) * 1e-6)) return false;
    value = whole;
    return true;
}

CommonLattice latticeOf(const std::vector<SourceInfo>& sources, double unit) {
    CommonLattice lattice;
    lattice.unit = unit;
    lattice.base = sources.front().offset;
    for (const SourceInfo& info : sources) {
        ToLattice to;
        for (int a = 0; a < 3; ++a) {
            to.ratio[a] = info.scale[a] / unit;
            to.shift[a] = (info.offset[a] - lattice.base[a]) / unit;
            to.exact = snap(to.ratio[a]) && to.exact;
            to.exact = snap(to.shift[a]) && to.exact;
        }
        lattice.of.push_back(to);
    }
    return lattice;
}

}  // namespace

CommonLattice findLattice(const std::vector<SourceInfo>& sources) {
    double finest = sources.front().scale.x;
    for (const SourceInfo& s : sources) finest = std::min({finest, s.scale.x, s.scale.y, s.scale.z});
    constexpr int kMostFractions = 1000;
    for (int k = 1; k <= kMostFractions; ++k) {
        CommonLattice lattice = latticeOf(sources, finest / k);
        if (std::all_of(lattice.of.begin(), lattice.of.end(), [](const ToLattice& t) { return t.exact; }))
            return lattice;
    }
    return latticeOf(sources, finest);
}

}  // namespace stipple::lod
