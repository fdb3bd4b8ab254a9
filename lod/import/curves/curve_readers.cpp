#include "lod/import/curves/curve_readers.h"

#include <algorithm>
#include <filesystem>

#include "engine/base/file.h"

namespace stipple::lod {
namespace {

/// By the bytes, where the format has a mark of its own; empty: they are of another kind than curves.
std::string extensionOf(const std::string& path, FileKind kind) {
    if (kind == FileKind::trk) return ".trk";
    if (kind == FileKind::hair) return ".hair";
    if (kind != FileKind::other) return "";
    std::string e = std::filesystem::path(path).extension().string();
    std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return e;
}

}  // namespace

bool isCurveFile(const std::string& path) { return isCurveFile(path, fileKindOf(path)); }

bool isCurveFile(const std::string& path, FileKind kind) {
    const std::string e = extensionOf(path, kind);
    return e == ".swc" || e == ".trk" || e == ".hair" || e == ".txt" || e == ".csv";
}

Result<CurveSource> openCurves(const std::string& path) {
    STIPPLE_ASSIGN(InputFile opened, InputFile::open(path));
    STIPPLE_ASSIGN(CurveSource source, openCurves(std::make_shared<const InputFile>(std::move(opened))));
    source.identity = [path] { return fileIdentity(path); };  // what was read as a whole is closed again
    return source;
}

Result<CurveSource> openCurves(const std::shared_ptr<const ByteSource>& file) {
    const std::string path = file->path();
    CurveSource source;
    source.vertices = file->sizeBytes() / 12;
    source.identity = [file] { return file->identity(); };
    const std::string e = extensionOf(path, fileKindOf(*file));
    source.isPlant = e != ".swc" && e != ".trk" && e != ".hair";  // of cylinder models trees are made
    if (e == ".trk") {
        source.read = [file, path](const CurveSource::Take& take) { return readTrk(Cursor(file, 0), path, take); };
        return source;
    }
    if (e == ".hair") {
        source.read = [file, path](const CurveSource::Take& take) {
            constexpr size_t kBlock = size_t{1} << 20;
            return readHair([&](uint64_t offset) { return Cursor(file, offset, kBlock); }, path, take);
        };
        return source;
    }
    constexpr uint64_t kLargest = uint64_t{256} << 20;
    if (file->sizeBytes() > kLargest)
        return fail(ErrorKind::input, "has more than 256 MiB of text, which is read as a whole", path,
                    "convert it to TrackVis or hair, which are read in blocks");
    std::string text(file->sizeBytes(), '\0');
    STIPPLE_TRY(file->readAt(0, text.data(), text.size()));
    STIPPLE_ASSIGN(CurveSet set, e == ".swc" ? readSwc(text, path) : readQsm(text, path));
    CurveSource whole = sourceOf(std::move(set));
    whole.identity = source.identity;
    whole.isPlant = source.isPlant;
    return whole;
}

}  // namespace stipple::lod
