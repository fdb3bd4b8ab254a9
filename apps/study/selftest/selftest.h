// `stipple selftest`: hard cases on this machine, per device, against what is known beforehand: closed forms, the same
// scene elsewhere, the fp64 restatement.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/study/study.h"

namespace stipple::study {

struct SelfCheck {
    std::string device, name, unit;
    std::vector<int> cases;  ///< of tests/hard/README.md
    double measured = 0, limit = 0;
    bool isAtLeast = false;  ///< measured is to reach the limit, instead of staying below it
    std::string worst;       ///< the mode or size that `measured` is of; empty: all are alike
    bool isPassed() const { return isAtLeast ? measured >= limit : measured <= limit; }
};
struct SelfTestReport {
    Machine machine;
    std::vector<std::string> devices, absent;  ///< absent: with the reason
    std::vector<SelfCheck> checks;
    double seconds = 0;
    size_t failed() const;
};
struct SelfTestSettings {
    std::vector<std::string> devices{"cpu", "gpu"};  ///< all of these must be there, unless `skipAbsent`
    bool skipAbsent = true;
    std::string folder;  ///< for what is built
    int threads = 0;
};
Result<SelfTestReport> runSelfTest(const SelfTestSettings& settings, const Host& host);
std::string describeSelfTest(const SelfTestReport& report);
nlohmann::json jsonOfSelfTest(const SelfTestReport& report);

}  // namespace stipple::study
