// Wide ribbons in wide pictures, twisted, and beside and behind the eye, on every backend: coverage, depth and normals
// against what rays meet of ribbons cut into small triangles (no root of a quadratic, no projected edge).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "engine/reference/decode.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "lod/store/store.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;
using reference::Segment;

/// What one ray meets first.
struct Met {
    double depth = 1e300;
    dvec3 normal{0};  ///< camera space, unit, either way
};

/// One picture of small triangles, by rays: right, down and forward are the axes.
class RayPicture {
  public:
    RayPicture(const lod::View& view, dvec2 shift)
        : view_(view), shift_(shift), met_(size_t{view.width} * view.height) {}

    struct Corner {
        dvec3 place, normal;
    };
    /// A triangle in camera space: rays of all pixels of its box, or of the picture where a corner is beside the eye.
    void add(const Corner& first, const Corner& second, const Corner& third) {
        const dvec3 &a = first.place, &b = second.place, &c = third.place;
        const dvec2 size(view_.width, view_.height);
        dvec2 lo(0), hi = size;
        if (std::max({a.z, b.z, c.z}) <= view_.nearPlane) return;
        if (std::min({a.z, b.z, c.z}) > view_.nearPlane) {
            const auto at = [&](const dvec3& p) { return view_.focalPixels * dvec2(p) / p.z + 0.5 * size; };
            lo = glm::max(lo, glm::min(glm::min(at(a), at(b)), at(c)) - 1.0);
            hi = glm::min(hi, glm::max(glm::max(at(a), at(b)), at(c)) + 1.0);
        }
        const dvec3 n = glm::cross(b - a, c - a);
        for (int y = static_cast<int>(lo.y); y < hi.y; ++y)
            for (int x = static_cast<int>(lo.x); x < hi.x; ++x) {
                const dvec3 ray((dvec2(x, y) + 0.5 + shift_ - 0.5 * size) / view_.focalPixels, 1);
                const double va = glm::dot(ray, glm::cross(b, c)), vb = glm::dot(ray, glm::cross(c, a)),
                             vc = glm::dot(ray, glm::cross(a, b));
                if (!((va >= 0 && vb >= 0 && vc >= 0) || (va <= 0 && vb <= 0 && vc <= 0))) continue;
                const double t = glm::dot(n, a) / glm::dot(n, ray);
                Met& m = met_[static_cast<size_t>(y) * view_.width + static_cast<size_t>(x)];
                if (!(t > view_.nearPlane) || t >= m.depth) continue;
                m = {t, glm::normalize(std::abs(va) * first.normal + std::abs(vb) * second.normal +
                                       std::abs(vc) * third.normal)};
            }
    }
    const Met& at(size_t pixel) const { return met_[pixel]; }

  private:
    const lod::View& view_;
    dvec2 shift_;
    std::vector<Met> met_;
};

struct Figures {
    size_t covered = 0, wrong = 0;  ///< wrong: farther than a twentieth of a pixel from every edge
    double iou = 1, depthPixels = 0, degrees = 0;
};

class Ribbons : public test::BackendsHere {
  protected:
    struct Case {
        const char* name;
        lod::CurveSet set;
        dvec3 eye, target;
    };
    static lod::CurveSet strip(const std::vector<dvec3>& places, float radius, double startTwist, double twist) {
        std::vector<glm::vec3> normals;
        for (size_t i = 0; i < places.size(); ++i) {
            const double t = startTwist + twist * static_cast<double>(i) / static_cast<double>(places.size() - 1);
            normals.emplace_back(std::sin(t), std::cos(t), 0);
        }
        return test::oneCurve(places, radius, normals);
    }
    static std::vector<Case> cases() {
        std::vector<Case> all;
        test::CurlRecipe recipe;
        recipe.count = 12;
        recipe.radius = 0.1f;
        recipe.ribbons = 1;
        all.push_back({"curls", test::curls(recipe), {0, 0, 1.3}, {0, 0, 0}});
        std::vector<dvec3> places;
        for (int i = 0; i <= 12; ++i) places.emplace_back(0.1 * std::sin(0.5 * i), -0.05, 0.1 * i - 0.6);
        all.push_back({"twisted", strip(places, 0.15f, 0.3, 4), {0.35, 0.3, 0.75}, {0, 0, 0.1}});
        all.push_back({"one twist", strip({{0, 0, -0.5}, {0, 0, 0.5}}, 0.3f, 0, 2.6), {0.7, 0.2, 0.6}, {0, 0, 0.2}});
        all.push_back(
            {"under the eye", strip({{0, 0, -3}, {0, 0, -1}, {0, 0, 1}}, 0.5f, 0, 0), {0.1, 0.2, 0}, {0, 0, -1}});
        // Its axis is beside the picture or behind the eye, and its edge is not.
        all.push_back(
            {"beside the eye", strip({{-0.5, 0, -0.2}, {-0.5, 0.1, 0.5}}, 1, 0.1, 0.3), {0, 0.4, 0.05}, {0.5, 0, -1}});
        return all;
    }
    static std::vector<RayPicture> rays(const std::vector<Segment>& segments, const lod::View& view) {
        constexpr int kAlong = 64, kAcross = 16;
        std::vector<RayPicture> all;
        for (const dvec2& shift : {dvec2(0), dvec2(0.05, 0), dvec2(-0.05, 0), dvec2(0, 0.05), dvec2(0, -0.05)})
            all.emplace_back(view, shift);
        for (const Segment& s : segments) {
            const auto at = [&](double i, double j) {
                const double v = i / kAlong, side = 2 * j / kAcross - 1;
                const dvec3 p = glm::mix(s.a, s.b, v) +
                                side * glm::mix(s.radiusA * s.directionA, s.radiusB * s.directionB, v) - view.eye;
                return dvec3(glm::dot(p, view.right), glm::dot(p, view.down), glm::dot(p, view.forward));
            };
            const auto corner = [&](int i, int j) {
                const dvec3 along = at(i + 0.5, j) - at(i - 0.5, j), across = at(i, j + 0.5) - at(i, j - 0.5);
                return RayPicture::Corner{at(i, j), glm::normalize(glm::cross(along, across))};
            };
            for (int i = 0; i < kAlong; ++i)
                for (int j = 0; j < kAcross; ++j) {
                    const auto a = corner(i, j), b = corner(i + 1, j), c = corner(i, j + 1), d = corner(i + 1, j + 1);
                    for (RayPicture& p : all) {
                        p.add(a, b, c);
                        p.add(c, b, d);
                    }
                }
        }
        return all;
    }
    static Figures compare(const render::Image& image, const lod::View& view, const std::vector<RayPicture>& truth) {
        Figures f;
        size_t both = 0, either = 0;
        std::vector<double> angles;
        for (size_t i = 0; i < size_t{view.width} * view.height; ++i) {
            const bool isDrawn = image.rgba[i] >> 24 != 0, isMet = truth[0].at(i).depth < 1e300;
            f.covered += isMet ? 1 : 0;
            both += isDrawn && isMet ? 1 : 0;
            either += isDrawn || isMet ? 1 : 0;
            const auto others = std::count_if(truth.begin(), truth.end(),
                                              [&](const RayPicture& p) { return (p.at(i).depth < 1e300) == isMet; });
            f.wrong += isDrawn != isMet && others == 5 ? 1 : 0;
            if (!isDrawn || !isMet || others < 5) continue;
            // The nearest to what is drawn of what is met within a twentieth of a pixel: edges hide each other.
            const dvec2 at(double(i % view.width) + 0.5 - 0.5 * view.width,
                           double(i / view.width) + 0.5 - 0.5 * view.height);
            const dvec3 ray(at / view.focalPixels, 1);
            const dvec3 own(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            const dvec3 n(glm::dot(own, view.right), glm::dot(own, view.down), glm::dot(own, view.forward));
            double depth = 1e300, angle = 180;
            for (const RayPicture& p : truth) {
                const Met& m = p.at(i);
                // Along the normal, in pixels there.
                const double off = std::abs(double(image.depth[i]) - m.depth) * std::abs(glm::dot(ray, m.normal));
                depth = std::min(depth, off * view.focalPixels / m.depth);
                angle = std::min(angle, std::acos(std::min(std::abs(glm::dot(n, m.normal)), 1.0)) * 57.29577951308232);
            }
            f.depthPixels = std::max(f.depthPixels, depth);
            angles.push_back(angle);
        }
        f.iou = either > 0 ? static_cast<double>(both) / static_cast<double>(either) : 1;
        std::sort(angles.begin(), angles.end());
        if (!angles.empty()) f.degrees = angles[angles.size() - 1 - angles.size() / 1000];
        return f;
    }
    void expectTrue() {
        render::FrameSettings settings;
        settings.draw.lit = true;
        settings.draw.worldUp = {0, 1, 0};
        settings.draw.exactCurves = 0.5f;
        settings.budgets.errorPixels = 1e-4;
        settings.wantDepthAndNormal = true;
        for (Case& c : cases()) {
            const auto store = test::buildCurves(c.set, folder_ / "ribbons.stipple", *executor_);
            ASSERT_TRUE(store);
            std::vector<Segment> segments;
            for (uint32_t i = 0; i < store->hierarchy.nodes.size(); ++i) {
                const lod::Node& node = store->hierarchy.nodes[i];
                if (!node.isLeaf()) continue;
                const auto chunk = lod::readChunk(*store, i);
                ASSERT_TRUE(chunk);
                for (const shared::CurveSegment& s : chunk->segments)
                    segments.push_back(reference::decodeSegment(store->hierarchy, node, s));
            }
            scene::Camera camera;
            camera.eye = c.eye;
            camera.target = c.target;
            camera.up = {0, 1, 0};
            camera.fovDegrees = 120;
            const lod::View view = scene::makeView(camera, 240, 180, 1e-3);
            const std::vector<RayPicture> truth = rays(segments, view);
            for (const auto& [name, backend] : backends_) {
                const Figures f =
                    compare(test::draw({{store, {}, {}}}, *backend, *executor_, view, settings), view, truth);
                SCOPED_TRACE(fmt::format("{}, {}", name, c.name));
                printf("%s, %s: %zu pixels, IoU %.5f, %zu wrong, depth %.4f px, normals %.2f degrees\n", name.c_str(),
                       c.name, f.covered, f.iou, f.wrong, f.depthPixels, f.degrees);
                EXPECT_GE(f.covered, 900u);
                EXPECT_EQ(f.wrong, 0u);
                EXPECT_GE(f.iou, 0.9995);
                EXPECT_LE(f.depthPixels, 0.05);
                EXPECT_LE(f.degrees, 0.5);
            }
        }
    }
};

TEST_F(Ribbons, AreWhatRaysMeetInWidePictures) { expectTrue(); }

}  // namespace
}  // namespace stipple
