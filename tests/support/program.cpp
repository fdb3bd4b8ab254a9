#include "tests/support/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "tests/support/runs.h"

namespace stipple::test {
namespace {

constexpr std::chrono::duration<double> kPatience{120 * kSlower};

int codeOf(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

}  // namespace

Outcome runProgram(const TempFolder& folder, const std::string& arguments, const std::string& before) {
    const std::string errPath = folder / ".stderr";
    const std::string command = "cd " + folder.path() + " && " + before + " XDG_CACHE_HOME=" + folder.path() +
                                "/.cache " + STIPPLE_PROGRAM + " " + arguments + " 2>" + errPath;
    Outcome r;
    FILE* pipe = ::popen(command.c_str(), "r");
    std::array<char, 4096> buffer{};
    while (const size_t got = std::fread(buffer.data(), 1, buffer.size(), pipe)) r.out.append(buffer.data(), got);
    r.code = codeOf(::pclose(pipe));
    r.err = slurp(errPath);
    return r;
}

void expectOneLine(const Outcome& r, int code, const std::vector<std::string>& texts) {
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_EQ(r.err.rfind("stipple: ", 0), 0u) << r.err;
    for (const std::string& text : texts) EXPECT_NE(r.err.find(text), std::string::npos) << text << " in " << r.err;
}

RunningProgram::RunningProgram(const TempFolder& folder, const std::vector<std::string>& arguments)
    : out_(folder / ".stdout"), err_(folder / ".stderr") {
    const std::string cache = folder / ".cache";
    child_ = ::fork();
    if (child_ != 0) return;
    std::vector<char*> argv{const_cast<char*>(STIPPLE_PROGRAM)};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    ::setenv("XDG_CACHE_HOME", cache.c_str(), 1);
    const int out = ::open(out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const int err = ::open(err_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(out, 1);
    ::dup2(err, 2);
    if (::chdir(folder.path().c_str()) == 0) ::execv(argv[0], argv.data());
    ::_exit(127);
}

RunningProgram::~RunningProgram() {
    if (hasEnded()) return;
    ::kill(child_, SIGKILL);
    ::waitpid(child_, &status_, 0);
}

bool RunningProgram::hasEnded() {
    if (!ended_) ended_ = ::waitpid(child_, &status_, WNOHANG) == child_;
    return ended_;
}

bool RunningProgram::await(const std::function<bool()>& condition) {
    const auto start = std::chrono::steady_clock::now();
    while (!condition()) {
        if (hasEnded() || std::chrono::steady_clock::now() - start > kPatience) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

double RunningProgram::processorSeconds() const {
    // Fields 14 and 15 of /proc/PID/stat, counted from behind the name, which may hold anything.
    const std::string text = slurp("/proc/" + std::to_string(child_) + "/stat");
    const size_t close = text.rfind(')');
    if (close == std::string::npos) return 0;
    std::istringstream rest(text.substr(close + 2));
    std::string field;
    for (int i = 3; i < 14; ++i) rest >> field;
    double user = 0, system = 0;
    rest >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

bool RunningProgram::catches(int signal) const {
    std::istringstream status(slurp("/proc/" + std::to_string(child_) + "/status"));
    for (std::string line; std::getline(status, line);)
        if (line.rfind("SigCgt:", 0) == 0) return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1) != 0;
    return false;
}

void RunningProgram::signal(int number) {
    if (!hasEnded()) ::kill(child_, number);
}

Outcome RunningProgram::end() {
    await([] { return false; });
    if (!hasEnded()) {
        ADD_FAILURE() << "it does not end";
        ::kill(child_, SIGKILL);
        ::waitpid(child_, &status_, 0);
        ended_ = true;
    }
    return {codeOf(status_), slurp(out_), slurp(err_)};
}

}  // namespace stipple::test
