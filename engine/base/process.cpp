#include "engine/base/process.h"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>

#include "engine/base/stop.h"

namespace stipple {

uint64_t peakRssBytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

void releaseFreeMemory() {
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

void keepFreeMemory(uint64_t memoryBytes, int threads) {
#ifdef __GLIBC__
    constexpr uint64_t kLeast = uint64_t{256} << 10, kMost = uint64_t{64} << 20;
    const auto kept = static_cast<int>(std::clamp(memoryBytes / 32, kLeast, kMost));
    mallopt(M_MMAP_THRESHOLD, kept);
    mallopt(M_TRIM_THRESHOLD, 2 * kept);
    mallopt(M_ARENA_MAX, std::max(threads / 4, 1));  // each keeps its own
#else
    static_cast<void>(memoryBytes);
    static_cast<void>(threads);
#endif
}

bool isAddressSpaceLimited() {
    rlimit limit{};
    return ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
}

namespace {

std::atomic<bool> stopRequested{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch it

extern "C" void requestStop(int signal) {
    stopRequested = true;
    std::signal(signal, SIG_DFL);
}

}  // namespace

void catchStopSignals() {
    std::signal(SIGINT, requestStop);
    std::signal(SIGTERM, requestStop);
}
bool isStopRequested() { return stopRequested; }
void askToStop() { stopRequested = true; }

double millisecondsSinceProcessStart() {
    // Field 22 of /proc/self/stat: start time after boot, in clock ticks. The name (field 2) may hold spaces.
    static const double startMs = [] {
        std::ifstream file("/proc/self/stat");
        std::string text;
        std::getline(file, text);
        const size_t close = text.rfind(')');
        std::istringstream rest(close == std::string::npos ? "" : text.substr(close + 2));
        std::string field;
        for (int i = 3; i <= 22; ++i) rest >> field;
        return 1000.0 * std::atof(field.c_str()) / static_cast<double>(sysconf(_SC_CLK_TCK));
    }();
    timespec now{};
    clock_gettime(CLOCK_BOOTTIME, &now);
    return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6 - startMs;
}

double nowSeconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string humanBytes(uint64_t bytes) {
    static const std::array<const char*, 6> units{"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
    double value = static_cast<double>(bytes);
    size_t unit = 0;
    while (value >= 1024 && unit + 1 < units.size()) {
        value /= 1024;
        ++unit;
    }
    return unit == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.1f} {}", value, units.at(unit));
}

}  // namespace stipple
