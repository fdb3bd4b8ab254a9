// What a backend keeps of each resident chunk.
#pragma once

#include <unordered_map>
#include <utility>
#include <vector>

#include "streaming/streamer.h"

namespace stipple::render {

/// The table's own memory is used again, so that chunks that come and go allocate nothing once warm. What was dropped
/// stands for others as `use` left it.
template <typename Kept>
class ChunkTable {
  public:
    /// Of a chunk that is there.
    const Kept& at(streaming::ChunkKey key) const { return kept_.at(idOf(key)); }
    const Kept* find(streaming::ChunkKey key) const {
        const auto found = kept_.find(idOf(key));
        return found == kept_.end() ? nullptr : &found->second;
    }
    /// Of one that is there, or comes.
    Kept& add(streaming::ChunkKey key) {
        if (spare_.empty() || kept_.contains(idOf(key))) return kept_[idOf(key)];
        auto entry = std::move(spare_.back());
        spare_.pop_back();
        entry.key() = idOf(key);
        return kept_.insert(std::move(entry)).position->second;
    }
    /// use(what was kept), if it is there, before it goes.
    template <typename Use>
    void drop(streaming::ChunkKey key, const Use& use) {
        auto entry = kept_.extract(idOf(key));
        if (!entry) return;
        use(entry.mapped());
        spare_.push_back(std::move(entry));
    }

  private:
    static uint64_t idOf(streaming::ChunkKey key) { return uint64_t{key.source} << 32 | key.chunk; }

    std::unordered_map<uint64_t, Kept> kept_;
    std::vector<typename std::unordered_map<uint64_t, Kept>::node_type> spare_;
};

}  // namespace stipple::render
