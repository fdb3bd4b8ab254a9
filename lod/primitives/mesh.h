// Triangle meshes: what scenes give and the build takes, and what the node table of a mesh store says beyond nodes.
//
// In a mesh store a node is a GROUP of clusters that are simplified together (their parent is one simplification), so
// groups form a directed acyclic graph: the clusters that one simplification produces are shared out to several groups
// of the next coarser level. A group is refined iff its error is too large for its sphere and its chunk and those of
// all its parents are there; then its clusters stand in the place of what its simplification gave. All of them or
// none: that is why there are no cracks.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "shaders/shared/material.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/texture.h"

namespace stipple::lod {

/// A triangle soup with shared vertices. Arrays are as long as `position`.
struct TriangleMesh {
    std::vector<glm::dvec3> position;
    std::vector<glm::vec3> normal;  ///< any length; ignored where kSurfaceFlat
    std::vector<glm::vec2> uv;
    std::vector<uint32_t> colour;   ///< sRGB, alpha in the high byte
    std::vector<uint32_t> surface;  ///< material | flags (shaders/shared/mesh.h)
    std::vector<uint32_t> indices;  ///< 3 a triangle
};

/// Clusters of one group that one simplification produced; they are drawn or left out together.
struct MeshRun {
    static constexpr uint32_t kOriginal = ~0u;
    uint32_t producer = kOriginal;  ///< node whose simplification gave them; kOriginal: triangles of the input
    uint32_t firstCluster = 0, clusters = 0, triangles = 0;
};

struct MeshGroup {
    uint32_t firstRun = 0, runs = 0;          ///< into Hierarchy::runs
    uint32_t firstParent = 0, parents = 0;    ///< into Hierarchy::parents; none: a root, always refined
    uint32_t vertices = 0, clusters = 0;      ///< in the chunk
    uint32_t firstTexture = 0, textures = 0;  ///< into Hierarchy::groupTextures
    // What part of them, and how densely: texture coordinates per lattice step where they lie closest together.
    float lowU = 0, lowV = 0, highU = 0, highV = 0, uvPerStep = 0;
};

/// One tile of a texture level, in the file.
struct TextureTile {
    uint64_t offset = 0, hash = 0;
    uint32_t bytes = 0, reserved = 0;
};

enum class TextureKind : uint8_t { colour, normal, data };
/// A decoded texture on its way into a store; empty: white, or for normals straight up.
struct TextureImage {
    TextureKind kind = TextureKind::colour;
    uint32_t width = 0, height = 0;
    uint32_t wrapU = shared::kWrapRepeat, wrapV = shared::kWrapRepeat;
    std::vector<uint32_t> rgba;  ///< 8 bits each; sRGB if a colour
};

}  // namespace stipple::lod
