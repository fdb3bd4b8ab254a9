// The stages of a build of points (octree/course.h): survey, count, distribute, then bucket by bucket estimate, build,
// write.
#include "lod/builder/build.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "engine/base/ordered.h"
#include "engine/base/queue.h"
#include "lod/builder/build_version.h"
#include "lod/builder/octree/assemble.h"
#include "lod/builder/octree/course.h"
#include "lod/builder/points/describe_input.h"
#include "lod/builder/points/distribution.h"
#include "lod/builder/points/estimate.h"
#include "lod/builder/points/exchange.h"
#include "lod/store/materials.h"
#include "lod/store/store.h"

namespace stipple::lod {
namespace {

class PointStages final : public BuildStages {
  public:
    PointStages(Course& course, const BuildSettings& settings, PointInput input)
        : course_(course),
          settings_(settings),
          input_(std::move(input)),
          layout_(input_.hasColour, input_.hasNormal, input_.hasRadius, input_.attributes()) {}

    Result<Planned> planMemory() override;
    uint64_t identity() const override;
    Result<Distributed> distribute(Workspace& workspace, const Planned& planned,
                                   std::vector<Journal::Entry> left) override {
        workspace_ = &workspace;
        // Enough buckets for all, and the same ones whatever each machine has.
        spread_.emplace(input_, settings_, layout_,
                        Distribution::Plan{course_.workers, bufferBytes_, leastOf(bucketPoints_), wantsEstimates(),
                                           !planned.isOnDisk},
                        workspace, course_.executor, course_.progress);
        STIPPLE_TRY(agree(settings_.ranks, spread_->run(left, course_.report, course_.clock)));
        std::erase_if(left, [](const Journal::Entry& e) { return e.what != Journal::What::done; });
        return Distributed{std::move(left)};
    }
    Result<Built> build(Workspace&, Distributed distributed) override {
        description_ = describePoints();
        ranges_ = ValueRanges(frame(), input_.points, description_.up);
        upper_.emplace(frame());
        STIPPLE_TRY(settings_.ranks != nullptr ? buildTogether() : buildAlone(std::move(distributed.done)));
        return Built{writer_ ? &*writer_ : nullptr};
    }
    Result<Described> describe(const Built&) override;
    uint64_t verifiedNodes() const override { return 512; }
    bool areSurfels() const override { return true; }

  private:
    Result<void> buildAlone(std::vector<Journal::Entry> entries) {
        STIPPLE_TRY(openWriter(entries));
        entries = {};
        const size_t first = batches_.size();
        for (size_t b = 0; b < first; ++b) done_ += plan().buckets[b].points;
        Result<void> built = inOrder<BuiltBucket>(
            course_.executor, course_.workers, first, plan().buckets.size(),
            [&](size_t index) -> Result<BuiltBucket> {
                STIPPLE_TRY(workspace_->checkStopped());
                return buildBucket(index);
            },
            [&](size_t index, BuiltBucket bucket) {
                course_.progress.update("build", done_ += plan().buckets[index].points, input_.points);
                return commit(index, std::move(bucket));
            });
        if (built) course_.clock.ends("build");
        return built;
    }

    /// With others: each builds its share of the buckets, the first one puts them together. What was built stays until
    /// the end, and an interrupted build goes on after that.
    Result<void> buildTogether() {
        Ranks& ranks = *settings_.ranks;
        std::vector<size_t> own;
        for (size_t b = 0; b < plan().buckets.size(); ++b)
            if (workspace_->isOwn(b) && !isBuilt(workspace_->folder(), b)) own.push_back(b);
        const Result<void> made = inOrder<BuiltBucket>(
            course_.executor, course_.workers, 0, own.size(),
            [&](size_t k) -> Result<BuiltBucket> {
                STIPPLE_TRY(workspace_->checkStopped());
                return buildBucket(own[k]);
            },
            [&](size_t k, const BuiltBucket& built) -> Result<void> {
                course_.progress.update("build", done_ += plan().buckets[own[k]].points, input_.points);
                STIPPLE_TRY(saveBuilt(workspace_->folder(), own[k], built));
                removeBucket(own[k]);
                return {};
            });
        STIPPLE_TRY(agree(&ranks, made));
        course_.clock.ends("build");
        return agree(&ranks, workspace_->isFirst() ? putTogether() : Result<void>());
    }
    Result<void> putTogether() {
        STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(course_.output));
        writer_.emplace(std::move(writer));
        const ValueRanges empty = ranges_;
        for (size_t b = 0; b < plan().buckets.size(); ++b) {
            STIPPLE_TRY(workspace_->checkStopped());
            STIPPLE_ASSIGN(BuiltBucket built, loadBuilt(workspace_->folder(), b, empty));
            STIPPLE_TRY(commit(b, std::move(built)));
        }
        course_.clock.ends("put together");
        return {};
    }
    void removeBucket(size_t index) {
        spread_->buckets()[index]->points.remove();
        spread_->buckets()[index]->ghosts.remove();
    }

    uint64_t pointBytes() const {  // that a worker needs for each point of its bucket
        uint64_t bytes = 128;
        for (const AttributeInfo& a : input_.attributes()) bytes += 4 * bytesOf(a.type);
        return bytes;
    }

    bool wantsEstimates() const { return settings_.estimateRadii || settings_.normals == NormalsMode::automatic; }
    uint64_t leastOf(uint64_t value) const {
        if (settings_.ranks == nullptr) return value;
        ByteWriter to;
        to.put(value);
        for (const std::vector<uint8_t>& bytes : settings_.ranks->gather(to.bytes())) {
            uint64_t theirs = value;
            ByteReader(bytes).get(theirs);
            value = std::min(value, theirs);
        }
        return value;
    }
    const Frame& frame() const { return spread_->frame(); }
    const BucketPlan& plan() const { return spread_->plan(); }

    // ---- buckets ----

    Result<void> openWriter(const std::vector<Journal::Entry>& entries) {
        if (!workspace_->isOnDisk()) {
            STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(course_.output));
            writer_.emplace(std::move(writer));
            return {};
        }
        uint64_t written = 0;
        for (const Journal::Entry& entry : entries) {
            ByteReader from(entry.payload);
            NodeBatch batch;
            uint64_t merged = 0, tooMany = 0;
            from.get(written);
            from.get(merged);
            from.get(tooMany);
            from.get(batch.nodes);
            from.get(batch.counts);
            ValueRanges ranges(frame(), input_.points, description_.up);
            ranges.load(from);
            upper_->loadChanges(from);
            if (!from.isWhole()) return tl::unexpected(workspace_->damaged());
            merged_ += merged;
            tooMany_ += tooMany;
            ranges_.add(ranges);
            batches_.push_back(std::move(batch));
        }
        if (!entries.empty())
            course_.progress.say(fmt::format("going on with the interrupted build: {} of {} buckets are done",
                                             entries.size(), plan().buckets.size()));
        STIPPLE_TRY(checkWritten());
        STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::resume(course_.output, workspace_->partialPath(), written));
        writer_.emplace(std::move(writer));
        return {};
    }

    /// Are the chunks that an earlier run wrote still what they were?
    Result<void> checkWritten() {
        if (batches_.empty()) return {};
        STIPPLE_ASSIGN(const InputFile file, InputFile::open(workspace_->partialPath()));
        CompletionQueue<Error> errors;
        course_.executor.parallelFor(batches_.size(), 1, [&](size_t begin, size_t end) {
            std::vector<uint8_t> bytes;
            for (size_t b = begin; b < end; ++b)
                for (const NodeBatch::Written& w : batches_[b].nodes) {
                    bytes.resize(size_t{w.node.chunkBytes} + w.node.attributeBytes);
                    const auto read = file.readAt(w.node.chunkOffset, bytes.data(), bytes.size());
                    const bool isSame =
                        read && hashBytes(bytes.data(), w.node.chunkBytes) == w.node.chunkHash &&
                        hashBytes(bytes.data() + w.node.chunkBytes, w.node.attributeBytes) == w.node.attributeHash;
                    if (isSame) continue;
                    errors.push({ErrorKind::input, "is not what was written", workspace_->partialPath(),
                                 "begin anew with --restart"});
                    return;
                }
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
        return {};
    }

    /// Threads that find no bucket left help with those that others work on, unless the memory allows only some of
    /// them.
    Executor& withinBucket() { return course_.workers < course_.executor.threads() ? *serial_ : course_.executor; }
    Result<BuiltBucket> buildBucket(size_t index) {
        const BucketPlan::Bucket& bucket = plan().buckets[index];
        BuiltBucket out;
        double last = nowSeconds();
        const auto ends = [&](const char* what) {
            out.seconds[what] += nowSeconds() - std::exchange(last, nowSeconds());
        };
        if (spread_->buckets()[index]->points.bytes() != bucket.points * layout_.bytes())
            return fail(ErrorKind::input, "changed while it was read", input_.firstPath(),
                        "build again when it is complete");
        STIPPLE_ASSIGN(SortResult sorted, sortBucket(frame(), layout_, spread_->buckets()[index]->points,
                                                     settings_.mergeDuplicates, 2 * spread_->bucketPoints()));
        ends("threads: load, sort");
        out.merged = sorted.merged;
        out.tooMany = sorted.tooMany;
        {
            STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, spread_->buckets()[index]->ghosts.take());
            const Places ghosts = sortGhosts(frame(), layout_, bytes, settings_.mergeDuplicates);
            EstimateSettings wanted;
            wanted.radii = settings_.estimateRadii;
            wanted.normals = settings_.normals == NormalsMode::automatic;
            wanted.isFine = settings_.fineNormals;
            wanted.limitStrays = settings_.estimateRadii && !input_.hasRadius;
            estimate(frame(), spread_->tree(), bucket.firstCell, bucket.cells, wanted, ghosts, withinBucket(),
                     sorted.sorted);
        }
        ends("threads: estimate");
        out.ranges = ValueRanges(frame(), input_.points, description_.up);
        uint64_t number = bucket.firstPoint;
        const std::vector<Key>& keys = sorted.sorted.key;
        std::vector<size_t> begins{0};
        for (const Subtree& subtree : bucket.subtrees) {
            const uint32_t shift = frame().shiftOf(subtree.level);
            size_t end = begins.back();
            while (end < keys.size() && keys[end] >> shift == subtree.key >> shift) ++end;
            out.ranges.add(frame(), sorted.sorted.points, begins.back(), end, number);
            number += subtree.count;
            begins.push_back(end);
        }
        out.subtrees.resize(bucket.subtrees.size());
        withinBucket().parallelFor(out.subtrees.size(), 1, [&](size_t from, size_t to) {
            for (size_t k = from; k < to; ++k) {
                BuiltSubtree& built = out.subtrees[k];
                built.root = makeSubtree(frame(), sorted.sorted, begins[k], begins[k + 1], bucket.subtrees[k].level,
                                         built.batch);
            }
        });
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
        for (const auto& [what, seconds] : built.seconds) course_.report.stageSeconds[what] += seconds;
        NodeBatch all, between;
        for (BuiltSubtree& subtree : built.subtrees) {
            upper_->closeBefore(subtree.root.key, between);
            STIPPLE_TRY(append(between, all));
            STIPPLE_TRY(append(subtree.batch, all));
            upper_->add(std::move(subtree.root));
        }
        merged_ += built.merged;
        tooMany_ += built.tooMany;
        ranges_.add(built.ranges);
        if (workspace_->isOnDisk() && settings_.ranks == nullptr) {
            ByteWriter to;
            to.put(writer_->bytes());
            to.put(built.merged);
            to.put(built.tooMany);
            to.put(all.nodes);
            to.put(all.counts);
            built.ranges.save(to);
            upper_->saveChanges(to);
            STIPPLE_TRY(workspace_->note(Journal::What::done, to.bytes()));
            removeBucket(index);
        }
        batches_.push_back(std::move(all));
        course_.report.stageSeconds["threads: append"] += nowSeconds() - begun;
        return {};
    }

    // ---- the end ----

    StoreDescription describePoints() const {
        StoreDescription d = describeInput(input_, settings_);
        d.roundingUnits = spread_->rounding();
        d.hasNormals = input_.hasNormal || settings_.normals == NormalsMode::automatic;
        return d;
    }

    Course& course_;
    const BuildSettings& settings_;
    PointInput input_;
    RecordLayout layout_;
    uint64_t bucketPoints_ = 0, bufferBytes_ = 0;  ///< as the memory allows
    const std::unique_ptr<Executor> serial_ = makeSerialExecutor();
    Workspace* workspace_ = nullptr;
    std::optional<Distribution> spread_;
    StoreDescription description_;
    ValueRanges ranges_;
    std::optional<UpperTree> upper_;
    std::optional<StoreWriter> writer_;
    std::vector<NodeBatch> batches_;  ///< of each bucket; bytes are written
    uint64_t done_ = 0, merged_ = 0, tooMany_ = 0;
};

Result<Planned> PointStages::planMemory() {
    constexpr uint64_t kFixed = uint64_t{72} << 20, kReader = uint64_t{12} << 20;
    const auto fixedFor = [&](uint64_t threads) { return kFixed + threads * kReader; };
    const auto leastFor = [&](uint64_t threads) {
        return fixedFor(threads) + (threads + 1) * kSubtreePoints * pointBytes() + input_.declared() / 2;
    };
    // Fewer threads rather than more memory.
    while (course_.workers > 1 && leastFor(static_cast<uint64_t>(course_.workers)) > settings_.memoryBytes)
        --course_.workers;
    const auto workers = static_cast<uint64_t>(course_.workers);
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
    // (Half of the memory at most: what neighbours see, buffers and the allocator's own losses come on top. What the
    // survey keeps, 18 bytes a point with a colour, lies in this room as well, and goes as the buckets fill.)
    const bool isOnDisk = 2 * all + (workers + 1) * kSubtreePoints * pointBytes() > room && small > room + fixed;
    bufferBytes_ = std::min<uint64_t>(room / 8, uint64_t{64} << 20);
    bucketPoints_ = bucketOf(isOnDisk ? room / 2 : room / 4);
    // Enough of them for all threads, but none smaller than a subtree; where nothing is estimated, and no bucket has to
    // see what lies in others, more, which takes less memory. In memory so many that what is sorted at once stays in a
    // cache, up to where what is on its way to them takes much memory itself.
    constexpr uint64_t kMostBuckets = 1024;
    const uint64_t ranks = settings_.ranks == nullptr ? 1 : static_cast<uint64_t>(settings_.ranks->count());
    uint64_t buckets = (wantsEstimates() ? 6u : 32u) * workers * ranks;
    if (!wantsEstimates() && !isOnDisk && settings_.ranks == nullptr) buckets = std::max(buckets, kMostBuckets);
    bucketPoints_ = std::max<uint64_t>(std::min<uint64_t>(bucketPoints_, n / buckets), kSubtreePoints);
    return Planned{isOnDisk || settings_.ranks != nullptr};
}

uint64_t PointStages::identity() const {
    std::string text =
        fmt::format("{}|{}|{}|{}|{}|{}|{}|{}|{}|{}|{}", kStoreVersion, kBuildVersion, input_.identity(),
                    static_cast<int>(settings_.normals), settings_.estimateRadii,
                    settings_.up ? static_cast<int>(*settings_.up) : -1, settings_.leafRecords, settings_.skipBad,
                    settings_.fineNormals, settings_.mergeDuplicates, settings_.dropOutliers);
    for (const AttributeInfo& a : input_.attributes()) text.append("|").append(a.name);
    for (const PointMaterial& m : input_.materials) text.append("|").append(identityOf(m));
    text.append("|").append(std::filesystem::absolute(course_.output).lexically_normal().string());
    return hashBytes(text.data(), text.size());
}
Result<Described> PointStages::describe(const Built&) {
    NodeBatch last, all;
    upper_->finish(last);
    STIPPLE_TRY(append(last, all));
    batches_.push_back(std::move(all));
    Described out{assemble(frame(), batches_), std::move(description_)};
    batches_ = {};
    BuildReport& report = course_.report;
    if (merged_ > 0) report.dropped["duplicate"] += merged_;
    if (tooMany_ > 0) report.dropped[fmt::format("beyond {} at one place", kMostAtOnePlace)] += tooMany_;
    out.description.points = report.pointsOut = input_.points - merged_ - tooMany_;
    out.description.pointsIn = report.pointsIn;
    out.description.dropped = report.dropped;
    ranges_.describe(frame(), input_.withoutOutliers(), out.description);
    if (const auto index = materialAttribute(out.description))  // those beyond the last that is used
        out.description.pointMaterials.resize(std::min(
            out.description.pointMaterials.size(), toWhole<size_t>(out.description.attributes[*index].greatest) + 1));
    return out;
}

}  // namespace

Result<BuildReport> buildStore(const std::vector<std::string>& inputs, const std::string& output,
                               const BuildSettings& settings, Executor& executor, Progress& progress) {
    // (Shares as measured with 2M points, normals and radii estimated.)
    StageShares shares{{"survey", 2}, {"count", 3}, {"distribute", 16}, {"build", 70}, {"verify", 9}};
    if (settings.surfelWeights) shares.push_back({"weights of surfels", 80});
    return runCourse(output, settings, executor, progress, shares,
                     [&](Course& course) -> Result<std::unique_ptr<BuildStages>> {
                         STIPPLE_ASSIGN(PointInput input, PointInput::open(inputs, settings, course.report));
                         return std::make_unique<PointStages>(course, settings, std::move(input));
                     });
}

}  // namespace stipple::lod
