// Closed triangles as a level set: exact distances within three voxels of them, signs by OpenVDB's flood from outside.
#include <openvdb/math/Proximity.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <unordered_map>

#include "lod/import/vdb/program/surface.h"

namespace stipple::vdb {
namespace {
using openvdb::Coord;
using openvdb::Vec3d;
using openvdb::Vec3I;

constexpr float kBandVoxels = 3;

/// Places in voxels, near 0.
struct Triangles {
    std::vector<Vec3d> place;
    std::vector<Vec3I> corners;
    const Vec3d& at(size_t n, int k) const { return place[corners[n][k]]; }
};

Result<Triangles> readBack(const Request& request, const nlohmann::json& layout) {
    Triangles out;
    out.place.resize(layout.at("vertices"));
    out.corners.resize(layout.at("triangles"));
    std::ifstream file(request.columns, std::ios::binary);
    file.read(reinterpret_cast<char*>(out.place.data()), static_cast<std::streamsize>(out.place.size() * 24));
    file.read(reinterpret_cast<char*>(out.corners.data()), static_cast<std::streamsize>(out.corners.size() * 12));
    if (!file) return fail(ErrorKind::output, "the triangles cannot be read back", request.columns);
    return out;
}

/// Edges with a triangle on one side only, of vertices that are one where they lie at one place.
uint64_t openEdges(const Triangles& mesh) {
    struct Hash {
        size_t operator()(const std::array<double, 3>& p) const {
            uint64_t h = 0;
            for (const double v : p) {
                uint64_t bits = 0;
                std::memcpy(&bits, &v, 8);
                h = (h ^ bits) * 0x9e3779b97f4a7c15ull;
                h ^= h >> 29;
            }
            return h;
        }
    };
    std::unordered_map<std::array<double, 3>, uint32_t, Hash> first;
    std::vector<uint32_t> same;
    for (const Vec3d& p : mesh.place)
        same.push_back(
            first.try_emplace({p[0] + 0.0, p[1] + 0.0, p[2] + 0.0}, static_cast<uint32_t>(same.size())).first->second);
    std::vector<uint64_t> edges;
    for (const Vec3I& t : mesh.corners)
        for (int k = 0; k < 3; ++k) {
            const uint64_t a = same[t[k]], b = same[t[(k + 1) % 3]];
            if (a != b) edges.push_back(std::min(a, b) << 32 | std::max(a, b));
        }
    std::sort(edges.begin(), edges.end());
    uint64_t open = 0;
    for (size_t i = 0, end = 0; i < edges.size(); i = end) {
        while (end < edges.size() && edges[end] == edges[i]) ++end;
        open += (end - i) % 2;
    }
    return open;
}

/// Which triangle is nearest, among those that are the nearest of a voxel around a place, and small ones around it.
class NearTriangles {
  public:
    NearTriangles(const Triangles& mesh, const openvdb::Int32Grid& closest)
        : mesh_(mesh), closest_(closest.getConstAccessor()) {
        constexpr double kSmall = 2;  // voxels: of larger ones several voxels are nearest
        for (uint32_t t = 0; t < mesh.corners.size(); ++t) {
            Vec3d least = mesh.at(t, 0), most = least;
            for (int k = 1; k < 3; ++k) {
                least = openvdb::math::minComponent(least, mesh.at(t, k));
                most = openvdb::math::maxComponent(most, mesh.at(t, k));
            }
            if ((most - least).length() < kSmall) small_.emplace_back(cell(Coord::round((least + most) * 0.5)), t);
        }
        std::sort(small_.begin(), small_.end());
    }
    /// Voxels; 1e300 where none is near.
    double distance(const Vec3d& p) const {
        const Coord middle = Coord::round(p);
        double least = 1e300;
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    const Coord at = middle + Coord(x, y, z);
                    const auto t = static_cast<uint32_t>(closest_.getValue(at));
                    if (t < mesh_.corners.size()) least = std::min(least, distance(p, t));
                    const uint64_t of = cell(at);
                    for (auto s = std::lower_bound(small_.begin(), small_.end(), std::pair{of, 0u});
                         s != small_.end() && s->first == of; ++s)
                        least = std::min(least, distance(p, s->second));
                }
        return least;
    }

  private:
    static uint64_t cell(const Coord& c) {
        constexpr uint64_t kMask = (1u << 21) - 1;
        return (uint64_t(uint32_t(c[0])) & kMask) << 42 | (uint64_t(uint32_t(c[1])) & kMask) << 21 |
               (uint64_t(uint32_t(c[2])) & kMask);
    }
    double distance(const Vec3d& p, uint32_t t) const {
        Vec3d barycentric;
        return (openvdb::math::closestPointOnTriangleToPoint(mesh_.at(t, 0), mesh_.at(t, 1), mesh_.at(t, 2), p,
                                                             barycentric) -
                p)
            .length();
    }
    const Triangles& mesh_;
    openvdb::Int32Grid::ConstAccessor closest_;
    std::vector<std::pair<uint64_t, uint32_t>> small_;  ///< cell, triangle
};

/// How far the triangles lie from the zero crossing, at places a voxel apart, and it from them.
Deviation deviationFrom(const LevelSet& set, const Triangles& mesh, const openvdb::Int32Grid& closest) {
    constexpr int kMost = 64;
    Deviation out;
    const Field field(*set.grid);
    const double unit = set.grid->transform().voxelSize()[0];
    for (size_t t = 0; t < mesh.corners.size(); ++t) {
        const Vec3d a = mesh.at(t, 0), u = mesh.at(t, 1) - a, v = mesh.at(t, 2) - a;
        const int n = static_cast<int>(std::clamp(std::ceil(std::max(u.length(), v.length())), 1.0, double{kMost}));
        for (int i = 0; i <= n; ++i)
            for (int j = 0; i + j <= n; ++j) {
                const Vec3d p = a + u * (double(i) / n) + v * (double(j) / n);
                const auto q = field.crossing(p);
                if (q)
                    out.add((p - *q).length() * unit, (p - *q).length());
                else
                    ++out.unmeasured;
            }
    }
    const NearTriangles near(mesh, closest);
    const auto value = set.grid->getConstAccessor();
    for (auto voxel = set.grid->cbeginValueOn(); voxel; ++voxel)
        eachCrossing(value, voxel.getCoord(), [&](const Vec3d& p) {
            const double least = near.distance(p);
            if (least < 1e300)
                out.add(least * unit, least);
            else
                ++out.unmeasured;
        });
    return out;
}

/// Deeper than `depth`?
bool hasInside(const openvdb::FloatGrid& grid, double depth) {
    for (auto v = grid.cbeginValueAll(); v; ++v)
        if (*v < -depth) return true;
    return false;
}

}  // namespace

Result<nlohmann::json> trianglesToLevelSet(const Request& request, const nlohmann::json& layout) {
    STIPPLE_ASSIGN(Triangles mesh, readBack(request, layout));
    if (mesh.place.empty()) return fail(ErrorKind::input, "holds no triangles", request.path);
    const double unit = request.voxel;
    Vec3d least(1e300);
    for (const Vec3d& p : mesh.place) least = openvdb::math::minComponent(least, p);
    for (int a = 0; a < 3; ++a) least[a] = std::floor(least[a] / unit) * unit;
    double area = 0;
    for (Vec3d& p : mesh.place) p = (p - least) / unit;
    for (size_t t = 0; t < mesh.corners.size(); ++t)
        area += (mesh.at(t, 1) - mesh.at(t, 0)).cross(mesh.at(t, 2) - mesh.at(t, 0)).length() / 2;
    // Leaves of 8 x 8 x 8 voxels around each square of 8 x 8, and those that the band reaches beside them; distances
    // and nearest triangles.
    constexpr double kLeaves = 2.5, kBytesOfLeaf = 512 * 8 * 1.5;
    const auto bytes =
        static_cast<uint64_t>(std::min(area / 64 * kLeaves * kBytesOfLeaf, 1e18)) + mesh.corners.size() * 64;
    if (bytes > request.memoryBytes) {
        Error error = overBudget(request, "level sets of so small voxels", bytes).value();
        error.hint += ", or a larger --voxel";
        return tl::unexpected(error);
    }
    auto transform = openvdb::math::Transform::createLinearTransform(unit);
    transform->postTranslate(least);
    openvdb::Int32Grid closest(openvdb::util::INVALID_IDX);
    // In fp32, as the library is compiled: 8,192 voxels wide that rounds by 2^-11 of one, which is measured below.
    const std::vector<openvdb::Vec3s> rounded(mesh.place.begin(), mesh.place.end());
    const openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, Vec3I> adapter(rounded, mesh.corners);
    openvdb::util::NullInterrupter never;
    const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(never, adapter, *transform, kBandVoxels,
                                                                       kBandVoxels, 0, &closest);
    const uint64_t open = openEdges(mesh);
    // Voxels that open sheets run through are counted as inside, too, but are not as deep as half a diagonal.
    if (!hasInside(*grid, open > 0 ? std::sqrt(0.75) * unit : 0))
        return fail(ErrorKind::input,
                    "encloses nothing that is as wide as a voxel, and level sets are of what is closed (" +
                        std::to_string(open) + " edges are open)",
                    layout.value("source", "the mesh"), "close it, or give a smaller --voxel");
    grid->setName("surface");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const Deviation d = deviationFrom({"surface", grid, Vec3d(0)}, mesh, closest);
    const uint64_t voxels = grid->activeVoxelCount();
    openvdb::io::File file(request.path);
    file.write({grid});
    file.close();
    const double places = std::max(1.0, static_cast<double>(d.places));
    return nlohmann::json{{"voxels", voxels},
                          {"voxel", unit},
                          {"triangles", mesh.corners.size()},
                          {"open_edges", open},
                          {"deviation",
                           {{"places", d.places},
                            {"unmeasured", d.unmeasured},
                            {"most_units", d.mostUnits},
                            {"mean_units", d.sumUnits / places},
                            {"most_voxels", d.mostVoxels},
                            {"mean_voxels", d.sumVoxels / places}}}};
}

}  // namespace stipple::vdb
