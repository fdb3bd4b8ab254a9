// Level sets as triangles, or as discs on their zero crossing.
#include <algorithm>
#include <cmath>

#include "lod/import/vdb/program/ply_file.h"
#include "lod/import/vdb/program/surface.h"

namespace stipple::vdb {
namespace {
using openvdb::Vec3d;
using openvdb::Vec3I;

/// Outwards, in world space; 0 where the level set is flat.
Vec3d normalAt(const LevelSet& set, const Field& field, const Vec3d& voxel) {
    const Vec3d g = field.gradient(voxel);
    Vec3d n = set.grid->transform().baseMap()->applyIJT(g, voxel + set.shift);
    return n.length() > 0 && std::isfinite(n.length()) ? n / n.length() : Vec3d(0);
}

/// Does the transform mirror?
bool isMirrored(const LevelSet& set) {
    const Vec3d o = set.world(Vec3d(0)), x = set.world({1, 0, 0}) - o, y = set.world({0, 1, 0}) - o,
                z = set.world({0, 0, 1}) - o;
    return x.cross(y).dot(z) < 0;
}

nlohmann::json deviationJson(const Deviation& d) {
    const double places = std::max(1.0, static_cast<double>(d.places));
    return {{"places", d.places},          {"unmeasured", d.unmeasured},
            {"most_units", d.mostUnits},   {"mean_units", d.sumUnits / places},
            {"most_voxels", d.mostVoxels}, {"mean_voxels", d.sumVoxels / places}};
}

void putPlace(PlyFile& ply, const Vec3d& p) {
    for (int a = 0; a < 3; ++a) ply.put(p[a]);
}
void putDirection(PlyFile& ply, const Vec3d& n) {
    for (int a = 0; a < 3; ++a) ply.put(static_cast<float>(n[a]));
}

const std::vector<std::pair<std::string, std::string>> kPlaces{{"double", "x"}, {"double", "y"}, {"double", "z"},
                                                               {"float", "nx"}, {"float", "ny"}, {"float", "nz"}};

nlohmann::json describe(const LevelSet& set, const Surface& surface, const Deviation& deviation) {
    return {{"grid", set.name},
            {"triangles", surface.triangles.size()},
            {"vertices", surface.vertices.size()},
            {"voxels", set.grid->activeVoxelCount()},
            {"deviation", deviationJson(deviation)}};
}

/// Beside an edge sharper than that the gradient is between the sides: smooth across, it would smear light over the
/// whole of larger triangles that come of these. There corners have the normals of their own triangles.
constexpr double kSmoothCosine = 0.9;

/// Puts the vertices of a level set, those that stand for sharp corners last; corners of `triangles` are numbered from
/// `first`. Returns how many vertices.
uint64_t putVertices(PlyFile& ply, const LevelSet& set, const Surface& surface, uint64_t first,
                     std::vector<Vec3I>& triangles) {
    const Field field(*set.grid);
    const bool mirror = isMirrored(set);
    std::vector<Vec3d> world, normal;
    for (const openvdb::Vec3s& v : surface.vertices) {
        world.push_back(set.world(Vec3d(v)));
        normal.push_back(normalAt(set, field, Vec3d(v)));
        putPlace(ply, world.back());
        putDirection(ply, normal.back());
    }
    // Slivers have a direction by rounding alone: at their corners that of the largest triangle stands for them.
    constexpr double kSliver = 0.05;  // of a triangle of equal sides
    std::vector<Vec3d> ofLargest(world.size(), Vec3d(0));
    const auto twiceArea = [&](const Vec3I& t) { return (world[t[1]] - world[t[0]]).cross(world[t[2]] - world[t[0]]); };
    for (const Vec3I& t : surface.triangles)
        for (int k = 0; k < 3; ++k)
            if (twiceArea(t).length() > ofLargest[t[k]].length())
                ofLargest[t[k]] = twiceArea(t) * (mirror ? -1.0 : 1.0);
    uint64_t count = world.size();
    for (Vec3I t : surface.triangles) {
        if (mirror) std::swap(t[1], t[2]);
        double longest = 0;
        for (int k = 0; k < 3; ++k) longest = std::max(longest, (world[t[k]] - world[t[(k + 1) % 3]]).lengthSqr());
        const Vec3d area = twiceArea(t);
        const bool isSliver = area.length() < kSliver * std::sqrt(0.75) * longest;
        for (int k = 0; k < 3; ++k) {
            const uint32_t v = t[k];
            Vec3d own = isSliver ? ofLargest[v] : area;
            own = own.length() > 0 ? own / own.length() : Vec3d(0);
            t[k] = static_cast<uint32_t>(first + v);
            if (own.length() == 0 || own.dot(normal[v]) >= kSmoothCosine) continue;
            putPlace(ply, world[v]);
            putDirection(ply, own);
            t[k] = static_cast<uint32_t>(first + count++);
        }
        triangles.push_back(t);
    }
    return count;
}

}  // namespace

Result<nlohmann::json> levelSetsToTriangles(const Request& request) {
    STIPPLE_ASSIGN(const std::vector<LevelSet> sets, readLevelSets(request));
    PlyFile ply(request.columns);
    nlohmann::json answer = {{"grids", nlohmann::json::array()}};
    std::vector<Vec3I> triangles;
    uint64_t vertices = 0;
    for (const LevelSet& set : sets) {
        const Surface surface = surfaceOf(*set.grid);
        answer["grids"].push_back(describe(set, surface, measure(set, surface)));
        vertices += putVertices(ply, set, surface, vertices, triangles);
        if (vertices > UINT32_MAX) return fail(ErrorKind::budget, "has more than 2^32 vertices", request.path);
    }
    for (const Vec3I& t : triangles) {
        ply.put(uint8_t{3});
        for (int k = 0; k < 3; ++k) ply.put(t[k]);
    }
    STIPPLE_TRY(ply.finish(vertices, kPlaces, triangles.size()));
    return answer;
}

Result<nlohmann::json> levelSetsToSurfels(const Request& request) {
    STIPPLE_ASSIGN(const std::vector<LevelSet> sets, readLevelSets(request));
    PlyFile ply(request.columns);
    nlohmann::json answer = {{"grids", nlohmann::json::array()}};
    uint64_t points = 0;
    for (const LevelSet& set : sets) {
        const Surface surface = surfaceOf(*set.grid);
        const Field field(*set.grid);
        std::vector<Vec3d> voxel, world;
        uint64_t notFound = 0;
        for (const openvdb::Vec3s& v : surface.vertices) {
            const auto found = field.crossing(Vec3d(v));
            notFound += found ? 0 : 1;
            voxel.push_back(found.value_or(Vec3d(v)));
            world.push_back(set.world(voxel.back()));
        }
        // No place of a triangle is farther from its nearest corner than the longest edge over the root of 3.
        std::vector<double> radius(world.size());
        for (const Vec3I& t : surface.triangles) {
            double longest = 0;
            for (int k = 0; k < 3; ++k) longest = std::max(longest, (world[t[k]] - world[t[(k + 1) % 3]]).length());
            for (int k = 0; k < 3; ++k) radius[t[k]] = std::max(radius[t[k]], longest / std::sqrt(3.0));
        }
        for (size_t i = 0; i < world.size(); ++i) {
            putPlace(ply, world[i]);
            putDirection(ply, normalAt(set, field, voxel[i]));
            ply.put(static_cast<float>(radius[i]));
        }
        points += world.size();
        answer["grids"].push_back({{"grid", set.name}, {"points", world.size()}, {"beside", notFound}});
    }
    auto properties = kPlaces;
    properties.emplace_back("float", "radius");
    STIPPLE_TRY(ply.finish(points, properties, 0));
    return answer;
}

}  // namespace stipple::vdb
