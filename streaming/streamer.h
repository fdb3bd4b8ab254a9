// Keeps the chunks that the cut wants resident: reads and decodes them on the executor, hands them to the sink within a
// byte budget, evicts what nobody needs. The life of a request:
//   1. the cut wants a chunk            absent -> requested     (request)
//   2. a thread reads it, a worker decodes it   requested       (executor)
//   3. it arrives                       requested -> arrived    (collect, the only place where async work enters)
//   4. it is uploaded within the budget arrived -> resident     (upload; drawable from the next frame on)
//      or nobody wants it any more      arrived -> absent
//   5. nobody keeps it any more         resident -> absent      (evict, least recently used, children before parents)
// A chunk that cannot be read is failed: counted, its parent stays drawn, tried again after a pause. What the node
// table does not know yet is asked for like a chunk: its page of the table is read then, and stays.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/executor.h"
#include "engine/base/queue.h"
#include "lod/cut/cut.h"
#include "lod/cut/resident.h"
#include "lod/store/chunk.h"
#include "lod/store/pages.h"

namespace stipple::streaming {

/// `source`: in the order of addSource; `chunk`: see lod::Hierarchy.
struct ChunkKey {
    uint32_t source = 0, chunk = 0;
};

/// Takes decoded chunks: implemented by each backend (and by the tests, which count what is alive).
class ChunkSink {
  public:
    virtual ~ChunkSink() = default;
    virtual Result<void> upload(ChunkKey key, lod::Chunk chunk) = 0;
    virtual void evict(ChunkKey key) = 0;
};

/// A last step before a chunk is handed over, e.g. colours from attributes: told its number, the chunk and, if asked
/// for, the bytes of its attribute streams (checked against their hash).
struct ChunkFinish {
    bool wantsAttributes = false;
    std::function<Result<void>(uint32_t index, lod::Chunk& chunk, const uint8_t* attributes, size_t bytes)> apply;
};

enum class ChunkState : uint8_t { absent, requested, arrived, resident, failed };
/// Is from -> to a step of a chunk's life?
bool isLegalTransition(ChunkState from, ChunkState to);

struct StreamSettings {
    uint64_t residentBytes = uint64_t{1} << 30;  ///< hard limit of decoded chunks held by the sink
    uint64_t uploadBytesPerFrame = uint64_t{64} << 20;
    uint32_t requestsInFlight = 64;
};

struct StreamCounters {
    uint64_t bytesStreamed = 0, residentBytes = 0, requests = 0, uploads = 0, evictions = 0, failures = 0, refused = 0;
    uint64_t unwanted = 0;  ///< arrived when nobody wanted them any more
    uint64_t pages = 0;     ///< of node tables, read since the stores were opened; their bytes are among those streamed
    uint32_t inFlight = 0;
};

class Streamer {
  public:
    Streamer(Executor& executor, ChunkSink& sink, StreamSettings settings);
    ~Streamer();
    Streamer(const Streamer&) = delete;
    Streamer& operator=(const Streamer&) = delete;

    /// One more store to stream from; `hierarchy` must outlive the streamer. `finish` (may be empty) is called with
    /// every decoded chunk on the thread that decoded it. `pages`: of a table that is read as it is needed.
    void addSource(const lod::Hierarchy& hierarchy, std::shared_ptr<const ByteSource> source, std::string name,
                   ChunkFinish finish = {}, std::shared_ptr<lod::NodePages> pages = {});
    /// Takes in what workers finished since the last call.
    void collect();
    /// Uploads arrived chunks within the budgets, evicting if needed.
    void upload();
    /// Starts what the cut wants, up to the quota; remembers what it keeps.
    void request(const lod::Cut& cut);

    // For pictures that hang on a plan and not on time; nothing may be on its way from the executor.
    /// Drops what arrived and is not in the plan; of what is resident and not in it, the least recently used (chunks of
    /// roots last) until the plan has room: all of it where the plan is not complete, as then it would show.
    void makeRoomFor(const lod::ResidentPlan& plan);
    /// As request: starts what the plan has and what is not there.
    void request(const lod::ResidentPlan& plan);
    /// Reads the pages of the node tables that tell of those chunks, and waits for them; false: none can be read.
    bool readPages(std::span<const std::pair<uint32_t, uint32_t>> unknown);
    /// (source, chunk) that could not be read, or that the sink could not take; `isDue`: also those to be tried again.
    std::vector<std::pair<uint32_t, uint32_t>> failed(bool isDue) const;
    uint64_t residentLimit() const { return settings_.residentBytes; }

    lod::Residency residency() const { return {drawable_}; }
    const StreamCounters& counters() const { return counters_; }
    /// Waits for all that is on its way from the executor.
    void wait() { executor_.wait(); }
    /// True if nothing is on its way.
    bool isIdle() const { return counters_.inFlight == 0 && pagesInFlight_ == 0 && arrived_.empty(); }
    /// The last failure, for the overlay and the log; empty if there was none.
    const std::string& lastFailure() const { return lastFailure_; }

  private:
    static constexpr uint32_t kGroupEnd = 0xffffffffu;  ///< as the source of a key: its chunk is a group
    static constexpr uint32_t kNever = 0xffffffffu;
    struct ChunkLife {
        ChunkState state = ChunkState::absent;
        uint16_t residentBelow = 0;  ///< that build on it
        uint32_t used = kNever;      ///< the group of the frame that used it last
        uint64_t lastWanted = 0, retryAt = 0;
        ChunkKey before, after;  ///< in the list of what may be evicted, least recently used first; alone: itself
    };
    /// What one frame was the last to use: of the list, what stands before `end` and behind the end of the group
    /// before. A chunk that becomes evictable finds its place in the list by it, without a look at others.
    struct Group {
        uint64_t frame = 0;
        uint32_t chunks = 0;  ///< evictable or not
        ChunkLife end;
    };
    struct PageLife {
        bool isRequested = false;
        uint64_t retryAt = 0;
    };
    struct Source {
        const lod::Hierarchy* hierarchy;
        std::shared_ptr<const ByteSource> bytes;
        std::string name;
        ChunkFinish finish;
        std::vector<ChunkLife> chunks;
        std::shared_ptr<lod::NodePages> pages;
        std::vector<PageLife> pageLives;
    };
    /// A chunk on its way, from start() until it is uploaded or dropped.
    struct Request;
    /// A page of a node table on its way.
    struct PageRequest {
        uint32_t source = 0, page = 0;
        const lod::Hierarchy* hierarchy = nullptr;
        lod::NodePages* pages = nullptr;
        Result<lod::NodePages::Loaded> read;
    };
    /// Of the page that tells of a chunk which is not known; false: it cannot be read now.
    bool startPage(ChunkKey unknown);
    void collectPages();
    void setState(ChunkKey key, ChunkState to);
    bool makeRoom(uint64_t bytes);
    void start(uint32_t source, uint32_t chunk);
    /// What upload() makes of one that arrived: it is resident or dropped, it waits for what it builds on, or it and
    /// all after it wait for the next frame, as this one has uploaded what it may.
    enum class Fate : uint8_t { settled, waits, frameIsFull };
    Fate settle(Request& request, uint64_t& uploaded);
    /// It has no chunk any more, and stands for another.
    void giveBack(Request& request);
    void evict(ChunkKey key);
    void countInParents(ChunkKey key, int change);
    ChunkLife& lifeOf(ChunkKey key) {
        return key.source == kGroupEnd ? groups_[key.chunk].end : sources_[key.source].chunks[key.chunk];
    }
    /// Resident, and nobody's parent: in the list, unless it is of the root.
    bool isEvictable(ChunkKey key) const;
    void unlink(ChunkKey key);
    void linkAfter(ChunkKey before, ChunkKey key);
    /// The last of its group.
    void link(ChunkKey key);
    /// It is in use now.
    void use(ChunkKey key);
    /// Nobody's use counts any more.
    void leaveGroup(ChunkLife& life);
    uint32_t groupOfFrame();

    Executor& executor_;
    std::weak_ptr<const void> executorLife_;  ///< one that is gone has finished what it had
    ChunkSink& sink_;
    StreamSettings settings_;
    std::deque<Source> sources_;  ///< tasks look at them, wherever others are added
    std::vector<Group> groups_;   ///< the first one's end is that of the list, a ring: after it comes the first chunk
    std::vector<uint32_t> spareGroups_;
    std::vector<std::vector<uint8_t>> drawable_;
    // What a frame needs while chunks come and go is used again, so that its thread allocates nothing once warm.
    std::vector<std::unique_ptr<Request>> requests_;
    std::vector<Request*> spare_, arrived_, taken_;
    CompletionQueue<Request*> completed_;
    CompletionQueue<std::unique_ptr<PageRequest>> completedPages_;
    std::vector<std::unique_ptr<PageRequest>> takenPages_;
    uint32_t pagesInFlight_ = 0;
    std::vector<lod::CutWanted> wanted_;
    std::vector<ChunkKey> others_;
    StreamCounters counters_;
    uint64_t frame_ = 0;
    std::string lastFailure_;
};

}  // namespace stipple::streaming
