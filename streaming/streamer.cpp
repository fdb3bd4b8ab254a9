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

struct Streamer::Request {
    ChunkKey key;
    const Source* source = nullptr;
    /// As it is in the file; attributes that are wanted stand behind the chunk's own bytes.
    std::vector<uint8_t> bytes, weights;
    Result<lod::Chunk> chunk;

    size_t attributeBytes() const {
        const lod::Hierarchy& h = *source->hierarchy;
        return source->finish.wantsAttributes && !h.isTile(key.chunk) ? h.payload(key.chunk).attributeBytes : 0;
    }
    const lod::Stream* weightsPlace() const {
        return source->hierarchy->isTile(key.chunk) ? nullptr : lod::weightsOf(*source->hierarchy, key.chunk);
    }
    Result<void> read();
    Result<lod::Chunk> decode() const;
};

Result<void> Streamer::Request::read() {
    const lod::ChunkPlace place = lod::chunkPlace(*source->hierarchy, key.chunk);
    bytes.resize(place.bytes + attributeBytes());
    STIPPLE_TRY(source->bytes->readAt(place.offset, bytes.data(), bytes.size()));
    const lod::Stream* const stream = weightsPlace();
    if (stream == nullptr) return {};
    weights.resize(stream->bytes);
    return source->bytes->readAt(stream->offset, weights.data(), weights.size());
}

Result<lod::Chunk> Streamer::Request::decode() const {
    const lod::Hierarchy& h = *source->hierarchy;
    const lod::ChunkPlace place = lod::chunkPlace(h, key.chunk);
    const std::string where = fmt::format("{}: chunk {}", source->name, key.chunk);
    const auto damaged = [&](const char* what) {
        return fail(ErrorKind::input, fmt::format("the hash of {} does not match", what), where,
                    "the store is damaged; build it again");
    };
    const size_t ofAttributes = attributeBytes();
    const uint8_t* const attributes = bytes.data() + place.bytes;
    if (hashBytes(bytes.data(), place.bytes) != place.hash ||
        (ofAttributes > 0 && hashBytes(attributes, ofAttributes) != h.payload(key.chunk).attributeHash))
        return damaged("a chunk");
    STIPPLE_ASSIGN(lod::Chunk decoded, lod::decodeStored(h, key.chunk, bytes.data(), place.bytes, where, false));
    if (source->finish.apply) STIPPLE_TRY(source->finish.apply(key.chunk, decoded, attributes, ofAttributes));
    if (const lod::Stream* stream = weightsPlace()) {
        if (hashBytes(weights.data(), weights.size()) != stream->hash) return damaged("the weights of a chunk");
        STIPPLE_ASSIGN(decoded.weights,
                       lod::decodeWeights(weights.data(), weights.size(), h.payload(key.chunk).records, where));
    }
    return decoded;
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
    : executor_(executor), executorLife_(executor.life()), sink_(sink), settings_(settings) {
    groups_.emplace_back();
    groups_.front().end.before = groups_.front().end.after = {kGroupEnd, 0};
}

Streamer::~Streamer() {
    if (!executorLife_.expired()) executor_.wait();
    for (uint32_t i = 0; i < sources_.size(); ++i)
        for (uint32_t n = 0; n < sources_[i].chunks.size(); ++n)
            if (sources_[i].chunks[n].state == ChunkState::resident) sink_.evict({i, n});
}

void Streamer::addSource(const lod::Hierarchy& hierarchy, std::shared_ptr<const ByteSource> source, std::string name,
                         ChunkFinish finish, std::shared_ptr<lod::NodePages> pages) {
    std::vector<PageLife> pageLives(hierarchy.known.count());
    sources_.push_back({&hierarchy, std::move(source), std::move(name), std::move(finish),
                        std::vector<ChunkLife>(hierarchy.chunks()), std::move(pages), std::move(pageLives)});
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

void Streamer::giveBack(Request& request) {
    request.chunk = lod::Chunk{};
    spare_.push_back(&request);
}

void Streamer::collect() {
    collectPages();
    completed_.takeAll(taken_);
    for (Request* const request : taken_) {
        --counters_.inFlight;
        const ChunkKey key = request->key;
        if (!request->chunk) {
            setState(key, ChunkState::failed);
            lifeOf(key).retryAt = frame_ + kRetryFrames;
            ++counters_.failures;
            lastFailure_ = request->chunk.error().line();
            giveBack(*request);
            continue;
        }
        setState(key, ChunkState::arrived);
        counters_.bytesStreamed += lod::chunkPlace(*request->source->hierarchy, key.chunk).bytes;
        arrived_.push_back(request);
    }
}

void Streamer::upload() {
    uint64_t uploaded = 0;
    // What others build on has the lower number.
    std::sort(arrived_.begin(), arrived_.end(), [](const Request* a, const Request* b) {
        return a->key.chunk != b->key.chunk ? a->key.chunk < b->key.chunk : a->key.source < b->key.source;
    });
    size_t waiting = 0;
    bool isFull = false;
    for (Request* const request : arrived_) {
        const Fate fate = isFull ? Fate::waits : settle(*request, uploaded);
        isFull = isFull || fate == Fate::frameIsFull;
        if (fate == Fate::settled)
            giveBack(*request);
        else
            arrived_[waiting++] = request;
    }
    arrived_.resize(waiting);
}

Streamer::Fate Streamer::settle(Request& request, uint64_t& uploaded) {
    const ChunkKey key = request.key;
    const Source& source = sources_[key.source];
    ChunkLife& life = lifeOf(key);
    const auto drop = [&](uint64_t& counter) {
        setState(key, ChunkState::absent);
        ++counter;
        return Fate::settled;
    };
    if (life.lastWanted < frame_) return drop(counters_.unwanted);
    bool isWhole = true, isUnderWay = true;
    lod::forEachRequired(*source.hierarchy, key.chunk, [&](uint32_t above) {
        const ChunkState base = source.chunks[above].state;
        isWhole = isWhole && base == ChunkState::resident;
        isUnderWay = isUnderWay && base != ChunkState::absent && base != ChunkState::failed;
    });
    if (!isWhole) return isUnderWay ? Fate::waits : drop(counters_.unwanted);
    const uint64_t bytes = lod::decodedBytes(*source.hierarchy, key.chunk);
    if (uploaded > 0 && uploaded + bytes > settings_.uploadBytesPerFrame) return Fate::frameIsFull;
    if (!makeRoom(bytes)) {
        life.retryAt = frame_ + kRetryFrames;
        return drop(counters_.refused);
    }
    (void)groupOfFrame();  // what may want memory comes before what must not stop half-way
    if (const auto result = sink_.upload(key, std::move(*request.chunk)); !result) {
        setState(key, ChunkState::failed);
        life.retryAt = frame_ + kRetryFrames;
        ++counters_.failures;
        lastFailure_ = result.error().line();
        return Fate::settled;
    }
    setState(key, ChunkState::resident);
    countInParents(key, 1);
    use(key);
    counters_.residentBytes += bytes;
    ++counters_.uploads;
    uploaded += bytes;
    return Fate::settled;
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

void Streamer::link(ChunkKey key) { linkAfter(groups_[lifeOf(key).used].end.before, key); }

uint32_t Streamer::groupOfFrame() {
    const ChunkKey last = groups_.front().end.before;  // an end: of the newest group, or of the list
    if (last.chunk != 0 && (groups_[last.chunk].frame == frame_ || groups_[last.chunk].chunks == 0)) {
        groups_[last.chunk].frame = frame_;
        return last.chunk;
    }
    if (spareGroups_.empty()) {
        groups_.emplace_back();
        spareGroups_.reserve(groups_.capacity());
        spareGroups_.push_back(static_cast<uint32_t>(groups_.size() - 1));
    }
    const uint32_t group = spareGroups_.back();
    spareGroups_.pop_back();
    groups_[group].frame = frame_;
    linkAfter(last, {kGroupEnd, group});
    return group;
}

void Streamer::leaveGroup(ChunkLife& life) {
    const uint32_t group = std::exchange(life.used, kNever);
    if (group == kNever || --groups_[group].chunks > 0) return;
    unlink({kGroupEnd, group});
    spareGroups_.push_back(group);
}

void Streamer::use(ChunkKey key) {
    ChunkLife& life = lifeOf(key);
    if (life.state != ChunkState::resident || lod::isOfRoot(*sources_[key.source].hierarchy, key.chunk)) return;
    const uint32_t group = groupOfFrame();
    if (life.used == group) return;
    unlink(key);
    leaveGroup(life);
    life.used = group;
    ++groups_[group].chunks;
    if (isEvictable(key)) link(key);
}

/// A chunk is not evicted before those that build on it.
void Streamer::countInParents(ChunkKey key, int change) {
    Source& source = sources_[key.source];
    lod::forEachRequired(*source.hierarchy, key.chunk, [&](uint32_t above) {
        const ChunkKey parent{key.source, above};
        ChunkLife& life = source.chunks[above];
        if (life.residentBelow == 0 && change > 0) unlink(parent);
        life.residentBelow = static_cast<uint16_t>(life.residentBelow + change);
        if (change < 0 && isEvictable(parent)) link(parent);
    });
}

void Streamer::evict(ChunkKey key) {
    Source& source = sources_[key.source];
    unlink(key);
    leaveGroup(lifeOf(key));
    sink_.evict(key);
    setState(key, ChunkState::absent);
    countInParents(key, -1);
    counters_.residentBytes -= lod::decodedBytes(*source.hierarchy, key.chunk);
    ++counters_.evictions;
}

bool Streamer::makeRoom(uint64_t bytes) {
    while (counters_.residentBytes + bytes > settings_.residentBytes) {
        ChunkKey oldest = groups_.front().end.after;
        while (oldest.source == kGroupEnd && oldest.chunk != 0) oldest = lifeOf(oldest).after;
        if (oldest.source == kGroupEnd) return false;
        if (groups_[lifeOf(oldest).used].frame >= frame_) return false;  // what this frame keeps is never evicted
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
    if (source.hierarchy->isUnknown(chunk)) {
        startPage({sourceIndex, chunk});
        return;
    }
    ChunkLife& state = source.chunks[chunk];
    if ((state.state != ChunkState::absent && state.state != ChunkState::failed) || frame_ < state.retryAt) return;
    // Of no use before all that it builds on, which is asked for first.
    bool isOfUse = true;
    lod::forEachRequired(*source.hierarchy, chunk, [&](uint32_t above) {
        const ChunkState base = source.chunks[above].state;
        isOfUse = isOfUse && base != ChunkState::absent && base != ChunkState::failed;
    });
    if (!isOfUse) return;
    const ChunkKey key{sourceIndex, chunk};
    if (spare_.empty()) spare_.push_back(requests_.emplace_back(std::make_unique<Request>()).get());
    completed_.reserve(requests_.size());
    setState(key, ChunkState::requested);
    ++counters_.inFlight;
    ++counters_.requests;
    Request* const request = spare_.back();
    spare_.pop_back();
    request->key = key;
    request->source = &source;
    // Two pointers are what a task holds without memory of its own. The streamer waits for its tasks before it ends.
    executor_.read([this, request] {
        if (auto read = orFail([&] { return request->read(); }); !read)
            request->chunk = tl::unexpected(std::move(read.error()));
        executor_.run([this, request] {
            if (request->chunk) request->chunk = orFail([&] { return request->decode(); });
            request->bytes = {};
            request->weights = {};
            completed_.push(request);
        });
    });
}

bool Streamer::startPage(ChunkKey unknown) {
    Source& source = sources_[unknown.source];
    const uint32_t page = source.hierarchy->known.pageOf(unknown.chunk);
    PageLife& life = source.pageLives[page];
    if (life.isRequested) return true;
    if (!source.pages || frame_ < life.retryAt) return false;
    auto request = std::make_unique<PageRequest>();
    *request = {unknown.source, page, source.hierarchy, source.pages.get(), {}};
    completedPages_.reserve(pagesInFlight_ + size_t{1});
    life.isRequested = true;
    ++pagesInFlight_;
    ++counters_.inFlight;
    executor_.read([this, of = request.release()] {
        std::unique_ptr<PageRequest> done(of);
        done->read = orFail([&] { return done->pages->load(*done->hierarchy, done->page); });
        completedPages_.push(std::move(done));
    });
    return true;
}

void Streamer::collectPages() {
    if (pagesInFlight_ == 0) return;
    completedPages_.takeAll(takenPages_);
    for (const auto& done : takenPages_) {
        --pagesInFlight_;
        --counters_.inFlight;
        PageLife& life = sources_[done->source].pageLives[done->page];
        life.isRequested = false;
        if (done->read) {
            counters_.pages += done->read->pages;
            counters_.bytesStreamed += done->read->bytes;
            continue;
        }
        life.retryAt = frame_ + kRetryFrames;
        ++counters_.failures;
        lastFailure_ = done->read.error().line();
    }
}

bool Streamer::readPages(std::span<const std::pair<uint32_t, uint32_t>> unknown) {
    bool isAny = false;
    for (const auto& [source, chunk] : unknown) isAny = startPage({source, chunk}) || isAny;
    executor_.wait();
    collectPages();
    return isAny;
}

void Streamer::makeRoomFor(const lod::ResidentPlan& plan) {
    const auto isPlanned = [&](ChunkKey key) { return plan.chunks[key.source][key.chunk] != 0; };
    std::erase_if(arrived_, [&](Request* request) {
        if (isPlanned(request->key)) return false;
        setState(request->key, ChunkState::absent);
        giveBack(*request);
        return true;
    });
    others_.clear();
    uint64_t together = plan.bytes;
    for (uint32_t s = 0; s < sources_.size(); ++s)
        for (uint32_t n = 0; n < sources_[s].chunks.size(); ++n) {
            ChunkLife& state = sources_[s].chunks[n];
            if (isPlanned({s, n})) state.retryAt = 0;  // there was no room; now there is
            if (state.state != ChunkState::resident || isPlanned({s, n})) continue;
            others_.push_back({s, n});
            together += lod::decodedBytes(*sources_[s].hierarchy, n);
        }
    const auto last = [&](ChunkKey k) {
        const uint32_t group = lifeOf(k).used;
        return group == kNever ? ~uint64_t{0} : groups_[group].frame;  // chunks of roots go last
    };
    // What builds on others was not used later than they, and has the higher number.
    std::sort(others_.begin(), others_.end(), [&](ChunkKey a, ChunkKey b) {
        if (last(a) != last(b)) return last(a) < last(b);
        return a.source != b.source ? a.source < b.source : a.chunk > b.chunk;
    });
    for (const ChunkKey key : others_) {
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
