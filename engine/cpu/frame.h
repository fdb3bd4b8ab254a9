// What the passes of one frame share on the cpu: what is drawn, and the planes that one pass hands to the next.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/huge_buffer.h"
#include "engine/base/queue.h"
#include "engine/cpu/effect_room.h"
#include "engine/cpu/hidden_nodes.h"
#include "engine/cpu/kernels.h"
#include "engine/cpu/pixel_regions.h"
#include "engine/cpu/pyramid.h"
#include "engine/render/backend.h"
#include "engine/render/chunk_table.h"

namespace stipple::cpu {

/// Resident chunks; `tiles`: of textures, by source and chunk; null: not resident.
struct Chunks {
    render::ChunkTable<lod::Chunk> chunks;
    std::vector<std::vector<const uint32_t*>> tiles;

    const lod::Chunk& at(streaming::ChunkKey key) const { return chunks.at(key); }
};

/// The tiles that a disc reaches; none if the last is before the first.
struct TileRange {
    uint16_t firstX, firstY, lastX, lastY;
    uint64_t tiles() const { return uint64_t{lastX - firstX + 1u} * (lastY - firstY + 1u); }
};

struct Frame {
    Frame(Executor& of, const Kernels& kernels_, Chunks& resident)
        : executor(of), kernels(kernels_), k(kernels_), tables(makeTables()), chunks(resident), pyramid(of, k) {}

    Executor& executor;
    const Kernels& kernels;
    Kernels k;  ///< those of the frame's kind of view
    const Tables tables;
    Chunks& chunks;

    // Of the frame at hand.
    const render::DrawList* draws = nullptr;
    const render::Reconstruction* mode = nullptr;
    shared::FrameConstants constants{};
    render::Image* image = nullptr;
    bool wantAll = false;       ///< depths are wanted ...
    bool wantsRest = false;     ///< ... and normals and linear colours
    bool hasPyramid = false;    ///< the levels above the first are of this frame: push runs
    bool wantsNormals = false;  ///< some pass reads the surface's
    bool mayHideNodes = false;  ///< RenderRequest::mayHideNodes
    bool tellsHiddenNodes = false;
    bool hasSmooth = false;    ///< pixels of wide discs take colours and normals from a pyramid of their own ...
    bool isSmoothing = false;  ///< ... which is being made: of nothing but those discs

    // Plane::visibility. It is clear between frames: resolve resets each entry that it has read.
    HugeBuffer<uint64_t> visibility;
    std::vector<uint8_t> runs;  ///< of `visibility`
    PixelRegions regions;       ///< of the picture
    size_t visibilityPixels = 0;

    // Where the draws' records are.
    std::vector<BlockSource> blocks;
    std::vector<CurveBlock> curveBlocks;
    std::vector<MeshBlock> meshBlocks;
    std::vector<PatchSource> patchBlocks;
    std::vector<shared::DrawMesh> patches;  ///< placed
    std::vector<TextureSet> textureSets;
    /// Are there triangles or patches?
    bool hasTriangles = false, hasEmissive = false, hasCurves = false;
    bool hasLitPatches = false;  ///< patches that send light, or are shown as they are

    HiddenNodes hidden;  ///< which blocks of points are drawn, and when

    // What covers so many pixels that its rows are shared out.
    std::vector<LargeTriangle> large;
    std::vector<FilledCurve> wide;
    std::vector<shared::WideDisc> discs;     ///< Plane::discList
    std::vector<shared::DiscBox> discBoxes;  ///< of each

    // Of discs drawn exactly (passes/splat.cpp); kept for their memory only.
    std::vector<PlacedSplat> placedSplats;
    std::vector<uint32_t> placedColours;  ///< only where discs are blended
    std::vector<TileRange> splatTiles;
    std::vector<uint32_t> tilePlaces, tileEnds;
    uint64_t mostTileEntries = 0;  ///< of those lists, at a time

    // Plane::filtered, and its coverage, of 255; only where discs are blended.
    HugeBuffer<shared::FilteredPixel> filtered;
    HugeBuffer<uint8_t> coverage;
    size_t filteredPixels = 0;
    // Second surfaces, where there are some; of each pixel its place among them and their kind; runs that have any.
    std::unique_ptr<SecondPixel, void (*)(void*)> secondPixels{nullptr, std::free};
    uint32_t secondsUsed = 0;
    std::unique_ptr<uint32_t, void (*)(void*)> secondPlaces{nullptr, std::free};
    std::vector<uint8_t> secondKinds, secondRuns;

    Pyramid pyramid;  ///< Plane::texels and Plane::coarse, or Plane::smooth; without one texels never leave the cache
    HugeBuffer<uint8_t> smooth;  ///< 1: shows a point of a node that is kNodeSmooth; only where there are some
    size_t smoothPixels = 0;
    /// Without a pyramid: 1 where the row of a tile shows something, all tiles of a row side by side.
    std::vector<uint8_t> shownRows;
    uint8_t& shownRow(uint32_t x0, uint32_t y) { return shownRows[tileRow(x0, y)]; }
    /// Its place among them.
    size_t tileRow(uint32_t x0, uint32_t y) const {
        return size_t{y} * ((constants.width + kTile - 1) / kTile) + x0 / kTile;
    }
    /// Of a row of a tile, once it is resolved.
    bool mayShow(uint32_t x0, uint32_t y, uint32_t n) {
        return hasPyramid ? pyramid.level(0).mayHold(y, x0, n) : shownRow(x0, y) != 0;
    }
    // Of the pixels of triangles, beside their texels.
    HugeBuffer<uint32_t> surface, emissive;
    size_t surfacePixels = 0, emissivePixels = 0;
    KeptSurface kept;         ///< Plane::surface, only where rows are kept between passes
    EffectRoom effectRoom;    ///< planes of effects
    size_t effectAtWork = 0;  ///< whose pass runs: its place in the table of effects
    /// Room for a plane of the effect whose pass runs, the same from frame to frame while it stays as large; new room
    /// is zero. Not from several threads.
    template <typename T>
    T* room(size_t plane, size_t count) {
        return static_cast<T*>(effectRoom.at(effectAtWork, plane, count * sizeof(T)));
    }

    /// Lights that cast shadows, in frames with pass shadow.
    struct Shadows {
        std::vector<shared::ShadowMap> maps;
        std::vector<const float*> depths;  ///< of each
        std::vector<const uint32_t*> through;
        uint32_t* masks = nullptr;    ///< Plane::shadows: a picture for each light that casts
        uint8_t* shadowed = nullptr;  ///< of each light the rows of tiles (tileRow): 0: all of it comes there, no mask
        bool areKept = false;         ///< they are those of this frame already
    };
    Shadows shadows;

    /// What light adds of the picture's mirror images, in frames with pass reflection: planes of the picture, ...
    struct Mirrored {
        const float *red = nullptr, *green = nullptr, *blue = nullptr;
        const uint8_t* rows = nullptr;  ///< ... of which only rows of tiles are filled that are 1 here (as shownRows)
    };
    Mirrored mirrored;

    /// Are there blended discs?
    bool isBlended() const { return mode->blendsSplats && !blocks.empty(); }
    SecondPixels seconds() {
        if (!isBlended()) return SecondPixels{nullptr, nullptr, nullptr, nullptr, nullptr};
        return {secondPixels.get(), &secondsUsed, secondPlaces.get(), secondKinds.data(), secondRuns.data()};
    }
    Visibility visible() { return {visibility.data(), runs.data()}; }
    /// May any of these pixels show something?
    bool isSeen(size_t first, uint32_t n) const {
        bool any = false;
        for (size_t r = first >> Visibility::kRunBits; r <= (first + n - 1) >> Visibility::kRunBits; ++r)
            any = any || runs[r] != 0;
        return any;
    }
    SurfacePlanes planesAt(size_t pixel) {
        return {hasTriangles ? surface.data() + pixel : nullptr, hasEmissive ? emissive.data() + pixel : nullptr,
                isBlended() ? coverage.data() + pixel : nullptr,
                hasSmooth && !isSmoothing ? smooth.data() + pixel : nullptr};
    }
    /// Rows of the image for all threads: what covers much of it must not be the work of one.
    template <typename Use>
    void forBands(const Use& use) {
        constexpr uint32_t kRows = 16;
        executor.parallelFor((constants.height + kRows - 1) / kRows, 1, [&](size_t begin, size_t end) {
            const auto first = static_cast<uint32_t>(begin) * kRows, last = static_cast<uint32_t>(end) * kRows - 1;
            use(first, std::min(last, constants.height - 1));
        });
    }
};

}  // namespace stipple::cpu
