#include "lod/store/file_kind.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "engine/base/file.h"

namespace stipple::lod {

FileKind fileKindOf(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return FileKind::other;
    const auto file = InputFile::open(path);
    return file ? fileKindOf(*file) : FileKind::other;
}

FileKind fileKindOf(const ByteSource& bytes) {
    std::array<char, 8> head{};
    if (!bytes.readAt(0, head.data(), std::min<uint64_t>(head.size(), bytes.sizeBytes()))) return FileKind::other;
    constexpr std::array<std::pair<std::string_view, FileKind>, 7> kMarks{{{"STIPPLE1", FileKind::store},
                                                                           {"LASF", FileKind::las},
                                                                           {"ply\n", FileKind::ply},
                                                                           {"ply\r", FileKind::ply},
                                                                           {"glTF", FileKind::glb},
                                                                           {"TRACK", FileKind::trk},
                                                                           {"HAIR", FileKind::hair}}};
    for (const auto& [mark, kind] : kMarks)
        if (std::string_view(head.data(), mark.size()) == mark) return kind;
    return FileKind::other;
}

bool isStoreFile(const std::string& path) {
    const FileKind kind = fileKindOf(path);
    return kind == FileKind::store ||
           (kind == FileKind::other && std::filesystem::path(path).extension() == ".stipple");
}

}  // namespace stipple::lod
