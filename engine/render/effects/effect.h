// An effect is a manifest: when it is called for, what it does to nodes and tables, its passes, and how far off it may
// be. A frame has it where it is requested, where the scene could show it, and where this frame does.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <vector>

#include "engine/base/result.h"
#include "engine/render/content.h"
#include "engine/render/effects/facts.h"
#include "engine/render/passes.h"
#include "engine/render/wind.h"
#include "lod/cut/cut.h"
#include "lod/cut/views.h"

namespace stipple::render {

struct DrawSettings;
struct DrawList;
struct FrameState;
struct FrameSettings;

/// All that is placed; asked once a scene.
struct EffectScene {
    std::span<const lod::Hierarchy* const> hierarchies;
    std::span<const lod::Instance> instances;
};
/// A node of points or curves that is drawn.
struct EffectNode {
    const lod::Hierarchy& hierarchy;
    const lod::Instance& instance;
    uint32_t node;
    const lod::View& view;
    const DrawSettings& settings;
};
struct EffectFrame {
    FrameContent content;
    const DrawSettings& settings;
    const DrawList& draws;  ///< nodes, meshes and the view; its tables are not filled yet
    uint64_t nodes = 0;     ///< that feed the effect
};

/// Where in a frame the passes of an effect run.
enum class Stage : uint8_t {
    surface,  ///< on surfaces, before light
    light,    ///< from surfaces to what they send to the eye
    lit       ///< on what they send
};

/// What an effect is told: NAME.PARAMETER=VALUE on the command line, a member of its object in scene files. Numbers
/// (three where `count` is 3), or one of `words`, whose place is the value.
struct Parameter {
    const char* name;
    const char* summary;  ///< with the unit
    double least = 0, most = 0;
    uint32_t count = 1;
    std::span<const char* const> words{};
    double* (*at)(DrawSettings& settings) = nullptr;  ///< the first of its numbers
};

/// A plane of its own, in a binding of its own (shaders/shared/bindings.h): room on the gpu, for `elements` of the
/// frame. On the cpu: Frame::room.
struct EffectPlane {
    uint32_t binding;
    uint64_t (*elements)(const DrawList& draws);
};

/// Frames that an effect draws before that of the camera, which shows what came of them.
struct FramesBefore {
    /// Draws them, and puts what came of them into `settings`; clears that where the frame does not call for them.
    /// `mayKeep`: what was drawn before may be taken although more is resident by now.
    Result<void> (*draw)(FrameState& state, const lod::View& view, FrameSettings& settings, bool mayKeep);
    /// Their views, so that they are planned with the camera's.
    void (*addViews)(const FrameState& state, const lod::View& view, const FrameSettings& settings,
                     std::vector<lod::ViewRequest>& views);
    /// What is kept of them beside what backends hold.
    uint64_t (*bytes)(const FrameState& state);
    /// What they took of the last frame, milliseconds.
    double (*ms)(const FrameState& state);
    std::span<const Pass> passes{};  ///< that only they have
};

/// Scenes in which anything is placed.
inline bool hasInstances(const EffectScene& scene) { return !scene.instances.empty(); }

/// What an effect has taken is given back after so many frames without it.
constexpr uint32_t kEffectHold = 60;

/// A manifest says what is its own: what is not said is as here.
struct Effect {
    const char* name;
    const char* summary;
    /// Null: where its name is among DrawSettings::effects.
    bool (*isRequested)(const DrawSettings& settings) = nullptr;
    /// Where not --effects does, or not it alone: the option that asks for it.
    const char* option = nullptr;
    /// Of what is requested by name: does that option ask for it, too? Null: there is none.
    bool (*isAskedFor)(const DrawSettings& settings) = nullptr;
    /// Takes the request of that option back, as `--effects none` does. Null: it is not left out.
    void (*leaveOut)(DrawSettings& settings) = nullptr;
    /// What of a scene calls for it under `auto`, in a few words; null: nothing. Null itself: nothing ever does.
    const char* (*calledForBy)(const SceneFacts& facts) = nullptr;
    std::span<const Parameter> parameters{};
    bool (*ofScene)(const EffectScene& scene) = hasInstances;  ///< could any of it need the effect? Conservative
    bool (*ofFrame)(const EffectFrame& frame);                 ///< does this frame show it?
    /// Does a node feed it, and how is that node moved? Still: it does not. Null: nodes do not matter.
    Bend (*ofNode)(const EffectNode& node) = nullptr;
    /// Tables and constants that its passes read, in camera space. Null: none.
    void (*fill)(const DrawSettings& settings, const glm::dmat3& cameraFromWorld, DrawList& out) = nullptr;
    const FramesBefore* before = nullptr;
    Stage stage = Stage::surface;
    std::span<const Pass> passes{};  ///< of its own; what they read and write: passes.inl
    /// Bindings of the tables that only it fills (DrawList::tables, or what backends fill on their own).
    std::span<const uint32_t> tables{};
    std::span<const EffectPlane> planes{};
    /// Largest difference that the effect would make where a predicate says no: pixels of motion, and 1/255 of a
    /// colour.
    double tolerancePixels = 0, toleranceSteps = 0;
};

/// Some of the effects of the table, by their places in it.
struct EffectSet {
    uint32_t bits = 0;
    bool has(size_t effect) const { return (bits >> effect & 1u) != 0; }
    void add(size_t effect) { bits |= 1u << effect; }
    bool operator==(const EffectSet&) const = default;
};

}  // namespace stipple::render
