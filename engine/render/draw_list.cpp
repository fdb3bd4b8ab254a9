#include "engine/render/draw_list.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/check.h"
#include "engine/render/kinds/kind.h"
#include "lod/primitives/patch_samples.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/surfel_weights.h"
#include "shaders/shared/material.h"
#include "shaders/shared/visibility.h"

namespace stipple::render {

static_assert(sizeof(shared::PointRecord) == 16);
static_assert(sizeof(shared::DrawNode) == 96);
static_assert(sizeof(shared::DrawBlock) == 8);
static_assert(sizeof(shared::CurveSegment) == 32);
static_assert(sizeof(shared::FrameConstants) == 196 + sizeof(shared::BlockRanges));
static_assert(sizeof(shared::MeshVertex) == 32);
static_assert(sizeof(shared::MeshCluster) == 12);
static_assert(sizeof(shared::DrawMesh) == 120);
static_assert(sizeof(shared::SurfaceMaterial) == 192);

namespace {

constexpr size_t kMostEffects = 8 * sizeof(EffectSet::bits);

/// Nearer than this nothing of the cut can be: by the nearest bounding sphere; of a node that holds the eye, a step of
/// its lattice, nearer than which nothing of it can be told apart. (Depth is linear: a small distance costs nothing.)
double nearestOf(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                 std::span<const lod::Instance> instances, const lod::View& view) {
    // Depth in a corner of the picture is the distance times this; discs beside the picture reach in: half of it.
    const glm::dvec2 corner = 0.5 * glm::dvec2(view.width, view.height) + glm::abs(view.shift);
    const double cosine = view.focalPixels / std::hypot(view.focalPixels, corner.x, corner.y);
    constexpr double kShare = 0.5;
    double nearest = HUGE_VAL;
    const auto look = [&](uint32_t instance, uint32_t number, double steps) {
        const lod::Instance& place = instances[instance];
        const lod::Hierarchy& h = *hierarchies[place.hierarchy];
        const lod::Node& node = h.nodes[number];
        const double scale = place.scale * h.unit, size = h.isMesh() ? node.radius : h.cellSize(node);
        const glm::dvec3 centre =
            place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre));
        const double apart = kShare * cosine * (glm::length(centre - view.eye) - node.radius * scale);
        nearest = std::min(nearest, std::max(apart, size * scale / steps));
    };
    for (const lod::CutDraw& draw : cut.draw) look(draw.instance, draw.node, 0x1p16);
    for (const lod::CutMeshDraw& draw : cut.meshDraw) look(draw.instance, draw.node, 0x1p20);
    return nearest;
}

/// The orthographic view of the same picture whose eye stands just before what is drawn, if it is far before that:
/// depths in fp32 keep their digits however far away the eye is. Returns how far it was moved.
double advanceEye(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                  std::span<const lod::Instance> instances, lod::View& view) {
    double nearest = HUGE_VAL, farthest = -HUGE_VAL;
    const auto look = [&](uint32_t instance, uint32_t number) {
        const lod::Instance& place = instances[instance];
        const lod::Hierarchy& h = *hierarchies[place.hierarchy];
        const lod::Node& node = h.nodes[number];
        const glm::dvec3 centre =
            place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre));
        const double depth = glm::dot(centre - view.eye, view.forward),
                     radius = node.radius * place.scale * h.unit + place.sway;
        nearest = std::min(nearest, depth - radius);
        farthest = std::max(farthest, depth + radius);
    };
    for (const lod::CutDraw& draw : cut.draw) look(draw.instance, draw.node);
    for (const lod::CutMeshDraw& draw : cut.meshDraw) look(draw.instance, draw.node);
    constexpr double kMargin = 0x1p-6;  // of the depth of what is drawn
    const double advance = nearest - std::max(kMargin * (farthest - nearest), 2 / view.focalPixels);
    if (!(advance > 0) || !std::isfinite(advance)) return 0;
    view.eye += view.forward * advance;
    view.nearPlane = std::max(view.nearPlane - advance, 0.5 * (nearest - advance));
    return advance;
}

/// Keeps the memory.
void clear(DrawList& out) {
    for (size_t k = 0; k < lod::kKinds; ++k) {
        out.batches.at(k).kind = static_cast<lod::Kind>(k);
        out.batches.at(k).clear();
    }
    out.meshes.clear();
    out.meshTextures.clear();
    out.meshDraws.clear();
    out.lights.clear();
    out.environment.reset();
    out.backdrop.reset();
    out.tables.clear();
    out.layer = nullptr;
    out.glass.reset();
    out.hasBlending = false;
    out.isShadowed = false;
    out.shadowMaps.reset();
    out.shadows.clear();
    out.shadowSlots = 0;
    out.shadowSlotOf.clear();
    out.shadowKey = 0;
    out.bends.clear();
    out.swaying = 0;
    out.hasWideDiscs = out.hasSmoothDiscs = false;
    out.pointBounds.clear();
}

/// A node of points or curves in camera space.
shared::DrawNode makeDrawNode(const lod::CutDraw& draw, const lod::Payload& payload, const Bend& bend,
                              const glm::dmat3& cameraFromWorld, const DrawList& list) {
    const lod::View& view = list.view;
    const lod::Instance& instance = list.instances[draw.instance];
    const lod::Hierarchy& h = *list.hierarchies[instance.hierarchy];
    const lod::Node& node = h.nodes[draw.node];
    // Composed in fp64 relative to the eye, rounded once (hard cases 1 and 2).
    const double worldPerStep = instance.scale * h.unit * std::exp2(payload.stepShift);
    const glm::dmat3 axes = cameraFromWorld * instance.rotation;
    const glm::dvec3 base =
        cameraFromWorld * (instance.translation - view.eye +
                           instance.rotation * (instance.scale * (h.origin + h.unit * h.recordOrigin(node, payload))));
    shared::DrawNode d{};
    // Moved with the wind: one more linear map, in camera space.
    const glm::dvec3 along = cameraFromWorld * bend.along, up = cameraFromWorld * bend.up;
    const auto bent = [&](const glm::dvec3& axis) { return axis + along * (bend.slope * glm::dot(up, axis)); };
    const double atEye = bend.slope * glm::dot(bend.up, view.eye) + bend.offset;
    d.axisX = glm::vec3(bent(axes[0] * worldPerStep));
    d.axisY = glm::vec3(bent(axes[1] * worldPerStep));
    d.axisZ = glm::vec3(bent(axes[2] * worldPerStep));
    d.base = glm::vec3(bent(base) + along * atEye);
    d.edge = static_cast<float>(instance.scale * h.unit * h.cellSize(node)) * draw.radiusScale;
    d.errorCode = draw.errorCode;
    d.octantMask = draw.octantMask | (bend.isStill() ? 0u : shared::kNodeBent | shared::kNodeTurned) |
                   (instance.rotation != glm::dmat3(1) ? shared::kNodeTurned : 0u);
    d.count = draw.first + draw.count;
    d.level = node.level;
    // Discs among which any beginning shows the whole have none. Of stores that do not tell it: minus a step, which
    // markDiscSizes takes times what was measured.
    const float steps = payload.spacingCode == 0 ? -1.0f : lod::spacingOfCode(payload.spacingCode);
    const bool isSpaced = payload.kind == lod::Kind::points && !h.isStochastic && draw.first >= h.overviewOf(payload);
    d.spacing = isSpaced ? steps * static_cast<float>(worldPerStep) : 0.0f;
    d.weights = lod::weightsOf(h, draw.chunk) != nullptr ? payload.records : 0u;
    d.errorPixels = draw.errorPixels;
    const bool isOfPatches = lod::kindOf(h, draw.chunk) == lod::Kind::patches;
    if (payload.kind != lod::Kind::points && !isOfPatches) {
        d.material = shared::kPlainPoint;
        return d;
    }
    const bool hasDefault = instance.hierarchy < list.pointMaterial.size();
    d.material = list.onlyMaterial.value_or(hasDefault ? list.pointMaterial[instance.hierarchy] : shared::kPlainPoint);
    if (list.onlyMaterial) d.material |= shared::kOnlyMaterial;
    const bool areSamples = isOfPatches && payload.kind == lod::Kind::points;
    const auto records = areSamples ? static_cast<uint32_t>(lod::recordsOfSamples(payload.records)) : payload.records;
    d.materials = h.hasMaterials && (isOfPatches || payload.attributeBytes > 0) ? records : 0;
    return d;
}

/// What is drawn of a chunk: patches as they are, or their samples.
lod::Payload payloadOf(const lod::Hierarchy& h, uint32_t chunk, const DrawSettings& settings) {
    const bool areSamples = settings.patchAs == lod::kPatchesAsSamples && lod::kindOf(h, chunk) == lod::Kind::patches;
    return areSamples ? lod::payloadOfSamples(h, chunk) : h.payload(chunk);
}
/// All samples of the blocks, whatever octants they lie in.
void drawsSamples(lod::CutDraw& draw) {
    draw.count = static_cast<uint32_t>(lod::recordsOfSamples(draw.count));
    draw.errorCode = lod::kNoSample - 1;
    draw.octantMask = 0;
}

/// Counts the nodes that feed each of the effects, which may move them.
void addNodes(const glm::dmat3& cameraFromWorld, const DrawSettings& settings, EffectSet requested,
              std::span<uint64_t> fed, DrawList& out) {
    std::array<size_t, kMostEffects> places{};
    size_t count = 0;  // mostly none
    for (size_t e = 0; e < effects().size(); ++e)
        if (requested.has(e) && effects()[e]->ofNode != nullptr) places.at(count++) = e;
    const std::span<const size_t> asked(places.data(), count);
    for (lod::CutDraw& draw : out.cut) {
        const lod::Instance& instance = out.instances[draw.instance];
        const lod::Hierarchy& h = *out.hierarchies[instance.hierarchy];
        Bend bend;
        for (const size_t e : asked) {
            const Bend by = effects()[e]->ofNode({h, instance, draw.node, out.view, settings});
            if (by.isStill()) continue;
            bend = by;
            ++fed[e];
        }
        if (!asked.empty()) out.bends.push_back(bend);
        out.swaying += bend.isStill() ? 0 : 1;
        const lod::Payload payload = payloadOf(h, draw.chunk, settings);
        const lod::Kind kind = payload.kind;
        if (kind != lod::kindOf(h, draw.chunk)) drawsSamples(draw);
        DrawBatch& batch = out.of(kind);
        const auto index = static_cast<uint32_t>(batch.nodes.size());
        for (uint32_t first = draw.first; first < draw.first + draw.count; first += drawnKind(kind).recordsPerBlock)
            batch.blocks.push_back({index, first});
        batch.nodes.push_back(makeDrawNode(draw, payload, bend, cameraFromWorld, out));
        const shared::DrawNode& node = batch.nodes.back();
        const bool hasMaterial = node.materials > 0 || node.material != shared::kPlainPoint;
        if (hasMaterial && settings.lit && kind == lod::Kind::points) out.frame.hasMaterials = 1;
        batch.keys.push_back({out.firstSource + instance.source, draw.chunk});
        batch.instances.push_back(draw.instance);
        batch.records.push_back(draw.count);
    }
    if (out.swaying == 0) out.bends.clear();
}

/// Where the eye is, and how records are drawn.
void setView(const lod::Cut& cut, const lod::View& view, const DrawSettings& settings, DrawList& out) {
    shared::FrameConstants& f = out.frame;
    f.viewX = glm::vec3(view.right);
    f.viewY = glm::vec3(view.down);
    f.viewZ = glm::vec3(view.forward);
    f.focal = static_cast<float>(view.focalPixels);
    f.orthographic = view.isOrthographic ? 1 : 0;
    const glm::dvec2 principal = view.principal();
    f.centre = {static_cast<float>(principal.x), static_cast<float>(principal.y)};
    f.width = view.width;
    f.height = view.height;
    // Not below what fp32 can divide by.
    const double nearest = view.isOrthographic ? 0 : nearestOf(cut, out.hierarchies, out.instances, view);
    out.view.nearPlane = std::max({view.nearPlane, std::isfinite(nearest) ? nearest : 0.0, 1e-30});
    f.nearPlane = static_cast<float>(out.view.nearPlane);
    f.supportScale = settings.supportScale;
    f.minimumRadius = settings.minimumRadius;
    f.exactCurves = settings.exactCurves;
    f.coverageSeed = settings.coverageSeed;
    f.lowPass = settings.lowPass;
    f.kernelSupport = settings.kernelSupport;
    f.perSurfel = settings.perSurfel ? 1 : 0;
    f.patchAs = settings.patchAs;
    f.shade = (settings.lit ? shared::kShadeLit : shared::kShadeUnlit) |
              (settings.unlitTriangles ? 0u : shared::kShadeTriangles);
    f.debugView = settings.debugView;
    f.background = settings.background;
    // A sun over the viewer's left shoulder: every view of a scan is lit from where one looks.
    f.sunDirection = glm::normalize(glm::vec3(-0.45f, -0.55f, -0.7f));
}

/// What the frame shows of what is requested, and its tables.
void addEffects(EffectSet requested, std::span<const uint64_t> fed, const glm::dmat3& cameraFromWorld,
                const DrawSettings& settings, DrawList& out) {
    shared::FrameConstants& f = out.frame;
    f.skyDirection = glm::vec3(cameraFromWorld * settings.worldUp);
    f.lightCount = 0;
    f.hasEnvironment = 0;
    f.environmentSharp = 0;
    f.ambient = 1;
    out.effects = effectsOfFrame(requested, contentOf(out), settings, out, fed);
    for (size_t e = 0; e < effects().size(); ++e)
        if (out.effects.has(e) && effects()[e]->fill != nullptr) effects()[e]->fill(settings, cameraFromWorld, out);
}

void setBlocks(DrawList& out) {
    // Blocks by kind (visibility.h): what is equally deep goes to them in their order. The last are those of wide
    // discs.
    static_assert(shared::kRecordsPerBlock == shared::kBlockLanes && shared::kSegmentsPerBlock == shared::kBlockLanes &&
                  shared::kClusterTriangles == shared::kBlockLanes);
    size_t blocks = 0, most = 0;
    forEachKind([&](lod::Kind kind) {
        out.frame.firstBlock.of[static_cast<size_t>(kind)] = static_cast<uint32_t>(blocks);
        blocks += out.of(kind).blocks.size();
        most = std::max(most, out.of(kind).blocks.size());
    });
    out.frame.firstBlock.of[shared::kKindDiscs] = static_cast<uint32_t>(blocks);
    STIPPLE_CHECK(blocks + out.points().blocks.size() < shared::kMostBlocks && most < shared::kMostBlocksOfKind,
                  "blocks of a frame");
}

}  // namespace

glm::vec3 linearBackground() {
    const auto linear = [](uint8_t byte) { return shared::linearFromSrgb(static_cast<float>(byte) / 255.0f); };
    return {linear(kBackground[0]), linear(kBackground[1]), linear(kBackground[2])};
}

FrameContent contentOf(const DrawList& draws) {
    FrameContent content;
    forEachKind([&](lod::Kind kind) {
        if (!draws.of(kind).isEmpty()) content.add(kind);
    });
    content.hasWideDiscs = draws.hasWideDiscs;
    content.hasSmoothDiscs = draws.hasSmoothDiscs;
    return content;
}

void makeDrawList(const lod::Cut& cut, std::span<const lod::Hierarchy* const> hierarchies,
                  std::span<const lod::Instance> instances, const lod::View& asked, const DrawSettings& settings,
                  DrawList& out) {
    clear(out);
    lod::View view = asked;
    out.eyeAdvanced = view.isOrthographic ? advanceEye(cut, hierarchies, instances, view) : 0;
    out.view = view;
    out.cut.assign(cut.draw.begin(), cut.draw.end());
    out.meshCut.assign(cut.meshDraw.begin(), cut.meshDraw.end());
    out.hierarchies = hierarchies;
    out.instances = instances;
    out.onlyMaterial = settings.pointMaterial;
    out.hasBlending = settings.isBlended;
    out.frame.hasMaterials = 0;
    const glm::dmat3 cameraFromWorld = glm::transpose(glm::dmat3(view.right, view.down, view.forward));
    const EffectSet requested = requestedEffects(out.effectsOfScene, settings);
    std::array<uint64_t, kMostEffects> fed{};
    addNodes(cameraFromWorld, settings, requested, fed, out);
    forEachKind([&](lod::Kind kind) {
        if (drawnKind(kind).add != nullptr) drawnKind(kind).add(cut, cameraFromWorld, out);
    });
    setView(cut, view, settings, out);
    addEffects(requested, fed, cameraFromWorld, settings, out);
    setBlocks(out);
}

void makeRayList(const lod::View& view, const DrawSettings& settings, DrawList& out) {
    makeDrawList({}, {}, {}, view, settings, out);
    const glm::dmat3 cameraFromWorld = glm::transpose(glm::dmat3(out.view.right, out.view.down, out.view.forward));
    const EffectSet requested = requestedEffects(allEffects(), settings);
    for (size_t e = 0; e < effects().size(); ++e)
        if (requested.has(e) && effects()[e]->fill != nullptr) effects()[e]->fill(settings, cameraFromWorld, out);
}

}  // namespace stipple::render
