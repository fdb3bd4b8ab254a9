#include "lod/store_file.h"

#include <array>
#include <string_view>

#include "engine/base/file.h"

namespace stipple::lod {

bool isStoreFile(const std::string& path) {
    constexpr std::string_view kMagic = "STIPPLE1";
    std::array<char, kMagic.size()> begin{};
    const auto file = InputFile::open(path);
    return file && file->sizeBytes() >= begin.size() && file->readAt(0, begin.data(), begin.size()) &&
           std::string_view(begin.data(), begin.size()) == kMagic;
}

}  // namespace stipple::lod
