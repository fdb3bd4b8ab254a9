// What a .vdb file says of its grids before any voxel is read. By our own reading: OpenVDB takes counts and sizes from
// a file as they are.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::lod {

enum class VdbKind : uint8_t { levelSet, points, fog, unknownClass, unknownType };

struct VdbGrid {
    std::string name;       ///< as a person gave it; several may have the same
    std::string type;       ///< of its tree, as the file has it: "Tree_float_5_4_3"
    std::string valueType;  ///< "float"
    std::string gridClass;  ///< "level set"; empty: not said
    std::string transform;  ///< "UniformScaleTranslateMap"
    VdbKind kind = VdbKind::unknownType;
    bool isHalf = false;
    uint64_t voxels = 0, memoryBytes = 0;  ///< as declared; 0: not said
    uint64_t begin = 0, end = 0;           ///< in the file
    /// "'density' (fog volume, float)".
    std::string label() const;
};
struct VdbHeader {
    uint32_t version = 0;
    std::vector<VdbGrid> grids;
};

/// Errors: no VDB file, a version that is not read, a file that ends before its grids do, counts that cannot be.
Result<VdbHeader> readVdbHeader(const std::string& path);

/// The grids that are drawn of a file.
struct VdbChoice {
    bool hasLevelSets = false, hasPoints = false;
    std::vector<std::string> leftOut;  ///< labels of the others
    uint64_t voxels = 0, memoryBytes = 0;
};
/// All level sets and point grids, or the one that is called `name`, of which a class need not be said. Error: there
/// is none; says what there is instead.
Result<VdbChoice> chooseGrids(const VdbHeader& header, const std::string& name, const std::string& path);

}  // namespace stipple::lod
