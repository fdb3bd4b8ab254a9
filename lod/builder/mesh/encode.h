// The chunk of a group.
#pragma once

#include "lod/builder/mesh/cell.h"

namespace stipple::lod {

/// `members` by producer; fills runs, counts and textures of `group`.
std::vector<uint8_t> encodeGroup(const WeldedMesh& mesh, const std::vector<const Cluster*>& members,
                                 const std::vector<Producer>& producers, const MeshBuildSettings& settings,
                                 Group& group);

}  // namespace stipple::lod
