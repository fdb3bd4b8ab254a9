// selectCut on a hierarchy of about 100,000 nodes with a budget: the figure of the README.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <new>

#include "engine/base/rng.h"
#include "lod/cut/cut.h"

namespace {

uint64_t allocations = 0;

stipple::lod::Hierarchy flatTerrain(uint32_t levels) {
    // A square surface: every node has four children; records and errors as a build of a scan gives them.
    using namespace stipple::lod;
    Hierarchy h;
    h.rootLog2 = 21;
    h.errors.smallest = std::exp2(23 - 254 / 8.0);
    h.nodes.resize(1);
    h.nodes[0].centre = {1 << 20, 1 << 20, 0};
    h.nodes[0].radius = 1.5 * (1 << 20);
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        const Node n = h.nodes[i];
        const double size = h.cellSize(n);
        const uint32_t code = n.level + 1u == levels ? 0 : h.errors.encodeUp(size / 64 * 0.3);
        const uint32_t parentCode = i == 0 ? 255 : h.errors.encodeUp(2 * size / 64 * 0.3);
        Node& to = h.nodes[i];
        to.records = 4000;
        to.errorCode = static_cast<uint8_t>(code);
        for (const auto& [counts, at] : {std::pair{&to.ownCounts, code}, std::pair{&to.parentCounts, parentCode}}) {
            counts->first = static_cast<uint32_t>(h.greaterThan.size());
            counts->lo = static_cast<uint8_t>(at == 255 ? 255 : at > 8 ? at - 8 : 0);  // the root's have no parent
            counts->hi = static_cast<uint8_t>(at);
            for (uint32_t c = counts->lo; c < counts->hi; ++c) h.greaterThan.push_back(4000 * (at - c) / 9);
        }
        if (n.level + 1u == levels) continue;
        to.childMask = 15;
        to.firstChild = static_cast<uint32_t>(h.nodes.size());
        for (uint32_t o = 0; o < 4; ++o) {
            Node child;
            child.level = static_cast<uint8_t>(n.level + 1);
            child.parent = static_cast<uint32_t>(i);
            child.centre = n.centre + glm::dvec3((o & 1 ? 1 : -1) * size / 4, (o & 2 ? 1 : -1) * size / 4, 0);
            child.radius = n.radius / 2;
            h.nodes.push_back(child);
        }
    }
    return h;
}

void selectCutBudget(benchmark::State& state) {
    using namespace stipple::lod;
    const Hierarchy h = flatTerrain(9);  // 87,381 nodes
    const std::vector<const Hierarchy*> hierarchies{&h};
    const std::vector<Instance> instances(1);
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(h.nodes.size(), 1)};
    CutScratch scratch;
    Cut cut;
    View view;
    view.forward = glm::normalize(glm::dvec3(0.1, 1, -0.3));
    view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0, 0, 1)));
    view.down = glm::cross(view.forward, view.right);
    view.eye = {1 << 20, -(1 << 17), 1 << 17};
    view.width = 1920;
    view.height = 1080;
    const Budgets budgets{0.5, static_cast<uint64_t>(state.range(0))};
    selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, scratch, cut);
    allocations = 0;
    for (auto _ : state) selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, scratch, cut);
    state.counters["allocations"] = static_cast<double>(allocations);
    state.counters["nodes"] = static_cast<double>(h.nodes.size());
    state.counters["drawn"] = static_cast<double>(cut.counters.nodesDrawn);
    state.counters["records"] = static_cast<double>(cut.counters.recordsDrawn);
    state.counters["tau_px"] = cut.tauEffective;
}
BENCHMARK(selectCutBudget)->Arg(1'000'000)->Arg(5'000'000)->Unit(benchmark::kMillisecond);

}  // namespace

void* operator new(size_t bytes) {
    ++allocations;
    if (void* p = std::malloc(bytes)) return p;
    throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }
