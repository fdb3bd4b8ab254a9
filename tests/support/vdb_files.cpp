#include "tests/support/vdb_files.h"

#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <cmath>

namespace stipple::test {
namespace {
using openvdb::Vec3d;
using openvdb::Vec3f;

openvdb::math::Transform::Ptr transformOf(const glm::dmat4& m) {
    openvdb::Mat4d rows;
    for (int r = 0; r < 4; ++r)
        for (int c = 0; c < 4; ++c) rows[r][c] = m[r][c];  // row vectors there, column vectors here
    return openvdb::math::Transform::createLinearTransform(rows);
}

void write(const std::string& path, const openvdb::GridPtrVec& grids, bool hasCounts) {
    openvdb::io::File file(path);
    file.setGridStatsMetadataEnabled(hasCounts);
    file.write(grids);
    file.close();
}

template <typename Grid>
openvdb::GridBase::Ptr gridOf(const VdbField& f) {
    using Value = typename Grid::ValueType;
    auto grid = Grid::create(static_cast<Value>(f.band));
    auto access = grid->getAccessor();
    for (const auto& at :
         openvdb::CoordBBox(f.least.x, f.least.y, f.least.z, f.greatest.x, f.greatest.y, f.greatest.z)) {
        const double v = f.value(glm::dvec3(f.worldFromVoxel * glm::dvec4(at[0], at[1], at[2], 1)));
        if (std::abs(v) < f.band) access.setValue(at, static_cast<Value>(v));
    }
    if (f.gridClass == "level set") openvdb::tools::signedFloodFill(grid->tree());
    grid->setTransform(transformOf(f.worldFromVoxel));
    grid->setName(f.name);
    grid->setGridClass(openvdb::GridBase::stringToGridClass(f.gridClass));
    return grid;
}

}  // namespace

void writeVdb(const std::string& path, const std::vector<VdbField>& fields, bool hasCounts) {
    openvdb::initialize();
    openvdb::GridPtrVec grids;
    for (const VdbField& f : fields)
        grids.push_back(f.isDouble ? gridOf<openvdb::DoubleGrid>(f) : gridOf<openvdb::FloatGrid>(f));
    write(path, grids, hasCounts);
}

void writeVdbBlock(const std::string& path, int edge, bool hasCounts) {
    openvdb::initialize();
    auto grid = openvdb::FloatGrid::create(1.0f);
    grid->sparseFill(openvdb::CoordBBox(0, 0, 0, edge - 1, edge - 1, edge - 1), -1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setName("block");
    write(path, {grid}, hasCounts);
}

void writeVdbVectors(const std::string& path) {
    openvdb::initialize();
    auto grid = openvdb::Vec3SGrid::create();
    grid->getAccessor().setValue({1, 2, 3}, Vec3f(1, 0, 0));
    grid->setName("velocity");
    write(path, {grid}, true);
}

void writeVdbPoints(const std::string& path, const std::vector<VdbPoint>& points, double voxel,
                    const glm::dvec3& translation) {
    using namespace openvdb::points;
    openvdb::initialize();
    std::vector<Vec3d> places;
    std::vector<Vec3f> colours, normals;
    std::vector<float> radii, intensities;
    std::vector<int32_t> categories;
    for (const VdbPoint& p : points) {
        places.emplace_back(p.place.x, p.place.y, p.place.z);
        colours.emplace_back(p.colour.x, p.colour.y, p.colour.z);
        normals.emplace_back(p.normal.x, p.normal.y, p.normal.z);
        radii.push_back(p.radius);
        intensities.push_back(p.intensity);
        categories.push_back(p.category);
    }
    const auto transform = openvdb::math::Transform::createLinearTransform(voxel);
    transform->postTranslate({translation.x, translation.y, translation.z});
    const PointAttributeVector<Vec3d> wrapped(places);
    const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapped, *transform);
    const auto grid = createPointDataGrid<NullCodec, PointDataGrid>(*index, wrapped, *transform);
    const auto add = [&]<typename T>(const char* name, const std::vector<T>& values) {
        appendAttribute(grid->tree(), name, TypedAttributeArray<T>::attributeType());
        populateAttribute(grid->tree(), index->tree(), name, PointAttributeVector<T>(values));
    };
    add("Cd", colours);
    add("N", normals);
    add("pscale", radii);
    add("intensity", intensities);
    add("class", categories);
    grid->setName("scan");
    write(path, {grid}, true);
}

}  // namespace stipple::test
