#include "lod/import/import.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "engine/base/file.h"

namespace stipple::lod {

Result<PointSource> openPointSource(const std::string& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        return fail(ErrorKind::input, "is a directory", path, "name the files in it, e.g. " + path + "/*.las");
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    if (file.sizeBytes() == 0) return fail(ErrorKind::input, "is empty", path, "is the download complete?");
    std::array<char, 4> magic{};
    if (file.sizeBytes() >= magic.size()) STIPPLE_TRY(file.readAt(0, magic.data(), magic.size()));
    const std::string head(magic.data(), magic.size());
    if (head.substr(0, 3) == "ply") return openPly(path);
    if (head == "LASF") return openLas(path);
    std::string extension = std::filesystem::path(path).extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    if (extension == ".ply") return openPly(path);
    if (extension == ".las") return openLas(path);
    if (head.substr(0, 2) == "\x1f\x8b")
        return fail(ErrorKind::input, "is compressed with gzip", path, "unpack it first: gunzip -k");
    return fail(ErrorKind::input, "is in a format that this version does not read", path,
                "it reads .ply and uncompressed .las");
}

}  // namespace stipple::lod
