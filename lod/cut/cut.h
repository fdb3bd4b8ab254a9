// selectCut: which records to draw, which chunks to load. A pure function over plain arrays.
//
// The rule (ALGORITHMS 2.2). Every node N has one allowed error  eps_N = tau * D_lo(N) / (F * sigma_N),  with D_lo the
// distance from the eye to N's sphere and sigma_N = 1/cos^2 of the largest off-axis angle inside it (capped at the
// image corner), so that tau is a bound in pixels. Record x of N is drawn iff the error of its parent is too large for
// N's parent (a prefix of the records) and its own is small enough for N, or its octant's child cannot be drawn. Nested
// spheres make eps grow towards the leaves and errors shrink, so every leaf is covered exactly once.
//
// Small features: the root's records give way, too, to the levels of its overview (Hierarchy::overviewOf), so that what
// is small in the picture costs no more than the few records that stand for it within tau.
//
// All comparisons are between integer codes (eps is rounded down to the error scale), which makes the cut of equal
// views equal to the last record.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// A camera in world space: z-forward, y-down. In perspective, or orthographic: rays are parallel to `forward`, and
/// what an error may be is the same everywhere, tau / focalPixels.
struct View {
    glm::dvec3 eye{0};
    glm::dvec3 right{1, 0, 0}, down{0, -1, 0}, forward{0, 0, -1};
    double focalPixels = 1000;  ///< orthographic: pixels per world unit
    uint32_t width = 1280, height = 720;
    double nearPlane = 1e-3;  ///< world units
    bool isOrthographic = false;
    /// How far the ray along `forward` is from the middle of the picture, px: samples of a pixel, and of a lens
    /// (engine/render/accumulation), look past it.
    glm::dvec2 shift{0};
    /// Where that ray is in the picture, px from its upper left corner.
    glm::dvec2 principal() const { return 0.5 * glm::dvec2(width, height) + shift; }
    bool operator==(const View&) const = default;
};

/// A placed hierarchy. world = translation + rotation * (scale * (origin + unit * lattice)).
struct Instance {
    uint32_t hierarchy = 0;
    uint32_t source = 0;  ///< whose chunks it is drawn from: instances of one store that look alike share them
    glm::dmat3 rotation{1};
    glm::dvec3 translation{0};
    double scale = 1;
    /// How far what the store holds in full detail may be from what it stands for, world units: a part of every error.
    double inputError = 0;
    double sway = 0;  ///< how far wind moves it at most, world units: its spheres are larger by that
    /// Another instance, of points, that is drawn instead where that is good enough and cheaper (the classic hybrid).
    static constexpr uint32_t kNone = ~0u;
    uint32_t proxy = kNone;
    bool isDriven = false;   ///< drawn only in another's stead, or as a member of an instance group
    uint32_t group = kNone;  ///< whose points these are
};

/// Instances that share coarse nodes: from afar one stochastic store (instance `points`) shows all of them, and a leaf
/// of it that is not good enough gives way to the instances that it stands for.
struct InstanceGroup {
    uint32_t points = 0;
    std::vector<uint32_t> first;    ///< of each node of the points, and the end: where its members begin
    std::vector<uint32_t> members;  ///< instances
    std::vector<uint32_t> sources;  ///< of all members and their proxies, each once
};

/// All that is placed in a scene.
struct CutScene {
    std::span<const Hierarchy* const> hierarchies;  ///< by Instance::hierarchy
    std::span<const Instance> instances;
    std::span<const InstanceGroup> groups;  ///< by Instance::group
};

/// One byte per chunk of each source's hierarchy: 1 where it can be drawn.
struct Residency {
    std::span<const std::vector<uint8_t>> drawable;
};

/// A node where it is placed: a node of the hierarchy of an instance.
struct PlacedNode {
    uint32_t instance = 0, node = 0;
    auto operator<=>(const PlacedNode&) const = default;
};

struct Budgets {
    double errorPixels = 1;                                   ///< tau asked for
    uint64_t records = std::numeric_limits<uint64_t>::max();  ///< records and triangles drawn at most
    /// Of octrees, what needs no detail: nodes that are not refined, whatever their error, which no tau counts then.
    std::span<const PlacedNode> unrefined{};
};

/// Of a payload of points or curves.
struct CutDraw {
    uint32_t instance = 0, node = 0;
    uint32_t chunk = 0;       ///< that holds the records
    uint32_t first = 0;       ///< record of the chunk
    uint32_t count = 0;       ///< records from there
    uint32_t errorCode = 0;   ///< draw records with own error <= this ...
    uint32_t octantMask = 0;  ///< ... and all records of these octants
    float errorPixels = 0;    ///< largest screen-space error among what this node draws
    float radiusScale = 1;    ///< of a stochastic store: discs drawn are larger than stored
    uint32_t triangles = 0;   ///< that a record is at most (a block of patches); 0: it is none
};

/// Clusters of triangles: one run of one group.
struct CutMeshDraw {
    uint32_t instance = 0, node = 0;
    uint32_t chunk = 0;
    uint32_t firstCluster = 0, clusters = 0, triangles = 0;
    float errorPixels = 0;
};

/// Also of nodes that the table does not know yet (Hierarchy::isUnknown): it is to be read there.
struct CutWanted {
    uint32_t source = 0, chunk = 0;
    float priority = 0;  ///< pixels of error that it would remove, parents always above children
};

struct CutCounters {
    uint64_t nodesVisited = 0, nodesDrawn = 0, nodesCulled = 0, nodesMissing = 0, recordsDrawn = 0, recordsTested = 0,
             trianglesDrawn = 0, proxies = 0, groupMembers = 0, evaluations = 0;
    uint64_t leavesAround = 0;  ///< drawn, with a source code, around the eye: it is not in tauEffective
};

struct Cut {
    std::vector<CutDraw> draw;                        ///< sorted by instance, node, then chunk
    std::vector<CutMeshDraw> meshDraw;                ///< sorted by instance, node, then chunk
    std::vector<CutWanted> wanted;                    ///< chunks that the full cut needs and that are not drawable
    std::vector<std::pair<uint32_t, uint32_t>> keep;  ///< (source, chunk) that must not be evicted
    double tauTarget = 0;                             ///< error, px, that the budget allows once everything is resident
    double tauEffective = 0;                          ///< error, px, delivered by what is drawn now
    bool truncated = false;  ///< even the coarsest of all roots exceed the budget: some of their records are left out
    CutCounters counters;
};

/// A view in the lattice space of one instance.
struct LocalView {
    glm::dvec3 eye{0}, forward{0};
    std::array<glm::dvec3, 4> planes{};  ///< inward normals of the frustum's sides ...
    std::array<double, 4> off{};         ///< ... and how far behind the eye they lie: in perspective they go through it
    double nearPlane = 0, focal = 0, cosineCorner = 0;  ///< orthographic: focal in pixels per step
    bool isOrthographic = false;
    /// Is what lies within `r` of the eye + d beyond one of the sides?
    bool isBeside(const glm::dvec3& d, double r) const {
        for (size_t k = 0; k < planes.size(); ++k)
            if (glm::dot(d, planes.at(k)) + off.at(k) < -r) return true;
        return false;
    }
};

/// Reused between frames of one scene, so that a cut allocates nothing once warm.
struct CutScratch {
    /// What a frame remembers of an instance that it looks at.
    struct Slot {
        LocalView view;
        double sway = 0;        ///< lattice units
        double inputError = 0;  ///< in steps of the smallest error code
        size_t first = 0;       ///< of its nodes in `allowed`
    };
    /// Of a node: allowed error of tau = 1 in 1/32 octave codes, and the frame that it is of.
    struct Allowed {
        int32_t epsilon = 0;
        uint32_t frame = 0;
    };
    /// Members of instance groups that are drawn themselves, and the evaluation in which each was last found to be.
    struct Members {
        std::vector<uint32_t> stamp, active;
        uint32_t evaluation = 0;
    };
    std::deque<Slot> slots;
    uint32_t slotsUsed = 0;
    std::vector<Allowed> allowed;
    size_t allowedUsed = 0;
    std::vector<std::pair<uint32_t, uint32_t>> slotOf;  ///< by instance: frame and slot
    std::vector<uint32_t> drivers;                      ///< instances that are not driven by others
    std::vector<uint8_t> isReady;                       ///< of each instance group: can its members be drawn?
    Members members;
    std::vector<uint32_t> stack;
    std::vector<uint8_t> groupState, tileSeen;
    uint32_t frame = 0;
};

/// Fills `cut`. `recordsDrawn` is exact where nothing is missing and
/// an upper bound otherwise; it never exceeds the budget unless `truncated`, and then the draws are cut to fit.
void selectCut(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
               CutScratch& scratch, Cut& cut);

}  // namespace stipple::lod
