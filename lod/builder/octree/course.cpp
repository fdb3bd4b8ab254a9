#include "lod/builder/octree/course.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "lod/builder/weights/add.h"

namespace stipple::lod {
namespace {

/// An output that cannot be written is found before any work.
Result<void> tryOutput(const Course& course) {
    if (course.limits.ranks != nullptr && course.limits.ranks->rank() > 0) return {};
    STIPPLE_ASSIGN(const StoreWriter writer, StoreWriter::create(course.output));
    return {};
}

template <typename T>
Result<void> verdict(const Result<T>& result) {
    return result ? Result<void>() : Result<void>(tl::unexpected(result.error()));
}

/// Found before any work, and before anything is written.
Result<void> checkWeights(const Course& course, const BuildStages& stages) {
    if (!course.limits.surfelWeights || stages.areSurfels()) return {};
    return fail(ErrorKind::usage, "gets no weights of surfels: what is built has no points alone", course.output,
                "leave out --surfel-weights");
}

/// With weights the store is written once more, to its place; without them the file that was verified goes there. So
/// a store that lacks its weights stands nowhere, and an interrupted build goes on from its journal.
Result<void> putInPlace(Course& course, StoreWriter& writer) {
    BuildReport& report = course.report;
    report.bytesOut = writer.bytes();
    report.contentHash = writer.contentHash();
    if (!course.limits.surfelWeights) return writer.commit();
    STIPPLE_ASSIGN(const WeightReport added, addSurfelWeights(writer.temporaryPath(), course.executor, course.progress,
                                                              course.output, course.limits.isStopped));
    std::error_code error;
    std::filesystem::remove(writer.temporaryPath(), error);
    report.bytesOut = added.fileBytes;
    report.contentHash = added.contentHash;
    course.clock.ends("weights of surfels");
    return {};
}

/// On the first rank alone.
Result<void> finish(Course& course, BuildStages& stages, Workspace& workspace, const Built& built) {
    BuildReport& report = course.report;
    StoreWriter& writer = *built.writer;
    STIPPLE_ASSIGN(Described described, stages.describe(built));
    course.clock.ends("tables");
    report.nodes = described.hierarchy.nodes.size();
    for (const Node& node : described.hierarchy.nodes) described.description.records += node.records;
    report.records = described.description.records;
    STIPPLE_TRY(writer.finish(described.hierarchy, described.description));
    course.clock.ends("finish");
    described = {};  // its memory is needed
    course.progress.update("verify", 0, 1);
    STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
    STIPPLE_TRY(
        verifyStore(store, course.executor, report.nodes > stages.verifiedNodes() ? stages.verifiedNodes() : 0));
    course.clock.ends("verify");
    STIPPLE_TRY(putInPlace(course, writer));
    workspace.remove();
    return {};
}

}  // namespace

Course::Course(std::string output_, const BuildLimits& limits_, Executor& executor_, Progress& progress_)
    : output(std::move(output_)),
      limits(limits_),
      executor(executor_),
      progress(progress_),
      clock(report),
      workers(std::max(executor_.threads(), 1)) {}

Result<BuildReport> runCourse(const std::string& output, const BuildLimits& limits, Executor& executor,
                              Progress& progress, const StageShares& shares,
                              const std::function<Result<std::unique_ptr<BuildStages>>(Course& course)>& open) {
    Course course(output, limits, executor, progress);
    std::optional<Workspace> workspace;  // ends after the stages, which lie in it
    STIPPLE_TRY(agree(limits.ranks, tryOutput(course)));
    progress.plan(shares);
    auto opened = open(course);
    STIPPLE_TRY(agree(limits.ranks, verdict(opened)));
    BuildStages& stages = **opened;
    STIPPLE_TRY(agree(limits.ranks, checkWeights(course, stages)));
    const Result<Planned> planned = stages.planMemory();
    STIPPLE_TRY(agree(limits.ranks, verdict(planned)));
    STIPPLE_ASSIGN(Workspace found, Workspace::open(output, limits, stages.identity(), planned->isOnDisk));
    workspace.emplace(std::move(found));
    std::vector<Journal::Entry> left = workspace->takeEntries();
    course.report.isResumed = !left.empty();
    STIPPLE_ASSIGN(Distributed distributed, stages.distribute(*workspace, *planned, std::move(left)));
    STIPPLE_ASSIGN(const Built built, stages.build(*workspace, std::move(distributed)));
    STIPPLE_TRY(agree(limits.ranks, workspace->isFirst() ? finish(course, stages, *workspace, built) : Result<void>()));
    course.report.seconds = course.clock.seconds();
    return std::move(course.report);
}

}  // namespace stipple::lod
