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
        case Pass::strands:
            return "strands";
        case Pass::rasterise:
            return "rasterise";
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

std::vector<Pass> passesOf(Mode mode, const FrameContent& content) {
    std::vector<Pass> passes{Pass::clear};
    if (content.hasPoints) passes.push_back(Pass::project);
    if (content.hasStrands) passes.push_back(Pass::strands);
    if (content.hasTriangles) passes.push_back(Pass::rasterise);
    passes.push_back(Pass::resolve);
    // Triangles keep their exact pixels: only splats are reconstructed. The last push and the shading are one pass:
    // each pixel is touched once.
    if (mode == Mode::pullpush && (content.hasPoints || content.hasStrands)) {
        passes.push_back(Pass::pull);
        passes.push_back(Pass::push);
    }
    passes.push_back(Pass::shade);
    return passes;
}

namespace {

/// Normals are stored along the store's own axes, and shaders know one rotation for all: a turned instance gets turned
/// records.
void turnNormals(const glm::dmat3& rotation, lod::Chunk& chunk) {
    const auto turned = [&](uint32_t code) {
        const shared::vec3 n = shared::octDecode(code);
        return lod::octEncode(glm::vec3(rotation * glm::dvec3(n.x, n.y, n.z)));
    };
    for (shared::StrandSegment& s : chunk.segments) {
        s.a.direction = turned(s.a.direction);
        s.b.direction = turned(s.b.direction);
    }
    for (shared::PointRecord& r : chunk.records) {
        if ((shared::recordFlags(r) & shared::kFlagNoNormal) != 0) continue;
        r.normal = turned(r.normal);
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

/// Do both get the same records?
bool looksLike(const PlacedStore& a, const PlacedStore& b) {
    return a.place.rotation == b.place.rotation && a.colour.mode == b.colour.mode &&
           (a.colour.mode == lod::ColourMode::own || &a == &b);
}

}  // namespace

std::unique_ptr<FrameState> makeFrameState(const std::vector<PlacedStore>& placed, Backend& backend, Executor& executor,
                                           const streaming::StreamSettings& settings) {
    auto state = std::make_unique<FrameState>();
    state->backend = &backend;
    state->streamer = std::make_unique<streaming::Streamer>(executor, backend, settings);
    std::vector<const PlacedStore*> sources;
    const auto add = [&](const PlacedStore& p) {
        lod::Instance instance = p.place;
        const auto known = std::find(state->stores.begin(), state->stores.end(), p.store);
        instance.hierarchy = static_cast<uint32_t>(known - state->stores.begin());
        if (known == state->stores.end()) {
            state->stores.push_back(p.store);
            state->hierarchies.push_back(&p.store->hierarchy);
            state->draws.firstMaterial.push_back(static_cast<uint32_t>(state->materials.size()));
            state->materials.insert(state->materials.end(), p.store->description.materials.begin(),
                                    p.store->description.materials.end());
        }
        const auto like = std::find_if(sources.begin(), sources.end(), [&](const PlacedStore* q) {
            return q->store == p.store && (p.store->hierarchy.isMesh() || looksLike(*q, p));
        });
        instance.source = static_cast<uint32_t>(like - sources.begin());
        if (like == sources.end()) {
            sources.push_back(&p);
            state->streamer->addSource(p.store->hierarchy, streaming::makeFileSource(p.store->file), p.store->path,
                                       p.store->hierarchy.isMesh() ? streaming::ChunkFinish{} : finishOf(p));
        }
        state->instances.push_back(instance);
    };
    std::vector<PlacedStore> standIns;
    standIns.reserve(placed.size());  // addresses are kept
    for (const PlacedStore& p : placed) {
        add(p);
        if (!p.standIn) continue;
        lod::Instance& mesh = state->instances.back();
        mesh.standIn = static_cast<uint32_t>(state->instances.size());
        mesh.standInError = p.standInError * p.place.scale;
        standIns.push_back({p.standIn, p.place, {}});
        add(standIns.back());
        state->instances.back().isStandIn = true;
    }
    state->draws.materials = state->materials;
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
    request.passes = passesOf(
        settings.mode, {!state.draws.nodes.empty(), !state.draws.meshDraws.empty(), !state.draws.strandNodes.empty()});
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
    c.trianglesDrawn = cut.trianglesDrawn;
    c.standIns = cut.standIns;
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
