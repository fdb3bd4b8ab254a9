// What times are of: the machine, and how busy it is.
#pragma once

#include <string>

namespace stipple::study {

struct Machine {
    std::string processor;  ///< as the system names it; "unknown processor" where it does not (Linux)
    std::string date;       ///< of the day, UTC
    int threads = 0;        ///< that draw
    double load = -1;       ///< processes that wanted a core in the last minute, on average; negative: not known
};
Machine machineNow(int threads);
/// "AMD EPYC 7B13, 2 threads, load 0.1 before, 2026-11-23".
std::string describeMachine(const Machine& machine);

}  // namespace stipple::study
