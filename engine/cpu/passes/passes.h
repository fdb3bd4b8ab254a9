// The passes of the cpu backend (engine/render/passes.inl): each is a function of the frame, or of a row of a tile.
#pragma once

#include <span>

#include "engine/cpu/frame.h"

namespace stipple::cpu {

/// A row of a tile, `n` pixels from (x0, y) on.
struct RowPlace {
    Frame& frame;
    uint32_t x0, y, n;
    size_t first;  ///< pixel of the image
};

/// What runs over rows while they are in cache, back to back with its neighbours in the list.
struct RowPass {
    /// Has the row's pixels anything that the pass changes? `planes`: of triangles there. Null: always.
    bool (*concerns)(const Frame& frame, const SurfacePlanes& planes);
    /// Adds what it reads of surfaces.
    void (*wants)(const Frame& frame, SurfaceWants& wants);
    void (*run)(const RowPlace& at, SurfaceRow& row);
    /// What light needs to know of surfaces that are seen beside those of the pixels, before it lights them. Null:
    /// nothing of this pass.
    void (*beside)(const RowPlace& at, SurfaceRow& second) = nullptr;
    bool showsEmpty = false;  ///< rows without anything are not all alike
};

/// One of the two. A pass of rows that reads its neighbours (passes.inl) begins a run of its own, and finds the whole
/// picture in Frame::kept. One over the frame may say what it wants there, too: RowPass::wants.
struct CpuPass {
    void (*run)(Frame& frame) = nullptr;
    RowPass row{};
    /// Before the first pass of a frame that has this one. Null: nothing is to be made ready.
    void (*begin)(Frame& frame) = nullptr;
};
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) extern const CpuPass name##Pass;
#include "engine/render/passes.inl"
#undef STIPPLE_PASS

const CpuPass& cpuPassOf(render::Pass pass);

/// What the backend knows of a kind beside the pass that draws it.
struct CpuKind {
    /// Tables of its blocks, before any pass of a frame. Null: none, or the pass makes them.
    void (*prepare)(Frame& frame) = nullptr;
    /// Null: a kernel does it (resolveRow).
    ResolveKind resolve = nullptr;
};
#define STIPPLE_KIND(name) extern const CpuKind name##OnCpu;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

const CpuKind& cpuKind(lod::Kind kind);

/// Does it run in the same tile as the pass of rows before?
bool joinsRows(render::Pass pass);

/// Runs passes of rows back to back: the first is surface, or reads what an earlier run left; what the last one leaves
/// is kept for the passes of `later`, unless it is the picture.
void runRows(Frame& frame, std::span<const render::Pass> passes, std::span<const render::Pass> later);

/// What lights surfaces, and what of that comes past shadow maps (no slots: nothing casts).
LightInput lightInputOf(const Frame& frame);
ShadowInput shadowInputOf(const Frame& frame);

/// Does any of the passes read normals of the surface?
bool wantsNormals(const Frame& frame, std::span<const render::Pass> passes);

}  // namespace stipple::cpu
