#include "streaming/streamer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>
#include <utility>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/primitives/kinds.h"
#include "lod/store/store.h"
#include "lod/store/surfel_weights.h"

namespace stipple::streaming {
namespace {

constexpr uint64_t kRetryFrames = 120;

/// A chunk as it is in the file.
struct Stored {
    std::vector<uint8_t> bytes, weights;  ///< attributes that are wanted stand behind the chunk's own
};
struct Asked {
    std::shared_ptr<const ByteSource> source;
    const lod::Hierarchy* hierarchy;
    std::shared_ptr<const ChunkFinish> finish;
    ChunkKey key;
    std::string where;
    size_t attributeBytes() const {
        const bool isWanted = finish->wantsAttributes && !hierarchy->isTile(key.chunk);
        return isWanted ? hierarchy->payload(key.chunk).attributeBytes : 0;
    }
    const lod::Stream* weights() const {
        return hierarchy->isTile(key.chunk) ? nullptr : lod::weightsOf(*hierarchy, key.chunk);
    }
};

Result<Stored> readStored(const Asked& asked) {
    const lod::ChunkPlace place = lod::chunkPlace(*asked.hierarchy, asked.key.chunk);
    Stored stored;
    stored.bytes.resize(place.bytes + asked.attributeBytes());
    STIPPLE_TRY(asked.source->readAt(place.offset, stored.bytes.data(), stored.bytes.size()));
    if (const lod::Stream* weights = asked.weights()) {
        stored.weights.resize(weights->bytes);
        STIPPLE_TRY(asked.source->readAt(weights->offset, stored.weights.data(), stored.weights.size()));
    }
    return stored;
}

Result<lod::Chunk> decode(const Asked& asked, const Stored& stored) {
    const lod::Hierarchy& h = *asked.hierarchy;
    const lod::ChunkPlace place = lod::chunkPlace(h, asked.key.chunk);
    const auto damaged = [&](const char* what) {
        return fail(ErrorKind::input, fmt::format("the hash of {} does not match", what), asked.where,
                    "the store is damaged; build it again");
    };
    const size_t attributeBytes = asked.attributeBytes();
    const uint8_t* const attributes = stored.bytes.data() + place.bytes;
    if (hashBytes(stored.bytes.data(), place.bytes) != place.hash ||
        (attributeBytes > 0 && hashBytes(attributes, attributeBytes) != h.payload(asked.key.chunk).attributeHash))
        return damaged("a chunk");
    STIPPLE_ASSIGN(lod::Chunk chunk,
                   lod::decodeStored(h, asked.key.chunk, stored.bytes.data(), place.bytes, asked.where, false));
    if (asked.finish->apply) STIPPLE_TRY(asked.finish->apply(asked.key.chunk, chunk, attributes, attributeBytes));
    if (const lod::Stream* weights = asked.weights()) {
        if (hashBytes(stored.weights.data(), stored.weights.size()) != weights->hash)
            return damaged("the weights of a chunk");
        STIPPLE_ASSIGN(chunk.weights, lod::decodeWeights(stored.weights.data(), stored.weights.size(),
                                                         h.payload(asked.key.chunk).records, asked.where));
    }
    return chunk;
}

/// Tasks of an executor throw nothing: a chunk for which there is no memory is one that failed.
template <typename Work>
auto orFail(const Work& work) noexcept -> decltype(work()) {
    try {
        return work();
    } catch (const std::bad_alloc&) {  // the text is short enough to take no memory
        return fail(ErrorKind::budget, "out of memory");
    } catch (...) {
        return fail(ErrorKind::input, "no such chunk");
    }
}

}  // namespace

bool isLegalTransition(ChunkState from, ChunkState to) {
    static const std::array<std::pair<ChunkState, ChunkState>, 8> legal{
        {{ChunkState::absent, ChunkState::requested},
         {ChunkState::requested, ChunkState::arrived},
         {ChunkState::requested, ChunkState::failed},
         {ChunkState::arrived, ChunkState::resident},
         {ChunkState::arrived, ChunkState::absent},  // no room, or nobody wants it any more
         {ChunkState::arrived, ChunkState::failed},  // the sink could not take it
         {ChunkState::resident, ChunkState::absent},
         {ChunkState::failed, ChunkState::requested}}};
    return std::find(legal.begin(), legal.end(), std::pair{from, to}) != legal.end();
}

Streamer::Streamer(Executor& executor, ChunkSink& sink, StreamSettings settings)
    : executor_(executor),
      executorLife_(executor.life()),
      sink_(sink),
      settings_(settings),
      completed_(std::make_shared<CompletionQueue<Arrival>>()) {
    ends_.before = ends_.after = {kNoSource, 0};
}

Streamer::~Streamer() {
    if (!executorLife_.expired()) executor_.wait();
    for (uint32_t i = 0; i < sources_.size(); ++i)
        for (uint32_t n = 0; n < sources_[i].chunks.size(); ++n)
            if (sources_[i].chunks[n].state == ChunkState::resident) sink_.evict({i, n});
}

void Streamer::addSource(const lod::Hierarchy& hierarchy, std::shared_ptr<const ByteSource> source, std::string name,
                         ChunkFinish finish) {
    sources_.push_back({&hierarchy, std::move(source), std::move(name),
                        std::make_shared<const ChunkFinish>(std::move(finish)),
                        std::vector<ChunkLife>(hierarchy.chunks())});
    drawable_.emplace_back(hierarchy.chunks(), uint8_t{0});
    const auto index = static_cast<uint32_t>(sources_.size() - 1);
    for (uint32_t n = 0; n < hierarchy.chunks(); ++n) {
        ChunkLife& life = sources_.back().chunks[n];
        life.before = life.after = {index, n};
    }
}

void Streamer::setState(ChunkKey key, ChunkState to) {
    ChunkState& state = sources_[key.source].chunks[key.chunk].state;
    STIPPLE_CHECK(isLegalTransition(state, to), "chunk state transition");
    state = to;
    drawable_[key.source][key.chunk] = to == ChunkState::resident ? 1 : 0;
}

void Streamer::collect() {
    for (Arrival& arrival : completed_->takeAll()) {
        --counters_.inFlight;
        if (!arrival.chunk) {
            setState(arrival.key, ChunkState::failed);
            sources_[arrival.key.source].chunks[arrival.key.chunk].retryAt = frame_ + kRetryFrames;
            ++counters_.failures;
            lastFailure_ = arrival.chunk.error().line();
            continue;
        }
        setState(arrival.key, ChunkState::arrived);
        counters_.bytesStreamed += lod::chunkPlace(*sources_[arrival.key.source].hierarchy, arrival.key.chunk).bytes;
        arrived_.push_back(std::move(arrival));
    }
}

void Streamer::upload() {
    uint64_t uploaded = 0;
    size_t taken = 0;
    for (; taken < arrived_.size(); ++taken) {
        Arrival& arrival = arrived_[taken];
        if (lifeOf(arrival.key).lastWanted < frame_) {
            setState(arrival.key, ChunkState::absent);
            ++counters_.unwanted;
            continue;
        }
        const uint64_t bytes = lod::decodedBytes(*sources_[arrival.key.source].hierarchy, arrival.key.chunk);
        if (uploaded > 0 && uploaded + bytes > settings_.uploadBytesPerFrame) break;
        if (!makeRoom(bytes)) {
            setState(arrival.key, ChunkState::absent);
            sources_[arrival.key.source].chunks[arrival.key.chunk].retryAt = frame_ + kRetryFrames;
            ++counters_.refused;
            continue;
        }
        if (const auto result = sink_.upload(arrival.key, std::move(*arrival.chunk)); !result) {
            setState(arrival.key, ChunkState::failed);
            sources_[arrival.key.source].chunks[arrival.key.chunk].retryAt = frame_ + kRetryFrames;
            ++counters_.failures;
            lastFailure_ = result.error().line();
            continue;
        }
        setState(arrival.key, ChunkState::resident);
        countInParents(arrival.key, 1);
        use(arrival.key);
        counters_.residentBytes += bytes;
        ++counters_.uploads;
        uploaded += bytes;
    }
    arrived_.erase(arrived_.begin(), arrived_.begin() + static_cast<std::ptrdiff_t>(taken));
}

bool Streamer::isEvictable(ChunkKey key) const {
    const Source& source = sources_[key.source];
    const ChunkLife& life = source.chunks[key.chunk];
    return life.state == ChunkState::resident && life.residentBelow == 0 &&
           !lod::isOfRoot(*source.hierarchy, key.chunk);
}

void Streamer::unlink(ChunkKey key) {
    ChunkLife& life = lifeOf(key);
    lifeOf(life.before).after = life.after;
    lifeOf(life.after).before = life.before;
    life.before = life.after = key;
}

void Streamer::linkAfter(ChunkKey before, ChunkKey key) {
    const ChunkKey after = lifeOf(before).after;
    lifeOf(key).before = before;
    lifeOf(key).after = after;
    lifeOf(before).after = key;
    lifeOf(after).before = key;
}

/// From both ends: a parent is in use still, or was given up with the child that made room for it.
ChunkKey Streamer::placeOf(uint64_t lastUsed) {
    ChunkKey early = ends_.after, late = ends_.before;
    for (;;) {
        if (late.source == kNoSource || lifeOf(late).lastUsed <= lastUsed) return late;
        if (lifeOf(early).lastUsed > lastUsed) return lifeOf(early).before;
        late = lifeOf(late).before;
        early = lifeOf(early).after;
    }
}

void Streamer::use(ChunkKey key) {
    lifeOf(key).lastUsed = frame_;
    if (!isEvictable(key)) return;
    unlink(key);
    linkAfter(ends_.before, key);
}

/// A chunk is not evicted before those that build on it.
void Streamer::countInParents(ChunkKey key, int change) {
    Source& source = sources_[key.source];
    lod::forEachRequired(*source.hierarchy, key.chunk, [&](uint32_t above) {
        const ChunkKey parent{key.source, above};
        ChunkLife& life = source.chunks[above];
        if (life.residentBelow == 0 && change > 0) unlink(parent);
        life.residentBelow = static_cast<uint16_t>(life.residentBelow + change);
        if (change < 0 && isEvictable(parent)) linkAfter(placeOf(life.lastUsed), parent);
    });
}

void Streamer::evict(ChunkKey key) {
    Source& source = sources_[key.source];
    unlink(key);
    sink_.evict(key);
    setState(key, ChunkState::absent);
    countInParents(key, -1);
    counters_.residentBytes -= lod::decodedBytes(*source.hierarchy, key.chunk);
    ++counters_.evictions;
}

bool Streamer::makeRoom(uint64_t bytes) {
    while (counters_.residentBytes + bytes > settings_.residentBytes) {
        const ChunkKey oldest = ends_.after;
        if (oldest.source == kNoSource) return false;
        if (lifeOf(oldest).lastUsed >= frame_) return false;  // what this frame keeps is never evicted
        evict(oldest);
    }
    return true;
}

void Streamer::request(const lod::Cut& cut) {
    ++frame_;
    for (const auto& [source, chunk] : cut.keep) use({source, chunk});
    for (const lod::CutWanted& w : cut.wanted) lifeOf({w.source, w.chunk}).lastWanted = frame_;
    wanted_.assign(cut.wanted.begin(), cut.wanted.end());
    std::sort(wanted_.begin(), wanted_.end(), lod::isMoreUrgent);
    for (const lod::CutWanted& w : wanted_) {
        if (counters_.inFlight >= settings_.requestsInFlight) break;
        start(w.source, w.chunk);
    }
}

void Streamer::start(uint32_t sourceIndex, uint32_t chunk) {
    Source& source = sources_[sourceIndex];
    ChunkLife& state = source.chunks[chunk];
    if ((state.state != ChunkState::absent && state.state != ChunkState::failed) || frame_ < state.retryAt) return;
    const ChunkKey key{sourceIndex, chunk};
    setState(key, ChunkState::requested);
    ++counters_.inFlight;
    ++counters_.requests;
    const std::string where = fmt::format("{}: chunk {}", source.name, chunk);
    auto asked = std::make_shared<const Asked>(Asked{source.bytes, source.hierarchy, source.finish, key, where});
    executor_.read([asked = std::move(asked), queue = completed_, &executor = executor_] {
        auto stored = std::make_shared<Result<Stored>>(orFail([&] { return readStored(*asked); }));
        executor.run([asked, stored, queue] {
            if (!*stored)
                queue->push({asked->key, tl::unexpected((*stored).error())});
            else
                queue->push({asked->key, orFail([&] { return decode(*asked, **stored); })});
        });
    });
}

void Streamer::makeRoomFor(const lod::ResidentPlan& plan) {
    const auto isPlanned = [&](ChunkKey key) { return plan.chunks[key.source][key.chunk] != 0; };
    std::erase_if(arrived_, [&](const Arrival& a) {
        if (isPlanned(a.key)) return false;
        setState(a.key, ChunkState::absent);
        return true;
    });
    std::vector<ChunkKey> others;
    uint64_t together = plan.bytes;
    for (uint32_t s = 0; s < sources_.size(); ++s)
        for (uint32_t n = 0; n < sources_[s].chunks.size(); ++n) {
            ChunkLife& state = sources_[s].chunks[n];
            if (isPlanned({s, n})) state.retryAt = 0;  // there was no room; now there is
            if (state.state != ChunkState::resident || isPlanned({s, n})) continue;
            others.push_back({s, n});
            together += lod::decodedBytes(*sources_[s].hierarchy, n);
        }
    const auto last = [&](ChunkKey k) { return sources_[k.source].chunks[k.chunk].lastUsed; };
    // What builds on others was not used later than they, and has the higher number.
    std::sort(others.begin(), others.end(), [&](ChunkKey a, ChunkKey b) {
        if (last(a) != last(b)) return last(a) < last(b);
        return a.source != b.source ? a.source < b.source : a.chunk > b.chunk;
    });
    for (const ChunkKey key : others) {
        if (plan.isComplete() && together <= settings_.residentBytes) break;
        together -= lod::decodedBytes(*sources_[key.source].hierarchy, key.chunk);
        evict(key);
    }
}

void Streamer::request(const lod::ResidentPlan& plan) {
    ++frame_;
    for (uint32_t s = 0; s < sources_.size(); ++s)
        for (uint32_t n = 0; n < sources_[s].chunks.size(); ++n) {
            if (!plan.chunks[s][n]) continue;
            sources_[s].chunks[n].lastWanted = frame_;
            if (drawable_[s][n])
                use({s, n});
            else if (counters_.inFlight < settings_.requestsInFlight)
                start(s, n);
        }
}

std::vector<std::pair<uint32_t, uint32_t>> Streamer::failed(bool isDue) const {
    std::vector<std::pair<uint32_t, uint32_t>> out;
    if (counters_.failures == 0) return out;
    for (uint32_t s = 0; s < sources_.size(); ++s)
        for (uint32_t n = 0; n < sources_[s].chunks.size(); ++n) {
            const ChunkLife& state = sources_[s].chunks[n];
            if (state.state == ChunkState::failed && (isDue || frame_ < state.retryAt)) out.emplace_back(s, n);
        }
    return out;
}

}  // namespace stipple::streaming
