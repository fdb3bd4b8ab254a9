#include "lod/import/formats.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>

#include "engine/base/file.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"
#include "lod/import/vdb/vdb.h"

namespace stipple::lod {
namespace {

Result<bool> plyHasMesh(const std::string& path, const FormatOptions& more) {
    if (more.onlyPoints) return false;
    STIPPLE_ASSIGN(const PlyFaces faces, plyFaces(path));
    return faces.any();
}
Result<OpenedMesh> plyMesh(const std::string& path, const FormatOptions& more) {
    const std::string folder =
        more.tempFolder.empty() ? std::filesystem::temp_directory_path().string() : more.tempFolder;
    STIPPLE_ASSIGN(MeshSource source, openPlyMesh(path, more.memoryBytes, folder));
    return OpenedMesh{std::move(source), {}};
}

/// In the order in which messages name them.
const std::vector<Format>& table() {
    static const std::vector<Format> kFormats{
        {.name = "LAS", .endings = {".las", ".laz"}, .marks = {"LASF"}, .readPoints = openLas},
        {.name = "PLY",
         .endings = {".ply"},
         .marks = {"ply"},
         .readPoints = openPly,
         .hasMesh = plyHasMesh,
         .openMesh = plyMesh},
        {.name = "OpenVDB",
         .endings = {".vdb"},
         .marks = {std::string_view(" BDV\0\0\0\0", 8)},
         .openPoints = openVdbPoints,
         .hasMesh = vdbHasMesh,
         .openMesh = openVdbMesh,
         .describe = describeVdb,
         .writePoints = writeVdbPoints,
         .writeMesh = writeVdbMesh},
    };
    return kFormats;
}

/// What a file begins with; nothing of what is none.
std::string headOf(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return {};
    const auto file = InputFile::open(path);
    std::array<char, 8> head{};
    if (!file || !file->readAt(0, head.data(), std::min<uint64_t>(head.size(), file->sizeBytes()))) return {};
    return std::string(head.data(), head.size());
}

}  // namespace

std::span<const Format> formats() { return table(); }

const Format* formatNamed(const std::string& path) {
    std::string ending = std::filesystem::path(path).extension().string();
    for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const Format& format : table())
        if (std::find(format.endings.begin(), format.endings.end(), ending) != format.endings.end()) return &format;
    return nullptr;
}

const Format* formatOf(const std::string& path) { return formatOf(path, headOf(path)); }

const Format* formatOf(const std::string& path, std::string_view head) {
    for (const Format& format : table())
        for (const std::string_view mark : format.marks)
            if (head.starts_with(mark)) return &format;
    return formatNamed(path);
}

std::string allEndings(const std::string& last) {
    std::vector<std::string_view> all;
    for (const Format& format : table()) all.insert(all.end(), format.endings.begin(), format.endings.end());
    std::string text;
    for (size_t i = 0; i < all.size(); ++i)
        text += (i == 0 ? "" : i + 1 == all.size() ? last : ", ") + std::string(all[i]);
    return text;
}

Result<bool> hasMesh(const std::string& path, const FormatOptions& more) {
    const Format* const format = formatOf(path);
    if (!format || !format->hasMesh) return false;
    return format->hasMesh(path, more);
}

Result<OpenedMesh> openMesh(const std::string& path, const FormatOptions& more) {
    const Format* const format = formatOf(path);
    if (!format || !format->openMesh) return fail(ErrorKind::input, "holds no triangles", path);
    return format->openMesh(path, more);
}

}  // namespace stipple::lod
