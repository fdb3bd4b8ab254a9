// The course of a build of any kind, as a straight line: open the sources, share out the memory, open the workspace
// (and find what an earlier run left there), distribute, build, put the tables together; then, alike for all kinds,
// finish the file, verify it, put it in its place. Each stage takes what the one before returned, so that none can be
// called out of turn. Ranks go through it together.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lod/builder/octree/workspace.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// What the stages of one build share.
struct Course {
    Course(std::string output_, const BuildLimits& limits_, Executor& executor_, Progress& progress_);
    Course(const Course&) = delete;
    Course& operator=(const Course&) = delete;

    const std::string output;
    const BuildLimits& limits;
    Executor& executor;
    Progress& progress;
    BuildReport report;
    StageClock clock;  ///< what is not "threads: ..." adds up to the whole
    int workers;       ///< threads that work, as far as the memory goes
};

/// The memory is shared out.
struct Planned {
    bool isOnDisk = false;  ///< what lies between the stages does not fit
};
/// Everything is where it is worked on.
struct Distributed {
    std::vector<Journal::Entry> done;  ///< steps of the work that an earlier run finished
};
/// All chunks are in the file.
struct Built {
    StoreWriter* writer = nullptr;  ///< the first rank's; else null
};
/// What the file says of itself.
struct Described {
    Hierarchy hierarchy;
    StoreDescription description;
};

/// A kind of content, its sources open.
class BuildStages {
  public:
    virtual ~BuildStages() = default;
    /// Error: it needs more than it may use.
    virtual Result<Planned> planMemory() = 0;
    /// Of input and settings: an interrupted build of another one is not gone on with.
    virtual uint64_t identity() const = 0;
    /// Goes on after `left`. All ranks together.
    virtual Result<Distributed> distribute(Workspace& workspace, const Planned& planned,
                                           std::vector<Journal::Entry> left) = 0;
    virtual Result<Built> build(Workspace& workspace, Distributed distributed) = 0;
    /// Writes what the file needs beside chunks; on the first rank.
    virtual Result<Described> describe(const Built& built) = 0;
    /// How many nodes are looked at again at the end; `info --verify` looks at all.
    virtual uint64_t verifiedNodes() const = 0;
    /// Are all its records points of an octree, so that they can have weights?
    virtual bool areSurfels() const { return false; }
};

/// Shares of the stages in the time, for the progress.
using StageShares = std::vector<JobPlan::Stage>;

/// Writes `output` (whole or not at all). `open`: opens the sources.
Result<BuildReport> runCourse(const std::string& output, const BuildLimits& limits, Executor& executor,
                              Progress& progress, const StageShares& shares,
                              const std::function<Result<std::unique_ptr<BuildStages>>(Course& course)>& open);

}  // namespace stipple::lod
