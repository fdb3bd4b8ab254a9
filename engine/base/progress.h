// Progress of a long job: one bar for the whole of it on a terminal, one JSON line a second for programs, notes only
// where neither is asked for.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace stipple {

enum class ProgressStyle : uint8_t {
    silent,  ///< nothing (library use, tests, --quiet)
    notes,   ///< no progress, but notes as lines
    bar,     ///< a line that rewrites itself, and notes
    json     ///< one JSON line a second, and notes as JSON
};
/// The bar on a terminal, otherwise notes only.
ProgressStyle automaticProgress();

/// The stages of a job and what share of its time each takes, as measured on other jobs of its kind.
class JobPlan {
  public:
    struct Stage {
        std::string name;
        double share = 1;
    };
    JobPlan() = default;
    explicit JobPlan(std::vector<Stage> stages) : stages_(std::move(stages)) {}
    /// Of the whole job, when `done` of one of its stages is finished: never less than before, whatever is said. A
    /// stage that is not in the plan adds nothing; without a plan, a stage is the job.
    double advance(const std::string& stage, double done);
    /// Other stages, of the same job or of its next part.
    void setStages(std::vector<Stage> stages);
    /// What follows is only a part of the job: `own` of it, with `before` behind and `after` ahead. `advance` stays
    /// that of the whole.
    void beginPart(double before, double own, double after);

  private:
    std::vector<Stage> stages_;
    double reached_ = 0;  ///< of the part
    double from_ = 0, share_ = 1, whole_ = 0;
};

/// How far a job is.
struct ProgressReport {
    std::string stage;
    double fraction = 0;      ///< of the whole job, 0 to 1; never falls
    double secondsLeft = -1;  ///< estimated; -1: not known yet
};
/// Called at most ten times a second, by the thread that got so far, one at a time.
using ProgressCall = std::function<void(const ProgressReport&)>;

class Progress {
  public:
    /// `enabled` false: says nothing.
    explicit Progress(bool enabled) : Progress(enabled ? automaticProgress() : ProgressStyle::silent) {}
    explicit Progress(ProgressStyle style, ProgressCall call = {});
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// What is going to be done; from here on there is one time left, that of all stages.
    void plan(std::vector<JobPlan::Stage> stages);
    /// Says that `done` of `total` units of `stage` are finished; prints at most ten times (JSON: once) a second.
    /// From any thread.
    void update(const std::string& stage, uint64_t done, uint64_t total);

    /// One of several jobs that are one to who waits, see JobPlan: one bar and one time left for all.
    void beginPart(double before, double own, double after);
    /// Takes the bar away until the next update, so that others can write lines.
    void rest();

    /// A note that stays.
    void say(const std::string& line);
    /// Bytes of temporary files, to be shown with the rest.
    void setTemporaryBytes(uint64_t bytes) { temporaryBytes_ = bytes; }

  private:
    void printBar(double fraction, double rate, double left);
    void printJson(uint64_t done, uint64_t total, double fraction, double rate, double left) const;

    std::mutex mutex_;
    std::atomic<uint64_t> temporaryBytes_{0};
    ProgressStyle style_;
    const ProgressCall call_;
    bool dirty_ = false;
    JobPlan plan_;
    double startSeconds_, stageSeconds_ = 0, lastPrintSeconds_ = 0;
    double firstFraction_ = -1;  ///< of the job, when it began or went on
    std::string stage_;
};

}  // namespace stipple
