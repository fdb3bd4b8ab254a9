#include <stdexcept>

#include "lod/builder/stochastic/stochastic_build.h"
#include "tests/support/crafted_store.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"
#include "tests/support/mixed_store.h"

namespace stipple::test {
namespace {

/// A grown mesh, a copy of some of its triangles at 1e9, and a vertex that was moved as far.
void buildWideMesh(MeshRecipe recipe, const std::string& path, Executor& executor) {
    recipe.grow.triangles = 1500;
    lod::MeshBuildSettings settings;
    lod::TriangleMesh mesh = growTriangles(recipe, settings);
    const size_t corners = mesh.indices.size() / 9 * 3;
    const auto vertices = static_cast<uint32_t>(mesh.position.size());
    const auto repeat = [](auto& items) {
        const auto copy = items;
        items.insert(items.end(), copy.begin(), copy.end());
    };
    repeat(mesh.position);
    repeat(mesh.normal);
    repeat(mesh.uv);
    repeat(mesh.colour);
    repeat(mesh.surface);
    for (size_t v = vertices; v < mesh.position.size(); ++v) mesh.position[v] += glm::dvec3(-1e9, 1e9, 0);
    mesh.position[mesh.indices.back()] = glm::dvec3(1e9, 0, 0);
    for (size_t i = 0; i < corners; ++i) mesh.indices.push_back(mesh.indices[i] + vertices);
    Progress silent(false);
    if (const auto built = lod::buildMeshStore(lod::sourceOf(mesh), path, settings, executor, silent); !built)
        throw std::runtime_error(built.error().line());
}

}  // namespace

std::vector<std::string> smallStores(const std::string& folder) {
    const auto executor = makeSerialExecutor();
    Progress silent(false);
    const std::string points = folder + "/points.stipple", mesh = folder + "/mesh.stipple",
                      curves = folder + "/curves.stipple", afar = folder + "/afar.stipple",
                      wide = folder + "/wide.stipple";
    writePly(folder + "/points.ply", bumpySphere(1500, 1));
    lod::BuildSettings settings;
    settings.leafRecords = 256;
    settings.allAttributes = true;
    build({folder + "/points.ply"}, points, *executor, settings);
    MeshRecipe recipe;
    recipe.grow.triangles = 3000;
    recipe.grow.textureSize = 64;
    growMeshStore(recipe, mesh, *executor);
    buildWideMesh(recipe, wide, *executor);
    const lod::CurveSet set = curls({.count = 60, .vertices = 30});
    buildCurves(set, curves, *executor, 64);
    const lod::CurveSamples samples = lod::sampleCurves(set, 2000);
    lod::StochasticSettings far;
    far.nodeRecords = 64;
    std::vector<lod::StochasticItem> items;
    for (int k = 0; k < 27; ++k) {
        lod::StochasticItem item{&samples, 300, {}, glm::dvec3(0), 2};
        item.place.translation = glm::dvec3(5 * (k % 3), 5 * (k / 3 % 3), 5 * (k / 9));
        items.push_back(item);
    }
    if (const auto built = lod::buildStochasticStore(items, afar, far, *executor, silent); !built)
        throw std::runtime_error(built.error().line());
    writeMixedStore(folder + "/mixed.stipple");
    return {points, mesh, curves, afar, wide, folder + "/mixed.stipple"};
}

}  // namespace stipple::test
