// From a cut to what the passes read: a batch per kind of primitive (one DrawNode per node, one DrawBlock per 256
// records), frame constants. The only
// place where world-sized numbers (fp64) become camera-space fp32.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/render/backdrop.h"
#include "engine/render/content.h"
#include "engine/render/effects/settings.h"
#include "engine/render/effects/table.h"
#include "engine/render/environment.h"
#include "lod/cut/cut.h"
#include "lod/primitives/kinds.h"
#include "lod/primitives/optics.h"
#include "shaders/shared/curve.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/material.h"
#include "shaders/shared/mesh.h"
#include "shaders/shared/optics.h"
#include "shaders/shared/record.h"
#include "shaders/shared/shadow.h"
#include "streaming/streamer.h"

namespace stipple::render {

struct LayerInput;
struct LayerTables;
struct ShadowMaps;

/// A light in world space, as KHR_lights_punctual has it.
struct WorldLight {
    uint32_t kind = shared::kLightPoint;
    glm::dvec3 position{0}, direction{0, 0, -1};  ///< direction: where its light goes
    glm::vec3 colour{1};                          ///< linear, times candela or lux
    float range = 0, innerCone = 0, outerCone = 0.785f;
    bool castsShadow = false;  ///< where shadows are asked for; point lights never do
    /// Directional: the angle at which it is seen, radians; spot: its radius, world units; 0: borders are hard.
    float size = 0;
    bool isSun = false;  ///< the sky is as bright beside it as beside the sun over the viewer's shoulder
};

/// What is drawn of one kind of primitive: nodes, their records in blocks of 256 draw ids, and the chunks that hold
/// them.
struct DrawBatch {
    lod::Kind kind = lod::Kind::points;
    std::vector<shared::DrawNode> nodes;    ///< of triangles none: DrawList::meshDraws
    std::vector<shared::DrawBlock> blocks;  ///< of triangles one a cluster: its run and place in the chunk
    std::vector<streaming::ChunkKey> keys;  ///< chunk of each node (run)
    std::vector<uint32_t> instances;        ///< of each node
    std::vector<uint32_t> records;          ///< of each node of records: how many are looked at
    bool isEmpty() const { return blocks.empty(); }
    void clear() {
        nodes.clear();
        blocks.clear();
        keys.clear();
        instances.clear();
        records.clear();
    }
};

/// What the records of a node of points keep to.
struct NodeBounds {
    std::array<uint16_t, 3> low{0, 0, 0}, high{65535, 65535, 65535};  ///< steps of its lattice, both included
    float radius = 0;  ///< no disc is larger: world units, without what the mode adds
    float error = 0;   ///< nothing that its records stand for is farther from them: world units
};

/// Clusters of one chunk of a mesh, as many blocks of the batch of triangles.
struct MeshDraw {
    uint32_t mesh = 0;  ///< of DrawList::meshes
    uint32_t firstCluster = 0, clusters = 0;
    uint32_t level = 0;
    float errorPixels = 0;
};

/// Textures of one mesh: tile t is chunk firstChunk + t of its source.
struct MeshTextures {
    std::span<const shared::TextureInfo> infos;
    uint32_t source = 0, firstChunk = 0, tiles = 0;
};

/// What an effect hands to its passes: bytes as shaders lay them out, in a binding of its own (Effect::tables).
struct EffectTable {
    uint32_t binding = 0;
    std::vector<std::byte> bytes;
};

struct DrawList {
    shared::FrameConstants frame{};
    std::array<DrawBatch, lod::kKinds> batches;  ///< by kind
    DrawBatch& of(lod::Kind kind) { return batches.at(static_cast<size_t>(kind)); }
    const DrawBatch& of(lod::Kind kind) const { return batches.at(static_cast<size_t>(kind)); }
    const DrawBatch& points() const { return of(lod::Kind::points); }
    const DrawBatch& curves() const { return of(lod::Kind::curves); }
    const DrawBatch& triangles() const { return of(lod::Kind::triangles); }
    const DrawBatch& patches() const { return of(lod::Kind::patches); }
    /// Are there pixels with words of their own for what lights them: of triangles and patches?
    bool hasSurfaces() const { return !triangles().isEmpty() || !patches().isEmpty(); }
    bool hasWideDiscs = false;               ///< some nodes of points may hold some (kNodeWide)
    bool hasSmoothDiscs = false;             ///< some nodes of points are kNodeSmooth
    std::vector<NodeBounds> pointBounds;     ///< of each node of points, from markDiscSizes on
    std::vector<shared::DrawMesh> meshes;    ///< instances of mesh stores that are in view
    std::vector<MeshTextures> meshTextures;  ///< of each of `meshes`
    std::vector<MeshDraw> meshDraws;  ///< runs of clusters: what blocks and keys of the batch of triangles belong to
    std::vector<shared::LightSource> lights;
    std::shared_ptr<const Environment> environment;  ///< null: a sky without features
    std::shared_ptr<const Backdrop> backdrop;        ///< behind everything; null: one colour
    uint64_t swaying = 0;                            ///< nodes that effects move
    uint32_t firstSource = 0;                        ///< what the backend calls source 0; set before the list is made
    EffectSet effectsOfScene = allEffects();         ///< what it could show; set before the list is made
    EffectSet effects;                               ///< what the frame shows
    std::vector<EffectTable> tables;                 ///< of those
    template <typename T>
    void addTable(uint32_t binding, std::span<const T> values) {
        const auto bytes = std::as_bytes(values);
        tables.push_back({binding, {bytes.begin(), bytes.end()}});
    }
    /// Null where the frame has none.
    template <typename T>
    const T* tableAt(uint32_t binding) const {
        for (const EffectTable& t : tables)
            if (t.binding == binding) return reinterpret_cast<const T*>(t.bytes.data());
        return nullptr;
    }
    std::span<const shared::SurfaceMaterial> materials;
    const LayerInput* layer = nullptr;             ///< of a layer of glass (layers.h), where this is one ...
    std::shared_ptr<const LayerTables> glass;      ///< ... and what its passes read
    bool isShadowed = false;                       ///< has the effect, whose maps may be none
    std::shared_ptr<const ShadowMaps> shadowMaps;  ///< where lights cast shadows, ...
    std::vector<shared::ShadowMap> shadows;        ///< ... each of them in camera space
    uint32_t shadowSlots = 0;                      ///< masks of lights
    std::vector<uint32_t> shadowSlotOf;            ///< of each light 1 + that of its mask, or 0; empty: none casts
    uint64_t shadowKey = 0;                        ///< frames of the same have the same masks; 0: nothing is known
    bool hasBlending = false;                      ///< some materials are kPixelBlends
    // What the fp32 numbers above were made from: the reference starts from these.
    lod::View view;          ///< orthographic: its eye stands before what is drawn ...
    double eyeAdvanced = 0;  ///< ... so far before the eye that was asked for
    std::vector<lod::CutDraw> cut;
    std::vector<Bend> bends;  ///< of each of `cut`; empty where nothing is moved
    std::vector<lod::CutMeshDraw> meshCut;
    std::vector<uint32_t> firstMaterial;  ///< of each hierarchy
    /// Of each hierarchy: that of points that have none of their own, packed (shaders/shared/material.h), or
    /// kPlainPoint.
    std::vector<uint32_t> pointMaterial;
    std::optional<uint32_t> onlyMaterial;  ///< of all points instead
    std::span<const lod::Hierarchy* const> hierarchies;
    std::span<const lod::Instance> instances;
};

/// Behind everything, in pictures and in the window: sRGB.
inline constexpr std::array<uint8_t, 3> kBackground{39, 39, 44};
/// The same, linear.
glm::vec3 linearBackground();

struct DrawSettings {
    bool lit = false;  ///< points; triangles are, unless their material says otherwise
    bool unlitTriangles = false;
    /// Of all points instead of their own, packed as DrawList has it, and of meshes without materials.
    std::optional<uint32_t> pointMaterial;
    /// Of all points, curves and meshes without materials; none: what their stores say.
    std::optional<lod::Optics> optics;
    uint32_t refract = shared::kRefractObject;  ///< how what is behind glass is found, where the body allows it
    const LayerInput* layer = nullptr;          ///< set by the frame for each layer of glass (layers.h)
    bool isBlended = false;                     ///< set by the frame for each layer that what is behind shows through
    bool transparency = true;                   ///< what is transparent is drawn so; else cut out where it is half
    float opacity = 1;                          ///< of everything
    uint32_t debugView = shared::kDebugNone;
    glm::vec3 background = linearBackground();  ///< linear
    glm::dvec3 worldUp{0, 0, 1};
    std::shared_ptr<const Environment> environment;
    std::shared_ptr<const Backdrop> backdrop;   ///< behind everything instead of `background`
    std::vector<WorldLight> lights;             ///< none: a sun over the viewer's shoulder
    std::shared_ptr<const ShadowMaps> shadows;  ///< set by the frame, of the lights that cast (shadow_frame.h)
    float supportScale = 1.0f;                  ///< splat radius of the reconstruction / stored radius
    float minimumRadius = 1.0f;                 ///< pixels
    float lowPass = 0.5f;                       ///< of blended discs: variance, px^2
    float kernelSupport = 2;                    ///< of blended discs: where kernels end, in sigmas (2 or 3)
    bool perSurfel = false;  ///< blended discs have weights of their own; pixels are not divided by theirs
    uint32_t patchAs = shared::kPatchStrips;
    float exactCurves = 2.0f;            ///< pixels of half-width from which curves are filled, not reconstructed
    Wind wind;                           ///< moves what setSway was told of
    uint64_t frameTag = 0;               ///< another one where what is resident, or the mode, is another than before
    uint32_t coverageSeed = 0;           ///< of curves narrower than a pixel
    std::vector<EffectRequest> effects;  ///< that are asked for by their names ...
    EffectParameters parameters;         ///< ... and what they are told
};

/// What a frame of these draws calls for.
FrameContent contentOf(const DrawList& draws);

/// Of a scene that is looked at by rays, whatever of it they meet: frame constants, and the tables of all effects that
/// are requested.
void makeRayList(const lod::View& view, const DrawSettings& settings, DrawList& out);

void makeDrawList(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                  std::span<const lod::Instance> instances, const lod::View& view, const DrawSettings& settings,
                  DrawList& out);

}  // namespace stipple::render
