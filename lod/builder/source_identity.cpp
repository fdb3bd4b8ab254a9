#include "lod/builder/source_identity.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>

#include "engine/base/hash.h"
#include "engine/base/text.h"
#include "lod/builder/build_version.h"
#include "lod/store/store.h"

namespace stipple::lod {

std::string sourceIdentity(const std::string& path) {
    std::error_code error;
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) info = {};
    return fmt::format("|{}|{}|{}.{}|{}.{}", std::filesystem::absolute(path, error).lexically_normal().string(),
                       info.st_size, info.st_mtim.tv_sec, info.st_mtim.tv_nsec, info.st_ctim.tv_sec,
                       info.st_ctim.tv_nsec);
}

std::string cacheKey(const std::string& sources, const std::string& settings) {
    const std::string text = fmt::format("{}|{}|{}{}", settings, kStoreVersion, kBuildVersion, sources);
    return hexDigits(hashBytes(text.data(), text.size()));
}

}  // namespace stipple::lod
