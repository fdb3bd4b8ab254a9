// How far what a picture of triangles shows lies from the full detail: the place of each pixel (its depth, along its
// ray) and the nearest triangle of the input, in fp64. Stated is tau; half a pixel more is the sample's own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/backends_here.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/program.h"
#include "tests/support/triangle_field.h"

namespace stipple {
namespace {

#ifdef STIPPLE_ON_GPU
constexpr uint32_t kSize = 200;  // a software device is slow
#else
constexpr uint32_t kSize = 400;
#endif

class FullMesh : public test::BackendsHere {
  protected:
    struct Beyond {
        size_t drawn = 0, beyond = 0;
        double worst = 0;  ///< px, of all
        uint64_t triangles = 0;
    };
    /// `drawnWith`: what the cut is asked for, where it is not what is judged.
    Beyond measure(const std::shared_ptr<const lod::Store>& store, const test::TriangleField& full,
                   const lod::View& view, double tau, double drawnWith = 0) {
        render::FrameSettings settings;
        settings.budgets.errorPixels = drawnWith > 0 ? drawnWith : tau;
        settings.wantDepthAndNormal = true;
        FrameCounters counters;
        const render::Image image = test::renderView(store, usual(), *executor_, view, settings, &counters);
        Beyond b;
        b.triangles = counters.trianglesDrawn;
        for (size_t i = 0; i < image.depth.size(); ++i) {
            const double z = image.depth[i];
            if (z <= 0) continue;
            ++b.drawn;
            const double x = static_cast<double>(i % view.width) + 0.5, y = static_cast<double>(i / view.width) + 0.5;
            const double pixel = view.isOrthographic ? 1 / view.focalPixels : z / view.focalPixels;
            const glm::dvec3 across = view.right * ((x - 0.5 * view.width) / view.focalPixels) +
                                      view.down * ((y - 0.5 * view.height) / view.focalPixels);
            const glm::dvec3 place = view.isOrthographic ? view.eye + across + z * view.forward
                                                         : view.eye + z * test::rayThrough(view, x, y);
            const double away = full.distance(place, 50 * pixel) / pixel;
            b.beyond += away > tau + 0.5;
            b.worst = std::max(b.worst, away);
        }
        return b;
    }

    /// None is beyond, from afar, from near by, and nearly along the surface.
    void expectNone(const std::string& name, const std::shared_ptr<const lod::Store>& store, bool isFlat = false) {
        const test::TriangleField full(test::leafTriangles(*store));
        for (const auto& [look, elevation, distance] :
             {std::tuple{"overview", 35.0, 0.9}, {"far", 20.0, 3.0}, {"close", 25.0, 0.5}, {"grazing", 3.0, 0.7}})
            for (const double tau : {0.5, 1.0, 4.0})
                for (const bool isOrthographic : {false, true}) {
                    lod::View view = test::lookAt(*store, 30, elevation, distance, kSize);
                    if (isOrthographic) {
                        const lod::StoreDescription& d = store->description;
                        view.focalPixels /= distance * glm::length(d.boundsMax - d.boundsMin);
                        view.isOrthographic = true;
                    }
                    const Beyond b = measure(store, full, view, tau);
                    std::printf("%-9s %-8s tau %.1f%s: %zu drawn of %lu triangles, beyond %zu, worst %.2f px\n",
                                name.c_str(), look, tau, isOrthographic ? " orthographic" : "", b.drawn,
                                static_cast<unsigned long>(b.triangles), b.beyond, b.worst);
                    std::fflush(stdout);
                    EXPECT_GT(b.drawn, kSize * kSize / 80);
                    EXPECT_EQ(b.beyond, 0u) << name << " " << look << " " << tau << " " << isOrthographic;
                    EXPECT_LE(b.worst, tau) << "a pixel's place is on a triangle: it needs no half a pixel";
                }
        if (isFlat) return;
        // The control: what is drawn for 64 px is beyond half a pixel.
        const Beyond coarse = measure(store, full, test::lookAt(*store, 30, 35, 0.9, kSize), 0.5, 64);
        EXPECT_GT(coarse.beyond, coarse.drawn / 200) << name;
    }
};

TEST_F(FullMesh, OfGrownOnesIsWhereThePictureSays) {
    for (const char* kind : {"rock", "building", "terrain"}) {
        test::MeshRecipe recipe;
        recipe.grow.kind = kind;
        recipe.grow.triangles = 120'000;
        recipe.isTextured = false;
        expectNone(kind, test::growMeshStore(recipe, folder_ / (std::string(kind) + ".stipple"), *executor_),
                   recipe.grow.kind == "building");
    }
}

TEST_F(FullMesh, OfStatuesIsWhereThePictureSays) {
    for (const char* name : {"01_meshes/bunny/bun_zipper.ply", "01_meshes/misc/lucy.ply", "01_meshes/misc/horse.ply"}) {
        const std::string path = test::dataFile(name);
        if (path.empty()) continue;
        const test::Outcome built = test::runProgram(folder_, "build " + path + " -o a.stipple --force --quiet");
        ASSERT_EQ(built.code, 0) << built.err;
        auto store = lod::openStore(folder_ / "a.stipple");
        ASSERT_TRUE(store);
        ASSERT_TRUE(store->hierarchy.isMesh());
        expectNone(path.substr(path.rfind('/') + 1), std::make_shared<const lod::Store>(std::move(*store)));
    }
}

}  // namespace
}  // namespace stipple
