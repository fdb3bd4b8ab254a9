#include "tests/support/runs.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

namespace stipple::test {

bool runAndKill(const std::vector<std::string>& arguments, int milliseconds, int signal,
                const std::function<bool()>& isUnderWay) {
    const pid_t child = ::fork();
    if (child == 0) {
        std::vector<char*> argv;
        for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
        argv.push_back(nullptr);
        const int nowhere = ::open("/dev/null", O_WRONLY);
        ::dup2(nowhere, 1);
        ::dup2(nowhere, 2);
        ::execv(argv[0], argv.data());
        ::_exit(127);
    }
    using Clock = std::chrono::steady_clock;
    bool isCounting = !isUnderWay;
    auto until = Clock::now() + std::chrono::milliseconds(milliseconds);
    int status = 0;
    while (!isCounting || Clock::now() < until) {
        if (::waitpid(child, &status, WNOHANG) == child) return true;
        if (!isCounting && isUnderWay()) {
            isCounting = true;
            until = Clock::now() + std::chrono::milliseconds(milliseconds);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ::kill(child, signal);
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

void killAllWith(const std::string& argument) {
    for (int found = 1; found > 0;) {
        found = 0;
        for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
            const int pid = std::atoi(entry.path().filename().c_str());
            if (pid <= 0 || pid == ::getpid()) continue;
            std::ifstream file(entry.path() / "cmdline", std::ios::binary);
            bool isIt = false;
            for (std::string a; std::getline(file, a, '\0');) isIt = isIt || a == argument;
            if (!isIt) continue;
            ++found;
            ::kill(pid, SIGKILL);
            ::waitpid(pid, nullptr, WNOHANG);
        }
        if (found > 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
}

int shell(const std::string& limits, const std::string& arguments, const std::string& folder) {
    const std::string command =
        limits + "; exec " + STIPPLE_PROGRAM + " " + arguments + " >" + folder + "/out 2>" + folder + "/err";
    const int status = std::system(("bash -c '" + command + "'").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace stipple::test
