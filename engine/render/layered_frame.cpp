#include "engine/render/layered_frame.h"

#include <algorithm>
#include <cmath>

#include "engine/render/picture_tone.h"

namespace stipple::render {
namespace {

/// What materials show, made anew where the settings say something else of them; null: as stores have them.
LayeredFrame* appearanceOf(FrameState& state, const DrawSettings& draw) {
    const bool isGiven = draw.optics.has_value() || draw.pointMaterial.has_value();
    const auto hasOptics = [](const auto& store) {
        const lod::StoreDescription& d = store->description;
        return !d.optics.empty() || (!d.pointMaterials.empty() && !d.pointMaterials.front().optics.isPlain());
    };
    if (!state.layered) {
        if (!isGiven && draw.opacity == 1 && std::none_of(state.stores.begin(), state.stores.end(), hasOptics))
            return nullptr;
        state.layered = std::make_shared<LayeredFrame>();
    }
    Appearance& a = state.layered->appearance;
    if (a.hierarchies.size() != state.stores.size() || a.pointMaterial != draw.pointMaterial ||
        a.given != draw.optics || a.transparency != draw.transparency || a.opacity != draw.opacity)
        a = makeAppearance(state.stores, state.materials, draw);
    return state.layered.get();
}

std::vector<LayerDraw> layersIn(FrameState& state, const lod::View& view, const DrawSettings& draw) {
    const LayeredFrame* const layered = appearanceOf(state, draw);
    if (layered == nullptr || !layered->appearance.hasLayers || draw.debugView != shared::kDebugNone) return {};
    return layersOf(state.cut, state.instances, state.stores, layered->appearance, view, draw);
}

Body bodyIn(const FrameState& state, uint32_t instance) {
    const lod::Instance& placed = state.instances[instance];
    return bodyOf(state.stores[placed.hierarchy]->description, placed);
}

/// The nodes of `from` whose instance is one that `takes` says.
template <typename Takes>
void takeNodes(const lod::Cut& from, lod::Cut& to, const Takes& takes) {
    to.draw.clear();
    to.meshDraw.clear();
    for (const lod::CutDraw& d : from.draw)
        if (takes(d.instance)) to.draw.push_back(d);
    for (const lod::CutMeshDraw& d : from.meshDraw)
        if (takes(d.instance)) to.meshDraw.push_back(d);
}

/// The cut of one instance as a view from behind has it.
void cutFromBehind(FrameState& state, uint32_t instance, const lod::View& back, const lod::Budgets& budgets) {
    LayeredFrame& l = *state.layered;
    lod::Instance alone = state.instances[instance];
    alone.proxy = alone.group = lod::Instance::kNone;
    alone.isDriven = false;
    const lod::Budgets ofOne{budgets.errorPixels, budgets.records};
    lod::selectCut({state.hierarchies, {&alone, 1}, {}}, state.streamer->residency(), back, ofOne, l.backScratch,
                   l.backCut);
    for (lod::CutDraw& d : l.backCut.draw) d.instance = instance;
    for (lod::CutMeshDraw& d : l.backCut.meshDraw) d.instance = instance;
}

/// Surfaces as they are, without light.
FrameSettings settingsFromBehind(const FrameSettings& settings) {
    FrameSettings s = settings;
    s.wantDepthAndNormal = true;
    s.staysOnDevice = s.mayHideNodes = false;
    s.draw.lit = false;
    s.draw.unlitTriangles = true;
    s.draw.environment.reset();
    s.draw.backdrop.reset();
    s.draw.lights.clear();
    s.draw.effects.clear();
    return s;
}

WorldOptic inWorld(const lod::Optics& o, double scale, const Body& body) {
    WorldOptic w;
    w.transmission = o.transmission;
    w.ior = o.ior;
    w.thickness = o.thickness < 0 ? -o.thickness * body.thinnest : o.thickness * scale;
    w.absorption = absorptionInWorld(o, scale);
    w.straightOn = glm::dvec3(o.straightOn());
    w.most = o.specular;
    return w;
}

LayerInput inputOf(const FrameState& state, const LayerDraw& layer, const DrawSettings& draw) {
    const Appearance& a = state.layered->appearance;
    const uint32_t nearest = layer.instances.back();
    const Body body = bodyIn(state, nearest);
    const lod::Instance& placed = state.instances[nearest];
    LayerInput in;
    in.executor = state.executor;
    in.way = draw.refract == shared::kRefractObject && !layer.isSeenTwice ? shared::kRefractScreen : draw.refract;
    for (const lod::Optics& o : a.optics) in.optics.push_back(inWorld(o, placed.scale, body));
    in.pointOptic = a.hierarchies[placed.hierarchy].points;
    in.bodyCentre = body.centre;
    in.bodyRadius = body.radius;
    const auto& own = state.stores[placed.hierarchy]->description.pointMaterials;
    if (draw.pointMaterial)
        in.plainRoughness = static_cast<double>(*draw.pointMaterial >> 8 & 255u) / 255;
    else if (!own.empty())
        in.plainRoughness = own.front().roughness;
    return in;
}

/// All of it, so that it is no part of what is behind.
bool isSeenThrough(const OpticsOf& o) {
    return o.opacity < 1 || (o.isGlass && (o.isWhole || o.isPlainMesh || o.points != 0));
}

/// The frame's list points at a layer only while that one is drawn, however drawing ends.
class NoLayerAfter {
  public:
    explicit NoLayerAfter(DrawList& draws) : draws_(draws) {}
    ~NoLayerAfter() { draws_.layer = nullptr; }
    NoLayerAfter(const NoLayerAfter&) = delete;
    NoLayerAfter& operator=(const NoLayerAfter&) = delete;

  private:
    DrawList& draws_;
};

}  // namespace

bool hasLayers(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    const bool has = !layersIn(state, view, settings.draw).empty();
    state.draws.materials = state.layered ? std::span<const shared::SurfaceMaterial>(state.layered->appearance.shown)
                                          : std::span<const shared::SurfaceMaterial>(state.materials);
    return has;
}

Result<uint64_t> drawLayered(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    LayeredFrame& l = *state.layered;
    const std::vector<LayerDraw> layers = layersIn(state, view, settings.draw);
    const std::vector<OpticsOf>& of = l.appearance.hierarchies;
    FrameSettings plain = settings;
    plain.wantDepthAndNormal = true;
    plain.staysOnDevice = false;
    const bool hasTone = takeTone(plain.draw);  // it comes last: layers see each other without it
    // What is glass all over is not behind; of meshes in which some of it is, that is cut out.
    takeNodes(state.cut, l.cut, [&](uint32_t i) {
        const OpticsOf& o = of[state.instances[i].hierarchy];
        const bool isDrawnLater = std::any_of(layers.begin(), layers.end(), [&](const LayerDraw& layer) {
            return std::binary_search(layer.instances.begin(), layer.instances.end(), i);
        });
        return !(isDrawnLater && isSeenThrough(o));
    });
    state.draws.materials = l.appearance.cutOut;
    STIPPLE_ASSIGN(uint64_t passes, drawNodes(state, l.cut, view, plain));
    std::swap(state.image, l.behind);
    for (const LayerDraw& layer : layers) {
        LayerInput in = inputOf(state, layer, settings.draw);
        state.draws.materials = l.appearance.shown;
        if (layer.isSeenTwice) {
            in.backView = viewFromBehind(bodyIn(state, layer.instances.front()), view);
            cutFromBehind(state, layer.instances.front(), in.backView, settings.budgets);
            STIPPLE_ASSIGN(const uint64_t more, drawNodes(state, l.backCut, in.backView, settingsFromBehind(settings)));
            passes += more;
            std::swap(state.image, l.back);
            in.back = &l.back;
        }
        if (layer.transmits && layer.isGlass && in.way != shared::kRefractEnvironment) in.behind = &l.behind;
        takeNodes(state.cut, l.cut,
                  [&](uint32_t i) { return std::binary_search(layer.instances.begin(), layer.instances.end(), i); });
        FrameSettings lit = plain;
        if (layer.isGlass) lit.draw.layer = &in;
        lit.draw.isBlended = layer.blends;
        const NoLayerAfter noLayerAfter(state.draws);
        STIPPLE_ASSIGN(const uint64_t more, drawNodes(state, l.cut, view, lit));
        passes += more;
        putLayer(state.image, settings.draw.background, layer.opacity, l.behind, *state.executor);
    }
    std::swap(state.image, l.behind);
    if (hasTone) toneImage(settings.draw, view, state.image, *state.executor);
    if (!settings.wantDepthAndNormal) {
        state.image.depth.clear();
        state.image.normal.clear();
        state.image.linear.clear();
    }
    return passes;
}

void addViewsFromBehind(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    for (const LayerDraw& layer : layersIn(state, view, settings.draw)) {
        if (!layer.isSeenTwice) continue;
        const uint32_t instance = layer.instances.front();
        cutFromBehind(state, instance, viewFromBehind(bodyIn(state, instance), view), settings.budgets);
        const lod::Cut& back = state.layered->backCut;
        state.cut.wanted.insert(state.cut.wanted.end(), back.wanted.begin(), back.wanted.end());
        state.cut.keep.insert(state.cut.keep.end(), back.keep.begin(), back.keep.end());
    }
}

void addRequestsFromBehind(FrameState& state, const lod::View& view, const FrameSettings& settings,
                           std::vector<lod::ViewRequest>& requests) {
    for (const LayerDraw& layer : layersIn(state, view, settings.draw))
        if (layer.isSeenTwice)
            requests.push_back(
                {viewFromBehind(bodyIn(state, layer.instances.front()), view), settings.budgets.errorPixels, true});
}

bool castsNone(const FrameState& state, uint32_t instance) {
    return state.layered && state.layered->appearance.hasLayers &&
           isSeenThrough(state.layered->appearance.hierarchies[state.instances[instance].hierarchy]);
}

std::span<const shared::SurfaceMaterial> materialsOfCasters(const FrameState& state) {
    if (!state.layered) return state.materials;
    const Appearance& a = state.layered->appearance;
    return a.hasLayers ? a.cutOut : a.shown;
}

}  // namespace stipple::render
