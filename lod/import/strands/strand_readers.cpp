#include "lod/import/strands/strand_readers.h"

#include <algorithm>
#include <filesystem>

#include "engine/base/file.h"

namespace stipple::lod {
namespace {

std::string extensionOf(const std::string& path) {
    std::string e = std::filesystem::path(path).extension().string();
    std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return e;
}

}  // namespace

bool isStrandFile(const std::string& path) {
    const std::string e = extensionOf(path);
    return e == ".swc" || e == ".trk" || e == ".hair" || e == ".txt" || e == ".csv";
}

Result<StrandSet> readStrands(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    constexpr uint64_t kLargest = uint64_t{8} << 30;
    if (file.sizeBytes() > kLargest)
        return fail(ErrorKind::input, "has more than 8 GiB: strands are read as a whole", path);
    std::vector<uint8_t> bytes(file.sizeBytes());
    STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const std::string e = extensionOf(path);
    if (e == ".swc") return readSwc(text, path);
    if (e == ".trk") return readTrk(bytes, path);
    if (e == ".hair") return readHair(bytes, path);
    return readQsm(text, path);
}

}  // namespace stipple::lod
