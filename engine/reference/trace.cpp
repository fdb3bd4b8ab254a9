// Rays against the discs of all leaves, through a bounding volume hierarchy (median split of the longest axis).
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/base/queue.h"
#include "engine/reference/decode.h"
#include "engine/reference/reference.h"

namespace stipple::reference {
namespace {

using glm::dvec3;

struct Box {
    dvec3 lo{std::numeric_limits<double>::max()}, hi{std::numeric_limits<double>::lowest()};
    void add(const Box& o) {
        lo = glm::min(lo, o.lo);
        hi = glm::max(hi, o.hi);
    }
};

struct TreeNode {
    Box box;
    uint32_t begin = 0, end = 0, left = 0;  ///< left != 0: children left, left + 1
};

class DiscTree {
  public:
    explicit DiscTree(std::vector<Disc> discs) : discs_(std::move(discs)) {
        nodes_.push_back({{}, 0, static_cast<uint32_t>(discs_.size()), 0});
        for (size_t i = 0; i < nodes_.size(); ++i) {
            TreeNode node = nodes_[i];
            for (uint32_t d = node.begin; d < node.end; ++d) node.box.add(boxOf(discs_[d]));
            if (node.end - node.begin > 4) {
                const dvec3 size = node.box.hi - node.box.lo;
                const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
                const uint32_t middle = (node.begin + node.end) / 2;
                std::nth_element(discs_.begin() + node.begin, discs_.begin() + middle, discs_.begin() + node.end,
                                 [axis](const Disc& a, const Disc& b) { return a.position[axis] < b.position[axis]; });
                node.left = static_cast<uint32_t>(nodes_.size());
                nodes_.push_back({{}, node.begin, middle, 0});
                nodes_.push_back({{}, middle, node.end, 0});
            }
            nodes_[i] = node;
        }
    }

    /// Calls hit(disc, t, rho2) for each disc that origin + t direction meets with near < t < limit(); hit may lower
    /// limit.
    template <typename Hit>
    void visit(const dvec3& origin, const dvec3& direction, double nearT, double& limit, const Hit& hit) const {
        const dvec3 inverse = 1.0 / direction;
        std::array<uint32_t, 64> stack{};
        size_t depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            const TreeNode& node = nodes_[stack[--depth]];
            const dvec3 a = (node.box.lo - origin) * inverse, b = (node.box.hi - origin) * inverse;
            const dvec3 lo = glm::min(a, b), hi = glm::max(a, b);
            const double enter = std::max({lo.x, lo.y, lo.z, nearT}), leave = std::min({hi.x, hi.y, hi.z, limit});
            if (!(enter <= leave)) continue;
            if (node.left != 0) {
                // Nearer child last, so that it is taken first.
                const bool leftFirst = glm::dot(nodes_[node.left].box.lo + nodes_[node.left].box.hi -
                                                    nodes_[node.left + 1].box.lo - nodes_[node.left + 1].box.hi,
                                                direction) < 0;
                stack[depth++] = leftFirst ? node.left + 1 : node.left;
                stack[depth++] = leftFirst ? node.left : node.left + 1;
                continue;
            }
            for (uint32_t i = node.begin; i < node.end; ++i) {
                const Disc& d = discs_[i];
                const dvec3 n = d.normal == dvec3(0) ? -glm::normalize(d.position - origin) : d.normal;
                const double facing = glm::dot(n, direction);
                if (facing == 0) continue;
                if (facing > 0 && (d.flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) == 0) continue;
                const double t = glm::dot(n, d.position - origin) / facing;
                if (!(t > nearT && t < limit)) continue;
                const dvec3 off = origin + t * direction - d.position;
                const double rho2 = glm::dot(off, off) / (d.radius * d.radius);
                if (rho2 <= 1) hit(d, facing > 0 ? -n : n, t, rho2);
            }
        }
    }

  private:
    static Box boxOf(const Disc& d) {
        dvec3 half(d.radius);
        if (d.normal != dvec3(0))
            half = d.radius * glm::sqrt(glm::max(dvec3(0), 1.0 - d.normal * d.normal)) + dvec3(1e-9 * d.radius);
        return {d.position - half, d.position + half};
    }
    std::vector<Disc> discs_;
    std::vector<TreeNode> nodes_;
};

}  // namespace

Result<render::Image> trace(const lod::Store& store, const lod::View& view, const TraceSettings& settings,
                            Executor& executor) {
    std::vector<Disc> discs;
    discs.reserve(store.description.points);
    for (uint32_t i = 0; i < store.hierarchy.nodes.size(); ++i) {
        if (!store.hierarchy.nodes[i].isLeaf()) continue;
        STIPPLE_ASSIGN(const lod::Chunk chunk, lod::readChunk(store, i));
        for (const shared::PointRecord& r : chunk.records) {
            discs.push_back(decodeDisc(store.hierarchy, store.hierarchy.nodes[i], r));
            discs.back().position -= view.eye;
        }
    }
    const DiscTree tree(std::move(discs));
    shared::FrameConstants f{};
    const glm::dmat3 cameraFromWorld = glm::transpose(glm::dmat3(view.right, view.down, view.forward));
    f.sunDirection = glm::normalize(glm::vec3(-0.45f, -0.55f, -0.7f));
    f.skyDirection = glm::vec3(cameraFromWorld * settings.draw.worldUp);
    render::Image image;
    image.width = view.width;
    image.height = view.height;
    image.rgba.resize(size_t{view.width} * view.height);
    const uint32_t n = std::max(1u, settings.samplesPerAxis);
    executor.parallelFor(view.height, 4, [&](size_t row0, size_t row1) {
        for (size_t y = row0; y < row1; ++y)
            for (uint32_t x = 0; x < view.width; ++x) {
                dvec3 sum(0);
                uint32_t hits = 0;
                for (uint32_t s = 0; s < n * n; ++s) {
                    const double px = x + (s % n + 0.5) / n - 0.5 * view.width,
                                 py = double(y) + (s / n + 0.5) / n - 0.5 * view.height;
                    // Along `forward` this direction has length 1, so t is linear depth.
                    const dvec3 direction =
                        view.forward + (px / view.focalPixels) * view.right + (py / view.focalPixels) * view.down;
                    double front = std::numeric_limits<double>::max(), thickness = 0;
                    const double length = glm::length(direction);
                    tree.visit(dvec3(0), direction, view.nearPlane, front,
                               [&](const Disc& d, const dvec3& normal, double t, double) {
                                   const double m = std::abs(glm::dot(normal, direction)) / length;
                                   front = t;
                                   thickness = d.radius * (0.25 + std::sqrt(std::max(0.0, 1 - m * m)));
                               });
                    if (front == std::numeric_limits<double>::max()) continue;
                    ++hits;
                    double limit = front + thickness, weights = 0;
                    dvec3 colour(0), normals(0);
                    tree.visit(dvec3(0), direction, view.nearPlane, limit,
                               [&](const Disc& d, const dvec3& normal, double, double rho2) {
                                   const double w = (1 - rho2) * (1 - rho2) + 1e-9;
                                   weights += w;
                                   colour += w * d.colour;
                                   normals += w * normal;
                               });
                    colour /= weights;
                    if (settings.draw.lit) colour *= lightOn(glm::normalize(cameraFromWorld * normals), f);
                    sum += colour;
                }
                const double coverage = double(hits) / (n * n);
                const dvec3 c = sum / double(n * n) + (1 - coverage) * dvec3(settings.draw.background);
                image.rgba[y * view.width + x] = encodeSrgb(c.x) | encodeSrgb(c.y) << 8 | encodeSrgb(c.z) << 16 |
                                                 static_cast<uint32_t>(std::lround(coverage * 255)) << 24;
            }
    });
    return image;
}

}  // namespace stipple::reference
