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

class FileSource final : public ByteSource {
  public:
    explicit FileSource(std::shared_ptr<const InputFile> file) : file_(std::move(file)) {}
    Result<void> read(uint64_t offset, void* destination, size_t count) const override {
        return file_->readAt(offset, destination, count);
    }

  private:
    std::shared_ptr<const InputFile> file_;
};

constexpr uint64_t kRetryFrames = 120;

Result<lod::Chunk> fetch(const ByteSource& source, const lod::Hierarchy& h, uint32_t index, const ChunkFinish& finish,
                         const std::string& where) {
    const lod::ChunkPlace place = lod::chunkPlace(h, index);
    const bool wantsAttributes = finish.wantsAttributes && !h.isTile(index);
    const size_t attributeBytes = wantsAttributes ? h.payload(index).attributeBytes : 0;
    std::vector<uint8_t> bytes(place.bytes + attributeBytes);
    STIPPLE_TRY(source.read(place.offset, bytes.data(), bytes.size()));
    const uint8_t* const attributes = bytes.data() + place.bytes;
    if (hashBytes(bytes.data(), place.bytes) != place.hash ||
        (wantsAttributes && hashBytes(attributes, attributeBytes) != h.payload(index).attributeHash))
        return fail(ErrorKind::input, "the hash of a chunk does not match", where,
                    "the store is damaged; build it again");
    STIPPLE_ASSIGN(lod::Chunk chunk, lod::decodeStored(h, index, bytes.data(), place.bytes, where, false));
    if (finish.apply) STIPPLE_TRY(finish.apply(index, chunk, attributes, attributeBytes));
    if (const lod::Stream* weights = h.isTile(index) ? nullptr : lod::weightsOf(h, index)) {
        bytes.resize(weights->bytes);
        STIPPLE_TRY(source.read(weights->offset, bytes.data(), bytes.size()));
        if (hashBytes(bytes.data(), bytes.size()) != weights->hash)
            return fail(ErrorKind::input, "the hash of the weights of a chunk does not match", where,
                        "the store is damaged; build it again");
        STIPPLE_ASSIGN(chunk.weights, lod::decodeWeights(bytes.data(), bytes.size(), h.payload(index).records, where));
    }
    return chunk;
}

/// Tasks of an executor throw nothing: a chunk for which there is no memory is one that failed.
Result<lod::Chunk> fetchOrFail(const ByteSource& source, const lod::Hierarchy& h, uint32_t index,
                               const ChunkFinish& finish, const std::string& where) noexcept {
    try {
        return fetch(source, h, index, finish, where);
    } catch (const std::bad_alloc&) {  // the text is short enough to take no memory
        return fail(ErrorKind::budget, "out of memory");
    } catch (...) {
        return fail(ErrorKind::input, "no such chunk");
    }
}

}  // namespace

std::unique_ptr<ByteSource> makeFileSource(std::shared_ptr<const InputFile> file) {
    return std::make_unique<FileSource>(std::move(file));
}

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
      completed_(std::make_shared<CompletionQueue<Arrival>>()) {}

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
        const Arrival& arrival = arrived_[taken];
        const uint64_t bytes = lod::decodedBytes(*sources_[arrival.key.source].hierarchy, arrival.key.chunk);
        if (uploaded > 0 && uploaded + bytes > settings_.uploadBytesPerFrame) break;
        if (!makeRoom(bytes)) {
            setState(arrival.key, ChunkState::absent);
            sources_[arrival.key.source].chunks[arrival.key.chunk].retryAt = frame_ + kRetryFrames;
            ++counters_.refused;
            continue;
        }
        if (const auto result = sink_.upload(arrival.key, *arrival.chunk); !result) {
            setState(arrival.key, ChunkState::failed);
            sources_[arrival.key.source].chunks[arrival.key.chunk].retryAt = frame_ + kRetryFrames;
            ++counters_.failures;
            lastFailure_ = result.error().line();
            continue;
        }
        setState(arrival.key, ChunkState::resident);
        Source& source = sources_[arrival.key.source];
        source.chunks[arrival.key.chunk].lastUsed = frame_;
        countInParents(arrival.key, 1);
        counters_.residentBytes += bytes;
        ++counters_.uploads;
        uploaded += bytes;
    }
    arrived_.erase(arrived_.begin(), arrived_.begin() + static_cast<std::ptrdiff_t>(taken));
}

/// A chunk is not evicted before those that build on it.
void Streamer::countInParents(ChunkKey key, int change) {
    Source& source = sources_[key.source];
    const lod::Hierarchy& h = *source.hierarchy;
    lod::forEachRequired(h, key.chunk, [&](uint32_t above) {
        uint16_t& below = source.chunks[above].residentBelow;
        below = static_cast<uint16_t>(below + change);
    });
}

void Streamer::evict(ChunkKey key) {
    Source& source = sources_[key.source];
    sink_.evict(key);
    setState(key, ChunkState::absent);
    countInParents(key, -1);
    counters_.residentBytes -= lod::decodedBytes(*source.hierarchy, key.chunk);
    ++counters_.evictions;
}

bool Streamer::makeRoom(uint64_t bytes) {
    while (counters_.residentBytes + bytes > settings_.residentBytes) {
        ChunkKey oldest{};
        uint64_t oldestUse = frame_;  // what this frame keeps is never evicted
        bool found = false;
        for (uint32_t i = 0; i < sources_.size(); ++i)
            for (uint32_t n = 1; n < sources_[i].chunks.size(); ++n) {
                const ChunkLife& s = sources_[i].chunks[n];
                const lod::Hierarchy& h = *sources_[i].hierarchy;
                if (s.state != ChunkState::resident || s.residentBelow != 0 || s.lastUsed >= oldestUse) continue;
                if (lod::isOfRoot(h, n)) continue;
                oldestUse = s.lastUsed;
                oldest = {i, n};
                found = true;
            }
        if (!found) return false;
        evict(oldest);
    }
    return true;
}

void Streamer::request(const lod::Cut& cut) {
    ++frame_;
    for (const auto& [source, chunk] : cut.keep) sources_[source].chunks[chunk].lastUsed = frame_;
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
    executor_.run([key, where, bytes = source.bytes, h = source.hierarchy, finish = source.finish, queue = completed_] {
        queue->push({key, fetchOrFail(*bytes, *h, key.chunk, *finish, where)});
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
            if (drawable_[s][n])
                sources_[s].chunks[n].lastUsed = frame_;
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
