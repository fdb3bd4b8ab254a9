// What the survey of a build read, in memory: whoever asks for it again need not read and decompress the files once
// more.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/base/huge_region.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

class KeptPoints {
  public:
    /// All: places, colours of 16 bits a channel and attributes; of what has more no more than places can be had.
    enum class What : uint8_t { nothing, places, all };
    /// Of a source on a lattice.
    struct Part {
        uint64_t count = 0;
        What what = What::nothing;
        bool hasColour = false;
    };

    /// `widths`: of the attributes, bytes. Takes no memory before something is kept. Throws std::bad_alloc.
    KeptPoints(std::vector<Part> parts, std::vector<size_t> widths);

    /// A block that begins with the part's point `at`. Parts from several threads at once, each from one.
    void keep(size_t part, uint64_t at, const PointBlock& block);
    /// The part is whole: it can be read.
    void finish(size_t part) { states_[part].isWhole = true; }
    /// Are places, or all that it has, to be had of it?
    bool has(size_t part, What what) const {
        const State& state = states_[part];
        return state.isWhole && parts_[part].what >= what && (what != What::all || !state.hasMore);
    }
    PointReader read(size_t part, What what) const;
    /// Nobody reads it any more. Once or more.
    void release(size_t part);
    /// Parts of which not all is to be had.
    void releasePlaces();

  private:
    struct State {
        bool isWhole = false, isReleased = false;
        bool hasMore = false;              ///< than is kept
        std::vector<bool> hasAttribute{};  ///< others are not in the file
    };
    /// Where the part's values of a kind begin: places, the lower 32 bits of colours, the upper 16, attributes.
    std::vector<uint8_t*> columnsOf(size_t part) const;

    std::vector<Part> parts_;
    std::vector<size_t> widths_;
    std::vector<State> states_;
    std::unique_ptr<HugeRegion> region_;
};

}  // namespace stipple::lod
