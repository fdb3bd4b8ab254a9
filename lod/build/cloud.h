// What travels between the steps of a build: one cloud on one lattice, then the same cloud in Morton order with its
// octree.
#pragma once

#include <string>
#include <vector>

#include "lod/build/build.h"
#include "lod/hierarchy.h"

namespace stipple::lod {

/// One attribute of every point: stored values, bytesOf(info.type) each.
struct CloudAttribute {
    AttributeInfo info;
    std::vector<uint8_t> values;
};

/// All points on one lattice: world = origin + unit * (x, y, z). Arrays are parallel.
struct Cloud {
    glm::dvec3 origin{0};
    double unit = 1;
    double roundingUnits = 0;  ///< largest rounding to the lattice, world units
    std::vector<uint32_t> x, y, z;
    std::vector<uint32_t> colour;  ///< r g b 8 | flags 8
    std::vector<uint32_t> normal;  ///< octahedral; meaning given by the flags
    std::vector<float> radius;     ///< lattice units; 0: to be estimated
    bool hasColour = false, hasNormal = false, hasRadius = false, isReflectance = false;
    UpAxis up = UpAxis::z;
    Crs crs;
    std::string source;
    std::vector<CloudAttribute> attributes;
    size_t size() const { return x.size(); }
};

/// Memory that a build needs per input point at its peak.
constexpr uint64_t kBuildBytesPerPoint = 96;

Result<Cloud> readCloud(const std::vector<std::string>& inputs, const BuildSettings& settings, BuildReport& report,
                        Executor& executor, Progress& progress);

struct BuildNode {
    uint32_t begin = 0, end = 0;  ///< points, in Morton order
    uint32_t parent = 0, firstChild = 0;
    std::array<uint32_t, 3> cell{};
    uint8_t level = 0, childMask = 0;
};

/// The octree over a cloud that is now sorted by `key` (Morton code of the upper `keyLevels` bits of each coordinate).
struct Partition {
    uint32_t rootLog2 = 0, keyLevels = 0;
    std::vector<uint64_t> key;
    std::vector<BuildNode> nodes;      ///< breadth first
    std::vector<uint32_t> levelBegin;  ///< first node of each level, and the end
    /// Key bits below level `level`.
    uint32_t shiftOf(uint32_t level) const { return 3 * (keyLevels - level); }
};

Partition partitionCloud(Cloud& cloud, uint32_t leafRecords, Executor& executor);

/// Fills in missing radii and normals from the neighbourhood; clamps radii.
void estimateAttributes(Cloud& cloud, const Partition& partition, const BuildSettings& settings, Executor& executor,
                        Progress& progress);

class StoreWriter;
/// Builds the records of every node bottom-up, measures their errors against the leaves, encodes and appends them.
Result<Hierarchy> simplifyAndWrite(Cloud& cloud, const Partition& partition, StoreWriter& writer, Executor& executor,
                                   Progress& progress);

}  // namespace stipple::lod
