// A build of points as a straight line: survey, count, distribute, then bucket by bucket estimate, build, write;
// verify.
#include "lod/build/build.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "engine/base/hash.h"
#include "engine/base/ordered.h"
#include "engine/base/queue.h"
#include "lod/build/octree/assemble.h"
#include "lod/build/octree/journal.h"
#include "lod/build/points/estimate.h"
#include "lod/build/points/exchange.h"
#include "lod/build/points/input.h"
#include "lod/store.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kVerifiedNodes = 512;  ///< at the end of a build; `info --verify` checks all
constexpr uint64_t kBuildVersion = 2;     ///< of what the same input gives: an interrupted build of another is refused

/// The axis of the format or of the settings; away from the Earth's centre for coordinates that are relative to it.
glm::dvec3 upOf(const PointInput& input, const BuildSettings& settings, const StoreDescription& description) {
    constexpr double kLeastRadius = 6.33e6, kGreatestRadius = 6.40e6;  // metres, sea floor to mountain tops
    const glm::dvec3 centre = 0.5 * (description.boundsMin + description.boundsMax);
    const double radius = glm::length(centre) * description.metresPerUnit;
    const double extent = glm::length(description.boundsMax - description.boundsMin) * description.metresPerUnit;
    const bool isGeocentric =
        radius > kLeastRadius && radius < kGreatestRadius && extent < 1e5 && std::abs(centre.z) > 1e5;
    if (!settings.up && isGeocentric && !input.crs.isDegrees && (input.crs.isGeocentric || input.crs.label().empty()))
        return glm::normalize(centre);
    return axisVector(input.up);
}

/// How the memory is shared out.
struct MemoryPlan {
    uint64_t bucketPoints = 0, bufferBytes = 0;
    bool isOnDisk = false;
};

class PointBuild {
  public:
    PointBuild(std::string output, const BuildSettings& settings, Executor& executor, Progress& progress,
               PointInput input, BuildReport report)
        : output_(std::move(output)),
          settings_(settings),
          executor_(executor),
          progress_(progress),
          input_(std::move(input)),
          report_(std::move(report)),
          clock_(report_),
          workers_(std::max(executor.threads(), 1)),
          layout_(input_.hasColour, input_.hasNormal, input_.hasRadius, input_.attributes()) {}

    Result<BuildReport> run() {
        STIPPLE_TRY(planMemory());
        if (settings_.ranks != nullptr) return runTogether();
        if (memory_.isOnDisk) {
            STIPPLE_ASSIGN(Journal journal,
                           Journal::open(Journal::folderOf(output_, settings_.tempFolder), output_, identity()));
            journal_.emplace(std::move(journal));
        }
        report_.isResumed = journal_ && !journal_->entries().empty();
        if (report_.isResumed) {
            STIPPLE_TRY(restoreDistribution());
        } else {
            STIPPLE_TRY(distribute());
        }
        STIPPLE_TRY(openWriter());
        STIPPLE_TRY(buildBuckets());
        STIPPLE_TRY(finish());
        report_.seconds = clock_.seconds();
        return std::move(report_);
    }

  private:
    /// The same with others: each builds its share of the buckets, the first one puts them together.
    Result<BuildReport> runTogether() {
        Ranks& ranks = *settings_.ranks;
        const std::string folder = Journal::folderOf(output_, settings_.tempFolder);
        STIPPLE_TRY(makeSharedFolder(ranks, folder));
        bucketFolder_ = ownFolder(ranks, folder);
        // Enough buckets for all, and the same ones whatever each machine has.
        const auto workers = static_cast<uint64_t>(workers_) * static_cast<uint64_t>(ranks.count());
        const uint64_t share = std::max(input_.declared() / (6 * workers), kAtomPoints);
        memory_.bucketPoints = leastOf(std::min(memory_.bucketPoints, share));
        STIPPLE_TRY(agree(&ranks, distribute()));
        STIPPLE_TRY(agree(&ranks, collectBuckets(ranks, folder, buckets_)));
        clock_.ends("distribute");
        description_ = describe();
        std::vector<size_t> own;
        for (size_t b = 0; b < plan_.buckets.size(); ++b)
            if (isOwn(&ranks, b)) own.push_back(b);
        const Result<void> made = inOrder<BuiltBucket>(
            executor_, workers_, 0, own.size(),
            [&](size_t k) -> Result<BuiltBucket> {
                STIPPLE_TRY(checkStopped());
                return buildBucket(own[k]);
            },
            [&](size_t k, const BuiltBucket& built) {
                progress_.update("build", done_ += plan_.buckets[own[k]].points, input_.points);
                buckets_[own[k]]->points.remove();
                buckets_[own[k]]->ghosts.remove();
                return saveBuilt(folder, own[k], built);
            });
        STIPPLE_TRY(agree(&ranks, made));
        clock_.ends("build");
        STIPPLE_TRY(agree(&ranks, ranks.rank() == 0 ? putTogether(folder) : Result<void>()));
        std::error_code error;
        if (ranks.rank() == 0) std::filesystem::remove_all(folder, error);
        report_.seconds = clock_.seconds();
        return std::move(report_);
    }
    Result<void> putTogether(const std::string& folder) {
        STIPPLE_TRY(openWriter());
        const ValueRanges empty = ranges_;
        for (size_t b = 0; b < plan_.buckets.size(); ++b) {
            STIPPLE_ASSIGN(BuiltBucket built, loadBuilt(folder, b, empty));
            STIPPLE_TRY(commit(b, std::move(built)));
        }
        clock_.ends("put together");
        return finish();
    }

    uint64_t pointBytes() const {  // that a worker needs for each point of its bucket
        uint64_t bytes = 128;
        for (const AttributeInfo& a : input_.attributes()) bytes += 4 * bytesOf(a.type);
        return bytes;
    }

    Result<void> planMemory() {
        constexpr uint64_t kFixed = uint64_t{72} << 20, kReader = uint64_t{12} << 20;
        const auto fixedFor = [&](uint64_t threads) { return kFixed + threads * kReader; };
        const auto leastFor = [&](uint64_t threads) {
            return fixedFor(threads) + (threads + 1) * kAtomPoints * pointBytes() + input_.declared() / 2;
        };
        // Fewer threads rather than more memory.
        while (workers_ > 1 && leastFor(static_cast<uint64_t>(workers_)) > settings_.memoryBytes) --workers_;
        const auto workers = static_cast<uint64_t>(workers_);
        const uint64_t fixed = fixedFor(workers), least = leastFor(workers);
        const uint64_t n = input_.declared(), all = n * layout_.bytes();
        // What is small needs no more than its own points.
        const uint64_t small = fixed + all + 2 * n * pointBytes();
        if (settings_.memoryBytes < std::min(least, small))
            return fail(ErrorKind::budget,
                        fmt::format("building {} points needs {} MiB, but --memory allows {} MiB", n,
                                    (std::min(least, small) >> 20) + 1, settings_.memoryBytes >> 20),
                        input_.firstPath(), fmt::format("give --memory {}M", (std::min(least, small) >> 20) + 1));
        const uint64_t room = settings_.memoryBytes - fixed;
        const auto bucketOf = [&](uint64_t bytes) {
            return std::min<uint64_t>(bytes / ((workers + 1) * pointBytes()), uint64_t{1} << 20);
        };
        // (Half of the memory at most: what neighbours see, buffers and the allocator's own losses come on top.)
        memory_.isOnDisk = 2 * all + (workers + 1) * kAtomPoints * pointBytes() > room && small > room + fixed;
        memory_.bufferBytes = std::min<uint64_t>(room / 8, uint64_t{64} << 20);
        memory_.bucketPoints = bucketOf(memory_.isOnDisk ? room / 2 : room / 4);
        // Enough of them for all threads, but none smaller than an atom.
        memory_.bucketPoints =
            std::max<uint64_t>(std::min<uint64_t>(memory_.bucketPoints, n / (6 * workers)), kAtomPoints);
        return {};
    }

    uint64_t identity() const {
        std::string text = fmt::format("{}|{}|{}|{}|{}|{}|{}|{}|{}|{}", kStoreVersion, kBuildVersion, input_.identity(),
                                       static_cast<int>(settings_.normals), settings_.estimateRadii,
                                       settings_.up ? static_cast<int>(*settings_.up) : -1, settings_.leafRecords,
                                       settings_.skipBad, settings_.fineNormals, settings_.mergeDuplicates);
        for (const AttributeInfo& a : input_.attributes()) text += "|" + a.name;
        text += "|" + std::filesystem::absolute(output_).lexically_normal().string();
        return hashBytes(text.data(), text.size());
    }
    Result<void> checkStopped() const {
        if (!settings_.isStopped || !settings_.isStopped()) return {};
        return fail(ErrorKind::interrupted, "interrupted", output_,
                    journal_ ? "run the same command again to go on" : "nothing was written");
    }

    // ---- survey, count, distribute ----

    Result<void> distribute() {
        Ranks* const ranks = settings_.ranks;
        inputIdentity_ = input_.identity();
        STIPPLE_TRY(input_.survey(report_, executor_, progress_));
        clock_.ends("survey");
        const auto& g = input_.greatest;
        frame_ = makeFrame(input_.origin, input_.unit, std::max({g[0], g[1], g[2]}), settings_.leafRecords);
        frame_.attributes = input_.attributes();
        tree_.emplace(frame_, input_.points);
        tree_->expect(input_.sample.coordinates(), input_.sampleShare);
        input_.sample = {};
        double rounding = 0;
        do {
            const Result<double> counted =
                input_.read(executor_, workers_, progress_, "count", [&](int, const Points& block) -> Result<void> {
                    tree_->count(block.coordinates());
                    return checkStopped();
                });
            STIPPLE_TRY(agree(ranks, counted ? Result<void>() : Result<void>(tl::unexpected(counted.error()))));
            rounding = *counted;
            if (ranks != nullptr) tree_->addUp([&](std::vector<uint32_t>& counts) { ranks->addUp(counts); });
        } while (tree_->split());
        tree_->finish();
        rounding_ = largestOf(rounding);
        clock_.ends("count");
        plan_ = planBuckets(frame_, *tree_, memory_.bucketPoints);
        STIPPLE_TRY(announceDisk());
        if (journal_) bucketFolder_ = journal_->folder();
        buckets_ = makeBuckets(plan_.buckets.size(), bucketFolder_);
        for (size_t b = 0; b < buckets_.size(); ++b)
            buckets_[b]->points.reserve(plan_.buckets[b].points * layout_.bytes());
        Distributor distributor(frame_, *tree_, plan_, layout_, buckets_, workers_, memory_.bufferBytes,
                                wantsEstimates());
        STIPPLE_ASSIGN(rounding_, input_.read(executor_, workers_, progress_, "distribute",
                                              [&](int worker, const Points& block) -> Result<void> {
                                                  STIPPLE_TRY(distributor.add(worker, block));
                                                  if (journal_) progress_.setTemporaryBytes(temporaryBytes());
                                                  return checkStopped();
                                              }));
        STIPPLE_TRY(distributor.flush());
        if (input_.identity() != inputIdentity_)
            return fail(ErrorKind::input, "changed while it was read", input_.firstPath(),
                        "build again when it is complete");
        report_.temporaryBytes = journal_ ? temporaryBytes() : 0;
        clock_.ends("distribute");
        return journal_ ? saveDistribution() : Result<void>();
    }

    /// Values of all ranks.
    template <typename T>
    std::vector<T> ofAll(T value) const {
        if (settings_.ranks == nullptr) return {value};
        ByteWriter to;
        to.put(value);
        std::vector<T> all;
        for (const std::vector<uint8_t>& bytes : settings_.ranks->gather(to.bytes()))
            ByteReader(bytes).get(all.emplace_back());
        return all;
    }
    double largestOf(double value) const { return std::ranges::max(ofAll(value)); }
    uint64_t leastOf(uint64_t value) const { return std::ranges::min(ofAll(value)); }

    uint64_t temporaryBytes() const {
        uint64_t sum = 0;
        for (const auto& bucket : buckets_) sum += bucket->bytes();
        return sum;
    }
    bool wantsEstimates() const { return settings_.estimateRadii || settings_.normals == NormalsMode::automatic; }

    /// Before anything is written: is there room?
    Result<void> announceDisk() {
        if (!journal_) return {};
        // Points near borders go to neighbours too: rarely all, now and then to more than one.
        uint64_t atBorders = 0;
        for (size_t c = 0; c < tree_->cells().size(); ++c)
            atBorders += wantsEstimates() && plan_.isBorder[c] != 0 ? tree_->cells()[c].count : 0;
        const uint64_t needed = input_.points * layout_.bytes() + atBorders * RecordLayout::kGhostBytes;
        return journal_->announce(needed, progress_);
    }

    /// What the survey and the count found, in the order in which it lies in the journal.
    template <typename Visit>
    void visitFacts(const Visit& visit) {
        visit(frame_.origin);
        visit(frame_.unit);
        visit(frame_.rootLog2);
        visit(frame_.keyLevels);
        visit(rounding_);
        visit(input_.greatest);
        visit(input_.points);
        visit(input_.hasColour);
        visit(memory_.bucketPoints);
        visit(report_.pointsIn);
        visit(report_.temporaryBytes);
        visit(report_.notes);
    }

    Result<void> saveDistribution() {
        ByteWriter to;
        visitFacts([&](const auto& value) { to.put(value); });
        to.put(uint64_t{report_.dropped.size()});
        for (const auto& [reason, count] : report_.dropped) {
            to.put(reason);
            to.put(count);
        }
        tree_->save(to);
        CompletionQueue<Error> errors;
        executor_.parallelFor(buckets_.size(), 1, [&](size_t begin, size_t end) {
            for (size_t b = begin; b < end; ++b)
                for (Spill* spill : {&buckets_[b]->points, &buckets_[b]->ghosts})
                    if (const auto sealed = spill->seal(); !sealed) errors.push(sealed.error());
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
        for (const auto& bucket : buckets_)
            for (Spill* spill : {&bucket->points, &bucket->ghosts}) {
                to.put(spill->bytes());
                to.put(spill->hash());
            }
        return journal_->append(to.bytes());
    }

    Result<void> restoreDistribution() {
        ByteReader from(journal_->entries().front());
        visitFacts([&](auto& value) { from.get(value); });
        frame_.leafRecords = settings_.leafRecords;
        frame_.errors = errorsOf(frame_.rootLog2);
        frame_.attributes = input_.attributes();
        input_.origin = frame_.origin;
        input_.unit = frame_.unit;
        uint64_t count = 0;
        from.get(count);
        for (uint64_t k = 0; k < count && k < 100; ++k) {
            std::string reason;
            uint64_t points = 0;
            from.get(reason);
            from.get(points);
            report_.dropped[reason] = points;
        }
        tree_.emplace(frame_, input_.points);
        tree_->load(from);
        plan_ = planBuckets(frame_, *tree_, memory_.bucketPoints);
        buckets_ = makeBuckets(plan_.buckets.size(), journal_->folder());
        for (const auto& bucket : buckets_)
            for (Spill* spill : {&bucket->points, &bucket->ghosts}) {
                uint64_t bytes = 0, hash = 0;
                from.get(bytes);
                from.get(hash);
                spill->restore(bytes, hash);
            }
        if (!from.isWhole())
            return fail(ErrorKind::input, "holds a damaged journal", journal_->folder(), "delete the folder");
        progress_.say(fmt::format("going on with the interrupted build: {} of {} buckets are done",
                                  journal_->entries().size() - 1, plan_.buckets.size()));
        return {};
    }

    // ---- buckets ----

    Result<void> openWriter() {
        description_ = describe();
        ranges_ = ValueRanges(frame_, input_.points, description_.up);
        upper_.emplace(frame_);
        if (!journal_) {
            STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output_));
            writer_.emplace(std::move(writer));
            return {};
        }
        uint64_t written = 0;
        for (size_t e = 1; e < journal_->entries().size(); ++e, ++firstBucket_) {
            ByteReader from(journal_->entries()[e]);
            NodeBatch batch;
            uint64_t merged = 0, tooMany = 0;
            from.get(written);
            from.get(merged);
            from.get(tooMany);
            from.get(batch.nodes);
            from.get(batch.counts);
            ValueRanges ranges(frame_, input_.points, description_.up);
            ranges.load(from);
            upper_->loadChanges(from);
            if (!from.isWhole())
                return fail(ErrorKind::input, "holds a damaged journal", journal_->folder(), "delete the folder");
            merged_ += merged;
            tooMany_ += tooMany;
            ranges_.add(ranges);
            batches_.push_back(std::move(batch));
        }
        journal_->forgetEntries();
        STIPPLE_TRY(checkWritten());
        STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::resume(output_, journal_->partialPath(), written));
        writer_.emplace(std::move(writer));
        return {};
    }

    /// Are the chunks that an earlier run wrote still what they were?
    Result<void> checkWritten() {
        if (batches_.empty()) return {};
        STIPPLE_ASSIGN(const InputFile file, InputFile::open(journal_->partialPath()));
        CompletionQueue<Error> errors;
        executor_.parallelFor(batches_.size(), 1, [&](size_t begin, size_t end) {
            std::vector<uint8_t> bytes;
            for (size_t b = begin; b < end; ++b)
                for (const NodeBatch::Written& w : batches_[b].nodes) {
                    bytes.resize(size_t{w.node.chunkBytes} + w.node.attributeBytes);
                    const auto read = file.readAt(w.node.chunkOffset, bytes.data(), bytes.size());
                    const bool isSame =
                        read && hashBytes(bytes.data(), w.node.chunkBytes) == w.node.chunkHash &&
                        hashBytes(bytes.data() + w.node.chunkBytes, w.node.attributeBytes) == w.node.attributeHash;
                    if (isSame) continue;
                    errors.push({ErrorKind::input, "is not what was written", journal_->partialPath(),
                                 "delete it and the folder " + journal_->folder()});
                    return;
                }
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
        return {};
    }

    Result<BuiltBucket> buildBucket(size_t index) {
        const BucketPlan::Bucket& bucket = plan_.buckets[index];
        BuiltBucket out;
        double last = nowSeconds();
        const auto ends = [&](const char* what) {
            out.seconds[what] += nowSeconds() - std::exchange(last, nowSeconds());
        };
        if (buckets_[index]->points.bytes() != bucket.points * layout_.bytes())
            return fail(ErrorKind::input, "changed while it was read", input_.firstPath(),
                        "build again when it is complete");
        STIPPLE_ASSIGN(SortResult sorted, sortBucket(frame_, layout_, buckets_[index]->points,
                                                     settings_.mergeDuplicates, 2 * memory_.bucketPoints));
        ends("threads: load, sort");
        out.merged = sorted.merged;
        out.tooMany = sorted.tooMany;
        {
            STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, buckets_[index]->ghosts.take());
            const Places ghosts = sortGhosts(frame_, bytes, settings_.mergeDuplicates);
            EstimateSettings wanted;
            wanted.radii = settings_.estimateRadii;
            wanted.normals = settings_.normals == NormalsMode::automatic;
            wanted.isFine = settings_.fineNormals;
            wanted.limitStrays = settings_.estimateRadii && !input_.hasRadius;
            estimate(frame_, *tree_, bucket.firstCell, bucket.cells, wanted, ghosts, sorted.sorted);
        }
        ends("threads: estimate");
        out.ranges = ValueRanges(frame_, input_.points, description_.up);
        uint64_t number = bucket.firstPoint;
        const std::vector<uint64_t>& keys = sorted.sorted.key;
        size_t begin = 0;
        for (const Atom& atom : bucket.atoms) {
            const uint32_t shift = frame_.shiftOf(atom.level);
            size_t end = begin;
            while (end < keys.size() && keys[end] >> shift == atom.key >> shift) ++end;
            out.ranges.add(frame_, sorted.sorted.points, begin, end, number);
            BuiltAtom built;
            built.root = makeSubtree(frame_, sorted.sorted, begin, end, atom.level, built.batch);
            out.atoms.push_back(std::move(built));
            number += atom.count;
            begin = end;
        }
        ends("threads: levels, encode");
        return out;
    }

    Result<void> append(NodeBatch& batch, NodeBatch& all) {
        STIPPLE_ASSIGN(const uint64_t at, writer_->appendEncoded(batch.bytes));
        const auto counts = static_cast<uint32_t>(all.counts.size());
        for (NodeBatch::Written& w : batch.nodes) {
            w.node.chunkOffset += at;
            w.firstCount += counts;
            all.nodes.push_back(w);
        }
        all.counts.insert(all.counts.end(), batch.counts.begin(), batch.counts.end());
        batch = {};
        return {};
    }

    /// In the order of the buckets.
    Result<void> commit(size_t index, BuiltBucket built) {
        const double begun = nowSeconds();
        for (const auto& [what, seconds] : built.seconds) report_.stageSeconds[what] += seconds;
        NodeBatch all, between;
        for (BuiltAtom& atom : built.atoms) {
            upper_->closeBefore(atom.root.key, between);
            STIPPLE_TRY(append(between, all));
            STIPPLE_TRY(append(atom.batch, all));
            upper_->add(std::move(atom.root));
        }
        merged_ += built.merged;
        tooMany_ += built.tooMany;
        ranges_.add(built.ranges);
        if (journal_) {
            ByteWriter to;
            to.put(writer_->bytes());
            to.put(built.merged);
            to.put(built.tooMany);
            to.put(all.nodes);
            to.put(all.counts);
            built.ranges.save(to);
            upper_->saveChanges(to);
            STIPPLE_TRY(journal_->append(to.bytes()));
            buckets_[index]->points.remove();
            buckets_[index]->ghosts.remove();
        }
        batches_.push_back(std::move(all));
        done_ += plan_.buckets[index].points;
        report_.stageSeconds["threads: append"] += nowSeconds() - begun;
        progress_.update("build", done_, input_.points);
        return {};
    }

    Result<void> buildBuckets() {
        for (size_t b = 0; b < firstBucket_; ++b) done_ += plan_.buckets[b].points;
        const Result<void> result = inOrder<BuiltBucket>(
            executor_, workers_, firstBucket_, plan_.buckets.size(),
            [&](size_t index) -> Result<BuiltBucket> {
                STIPPLE_TRY(checkStopped());
                return buildBucket(index);
            },
            [&](size_t index, BuiltBucket built) { return commit(index, std::move(built)); });
        if (!result) return result;
        clock_.ends("build");
        return {};
    }

    // ---- the end ----

    StoreDescription describe() const {
        StoreDescription d;
        d.crs = input_.crs;
        d.metresPerUnit = input_.crs.metresPerUnit;
        d.roundingUnits = rounding_;
        d.hasColour = input_.hasColour;
        d.isReflectance = input_.isReflectance;
        d.hasNormals = input_.hasNormal || settings_.normals == NormalsMode::automatic;
        d.source = input_.source;
        const auto& g = input_.greatest;
        d.boundsMin = input_.origin;
        d.boundsMax = input_.origin + input_.unit * glm::dvec3(g[0], g[1], g[2]);
        d.up = upOf(input_, settings_, d);
        return d;
    }

    Result<void> finish() {
        NodeBatch last, all;
        upper_->finish(last);
        STIPPLE_TRY(append(last, all));
        batches_.push_back(std::move(all));
        Hierarchy hierarchy = assemble(frame_, batches_);
        batches_ = {};
        if (merged_ > 0) report_.dropped["duplicate"] += merged_;
        if (tooMany_ > 0) report_.dropped[fmt::format("beyond {} at one place", kMostAtOnePlace)] += tooMany_;
        description_.points = input_.points - merged_ - tooMany_;
        description_.pointsIn = report_.pointsIn;
        description_.dropped = report_.dropped;
        for (const Node& node : hierarchy.nodes) description_.records += node.records;
        ranges_.describe(frame_, description_);
        STIPPLE_TRY(writer_->finish(hierarchy, description_));
        clock_.ends("write");
        report_.nodes = hierarchy.nodes.size();
        hierarchy = {};  // its memory is needed
        STIPPLE_ASSIGN(const Store store, openStore(writer_->temporaryPath()));
        STIPPLE_TRY(verifyStore(store, executor_, kVerifiedNodes));
        clock_.ends("verify");
        report_.bytesOut = writer_->bytes();
        STIPPLE_TRY(writer_->commit());
        if (journal_) journal_->remove();
        report_.pointsOut = description_.points;
        report_.records = description_.records;
        report_.contentHash = writer_->contentHash();
        return {};
    }

    const std::string output_;
    const BuildSettings& settings_;
    Executor& executor_;
    Progress& progress_;
    PointInput input_;
    BuildReport report_;
    StageClock clock_;  ///< what is not "threads: ..." adds up to the whole
    int workers_;
    const RecordLayout layout_;
    MemoryPlan memory_;
    std::optional<Journal> journal_;
    std::string bucketFolder_;  ///< empty: in memory
    Frame frame_;
    double rounding_ = 0;
    uint64_t inputIdentity_ = 0;
    std::optional<CellTree> tree_;
    BucketPlan plan_;
    Buckets buckets_;
    StoreDescription description_;
    ValueRanges ranges_;
    std::optional<UpperTree> upper_;
    std::optional<StoreWriter> writer_;
    std::vector<NodeBatch> batches_;  ///< of each bucket; bytes are written
    size_t firstBucket_ = 0;          ///< those before are done
    uint64_t done_ = 0, merged_ = 0, tooMany_ = 0;
};

}  // namespace

Result<BuildReport> buildStore(const std::vector<std::string>& inputs, const std::string& output,
                               const BuildSettings& settings, Executor& executor, Progress& progress) {
    BuildReport report;
    const auto tryOutput = [&]() -> Result<void> {  // an unwritable output is found first
        if (settings.ranks != nullptr && settings.ranks->rank() > 0) return {};
        STIPPLE_ASSIGN(const StoreWriter writer, StoreWriter::create(output));
        return {};
    };
    STIPPLE_TRY(agree(settings.ranks, tryOutput()));
    Result<PointInput> opened = PointInput::open(inputs, settings, report);
    STIPPLE_TRY(agree(settings.ranks, opened ? Result<void>() : Result<void>(tl::unexpected(opened.error()))));
    PointInput input = std::move(*opened);
    return PointBuild(output, settings, executor, progress, std::move(input), std::move(report)).run();
}

}  // namespace stipple::lod
