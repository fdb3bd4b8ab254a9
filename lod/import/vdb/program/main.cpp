// Reads and writes OpenVDB files in a process of its own. OpenVDB trusts its files: counts that lie make it take memory
// without end or read past what it has. Here that ends this process (whose memory is limited) and nothing else.
//
//   stipple_vdb REQUEST    the request and, on standard output, the answer are JSON
#include <openvdb/openvdb.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <new>
#include <optional>

#include "lod/import/vdb/program/job.h"

namespace {
using stipple::ErrorKind;
using stipple::Result;
using stipple::vdb::Request;

/// Beyond what the data take: libraries, stacks, and what a failed reading holds.
constexpr uint64_t kOfProgram = uint64_t{192} << 20;

void limit(__rlimit_resource_t resource, uint64_t most) {
    const rlimit both{most, most};
    ::setrlimit(resource, &both);
}

/// Memory as it was told, and more time than a file of that size can take: one that is damaged may take for ever.
void limitThisProcess(const Request& request) {
    constexpr uint64_t kSeconds = 120, kBytesASecond = 100'000;
    uint64_t bytes = 0;
    for (const std::string& path : {request.path, request.columns}) {
        std::error_code error;
        const uint64_t size = std::filesystem::file_size(path, error);
        if (!error) bytes = std::max(bytes, size);
    }
    limit(RLIMIT_DATA, request.memoryBytes + kOfProgram);
    limit(RLIMIT_CPU, kSeconds + bytes / kBytesASecond);
    limit(RLIMIT_CORE, 0);
}

Result<nlohmann::json> run(const std::string& job, const Request& request, const nlohmann::json& layout) {
    if (job == "triangles") return stipple::vdb::levelSetsToTriangles(request);
    if (job == "surfels") return stipple::vdb::levelSetsToSurfels(request);
    if (job == "points") return stipple::vdb::pointGridsToPoints(request);
    if (job == "write triangles") return stipple::vdb::trianglesToLevelSet(request, layout);
    if (job == "write points") return stipple::vdb::pointsToPointGrid(request, layout);
    return stipple::fail(ErrorKind::usage, "knows no such job", job);
}

Result<nlohmann::json> runSafely(const char* text) {
    Request request;
    try {
        const nlohmann::json j = nlohmann::json::parse(text);
        request = {j.at("path"),   j.value("grid", ""),   j.at("columns"),
                   j.at("memory"), j.value("voxel", 0.0), j.value("threads", 0)};
        limitThisProcess(request);
        std::optional<tbb::global_control> threads;
        if (request.threads > 0)
            threads.emplace(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(request.threads));
        openvdb::initialize();
        return run(j.at("job"), request, j.value("layout", nlohmann::json()));
    } catch (const std::bad_alloc&) {
        return stipple::fail(ErrorKind::budget, "takes more memory than --memory allows", request.path,
                             "give more, if the file is what it says");
    } catch (const std::exception& e) {
        std::string what = e.what();
        for (char& c : what)
            if (c == '\n' || c == '\r') c = ' ';
        return stipple::fail(ErrorKind::input, "OpenVDB says: " + what, request.path, "is the file whole?");
    }
}

}  // namespace

int main(int argc, char** argv) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nobody would read the answer
    if (argc != 2) {
        std::cerr << "stipple_vdb is a part of stipple, which starts it\n";
        return 2;
    }
    const Result<nlohmann::json> done = runSafely(argv[1]);
    nlohmann::json answer;
    if (done)
        answer = *done;
    else
        answer["error"] = {{"kind", static_cast<int>(done.error().kind)},
                           {"what", done.error().what},
                           {"where", done.error().where},
                           {"hint", done.error().hint}};
    std::cout << answer.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << std::flush;
    ::_exit(std::cout ? 0 : 1);  // (nothing here needs to be taken apart)
}
