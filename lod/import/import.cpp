#include "lod/import/import.h"

#include <fmt/format.h>
#include <glob.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "engine/base/file.h"
#include "lod/import/formats.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

std::string lowerExtension(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    return extension;
}

/// Formats of points that other programs turn into ours.
bool isOtherPointFormat(const std::string& extension) {
    static constexpr std::array<const char*, 12> known{".xyz", ".pts", ".ptx", ".asc", ".pcd", ".e57",
                                                       ".txt", ".csv", ".npy", ".rcp", ".rcs", ".fls"};
    return std::find(known.begin(), known.end(), extension) != known.end();
}

/// Every point file below `folder`.
Result<std::vector<std::string>> filesBelow(const fs::path& folder) {
    std::vector<std::string> files;
    std::error_code error;
    for (auto it = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, error);
         !error && it != fs::recursive_directory_iterator(); it.increment(error))
        if (it->is_regular_file(error) && formatNamed(it->path().string())) files.push_back(it->path().string());
    if (error) return fail(ErrorKind::input, "cannot be listed: " + error.message(), folder.string());
    if (files.empty())
        return fail(ErrorKind::input, "holds no " + allEndings(" or ") + " file", folder.string(),
                    "octrees of other formats (e.g. Potree's octree.bin) are not read");
    std::sort(files.begin(), files.end());
    return files;
}

/// The folder that holds the node files of an octree, given its description file.
fs::path nodeFolder(const fs::path& description) {
    const fs::path folder = description.parent_path();
    for (const char* name : {"ept-data", "data"})
        if (std::error_code e; fs::is_directory(folder / name, e)) return folder / name;
    return folder.empty() ? fs::path(".") : folder;
}

std::vector<std::string> matching(const std::string& pattern) {
    glob_t found{};
    std::vector<std::string> files;
    if (glob(pattern.c_str(), 0, nullptr, &found) == 0) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    globfree(&found);
    return files;
}

/// The same file under another name, or again, goes.
std::vector<std::string> onceEach(const std::vector<std::string>& files, std::vector<std::string>* notes) {
    std::map<std::pair<dev_t, ino_t>, std::string> first;
    std::vector<std::string> once, again;
    for (const std::string& file : files) {
        struct stat info {};
        if (::stat(file.c_str(), &info) == 0 && !first.try_emplace({info.st_dev, info.st_ino}, file).second) {
            again.push_back(file == first.at({info.st_dev, info.st_ino})
                                ? fmt::format("{}: is named more than once", file)
                                : fmt::format("{}: is the same file as {}", file, first[{info.st_dev, info.st_ino}]));
            continue;
        }
        once.push_back(file);
    }
    if (notes == nullptr || again.empty()) return once;
    notes->push_back(again.size() == 1 ? again.front() + ", and is taken once"
                                       : fmt::format("{}, and {} more files likewise: each is taken once",
                                                     again.front(), again.size() - 1));
    return once;
}

}  // namespace

Result<std::vector<std::string>> expandInputs(const std::vector<std::string>& inputs, std::vector<std::string>* notes) {
    std::vector<std::string> files;
    for (const std::string& input : inputs) {
        std::error_code error;
        const fs::path path(input);
        std::vector<std::string> names{input};
        if (!fs::exists(path, error) && input.find_first_of("*?[") != std::string::npos) {
            names = matching(input);
            if (names.empty()) return fail(ErrorKind::input, "matches no file", input, "check the pattern");
        }
        for (const std::string& name : names) {
            const fs::path p(name);
            const std::string file = p.filename().string();
            if (fs::is_directory(p, error)) {
                const bool isOctree = fs::exists(p / "ept.json", error) || fs::exists(p / "cloud.js", error);
                STIPPLE_ASSIGN(const std::vector<std::string> below, filesBelow(isOctree ? nodeFolder(p / "x") : p));
                files.insert(files.end(), below.begin(), below.end());
            } else if ((file == "ept.json" || file == "cloud.js") && fs::exists(p, error)) {
                STIPPLE_ASSIGN(const std::vector<std::string> below, filesBelow(nodeFolder(p)));
                files.insert(files.end(), below.begin(), below.end());
            } else {
                files.push_back(name);
            }
        }
    }
    return onceEach(files, notes);
}

std::optional<uint64_t> declaredByOctree(const std::string& input) {
    std::error_code error;
    fs::path description(input);
    if (fs::is_directory(description, error)) {
        for (const char* name : {"ept.json", "cloud.js"})
            if (fs::exists(fs::path(input) / name, error)) description = fs::path(input) / name;
    }
    const std::string name = description.filename().string();
    if (name != "ept.json" && name != "cloud.js") return {};
    constexpr uint64_t kSizeLimit = 1 << 20;
    const auto text = readTextFile(description.string(), kSizeLimit);
    if (!text) return {};
    const auto json = nlohmann::json::parse(*text, nullptr, false);
    if (!json.is_object() || !json.contains("points") || !json["points"].is_number_unsigned()) return {};
    return json["points"].get<uint64_t>();
}

Result<uint64_t> readPoints(const PointSource& source, const std::function<Result<void>(const PointBlock&)>& take) {
    constexpr size_t kBlockPoints = 65536;
    uint64_t points = 0;
    PointBlock block;
    for (size_t part = 0; part < source.parts.size(); ++part) {
        STIPPLE_ASSIGN(const PointReader read, source.openPart(part));
        for (;;) {
            block.clear();
            STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
            if (count == 0) break;
            points += count;
            if (take) STIPPLE_TRY(take(block));
        }
    }
    return points;
}

OpenBytes fromFile(const std::string& path) {
    return [path]() -> Result<std::shared_ptr<const ByteSource>> {
        STIPPLE_ASSIGN(InputFile file, InputFile::open(path));
        return std::make_shared<const InputFile>(std::move(file));
    };
}

OpenBytes fromBytes(std::shared_ptr<const ByteSource> bytes) {
    return [bytes = std::move(bytes)] { return Result<std::shared_ptr<const ByteSource>>(bytes); };
}

Result<PointSource> openPointSource(const std::string& path, const ReadOptions& options, const FormatOptions& more) {
    std::error_code ignored;
    if (fs::is_directory(path, ignored))
        return fail(ErrorKind::input, "is a directory", path, "name the files in it, e.g. " + path + "/*.las");
    const Format* const format = formatOf(path);
    if (format != nullptr && format->openPoints != nullptr && fs::file_size(path, ignored) > 0)
        return format->openPoints(path, options, more);
    return openPointSource(fromFile(path), options);
}

Result<PointSource> openPointSource(const OpenBytes& open, const ReadOptions& options) {
    std::array<char, 8> head{};
    std::string path;
    {
        STIPPLE_ASSIGN(const std::shared_ptr<const ByteSource> bytes, open());
        path = bytes->path();
        if (bytes->sizeBytes() == 0) return fail(ErrorKind::input, "is empty", path, "is the download complete?");
        STIPPLE_TRY(bytes->readAt(0, head.data(), std::min<uint64_t>(head.size(), bytes->sizeBytes())));
    }
    const std::string_view text(head.data(), head.size());
    const Format* const format = formatOf(path, text);
    if (format != nullptr && format->readPoints != nullptr) return format->readPoints(open, options);
    if (format != nullptr)
        return fail(ErrorKind::input, fmt::format("is {}, which is read from files only", format->name), path);
    if (text.starts_with("\x1f\x8b"))
        return fail(ErrorKind::input, "is compressed with gzip", path, "unpack it first: gunzip -k");
    const std::string reads = "it reads " + allEndings() + ", .gltf, .glb, .obj, .swc, .trk, .hair and cylinder models";
    if (isOtherPointFormat(lowerExtension(path)))
        return fail(ErrorKind::input, "holds points in a format that this version does not read", path,
                    reads + "; `pdal translate` or CloudCompare make .laz of it");
    return fail(ErrorKind::input, "is in a format that this version does not read", path, reads);
}

}  // namespace stipple::lod
