// The cuts of many scenes, views, budgets and residencies, one hash a line: two programs' lists are to be the same.
//   stipple_cut_dump [STORE...]    of the scenes of the tests, and of each store
#include <fmt/format.h>

#include "engine/base/hash.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/scene/camera.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple::test {
namespace {

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

template <typename... T>
void addFields(uint64_t& hash, const T&... fields) {
    ((hash = hashBytes(&fields, sizeof(fields), hash)), ...);
}

uint64_t hashOf(const lod::Cut& cut) {
    uint64_t hash = 0;
    for (const lod::CutDraw& d : cut.draw)
        addFields(hash, d.instance, d.node, d.first, d.count, d.errorCode, d.octantMask, d.errorPixels, d.radiusScale);
    for (const lod::CutMeshDraw& d : cut.meshDraw)
        addFields(hash, d.instance, d.node, d.firstCluster, d.clusters, d.triangles, d.errorPixels);
    for (const lod::CutWanted& w : cut.wanted) addFields(hash, w.source, w.chunk, w.priority);
    for (const auto& [source, node] : cut.keep) addFields(hash, source, node);
    const lod::CutCounters& c = cut.counters;
    addFields(hash, cut.tauTarget, cut.tauEffective, cut.truncated, c.nodesDrawn, c.nodesMissing, c.recordsDrawn,
              c.recordsTested, c.trianglesDrawn, c.proxies, c.groupMembers);
    return hash;
}

/// A box in world space that views look at, from near and far.
struct Place {
    glm::dvec3 centre{0};
    double size = 1;
};

lod::View randomView(Rng& rng, const Place& place) {
    scene::Camera camera;
    const double a = rng.uniform(0, 6.28), b = rng.uniform(-1.3, 1.3), distance = std::exp2(rng.uniform(-3, 5));
    const glm::dvec3 out(std::cos(a) * std::cos(b), std::sin(b), std::sin(a) * std::cos(b));
    camera.eye = place.centre + place.size * distance * out;
    camera.target = place.centre + 0.3 * place.size * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    camera.up = {0, 1, 0};
    camera.fovDegrees = rng.uniform(20, 100);
    return scene::makeView(camera, 1280, 720, place.size * 1e-5);
}

void dump(const std::string& name, const lod::CutScene& scene, const Place& place, int cases) {
    std::vector<std::vector<uint8_t>> drawable;
    for (const lod::Instance& i : scene.instances) {
        if (drawable.size() <= i.source) drawable.resize(i.source + 1);
        drawable[i.source].resize(scene.hierarchies[i.hierarchy]->chunks(), 1);
    }
    Rng rng(7);
    lod::CutScratch scratch;
    lod::Cut cut;
    uint64_t missing = 0, bound = 0, raised = 0;
    for (int k = 0; k < cases; ++k) {
        const uint64_t keep = k % 3 == 0 ? 9 : rng.below(9);  // of nine
        for (auto& of : drawable) {
            for (uint8_t& d : of) d = rng.below(9) < keep ? 1 : 0;
            if (rng.below(8) != 0 && !of.empty()) of[0] = 1;
        }
        const uint64_t most = k % 2 == 0 ? kNoLimit : static_cast<uint64_t>(std::exp2(rng.uniform(2, 22)));
        lod::selectCut(scene, {drawable}, randomView(rng, place), {std::exp2(rng.uniform(-6, 6)), most}, scratch, cut);
        fmt::print("{} {} {:016x}\n", name, k, hashOf(cut));
        missing += cut.wanted.empty() ? 0 : 1;
        bound += cut.tauTarget > 0 && most != kNoLimit ? 1 : 0;
        raised += cut.tauEffective > cut.tauTarget * 1.0001 ? 1 : 0;
    }
    fmt::print("{}: {} cases, {} with something missing, {} with a budget, {} coarser than planned\n", name, cases,
               missing, bound, raised);
}

Place placeOf(const lod::Hierarchy& h) { return {h.origin + h.unit * h.nodes[0].centre, h.unit * h.nodes[0].radius}; }

/// One instance of each, in a row; each but the first turned.
void dumpRow(const std::string& name, const std::vector<const lod::Hierarchy*>& hierarchies, int cases) {
    std::vector<lod::Instance> instances(hierarchies.size());
    for (uint32_t i = 0; i < instances.size(); ++i) {
        instances[i].hierarchy = instances[i].source = i;
        instances[i].scale = 1 + 0.25 * i;
        instances[i].sway = i == 1 ? 0.01 : 0;
        const double a = 0.7 * i;
        instances[i].rotation = {{std::cos(a), std::sin(a), 0}, {-std::sin(a), std::cos(a), 0}, {0, 0, 1}};
    }
    dump(name, {hierarchies, instances, {}}, placeOf(*hierarchies[0]), cases);
}

/// `coarse` stand in for `fine`, one behind the other.
void dumpProxies(const std::string& name, const lod::Hierarchy& fine, const std::vector<const lod::Hierarchy*>& coarse,
                 double error, int cases) {
    std::vector<const lod::Hierarchy*> hierarchies{&fine};
    std::vector<lod::Instance> instances(1);
    for (const lod::Hierarchy* h : coarse) {
        instances.back().proxy = static_cast<uint32_t>(instances.size());
        lod::Instance next;
        next.hierarchy = next.source = static_cast<uint32_t>(hierarchies.size());
        next.inputError = error * static_cast<double>(instances.size());
        next.isDriven = true;
        instances.push_back(next);
        hierarchies.push_back(h);
    }
    dump(name, {hierarchies, instances, {}}, placeOf(fine), cases);
}

void dumpAll(const std::vector<std::string>& paths) {
    const TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    writePly(folder / "a.ply", bumpySphere(60'000, 1));
    const auto points = buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    dumpRow("points", {&points->hierarchy}, 400);
    MeshRecipe recipe;
    recipe.grow.kind = "terrain";
    recipe.grow.triangles = 60'000;
    recipe.grow.textureSize = 1024;
    const auto mesh = growMeshStore(recipe, folder / "b.stipple", *executor);
    dumpRow("triangles", {&mesh->hierarchy}, 400);
    const Forest forest = plantForest(folder.path(), 12, *executor);
    dumpRow("curves", {&forest.curves->hierarchy}, 400);
    dumpRow("progressive", {&forest.afar->hierarchy}, 400);
    dumpRow("row", {&mesh->hierarchy, &points->hierarchy, &forest.curves->hierarchy, &forest.afar->hierarchy}, 400);
    dumpProxies("proxies of a mesh", mesh->hierarchy, {&points->hierarchy}, 0.5, 300);
    dumpProxies("proxies of curves", forest.curves->hierarchy, {&points->hierarchy, &forest.afar->hierarchy}, 1e-4,
                300);
    const auto backend = cpu::makeCpuBackend(*executor);
    const auto state = render::makeFrameState(forest.placed, *backend, *executor, {}, forest.groups);
    dump("forest", state->scene(), {{44, 8, 44}, 60}, 600);
    for (const std::string& path : paths) {
        const auto store = lod::openStore(path);
        if (!store) throw std::runtime_error(store.error().line());
        dumpRow(path.substr(path.rfind('/') + 1), {&store->hierarchy}, 100);
    }
}

}  // namespace
}  // namespace stipple::test

int main(int argc, char** argv) try {
    stipple::test::dumpAll({argv + 1, argv + argc});
} catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 1;
}
