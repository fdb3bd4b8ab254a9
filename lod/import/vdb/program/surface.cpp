#include "lod/import/vdb/program/surface.h"

#include <openvdb/math/Proximity.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace stipple::vdb {
namespace {
using openvdb::Coord;
using openvdb::Vec3d;
using openvdb::Vec3I;

/// Of a grid with more leaves, one in so many is measured that about this many are.
constexpr uint64_t kMeasuredLeaves = 4000;

/// Which leaves are measured: by their place, so that it is the same every time.
class Choice {
  public:
    explicit Choice(uint64_t leaves) : stride_(std::max<uint64_t>(leaves / kMeasuredLeaves, 1)) {}
    bool isChosen(const Coord& voxel) const {
        uint64_t h = 0;
        for (int a = 0; a < 3; ++a) h = (h ^ static_cast<uint32_t>(voxel[a] & ~7)) * 0x9e3779b97f4a7c15ull + 0x7f4a7c15;
        return (h >> 32) % stride_ == 0;
    }

  private:
    uint64_t stride_;
};

/// The triangles of the chosen leaves' cells, by cell.
class Near {
  public:
    Near(const Surface& surface, const Choice& choice) : surface_(surface) {
        for (uint32_t t = 0; t < surface.triangles.size(); ++t) {
            Vec3d least(1e300), greatest(-1e300);
            for (int k = 0; k < 3; ++k) {
                const Vec3d p(corner(t, k));
                least = openvdb::math::minComponent(least, p);
                greatest = openvdb::math::maxComponent(greatest, p);
            }
            const Coord first = Coord::floor(least), last = Coord::floor(greatest);
            bool isNear = false;
            for (int i = 0; i < 8; ++i)
                isNear = isNear ||
                         choice.isChosen({(i & 1) ? last[0] + 1 : first[0] - 1, (i & 2) ? last[1] + 1 : first[1] - 1,
                                          (i & 4) ? last[2] + 1 : first[2] - 1});
            if (!isNear) continue;
            for (const auto& cell : openvdb::CoordBBox(first, last)) cells_[cell].push_back(t);
        }
    }
    Vec3d corner(uint32_t triangle, int k) const { return Vec3d(surface_.vertices[surface_.triangles[triangle][k]]); }
    /// The place of the triangles around that is nearest.
    std::optional<Vec3d> nearest(const Vec3d& p) const {
        std::optional<Vec3d> found;
        double least = 1e300;
        const Coord cell = Coord::floor(p);
        for (const auto& around : openvdb::CoordBBox(cell.offsetBy(-1), cell.offsetBy(1))) {
            const auto here = cells_.find(around);
            if (here == cells_.end()) continue;
            for (const uint32_t t : here->second) {
                Vec3d barycentric;
                const Vec3d q = openvdb::math::closestPointOnTriangleToPoint(corner(t, 0), corner(t, 1), corner(t, 2),
                                                                             p, barycentric);
                if ((q - p).length() >= least) continue;
                least = (q - p).length();
                found = q;
            }
        }
        return found;
    }

  private:
    struct Hash {
        size_t operator()(const Coord& c) const { return c.hash<20>(); }
    };
    const Surface& surface_;
    std::unordered_map<Coord, std::vector<uint32_t>, Hash> cells_;
};

void addPair(const LevelSet& set, const Vec3d& place, const std::optional<Vec3d>& other, Deviation& out) {
    if (other)
        out.add((set.world(place) - set.world(*other)).length(), (place - *other).length());
    else
        ++out.unmeasured;
}

}  // namespace

Surface surfaceOf(const openvdb::FloatGrid& grid) {
    // In voxels: the tool writes fp32, which at the coordinates of a map would be off by decimetres.
    auto plain = openvdb::FloatGrid::create(std::const_pointer_cast<openvdb::FloatTree>(grid.constTreePtr()));
    plain->setTransform(openvdb::math::Transform::createLinearTransform(1.0));
    plain->setGridClass(openvdb::GRID_LEVEL_SET);
    Surface out;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*plain, out.vertices, quads, 0.0);  // (compiled in the library for these types)
    for (const openvdb::Vec4I& v : quads) {
        out.triangles.emplace_back(v[0], v[2], v[1]);
        out.triangles.emplace_back(v[0], v[3], v[2]);
    }
    return out;
}

Vec3d Field::gradient(const Vec3d& voxel) const {
    Vec3d g;
    for (int a = 0; a < 3; ++a) {
        Vec3d step(0);
        step[a] = 0.5;
        g[a] = at(voxel + step) - at(voxel - step);
    }
    return g;
}

std::optional<Vec3d> Field::crossing(const Vec3d& voxel) const {
    constexpr int kSteps = 20;
    constexpr double kFarthest = 2, kExact = 1e-5;  // voxels
    Vec3d q = voxel;
    for (int i = 0; i < kSteps; ++i) {
        const double value = at(q);
        const Vec3d g = gradient(q);
        const double slope = g.length();
        if (!(slope > 0) || !std::isfinite(value)) return {};
        const double left = value / slope;
        if (std::abs(left) < kExact) return q;
        // (In a corner the slope by differences is less than that ahead: half steps come back.)
        q -= g * (std::clamp(left, -0.5, 0.5) / slope) * (i < kSteps / 2 ? 1.0 : 0.5);
        if ((q - voxel).length() > kFarthest) return {};
    }
    return {};
}

void Deviation::add(double units, double voxels) {
    ++places;
    mostUnits = std::max(mostUnits, units);
    mostVoxels = std::max(mostVoxels, voxels);
    sumUnits += units;
    sumVoxels += voxels;
}

Deviation measure(const LevelSet& set, const Surface& surface) {
    Deviation out;
    const openvdb::FloatTree& tree = set.grid->tree();
    const Choice choice(tree.leafCount());
    const Field field(*set.grid);
    const Near near(surface, choice);
    for (uint32_t t = 0; t < surface.triangles.size(); ++t) {
        const std::array<Vec3d, 3> v{near.corner(t, 0), near.corner(t, 1), near.corner(t, 2)};
        if (!choice.isChosen(Coord::floor(v[0]))) continue;
        for (const Vec3d& p :
             {v[0], (v[0] + v[1]) * 0.5, (v[1] + v[2]) * 0.5, (v[2] + v[0]) * 0.5, (v[0] + v[1] + v[2]) / 3.0})
            addPair(set, p, field.crossing(p), out);
    }
    const auto value = set.grid->getConstAccessor();
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        if (!choice.isChosen(leaf->origin())) continue;
        for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel)
            eachCrossing(value, voxel.getCoord(), [&](const Vec3d& p) { addPair(set, p, near.nearest(p), out); });
    }
    return out;
}

}  // namespace stipple::vdb
