#include "lod/builder/points/distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>

#include "engine/base/hash.h"
#include "engine/base/queue.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

Result<void> verdict(const Result<double>& result) {
    return result ? Result<void>() : Result<void>(tl::unexpected(result.error()));
}

/// The largest of all ranks.
double largestOf(const Workspace& workspace, double value) {
    if (workspace.ranks() == nullptr) return value;
    ByteWriter to;
    to.put(value);
    for (const std::vector<uint8_t>& bytes : workspace.ranks()->gather(to.bytes())) {
        double theirs = 0;
        ByteReader(bytes).get(theirs);
        value = std::max(value, theirs);
    }
    return value;
}

}  // namespace

Result<void> Distribution::run(const std::vector<Journal::Entry>& entries, BuildReport& report, StageClock& clock) {
    const uint64_t identity = input_.identity();
    const Journal::Entry* sent = nullptr;
    for (const Journal::Entry& e : entries) {
        if (e.what == Journal::What::sent || e.what == Journal::What::ready) sent = &e;
        if (e.what != Journal::What::counted) continue;
        ByteReader from(e.payload);
        from.get(wanted_.bucketPoints);
        from.get(rounding_);
        STIPPLE_TRY(input_.load(from, report));
        setFrame();
        tree_.emplace(frame_, input_.points);
        tree_->load(from);
        if (!from.isWhole()) return tl::unexpected(workspace_.damaged());
    }
    if (!tree_) STIPPLE_TRY(count(report, clock));
    plan_ = planBuckets(frame_, *tree_, wanted_.bucketPoints);
    makeBuckets();
    if (sent != nullptr && !loadBuckets(sent->payload, nextPart_)) return tl::unexpected(workspace_.damaged());
    report.temporaryBytes = workspace_.isOnDisk() ? temporaryBytes() : 0;
    if (sent != nullptr && sent->what == Journal::What::ready) return {};  // (what was built since is gone, and known)
    if (nextPart_ > 0)
        progress_.say(fmt::format("going on with the interrupted build: {} of its input are in their places",
                                  humanBytes(temporaryBytes())));
    if (workspace_.isOnDisk()) STIPPLE_TRY(announce());
    STIPPLE_TRY(send());
    if (input_.identity() != identity)
        return fail(ErrorKind::input, "changed while it was read", input_.firstPath(),
                    "build again when it is complete");
    report.temporaryBytes = workspace_.isOnDisk() ? temporaryBytes() : 0;
    clock.ends("distribute");
    return {};
}

Result<void> Distribution::count(BuildReport& report, StageClock& clock) {
    STIPPLE_TRY(input_.survey(report, executor_, progress_, wanted_.keepsPoints));
    clock.ends("survey");
    setFrame();
    tree_.emplace(frame_, input_.points);
    tree_->expect(input_.sample.coordinates(), input_.sampleShare);
    input_.sample = {};
    Ranks* const ranks = workspace_.ranks();
    std::vector<FarCubes> far = input_.farCubes(wanted_.workers);
    do {
        const Result<double> counted = input_.read(
            executor_, wanted_.workers, progress_, "count", {},
            [&](int, const Points& block) -> Result<void> {
                tree_->count(block.coordinates());
                return workspace_.checkStopped();
            },
            PointInput::Wanted::places, &far);
        STIPPLE_TRY(agree(ranks, verdict(counted)));
        if (!far.empty()) input_.concludeOutliers(std::exchange(far, {}), report);
        rounding_ = *counted;
        if (ranks != nullptr) tree_->addUp([&](std::vector<uint32_t>& counts) { ranks->addUp(counts); });
    } while (tree_->split());
    tree_->finish();
    input_.dropPlaces();
    rounding_ = largestOf(workspace_, rounding_);
    clock.ends("count");
    ByteWriter to;
    to.put(wanted_.bucketPoints);
    to.put(rounding_);
    input_.save(to);
    tree_->save(to);
    return agree(ranks, workspace_.note(Journal::What::counted, to.bytes()));
}

void Distribution::setFrame() {
    frame_ = makeFrame(input_.origin, input_.unit, input_.span, settings_.leafRecords, input_.resolution);
    layout_.holdPlacesOf(frame_);
    frame_.attributes = input_.attributes();
}

/// Buckets of a rank's own lie in the folder itself, what it has for others in one of its own.
std::string Distribution::folderOf(int rank, size_t bucket) const {
    const Ranks* const ranks = workspace_.ranks();
    const bool isTheirs = ranks == nullptr || bucket % static_cast<size_t>(ranks->count()) == static_cast<size_t>(rank);
    return isTheirs ? workspace_.folder() : fmt::format("{}/rank-{}", workspace_.folder(), rank);
}

void Distribution::makeBuckets() {
    const Ranks* const ranks = workspace_.ranks();
    const int rank = ranks == nullptr ? 0 : ranks->rank();
    std::error_code error;
    if (ranks != nullptr) fs::create_directory(fmt::format("{}/rank-{}", workspace_.folder(), rank), error);
    std::vector<uint64_t> sizes;
    for (size_t b = 0; b < plan_.buckets.size(); ++b) {
        buckets_.push_back(std::make_unique<BucketBytes>(folderOf(rank, b), b));
        sizes.push_back(plan_.buckets[b].points * layout_.bytes());
    }
    if (workspace_.isOnDisk()) return;
    region_.emplace(sizes);
    for (size_t b = 0; b < buckets_.size(); ++b) buckets_[b]->points.placeIn(*region_, b);
}

uint64_t Distribution::temporaryBytes() const {
    uint64_t sum = 0;
    for (const auto& bucket : buckets_) sum += bucket->bytes();
    return sum;
}

/// Before anything is written: is there room?
Result<void> Distribution::announce() const {
    // Points near borders go to neighbours too: rarely all, now and then to more than one.
    uint64_t atBorders = 0;
    for (size_t c = 0; c < tree_->cells().size(); ++c)
        atBorders += wanted_.wantGhosts && plan_.border[c] != 0 ? tree_->cells()[c].count : 0;
    return workspace_.announce(input_.points * layout_.bytes() + atBorders * layout_.ghostBytes(), progress_);
}

/// An error that does not say of which file it is: of the input.
Result<void> Distribution::named(Result<void> result) const {
    if (!result && result.error().where.empty()) result.error().where = input_.firstPath();
    return result;
}

Result<void> Distribution::send() {
    constexpr uint64_t kOften = uint64_t{1} << 26, kShare = 4;  // points between notes, and notes at least
    const uint64_t often = workspace_.isOnDisk() ? std::min(kOften, input_.points / kShare) : input_.points;
    Ranks* const ranks = workspace_.ranks();
    Distributor distributor(frame_, *tree_, plan_, layout_, buckets_, wanted_.workers, wanted_.bufferBytes,
                            wanted_.wantGhosts);
    constexpr uint32_t kSaidEvery = 16;  // blocks: all buckets are asked
    std::atomic<uint32_t> blocks{0};
    for (PointInput::Range range{nextPart_, nextPart_, 0}; range.end < input_.parts();) {
        range = input_.nextRange(range, often);
        const auto take = [&](int worker, const Points& block) -> Result<void> {
            STIPPLE_TRY(distributor.add(worker, block));
            if (workspace_.isOnDisk() && blocks++ % kSaidEvery == 0) progress_.setTemporaryBytes(temporaryBytes());
            return workspace_.checkStopped();
        };
        const Result<double> sent = input_.read(executor_, wanted_.workers, progress_, "distribute", range, take);
        STIPPLE_TRY(agree(ranks, named(verdict(sent))));
        STIPPLE_TRY(agree(ranks, named(distributor.flush())));
        if (range.end < input_.parts()) STIPPLE_TRY(note(Journal::What::sent, range.end));
    }
    if (!workspace_.isOnDisk()) return {};
    if (ranks != nullptr) STIPPLE_TRY(collect());
    return note(Journal::What::ready, input_.parts());
}

Result<void> Distribution::sealBuckets() {
    CompletionQueue<Error> errors;
    executor_.parallelFor(buckets_.size(), 1, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b)
            for (Spill* spill : {&buckets_[b]->points, &buckets_[b]->ghosts})
                if (const auto sealed = spill->seal(); !sealed) errors.push(sealed.error());
    });
    if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    return {};
}

// What lies in the buckets: for each rank that brought something its number, then bucket, points, ghosts.
void Distribution::saveBuckets(ByteWriter& to, bool isOwnOnly) const {
    const int rank = workspace_.ranks() == nullptr ? 0 : workspace_.ranks()->rank();
    for (size_t b = 0; b < buckets_.size(); ++b) {
        if (isOwnOnly && !workspace_.isOwn(b)) continue;
        to.put(rank);
        to.put(uint64_t{b});
        to.put(buckets_[b]->points.segments());
        to.put(buckets_[b]->ghosts.segments());
    }
}

Result<void> Distribution::note(Journal::What what, size_t nextPart) {
    if (!workspace_.isOnDisk()) return {};
    Ranks* const ranks = workspace_.ranks();
    STIPPLE_TRY(agree(ranks, sealBuckets()));
    ByteWriter own, all;
    saveBuckets(own, what == Journal::What::ready);
    all.put(ranks == nullptr ? 1 : ranks->count());
    all.put(uint64_t{nextPart});
    std::vector<uint8_t> joined;
    if (ranks == nullptr) {
        joined = own.bytes();
    } else {
        for (const auto& theirs : ranks->gather(own.bytes())) joined.insert(joined.end(), theirs.begin(), theirs.end());
    }
    all.put(joined);
    return agree(ranks, workspace_.note(what, all.bytes()));
}

/// What is not whole yet is of use only to as many ranks as there were.
bool Distribution::loadBuckets(const std::vector<uint8_t>& saved, size_t& nextPart) {
    const Ranks* const ranks = workspace_.ranks();
    int count = 0;
    uint64_t next = 0;
    std::vector<uint8_t> joined;
    ByteReader head(saved);
    head.get(count);
    head.get(next);
    head.get(joined);
    if (!head.isWhole()) return false;
    const bool isReady = next == input_.parts();
    if (!isReady && count != (ranks == nullptr ? 1 : ranks->count())) return true;
    nextPart = next;
    for (ByteReader from(joined); !from.isWhole();) {
        int rank = 0;
        uint64_t b = 0;
        std::vector<Spill::Segment> points, ghosts;
        from.get(rank);
        from.get(b);
        from.get(points);
        from.get(ghosts);
        if (from.isBroken() || b >= buckets_.size()) return false;
        if (!isReady && ranks != nullptr && rank != ranks->rank()) continue;
        if (isReady) buckets_[b] = std::make_unique<BucketBytes>(workspace_.folder(), b);
        buckets_[b]->points.restore(std::move(points));
        buckets_[b]->ghosts.restore(std::move(ghosts));
    }
    return true;
}

/// Each rank appends to its own buckets what the others have for them.
Result<void> Distribution::collect() {
    Ranks& ranks = *workspace_.ranks();
    STIPPLE_TRY(agree(&ranks, sealBuckets()));
    // What is collected goes: an interrupted build has to distribute again.
    ByteWriter nothing;
    nothing.put(0);
    nothing.put(uint64_t{0});
    nothing.put(std::vector<uint8_t>());
    STIPPLE_TRY(agree(&ranks, workspace_.note(Journal::What::sent, nothing.bytes())));
    ByteWriter mine;
    saveBuckets(mine, false);
    const std::vector<std::vector<uint8_t>> all = ranks.gather(mine.bytes());
    const auto collectAll = [&]() -> Result<void> {
        for (const std::vector<uint8_t>& theirs : all)
            for (ByteReader from(theirs); !from.isWhole();) {
                int rank = 0;
                uint64_t b = 0;
                std::array<std::vector<Spill::Segment>, 2> segments;
                from.get(rank);
                from.get(b);
                from.get(segments[0]);
                from.get(segments[1]);
                if (from.isBroken()) return tl::unexpected(workspace_.damaged());
                if (rank == ranks.rank() || !workspace_.isOwn(b)) continue;
                BucketBytes there(folderOf(rank, b), b);
                for (const auto& [spill, to, k] : {std::tuple{&there.points, &buckets_[b]->points, 0},
                                                   std::tuple{&there.ghosts, &buckets_[b]->ghosts, 1}}) {
                    spill->restore(std::move(segments.at(static_cast<size_t>(k))));
                    if (spill->bytes() == 0) continue;
                    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, spill->take());
                    STIPPLE_TRY(to->append(bytes));
                    spill->remove();
                }
            }
        return {};
    };
    return agree(&ranks, collectAll());
}

}  // namespace stipple::lod
