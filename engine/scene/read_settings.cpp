#include "engine/scene/read_settings.h"

#include <fmt/format.h>

#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/process.h"

namespace stipple::scene {
namespace fs = std::filesystem;

Result<std::string> fileOfScene(const std::string& folder, const std::string& name, const ReadSettings& settings) {
    if (name.find('\0') != std::string::npos) return fail(ErrorKind::input, "its name holds a zero byte", folder);
    const fs::path path = fs::path(folder) / name;
    if (settings.allowOutside) return path.string();
    std::error_code error;
    const fs::path own = fs::canonical(folder.empty() ? fs::path(".") : fs::path(folder), error);
    const fs::path real = error ? fs::path() : fs::weakly_canonical(fs::absolute(path), error);
    if (error) return fail(ErrorKind::input, error.message(), path.string(), "check the path and its permissions");
    const auto [end, ignored] = std::mismatch(own.begin(), own.end(), real.begin(), real.end());
    if (end == own.end()) return path.string();
    return fail(ErrorKind::input, "lies outside the folder of the scene that names it", path.string(),
                "--allow-outside reads it all the same");
}

Result<std::vector<uint8_t>> readFileOfScene(const std::string& folder, const std::string& name,
                                             const ReadSettings& settings) {
    STIPPLE_ASSIGN(const std::string path, fileOfScene(folder, name, settings));
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    if (file.sizeBytes() > settings.memoryBytes)
        return overBudget("is read as a whole, which", file.sizeBytes(), settings.memoryBytes, path);
    std::vector<uint8_t> bytes(file.sizeBytes());
    if (!bytes.empty()) STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    return bytes;
}

tl::unexpected<Error> overBudget(const std::string& what, uint64_t neededBytes, uint64_t memoryBytes,
                                 const std::string& where) {
    return fail(ErrorKind::budget,
                fmt::format("{} takes about {}, but --memory allows {}", what, humanBytes(neededBytes),
                            humanBytes(memoryBytes)),
                where, fmt::format("give --memory {}M or more", (neededBytes >> 20) + 1));
}

}  // namespace stipple::scene
