#include "tests/support/forests.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "apps/grow/plants.h"
#include "engine/scene/curves.h"
#include "lod/builder/curves/curve_coverage.h"

namespace stipple::test {

lod::CurveSet oak(uint64_t leaves, uint64_t seed) {
    grow::PlantOptions plant;
    plant.leaves = leaves;
    plant.seed = seed;
    const scene::Scene scene = grow::growPlant(plant);
    return lod::cleanCurves(scene::flattenCurves(scene, scene::placements(scene)), 0);
}

Forest plantForest(const std::string& folder, uint32_t side, Executor& executor) {
    Forest f;
    f.tree = oak(3000);
    f.curves = buildCurves(f.tree, folder + "/tree.stipple", executor, 512);
    f.samples = lod::sampleCurves(f.tree, 8192);
    lod::StochasticSettings settings;
    settings.description.up = {0, 1, 0};
    lod::describeDiscs({{lod::coverageFactors(f.tree, f.samples, executor), f.samples.radius}}, settings.description);
    const lod::Hierarchy& h = f.curves->hierarchy;
    lod::StochasticItem item;
    item.samples = &f.samples;
    item.count = static_cast<uint32_t>(f.samples.points.position.size());
    item.centre = h.origin + h.unit * h.nodes[0].centre;
    item.reach = h.unit * h.nodes[0].radius;
    Progress progress(false);
    const std::string afar = folder + "/afar.stipple", group = folder + "/group.stipple";
    EXPECT_TRUE(lod::buildStochasticStore({item}, afar, settings, executor, progress));
    f.afar = std::make_shared<const lod::Store>(*lod::openStore(afar));
    const auto proxies = std::make_shared<const std::vector<render::Proxy>>(std::vector{render::Proxy{f.afar, 0}});
    Rng rng(11);
    std::vector<lod::StochasticItem> items;
    item.count = 128;
    for (uint32_t k = 0; k < side * side; ++k) {
        const double x = 8.0 * (k % side + rng.uniform(-0.2, 0.2)),
                     z = 8.0 * (double(k / side) + rng.uniform(-0.2, 0.2));
        item.place.translation = {x, 0.1 * x, z};
        item.place.rotation = glm::dmat3(glm::rotate(glm::dmat4(1), rng.uniform(0, 6.28), glm::dvec3(0, 1, 0)));
        item.place.scale = rng.uniform(0.8, 1.25);
        items.push_back(item);
        render::PlacedStore tree{f.curves, item.place, {}};
        tree.proxies = proxies;
        tree.isMember = true;
        f.placed.push_back(tree);
    }
    settings.nodeRecords = 1024;
    EXPECT_TRUE(lod::buildStochasticStore(items, group, settings, executor, progress));
    render::PlacedGroup c;
    c.points = std::make_shared<const lod::Store>(*lod::openStore(group));
    std::vector<std::vector<uint32_t>> members(c.points->hierarchy.nodes.size());
    for (uint32_t k = 0; k < items.size(); ++k) {
        const lod::Instance& p = items[k].place;
        members[lod::leafOf(c.points->hierarchy, p.translation + p.rotation * (p.scale * item.centre))].push_back(k);
    }
    c.first.push_back(0);
    for (const auto& some : members) {
        c.members.insert(c.members.end(), some.begin(), some.end());
        c.first.push_back(static_cast<uint32_t>(c.members.size()));
    }
    f.groups.push_back(std::move(c));
    return f;
}

}  // namespace stipple::test
