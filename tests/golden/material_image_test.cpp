// Points with materials: their highlights are those of triangles of the same material, in all modes that close
// surfaces; every backend shows what the fp64 restatement shows.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "engine/scene/triangles.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/store/materials.h"
#include "tests/support/backends_here.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::PointMaterial;

using MaterialBackends = test::BackendsHere;

/// Evenly spread (Fibonacci) on a unit sphere.
std::vector<test::TestPoint> sphere(size_t count) {
    std::vector<test::TestPoint> points;
    for (size_t i = 0; i < count; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count),
                     a = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
        const glm::dvec3 p(r * std::cos(a), r * std::sin(a), z);
        points.push_back({p, glm::vec3(p), 0x4080c0, 0});
    }
    return points;
}

/// Binary PLY whose points have the properties roughness and metallic.
void writeMaterials(const std::string& path, const std::vector<test::TestPoint>& points,
                    const std::function<PointMaterial(const test::TestPoint&)>& materialOf) {
    std::ofstream out(path, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nproperty float nx\nproperty float ny\n"
           "property float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
           "property float roughness\nproperty float metalness\nend_header\n";
    for (const test::TestPoint& p : points) {
        const PointMaterial m = materialOf(p);
        out.write(reinterpret_cast<const char*>(&p.position), 24);
        out.write(reinterpret_cast<const char*>(&p.normal), 12);
        out.write(reinterpret_cast<const char*>(&p.colour), 3);
        out.write(reinterpret_cast<const char*>(&m.roughness), 4);
        out.write(reinterpret_cast<const char*>(&m.metallic), 4);
    }
}

/// Stripes of metal, plastic and matte, each of several roughnesses.
PointMaterial striped(const test::TestPoint& p) {
    const auto band = static_cast<int>(std::floor((p.position.y + 2) * 4));
    return {0.2f + 0.2f * static_cast<float>(band % 5), band % 3 == 0 ? 1.0f : 0.0f};
}

lod::View viewOf(double distance, uint32_t size, bool isOrthographic = false) {
    scene::Camera camera;
    camera.eye = glm::normalize(glm::dvec3(0.5, 0.3, 1)) * distance;
    camera.target = {0, 0, 0};
    camera.up = {0, 1, 0};
    camera.fovDegrees = 40;
    lod::View view = scene::makeView(camera, size, size, 1e-3);
    if (isOrthographic) {
        view.isOrthographic = true;
        view.focalPixels /= distance;
    }
    return view;
}

render::FrameSettings lit(render::Mode mode, double errorPixels = 0.5) {
    render::FrameSettings settings;
    settings.mode = mode;
    settings.draw.lit = true;
    settings.draw.worldUp = {0, 1, 0};
    settings.budgets.errorPixels = errorPixels;
    settings.wantDepthAndNormal = true;
    return settings;
}

#ifndef STIPPLE_ON_GPU
/// dB of linear colours against the largest of `truth` there, over the inner part of the sphere, where both are.
double inside(const render::Image& image, const render::Image& truth, double share) {
    double sum = 0, n = 0, peak = 0;
    const double middle = 0.5 * image.width;
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            const size_t i = size_t{y} * image.width + x;
            if (std::hypot(x + 0.5 - middle, y + 0.5 - middle) > share * middle) continue;
            if (!(image.depth[i] > 0 && truth.depth[i] > 0)) continue;
            for (size_t c = 0; c < 3; ++c) {
                const double v = double{truth.linear[3 * i + c]}, d = double{image.linear[3 * i + c]} - v;
                sum += d * d;
                peak = std::max(peak, v);
                ++n;
            }
        }
    EXPECT_GT(n, 10'000);
    return 10 * std::log10(peak * peak * n / sum);
}

/// The same sphere as triangles, of one material and colour.
std::shared_ptr<const lod::Store> triangles(const PointMaterial& material, const std::string& path,
                                            Executor& executor) {
    scene::Scene scene;
    scene.path = "sphere";
    scene::Primitive mesh;
    constexpr uint32_t kAround = 480, kUp = 240;
    for (uint32_t j = 0; j <= kUp; ++j)
        for (uint32_t i = 0; i <= kAround; ++i) {
            const double a = 2 * M_PI * i / kAround, b = M_PI * j / kUp;
            mesh.position.emplace_back(std::cos(a) * std::sin(b), std::cos(b), std::sin(a) * std::sin(b));
            if (i == 0 || j == 0) continue;
            const auto d = static_cast<uint32_t>(mesh.position.size() - 1), c = d - 1, b2 = d - (kAround + 1),
                       a2 = b2 - 1;
            for (const uint32_t k : {a2, b2, d, a2, d, c}) mesh.indices.push_back(k);
        }
    mesh.normal = mesh.position;
    mesh.material = 0;
    scene.materials.resize(1);
    scene.materials[0].baseColour = {shared::linearFromSrgb(0xc0 / 255.0f), shared::linearFromSrgb(0x80 / 255.0f),
                                     shared::linearFromSrgb(0x40 / 255.0f), 1};
    scene.materials[0].roughness = material.roughness;
    scene.materials[0].metallic = material.metallic;
    scene.materials[0].isDoubleSided = true;
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {std::move(mesh)};
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    lod::MeshBuildSettings build;
    build.description.materials = scene::surfaceMaterials(scene);
    Progress silent(false);
    EXPECT_TRUE(
        lod::buildMeshStore(scene::triangleSource(scene, scene::placements(scene)), path, build, executor, silent));
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

std::shared_ptr<const lod::Store> opened(const std::string& path) {
    return std::make_shared<const lod::Store>(*lod::openStore(path));
}

TEST(MaterialImages, ASphereOfPointsHasTheHighlightsOfOneOfTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points = sphere(60'000);
    for (test::TestPoint& p : points) p.colour = 0x4080c0;  // r | g << 8 | b << 16: c0, 80, 40 in order
    test::writePly(folder / "a.ply", points);
    const auto backend = cpu::makeCpuBackend(*executor);
    const lod::View view = viewOf(3, 320);
    for (const char* name : {"plastic", "metal"}) {
        lod::BuildSettings build;
        build.material = *lod::materialNamed(name);
        test::build({folder / "a.ply"}, folder / "points.stipple", *executor, build);
        build.material = *lod::materialNamed("matte");
        test::build({folder / "a.ply"}, folder / "matte.stipple", *executor, build);
        const auto mesh = triangles(*lod::materialNamed(name), folder / "mesh.stipple", *executor),
                   store = opened(folder / "points.stipple"), matte = opened(folder / "matte.stipple");
        for (const render::Mode mode : {render::Mode::surface, render::Mode::pullpush, render::Mode::splat,
                                        render::Mode::ewa, render::Mode::pullpushExact, render::Mode::points}) {
            const render::FrameSettings settings = lit(mode);
            const render::Image truth = test::renderView(mesh, *backend, *executor, view, settings),
                                image = test::renderView(store, *backend, *executor, view, settings),
                                control = test::renderView(matte, *backend, *executor, view, settings);
            SCOPED_TRACE(testing::Message() << name << ", " << render::reconstructionOf(mode).name);
            const double db = inside(image, truth, 0.7), without = inside(control, truth, 0.7);
            std::printf("%-7s %-14s %.1f dB (matte: %.1f)\n", name, render::reconstructionOf(mode).name, db, without);
            EXPECT_GE(db, 45);
            EXPECT_LE(without, 28) << "the control";
            // What is asked for at drawing is as what was built.
            render::FrameSettings asked = settings;
            asked.draw.pointMaterial = lod::packed(*lod::materialNamed(name));
            EXPECT_TRUE(test::renderView(matte, *backend, *executor, view, asked).rgba == image.rgba);
        }
    }
}

TEST(MaterialImages, WithoutAMaterialPointsAreLitAsEver) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", sphere(20'000));
    writeMaterials(folder / "b.ply", sphere(20'000), striped);
    const auto plain = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor),
               striped_ = test::buildAndOpen(folder / "b.ply", folder / "b.stipple", *executor);
    const auto backend = cpu::makeCpuBackend(*executor);
    const lod::View view = viewOf(6, 320);
    lod::Instance left, right;
    left.translation = {-1.2, 0, 0};
    right.translation = {1.2, 0, 0};
    for (const render::Mode mode :
         {render::Mode::surface, render::Mode::pullpush, render::Mode::splat, render::Mode::ewa}) {
        const render::FrameSettings settings = lit(mode);
        const render::Image alone = test::draw({{plain, left, {}}}, *backend, *executor, view, settings),
                            both = test::draw({{plain, left, {}}, {striped_, right, {}}}, *backend, *executor, view,
                                              settings);
        size_t same = 0, drawn = 0;
        for (size_t i = 0; i < alone.rgba.size(); ++i) {
            if (!(alone.depth[i] > 0)) continue;
            ++drawn;
            same += alone.rgba[i] == both.rgba[i];
        }
        EXPECT_GT(drawn, 5'000u);
        EXPECT_GE(same, drawn - drawn / 200) << render::reconstructionOf(mode).name << ": beside one that has some";
    }
}
#endif

TEST_F(MaterialBackends, ShowManyMaterialsAsTheOracleDoes) {
    writeMaterials(folder_ / "a.ply", sphere(30'000), striped);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    ASSERT_TRUE(store->hierarchy.hasMaterials);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    backends_.erase("fp64");
    render::WorldLight lamp;
    lamp.position = {2, 2, 2};
    lamp.colour = glm::vec3(6);
    // From afar, near (wide discs), orthographic; under the sun and under a lamp.
    struct Look {
        double distance;
        bool isOrthographic, hasLamp;
        double error;
    };
    for (const Look& look :
         {Look{3, false, false, 0.5}, {1.02, false, true, 0.5}, {3, true, true, 2}, {3, false, true, 4}})
        for (const render::Mode mode : {render::Mode::surface, render::Mode::pullpush, render::Mode::splat,
                                        render::Mode::ewa, render::Mode::pullpushExact, render::Mode::points}) {
            render::FrameSettings settings = lit(mode, look.error);
            if (look.hasLamp) settings.draw.lights = {lamp};
            const lod::View view = viewOf(look.distance, 240, look.isOrthographic);
            const render::Image truth = test::renderView(store, *oracle, *executor_, view, settings);
            render::FrameSettings matte = settings;
            matte.draw.pointMaterial = lod::packed(PointMaterial{1, 0});
            const render::Image control = test::renderView(store, *oracle, *executor_, view, matte);
            for (auto& [name, backend] : backends_) {
                SCOPED_TRACE(testing::Message() << name << ", " << render::reconstructionOf(mode).name << " from "
                                                << look.distance << " " << look.isOrthographic << look.hasLamp);
                const render::Image image = test::renderView(store, *backend, *executor_, view, settings);
                EXPECT_GE(test::drawnPsnr(image, truth), 50);
                EXPECT_LE(test::drawnPsnr(control, truth), 35) << "the control";
            }
        }
}

}  // namespace
}  // namespace stipple
