// A layer of glass once more, in fp64 and in world space: rays by the vector form of Snell's law in angles, Fresnel by
// Schlick, what is behind from the pictures themselves.
#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/reference/decode.h"
#include "engine/reference/effects/effects.h"
#include "engine/reference/surface.h"
#include "engine/render/layers.h"

namespace stipple::reference {
namespace {

using glm::dmat3;
using glm::dvec2;
using glm::dvec3;
using glm::dvec4;

/// Light times cover, and cover, in means of two by two.
struct Means {
    int width, height;
    std::vector<dvec4> texels;
    dvec4 at(int x, int y) const {
        return texels[static_cast<size_t>(std::clamp(y, 0, height - 1)) * static_cast<size_t>(width) +
                      static_cast<size_t>(std::clamp(x, 0, width - 1))];
    }
    dvec4 look(dvec2 p) const {
        p = glm::clamp(p - 0.5, dvec2(0), dvec2(width - 1, height - 1));
        const dvec2 low = glm::floor(p), part = p - low;
        const int x = static_cast<int>(low.x), y = static_cast<int>(low.y);
        return glm::mix(glm::mix(at(x, y), at(x + 1, y), part.x), glm::mix(at(x, y + 1), at(x + 1, y + 1), part.x),
                        part.y);
    }
};

std::vector<Means> meansOf(const render::Image& image) {
    std::vector<Means> out{{static_cast<int>(image.width), static_cast<int>(image.height), {}}};
    for (size_t i = 0; i < image.depth.size(); ++i)
        out[0].texels.push_back(image.depth[i] > 0
                                    ? dvec4(image.linear[3 * i], image.linear[3 * i + 1], image.linear[3 * i + 2], 1)
                                    : dvec4(0));
    while (out.size() < 16 && (out.back().width > 1 || out.back().height > 1)) {
        const Means& fine = out.back();
        Means half{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
        for (int y = 0; y < half.height; ++y)
            for (int x = 0; x < half.width; ++x)
                half.texels.push_back(0.25 * (fine.at(2 * x, 2 * y) + fine.at(2 * x + 1, 2 * y) +
                                              fine.at(2 * x, 2 * y + 1) + fine.at(2 * x + 1, 2 * y + 1)));
        out.push_back(std::move(half));
    }
    return out;
}

/// The direction behind an interface whose normal is against `d`; none: all is reflected.
std::optional<dvec3> snell(const dvec3& d, const dvec3& n, double from, double to) {
    const double incoming = std::acos(std::clamp(-glm::dot(n, d), 0.0, 1.0));
    const double sine = from / to * std::sin(incoming);
    if (sine > 1) return {};
    const dvec3 along = d + n * std::cos(incoming);
    const dvec3 sideways = glm::length(along) > 1e-12 ? glm::normalize(along) : dvec3(0);
    return sideways * sine - n * std::sqrt(1 - sine * sine);
}

class Glass {
  public:
    Glass(const render::DrawList& draws)
        : draws_(draws), layer_(*draws.layer), view_(draws.view), toWorld_(view_.right, view_.down, view_.forward) {
        if (layer_.behind == nullptr) return;
        means_ = meansOf(*layer_.behind);
        for (const float d : layer_.behind->depth) farthest_ = std::max(farthest_, double{d} - draws.eyeAdvanced);
    }

    dvec3 shade(const Sample& s, const dvec3& n, const dvec3& point) const {
        const render::WorldOptic& o = layer_.optics.at(s.blends() ? 0 : s.optic != 0 ? s.optic : layer_.pointOptic);
        const shared::FrameConstants& f = draws_.frame;
        const double rough = s.optic == 0 && !s.hasMaterial() ? layer_.plainRoughness : s.roughness;
        const dvec3 d = sightOf(view_, point);
        const double c = std::clamp(-glm::dot(n, d), 1e-3, 1.0), through = o.transmission * (1 - s.metallic);
        const dvec3 straight = glm::mix(o.straightOn, s.colour, s.metallic);
        const dvec3 grazing = glm::max(straight, dvec3((1 - rough) * glm::mix(o.most, 1.0, s.metallic)));
        const dvec3 share = straight + (grazing - straight) * std::pow(1 - c, 5);
        const dvec3 mirror = d + 2 * c * n, up(f.skyDirection);
        dvec3 seen(0.25 + 0.15 * glm::dot(glm::mix(mirror, n, rough), up)), around(0.25 + 0.15 * glm::dot(n, up));
        if (draws_.environment) {
            seen = surroundings(mirror, rough);
            around = irradianceOf(*draws_.environment, toMap(n));
        }
        Sample opaque = s;
        opaque.roughness = rough;
        opaque.colour *= (1 - s.metallic) - through;
        opaque.metallic = 0;
        opaque.thickness = 1e30;  // no leaf
        opaque.isRound = true;
        dvec3 sum = lightsOn(opaque, n, point, straight, draws_) +
                    double(f.ambient) * s.occlusion * (opaque.colour * around + share * seen);
        if (through > 0) sum += through * (1.0 - share) * s.colour * comesThrough(o, point, d, n, c, rough);
        return sum + s.emissive;
    }

  private:
    dvec3 toMap(const dvec3& d) const {
        const shared::FrameConstants& f = draws_.frame;
        return {glm::dot(dvec3(f.environmentX), d), glm::dot(dvec3(f.environmentY), d),
                glm::dot(dvec3(f.environmentZ), d)};
    }
    dvec3 surroundings(const dvec3& d, double rough) const {
        return draws_.environment ? mirrored(*draws_.environment, toMap(d), rough) : dvec3(draws_.frame.background);
    }
    bool isOnPicture(const dvec3& p, dvec2& at) const {
        if (!view_.isOrthographic && !(p.z > 0)) return false;
        at = imageOf(view_, p);
        return at.x >= 0 && at.y >= 0 && at.x < view_.width && at.y < view_.height;
    }
    dvec3 behindAt(const dvec2& at, double rough, const dvec3& missed) const {
        const double lod = std::clamp(rough * std::log2(double(std::max(view_.width, view_.height))), 0.0,
                                      static_cast<double>(means_.size()) - 1);
        const auto level = static_cast<size_t>(lod), next = std::min(level + 1, means_.size() - 1);
        const auto look = [&](size_t l) { return means_[l].look(at / std::ldexp(1.0, static_cast<int>(l))); };
        const dvec4 t = glm::mix(look(level), look(next), lod - static_cast<double>(level));
        return dvec3(t) + (1 - t.w) * missed;
    }
    bool isBehind(const dvec3& p, const dvec2& at) const {
        const float depth = layer_.behind->depth[static_cast<size_t>(at.y) * view_.width + static_cast<size_t>(at.x)];
        return depth > 0 && p.z > depth - draws_.eyeAdvanced;
    }

    dvec3 leaving(const dvec3& p, const dvec3& d, double rough) const {
        const dvec3 missed = surroundings(d, rough);
        if (means_.empty() || !(farthest_ > 0) || !(p.z > 0)) return missed;
        double reach = 8 * farthest_;
        if (d.z > 1e-6) reach = std::min(reach, (1.001 * farthest_ - p.z) / d.z);
        if (d.z < -1e-6) reach = std::min(reach, -0.9 * p.z / d.z);
        if (!(reach > 0)) return missed;
        // Even steps on the picture.
        const dvec3 end = p + reach * d;
        const auto placeAt = [&](double share) {
            const double s = view_.isOrthographic ? share : (share / end.z) / ((1 - share) / p.z + share / end.z);
            return p + s * reach * d;
        };
        bool wasInFront = false;
        for (int k = 0; k <= 32; ++k) {
            dvec2 at;
            const dvec3 q = placeAt(k / 32.0);
            if (!isOnPicture(q, at)) return missed;
            const bool isHidden = isBehind(q, at);
            if (isHidden && wasInFront) {
                double low = (k - 1) / 32.0, high = k / 32.0;
                for (int h = 0; h < 4; ++h) {
                    const dvec3 middle = placeAt((low + high) / 2);
                    isOnPicture(middle, at);
                    (isBehind(middle, at) ? high : low) = (low + high) / 2;
                }
                isOnPicture(placeAt(high), at);
                return behindAt(at, rough, missed);
            }
            wasInFront = !isHidden;
        }
        return missed;
    }

    struct Back {
        double depth = 0;
        dvec3 normal{0};  ///< world
    };
    /// In the view from behind; `world`: a place.
    double depthFromBehind(const dvec3& world) const {
        return glm::dot(world - layer_.backView.eye, layer_.backView.forward);
    }
    Back backAt(const dvec3& world) const {
        const render::Image& image = *layer_.back;
        const lod::View& v = layer_.backView;
        const dvec2 p = dvec2(glm::dot(world - v.eye, v.right), glm::dot(world - v.eye, v.down)) * v.focalPixels +
                        0.5 * image.width - 0.5;
        const double last = image.width - 1.0;
        if (!(p.x >= 0 && p.y >= 0 && p.x < last && p.y < last)) return {};
        const auto place = [&](double x, double y) {
            return static_cast<size_t>(y) * image.width + static_cast<size_t>(x);
        };
        if (!(image.depth[place(std::floor(p.x + 0.5), std::floor(p.y + 0.5))] > 0)) return {};
        const dvec2 low = glm::floor(p);
        Back sum;
        double weights = 0;
        for (int y = 0; y < 2; ++y)
            for (int x = 0; x < 2; ++x) {
                const size_t i = place(low.x + x, low.y + y);
                const double w = (1 - std::abs(low.x + x - p.x)) * (1 - std::abs(low.y + y - p.y));
                if (!(image.depth[i] > 0)) continue;
                weights += w;
                sum.depth += w * image.depth[i];
                sum.normal += w * dvec3(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            }
        return {sum.depth / weights, glm::normalize(sum.normal)};
    }

    /// Where a ray inside the body (world) leaves it: the length of the way, the outward normal.
    std::optional<std::pair<double, dvec3>> exitOf(const dvec3& from, const dvec3& t) const {
        const dvec3 to = layer_.bodyCentre - from;
        const double along = glm::dot(to, t),
                     reach = along + std::sqrt(std::max(0.0, along * along - glm::dot(to, to) +
                                                                 layer_.bodyRadius * layer_.bodyRadius));
        if (!(reach > 0)) return {};
        const auto inside = [&](double s) {
            const Back back = backAt(from + s * t);
            return back.depth > 0 ? depthFromBehind(from + s * t) - back.depth : -1e30;
        };
        double low = 0, high = reach, lowInside = 0, highInside = -1e30;
        bool isOut = false;
        const auto narrow = [&](double s) {
            const double in = inside(s);
            (in < 0 ? high : low) = s;
            (in < 0 ? highInside : lowInside) = in;
            return in < 0;
        };
        for (int k = 1; k <= 16 && !isOut; ++k) isOut = narrow(reach * k / 16);
        for (int h = 0; h < 4; ++h) narrow((low + high) / 2);
        double length = low;
        if (highInside > -1e29 && lowInside > 0) length += (high - low) * lowInside / (lowInside - highInside);
        Back back = backAt(from + length * t);
        if (!(back.depth > 0)) back = backAt(from + low * t);
        if (!isOut || !(back.depth > 0) || !(length > 0)) return {};
        return std::pair{length, back.normal};
    }

    dvec3 comesThrough(const render::WorldOptic& o, const dvec3& p, const dvec3& d, const dvec3& n, double c,
                       double roughness) const {
        const double ior = std::max(o.ior, 1.0), rough = roughness * std::clamp(2 * ior - 2, 0.0, 1.0);
        const bool isThin = !(o.thickness > 0);
        const dvec3 facing = c > 1e-3 ? n : glm::normalize(n - (glm::dot(n, d) + c) * d);
        const dvec3 t = isThin ? d : *snell(d, facing, 1, ior);
        const dvec3 missed = surroundings(t, rough);
        const double whole = isThin ? 0 : o.thickness;
        if (layer_.way == shared::kRefractEnvironment) return missed * glm::exp(-o.absorption * whole);
        if (layer_.way == shared::kRefractObject && !isThin && layer_.back != nullptr)
            if (const auto exit = exitOf(view_.eye + toWorld_ * p, toWorld_ * t))
                return twice(o, p + exit->first * t, t, glm::transpose(toWorld_) * exit->second, rough) *
                       glm::exp(-o.absorption * exit->first);
        dvec2 at;
        const bool isSeen = isOnPicture(p + whole * t, at) && !means_.empty();
        return (isSeen ? behindAt(at, rough, missed) : missed) * glm::exp(-o.absorption * whole);
    }
    /// At the second interface; `n`: outwards.
    dvec3 twice(const render::WorldOptic& o, const dvec3& p, const dvec3& t, const dvec3& n, double rough) const {
        const double ior = std::max(o.ior, 1.0), c = std::clamp(glm::dot(t, n), 1e-3, 1.0);
        const dvec3 inner = surroundings(t - 2 * c * n, rough);
        const double sine = ior * std::sqrt(1 - c * c);
        if (sine > 1) return inner;
        const double r0 = std::pow((ior - 1) / (ior + 1), 2), outer = std::sqrt(1 - sine * sine);
        const double back = r0 + (1 - r0) * std::pow(1 - outer, 5);
        const dvec3 out = ior * t + (outer - ior * c) * n;
        return back * inner + (1 - back) * leaving(p, out, rough);
    }

    const render::DrawList& draws_;
    const render::LayerInput& layer_;
    const lod::View& view_;
    const dmat3 toWorld_;
    std::vector<Means> means_;
    double farthest_ = 0;
};

void onSurface(const render::DrawList& draws, Level& level) {
    const Glass glass(draws);
    const auto shade = [&](Sample& s, const dvec2& at) {
        if (!s.valid || (s.optic == 0 && draws.layer->pointOptic == 0)) return;
        s.colour = glass.shade(s, normalAt(s, at, draws.view), viewRay(draws.view, at).at(depthAt(s, at, draws.view)));
        s.isTriangle = s.isUnlit = true;  // what is shown is this
    };
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) shade(level.ref(x, y), dvec2(x + 0.5, y + 0.5));
    const auto width = static_cast<size_t>(level.width);
    for (auto& [i, second] : level.seconds)
        shade(second.sample, dvec2(static_cast<double>(i % width) + 0.5, static_cast<double>(i / width) + 0.5));
}

}  // namespace

constinit const RestatedEffect refractionRestated{.onSurface = onSurface};

}  // namespace stipple::reference
