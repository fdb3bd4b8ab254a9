// Records the passes of a frame (engine/render/passes.h): for each its dispatches, and the buffers that these read and
// write.
#pragma once

#include <vector>

#include "engine/gpu/pass_list.h"
#include "engine/gpu/pipelines.h"
#include "engine/render/backend.h"

namespace stipple::gpu {

constexpr uint32_t kLargeCapacity = 65536, kWideCapacity = 65536;  // see shaders/rasterise, shaders/strands

/// A level of the pyramid; `offset` in words.
struct Level {
    uint32_t width, height, offset;
};

struct FrameBuffers {
    Buffer frame, nodes, blocks, visibility, texels, stats, surface, image, extra, readback, staging;
    Buffer meshes, clusters, materials, textures, tiles, triangleWords, large;  // only with triangles
    Buffer wide;                                                                // only with curves
    Buffer lights, environment;                                                 // only with lights
    Buffer discs;                                                               // only with discs of many pixels
};

/// What a frame's passes are recorded from.
struct Recording {
    PassList& list;
    const Pipelines& pipelines;
    VkCommandBuffer commands;
    const FrameBuffers& buffers;
    const std::vector<Level>& levels;
    const render::DrawList& draws;
    const render::Reconstruction& mode;
    uint32_t clusters;  ///< of triangles
    bool wantAll, isLit;
    bool hasPyramid;  ///< the levels above the first are of this frame
};

void recordPass(const Recording& frame, render::Pass pass);

}  // namespace stipple::gpu
