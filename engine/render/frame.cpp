#include "engine/render/frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "engine/base/process.h"
#include "lod/attributes.h"
#include "lod/octahedral.h"

namespace stipple::render {

const char* passName(Pass pass) {
    switch (pass) {
        case Pass::clear:
            return "clear";
        case Pass::project:
            return "project";
        case Pass::resolve:
            return "resolve";
        case Pass::pull:
            return "pull";
        case Pass::push:
            return "push";
        case Pass::shade:
            return "shade";
    }
    return "?";
}

std::vector<Pass> passesOf(Mode mode) {
    if (mode == Mode::points) return {Pass::clear, Pass::project, Pass::resolve, Pass::shade};
    // The last push and the shading are one pass: each pixel is touched once.
    return {Pass::clear, Pass::project, Pass::resolve, Pass::pull, Pass::push, Pass::shade};
}

namespace {

/// Normals are stored along the store's own axes, and shaders know one rotation for all: a turned instance gets turned
/// records.
void turnNormals(const glm::dmat3& rotation, lod::Chunk& chunk) {
    for (shared::PointRecord& r : chunk.records) {
        if ((shared::recordFlags(r) & shared::kFlagNoNormal) != 0) continue;
        const shared::vec3 n = shared::octDecode(r.normal);
        r.normal = lod::octEncode(glm::vec3(rotation * glm::dvec3(n.x, n.y, n.z)));
    }
}

/// The last steps of a chunk's decoding: other colours than its own, other directions.
streaming::ChunkFinish finishOf(const PlacedStore& placed) {
    const lod::ColourBy by = placed.colour;
    const glm::dmat3 rotation = placed.place.rotation;
    const bool isTurned = rotation != glm::dmat3(1);
    if (by.mode == lod::ColourMode::own && !isTurned) return {};
    const auto apply = [by, rotation, isTurned, store = placed.store](
                           uint32_t node, lod::Chunk& chunk, const uint8_t* bytes, size_t count) -> Result<void> {
        std::vector<uint8_t> values;
        if (by.needsAttributes()) {
            const auto& attributes = store->description.attributes;
            const uint32_t records = store->hierarchy.nodes[node].records;
            STIPPLE_ASSIGN(values, lod::decodeAttribute(bytes, count, attributes, by.attribute, records,
                                                        fmt::format("{}: node {}", store->path, node)));
        }
        if (by.mode != lod::ColourMode::own) lod::recolour(by, *store, node, chunk, values);
        if (isTurned) turnNormals(rotation, chunk);
        return {};
    };
    return {by.needsAttributes(), apply};
}

}  // namespace

std::unique_ptr<FrameState> makeFrameState(const std::vector<PlacedStore>& placed, Backend& backend, Executor& executor,
                                           const streaming::StreamSettings& settings) {
    auto state = std::make_unique<FrameState>();
    state->backend = &backend;
    state->streamer = std::make_unique<streaming::Streamer>(executor, backend, settings);
    for (const PlacedStore& p : placed) {
        lod::Instance instance = p.place;
        const auto known = std::find(state->stores.begin(), state->stores.end(), p.store);
        instance.hierarchy = static_cast<uint32_t>(known - state->stores.begin());
        if (known == state->stores.end()) {
            state->stores.push_back(p.store);
            state->hierarchies.push_back(&p.store->hierarchy);
        }
        state->instances.push_back(instance);
        state->streamer->addInstance(p.store->hierarchy, streaming::makeFileSource(p.store->file), p.store->path,
                                     finishOf(p));
    }
    return state;
}

std::unique_ptr<FrameState> makeFrameState(std::vector<std::shared_ptr<const lod::Store>> stores, Backend& backend,
                                           Executor& executor, const streaming::StreamSettings& settings,
                                           const lod::ColourBy& colour) {
    std::vector<PlacedStore> placed;
    placed.reserve(stores.size());
    for (auto& store : stores) placed.push_back({std::move(store), {}, colour});
    return makeFrameState(placed, backend, executor, settings);
}

Result<void> renderFrame(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    const double start = nowSeconds();
    streaming::Streamer& streamer = *state.streamer;
    streamer.collect();
    streamer.upload();
    const double cutStart = nowSeconds();
    lod::selectCut(state.hierarchies, state.instances, streamer.residency(), view, settings.budgets, state.scratch,
                   state.cut);
    const double cutEnd = nowSeconds();
    streamer.request(state.cut);
    makeDrawList(state.cut, state.hierarchies, state.instances, view, settings.draw, state.draws);
    RenderRequest request;
    request.draws = &state.draws;
    request.passes = passesOf(settings.mode);
    request.wantDepthAndNormal = settings.wantDepthAndNormal;
    STIPPLE_TRY(state.backend->render(request, state.image));

    FrameCounters& c = state.counters;
    const lod::CutCounters& cut = state.cut.counters;
    const streaming::StreamCounters& stream = streamer.counters();
    c.nodesVisited = cut.nodesVisited;
    c.nodesDrawn = cut.nodesDrawn;
    c.nodesCulled = cut.nodesCulled;
    c.nodesMissing = cut.nodesMissing;
    c.recordsDrawn = cut.recordsDrawn;
    c.recordsTested = cut.recordsTested;
    c.cutEvaluations = cut.evaluations;
    c.budgetTruncated = state.cut.truncated;
    c.tauTargetPixels = state.cut.tauTarget;
    c.tauEffectivePixels = state.cut.tauEffective;
    c.passes = request.passes.size();
    c.blocks = state.draws.blocks.size();
    c.bytesStreamed = stream.bytesStreamed;
    c.residentBytes = stream.residentBytes;
    c.requests = stream.requests;
    c.uploads = stream.uploads;
    c.evictions = stream.evictions;
    c.failures = stream.failures;
    c.refused = stream.refused;
    c.requestsInFlight = stream.inFlight;
    c.cutMs = (cutEnd - cutStart) * 1e3;
    c.frameMs = (nowSeconds() - start) * 1e3;
    return {};
}

Result<bool> renderUntilComplete(FrameState& state, const lod::View& view, const FrameSettings& settings,
                                 Executor& executor) {
    streaming::Streamer& streamer = *state.streamer;
    for (;;) {
        streamer.collect();
        streamer.upload();
        lod::selectCut(state.hierarchies, state.instances, streamer.residency(), view, settings.budgets, state.scratch,
                       state.cut);
        const uint64_t before = streamer.counters().requests;
        streamer.request(state.cut);
        if (streamer.isIdle() && streamer.counters().requests == before) break;
        executor.wait();
    }
    STIPPLE_TRY(renderFrame(state, view, settings));
    return state.cut.wanted.empty();
}

}  // namespace stipple::render
