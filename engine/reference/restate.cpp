// Modes points and pullpush once more, in fp64, one pixel at a time, written from ALGORITHMS 1.4 and not from the
// kernels.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "engine/base/check.h"
#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/reference/effects/effects.h"
#include "engine/reference/kinds.h"
#include "engine/reference/reference.h"
#include "engine/reference/restate_discs.h"
#include "engine/reference/surface.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

/// What a sample's disc has to do with rays: its place where its depth is `depth`.
dvec3 placeOf(const Sample& s, double depth, const lod::View& view) { return viewRay(view, s.centre).at(depth); }

/// Normal of a sample's disc in camera space; `perp`, `facing`: across and along the view of its centre.
dvec3 discNormal(const Sample& s, const dvec2& perp, double facing, const lod::View& view) {
    return glm::transpose(rotationToZ(viewRay(view, s.centre).sight())) * dvec3(perp, -facing);
}

/// rho^2 of an image point in the disc of a sample: where the ray through it meets the plane, in radii. A disc that is
/// seen edge-on is turned until a quarter of a pixel of it is seen to each side; a tube's faces the eye.
double rhoSquared(const Sample& s, const dvec2& point, const lod::View& view) {
    dvec2 perp = s.isRound ? dvec2(0) : s.perp;
    const double sine = glm::length(perp), least = std::min(0.25 / s.radius, 1.0);
    const double facing = std::max(std::sqrt(std::max(0.0, 1 - sine * sine)), least);
    if (sine > 0) perp *= std::sqrt(1 - facing * facing) / sine;
    // Where the centre's depth is 1, which is as good as any.
    const dvec3 n = discNormal(s, perp, facing, view), c = placeOf(s, 1, view);
    const ViewRay ray = viewRay(view, point);
    const double t = glm::dot(n, c - ray.origin) / glm::dot(n, ray.direction);
    if (!view.isOrthographic && !(t > 0 && t < 100)) return 1e300;
    const dvec3 off = ray.at(t) - c;
    return glm::dot(off, off) * view.focalPixels * view.focalPixels / (s.radius * s.radius);
}

}  // namespace

double depthAt(const Sample& s, const dvec2& point, const lod::View& view) {
    if (s.isRound) return s.depth;
    const double facing = std::max(std::sqrt(std::max(0.0, 1 - glm::dot(s.perp, s.perp))), 1.0 / 32);
    const dvec3 n = discNormal(s, s.perp, facing, view);
    // (What stands alone ends at its rim.)
    const double across =
        (s.isMerged ? std::max(2 * s.radius, 1 / facing) : std::max(s.radius, 0.5)) / view.focalPixels;
    if (view.isOrthographic) {
        const ViewRay ray = viewRay(view, point);
        const double t = glm::dot(n, placeOf(s, s.depth, view) - ray.origin) / n.z;
        return std::clamp(t, s.depth - across, s.depth + across);
    }
    const double nearer = glm::dot(n, placeOf({.centre = point}, 1, view)) / glm::dot(n, placeOf(s, 1, view));
    const double reach = std::min(across, 0.5);
    return s.depth / std::clamp(nearer, 1 - reach, 1 + reach);
}

dvec3 normalAt(const Sample& s, const dvec2& point, const lod::View& view) {
    Sample at = s;
    if (s.isRound) at.centre = point;
    return discNormal(at, s.perp, std::sqrt(std::max(0.0, 1 - glm::dot(s.perp, s.perp))), view);
}

namespace {

struct Contribution {
    const Sample* sample;
    double weight;
};

/// Weighted mean of the contributions whose depth interval begins before the first one ends, at `back`, and that are
/// round if that one is. A tube is as thick as it is wide.
Sample blend(std::vector<Contribution>& list, double& back, const lod::View& view) {
    STIPPLE_CHECK(!list.empty(), "nothing to blend");
    back = 1e300;
    for (const Contribution& c : list) back = std::min(back, c.sample->depth + c.sample->thickness);
    Sample sum;
    double weight = 0, metallic = 0, roughness = 0;
    for (const Contribution& c : list)
        if (c.sample->depth + c.sample->thickness <= back) {
            sum.isRound = c.sample->isRound;
            break;
        }
    std::erase_if(list, [&](const Contribution& c) {
        return c.sample->depth - c.sample->thickness > back || c.sample->isRound != sum.isRound;
    });
    // Which way normals point is not known; discs on both sides of an outline, turned to the eye, would cancel out.
    const auto facing = [](const Sample& s) { return std::sqrt(std::max(0.0, 1 - glm::dot(s.perp, s.perp))); };
    dvec3 direction(0);
    for (const auto& [s, w] : list) {
        const dvec3 n(s->perp, -facing(*s)), first(list.front().sample->perp, -facing(*list.front().sample));
        direction += (sum.isRound || glm::dot(n, first) >= 0 ? w : -w) * n;
    }
    for (const auto& [s, w] : list) {
        weight += w;
        sum.depth += view.isOrthographic ? w * s->depth : w / s->depth;  // what is linear on the image
        sum.radius += w * s->radius;
        sum.thickness += w * s->thickness * pixelsAt(view, s->depth);
        sum.centre += w * s->centre;
        sum.perp += w * s->perp;
        sum.axis += w * s->axis;
        sum.colour += w * s->colour;
        sum.materialShare += w * s->materialShare;
        metallic += w * s->materialShare * s->metallic;
        roughness += w * s->materialShare * s->roughness;
    }
    if (sum.materialShare > 0) {
        sum.metallic = metallic / sum.materialShare;
        sum.roughness = roughness / sum.materialShare;
    }
    sum.materialShare /= weight;
    sum.valid = true;
    sum.depth = view.isOrthographic ? sum.depth / weight : weight / sum.depth;
    sum.radius /= weight;
    sum.thickness = sum.thickness / weight / pixelsAt(view, sum.depth);
    sum.centre /= weight;
    sum.perp =
        sum.isRound ? sum.perp / weight : dvec2(direction) / glm::length(direction) * (direction.z > 0 ? -1.0 : 1.0);
    sum.axis /= weight;
    sum.colour /= weight;
    if (sum.isRound) sum.thickness = sum.radius / pixelsAt(view, sum.depth);
    return sum;
}

Level pullLevel(const Level& fine, double childSize, const lod::View& view, bool containedOnly) {
    Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
    coarse.samples.resize(static_cast<size_t>(coarse.width) * static_cast<size_t>(coarse.height));
    for (int y = 0; y < coarse.height; ++y)
        for (int x = 0; x < coarse.width; ++x) {
            std::vector<Contribution> list;
            for (int k = 0; k < 4; ++k) {
                const Sample* s = fine.at(2 * x + k % 2, 2 * y + k / 2);
                if (!s || !s->valid || !(s->radius >= 0.5 * childSize)) continue;
                if (containedOnly && rhoSquared(*s, dvec2(2 * x + 1, 2 * y + 1) * childSize, view) > 1) continue;
                list.push_back({s, s->radius * s->radius});
            }
            if (list.empty()) continue;
            double back = 0, front = 1e300, deepest = 0, thickest = 0;
            bool anyLeaf = false;
            Sample merged = blend(list, back, view);
            for (const Contribution& c : list) {
                front = std::min(front, c.sample->depth);
                deepest = std::max(deepest, c.sample->depth);
                thickest = std::max(thickest, c.sample->thickness);
                anyLeaf = anyLeaf || c.sample->isLeaf(pixelsAt(view, c.sample->depth));
            }
            const double end = std::min(thickest + deepest, front + (anyLeaf ? 1 : 2) * thickest);
            merged.thickness = merged.isRound ? merged.radius / pixelsAt(view, merged.depth)
                                              : std::max(end - merged.depth, 0.5 * thickest);
            coarse.ref(x, y) = merged;
        }
    return coarse;
}

void pushLevel(Level& fine, const Level& coarse, double fineSize, const lod::View& view, double (*kernel)(double)) {
    for (int y = 0; y < fine.height; ++y)
        for (int x = 0; x < fine.width; ++x) {
            const dvec2 centre = (dvec2(x, y) + 0.5) * fineSize;
            // What stands for a splat beside the picture does not show its own pixel.
            if (Sample& s = fine.ref(x, y);
                fineSize == 1 && s.valid &&
                std::max(std::abs(s.centre.x - centre.x), std::abs(s.centre.y - centre.y)) > 0.75)
                s.valid = false;
            const int px = x / 2, py = y / 2, sx = x % 2 ? 1 : -1, sy = y % 2 ? 1 : -1;
            std::vector<std::pair<const Sample*, double>> around;  // filled coarse texels and rho^2 there
            double least = 1e300, hindmost = 0, nearBack = 1e300;
            size_t outside = 0;
            for (int k = 0; k < 4; ++k) {
                const Sample* s = coarse.at(px + (k % 2 ? sx : 0), py + (k / 2 ? sy : 0));
                outside += s == nullptr;
                if (!s || !s->valid) continue;
                hindmost = std::max(hindmost, s->depth + s->thickness);
                around.emplace_back(s, rhoSquared(*s, centre, view));
                nearBack = std::min(nearBack, s->depth + s->thickness);
                least = std::min(least, around.back().second);
            }
            // Inside one surface but just missed by all its texels: they count with twice the radius.
            const auto together = std::count_if(around.begin(), around.end(), [&](const auto& a) {
                return a.first->depth - a.first->thickness <= nearBack;
            });
            const bool widen = least >= 1 && together >= 4;
            std::vector<Contribution> list;
            for (const auto& [s, rho2] : around) {
                const double widened = widen ? rho2 / 4 : rho2, rest = std::max(0.0, 1 - widened);
                const double reached = !kernel ? rest * rest : widened < 1 ? kernel(widened) : 0;
                // An empty texel between four filled ones takes whatever is nearest, within five radii; at the border
                // of the image within two, where texels are large.
                const double farthest = outside > 0 && fineSize > 8 ? 4 : 25;
                const bool gap = around.size() + outside == 4 && !fine.ref(x, y).valid && least < farthest;
                // So does what shines through from behind all four.
                const bool shines = around.size() == 4 && fine.ref(x, y).valid && fine.ref(x, y).depth > hindmost;
                // Leaves are no surface: between them it stays open.
                const bool isSolid = std::all_of(around.begin(), around.end(), [&](const auto& a) {
                    return !a.first->isLeaf(pixelsAt(view, a.first->depth));
                });
                const bool between = least >= 1 && isSolid && (gap || shines);
                const double weight = std::max(reached, between && rho2 <= least ? 0.01 : 0.0);
                if (weight > 0) list.push_back({s, weight});
            }
            if (list.empty()) continue;
            double back = 0;
            const Sample merged = blend(list, back, view);
            Sample& own = fine.ref(x, y);
            if (!own.valid || own.depth > back || glm::length(own.centre - centre) > std::max(own.radius, fineSize))
                own = merged;
        }
}

class ReferenceBackend final : public render::DrawsAtOnce {
  public:
    ReferenceBackend(Executor& executor, const Variation& variation) : executor_(executor), variation_(variation) {}
    std::string name() const override { return "reference"; }
    std::string device() const override { return "fp64 reference, scalar"; }
    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override {
        chunks_[uint64_t{key.source} << 32 | key.chunk] = std::move(chunk);
        return {};
    }
    void evict(streaming::ChunkKey key) override { chunks_.erase(uint64_t{key.source} << 32 | key.chunk); }

  private:
    void draw(const render::RenderRequest& request, render::Image& image) override {
        const double start = nowSeconds();
        const render::DrawList& draws = *request.draws;
        const render::Reconstruction& mode = render::reconstructionOf(request.mode);
        Level level0 = projectAll(draws, mode);
        projectOtherKinds(draws, chunks_, level0);
        if (mode.blendsSplats && !variation_.showDiscs) blendDiscs(draws, placedDiscs(draws, chunks_), level0);
        const Level own = level0;
        if (mode.hasPyramid) reconstruct(level0, draws.view);
        if (mode.smoothsSplats) smooth(draws, level0);
        finishTubes(draws.view, level0);
        if (request.isOfCasters) {
            showCasters(draws, level0, image);
            return;
        }
        applyOnSurface(draws, level0);
        shade(draws, own, level0, request.wantDepthAndNormal, image);
        times_ = {{"reference", (nowSeconds() - start) * 1e3}};
    }
    Level projectAll(const render::DrawList& draws, const render::Reconstruction& mode) {
        const lod::View& v = draws.view;
        Level level{static_cast<int>(v.width), static_cast<int>(v.height), {}, {}};
        level.samples.resize(size_t{v.width} * v.height);
        if (mode.blendsSplats && !variation_.showDiscs) return level;
        std::vector<PlacedDisc> discs = placedDiscs(draws, chunks_);
        for (PlacedDisc& d : discs) {
            if (!variation_.hasColours) d.colour = dvec3(0.6);
            if (variation_.lightsPoints) d.colour *= lightOn(towardsEye(d, v), draws.frame, false);
        }
        if (variation_.showDiscs) {
            variation_.showDiscs(draws, discs, level);
            return level;
        }
        if (mode.fillsSplats) {
            showSplats(draws, discs, level);
            return level;
        }
        std::vector<PlacedDisc> wide;
        for (const PlacedDisc& d : discs) {
            if (mode.hasPyramid && d.mayBeWide && isWide(v, d))
                wide.push_back(d);
            else if (d.centre.z > v.nearPlane)
                project(draws, d, mode.hasPyramid, level);
        }
        showWide(draws, wide, level);
        return level;
    }

    /// Colours, normals and materials of wide discs from what pull and push make of them alone, where that lies within
    /// twice its thickness of the disc.
    void smooth(const render::DrawList& draws, Level& level) {
        const lod::View& v = draws.view;
        Level mean{level.width, level.height, {}, {}};
        mean.samples.resize(level.samples.size());
        std::vector<PlacedDisc> wide;
        bool isAny = false;
        for (const PlacedDisc& d : placedDiscs(draws, chunks_)) {
            if (!d.isSmooth) continue;
            isAny = true;
            if (d.mayBeWide && isWide(v, d))
                wide.push_back(d);
            else if (d.centre.z > v.nearPlane)
                project(draws, d, true, mean);
        }
        if (!isAny) return;
        showWide(draws, wide, mean);
        reconstruct(mean, v);
        for (size_t i = 0; i < level.samples.size(); ++i) {
            Sample& s = level.samples[i];
            const Sample& m = mean.samples[i];
            const dvec2 at(double(i % v.width) + 0.5, double(i / v.width) + 0.5);
            if (!s.valid || !s.isSmooth || !m.valid || std::abs(depthAt(m, at, v) - s.depth) > 2 * m.thickness)
                continue;
            s.perp = dvec2(rotationToZ(viewRay(v, at).sight()) * normalAt(m, at, v));
            s.colour = m.colour;
            s.materialShare = m.materialShare;
            s.metallic = m.metallic;
            s.roughness = m.roughness;
            if (m.letsLightThrough(pixelsAt(v, m.depth)))
                s.thickness = kLeafThickness * s.radius / pixelsAt(v, s.depth);
        }
    }

    static dvec3 towardsEye(const PlacedDisc& d, const lod::View& v) {
        return glm::dot(d.normal, sightOf(v, d.centre)) > 0 ? -d.normal : d.normal;
    }

    /// A disc to the pixel of its centre, or, where `besideToo` and it reaches in, to one at the border.
    static void project(const render::DrawList& draws, const PlacedDisc& d, bool besideToo, Level& level) {
        const lod::View& v = draws.view;
        const dvec3 c = d.centre;
        const dvec2 p = imageOf(v, c);
        const double pixels = pixelsAt(v, c.z);
        const dvec3 toPoint = sightOf(v, c);
        // A stray point hides no more of the picture than this.
        const bool isScattered = (d.flags & shared::kFlagScattered) != 0;
        const double most = isScattered ? std::max(v.height / 128.0, 4.0) : 16384.0;
        const double radius = std::clamp(d.radius * pixels, double(draws.frame.minimumRadius), most);
        const dvec2 at(std::clamp(p.x, 0.0, v.width - 1.0), std::clamp(p.y, 0.0, v.height - 1.0));
        const bool isInside = p.x >= 0 && p.y >= 0 && p.x < v.width && p.y < v.height;
        const double beside = glm::length(p - at) / (1 + radius * std::min(1.25 / toPoint.z, 15.0));
        if (!isInside && !(besideToo && beside < 1)) return;
        // There, of one surface's splats that which reaches in farthest is kept.
        const double key = c.z + (isInside ? 0.0 : beside * beside * radius / pixels);
        Sample& s = isInside ? level.ref(toWhole<int>(p.x), toWhole<int>(p.y))
                             : level.ref(toWhole<int>(at.x), toWhole<int>(at.y));
        if (s.valid && s.key <= key) return;
        const double facing = glm::dot(d.normal, toPoint);
        s.valid = true;
        s.depth = c.z;
        s.key = key;
        s.centre = p;
        s.radius = radius;
        s.thickness = s.radius / pixels * (0.25 + std::sqrt(std::max(0.0, 1 - facing * facing)));
        if ((d.flags & shared::kFlagLeaf) != 0) s.thickness = kLeafThickness * s.radius / pixels;
        s.perp = dvec2(rotationToZ(toPoint) * (facing > 0 ? -d.normal : d.normal));
        s.colour = d.colour;
        setMaterial(s, d.material);
    }

    void reconstruct(Level& level0, const lod::View& view) const {
        double largest = 0;
        for (const Sample& s : level0.samples) largest = std::max(largest, s.valid ? s.radius : 0.0);
        const int count = 1 + toWhole<int>(std::ceil(std::log2(std::max(2.0, 2 * largest))));
        std::vector<Level> pyramid{level0};
        while (static_cast<int>(pyramid.size()) < count && (pyramid.back().width > 1 || pyramid.back().height > 1))
            pyramid.push_back(pullLevel(pyramid.back(), std::ldexp(1.0, static_cast<int>(pyramid.size()) - 1), view,
                                        variation_.pullsContained));
        for (size_t l = pyramid.size() - 1; l-- > 0;)
            pushLevel(pyramid[l], pyramid[l + 1], std::ldexp(1.0, static_cast<int>(l)), view, variation_.kernel);
        level0 = std::move(pyramid[0]);
        for (Sample& s : level0.samples) s.isMerged = pyramid.size() > 1;
    }

    void shade(const render::DrawList& draws, const Level& own, const Level& level, bool wantAll,
               render::Image& image) {
        const lod::View& v = draws.view;
        const shared::FrameConstants& f = draws.frame;
        const size_t pixels = size_t{v.width} * v.height;
        image.width = v.width;
        image.height = v.height;
        image.rgba.resize(pixels);
        image.depth.assign(wantAll ? pixels : 0, 0.0f);
        image.normal.assign(wantAll ? pixels * 3 : 0, 0.0f);
        image.linear.assign(wantAll ? pixels * 3 : 0, 0.0f);
        executor_.parallelFor(pixels, 4096, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) {
                const Sample& s = level.samples[i];
                const dvec2 middle(double(i % v.width) + 0.5, double(i / v.width) + 0.5);
                const dvec3 behind = behindAll(draws, middle);
                Seen seen{behind, dvec3(0), 0};
                if (s.valid) {
                    seen = seenOf(draws, own.samples[i], s, i);
                    const auto second = level.seconds.find(i);
                    if (second != level.seconds.end()) {
                        const Sample& beside = second->second.sample;
                        const Seen other = seenOf(draws, beside, beside, i);
                        const dvec3 mixed = glm::mix(seen.colour, other.colour, second->second.share);
                        if (second->second.isFront) seen = other;
                        const bool isOfGeometry =
                            f.debugView == shared::kDebugHoles || f.debugView == shared::kDebugNormals;
                        if (!isOfGeometry) seen.colour = mixed;
                    }
                    seen.colour = applyOnSent(draws, seen.colour, middle, seen.depth);
                    // Of a pixel that is less than half covered the ray meets nothing.
                    if (wantAll && s.coverage >= 0.5) {
                        image.depth[i] = static_cast<float>(seen.depth);
                        const dvec3 n = seen.normal, world = v.right * n.x + v.down * n.y + v.forward * n.z;
                        for (int c = 0; c < 3; ++c)
                            image.normal[i * 3 + static_cast<size_t>(c)] = static_cast<float>(world[c]);
                    }
                }
                const double share = s.coverage * s.opacity;
                const dvec3 colour = glm::mix(behind, seen.colour, share);
                if (wantAll)
                    for (int c = 0; c < 3; ++c)
                        image.linear[i * 3 + static_cast<size_t>(c)] = static_cast<float>(colour[c]);
                image.rgba[i] = encodeSrgb(colour.x) | encodeSrgb(colour.y) << 8 | encodeSrgb(colour.z) << 16 |
                                (s.valid ? static_cast<uint32_t>(std::lround(255 * share)) << 24 : 0u);
            }
        });
    }

    /// What a light meets first: depths, and what leaves let through of it, in bytes.
    static void showCasters(const render::DrawList& draws, const Level& level, render::Image& image) {
        const lod::View& v = draws.view;
        image.width = v.width;
        image.height = v.height;
        image.rgba.assign(level.samples.size(), 0);
        image.depth.assign(level.samples.size(), 0.0f);
        image.normal.clear();
        image.linear.clear();
        for (size_t i = 0; i < level.samples.size(); ++i) {
            const Sample& s = level.samples[i];
            if (!s.valid) continue;
            image.depth[i] =
                static_cast<float>(depthAt(s, dvec2(double(i % v.width) + 0.5, double(i / v.width) + 0.5), v));
            if (!s.letsLightThrough(pixelsAt(v, s.depth))) continue;
            constexpr double kGlow = 0.6;
            const glm::dvec3 c = glm::round(glm::clamp(s.colour * kGlow, dvec3(0), dvec3(1)) * 255.0);
            image.rgba[i] =
                toWhole<uint32_t>(c.x) | toWhole<uint32_t>(c.y) << 8 | toWhole<uint32_t>(c.z) << 16 | 0xff000000u;
        }
    }

    struct Seen {
        dvec3 colour, normal;
        double depth;
    };
    /// What a surface at pixel `i` sends to the eye. `o`: before reconstruction.
    Seen seenOf(const render::DrawList& draws, const Sample& o, const Sample& s, size_t i) const {
        const lod::View& v = draws.view;
        const shared::FrameConstants& f = draws.frame;
        const dvec2 p(double(i % v.width) + 0.5, double(i / v.width) + 0.5);
        const dvec3 n = normalAt(s, p, v);
        const double depth = depthAt(s, p, v);
        dvec3 colour = s.colour;
        if (f.debugView == shared::kDebugHoles) {
            colour = !o.valid ? dvec3(1, 0.3, 0.02) : o.depth != s.depth ? dvec3(0.02, 0.1, 0.9) : dvec3(0.2);
        } else if (f.debugView == shared::kDebugNormals) {
            colour = 0.5 + 0.5 * dvec3(n.x, -n.y, -n.z);
        } else if (f.debugView == shared::kDebugNone) {
            colour = sentBy(s, n, viewRay(v, p).at(depth), draws, isLit(f)) + s.mirrored;
        }
        return {colour, n, depth};
    }

    bool isLit(const shared::FrameConstants& f) const {
        return (f.shade & shared::kShadeLit) != 0 && !variation_.lightsPoints;
    }

    Executor& executor_;
    const Variation variation_;
    Chunks chunks_;
};

}  // namespace

glm::dmat3 rotationToZ(const dvec3& v) {
    const dvec3 axis(v.y, -v.x, 0);  // v x z
    const double c = v.z;
    const glm::dmat3 k(dvec3(0, axis.z, -axis.y), dvec3(-axis.z, 0, axis.x), dvec3(axis.y, -axis.x, 0));
    return glm::dmat3(1) + k + k * k * (1 / (1 + c));
}

dvec3 debugColour(const shared::FrameConstants& f, const lod::Node& node, const lod::CutDraw& cut) {
    const double t = f.debugView == shared::kDebugLevel
                         ? (node.level % 8) / 7.0
                         : std::clamp((std::log2(std::max(1e-6, double(cut.errorPixels))) + 3) / 6, 0.0, 1.0);
    const auto hat = [&](double middle) { return std::clamp(1.5 - std::abs(4 * t - middle), 0.0, 1.0); };
    return {hat(3), hat(2), hat(1)};
}

std::unique_ptr<render::Backend> makeReferenceBackend(Executor& executor) {
    return std::make_unique<ReferenceBackend>(executor, Variation{});
}

std::unique_ptr<render::Backend> makeReferenceBackend(Executor& executor, const Variation& variation) {
    return std::make_unique<ReferenceBackend>(executor, variation);
}

}  // namespace stipple::reference
