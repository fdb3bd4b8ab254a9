// The program as a person runs it: in a folder, with a cache of its own.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/support/support.h"

namespace stipple::test {

struct Outcome {
    int code = -1;  ///< 128 + N: ended by signal N
    std::string out, err;
};

/// `program ARGUMENTS` in that folder, by a shell; `before`: what stands before it on the line.
Outcome runProgram(const TempFolder& folder, const std::string& arguments, const std::string& before = "");

/// One line, with the program's name, that mentions all of `texts`.
void expectOneLine(const Outcome& outcome, int code, const std::vector<std::string>& texts);

/// The program while it runs.
class RunningProgram {
  public:
    RunningProgram(const TempFolder& folder, const std::vector<std::string>& arguments);
    ~RunningProgram();
    RunningProgram(const RunningProgram&) = delete;
    RunningProgram& operator=(const RunningProgram&) = delete;
    /// Until `condition` holds, the program has ended, or two minutes are over; true if it holds.
    bool await(const std::function<bool()>& condition);
    /// Seconds of processor time that it took so far.
    double processorSeconds() const;
    /// What it does at that signal is its own: the signal no longer ends it.
    bool catches(int signal) const;
    void signal(int number);
    /// Waits for its end, and kills it where that takes more than two minutes.
    Outcome end();

  private:
    bool hasEnded();
    pid_t child_ = -1;
    int status_ = 0;
    bool ended_ = false;
    std::string out_, err_;
};

}  // namespace stipple::test
