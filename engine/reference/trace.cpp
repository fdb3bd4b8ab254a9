// Rays against the full detail of a scene: discs, triangles and curves of all leaves, in one hierarchy of boxes per
// store and one over the places where the stores stand.
#include <cmath>
#include <limits>
#include <map>

#include "engine/base/box_tree.h"
#include "engine/base/process.h"
#include "engine/base/queue.h"
#include "engine/reference/curve_rays.h"
#include "engine/reference/decode.h"
#include "engine/reference/decode_map.h"
#include "engine/reference/decode_patch.h"
#include "engine/reference/reference.h"
#include "engine/reference/surface.h"
#include "engine/reference/surroundings.h"
#include "engine/render/effects/table.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/colour.h"
#include "lod/store/materials.h"
#include "lod/store/mesh_place.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

constexpr double kNever = std::numeric_limits<double>::max();
constexpr uint32_t kRough = 255u << 8;  ///< packed: not metallic

/// Everything that a store draws in full detail, in its own coordinates.
struct TracedStore {
    const lod::Store* store = nullptr;
    lod::ColourBy colour;
    std::vector<Disc> discs;
    std::vector<Segment> segments;
    std::vector<shared::MeshVertex> vertices;
    std::vector<dvec3> places;  ///< of each, lattice units
    std::vector<std::array<uint32_t, 3>> triangles;
    std::vector<uint32_t> maps;      ///< of blocks of patches, 153 vertices each: PatchBlock::map
    std::vector<uint32_t> mapWords;  ///< that those point into
    std::vector<glm::dmat3> frames;  ///< of those blocks: from the patch's directions to the store's
    Chunks tiles;                    ///< all levels of all textures
    render::MeshTextures textures;
    BoxTree tree;  ///< items: discs, then triangles, then segments (a store has one kind)

    /// Of a vertex; those of patches say it themselves.
    const shared::SurfaceMaterial& materialOf(uint32_t surface) const {
        if (store->hierarchy.groups.empty()) return kPatchMaterial;
        return store->description.materials.at(surface & shared::kSurfaceMaterialMask);
    }
    dvec3 positionOf(uint32_t vertex) const { return store->hierarchy.origin + store->hierarchy.unit * places[vertex]; }
};

Box boxOf(const Disc& d) {
    dvec3 half(d.radius);
    if (d.normal != dvec3(0))
        half = d.radius * glm::sqrt(glm::max(dvec3(0), 1.0 - d.normal * d.normal)) + dvec3(1e-9 * d.radius);
    return {d.position - half, d.position + half};
}

/// Makes room for the vertices of a chunk; where they begin.
uint32_t addVertices(const lod::Chunk& chunk, TracedStore& t) {
    const auto base = static_cast<uint32_t>(t.vertices.size());
    t.vertices.insert(t.vertices.end(), chunk.vertices.begin(), chunk.vertices.end());
    t.places.resize(t.vertices.size());
    return base;
}

/// The triangles of some clusters of a chunk, whose vertices begin at `base`.
void addClusters(const lod::Chunk& chunk, uint32_t node, uint32_t begin, uint32_t end, uint32_t base, TracedStore& t) {
    const lod::Node& group = lod::meshNode(t.store->hierarchy, node);
    for (uint32_t c = begin; c < end; ++c) {
        const shared::MeshCluster& cluster = chunk.clusters[c];
        for (uint32_t v = 0; v < lod::verticesOf(group, cluster); ++v)
            t.places[base + cluster.firstVertex + v] = lod::vertexPlace(group, chunk, cluster, v);
        for (uint32_t k = 0; k < cluster.counts >> 16; ++k) {
            const uint32_t word = chunk.triangles[cluster.firstTriangle + k], first = base + cluster.firstVertex;
            t.triangles.push_back({first + word % 256, first + (word >> 8) % 256, first + (word >> 16) % 256});
        }
    }
}

/// The lifted triangles of a chunk's patches, seen from both sides; their surface has the packed material instead of a
/// number.
void addPatches(const lod::Chunk& chunk, uint32_t node, TracedStore& t) {
    const lod::Hierarchy& h = t.store->hierarchy;
    const auto firstWord = static_cast<uint32_t>(t.mapWords.size());
    t.mapWords.insert(t.mapWords.end(), chunk.patchMaps.begin(), chunk.patchMaps.end());
    for (size_t b = 0; b < chunk.patchBlocks.size(); ++b) {
        const uint32_t map = chunk.patchBlocks[b].map;
        t.maps.push_back(map == 0 ? 0 : map + 32 * firstWord);
        const PatchBlockReader block(h, h.nodes[node], chunk.patchBlocks[b], chunk.patchPlanes[b]);
        t.frames.emplace_back(block.inStore({1, 0, 0}), block.inStore({0, 1, 0}), block.inStore({0, 0, 1}));
        const auto base = static_cast<uint32_t>(t.vertices.size());
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            const PatchCorner corner = block.sample(s);
            shared::MeshVertex v{};
            v.normal = lod::octEncode(glm::vec3(corner.normal));
            v.colour = chunk.patchBlocks[b].colours[s] | 0xff000000u;
            v.u = static_cast<float>(s % 17);
            v.v = static_cast<float>(s / 17);
            v.surface = shared::kSurfaceTwoSided | kRough;
            if (!chunk.materials.empty())
                v.surface = shared::kSurfaceTwoSided | chunk.materials[153 * b + s];
            else if (!t.store->description.pointMaterials.empty())
                v.surface = shared::kSurfaceTwoSided | lod::packed(t.store->description.pointMaterials.front());
            t.vertices.push_back(v);
            t.places.push_back(corner.place);
        }
        block.forEachTriangle([&](uint32_t a, uint32_t c, uint32_t d) {
            t.triangles.push_back({base + a, base + c, base + d});
        });
    }
}

Result<void> readLeaf(uint32_t index, TracedStore& t) {
    const lod::Hierarchy& h = t.store->hierarchy;
    const uint32_t number = h.nodeOf(index);
    const lod::Node& node = h.nodes[number];
    STIPPLE_ASSIGN(lod::Chunk chunk, lod::readChunk(*t.store, index));
    std::vector<uint8_t> values;
    if (t.colour.needsAttributes() && chunk.clusters.empty()) {
        STIPPLE_ASSIGN(values, lod::readAttribute(*t.store, index, t.colour.attribute));
    }
    lod::recolour(t.colour, *t.store, index, chunk, values);
    for (const shared::CurveSegment& s : chunk.segments) t.segments.push_back(decodeSegment(h, node, s));
    STIPPLE_TRY(lod::addMaterials(*t.store, index, chunk));
    const std::vector<lod::PointMaterial>& materials = t.store->description.pointMaterials;
    for (size_t i = 0; i < chunk.records.size(); ++i) {
        Disc& d = t.discs.emplace_back(decodeDisc(h, node, chunk.records[i]));
        if (!chunk.materials.empty())
            d.material = lod::PointMaterial{static_cast<float>(chunk.materials[i] >> 8) / 255,
                                            static_cast<float>(chunk.materials[i] & 255) / 255};
        else if (!materials.empty())
            d.material = materials.front();
    }
    addClusters(chunk, number, 0, static_cast<uint32_t>(chunk.clusters.size()), addVertices(chunk, t), t);
    addPatches(chunk, number, t);
    return {};
}

Result<void> readTree(TracedStore& t) {
    const lod::Hierarchy& h = t.store->hierarchy;
    t.discs.reserve(t.store->description.points);
    Result<void> read;
    for (uint32_t i = 0; i < h.nodes.size(); ++i)
        if (h.nodes[i].isLeaf())
            h.forEachPayload(i, [&](uint32_t index) {
                if (read) read = readLeaf(index, t);
            });
    return read;
}

Result<void> readMesh(TracedStore& t) {
    const lod::Hierarchy& h = t.store->hierarchy;
    t.textures = {h.textures, 0, static_cast<uint32_t>(h.nodes.size()), static_cast<uint32_t>(h.tiles.size())};
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        const lod::MeshGroup& group = h.groups[i];
        lod::Chunk chunk;
        uint32_t base = 0;
        for (uint32_t r = group.firstRun; r < group.firstRun + group.runs; ++r) {
            const lod::MeshRun& run = h.runs[r];
            if (run.producer != lod::MeshRun::kOriginal) continue;
            if (chunk.clusters.empty()) {
                STIPPLE_ASSIGN(chunk, lod::readChunk(*t.store, i));
                base = addVertices(chunk, t);
            }
            addClusters(chunk, i, run.firstCluster, run.firstCluster + run.clusters, base, t);
        }
    }
    for (uint32_t i = t.textures.firstChunk; h.isTile(i); ++i) {
        STIPPLE_ASSIGN(t.tiles[i], lod::readChunk(*t.store, i));
    }
    return {};
}

Result<void> readStore(const render::PlacedStore& placed, TracedStore& t) {
    const lod::Store& store = *placed.store;
    t.store = &store;
    t.colour = placed.colour;
    STIPPLE_TRY(lod::readWholeTable(store));
    STIPPLE_TRY(store.hierarchy.isMesh() ? readMesh(t) : readTree(t));
    std::vector<Box> boxes;
    boxes.reserve(t.discs.size() + t.triangles.size());
    for (const Disc& d : t.discs) boxes.push_back(boxOf(d));
    for (const auto& corners : t.triangles) {
        boxes.emplace_back();
        for (const uint32_t v : corners) boxes.back().add(t.positionOf(v));
    }
    for (const Segment& s : t.segments) {
        boxes.push_back({s.a - s.radiusA, s.a + s.radiusA});
        boxes.back().add({s.b - s.radiusB, s.b + s.radiusB});
    }
    t.tree = BoxTree(boxes);
    return {};
}

/// Where the ray meets the disc within a radius; its side towards the eye.
bool meetsDisc(const Disc& d, double radius, const LocalRay& ray, bool isOrthographic, double& t, double& rho2,
               dvec3& normal) {
    const dvec3 n = d.normal != dvec3(0) ? d.normal
                    : isOrthographic     ? -glm::normalize(ray.direction)
                                         : -glm::normalize(d.position - ray.origin);
    const double facing = glm::dot(n, ray.direction);
    if (facing == 0) return false;
    if (facing > 0 && (d.flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) == 0) return false;
    t = glm::dot(n, d.position - ray.origin) / facing;
    const dvec3 off = ray.origin + t * ray.direction - d.position;
    rho2 = glm::dot(off, off) / (radius * radius);
    normal = facing > 0 ? -n : n;
    return rho2 <= 1;
}

/// Moeller and Trumbore 1997; edges belong to both of their triangles.
bool meetsTriangle(const dvec3& a, const dvec3& b, const dvec3& c, bool isTwoSided, const LocalRay& ray, double& t) {
    const dvec3 e1 = b - a, e2 = c - a, p = glm::cross(ray.direction, e2);
    const double det = glm::dot(e1, p);
    if (det == 0 || (det < 0 && !isTwoSided)) return false;
    const dvec3 off = ray.origin - a, q = glm::cross(off, e1);
    const double u = glm::dot(off, p) / det, v = glm::dot(ray.direction, q) / det;
    constexpr double kSlack = 1e-12;
    if (u < -kSlack || v < -kSlack || u + v > 1 + kSlack) return false;
    t = glm::dot(e2, q) / det;
    return true;
}

/// Where the stores of a scene stand, and what each draws: those that look alike are one.
struct TracedScene {
    std::vector<render::PlacedStore> placed;
    std::map<std::pair<const lod::Store*, size_t>, TracedStore> stores;
    std::vector<const TracedStore*> places;

    Result<void> read(Executor& executor) {
        std::vector<std::pair<const render::PlacedStore*, TracedStore*>> toRead;
        for (const render::PlacedStore& p : placed) {
            // A store in other colours is another one.
            const bool isOwn = p.colour.mode == lod::ColourMode::own;
            auto [at, isNew] = stores.try_emplace({p.store.get(), isOwn ? 0 : places.size() + 1});
            if (isNew) toRead.emplace_back(&p, &at->second);
            places.push_back(&at->second);
        }
        std::vector<Result<void>> results(toRead.size());
        executor.parallelFor(toRead.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) results[k] = readStore(*toRead[k].first, *toRead[k].second);
        });
        for (const Result<void>& result : results) STIPPLE_TRY(result);
        return {};
    }
};

class Tracer {
  public:
    Tracer(const TracedScene& scene, const lod::View& view, const TraceSettings& settings)
        : placed_(scene.placed), view_(view), settings_(settings), places_(scene.places) {
        std::vector<Box> boxes;
        for (size_t p = 0; p < placed_.size(); ++p) {
            const lod::Instance& place = placed_[p].place;
            const Box own = places_[p]->tree.bounds();
            boxes.emplace_back();
            for (int k = 0; k < 8; ++k) {
                const dvec3 corner((k & 1) != 0 ? own.hi.x : own.lo.x, (k & 2) != 0 ? own.hi.y : own.lo.y,
                                   (k & 4) != 0 ? own.hi.z : own.lo.z);
                boxes.back().add(place.translation + place.rotation * (place.scale * corner) - view_.eye);
            }
        }
        tree_ = BoxTree(boxes);
        render::makeRayList(view_, settings_.draw, draws_);
    }

    /// Depth of what one ray meets first, and its normal towards the eye (world space); false if it meets nothing.
    bool surface(const ViewRay& ray, double step, double& depth, dvec3& normal) const {
        const Hit hit = nearestHit(ray, step);
        depth = hit.t;
        normal = toWorld(hit.normal);
        return hit.place != kNone;
    }

    /// Linear colour that one ray brings; false if it meets nothing. `ray`: camera space.
    bool look(const ViewRay& ray, double step, dvec3& colour) const {
        Hit hit = nearestHit(ray, step);
        if (hit.place == kNone) return false;
        const dvec3 point = ray.at(hit.t);
        if (hit.isTriangle && !hit.sample.isLitAsPoint) {
            colour = shadeTriangle(hit.sample, hit.normal, point, draws_, pastThings(hit));
            return true;
        }
        Sample s = hit.sample;
        const dvec3 n = hit.isCurve || hit.isTriangle ? hit.normal : blendDiscs(ray, hit, s);
        const shared::FrameConstants& f = draws_.frame;
        colour = s.colour;
        if ((f.shade & shared::kShadeLit) == 0) return true;
        if (draws_.lights.empty() && !draws_.environment && !s.hasMaterial())
            colour *= lightOn(n, f, s.isLeaf(pixelsAt(view_, s.depth)));
        else
            colour = shadeTriangle(s, n, point, draws_, pastThings(hit));
        return true;
    }

  private:
    static constexpr uint32_t kNone = ~0u;
    struct Hit {
        uint32_t place = kNone;
        double t = kNever, thickness = 0;
        bool isTriangle = false, isCurve = false;
        Sample sample;
        dvec3 normal{0};  ///< camera space, towards the eye
    };

    /// What comes of a light that casts shadows to a surface, by rays from the light: nothing past what is no leaf, and
    /// of what falls on a leaf what it lets through. What is no farther in front of the surface than that is thick is
    /// the surface itself.
    LightPast pastThings(const Hit& surface) const {
        const double thickness = surface.thickness;
        return [this, thickness](size_t k, const dvec3& point, const dvec3&) {
            const bool casts = castsShadows_ && settings_.draw.lights.at(k).castsShadow;
            const shared::LightSource& light = draws_.lights[k];
            if (!casts || light.kind == shared::kLightPoint) return dvec3(1);
            const bool isFar = light.kind == shared::kLightDirectional;
            const double far = 4 * glm::length(tree_.bounds().hi - tree_.bounds().lo) + glm::length(point);
            const dvec3 from = isFar ? point + far * glm::normalize(dvec3(light.position)) : dvec3(light.position);
            const double length = glm::length(point - from);
            constexpr double kRounding = 1e-9;
            const double end = length * (1 - kRounding) - thickness;
            dvec3 share(1);
            ViewRay ray{from, (point - from) / length};
            for (double gone = 0; gone < end && share != dvec3(0);) {
                const Hit hit = nearestHit(ray, 0);
                gone += hit.t;
                if (hit.place == kNone || gone >= end) break;
                constexpr double kGlow = 0.6;
                share *= hit.sample.isLeaf(1) ? kGlow * hit.sample.colour : dvec3(0);
                gone += length * kRounding;
                ray.origin = from + gone * ray.direction;
            }
            return share;
        };
    }

    dvec3 toWorld(const dvec3& c) const { return view_.right * c.x + view_.down * c.y + view_.forward * c.z; }
    dvec3 toCamera(const dvec3& w) const {
        return {glm::dot(w, view_.right), glm::dot(w, view_.down), glm::dot(w, view_.forward)};
    }
    LocalRay localRay(const lod::Instance& place, const ViewRay& ray) const {
        const glm::dmat3 back = glm::transpose(place.rotation);
        return {back * (view_.eye + toWorld(ray.origin) - place.translation) / place.scale,
                back * toWorld(ray.direction) / place.scale};
    }

    /// What of a disc is drawn, store units: a stray point hides no more of the picture than a 128th of its height.
    double drawnRadius(const Disc& d, const lod::Instance& place) const {
        if ((d.flags & shared::kFlagScattered) == 0) return d.radius;
        constexpr double kShare = 1.0 / 128, kLeastPixels = 4;
        const dvec3 at = place.translation + place.rotation * (place.scale * d.position) - view_.eye;
        const double depth = std::max(glm::dot(at, view_.forward), view_.nearPlane);
        const double most = std::max(kShare * view_.height, kLeastPixels) / pixelsAt(view_, depth);
        return std::min(d.radius, most / place.scale);
    }

    Hit nearestHit(const ViewRay& ray, double step) const {
        Hit best;
        const double length = glm::length(ray.direction);
        tree_.visit(toWorld(ray.origin), toWorld(ray.direction), view_.nearPlane, best.t, [&](uint32_t p) {
            const TracedStore& store = *places_[p];
            const lod::Instance& place = placed_[p].place;
            const LocalRay local = localRay(place, ray);
            store.tree.visit(local.origin, local.direction, view_.nearPlane, best.t, [&](uint32_t item) {
                double t = 0, rho2 = 0;
                dvec3 normal;
                const auto meets = [&](const Disc& d) {
                    return meetsDisc(d, drawnRadius(d, place), local, view_.isOrthographic, t, rho2, normal);
                };
                const size_t discs = store.discs.size(), triangles = store.triangles.size();
                if (item >= discs + triangles) {
                    hitSegment(store.segments[item - discs - triangles], place, local, p, best);
                } else if (item >= discs) {
                    hitTriangle(store, place, store.triangles[item - discs], local, ray, step, p, best);
                } else if (meets(store.discs[item]) && t > view_.nearPlane && t < best.t) {
                    const double m = std::abs(glm::dot(place.rotation * normal, toWorld(ray.direction))) / length;
                    best.place = p;
                    best.t = t;
                    best.isTriangle = best.isCurve = false;
                    best.sample.thickness = 1;
                    best.normal = toCamera(place.rotation * normal);
                    best.thickness = place.scale * drawnRadius(store.discs[item], place) *
                                     (0.25 + std::sqrt(std::max(0.0, 1 - m * m)));
                }
            });
        });
        return best;
    }

    /// What a map shows instead of its samples.
    void showMap(const TracedStore& store, const lod::Instance& place, const std::array<uint32_t, 3>& corners,
                 const MapReader& map, const dvec2& at, double cells, Sample& s, dvec3& n) const {
        const MapReader::Look look = map.look(at, cells);
        if (!settings_.draw.pointMaterial && !store.store->description.pointMaterials.empty()) {
            s.emissive = look.emission;
            s.isUnlit = look.unlit >= 0.5;
        }
        if (!map.hasColours()) return;
        s.colour = look.colour;
        if (map.hasNormals()) n = toCamera(place.rotation * (store.frames[corners[0] / 153] * look.normal));
        const bool isList = store.store->description.pointMaterials.size() > 1;
        if (!map.hasMaterials() || settings_.draw.pointMaterial || !isList) return;
        s.metallic = look.finish.x;
        s.roughness = look.finish.y;
    }

    void hitSegment(const Segment& s, const lod::Instance& place, const LocalRay& local, uint32_t p, Hit& best) const {
        CurveHit hit;
        if (!meetsSegment(s, local, view_.nearPlane, hit) || hit.t >= best.t) return;
        best = {};
        best.place = p;
        best.t = hit.t;
        best.isCurve = true;
        best.sample.colour = glm::mix(s.colourA, s.colourB, hit.place);
        best.sample.thickness = s.isTube ? 1e30 : 0;  // a ribbon is a leaf, in all units
        best.sample.radius = best.sample.depth = 1;
        best.normal = toCamera(place.rotation * hit.normal);
    }

    void hitTriangle(const TracedStore& store, const lod::Instance& place, const std::array<uint32_t, 3>& corners,
                     const LocalRay& local, const ViewRay& ray, double step, uint32_t p, Hit& best) const {
        const uint32_t surface = store.vertices[corners[0]].surface;
        double t = 0;
        if (!meetsTriangle(store.positionOf(corners[0]), store.positionOf(corners[1]), store.positionOf(corners[2]),
                           (surface & shared::kSurfaceTwoSided) != 0, local, t) ||
            t <= view_.nearPlane || t >= best.t)
            return;
        Corners c;
        for (size_t k = 0; k < 3; ++k)
            c.at(k) = cornerOf(store.store->hierarchy, place, store.vertices[corners.at(k)],
                               store.places[corners.at(k)], view_);
        if (store.store->hierarchy.groups.empty())  // a patch
            for (size_t k = 0; k < 3; ++k)
                c.at(k).finish = finishOf(settings_.draw.pointMaterial.value_or(store.vertices[corners.at(k)].surface &
                                                                                shared::kSurfaceMaterialMask));
        const dvec3 face = glm::cross(c[1].at - c[0].at, c[2].at - c[0].at);
        const dvec2 w = glm::clamp(weightsOn(ray, c, face), dvec2(0), dvec2(1));
        Sample sample;
        dvec3 n;
        const uint32_t map = corners[0] / 153 < store.maps.size() ? store.maps[corners[0] / 153] : 0;
        const ShowPlace show = [&](const dvec2& at, double cells, Sample& s, dvec3& normal) {
            showMap(store, place, corners, MapReader(store.mapWords, map), at, cells, s, normal);
        };
        if (!surfaceOn(ray.direction, w, footprintOn(ray, view_.isOrthographic, step, c, face), c, face, surface,
                       store.materialOf(surface), {store.textures, store.tiles, map != 0 ? &show : nullptr}, sample, n))
            return;
        best.place = p;
        best.t = t;
        best.isTriangle = true;
        best.isCurve = false;
        best.sample = sample;
        best.sample.thickness = 1;
        const bool isPlain = store.store->description.pointMaterials.empty() && !settings_.draw.pointMaterial;
        best.sample.isLitAsPoint = store.store->hierarchy.groups.empty() && isPlain;
        best.normal = n;
    }

    std::optional<lod::PointMaterial> materialOf(const Disc& d) const {
        const std::optional<uint32_t>& only = settings_.draw.pointMaterial;
        if (!only) return d.material;
        return lod::PointMaterial{static_cast<float>(*only >> 8) / 255, static_cast<float>(*only & 255u) / 255};
    }

    /// Mean colour and material of the discs within the front thickness, weighted by (1 - rho^2)^2; returns their
    /// normal.
    dvec3 blendDiscs(const ViewRay& ray, const Hit& front, Sample& out) const {
        const double limit = front.t + front.thickness;
        double weights = 0, share = 0, metallic = 0, roughness = 0;
        dvec3 normals(0), colour(0);
        tree_.visit(toWorld(ray.origin), toWorld(ray.direction), view_.nearPlane, limit, [&](uint32_t p) {
            const TracedStore& store = *places_[p];
            const LocalRay local = localRay(placed_[p].place, ray);
            store.tree.visit(local.origin, local.direction, view_.nearPlane, limit, [&](uint32_t item) {
                double t = 0, rho2 = 0;
                dvec3 normal;
                if (item >= store.discs.size()) return;
                const Disc& d = store.discs[item];
                if (!meetsDisc(d, drawnRadius(d, placed_[p].place), local, view_.isOrthographic, t, rho2, normal) ||
                    t <= view_.nearPlane || t >= limit)
                    return;
                const double w = (1 - rho2) * (1 - rho2) + 1e-9;
                weights += w;
                colour += w * store.discs[item].colour;
                if (const auto material = materialOf(d)) {
                    share += w;
                    metallic += w * double{material->metallic};
                    roughness += w * double{material->roughness};
                }
                normals += w * (placed_[p].place.rotation * normal);
            });
        });
        out.colour = colour / weights;
        out.materialShare = share / weights;
        out.metallic = share > 0 ? metallic / share : 0;
        out.roughness = share > 0 ? roughness / share : 1;
        return glm::normalize(toCamera(normals));
    }

    const std::vector<render::PlacedStore>& placed_;
    const lod::View& view_;
    const TraceSettings& settings_;
    const bool castsShadows_ = render::isRequested("shadow", settings_.draw);
    const std::vector<const TracedStore*>& places_;
    BoxTree tree_;  ///< of the places, relative to the eye
    render::DrawList draws_;
};

/// What of a backdrop a ray brings that meets nothing; `n`: rays along an edge of a pixel.
dvec3 missedLight(const render::DrawSettings& draw, const lod::View& view, const ViewRay& ray, uint32_t n) {
    const dvec3 world = view.right * ray.direction.x + view.down * ray.direction.y + view.forward * ray.direction.z;
    return lightFrom(*draw.backdrop, toMap(world, draw.worldUp), view.isOrthographic ? 0 : 1 / (view.focalPixels * n));
}

Result<render::Image> traceScene(const TracedScene& scene, const lod::View& view, const TraceSettings& settings,
                                 Executor& executor) {
    const Tracer tracer(scene, view, settings);
    render::Image image;
    image.width = view.width;
    image.height = view.height;
    image.rgba.resize(size_t{view.width} * view.height);
    image.depth.resize(image.rgba.size());
    image.normal.resize(image.rgba.size() * 3);
    image.linear.resize(image.rgba.size() * 3);
    const uint32_t n = std::max(1u, settings.samplesPerAxis);
    const bool hasBackdrop = render::showsBackdrop(settings.draw);
    executor.parallelFor(view.height, 4, [&](size_t row0, size_t row1) {
        for (size_t y = row0; y < row1; ++y)
            for (uint32_t x = 0; x < view.width && !isStopRequested(); ++x) {
                const auto rayAt = [&](double px, double py) { return viewRay(view, dvec2(px, py)); };
                dvec3 sum(0), normal(0);
                uint32_t hits = 0;
                double depth = 0;
                for (uint32_t s = 0; s < n * n; ++s) {
                    dvec3 colour(0);
                    const ViewRay ray = rayAt(x + (s % n + 0.5) / n, double(y) + (s / n + 0.5) / n);
                    const bool isHit = tracer.look(ray, 1 / (view.focalPixels * n), colour);
                    hits += isHit ? 1 : 0;
                    if (isHit || hasBackdrop) sum += isHit ? colour : missedLight(settings.draw, view, ray, n);
                }
                // Of edges a mean would be the depth of nothing.
                const bool isThere =
                    tracer.surface(rayAt(x + 0.5, double(y) + 0.5), 1 / view.focalPixels, depth, normal);
                const double coverage = double(hits) / (n * n);
                const dvec3 beside = hasBackdrop ? dvec3(0) : (1 - coverage) * dvec3(settings.draw.background);
                const dvec3 c = sum / double(n * n) + beside;
                const size_t pixel = y * view.width + x;
                image.depth[pixel] = isThere ? static_cast<float>(depth) : 0.0f;
                for (int k = 0; k < 3; ++k) {
                    const size_t channel = 3 * pixel + static_cast<size_t>(k);
                    image.linear[channel] = static_cast<float>(c[k]);
                    image.normal[channel] = isThere ? static_cast<float>(normal[k]) : 0.0f;
                }
                image.rgba[pixel] = encodeSrgb(c.x) | encodeSrgb(c.y) << 8 | encodeSrgb(c.z) << 16 |
                                    static_cast<uint32_t>(std::lround(coverage * 255)) << 24;
            }
    });
    if (isStopRequested()) return fail(ErrorKind::interrupted, "interrupted");
    return image;
}

struct TracedFullScene final : FullScene {
    TracedScene scene;
    Result<render::Image> trace(const lod::View& view, const TraceSettings& settings,
                                Executor& executor) const override {
        return traceScene(scene, view, settings, executor);
    }
};

}  // namespace

Result<std::unique_ptr<FullScene>> readFullScene(const std::vector<render::PlacedStore>& placed, Executor& executor) {
    auto full = std::make_unique<TracedFullScene>();
    full->scene.placed = placed;
    STIPPLE_TRY(full->scene.read(executor));
    return full;
}

Result<render::Image> trace(const std::vector<render::PlacedStore>& placed, const lod::View& view,
                            const TraceSettings& settings, Executor& executor) {
    STIPPLE_ASSIGN(const auto full, readFullScene(placed, executor));
    return full->trace(view, settings, executor);
}

}  // namespace stipple::reference
