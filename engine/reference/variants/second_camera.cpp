#include <algorithm>
#include <cmath>

#include "engine/reference/decode.h"
#include "engine/reference/variants/variants.h"

namespace stipple::reference {

render::Image seenFrom(const render::Image& image, const lod::View& own, const lod::View& other) {
    using glm::dvec2;
    using glm::dvec3;
    render::Image out;
    out.width = other.width;
    out.height = other.height;
    const size_t pixels = size_t{out.width} * out.height;
    out.rgba.assign(pixels, 0);
    out.depth.assign(pixels, 0);
    for (size_t i = 0; i < image.depth.size(); ++i) {
        if (!(image.depth[i] > 0)) continue;
        const dvec2 at(static_cast<double>(i % image.width) + 0.5, static_cast<double>(i / image.width) + 0.5);
        const dvec3 c = viewRay(own, at).at(double{image.depth[i]});
        const dvec3 world = own.eye + own.right * c.x + own.down * c.y + own.forward * c.z - other.eye;
        const dvec3 there(glm::dot(world, other.right), glm::dot(world, other.down), glm::dot(world, other.forward));
        if (!(there.z > other.nearPlane)) continue;
        const dvec2 p = imageOf(other, there);
        if (!(p.x >= 0 && p.y >= 0 && p.x < out.width && p.y < out.height)) continue;
        const size_t place = static_cast<size_t>(p.y) * out.width + static_cast<size_t>(p.x);
        const auto depth = static_cast<float>(there.z);
        if (out.depth[place] > 0 && out.depth[place] <= depth) continue;
        out.depth[place] = depth;
        out.rgba[place] = image.rgba[i] | 0xff000000u;
    }
    return out;
}

}  // namespace stipple::reference
