#include "lod/import/vdb/child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "engine/base/own_places.h"
#include "engine/base/process.h"

namespace stipple::lod {
namespace {
namespace fs = std::filesystem;

constexpr int kColumns = 3;  ///< the descriptor that the program has the columns under

/// The same above those that the program gets, wherever a host has closed its own 0 to 3; below 0: as it was.
int aboveColumns(int descriptor) {
    if (descriptor < 0 || descriptor > kColumns) return descriptor;
    const int above = ::fcntl(descriptor, F_DUPFD_CLOEXEC, kColumns + 1);
    ::close(descriptor);
    return above;
}

Result<std::string> programPath() {
    std::error_code ignored;
    const std::vector<std::string> places = ownPlaces("stipple_vdb", STIPPLE_INSTALLED_VDB, STIPPLE_BUILT_VDB);
    for (const std::string& place : places)
        if (fs::is_regular_file(place, ignored)) return place;
    return fail(ErrorKind::input, "the program that reads OpenVDB files is not there", places.front(),
                "build the target stipple_vdb, or install stipple anew");
}

/// All that it says, until it closes its end; killed where a stop is asked for.
std::string listen(int from, pid_t child, const std::function<bool()>& isStopped) {
    constexpr int kTurnMs = 100;
    std::string said;
    for (;;) {
        if (isStopped()) ::kill(child, SIGKILL);
        pollfd wait{from, POLLIN, 0};
        const int ready = ::poll(&wait, 1, kTurnMs);
        if (ready < 0 && errno != EINTR) return said;
        if (ready <= 0) continue;
        std::array<char, 4096> block{};
        const ssize_t got = ::read(from, block.data(), block.size());
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return said;
        said.append(block.data(), static_cast<size_t>(got));
    }
}

Result<nlohmann::json> answerOf(const std::string& said, int status, const std::string& where) {
    if (WIFSIGNALED(status))
        return fail(ErrorKind::input, fmt::format("made its reader end ({})", ::strsignal(WTERMSIG(status))), where,
                    "the file is damaged");
    nlohmann::json answer = nlohmann::json::parse(said, nullptr, false);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || !answer.is_object())
        return fail(ErrorKind::input, "made its reader end without an answer", where, "the file is damaged");
    if (!answer.contains("error")) return answer;
    const auto& e = answer["error"];
    return fail(static_cast<ErrorKind>(e.value("kind", 3)), e.value("what", ""), e.value("where", where),
                e.value("hint", ""));
}

}  // namespace

Result<std::shared_ptr<const NamelessFile>> NamelessFile::create(const std::string& folder) {
    std::error_code error;
    const fs::path place = folder.empty() ? fs::temp_directory_path(error) : fs::path(folder);
    std::string name = (place / "stipple-vdb-XXXXXX").string();
    int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
    if (descriptor >= 0) {
        ::unlink(name.c_str());
        descriptor = aboveColumns(descriptor);
    }
    if (descriptor < 0)
        return fail(ErrorKind::output, fmt::format("no temporary file can be made: {}", std::strerror(errno)),
                    place.string(), "--temp names another folder");
    return std::make_shared<const NamelessFile>(descriptor);
}

NamelessFile::~NamelessFile() { ::close(descriptor_); }

Result<nlohmann::json> runVdbProgram(nlohmann::json request, const NamelessFile& columns, const std::string& where,
                                     const std::function<bool()>& isStopped) {
    STIPPLE_ASSIGN(std::string program, programPath());
    request["columns"] = fmt::format("/proc/self/fd/{}", kColumns);
    std::string text = request.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    const auto notStarted = [&](int why) {
        return fail(ErrorKind::input, fmt::format("its reader cannot be started: {}", std::strerror(why)), where);
    };
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) return notStarted(errno);
    for (int& end : ends) end = aboveColumns(end);
    if (ends[0] < 0 || ends[1] < 0) {
        const int why = errno;
        for (const int end : ends) ::close(end);
        return notStarted(why);
    }
    posix_spawn_file_actions_t actions{};
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    ::posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_adddup2(&actions, columns.descriptor(), kColumns);
    std::array<char*, 3> arguments{program.data(), text.data(), nullptr};
    pid_t child = 0;
    const int failed = ::posix_spawn(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    if (failed != 0) {
        ::close(ends[0]);
        return notStarted(failed);
    }
    bool wasStopped = false;  // who asks once may not say so again
    const std::string said = listen(ends[0], child, [&] { return wasStopped = wasStopped || isStopped(); });
    ::close(ends[0]);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (wasStopped) return fail(ErrorKind::interrupted, "interrupted", where);
    return answerOf(said, status, where);
}

}  // namespace stipple::lod
