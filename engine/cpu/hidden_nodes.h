// Nodes of points that are behind what is drawn already, and are left out for it. The picture is bit for bit what it
// is with them: a node is left out only if every pixel that any of its records could claim holds a key that is nearer
// than any of theirs.
//
//   nodes not hidden lately --project, splat--> visibility --tiles--> farthest depth of each 16 x 16 px
//                                                   ^                     |
//                                                   +-- nodes held back <-+ that may be seen
//
// What was hidden before says only which nodes wait for the second step, so the picture depends on nothing that came
// before (Greene, Kass & Miller 1993, hierarchical z-buffer; two passes as in Haar & Aaltonen 2015).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/backend.h"

namespace stipple::cpu {

struct Frame;

/// The pixels that records of a node may claim, and bits of a depth that none of them is nearer than.
struct NodeReach {
    bool isKnown = false;                                ///< else it may be anywhere: near the eye, or with wide discs
    uint32_t nearest = 0;                                ///< as keyDepthBits
    int firstX = 0, firstY = 0, lastX = -1, lastY = -1;  ///< within the picture; none: last < first
};
/// `areDiscs`: its records are drawn as discs, else each has one pixel. `besideToo`: records beside the picture claim
/// the nearest pixel at its border.
NodeReach reachOf(const shared::FrameConstants& f, const shared::DrawNode& node, const render::NodeBounds& bounds,
                  bool areDiscs, bool besideToo);

class HiddenNodes {
  public:
    static constexpr uint32_t kTilePixels = 16;
    static constexpr uint32_t kLeastRecords = 32;  ///< of a node: less is drawn as fast as it is tested
    /// If less than this share of the records was hidden, nothing is tested for so many frames: where nothing is
    /// hidden, that is what it costs.
    static constexpr double kLeastShare = 0.0625;
    static constexpr uint32_t kRest = 16;

    /// The blocks of points that are drawn first, in their order.
    std::span<const uint32_t> begin(const Frame& frame, bool mayHide);
    /// Once those are in the visibility buffer: what was held back and may be seen, in its order. `areDiscs`: as they
    /// are drawn.
    std::span<const uint32_t> rest(Frame& frame, bool areDiscs);

    const render::HiddenCounts& counts() const { return counts_; }
    /// Backend::hiddenNodes.
    const std::vector<uint32_t>* whole() const { return isTested_ ? &whole_ : nullptr; }
    /// Of a frame that does not come to begin().
    void reset() {
        counts_ = {};
        isTested_ = false;
    }

  private:
    struct Marks {  ///< of nodes by a hash, two bits of a word: what seems to be marked is only drawn later
        std::vector<uint64_t> words;
        uint64_t& wordOf(uint64_t hash) { return words[(hash >> 12) & (words.size() - 1)]; }
        static uint64_t bitsOf(uint64_t hash) { return uint64_t{1} << (hash & 63) | uint64_t{1} << (hash >> 6 & 63); }
        void clear(size_t nodes);
        void mark(uint64_t hash) { wordOf(hash) |= bitsOf(hash); }
        bool has(uint64_t hash) { return (~wordOf(hash) & bitsOf(hash)) == 0; }
    };
    void measure(Frame& frame);
    bool isBehind(const NodeReach& reach) const;
    void take(const render::DrawBatch& points, uint8_t state, std::vector<uint32_t>& blocks) const;

    enum : uint8_t { kDrawn, kHeld, kSeen };            ///< of a node in this frame
    enum : uint8_t { kBefore, kBehind, kWholeBehind };  ///< what is known of its place: with all it stands for, too
    std::vector<uint8_t> states_, behind_;              ///< of each node
    std::vector<uint32_t> whole_;                       ///< nodes that are kWholeBehind
    std::vector<uint32_t> blocks_, late_;
    std::vector<uint32_t> farthest_;  ///< of each tile: bits of a depth
    uint32_t columns_ = 0;
    Marks marks_;             ///< what was hidden in the last frame that was tested
    bool hasMarks_ = false;   ///< ... and whether that paid
    uint32_t untilTest_ = 2;  ///< frames; the first gains nothing
    bool isTested_ = false;   ///< this frame
    render::HiddenCounts counts_;
};

}  // namespace stipple::cpu
