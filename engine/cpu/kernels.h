// The inner loops of the cpu backend, compiled once per instruction set from kernels.inl and chosen at run time. They
// call the scalar formulas of shaders/shared; the compiler turns the loops into SIMD, so no formula stands twice.
#pragma once

#include <array>
#include <cstdint>

#include "shaders/shared/background.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/edl.h"
#include "shaders/shared/ewa.h"
#include "shaders/shared/fog.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/material.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/patch.h"
#include "shaders/shared/patch_splat.h"
#include "shaders/shared/record.h"
#include "shaders/shared/reflection.h"
#include "shaders/shared/shadow.h"
#include "shaders/shared/smooth.h"
#include "shaders/shared/splat_disc.h"
#include "shaders/shared/surface.h"
#include "shaders/shared/texture.h"
#include "shaders/shared/tone.h"
#include "shaders/shared/visibility.h"
#include "shaders/shared/wide_disc.h"

namespace stipple::cpu {

constexpr uint32_t kTile = 128;  ///< pixels of a row that are worked on together: all rows of a tile stay in L1 and L2
constexpr uint32_t kPad = 16;    ///< entries in front of the first one; also room behind the last one

constexpr uint32_t kTexelGroup = 16;  ///< texels of a row that are made or left out together

[[gnu::always_inline]] constexpr uint32_t wholeGroups(uint32_t n) {
    return (n + kTexelGroup - 1) / kTexelGroup * kTexelGroup;
}

constexpr uint32_t kWidePixel = ~1u;  ///< in the place of a pixel's index: a wide disc

/// A row of unpacked texels; entry x of a tile is at [kPad + x]. Entries -1 and n may be read as neighbours, and what
/// lies beyond up to whole groups: it is whatever older rows have left, finite, and counts for nothing.
struct TexelRow {
    static constexpr uint32_t kSize = kTile + 2 * kPad;
    // Plain arrays: references into std::array keep GCC 12 from vectorising.
    alignas(64) float depth[kSize], radius[kSize], thickness[kSize], x[kSize], y[kSize], perpX[kSize], perpY[kSize],
        red[kSize], green[kSize], blue[kSize];
    // Only of frames with tubes:
    alignas(64) float isRound[kSize], axisX[kSize], axisY[kSize];
    // Only of frames with materials of points (TexelSurface):
    alignas(64) float share[kSize], metallic[kSize], roughness[kSize];
    bool hasTubes;  ///< or narrow ribbons
    bool hasMaterials;
    bool isRounded;  ///< to pack and unpack it would change nothing
};

/// Some texels of a tile's row, a bit each.
struct RowBits {
    uint64_t of[kTile / 64] = {};
    [[gnu::always_inline]] bool isAny() const { return (of[0] | of[1]) != 0; }
    [[gnu::always_inline]] uint32_t count() const {
        return static_cast<uint32_t>(__builtin_popcountll(of[0]) + __builtin_popcountll(of[1]));
    }
    [[gnu::always_inline]] void add(uint32_t i) { of[i / 64] |= uint64_t{1} << i % 64; }
    /// Those of a group (kTexelGroup).
    [[gnu::always_inline]] uint32_t group(uint32_t g) const {
        return static_cast<uint32_t>(of[g / 4] >> g % 4 * kTexelGroup) & ((1u << kTexelGroup) - 1u);
    }
};
/// Texels of a row side by side, without the gaps between them.
struct ClosedUpRow {
    TexelRow texels;
    RowBits of;  ///< where they are in the row
};

/// A coarse row that is pushed from, with its texels' discs (CoarseDisc).
struct CoarseRow {
    static constexpr uint32_t kSize = TexelRow::kSize;
    TexelRow texels;
    alignas(64) float slopeX[kSize], slopeY[kSize], inverseDepth[kSize], facing[kSize], front[kSize], end[kSize];
    alignas(64) uint32_t kinds[kSize];
};

/// Packed texels of a row, or of a part of one: five planes, and a sixth in frames with materials of points.
struct Planes {
    float* depth;
    uint32_t *size, *offset, *normal, *colour;
    uint32_t* surface;  ///< or null
    Planes at(size_t i) const {
        return {depth + i, size + i, offset + i, normal + i, colour + i, surface == nullptr ? nullptr : surface + i};
    }
};

/// The nearest of each pixel, and which runs of kRun pixels hold any: the others cost nothing in later passes.
struct Visibility {
    static constexpr uint32_t kRunBits = 8, kRun = 1u << kRunBits;
    uint64_t* keys;
    uint8_t* runs;  ///< 1: may hold some
};

/// Discs are drawn exactly tile by tile: the planes of one stay in L1.
struct SplatTile {
    static constexpr uint32_t kWidth = 32, kHeight = 16;
    uint32_t x0, y0, width, height;  ///< px
};
/// A disc that is to be drawn, camera space.
struct PlacedSplat {
    float cx, cy, cz, nx, ny, nz, radius;
    uint32_t id;  ///< of the visibility buffer, with kAlone where discs are drawn exactly
};
/// How large discs count: at least so many of their node's spacings. What is drawn of them ends `support` sigmas of
/// `sigmas` radii each from their centres, widened by a low-pass (variance, px^2).
struct SplatReach {
    float leastSpacings = 0, sigmas = 1, support = 1, lowPass = 0;
};
/// The discs of one block, and boxes of pixels that hold them.
struct SplatBlock {
    static constexpr uint32_t kSize = shared::kRecordsPerBlock;
    alignas(64) float cx[kSize], cy[kSize], cz[kSize], nx[kSize], ny[kSize], nz[kSize], radius[kSize];
    alignas(64) int firstX[kSize], lastX[kSize], firstY[kSize], lastY[kSize];
    alignas(64) uint32_t colour[kSize];  ///< and flags, of the records
    alignas(64) uint32_t keep[kSize];    ///< 0: not to be drawn
    alignas(64) uint32_t alone[kSize];   ///< kAlone, or 0
};

/// What each record of a block of points claims.
struct ProjectedBlock {
    static constexpr uint32_t kSize = shared::kRecordsPerBlock;
    alignas(64) uint32_t pixel[kSize];  ///< its index; ~0u: none; kWidePixel: it is a wide disc
    alignas(64) uint32_t depth[kSize];  ///< bits
    int firstX, lastX, firstY, lastY;   ///< px; all pixels are among these; none: the first behind the last
};

/// The records of a block that claim a pixel, closed up.
struct Claims {
    /// Keys are scattered over the picture (16 MB at 1080p): so many pixels before they are read they are asked for.
    static constexpr uint32_t kAhead = 48;
    uint32_t count;
    alignas(64) uint32_t pixel[ProjectedBlock::kSize + kAhead];  ///< behind the last kAhead times the first
    alignas(64) uint32_t depth[ProjectedBlock::kSize];           ///< bits
    alignas(64) uint32_t lane[ProjectedBlock::kSize];            ///< of the block
};

struct BlockSource {
    const shared::PointRecord* records;  ///< first record of the block
    const shared::DrawNode* node;
    const uint8_t* weights = nullptr;     ///< of surfels, of the same records; null: there are none
    const uint16_t* materials = nullptr;  ///< of the first record; null: all have that of the node
    uint32_t materialOf(uint32_t lane) const {
        return materials == nullptr ? node->material & ~shared::kOnlyMaterial : materials[lane];
    }
};

/// One block of segments of curves.
struct CurveBlock {
    const shared::CurveSegment* segments;  ///< first of the block
    const shared::DrawNode* node;
};

/// Textures of one store; a tile that is not resident is null.
struct TextureSet {
    const shared::TextureInfo* infos;
    const uint32_t* const* tiles;
};

/// One cluster of a mesh: one block of draw ids.
struct MeshBlock {
    const shared::MeshVertex* vertices;
    const uint32_t* triangles;
    const shared::DrawMesh* mesh;
    const TextureSet* textures;
    uint32_t counts;  ///< vertices | triangles << 16
    uint32_t level;
    float errorPixels;
};

/// One block of a patch.
struct PatchSource {
    const shared::PatchBlock* block;
    const shared::DrawMesh* mesh;  ///< its patch
    uint32_t level;
    float errorPixels;
    bool hasLight = false;                    ///< of its own, in the map, and it is shown
    uint32_t material = shared::kPlainPoint;  ///< of all samples, packed, unless ...
    const uint16_t* materials = nullptr;      ///< ... each has its own
    const uint32_t* map = nullptr;            ///< the block's, if it has one
    uint32_t materialOf(uint32_t sample) const { return materials == nullptr ? material : materials[sample]; }
};

/// A splat of a patch that covers so many pixels that its rows are shared out among threads.
struct LargeSplat {
    const PatchSource* source;
    uint32_t firstPlace, lane;  ///< draw ids: of its block; its own
};
struct LargeSplatSink {
    void* context;
    void (*keep)(void* context, const LargeSplat& splat);
};

/// A triangle that covers so many pixels that its rows are shared out among threads.
struct LargeTriangle {
    int32_t x[3], y[3];
    float inverseDepth[3];  ///< imageLinear
    uint64_t id;            ///< drawId
};
/// A curve so wide that its pixels are filled, and so large that its rows are shared out among threads.
struct FilledCurve {
    bool isRound;
    uint64_t id;              ///< drawId
    shared::Tube tube;        ///< what a tube's rays meet
    float left[2], right[2];  ///< tube: pixels around both ends; what lies between the boxes is all it covers
    float top[2], bottom[2];
    shared::Ribbon ribbon;  ///< what a ribbon's rays meet
    float x[4], y[4];       ///< ribbon: its corners, px; all it covers lies between them
};
struct WideSink {
    void* context;
    void (*keep)(void* context, const FilledCurve& curve);
};

struct LargeSink {
    void* context;
    void (*keep)(void* context, const LargeTriangle& triangle);
};

/// Planes over the whole image, only where triangles are drawn; `emissive` only where something sends light.
struct SurfacePlanes {
    uint32_t* surface;
    uint32_t* emissive;       ///< packColour
    const uint8_t* coverage;  ///< of silhouettes, of 255; null: all or nothing
    uint8_t* smooth;          ///< 1: shows a point of a node that is kNodeSmooth; null: none is
};

/// Look-up tables that the kernels share.
struct Tables {
    std::array<float, 256> radiusFraction;
    std::array<uint32_t, 256> red, green, blue;  ///< sRGB byte -> its bits of the packed colour
    std::array<uint32_t, 2048> srgbByte;         ///< sqrt(linear) * 2047 -> sRGB byte
    /// sRGB byte of a point that is not lit -> its bits of the picture's pixel, which is opaque.
    std::array<uint32_t, 256> shownRed, shownGreen, shownBlue;
};

Tables makeTables();

/// The pixels of a row that show one kind of primitive.
struct WinningPixels {
    uint32_t count;
    alignas(64) uint32_t pixel[kTile], id[kTile];  ///< id: the place within its kind (visibility.h)
    alignas(64) float depth[kTile];
};

/// A second surface at a pixel that shows blended discs, or that they reach into (shaders/shared/ewa.h).
struct SecondPixel {
    shared::FilteredPixel shown;
    float depth;   ///< linear
    float limit;   ///< depth behind which a pixel beside this one shows that the front ends here
    float share;   ///< of the pixel, in its place
    uint64_t key;  ///< kSecondFront: of what is behind
};
/// Those of an image.
struct SecondPixels {
    SecondPixel* list;  ///< those of one tile behind those of another; null: there are none
    uint32_t* used;     ///< how many it holds
    uint32_t* places;   ///< in the list, of each pixel that has one
    uint8_t* kinds;     ///< kSecond... of each
    uint8_t* runs;      ///< as Visibility::runs
    const SecondPixel* at(size_t pixel) const {
        return list != nullptr && kinds[pixel] != shared::kSecondNone ? list + places[pixel] : nullptr;
    }
    /// Room for some of a tile: the place of the first. (In which order tiles come changes no pixel.)
    uint32_t take(uint32_t count) const { return __atomic_fetch_add(used, count, __ATOMIC_RELAXED); }
    /// May any of these have one?
    bool mayHave(size_t first, size_t n) const {
        bool any = false;
        for (size_t r = first >> Visibility::kRunBits; list != nullptr && r <= (first + n - 1) >> Visibility::kRunBits;
             ++r)
            any = any || __atomic_load_n(&runs[r], __ATOMIC_RELAXED) != 0;
        return any;
    }
};

struct Frame;
/// Texels of pixels of one kind; none of its row has anything yet.
using ResolveKind = void (*)(const Frame& frame, const WinningPixels& pixels, uint32_t x0, uint32_t y, TexelRow& row);

/// What the passes after coverage read of the frame beside records.
struct ResolveInput {
    const BlockSource* blocks;
    const MeshBlock* meshBlocks;
    const shared::SurfaceMaterial* materials;
    const PatchSource* patchBlocks;
    const CurveBlock* curveBlocks;
    const shared::WideDisc* discs;
    const shared::DiscBox* discBoxes;  ///< of each
    size_t discCount;
    bool exactPoints;   ///< points are what their pixels show, at the depth of the visibility buffer
    bool needsDepths;   ///< else nobody asks more of those than whether there is one
    bool roundsPoints;  ///< rows of nothing but such points are rounded as packed ones are (TexelRow::isRounded)
    const shared::FilteredPixel* filtered;  ///< of the image: what they show there; null: that of their records
    SecondPixels seconds;
    const Frame* frame;         ///< for ...
    const ResolveKind* ofKind;  ///< ... kinds that are resolved without kernels; null: a kernel does
};

struct LightInput {
    const shared::LightSource* lights;
    const float* environment;     ///< table of shaders/shared/environment.h; null: none
    const uint32_t* shadowSlots;  ///< of each light 1 + that of its mask in the row, or 0; null: none casts
};

/// Maps of lights that cast shadows: of each light the finest first.
struct ShadowInput {
    const shared::ShadowMap* maps;  ///< whose texels begin at 0
    const float* const* depths;     ///< of each
    const uint32_t* const* through;
    uint32_t count, slots;
};

/// The visible surface at the pixels of a tile's row, whatever it was made of: what reconstruction leaves, light
/// changes (colours only) and output reads.
struct SurfaceRow {
    alignas(64) float depth[kTile];  ///< linear, world units; 0: nothing. Only > 0 is sure unless depths are wanted
    alignas(64) float nx[kTile], ny[kTile], nz[kTile];              ///< camera space, towards the eye; only if wanted
    alignas(64) float red[kTile], green[kTile], blue[kTile];        ///< linear: of the surface, then what it sends
    alignas(64) float leaf[kTile];                                  ///< 1: lets light through; only if wanted
    alignas(64) uint32_t material[kTile];                           ///< metallic 8 | roughness 8 | occlusion 8 | flags
    alignas(64) uint32_t emission[kTile];                           ///< packColour; only if hasEmission
    alignas(64) float ownDepth[kTile];                              ///< before reconstruction; only if wanted
    alignas(64) float coverage[kTile];                              ///< only if hasCoverage
    alignas(64) uint32_t shadow[shared::kMostShadowLights][kTile];  ///< packLight: what comes of lights that cast
    bool isShadowed[shared::kMostShadowLights];                     ///< else all comes, `shadow` is not filled
    uint32_t shadowSlots;                                           ///< so many of them
    bool hasTriangles, hasEmission, hasCoverage, hasMaterials;
    bool hasOcclusion;  ///< of points, too
    bool hasOpacity;    ///< some pixels may be kPixelBlends
    bool hasBehind;     ///< what is not covered shows these, and not one colour
    alignas(64) float behindRed[kTile], behindGreen[kTile], behindBlue[kTile];
    const float *placeX, *placeY;  ///< px from the principal point; both null: where the row is
    const float *mirroredRed, *mirroredGreen,
        *mirroredBlue;  ///< what light adds of the picture's mirror images, or null
};
/// What of a surface is needed beyond whether there is one, and its colour.
struct SurfaceWants {
    bool depth, normal, leaf, ownDepth;
    bool isMerged;  ///< texels are a pyramid's (planeDepth)
};

/// Planes of the surface buffer, from a row's first pixel on (effect_room.h).
struct KeptRow {
    float* depth;
    uint32_t *normal, *colour, *material;
};

/// Logarithms of depth in the rows of a pixel's neighbours, from the row's first pixel on.
struct EdlRows {
    const float *straightAbove, *straightBelow, *slantedAbove, *slantedBelow;
};

/// What ambient occlusion is computed of (shaders/shared/occlusion.h): every pixel, or every second one both ways, with
/// a border of nothing.
struct AoPlanes {
    static constexpr uint32_t kBorder = 2;
    float* depth;      ///< 0: nothing
    uint32_t* normal;  ///< octahedral
    float *open, *mean;
    uint32_t width, height, pitch, edge;  ///< edge: px from one to the next
    float radius;                         ///< world units
    std::array<float, 16> cosine, sine;   ///< of aoAngle
    size_t at(uint32_t x, uint32_t y) const { return size_t{y + kBorder} * pitch + x + kBorder; }
};

/// What reflections of the screen are made of: planes over the picture (KeptSurface), and what lights them.
struct ReflectionInput {
    shared::ReflectionConstants constants;
    const float* depth;
    const uint32_t *normal, *colour, *material;
    const uint32_t* emissive;  ///< or null
    LightInput light;
    ShadowInput shadows;  ///< no slots: none
    bool hasOcclusion;    ///< of points, too
};
/// What light adds to the pixels of a row.
struct MirroredRow {
    float *red, *green, *blue;
};

struct ShadeOutput {
    uint32_t* rgba;
    float *depth, *normal, *linear;  ///< may be null
};

/// What a row of pixels shows.
enum class RowContent { nothing, points, other };

/// Compiled once for views in perspective and once for orthographic ones, which `orthographic` leads to.
struct Kernels {
    const char* name;
    const Kernels* orthographic;
    /// Up to 256 records. `besideToo`: also those beside the picture whose discs reach in; wide discs give kWidePixel.
    void (*projectBlock)(const shared::FrameConstants& f, const shared::DrawNode& node,
                         const shared::PointRecord* records, uint32_t count, bool besideToo, ProjectedBlock& to);
    /// Those of the block's first `count` records that claim a pixel.
    void (*findClaims)(const ProjectedBlock& block, uint32_t count, Claims& to);
    /// Decodes the winners of `n` pixels of row `y` from `x0` on; clears the visibility entries. False if all are
    /// empty. `closedUp`: where some pixels show nothing and all others show points, their texels once more (else it
    /// is of none).
    /// `planes`: from the row's first pixel on; null without triangles, 0 where none is seen.
    bool (*resolveRow)(const shared::FrameConstants& f, const Tables& tables, const ResolveInput& in,
                       uint64_t* visibility, uint32_t x0, uint32_t y, uint32_t n, TexelRow& row, ClosedUpRow& closedUp,
                       float& largestRadius, const SurfacePlanes& planes);
    /// The same and all passes after it, where points show their own colours and nobody asks for more: their pixels of
    /// the picture. Does nothing if the row shows something else (with
    /// `tellsSmooth` points of smooth nodes, too), or nothing. `nothing`: a pixel without points.
    RowContent (*showPoints)(const shared::FrameConstants& f, const Tables& tables, const BlockSource* blocks,
                             bool tellsSmooth, uint64_t* visibility, uint32_t n, uint32_t nothing, uint32_t* rgba);
    /// Groups (kTexelGroup) of texels of which some are there: of the others nothing is written. A bit each.
    uint32_t (*packRow)(const TexelRow& row, uint32_t n, const Planes& to);
    /// `held`: those groups; others become empty, and nothing of them is read. `to`: entry of the first in the row.
    /// `hasNormals`: else those of rows without tubes and materials are any.
    void (*unpackRow)(const Planes& from, uint32_t to, uint32_t n, uint32_t held, bool hasNormals, TexelRow& row);
    /// Packed texels that are closed up, each in its place of a row; of groups without any nothing is written, of
    /// others 0 between them. Reads up to a group more than there are, writes whole groups.
    void (*openUpPacked)(const Planes& from, const RowBits& of, bool hasNormals, const Planes& to);
    void (*pullRow)(const TexelRow& upper, const TexelRow& lower, uint32_t n, float childSize, float focal,
                    TexelRow& out);
    /// `nearRow`: the coarse row of the parents; `farRow`: the one beyond, in direction sy. (x, y): centre of the row's
    /// first texel, px from the principal point. `wanted`: groups of texels (kTexelGroup), a bit each; others may be
    /// left empty. `coloursAlone`: of rows without tubes depths, colours and materials are all that is made. Entries of
    /// `out` behind the row's last are written, too.
    void (*pushRow)(const TexelRow& fine, const CoarseRow& nearRow, const CoarseRow& farRow, float sy, float x, float y,
                    uint32_t n, uint32_t wanted, float fineSize, float focal, bool coloursAlone, TexelRow& out);
    /// Discs of a coarse row's entries -1 to (n + 1) / 2. (x, y): centre of its first texel, px from the principal
    /// point; `size`: edge of its texels, px.
    void (*coarseDiscs)(CoarseRow& row, uint32_t n, float x, float y, float size, float focal);
    /// Normals and depths of tubes, pixel by pixel, once a row is reconstructed.
    void (*finishRow)(float focal, uint32_t n, TexelRow& row);
    /// The surface of a reconstructed row; `own`: the row before. `planes`: from the row's first pixel on, or null.
    void (*surfaceRow)(const shared::FrameConstants& f, const TexelRow& own, const TexelRow& row,
                       const SurfacePlanes& planes, const SurfaceWants& wants, uint32_t x0, uint32_t y, uint32_t n,
                       SurfaceRow& out);
    /// Colours, normals and materials of wide discs (planes.smooth) where they are of one surface with what was
    /// reconstructed of such: `mean`, and the texels that it is of (shaders/shared/smooth.h).
    void (*smoothRow)(const shared::FrameConstants& f, const TexelRow& texels, const SurfaceRow& mean,
                      const SurfacePlanes& planes, uint32_t n, SurfaceRow& out);
    /// What of lights that cast shadows comes to the surface.
    void (*shadowRow)(const shared::FrameConstants& f, const ShadowInput& in, uint32_t x0, uint32_t y, uint32_t n,
                      SurfaceRow& row);
    /// What the surface sends to the eye.
    void (*lightRow)(const shared::FrameConstants& f, const LightInput& light, uint32_t x0, uint32_t y, uint32_t n,
                     SurfaceRow& row);
    /// The picture's pixels, over the background.
    void (*outputRow)(const shared::FrameConstants& f, const Tables& tables, uint32_t n, const SurfaceRow& row,
                      const ShadeOutput& out);
    /// Into the surface buffer: 16 bytes a pixel, or 12 without normals; without `depth` colours and materials alone.
    /// Colours beyond 1 are 1 there.
    void (*keepRow)(const SurfaceRow& row, const SurfaceWants& wants, uint32_t n, const KeptRow& to);
    /// And back; false if nothing is there.
    bool (*takeRow)(const KeptRow& from, const SurfaceWants& wants, uint32_t n, SurfaceRow& row);
    /// Effects on what surfaces show or send. edlLogs: edlDepth of `n` pixels, at most kTile + 2 kEdlReach.
    void (*edlLogs)(const shared::EdlConstants& c, const float* depth, uint32_t n, float* out);
    /// `here`: edlLogs of the row; `scales`: of its neighbours' rows, of each scale.
    void (*edlRow)(const shared::FrameConstants& f, const shared::EdlConstants& c, const float* here,
                   const EdlRows* scales, uint32_t n, SurfaceRow& row);
    void (*fogRow)(const shared::FrameConstants& f, const shared::FogConstants& c, uint32_t x0, uint32_t y, uint32_t n,
                   SurfaceRow& row);
    void (*toneRow)(const shared::ToneConstants& c, uint32_t n, SurfaceRow& row);
    /// What is behind the row's pixels (row.behindRed ...); `texels`: of the backdrop.
    void (*backgroundRow)(const shared::FrameConstants& f, const shared::BackgroundConstants& c, const uint32_t* texels,
                          uint32_t x0, uint32_t y, uint32_t n, SurfaceRow& row);
    /// Offers the triangles of one cluster (places from firstPlace on) to the visibility buffer.
    void (*rasterCluster)(const shared::FrameConstants& f, const shared::SurfaceMaterial* materials,
                          const MeshBlock& block, uint32_t firstPlace, const LargeSink& large,
                          const Visibility& visibility);
    /// Rows [firstRow, lastRow] of the triangles that were kept.
    void (*rasterLarge)(const shared::FrameConstants& f, const LargeTriangle* large, size_t count, uint32_t firstRow,
                        uint32_t lastRow, const Visibility& visibility);
    /// Offers the triangles of one block of a patch (places from firstPlace on) to the visibility buffer.
    void (*rasterPatch)(const shared::FrameConstants& f, const PatchSource& of, uint32_t firstPlace,
                        const LargeSink& large, const Visibility& visibility);
    /// The same as splats (shaders/shared/patch_splat.h); frame constants say of which kind.
    void (*splatPatch)(const shared::FrameConstants& f, const PatchSource& of, uint32_t firstPlace,
                       const LargeSplatSink& large, const Visibility& visibility);
    /// Rows [firstRow, lastRow] of the splats that were kept: those of a block one after another, by lane.
    void (*splatLarge)(const shared::FrameConstants& f, const LargeSplat* splats, size_t count, uint32_t firstRow,
                       uint32_t lastRow, const Visibility& visibility);
    /// Offers up to 256 segments of curves (places from firstPlace on) to the visibility buffer.
    void (*drawSegments)(const shared::FrameConstants& f, const CurveBlock& block, uint32_t count, uint32_t firstPlace,
                         const WideSink& wide, const Visibility& visibility);
    /// Rows [firstRow, lastRow] of the curves that were kept.
    void (*fillWide)(const shared::FrameConstants& f, const FilledCurve* curves, size_t count, uint32_t firstRow,
                     uint32_t lastRow, const Visibility& visibility);
    /// Rows [firstRow, lastRow] of wide discs.
    void (*fillDiscs)(const shared::FrameConstants& f, const shared::WideDisc* discs, const shared::DiscBox* boxes,
                      size_t count, uint32_t firstRow, uint32_t lastRow, const Visibility& visibility);
    /// Up to 256 records as discs in camera space.
    void (*placeSplats)(const shared::FrameConstants& f, const shared::DrawNode& node,
                        const shared::PointRecord* records, uint32_t count, const SplatReach& reach, SplatBlock& out);
    /// Draws some discs into the pixels of one tile, which is nobody else's meanwhile.
    void (*splatTile)(const shared::FrameConstants& f, const PlacedSplat* splats, const uint32_t* places, size_t count,
                      const SplatTile& tile, const Visibility& visibility);
    /// Blends some discs at the pixels of one tile, which is nobody else's meanwhile; `filtered` is of the whole image.
    /// `colours`: of each disc, as records have them, with their flags. `wantsNormals`: else those of pixels (and their
    /// materials) are any.
    void (*filterTile)(const shared::FrameConstants& f, const Tables& tables, const BlockSource* blocks,
                       const PlacedSplat* splats, const uint32_t* colours, const uint32_t* places, size_t count,
                       const SplatTile& tile, bool wantsNormals, const Visibility& visibility,
                       shared::FilteredPixel* filtered, const SecondPixels& seconds);
    /// Does one of nine pixels about (x, y) show nothing opaque, or what is deeper than `limit`?
    bool (*isAtJump)(const shared::FrameConstants& f, const uint64_t* keys, const shared::FilteredPixel* filtered,
                     uint32_t x, uint32_t y, float limit);
    /// 1 for each pixel of a row that no opaque surface is seen at.
    void (*openRow)(const shared::FrameConstants& f, const uint64_t* keys, const shared::FilteredPixel* filtered,
                    uint32_t n, uint8_t* open);
    /// Ambient occlusion: how much of the light gets to entries of the planes, into `open`; the mean of those along a
    /// row (into `mean`), then down (into `open`); and to pixels of the picture that are an edge apart.
    void (*occludeRow)(const shared::FrameConstants& f, const AoPlanes& of, uint32_t x0, uint32_t y, uint32_t n);
    void (*aoMeanRow)(const shared::FrameConstants& f, const AoPlanes& of, bool isDown, uint32_t x0, uint32_t y,
                      uint32_t n);
    void (*aoSpreadRow)(const shared::FrameConstants& f, const AoPlanes& of, const float* depth, const uint32_t* normal,
                        uint32_t x0, uint32_t y, uint32_t n, float* open);
    /// What a row mirrors of the picture; false, and nothing is written, where that is nothing.
    bool (*reflectRow)(const shared::FrameConstants& f, const ReflectionInput& in, uint32_t x0, uint32_t y, uint32_t n,
                       const MirroredRow& out);
    /// Of each 16 pixels of `n` (at most kTile) and `rows`: bits of the depth of the farthest (keyDepthBits); where all
    /// have a pixel without a key it may return after some of the rows, as that is what is farthest.
    void (*farthestOf)(const uint64_t* keys, size_t stride, uint32_t rows, uint32_t n, uint32_t* farthest);
};

/// The best kernels that this processor runs; STIPPLE_SIMD=sse|avx2|avx512 asks for fewer.
const Kernels& bestKernels();
/// All that it runs, for tests.
const Kernels* const* availableKernels(size_t& count);

}  // namespace stipple::cpu
