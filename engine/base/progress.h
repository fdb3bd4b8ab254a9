// Progress of a long job: a line that rewrites itself on a terminal, one JSON line a second when piped.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>

namespace stipple {

class Progress {
  public:
    /// `enabled` false: says nothing (library use, tests).
    /// `json`: JSON lines on a terminal too.
    explicit Progress(bool enabled, bool json = false);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    /// Says that `done` of `total` units of `stage` are finished; prints at most ten times (JSON: once) a second.
    /// From any thread.
    void update(const std::string& stage, uint64_t done, uint64_t total);

    /// A line that stays (a JSON object where the progress is one).
    void say(const std::string& line);
    /// Bytes of temporary files, to be shown with the rest.
    void setTemporaryBytes(uint64_t bytes) { temporaryBytes_ = bytes; }

  private:
    std::mutex mutex_;
    std::atomic<uint64_t> temporaryBytes_{0};
    bool enabled_, terminal_, dirty_ = false;
    double startSeconds_, stageSeconds_ = 0, lastPrintSeconds_ = 0;
    std::string stage_;
};

}  // namespace stipple
