#include "apps/stipple/cache.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>

#include "engine/base/hash.h"
#include "lod/import/import.h"

namespace stipple::app {
namespace fs = std::filesystem;

namespace {

/// `part`: which of the stores that these inputs give.
Result<std::string> cachePath(const std::vector<std::string>& inputs, const BuildOptions& build,
                              const std::string& part) {
    std::string key = part + (build.onlyPoints ? "|points|" : "|") + build.normals + "|" + build.radii + "|" +
                      build.up + "|" + build.attributes + (build.skipBad ? "|skip" : "|") +
                      std::to_string(build.surfels) + fmt::format("|{}|", build.strandRadius) + STIPPLE_VERSION +
                      fmt::format("|{}", lod::kStoreVersion);
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs));
    for (const std::string& input : files) {
        std::error_code error;
        const fs::path absolute = fs::absolute(input, error);
        const auto size = fs::file_size(absolute, error);
        const auto time = fs::last_write_time(absolute, error);
        key +=
            fmt::format("|{}|{}|{}", absolute.string(), error ? 0 : size, error ? 0 : time.time_since_epoch().count());
    }
    const char* cache = std::getenv("XDG_CACHE_HOME");
    const char* home = std::getenv("HOME");
    const fs::path folder =
        cache && *cache ? fs::path(cache) / "stipple" : fs::path(home ? home : ".") / ".cache" / "stipple";
    std::error_code error;
    fs::create_directories(folder, error);
    if (error)
        return fail(ErrorKind::output, "cannot be created: " + error.message(), folder.string(), "set XDG_CACHE_HOME");
    return (folder / (hexDigits(hashBytes(key.data(), key.size())) + ".stipple")).string();
}

}  // namespace

Result<std::shared_ptr<const lod::Store>> openStoreFile(const std::string& path) {
    STIPPLE_ASSIGN(lod::Store store, lod::openStore(path));
    return std::make_shared<const lod::Store>(std::move(store));
}

Result<std::shared_ptr<const lod::Store>> openCached(const std::vector<std::string>& inputs, const BuildOptions& build,
                                                     const std::string& part, bool showProgress,
                                                     const StoreMaker& make) {
    STIPPLE_ASSIGN(const std::string path, cachePath(inputs, build, part));
    if (!fs::exists(path)) {
        Progress progress(build.progressStyle(!showProgress));
        STIPPLE_ASSIGN(const lod::BuildReport built, make(path, progress));
        if (showProgress)
            fmt::print(stderr, "{} ({}): built into the cache in {:.1f} s ({})\n", inputs.front(), part, built.seconds,
                       path);
        for (const std::string& note : built.notes)
            if (showProgress) fmt::print(stderr, "note: {}\n", note);
        for (const auto& [reason, count] : built.dropped)
            if (showProgress) fmt::print(stderr, "dropped {}: {}\n", count, reason);
    }
    return openStoreFile(path);
}

}  // namespace stipple::app
