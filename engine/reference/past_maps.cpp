// Shadow once more, in fp64: a place is turned into the world and from there into each light's view, whose texels are
// squares with a depth each.
#include "engine/reference/shadow.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/reference/decode.h"
#include "engine/render/shadow_frame.h"

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

constexpr double kTurn = 2 * 3.14159265358979323846;

/// The plane of a surface in the view of a light.
class Receiver {
  public:
    Receiver(const render::DrawList& draws, const render::ShadowMapOf& map, const dvec3& point, const dvec3& normal)
        : map_(map), view_(map.of.view) {
        const lod::View& camera = draws.view;
        const glm::dmat3 world(camera.right, camera.down, camera.forward);
        const dvec3 n = world * normal, at = camera.eye + world * point - view_.eye;
        place_ = {glm::dot(at, view_.right), glm::dot(at, view_.down), glm::dot(at, view_.forward)};
        const dvec3 nl{glm::dot(n, view_.right), glm::dot(n, view_.down), glm::dot(n, view_.forward)};
        const dvec3 ray = view_.isOrthographic ? dvec3(0, 0, 1) : place_ / place_.z;
        image = imageOf(view_, place_);
        // Sixteen angles in a pattern of 4 x 4 pixels, of ordered dither, four to each quarter; frames of a series turn
        // them further.
        const glm::ivec2 pixel = glm::ivec2(glm::floor(imageOf(camera, point))) & 3;
        constexpr int kOrder[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
        const int number = kOrder[pixel.y][pixel.x], quarter = (number & 1) + (number & 2);
        const double within = (number / 4 + (draws.frame.coverageSeed * 2654435769u >> 24) / 256.0) / 4;
        turn_ = kTurn / 4 * quarter + std::atan2(within, 1 - within);
        // cos of the angle between the plane's normal and the light's ray, and how fast depth changes from texel to
        // texel; a plane that is seen nearly edge-on is turned.
        double facing = glm::dot(nl, ray) / glm::length(ray);
        const double stated = std::max(std::abs(facing), 0.2);
        if (std::abs(facing) < 1.0 / 16) facing = facing < 0 ? -1.0 / 16 : 1.0 / 16;
        slope_ = -dvec2(nl) / (facing * glm::length(ray) * pixelsAt(view_, place_.z));
        const double perDepth = view_.isOrthographic ? 1 : place_.z,
                     surface = draws.shadowMaps->surfaceError / pixelsAt(camera, point.z),
                     rounding = map.depthStep + (std::abs(point.x) + std::abs(point.y) + std::abs(point.z)) / (1 << 21);
        bias_ = (map.casterError * perDepth + surface) / stated + rounding;
        isOn = (view_.isOrthographic || place_.z > 0) && image.x >= 0 && image.y >= 0 && image.x < view_.width &&
               image.y < view_.width && glm::dot(point, point) <= map.of.reach * map.of.reach;
    }

    dvec3 light() const {
        const double penumbra = map_.of.size > 0 ? widthOfPenumbra() : 0;
        if (penumbra < 0) return dvec3(1);
        if (penumbra == 0) return around(image);
        dvec3 sum(0);
        for (int k = 0; k < 16; ++k) sum += around(image + penumbra * onDisc(k, 0.5));
        return sum / 16.0;
    }

    dvec2 image;  ///< texels
    bool isOn = false;

  private:
    dvec2 onDisc(int k, double off) const {
        const double angle = turn_ + k * kTurn / 2 * (3 - std::sqrt(5.0));
        return std::sqrt((k + off) / 16) * dvec2(std::cos(angle), std::sin(angle));
    }
    size_t texel(int x, int y) const {
        return static_cast<size_t>(y) * shared::shadowStride(view_.width) + static_cast<size_t>(x);
    }
    /// Depth of what hides the plane at a texel.
    std::optional<double> casterAt(int x, int y) const {
        const double plane = place_.z - bias_ + glm::dot(slope_, dvec2(x + 0.5, y + 0.5) - image),
                     depth = map_.of.centreDepth + double{map_.texels->depth[texel(x, y)]};
        return depth < plane ? std::optional(depth) : std::nullopt;
    }
    dvec3 lightAt(int x, int y) const {
        if (!casterAt(x, y)) return dvec3(1);
        if (map_.texels->through.empty()) return dvec3(0);
        const uint32_t word = map_.texels->through[texel(x, y)];
        return dvec3(word & 255u, word >> 8 & 255u, word >> 16 & 255u) / 255.0;
    }
    dvec3 around(dvec2 at) const {
        const double last = view_.width - 1.0;
        at = glm::clamp(at - 0.5, dvec2(0), dvec2(last));
        const dvec2 low = glm::min(glm::floor(at), dvec2(last - 1)), part = at - low;
        const int x = static_cast<int>(low.x), y = static_cast<int>(low.y);
        return glm::mix(glm::mix(lightAt(x, y), lightAt(x + 1, y), part.x),
                        glm::mix(lightAt(x, y + 1), lightAt(x + 1, y + 1), part.x), part.y);
    }
    /// Less than 0: nothing hides the light.
    double widthOfPenumbra() const {
        const double most = view_.width / 16.0, nearest = map_.of.centreDepth + map_.nearest;
        const auto seen = [&](double caster) {
            const double apart = std::max(place_.z - caster, 0.0) * map_.of.size * view_.focalPixels;
            return std::min(view_.isOrthographic ? apart : apart / (place_.z * caster), most);
        };
        const double search = seen(nearest);
        double sum = 0;
        int count = 0;
        for (int k = 0; k < 16; ++k) {
            const dvec2 at = glm::floor(glm::clamp(image + search * onDisc(k, 0), dvec2(0), dvec2(view_.width - 1.0)));
            if (const auto caster = casterAt(static_cast<int>(at.x), static_cast<int>(at.y))) {
                sum += *caster;
                ++count;
            }
        }
        if (count == 0) return search < 1 ? 0 : -1;
        return seen(sum / count);
    }

    const render::ShadowMapOf& map_;
    const lod::View& view_;
    dvec3 place_;
    dvec2 slope_;
    double bias_ = 0, turn_ = 0;
};

}  // namespace

dvec3 pastMaps(const render::DrawList& draws, size_t light, const dvec3& point, const dvec3& n) {
    if (!draws.shadowMaps || draws.shadowSlotOf[light] == 0) return dvec3(1);
    for (const render::ShadowMapOf& map : draws.shadowMaps->maps) {
        if (1 + map.of.slot != draws.shadowSlotOf[light]) continue;
        const Receiver receiver(draws, map, point, n);
        if (receiver.isOn) return receiver.light();
    }
    return dvec3(1);
}

}  // namespace stipple::reference
