#include "apps/study/machine.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdlib>
#include <ctime>
#include <fstream>

namespace stipple::study {

Machine machineNow(int threads) {
    Machine m{"unknown processor", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr))), threads, -1};
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (const size_t colon = line.find(": "); line.starts_with("model name") && colon != std::string::npos) {
            m.processor = line.substr(colon + 2);
            break;
        }
    getloadavg(&m.load, 1);
    return m;
}

std::string describeMachine(const Machine& m) {
    const std::string load = m.load < 0 ? "" : fmt::format(", load {:.1f} before", m.load);
    return fmt::format("{}, {} threads{}, {}", m.processor, m.threads, load, m.date);
}

}  // namespace stipple::study
