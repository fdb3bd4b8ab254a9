#include "engine/render/shadow_frame.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "engine/render/frame_passes.h"
#include "engine/render/layered_frame.h"
#include "engine/render/length_unit.h"

namespace stipple::render {
namespace {

constexpr std::string_view kShadow = "shadow";
constexpr double kDepthDigits = 0x1p-22;  // of depths in fp32, twice

bool callsForShadows(const DrawSettings& d) {
    return isRequested(kShadow, d) && d.debugView == shared::kDebugNone && (d.lit || !d.unlitTriangles);
}

/// Depths and leaves, without anything that costs light.
FrameSettings settingsOfCasters(const FrameSettings& settings) {
    FrameSettings s = settings;
    s.mode = kCasterMode;
    s.draw.exactCurves = std::min(s.draw.exactCurves, reconstructionOf(kCasterMode).exactCurves);
    s.draw.lit = false;
    s.draw.unlitTriangles = true;
    s.draw.environment.reset();
    s.draw.backdrop.reset();
    s.draw.lights.clear();
    s.draw.shadows.reset();
    s.draw.effects.clear();
    s.draw.coverageSeed = 0;
    return s;
}

uint64_t appearanceOf(const FrameState& state, const DrawSettings& d) {
    struct {
        uint32_t patchAs;
        float supportScale, minimumRadius;
    } of{d.patchAs, d.supportScale, d.minimumRadius};
    return hashBytes(state.draws.materials.data(), state.draws.materials.size_bytes(), hashBytes(&of, sizeof(of)));
}

/// Nothing of what is smaller than a texel can be seen in a map, nor of glass, which is drawn over all else.
void dropSmallAndGlass(const FrameState& state, const lod::View& view, lod::Cut& cut) {
    const auto isDropped = [&](const auto& draw) {
        const lod::Instance& place = state.instances[draw.instance];
        const lod::Hierarchy& h = *state.hierarchies[place.hierarchy];
        const double size = 2 * (h.nodes[0].radius * h.unit * place.scale + place.sway);
        const glm::dvec3 centre =
            place.translation + place.rotation * (place.scale * (h.origin + h.unit * h.nodes[0].centre));
        const double depth = view.isOrthographic ? 1 : glm::length(centre - view.eye) - 0.5 * size;
        return size * view.focalPixels < depth || castsNone(state, draw.instance);
    };
    std::erase_if(cut.draw, isDropped);
    std::erase_if(cut.meshDraw, isDropped);
}

template <typename T>
bool areSame(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// How far discs of one surface stand out of each other: a quarter of their radius, as reconstruction has it
/// (ALGORITHMS 1.4), of the usual disc of what is drawn. World units.
double thicknessOf(const DrawList& draws, const DiscSizes& sizes) {
    constexpr double kShare = 0.25;
    double sum = 0, count = 0;
    const DrawBatch& points = draws.points();
    for (size_t i = 0; i < points.nodes.size(); ++i) {
        const shared::DrawNode& node = points.nodes[i];
        const double records = points.records[i];
        sum += records * double{sizes.shareOf(points.keys[i], node.count).usual * node.edge};
        count += records;
    }
    return count > 0 ? kShare * sum / count : 0;
}

/// From the picture of a light's view to the map.
ShadowMapOf mapOf(const ShadowView& of, const Image& image, double eyeAdvanced, double tau, double thickness) {
    ShadowMapOf map;
    map.of = of;
    auto texels = std::make_shared<ShadowTexels>();
    const size_t edge = image.width, stride = shared::shadowStride(image.width);
    texels->depth.resize(stride * edge);
    const double shift = eyeAdvanced - of.centreDepth;
    float farthest = 0, nearest = std::numeric_limits<float>::infinity();
    uint32_t through = 0;
    for (size_t i = 0; i < image.depth.size(); ++i) {
        const float depth = image.depth[i];
        const bool isMet = depth > 0;
        float& texel = texels->depth[i / edge * stride + i % edge];
        texel = isMet ? static_cast<float>(double{depth} + shift) : std::numeric_limits<float>::infinity();
        farthest = std::max(farthest, depth);
        nearest = std::min(nearest, texel);
        through |= isMet ? image.rgba[i] : 0;
    }
    if (through != 0) texels->through.resize(stride * edge);
    for (size_t y = 0; through != 0 && y < edge; ++y)
        std::copy_n(image.rgba.data() + y * edge, edge, texels->through.data() + y * stride);
    map.texels = std::move(texels);
    map.nearest = nearest;
    map.casterError = tau / of.view.focalPixels;
    map.depthStep = kDepthDigits * (double{farthest} + std::abs(shift));
    // (In perspective errors are over the depth, and this is none: as of a surface that is lit at 30 degrees.)
    (of.view.isOrthographic ? map.casterError : map.depthStep) += of.view.isOrthographic ? thickness : 2 * thickness;
    return map;
}

ShadowView viewInUnits(ShadowView of, double units) {
    of.view = inUnits(of.view, units);
    of.reach *= units;
    of.centreDepth *= units;
    if (!of.view.isOrthographic) of.size *= units;
    return of;
}

/// `of`: in units of length as state.shadows has them, like `settings`.
Result<ShadowFrame::Kept> drawCasters(FrameState& state, const ShadowView& of, const lod::Cut& cut,
                                      const FrameSettings& settings, Image& image) {
    const double units = state.shadows->units;
    if (units != 1) {
        inUnits(state.instances, units, state.inUnits);
        std::swap(state.instances, state.inUnits);  // the draw list refers to them
    }
    makeDrawList(cut, state.hierarchies, state.instances, of.view, settings.draw, state.draws);
    if (units != 1) std::swap(state.instances, state.inUnits);
    markDiscSizes(*state.discSizes, state.draws);
    RenderRequest request;
    request.draws = &state.draws;
    request.mode = kCasterMode;
    request.passes = passesOfCasters(contentOf(state.draws));
    request.wantDepthAndNormal = request.isOfCasters = true;
    STIPPLE_TRY(state.backend->render(request, image));
    ShadowFrame::Kept kept;
    kept.map = mapOf(of, image, state.draws.eyeAdvanced, cut.tauEffective, thicknessOf(state.draws, *state.discSizes));
    auto drawn = std::make_shared<lod::Cut>();
    drawn->draw = cut.draw;
    drawn->meshDraw = cut.meshDraw;
    kept.cut = std::move(drawn);
    kept.isComplete = cut.wanted.empty();
    kept.isStill = state.draws.swaying == 0;
    return kept;
}

ShadowMapSettings settingsOfMaps(const FrameSettings& settings) {
    ShadowMapSettings s;
    s.edge = static_cast<uint32_t>(settings.draw.parameters.shadow.texels);
    s.errorTexels *= settings.budgets.errorPixels;
    return s;
}

/// Those whose light falls on something that the camera sees. `left`: lights without.
std::vector<ShadowView> viewsOfLights(const FrameState& state, const lod::View& view, const FrameSettings& settings,
                                      uint64_t* left) {
    const lod::CutScene scene = state.scene();
    const std::vector<SeenBall> seen = seenBalls(state.cut, scene, view);
    ShadowViews all = shadowViews(settings.draw.lights, settingsOfMaps(settings), ballOf(scene), seenRange(seen), view);
    if (left != nullptr) *left = all.left;
    std::vector<ShadowView> views;
    double from = 0;
    for (size_t v = 0; v < all.views.size(); ++v) {
        const bool isFirst = v == 0 || all.views[v].slot != all.views[v - 1].slot;
        from = isFirst ? 0 : all.views[v - 1].reach;
        if (hasReceivers(seen, view, all.views[v].view, from, all.views[v].reach)) views.push_back(all.views[v]);
    }
    return views;
}

}  // namespace

std::vector<Pass> passesOfCasters(const FrameContent& content) {
    std::vector<Pass> passes = passesOf(kCasterMode, content, {});
    passes.back() = Pass::cast;
    return passes;
}

void addShadowRequests(const FrameState& state, const lod::View& view, const FrameSettings& settings,
                       std::vector<lod::ViewRequest>& requests) {
    if (!callsForShadows(settings.draw)) return;
    const double tau = settingsOfMaps(settings).errorTexels;
    for (const ShadowView& v : viewsOfLights(state, view, settings, nullptr)) requests.push_back({v.view, tau, true});
}

uint64_t bytesOfShadows(const FrameState& state) {
    if (!state.shadows) return 0;
    uint64_t bytes = 0;
    for (const ShadowFrame::Kept& kept : state.shadows->kept)
        bytes += (kept.map.texels->depth.size() + kept.map.texels->through.size()) * sizeof(uint32_t);
    const Image& image = state.shadows->image;
    return bytes + (image.rgba.size() + image.depth.size() + image.normal.size() + image.linear.size()) * sizeof(float);
}

double msOfShadows(const FrameState& state) { return state.shadows ? state.shadows->ms : 0; }

namespace {

/// What all maps of a frame are drawn by.
struct CasterWishes {
    double errorTexels;
    uint64_t appearance;
};

/// The map of before that is of this view and still holds; null: there is none. `of`: in the maps' unit of length.
const ShadowFrame::Kept* keptOf(const ShadowFrame& frame, const ShadowView& of, const CasterWishes& wishes) {
    const auto at = std::find_if(frame.kept.begin(), frame.kept.end(), [&](const ShadowFrame::Kept& k) {
        return k.isComplete && k.isStill && k.map.of.isOf(of) && k.errorAsked == wishes.errorTexels &&
               k.appearance == wishes.appearance;
    });
    return at == frame.kept.end() ? nullptr : &*at;
}

/// Asks the cuts of `views`, together with the camera's, for those that are none of before. Returns which cut of
/// frame.cuts each has, 0 where the map of before holds.
std::vector<size_t> cutCasters(FrameState& state, const lod::View& view, const FrameSettings& settings,
                               std::span<const ShadowView> views, const CasterWishes& wishes, bool mayKeep) {
    ShadowFrame& frame = *state.shadows;
    std::vector<lod::ViewRequest> requests{{view, settings.budgets.errorPixels, false, settings.budgets.unrefined}};
    std::vector<size_t> asked(views.size());
    for (size_t v = 0; v < views.size(); ++v) {
        if (mayKeep && keptOf(frame, viewInUnits(views[v], frame.units), wishes) != nullptr) continue;
        asked[v] = requests.size();
        requests.push_back({views[v].view, wishes.errorTexels, true});
    }
    if (requests.size() == 1) return asked;
    lod::selectCuts(state.scene(), state.streamer->residency(), requests, settings.budgets.records, frame.scratch,
                    frame.cuts);
    std::swap(state.cut, frame.cuts.views[0]);
    state.cut.wanted = frame.cuts.merged.wanted;
    state.cut.keep = frame.cuts.merged.keep;
    return asked;
}

/// The map of a view: that of before, if it is of the same cut, or a new one.
Result<ShadowFrame::Kept> mapOfCut(FrameState& state, const ShadowView& world, lod::Cut& cut,
                                   const FrameSettings& casting, const CasterWishes& wishes) {
    ShadowFrame& frame = *state.shadows;
    const ShadowView of = viewInUnits(world, frame.units);
    dropSmallAndGlass(state, world.view, cut);
    const ShadowFrame::Kept* const before = keptOf(frame, of, wishes);
    if (before != nullptr && cut.wanted.empty() && areSame(before->cut->draw, cut.draw) &&
        areSame(before->cut->meshDraw, cut.meshDraw))
        return *before;
    STIPPLE_ASSIGN(ShadowFrame::Kept drawn, drawCasters(state, of, cut, casting, frame.image));
    drawn.errorAsked = wishes.errorTexels;
    drawn.appearance = wishes.appearance;
    ++state.counters.shadowMapsDrawn;
    return drawn;
}

}  // namespace

Result<void> addShadows(FrameState& state, const lod::View& view, FrameSettings& settings, bool mayKeep) {
    FrameCounters& counters = state.counters;
    counters.shadowMaps = counters.shadowMapsDrawn = counters.shadowLightsLeft = 0;
    std::vector<ShadowView> views;
    const double start = nowSeconds();
    if (callsForShadows(settings.draw)) views = viewsOfLights(state, view, settings, &counters.shadowLightsLeft);
    if (views.empty()) {
        state.shadows.reset();
        settings.draw.shadows.reset();
        return {};
    }
    if (!state.shadows) state.shadows = std::make_shared<ShadowFrame>();
    ShadowFrame& frame = *state.shadows;
    const bool isLayered = hasLayers(state, view, settings);
    state.draws.materials = materialsOfCasters(state);
    const double units = isLayered ? 1 : unitsOfLength(state.cut, state.hierarchies, state.instances, view);
    if (units != frame.units) frame.kept.clear();
    frame.units = units;
    const CasterWishes wishes{settingsOfMaps(settings).errorTexels, appearanceOf(state, settings.draw)};
    const std::vector<size_t> asked = cutCasters(state, view, settings, views, wishes, mayKeep);
    FrameSettings casting = settingsOfCasters(settings);
    if (units != 1) casting.draw = inUnits(casting.draw, units);
    std::vector<ShadowFrame::Kept> now;
    auto maps = std::make_shared<ShadowMaps>();
    maps->surfaceError = state.cut.tauEffective;
    maps->units = units;
    for (size_t v = 0; v < views.size(); ++v) {
        const ShadowView of = viewInUnits(views[v], units);
        if (asked[v] == 0) {
            now.push_back(*keptOf(frame, of, wishes));
        } else {
            STIPPLE_ASSIGN(now.emplace_back(), mapOfCut(state, views[v], frame.cuts.views[asked[v]], casting, wishes));
        }
        now.back().map.of = of;  // its light, and how far it reaches
        if (std::isfinite(now.back().map.nearest)) maps->maps.push_back(now.back().map);
    }
    frame.kept = std::move(now);
    counters.shadowMaps = maps->maps.size();
    settings.draw.shadows = std::move(maps);
    frame.ms = (nowSeconds() - start) * 1e3;
    return {};
}

}  // namespace stipple::render
