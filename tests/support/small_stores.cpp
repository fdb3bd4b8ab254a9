#include <stdexcept>

#include "lod/builder/progressive/progressive_build.h"
#include "tests/support/crafted_store.h"
#include "tests/support/meshes.h"
#include "tests/support/strands.h"

namespace stipple::test {

std::vector<std::string> smallStores(const std::string& folder) {
    const auto executor = makeSerialExecutor();
    Progress silent(false);
    const std::string points = folder + "/points.stipple", mesh = folder + "/mesh.stipple",
                      strands = folder + "/strands.stipple", afar = folder + "/afar.stipple";
    writePly(folder + "/points.ply", bumpySphere(1500, 1));
    lod::BuildSettings settings;
    settings.leafRecords = 256;
    settings.allAttributes = true;
    build({folder + "/points.ply"}, points, *executor, settings);
    MeshRecipe recipe;
    recipe.grow.triangles = 3000;
    recipe.grow.textureSize = 64;
    growMeshStore(recipe, mesh, *executor);
    const lod::StrandSet set = curls({.count = 60, .vertices = 30});
    buildStrands(set, strands, *executor, 64);
    const lod::StrandSamples samples = lod::sampleStrands(set, 2000);
    lod::ProgressiveSettings far;
    far.nodeRecords = 64;
    std::vector<lod::ProgressiveItem> items;
    for (int k = 0; k < 27; ++k) {
        lod::ProgressiveItem item{&samples, 300, {}, glm::dvec3(0), 2};
        item.place.translation = glm::dvec3(5 * (k % 3), 5 * (k / 3 % 3), 5 * (k / 9));
        items.push_back(item);
    }
    if (const auto built = lod::buildProgressiveStore(items, afar, far, *executor, silent); !built)
        throw std::runtime_error(built.error().line());
    return {points, mesh, strands, afar};
}

}  // namespace stipple::test
