#include "engine/scene/read_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
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

std::string decodePercent(const std::string& uri) {
    std::string out;
    for (size_t i = 0; i < uri.size(); ++i) {
        const auto isDigit = [&](size_t k) {
            return k < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[k])) != 0;
        };
        if (uri[i] == '%' && isDigit(i + 1) && isDigit(i + 2)) {
            out += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
            i += 2;
        } else {
            out += uri[i];
        }
    }
    return out;
}

std::string withSlashes(std::string name) {
    std::replace(name.begin(), name.end(), '\\', '/');
    return name;
}

std::string nameOfUri(const std::string& uri) { return withSlashes(decodePercent(uri)); }

}  // namespace stipple::scene
