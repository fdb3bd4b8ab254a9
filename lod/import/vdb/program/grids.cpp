#include "lod/import/vdb/program/grids.h"

#include <openvdb/points/PointDataGrid.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <algorithm>
#include <cmath>

namespace stipple::vdb {
namespace {

/// Beyond so many voxels from the origin, fp32 coordinates round by more than 2^-10 of a voxel.
constexpr int64_t kFarVoxels = 1 << 13;
/// A voxel of a level set takes 4 bytes, and while triangles are made three times that.
constexpr uint64_t kBytesOfVoxel = 12;

std::string human(uint64_t bytes) {
    char text[64];
    std::snprintf(text, sizeof(text), "%.1f GiB", static_cast<double>(bytes) / static_cast<double>(1ull << 30));
    return text;
}

/// Nothing but its topology is in memory until its voxels are asked for.
Result<void> checkVoxels(const Request& request, const openvdb::GridBase& grid, uint64_t& bytes) {
    const uint64_t inLeaves = uint64_t{grid.constBaseTree().leafCount()} * 512;
    const uint64_t active = grid.constBaseTree().activeVoxelCount();
    bytes += std::max(inLeaves, active) * kBytesOfVoxel;
    if (bytes <= request.memoryBytes) return {};
    return overBudget(request, "grid '" + grid.getName() + "' has " + std::to_string(active) + " voxels, which", bytes);
}

/// The same level set near 0. (Its leaves only: tiles of a narrow band are outside or inside, as leaves say.)
openvdb::FloatTree::Ptr moved(const openvdb::FloatTree& tree, const openvdb::Coord& by) {
    auto out = std::make_shared<openvdb::FloatTree>(tree.background());
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        auto* copy = new openvdb::FloatTree::LeafNodeType(*leaf);
        copy->setOrigin(leaf->origin() - by);
        out->addLeaf(copy);
    }
    openvdb::tools::signedFloodFill(*out);
    return out;
}

LevelSet nearOrigin(const std::string& name, const openvdb::FloatGrid::Ptr& grid) {
    const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    const auto least = box.min(), greatest = box.max();
    int64_t farthest = 0;
    for (int a = 0; a < 3; ++a)
        farthest = std::max({farthest, std::abs(int64_t{least[a]}), std::abs(int64_t{greatest[a]})});
    if (box.empty() || farthest <= kFarVoxels) return {name, grid, openvdb::Vec3d(0)};
    openvdb::Coord by;
    for (int a = 0; a < 3; ++a) by[a] = static_cast<int>((int64_t{least[a]} + greatest[a]) / 2 / 8 * 8);
    auto near = openvdb::FloatGrid::create(moved(grid->tree(), by));
    near->setTransform(grid->transformPtr());
    near->setGridClass(openvdb::GRID_LEVEL_SET);
    return {name, near, by.asVec3d()};
}

openvdb::FloatGrid::Ptr asFloats(const openvdb::GridBase::Ptr& grid) {
    if (auto floats = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) return floats;
    const auto doubles = openvdb::gridPtrCast<openvdb::DoubleGrid>(grid);
    if (!doubles) return nullptr;
    auto tree = std::make_shared<openvdb::FloatTree>(doubles->tree());
    auto out = openvdb::FloatGrid::create(tree);
    out->setTransform(doubles->transformPtr());
    return out;
}

bool isWanted(const Request& request, const openvdb::GridBase& grid) {
    return request.grid.empty() || grid.getName() == request.grid;
}

}  // namespace

tl::unexpected<Error> overBudget(const Request& request, const std::string& what, uint64_t bytes) {
    return fail(ErrorKind::budget,
                what + " take about " + human(bytes) + ", but --memory allows " + human(request.memoryBytes),
                request.path, "give --memory " + std::to_string((bytes >> 20) + 1) + "M or more");
}

Result<std::vector<LevelSet>> readLevelSets(const Request& request) {
    openvdb::io::File file(request.path);
    file.setCopyMaxBytes(0);
    file.open();
    std::vector<LevelSet> sets;
    uint64_t bytes = 0;
    for (auto name = file.beginName(); name != file.endName(); ++name) {
        const openvdb::GridBase::Ptr meta = file.readGridMetadata(name.gridName());
        if (!isWanted(request, *meta)) continue;
        const bool isScalar = meta->isType<openvdb::FloatGrid>() || meta->isType<openvdb::DoubleGrid>();
        const bool isNamed = !request.grid.empty() && meta->getGridClass() == openvdb::GRID_UNKNOWN;
        if (!isScalar || (meta->getGridClass() != openvdb::GRID_LEVEL_SET && !isNamed)) continue;
        const openvdb::GridBase::Ptr grid = file.readGrid(name.gridName());
        STIPPLE_TRY(checkVoxels(request, *grid, bytes));
        sets.push_back(nearOrigin(meta->getName(), asFloats(grid)));
    }
    return sets;
}

Result<std::vector<openvdb::GridBase::Ptr>> readPointGrids(const Request& request) {
    openvdb::io::File file(request.path);
    file.setCopyMaxBytes(0);
    file.open(false);
    std::vector<openvdb::GridBase::Ptr> grids;
    for (auto name = file.beginName(); name != file.endName(); ++name) {
        const openvdb::GridBase::Ptr meta = file.readGridMetadata(name.gridName());
        if (!isWanted(request, *meta)) continue;
        if (meta->isType<openvdb::points::PointDataGrid>()) grids.push_back(file.readGrid(name.gridName()));
    }
    return grids;
}

}  // namespace stipple::vdb
