// Survey, count, distribute: where the points of a build lie, and each in the bucket that is built with it.
#pragma once

#include <optional>

#include "engine/base/huge_region.h"
#include "lod/builder/octree/workspace.h"
#include "lod/builder/points/bucket.h"
#include "lod/builder/points/input.h"

namespace stipple::lod {

class Distribution {
  public:
    struct Plan {
        int workers = 1;
        uint64_t bufferBytes = 0, bucketPoints = 0;
        bool wantGhosts = false;   ///< neighbours are looked at
        bool keepsPoints = false;  ///< of the survey (PointInput::survey), in what is planned for the buckets
    };
    /// `layout`: is told how places are held, once the input was surveyed.
    Distribution(PointInput& input, const BuildSettings& settings, RecordLayout& layout, const Plan& plan,
                 Workspace& workspace, Executor& executor, Progress& progress)
        : input_(input),
          settings_(settings),
          layout_(layout),
          wanted_(plan),
          workspace_(workspace),
          executor_(executor),
          progress_(progress) {}

    /// Goes on after what `entries` say; the steps of the work are none of its business. All ranks together.
    Result<void> run(const std::vector<Journal::Entry>& entries, BuildReport& report, StageClock& clock);

    // After that:
    const Frame& frame() const { return frame_; }
    const CellTree& tree() const { return *tree_; }
    const BucketPlan& plan() const { return plan_; }
    /// Of more points there are none in a bucket, but for one that cannot be divided.
    uint64_t bucketPoints() const { return wanted_.bucketPoints; }
    /// Those of this rank are whole.
    Buckets& buckets() { return buckets_; }
    double rounding() const { return rounding_; }  ///< largest of a coordinate, world units

  private:
    Result<void> count(BuildReport& report, StageClock& clock);
    void setFrame();
    void makeBuckets();
    Result<void> announce() const;
    Result<void> named(Result<void> result) const;
    Result<void> send();
    Result<void> note(Journal::What what, size_t nextPart);
    Result<void> collect();
    Result<void> sealBuckets();
    void saveBuckets(ByteWriter& to, bool isOwnOnly) const;
    bool loadBuckets(const std::vector<uint8_t>& saved, size_t& nextPart);
    std::string folderOf(int rank, size_t bucket) const;
    uint64_t temporaryBytes() const;

    PointInput& input_;
    const BuildSettings& settings_;
    RecordLayout& layout_;
    Plan wanted_;
    Workspace& workspace_;
    Executor& executor_;
    Progress& progress_;
    Frame frame_;
    double rounding_ = 0;
    std::optional<CellTree> tree_;
    BucketPlan plan_;
    std::optional<HugeRegion> region_;  ///< where the buckets' points lie, in memory
    Buckets buckets_;
    size_t nextPart_ = 0;  ///< of the input: those before are sent
};

}  // namespace stipple::lod
