#include "engine/render/frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>
#include <unordered_map>

#include "engine/base/process.h"
#include "engine/render/effects/table.h"
#include "engine/render/frame_passes.h"
#include "engine/render/layered_frame.h"
#include "engine/render/length_unit.h"
#include "engine/render/picture_tone.h"
#include "engine/render/shadow_frame.h"
#include "engine/render/views.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/attributes.h"
#include "lod/store/check.h"
#include "lod/store/materials.h"

namespace stipple::render {

namespace {

/// The last steps of a chunk's decoding: other colours than its own, materials; of triangles, that theirs are there.
streaming::ChunkFinish finishOf(const PlacedStore& placed) {
    const lod::ColourBy by = placed.colour;
    const bool hasTriangles = !placed.store->hierarchy.groups.empty();
    const bool hasMaterials = placed.store->hierarchy.hasMaterials;
    if (placed.store->hierarchy.isGraph || (hasTriangles && by.mode == lod::ColourMode::own && !hasMaterials))
        return {false, [store = placed.store](uint32_t index, lod::Chunk& chunk, const uint8_t*, size_t) {
                    return lod::checkMaterials(*store, chunk, fmt::format("{}: chunk {}", store->path, index));
                }};
    if (by.mode == lod::ColourMode::own && !hasMaterials) return {};
    const auto apply = [by, store = placed.store](uint32_t index, lod::Chunk& chunk, const uint8_t* bytes,
                                                  size_t count) -> Result<void> {
        if (!chunk.vertices.empty())
            return lod::checkMaterials(*store, chunk, fmt::format("{}: chunk {}", store->path, index));
        if (!chunk.patchBlocks.empty()) {
            lod::recolour(by, *store, index, chunk, {});
            return lod::addMaterials(*store, index, chunk);
        }
        std::vector<uint8_t> values;
        if (by.needsAttributes()) {
            const auto& attributes = store->description.attributes;
            const uint32_t records = store->hierarchy.payload(index).records;
            STIPPLE_ASSIGN(values, lod::decodeAttribute(bytes, count, attributes, by.attribute, records,
                                                        fmt::format("{}: chunk {}", store->path, index)));
        }
        lod::recolour(by, *store, index, chunk, values);
        return lod::addMaterials(*store, index, bytes, count, chunk);
    };
    return {by.needsAttributes() || hasMaterials, apply};
}

/// Patches become points, once all else is done with them.
streaming::ChunkFinish withSamples(streaming::ChunkFinish of, const PlacedStore& placed) {
    return {of.wantsAttributes,
            [of, store = placed.store](uint32_t index, lod::Chunk& chunk, const uint8_t* bytes,
                                       size_t count) -> Result<void> {
                if (of.apply) STIPPLE_TRY(of.apply(index, chunk, bytes, count));
                lod::samplesAsPoints(store->hierarchy, index, chunk);
                return {};
            }};
}

/// Adds placed stores to a state: each store once, and one source of chunks for all that look alike.
class Placer {
  public:
    explicit Placer(FrameState& state) : state_(state) {}

    /// Number of the new instance.
    uint32_t add(const PlacedStore& p) {
        lod::Instance instance = p.place;
        instance.hierarchy = hierarchyOf(p.store);
        instance.source = sourceOf(p);
        instance.isDriven = p.isMember;
        state_.instances.push_back(instance);
        return static_cast<uint32_t>(state_.instances.size() - 1);
    }

    /// Number of the instance itself; those of its proxies follow.
    uint32_t addWithProxies(const PlacedStore& p) {
        const uint32_t own = add(p);
        uint32_t last = own;
        for (size_t k = 0; p.proxies && k < p.proxies->size(); ++k) {
            const Proxy& proxy = (*p.proxies)[k];
            const uint32_t points = add({proxy.store, p.place, {}});
            state_.instances[last].proxy = points;
            state_.instances[points].inputError = proxy.error * p.place.scale;
            state_.instances[points].isDriven = true;
            last = points;
        }
        return own;
    }

    uint32_t sources() const { return sources_; }

    /// `numbers`: instances of the placed stores.
    void addGroup(const PlacedGroup& from, const std::vector<uint32_t>& numbers) {
        lod::InstanceGroup group;
        group.points = add({from.points, {}, {}});
        lod::Instance& points = state_.instances[group.points];
        points.group = static_cast<uint32_t>(state_.groups.size());
        group.first = from.first;
        group.members.reserve(from.members.size());
        std::set<uint32_t> sources;
        for (const uint32_t m : from.members) {
            group.members.push_back(numbers[m]);
            for (uint32_t i = numbers[m]; i != lod::Instance::kNone; i = state_.instances[i].proxy)
                sources.insert(state_.instances[i].source);
        }
        group.sources.assign(sources.begin(), sources.end());
        state_.groups.push_back(std::move(group));
    }

  private:
    uint32_t hierarchyOf(const std::shared_ptr<const lod::Store>& store) {
        const auto [known, isNew] = numbers_.try_emplace(store.get(), static_cast<uint32_t>(state_.stores.size()));
        if (!isNew) return known->second;
        state_.stores.push_back(store);
        state_.hierarchies.push_back(&store->hierarchy);
        state_.draws.firstMaterial.push_back(static_cast<uint32_t>(state_.materials.size()));
        state_.draws.pointMaterial.push_back(lod::defaultMaterial(store->description));
        state_.materials.insert(state_.materials.end(), store->description.materials.begin(),
                                store->description.materials.end());
        return known->second;
    }
    /// Two stores that are the same get the same records, unless coloured by something else than themselves.
    uint32_t sourceOf(const PlacedStore& p) {
        const bool isPlain = p.store->hierarchy.isMesh() || p.colour.mode == lod::ColourMode::own;
        if (isPlain)
            if (const auto known = plainSources_.find(p.store.get()); known != plainSources_.end())
                return known->second;
        const uint32_t number = sources_++;
        if (isPlain) plainSources_[p.store.get()] = number;
        state_.discSizes->addSource(p.store->hierarchy);
        state_.streamer->addSource(p.store->hierarchy, p.store->file, p.store->path,
                                   p.patchesAreSamples ? withSamples(finishOf(p), p) : finishOf(p), p.store->pages);
        return number;
    }

    FrameState& state_;
    std::unordered_map<const lod::Store*, uint32_t> numbers_, plainSources_;
    uint32_t sources_ = 0;
};

}  // namespace

std::unique_ptr<FrameState> makeFrameState(const std::vector<PlacedStore>& placed, Backend& backend, Executor& executor,
                                           const streaming::StreamSettings& settings,
                                           const std::vector<PlacedGroup>& groups) {
    auto state = std::make_unique<FrameState>();
    state->backend = &backend;
    state->executor = &executor;
    state->executorLife = executor.life();
    state->backendLife = backend.life();
    state->discSizes = std::make_unique<DiscSizes>(backend);
    state->streamer = std::make_unique<streaming::Streamer>(executor, *state->discSizes, settings);
    Placer placer(*state);
    std::vector<uint32_t> numbers;
    numbers.reserve(placed.size());
    for (const PlacedStore& p : placed) numbers.push_back(placer.addWithProxies(p));
    for (const PlacedGroup& group : groups) placer.addGroup(group, numbers);
    state->draws.firstSource = backend.claimSources(placer.sources());
    state->discSizes->setFirstSource(state->draws.firstSource);
    state->draws.materials = state->materials;
    state->draws.effectsOfScene = effectsOfScene({state->hierarchies, state->instances});
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

namespace {

/// Gaussians are known as far as shaders/shared/ewa.h has them.
Result<void> checkFilter(const DrawSettings& s) {
    if (!(s.kernelSupport >= 1 && s.kernelSupport <= 4))
        return fail(ErrorKind::usage, "kernels end between 1 and 4 standard deviations", "kernelSupport",
                    "take 2 or 3");
    if (!(s.lowPass >= 0 && s.lowPass <= 64))
        return fail(ErrorKind::usage, "the low-pass is between 0 and 64 px^2", "lowPass", "take 0.5");
    return {};
}

Result<void> drawPicture(FrameState& state, const RenderRequest& request) {
    if (request.staysOnDevice) {  // where that fails, what was there before is
        STIPPLE_ASSIGN(state.onDevice, state.backend->submit(request));
        return {};
    }
    STIPPLE_TRY(state.backend->render(request, state.image));
    state.onDevice.reset();
    // Depths count from the eye that was asked for.
    if (state.draws.eyeAdvanced != 0)
        for (float& depth : state.image.depth)
            depth = depth > 0 ? static_cast<float>(double{depth} + state.draws.eyeAdvanced) : depth;
    return {};
}

void count(std::span<const Pass> passes, EffectSet requested, FrameState& state) {
    EffectsOfFrame& e = state.effects;
    e.requested.bits |= requested.bits;
    e.shown.bits |= state.draws.effects.bits;
    e.passes.resize(effects().size());
    for (const Pass pass : passes)
        if (const auto of = effectOfPass(pass)) ++e.passes[*of];
}

}  // namespace

Result<uint64_t> drawNodes(FrameState& state, const lod::Cut& cut, const lod::View& view,
                           const FrameSettings& settings) {
    DrawSettings settingsOfMode = settings.draw;
    settingsOfMode.exactCurves = std::min(settings.draw.exactCurves, reconstructionOf(settings.mode).exactCurves);
    makeDrawList(cut, state.hierarchies, state.instances, view, settingsOfMode, state.draws);
    markDiscSizes(*state.discSizes, state.draws);
    RenderRequest request;
    request.draws = &state.draws;
    request.mode = settings.mode;
    request.passes = passesOf(settings.mode, contentOf(state.draws), state.draws.effects);
    request.wantDepthAndNormal = settings.wantDepthAndNormal;
    request.staysOnDevice = settings.staysOnDevice;
    // (What is hidden within a layer is another picture's each time: nothing is known of it.)
    request.mayHideNodes = settings.mayHideNodes && settings.draw.layer == nullptr && !settings.draw.isBlended;
    request.tellsHiddenNodes = settings.tellsHiddenNodes;
    if (request.mayHideNodes) addErrors(state.hierarchies, state.instances, state.draws);
    count(request.passes, requestedEffects(state.draws.effectsOfScene, settings.draw), state);
    STIPPLE_TRY(drawPicture(state, request));
    const HiddenCounts hidden = state.backend->hidden();
    state.counters.nodesHidden += hidden.nodes;
    state.counters.recordsHidden += hidden.records;
    if (request.mayHideNodes) state.unrefined.take(*state.backend, state.draws);
    return request.passes.size();
}

namespace {

/// Draws state.cut, which has no layers, in a unit of length that suits it.
Result<uint64_t> drawPlain(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    const double units = settings.draw.shadows ? settings.draw.shadows->units  // their maps are in them
                                               : unitsOfLength(state.cut, state.hierarchies, state.instances, view);
    if (units == 1) return drawNodes(state, state.cut, view, settings);
    FrameSettings converted = settings;
    converted.draw = inUnits(settings.draw, units);
    inUnits(state.instances, units, state.inUnits);
    std::swap(state.instances, state.inUnits);  // the draw list refers to them
    const auto passes = drawNodes(state, state.cut, inUnits(view, units), converted);
    std::swap(state.instances, state.inUnits);
    inWorldUnits(state.image.depth, units);
    return passes;
}

}  // namespace

namespace {

/// The same, with a metered exposure: the whole picture is there before that is known.
Result<uint64_t> drawMetered(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    FrameSettings plain = settings;
    plain.wantDepthAndNormal = true;
    plain.staysOnDevice = false;
    takeTone(plain.draw);
    STIPPLE_ASSIGN(const uint64_t passes, drawPlain(state, view, plain));
    toneImage(settings.draw, view, state.image, *state.executor);
    if (!settings.wantDepthAndNormal) {
        state.image.depth.clear();
        state.image.normal.clear();
        state.image.linear.clear();
    }
    return passes;
}

/// Tone on the whole picture is no pass, but the frame shows it.
void addTone(const DrawSettings& settings, EffectsOfFrame& shown) {
    DrawSettings asked = settings;
    for (size_t e = 0; e < effects().size(); ++e)
        if (std::string_view(effects()[e]->name) == "tone" && takeTone(asked)) {
            shown.requested.add(e);
            shown.shown.add(e);
        }
}

}  // namespace

Result<void> drawCut(FrameState& state, const lod::View& view, const FrameSettings& settings, double start,
                     double cutMs) {
    STIPPLE_TRY(checkFilter(settings.draw));
    uint64_t passes = 0;
    state.effects = {};
    state.counters.nodesHidden = state.counters.recordsHidden = 0;
    state.unrefined.forget();
    if (hasLayers(state, view, settings)) {
        STIPPLE_ASSIGN(passes, drawLayered(state, view, settings));
        state.unrefined.forget();  // through glass other things are seen
        addTone(settings.draw, state.effects);
    } else if (isMetered(settings.draw)) {
        STIPPLE_ASSIGN(passes, drawMetered(state, view, settings));
        addTone(settings.draw, state.effects);
    } else {
        STIPPLE_ASSIGN(passes, drawPlain(state, view, settings));
    }

    FrameCounters& c = state.counters;
    const lod::CutCounters& cut = state.cut.counters;
    const streaming::StreamCounters& stream = state.streamer->counters();
    c.nodesVisited = cut.nodesVisited;
    c.nodesDrawn = cut.nodesDrawn;
    c.nodesCulled = cut.nodesCulled;
    c.nodesMissing = cut.nodesMissing;
    c.recordsDrawn = cut.recordsDrawn;
    c.recordsTested = cut.recordsTested;
    c.trianglesDrawn = cut.trianglesDrawn;
    c.proxies = cut.proxies;
    c.groupMembers = cut.groupMembers;
    c.nodesSwaying = state.draws.swaying;
    c.cutEvaluations = cut.evaluations;
    c.budgetTruncated = state.cut.truncated;
    c.tauTargetPixels = state.cut.tauTarget;
    c.tauEffectivePixels = state.cut.tauEffective;
    c.passes = passes;
    c.blocks = state.draws.points().blocks.size();
    c.bytesStreamed = stream.bytesStreamed;
    c.residentBytes = stream.residentBytes;
    c.requests = stream.requests;
    c.uploads = stream.uploads;
    c.evictions = stream.evictions;
    c.failures = stream.failures;
    c.refused = stream.refused;
    c.requestsInFlight = stream.inFlight;
    c.cutMs = cutMs;
    c.frameMs = (nowSeconds() - start) * 1e3;
    return {};
}

namespace {

bool leavesHiddenCoarse(const FrameSettings& settings) {
    return settings.leavesHiddenCoarse && settings.mayHideNodes && settings.budgets.records != lod::Budgets{}.records;
}

/// From `start` on (seconds) it counts as time of the frame.
Result<void> draw(FrameState& state, const lod::View& view, const FrameSettings& settings, double start, bool asks) {
    streaming::Streamer& streamer = *state.streamer;
    const double cutStart = nowSeconds();
    FrameSettings shaded = settings;
    if (leavesHiddenCoarse(settings)) shaded.budgets.unrefined = state.unrefined.nodes();
    lod::selectCut(state.scene(), streamer.residency(), view, shaded.budgets, state.scratch, state.cut);
    const double cutEnd = nowSeconds();
    constexpr uint64_t kMostModes = 16;
    shaded.draw.frameTag = (streamer.counters().uploads + streamer.counters().evictions) * kMostModes +
                           static_cast<uint64_t>(settings.mode);
    for (const Effect* e : effects())
        if (e->before != nullptr && !state.backendLife.expired())
            STIPPLE_TRY(e->before->draw(state, view, shaded, asks));
    addViewsFromBehind(state, view, settings);
    if (asks) streamer.request(state.cut);
    return drawCut(state, view, shaded, start, (cutEnd - cutStart) * 1e3);
}

/// After a picture of its own: true if the next one of the view leaves other nodes coarse.
bool learnHidden(FrameState& state, const FrameSettings& settings) {
    const bool isShort = state.cut.tauTarget > 1.001 * settings.budgets.errorPixels && !state.cut.truncated;
    const bool isOther = leavesHiddenCoarse(settings) && state.unrefined.learn(state.cut, isShort);
    state.counters.nodesLeftCoarse = leavesHiddenCoarse(settings) ? state.unrefined.drawn() : 0;
    state.counters.nodesSeenCoarse = leavesHiddenCoarse(settings) ? state.unrefined.seen() : 0;
    return isOther;
}

}  // namespace

namespace {

Result<void> checkAlive(const FrameState& state) {
    if (state.backendLife.expired() || state.executorLife.expired())
        return fail(ErrorKind::device, "what draws the scene is gone", "the frame",
                    "keep the backend and the executor while it is used");
    return {};
}

}  // namespace

Result<void> renderFrame(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    STIPPLE_TRY(checkAlive(state));
    const double start = nowSeconds();
    state.streamer->collect();
    state.streamer->upload();
    state.unrefined.clear();  // it is known of one view, and nobody waits for pictures that look again
    state.counters.nodesLeftCoarse = state.counters.nodesSeenCoarse = 0;
    return draw(state, view, settings, start, true);
}

Result<void> renderResident(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    STIPPLE_TRY(checkAlive(state));
    return draw(state, view, settings, nowSeconds(), false);
}

namespace {

/// Bodies from behind, what effects look at: makes state.plan, which is of `view` alone, that of all views together.
void planFurtherViews(FrameState& state, const lod::View& view, const FrameSettings& settings,
                      std::span<const std::pair<uint32_t, uint32_t>> barred) {
    std::vector<lod::ViewRequest> views{{view, settings.budgets.errorPixels, false, settings.budgets.unrefined}};
    addRequestsFromBehind(state, view, settings, views);
    for (const Effect* e : effects())
        if (e->before != nullptr) e->before->addViews(state, view, settings, views);
    if (views.size() == 1) return;
    lod::planResident(state.scene(), views, settings.budgets.records, state.streamer->residentLimit(), barred,
                      state.planScratch, state.planCut, state.plan);
}

/// Waits until the plan is resident, as far as it can be.
Result<void> await(const lod::ResidentPlan& plan, streaming::Streamer& streamer) {
    streamer.makeRoomFor(plan);
    for (;;) {
        streamer.collect();
        streamer.upload();
        const uint64_t before = streamer.counters().requests;
        streamer.request(plan);
        if (streamer.isIdle() && streamer.counters().requests == before) return {};
        streamer.wait();
        if (isStopRequested()) return fail(ErrorKind::interrupted, "interrupted");
    }
}

/// Waits for what planResident says of the view, and draws it: true if nothing is missing.
Result<bool> drawComplete(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    streaming::Streamer& streamer = *state.streamer;
    streamer.wait();
    streamer.collect();
    auto barred = streamer.failed(false);
    for (;;) {
        lod::planResident(state.scene(), view, settings.budgets, streamer.residentLimit(), barred, state.scratch,
                          state.cut, state.plan);
        bool arePagesNew = streamer.readPages(state.plan.unknown);
        if (!arePagesNew) {
            planFurtherViews(state, view, settings, barred);
            arePagesNew = streamer.readPages(state.plan.unknown);
        }
        if (arePagesNew && isStopRequested()) return fail(ErrorKind::interrupted, "interrupted");
        if (arePagesNew) continue;
        const uint64_t failures = streamer.counters().failures;
        STIPPLE_TRY(await(state.plan, streamer));
        if (streamer.counters().failures == failures) break;
        // Something else may be shown in the place of what cannot be read.
        const auto more = streamer.failed(true);
        barred.insert(barred.end(), more.begin(), more.end());
    }
    STIPPLE_TRY(renderResident(state, view, settings));
    return state.cut.wanted.empty();
}

}  // namespace

Result<bool> renderUntilComplete(FrameState& state, const lod::View& view, const FrameSettings& settings) {
    STIPPLE_TRY(checkAlive(state));
    state.unrefined.clear();
    state.unrefined.beginView(view);
    constexpr int kMostPictures = 8;  // each but the first few refines something again for good
    for (int picture = 1;; ++picture) {
        FrameSettings asked = settings;
        asked.tellsHiddenNodes = leavesHiddenCoarse(settings);
        if (asked.tellsHiddenNodes) asked.budgets.unrefined = state.unrefined.nodes();
        STIPPLE_ASSIGN(const bool isComplete, drawComplete(state, view, asked));
        if (!learnHidden(state, settings)) return isComplete;
        if (picture + 1 >= kMostPictures) state.unrefined.clear();  // and nothing is left coarse
        if (picture == kMostPictures) return isComplete;
    }
}

}  // namespace stipple::render
