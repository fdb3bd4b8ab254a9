// One folder, one study.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "apps/study/sweep/runner.h"

namespace stipple::study {
namespace {

namespace fs = std::filesystem;

/// The first line that differs, of what is there and of what is asked for.
std::string firstDifference(const std::string& there, const std::string& asked) {
    std::istringstream a(there), b(asked);
    for (std::string x, y;;) {
        const bool hasA = static_cast<bool>(std::getline(a, x)), hasB = static_cast<bool>(std::getline(b, y));
        if (!hasA && !hasB) return "";
        if (!hasA || !hasB || x != y) return fmt::format("'{}', not '{}'", hasA ? x : "", hasB ? y : "");
    }
}

}  // namespace

Result<void> claimFolder(const std::vector<StudyScene>& scenes, const StudySettings& settings,
                         const Provenance& provenance) {
    const std::string& folder = settings.output;
    const std::string plan =
        fmt::format("stipple study 1\nprogram {} {} {}\non {}, {} threads\ndevice {}\n{}", provenance.version,
                    provenance.compiler, provenance.program, provenance.machine.processor, provenance.machine.threads,
                    provenance.device, describePlan(scenes, settings));
    std::error_code error;
    if (std::ifstream in(folder + "/plan.txt", std::ios::binary); in) {
        std::stringstream there;
        there << in.rdbuf();
        if (there.str() != plan)
            return fail(ErrorKind::output,
                        "holds another study, which this one would spoil: " + firstDifference(there.str(), plan),
                        folder, "choose another --output, or remove that one");
        return {};
    }
    if (fs::exists(folder, error) && (!fs::is_directory(folder, error) || !fs::is_empty(folder, error)))
        return fail(ErrorKind::output, "is there already, and is no folder of a study", folder,
                    "choose another --output");
    fs::create_directories(folder + "/crops", error);
    std::ofstream out(folder + "/plan.txt", std::ios::binary);
    out << plan;
    out.close();
    if (error || !out) return fail(ErrorKind::output, "cannot be written", folder, "choose another --output");
    return {};
}

std::string cropName(uint32_t cell) { return fmt::format("crops/cell_{:05}.png", cell); }

double cropTarget(const StudySettings& settings) {
    double best = settings.targets.front();
    for (const double t : settings.targets)
        if (std::abs(std::log2(t)) < std::abs(std::log2(best))) best = t;
    return best;
}

}  // namespace stipple::study
