#include "engine/render/layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "engine/render/draw_list.h"
#include "lod/store/materials.h"
#include "shaders/shared/surface.h"

namespace stipple::render {
namespace {

/// The list of a frame's optics: each different one once.
class OpticsList {
  public:
    OpticsList() : list_(1) {}
    uint32_t numberOf(const lod::Optics& o) {
        if (o.isPlain()) return 0;
        const auto isThat = [&](lod::Optics other) {
            other.blends = o.blends;
            other.opacity = o.opacity;
            return other == o;
        };
        const auto known = std::find_if(list_.begin() + 1, list_.end(), isThat);
        if (known != list_.end()) return static_cast<uint32_t>(known - list_.begin());
        if (list_.size() <= shared::kMostOptics) {
            list_.push_back(o);
            return static_cast<uint32_t>(list_.size() - 1);
        }
        const auto off = [&](const lod::Optics& other) {
            return std::abs(o.transmission - other.transmission) + std::abs(o.ior - other.ior) +
                   glm::length(o.attenuationColour - other.attenuationColour);
        };
        const auto nearest = std::min_element(list_.begin() + 1, list_.end(),
                                              [&](const auto& a, const auto& b) { return off(a) < off(b); });
        return static_cast<uint32_t>(nearest - list_.begin());
    }
    std::vector<lod::Optics> take() { return std::move(list_); }

  private:
    std::vector<lod::Optics> list_;
};

/// Of points: those of the store's list, if all of it has the same.
lod::Optics opticsOfPoints(const lod::StoreDescription& d) {
    const auto& list = d.pointMaterials;
    const bool areAlike = std::all_of(list.begin(), list.end(),
                                      [&](const lod::PointMaterial& m) { return m.optics == list.front().optics; });
    return list.empty() || !areAlike ? lod::Optics{} : list.front().optics;
}

void addTo(OpticsOf& of, const lod::Optics& o, uint32_t number) {
    of.isGlass = of.isGlass || number != 0;
    of.blends = of.blends || o.blends;
    of.hasAny = of.isGlass || of.blends;
    of.transmits = of.transmits || (number != 0 && o.transmission > 0);
    of.isWhole = of.isWhole && number != 0 && o.transmission > 0 && !o.blends;
    of.isSolid = of.isSolid && o.thickness != 0;
}

/// With what is said of everything.
OpticsOf shownThrough(OpticsOf of, const DrawSettings& settings) {
    of.opacity *= settings.opacity;
    of.blends = of.blends || of.opacity < 1;
    of.hasAny = of.hasAny || of.blends;
    return of;
}

OpticsOf appearanceOf(const lod::Store& store, const DrawSettings& settings, OpticsList& list,
                      std::span<shared::SurfaceMaterial> materials) {
    const lod::StoreDescription& d = store.description;
    OpticsOf of;
    of.isWhole = of.isSolid = true;
    if (materials.empty()) {
        lod::Optics o = settings.optics.value_or(opticsOfPoints(d));
        o.blends = o.blends && settings.transparency;
        if (o.blends) of.opacity = o.opacity;
        of.points = list.numberOf(o);
        addTo(of, o, of.points);
        return shownThrough(of, settings);
    }
    of.isPlainMesh = isPlainMesh(d);
    for (size_t m = 0; m < materials.size(); ++m) {
        lod::Optics o = d.optics.empty() ? lod::Optics{} : d.optics[m];
        if (of.isPlainMesh && settings.pointMaterial) {
            materials[m].metallic = static_cast<float>(*settings.pointMaterial & 255u) / 255;
            materials[m].roughness = static_cast<float>(*settings.pointMaterial >> 8 & 255u) / 255;
            o = settings.optics.value_or(o);
        }
        if (o.blends && !settings.transparency) materials[m].alphaCutoff = 0.5f;
        o.blends = o.blends && settings.transparency;
        const uint32_t number = list.numberOf(o);
        materials[m].optics = o.blends ? shared::kPixelBlends : number << shared::kPixelOpticsShift;
        addTo(of, o, o.blends ? 0 : number);
    }
    return shownThrough(of, settings);
}

}  // namespace

Appearance makeAppearance(std::span<const std::shared_ptr<const lod::Store>> stores,
                          const std::vector<shared::SurfaceMaterial>& materials, const DrawSettings& settings) {
    Appearance a;
    a.pointMaterial = settings.pointMaterial;
    a.given = settings.optics;
    a.transparency = settings.transparency;
    a.opacity = settings.opacity;
    a.shown = materials;
    OpticsList list;
    size_t first = 0;
    for (const auto& store : stores) {
        const size_t count = store->description.materials.size();
        a.hierarchies.push_back(appearanceOf(*store, settings, list, std::span(a.shown).subspan(first, count)));
        a.hasLayers = a.hasLayers || a.hierarchies.back().hasAny;
        first += count;
    }
    a.optics = list.take();
    if (!a.hasLayers) return a;
    a.cutOut = a.shown;
    for (shared::SurfaceMaterial& m : a.cutOut)
        if (m.optics != 0)
            m.alphaCutoff = m.optics == shared::kPixelBlends ? kOpaque : std::numeric_limits<float>::infinity();
    for (shared::SurfaceMaterial& m : a.shown)
        if (m.optics == shared::kPixelBlends) m.alphaCutoff = kLeastOpacity;
    return a;
}

Body bodyOf(const lod::StoreDescription& d, const lod::Instance& instance) {
    const glm::dvec3 edges = instance.scale * (d.boundsMax - d.boundsMin);
    Body body;
    body.centre = instance.translation + instance.rotation * (instance.scale * 0.5 * (d.boundsMin + d.boundsMax));
    body.radius = 0.51 * glm::length(edges) + instance.sway;
    const double longest = std::max({edges.x, edges.y, edges.z});
    body.thinnest = std::max(std::min({edges.x, edges.y, edges.z}), 0.02 * longest);
    return body;
}

std::vector<LayerDraw> layersOf(const lod::Cut& cut, std::span<const lod::Instance> instances,
                                std::span<const std::shared_ptr<const lod::Store>> stores, const Appearance& appearance,
                                const lod::View& view, const DrawSettings& settings) {
    std::vector<uint32_t> drawn;
    // Glass needs light; what is only transparent does not.
    const auto add = [&](uint32_t i, bool isLit) {
        const OpticsOf& of = appearance.hierarchies[instances[i].hierarchy];
        if ((of.blends || (isLit && of.isGlass)) && (drawn.empty() || drawn.back() != i)) drawn.push_back(i);
    };
    for (const lod::CutDraw& d : cut.draw) add(d.instance, settings.lit);
    for (const lod::CutMeshDraw& d : cut.meshDraw) add(d.instance, !settings.unlitTriangles);
    std::sort(drawn.begin(), drawn.end());
    drawn.erase(std::unique(drawn.begin(), drawn.end()), drawn.end());
    // What is told of points is told of all of a layer: theirs is another than that of the rest.
    std::array<LayerDraw, 2> opaque;
    const auto isOfPoints = [&](uint32_t i) { return appearance.hierarchies[instances[i].hierarchy].points != 0; };
    const auto isLit = [&](uint32_t i) {
        const bool isMesh = stores[instances[i].hierarchy]->hierarchy.isMesh();
        return isMesh ? !settings.unlitTriangles : settings.lit;
    };
    std::vector<LayerDraw> bodies;
    for (const uint32_t i : drawn) {
        const OpticsOf& of = appearance.hierarchies[instances[i].hierarchy];
        if (!of.transmits && !of.blends) {
            opaque.at(isOfPoints(i) ? 1 : 0).instances.push_back(i);
            continue;
        }
        const Body body = bodyOf(stores[instances[i].hierarchy]->description, instances[i]);
        const glm::dvec3 to = body.centre - view.eye;
        LayerDraw layer;
        layer.instances = {i};
        layer.blends = of.blends;
        layer.isGlass = of.isGlass && isLit(i);
        layer.opacity = of.opacity;
        layer.isSeenTwice = layer.isGlass && settings.refract == shared::kRefractObject && of.isWhole && of.isSolid;
        layer.distance = view.isOrthographic ? glm::dot(to, view.forward) : glm::length(to);
        bodies.push_back(std::move(layer));
    }
    std::stable_sort(bodies.begin(), bodies.end(),
                     [](const LayerDraw& a, const LayerDraw& b) { return a.distance > b.distance; });
    std::array<LayerDraw, 2> far;
    if (bodies.size() > kMostBodies) {  // the farthest are one
        const auto nearest = bodies.end() - static_cast<ptrdiff_t>(kMostBodies - 1);
        for (auto body = bodies.begin(); body != nearest; ++body) {
            LayerDraw& of = far.at(isOfPoints(body->instances.front()) ? 1 : 0);
            of.instances.push_back(body->instances.front());
            of.blends = of.blends || body->blends;
            of.isGlass = of.isGlass || body->isGlass;
            of.opacity = body->opacity;  // the nearest's
        }
        bodies.erase(bodies.begin(), nearest);
    }
    std::vector<LayerDraw> all;
    for (std::array<LayerDraw, 2>* const of : {&opaque, &far})
        for (LayerDraw& layer : *of) {
            layer.transmits = of == &far;
            layer.isGlass = layer.isGlass || of == &opaque;
            std::sort(layer.instances.begin(), layer.instances.end());
            if (!layer.instances.empty()) all.push_back(std::move(layer));
        }
    std::move(bodies.begin(), bodies.end(), std::back_inserter(all));
    return all;
}

lod::View viewFromBehind(const Body& body, const lod::View& view) {
    constexpr double kMargin = 1.02;
    constexpr double kLeast = 64, kMost = 1024;
    const glm::dvec3 to = body.centre - view.eye;
    const double distance = glm::length(to);
    lod::View back;
    back.isOrthographic = true;
    back.forward = view.isOrthographic || !(distance > 0) ? -view.forward : -to / distance;
    back.right = glm::normalize(
        glm::cross(std::abs(glm::dot(back.forward, view.down)) < 0.9 ? view.down : view.right, back.forward));
    back.down = glm::cross(back.forward, back.right);
    back.eye = body.centre - 2 * body.radius * back.forward;
    const double pixels = view.isOrthographic ? view.focalPixels : view.focalPixels / std::max(distance, body.radius);
    const double edge = std::clamp(std::ceil(2 * kMargin * body.radius * pixels), kLeast, kMost);
    back.width = back.height = static_cast<uint32_t>(edge);
    back.focalPixels = edge / (2 * kMargin * body.radius);
    back.nearPlane = 1e-3 * body.radius;
    return back;
}

glm::dvec3 absorptionInWorld(const lod::Optics& o, double scale) {
    glm::dvec3 a(0);
    for (int k = 0; k < 3 && o.attenuationDistance > 0; ++k)
        a[k] = std::min(
            -std::log(std::max(double{o.attenuationColour[k]}, 1e-6)) / (double{o.attenuationDistance} * scale), 1e30);
    return a;
}

bool isPlainMesh(const lod::StoreDescription& d) {
    if (d.materials.size() != 1) return false;
    const shared::SurfaceMaterial& m = d.materials.front();
    const bool isWhite = m.baseColour.x == 1 && m.baseColour.y == 1 && m.baseColour.z == 1;
    const uint32_t textures = m.baseTexture.texture | m.surfaceTexture.texture | m.normalTexture.texture |
                              m.occlusionTexture.texture | m.emissiveTexture.texture;
    return isWhite && m.metallic == 0 && textures == 0;
}

bool hasMirrors(const lod::StoreDescription& d) {
    const auto isSmooth = [](float roughness) { return roughness < kMirrorRoughness; };
    // Where a texture says how rough it is the factor is the most it can be.
    const auto is = [&](const shared::SurfaceMaterial& m) {
        return isSmooth(m.roughness) || m.surfaceTexture.texture != 0;
    };
    if (std::any_of(d.materials.begin(), d.materials.end(), is)) return true;
    // The list may be a grid, of which some point has to have a smooth one.
    const auto index = lod::materialAttribute(d);
    const auto isUsed = [&](size_t k) {
        if (!index || d.attributes[*index].counts.empty()) return true;  // not known
        const auto& counts = d.attributes[*index].counts;
        return std::any_of(counts.begin(), counts.end(),
                           [&](const auto& c) { return c.first == static_cast<double>(k); });
    };
    for (size_t k = 0; k < d.pointMaterials.size(); ++k)
        if (isSmooth(d.pointMaterials[k].roughness) && isUsed(k)) return true;
    return false;
}

}  // namespace stipple::render
