#include "engine/base/own_places.h"

#include <dlfcn.h>

#include <filesystem>

namespace stipple {
namespace {

/// Of the program, or of libstipple.so in somebody else's.
std::filesystem::path folderOfThisCode() {
    Dl_info info{};
    std::error_code ignored;
    if (::dladdr(reinterpret_cast<const void*>(&folderOfThisCode), &info) == 0 || info.dli_fname == nullptr) return {};
    return std::filesystem::canonical(info.dli_fname, ignored).parent_path();
}

}  // namespace

std::vector<std::string> ownPlaces(const std::string& name, const std::string& installed, const std::string& built) {
    std::error_code ignored;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
    const auto library = folderOfThisCode();
    // What lies beside somebody else's program is not ours.
    return {(library / "stipple" / name).string(), (library / name).string(), (program / name).string(),
            (program / installed).string(), built};
}

}  // namespace stipple
