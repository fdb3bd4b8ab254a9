// One frame, as a straight line (ARCHITECTURE, "One frame").
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/counters.h"
#include "engine/render/backend.h"
#include "engine/render/disc_sizes.h"
#include "engine/render/unrefined.h"
#include "lod/cut/views.h"
#include "lod/store/colour.h"
#include "lod/store/store.h"
#include "streaming/streamer.h"

namespace stipple::render {

struct LayeredFrame;
struct ShadowFrame;

/// Of the last frame, with all its layers.
struct EffectsOfFrame {
    EffectSet requested, shown;
    std::vector<uint64_t> passes;  ///< recorded of each of the table
};

struct FrameSettings {
    lod::Budgets budgets;
    Mode mode = Mode::pullpush;
    DrawSettings draw;
    bool wantDepthAndNormal = false;
    bool staysOnDevice = false;     ///< see RenderRequest: FrameState::onDevice, and no image
    bool mayHideNodes = true;       ///< see RenderRequest: it changes no picture
    bool tellsHiddenNodes = false;  ///< see RenderRequest
    /// Where the budget of records does not do, what is hidden is not refined (unrefined.h): the error of what is seen
    /// is smaller for it. Until a picture is complete that may take several.
    bool leavesHiddenCoarse = false;
};

/// Everything a frame walks through, owned in one place.
struct FrameState {
    std::vector<std::shared_ptr<const lod::Store>> stores;
    std::vector<const lod::Hierarchy*> hierarchies;
    std::vector<lod::Instance> instances;
    std::vector<lod::InstanceGroup> groups;
    std::vector<lod::Instance> inUnits;  ///< instances as the last frame had them, if its unit of length was another
    std::vector<shared::SurfaceMaterial> materials;  ///< of all stores, one after another
    std::unique_ptr<DiscSizes> discSizes;            ///< between streamer and backend
    std::unique_ptr<streaming::Streamer> streamer;   // evicts at its end
    Backend* backend = nullptr;
    Executor* executor = nullptr;
    std::weak_ptr<const void> executorLife;
    std::weak_ptr<const void> backendLife;
    lod::CutScratch scratch;
    lod::Cut cut;
    lod::ResidentPlan plan;
    DrawList draws;
    Image image;
    std::shared_ptr<LayeredFrame> layered;  ///< of scenes with glass, from the first such frame on (layered_frame.h)
    std::shared_ptr<ShadowFrame> shadows;   ///< of frames with lights that cast them (shadow_frame.h)
    lod::ViewsScratch planScratch;          ///< of frames of several views, for what they plan
    lod::CutOfViews planCut;
    std::optional<Ticket> onDevice;  ///< of the last frame, if its picture stays there
    FrameCounters counters;
    EffectsOfFrame effects;
    Unrefined unrefined;

    lod::CutScene scene() const { return {hierarchies, instances, groups}; }
};

/// Points that may be drawn in another store's stead, and how far they are from it (store units; of a stochastic
/// store: 0, it says so itself).
struct Proxy {
    std::shared_ptr<const lod::Store> store;
    double error = 0;
};
/// A store somewhere in the scene, coloured in some way.
struct PlacedStore {
    std::shared_ptr<const lod::Store> store;
    lod::Instance place;  ///< its `hierarchy` is set by makeFrameState
    lod::ColourBy colour;
    std::shared_ptr<const std::vector<Proxy>> proxies = nullptr;  ///< finer ones first
    bool isMember = false;                                        ///< of an instance group
    /// Its patches are points, as DrawSettings::patchAs has to say too (lod::kPatchesAsSamples). All stores of a scene,
    /// or none.
    bool patchesAreSamples = false;
};
/// Many placed stores that are seen as one from afar, see lod::InstanceGroup.
struct PlacedGroup {
    std::shared_ptr<const lod::Store> points;  ///< stochastic, world coordinates
    std::vector<uint32_t> first, members;      ///< of the nodes of `points`; members count the placed stores
};
/// The same store may be placed many times.
std::unique_ptr<FrameState> makeFrameState(const std::vector<PlacedStore>& placed, Backend& backend, Executor& executor,
                                           const streaming::StreamSettings& settings,
                                           const std::vector<PlacedGroup>& groups = {});
/// One instance of each store, at its own place, coloured by `colour`.
std::unique_ptr<FrameState> makeFrameState(std::vector<std::shared_ptr<const lod::Store>> stores, Backend& backend,
                                           Executor& executor, const streaming::StreamSettings& settings,
                                           const lod::ColourBy& colour = {});

/// Draws one frame into state.image and fills state.counters: with what arrived by now, asking for what is missing.
Result<void> renderFrame(FrameState& state, const lod::View& view, const FrameSettings& settings);
/// The same with what is resident: it takes nothing in and asks for nothing.
Result<void> renderResident(FrameState& state, const lod::View& view, const FrameSettings& settings);

/// Waits for what planResident says of the view and draws it; true if nothing that the view wants is missing. The
/// picture is the same whatever was drawn before and however long reading took.
Result<bool> renderUntilComplete(FrameState& state, const lod::View& view, const FrameSettings& settings);

}  // namespace stipple::render
