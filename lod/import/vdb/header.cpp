#include "lod/import/vdb/header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "engine/base/file.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kMagic = 0x56444220;
constexpr uint32_t kOldest = 222, kNewest = 224;  // OpenVDB 2.0 to 10
constexpr uint64_t kMostGrids = 65536, kMostEntries = 65536, kLongestText = 1 << 20;

/// Reads forward; once something is not there, all that follows is 0.
class Reader {
  public:
    Reader(const InputFile& file, uint64_t at) : file_(&file), at_(at) {}
    template <typename T>
    T number() {
        T value{};
        take(&value, sizeof(T));
        return value;
    }
    std::string text() {
        const auto bytes = number<uint32_t>();
        std::string value(bytes <= kLongestText ? bytes : 0, '\0');
        if (bytes > kLongestText) isBad_ = true;
        take(value.data(), value.size());
        return value;
    }
    /// Entries of a map of metadata, by name; of what is no text the bytes.
    std::map<std::string, std::string> metadata() {
        std::map<std::string, std::string> all;
        const auto count = number<uint32_t>();
        if (count > kMostEntries) isBad_ = true;
        for (uint32_t i = 0; i < count && !isBad_; ++i) {
            const std::string name = text();
            text();  // the type
            all[name] = text();
        }
        return all;
    }
    void skip(uint64_t bytes) {
        if (bytes > file_->sizeBytes() - at_)
            isBad_ = true;
        else
            at_ += bytes;
    }
    uint64_t at() const { return at_; }
    bool isBad() const { return isBad_; }

  private:
    void take(void* to, size_t bytes) {
        if (isBad_ || bytes > file_->sizeBytes() - at_ || !file_->readAt(at_, to, bytes)) {
            isBad_ = true;
            std::memset(to, 0, bytes);
            return;
        }
        at_ += bytes;
    }
    const InputFile* file_;
    uint64_t at_;
    bool isBad_ = false;
};

uint64_t countOf(const std::map<std::string, std::string>& metadata, const char* name) {
    const auto found = metadata.find(name);
    int64_t value = 0;
    if (found != metadata.end() && found->second.size() == sizeof(value))
        std::memcpy(&value, found->second.data(), sizeof(value));
    return value > 0 ? static_cast<uint64_t>(value) : 0;
}

VdbKind kindOf(const VdbGrid& g) {
    if (g.type.starts_with("Tree_ptdataidx32_5_4_3")) return VdbKind::points;
    if (g.type != "Tree_float_5_4_3" && g.type != "Tree_double_5_4_3") return VdbKind::unknownType;
    if (g.gridClass == "level set") return VdbKind::levelSet;
    return g.gridClass == "fog volume" ? VdbKind::fog : VdbKind::unknownClass;
}

/// The descriptor and what stands at the begin of its grid.
Result<VdbGrid> readGrid(const InputFile& file, Reader& reader, const std::string& path) {
    VdbGrid g;
    const std::string unique = reader.text();
    g.name = unique.substr(0, unique.find('\x1e'));  // what follows tells grids of one name apart
    g.type = reader.text();
    const std::string parent = reader.text();
    if (const size_t half = g.type.find("_HalfFloat"); half != std::string::npos) {
        g.isHalf = true;
        g.type.resize(half);
    }
    g.begin = reader.number<uint64_t>();
    const auto blocks = reader.number<uint64_t>();
    g.end = reader.number<uint64_t>();
    if (reader.isBad()) return fail(ErrorKind::input, "ends within its list of grids", path, "the file is truncated");
    if (g.begin < reader.at() || blocks < g.begin || g.end < blocks)
        return fail(ErrorKind::input, fmt::format("says that grid '{}' ends before it begins", g.name), path,
                    "the file is damaged");
    if (g.end > file.sizeBytes())
        return fail(ErrorKind::input,
                    fmt::format("ends after {} bytes, but its grid '{}' after {}", file.sizeBytes(), g.name, g.end),
                    path, "the file is truncated");
    Reader own(file, g.begin);
    own.number<uint32_t>();  // how it is compressed
    const auto metadata = own.metadata();
    if (const auto found = metadata.find("class"); found != metadata.end()) g.gridClass = found->second;
    if (const auto found = metadata.find("name"); found != metadata.end() && !found->second.empty())
        g.name = found->second;
    g.voxels = countOf(metadata, "file_voxel_count");
    g.memoryBytes = countOf(metadata, "file_mem_bytes");
    g.transform = own.text();
    if (own.isBad() || own.at() > g.end)
        return fail(ErrorKind::input, fmt::format("has no readable description of its grid '{}'", g.name), path,
                    "the file is damaged");
    const size_t from = g.type.find('_'), to = g.type.find('_', from + 1);
    g.valueType = from == std::string::npos ? g.type : g.type.substr(from + 1, to - from - 1);
    g.kind = parent.empty() ? kindOf(g) : VdbKind::unknownType;
    return g;
}

std::string joined(const std::vector<std::string>& all) {
    constexpr size_t kMost = 6;
    std::string text;
    for (size_t i = 0; i < std::min(all.size(), kMost); ++i) text += (i > 0 ? ", " : "") + all[i];
    return all.size() > kMost ? fmt::format("{} and {} more", text, all.size() - kMost) : text;
}

}  // namespace

std::string VdbGrid::label() const {
    const std::string of = kind == VdbKind::points ? "points" : gridClass.empty() ? "no class" : gridClass;
    return fmt::format("'{}' ({}{})", name, of, kind == VdbKind::points ? "" : ", " + valueType);
}

Result<VdbHeader> readVdbHeader(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    if (file.sizeBytes() == 0) return fail(ErrorKind::input, "is empty", path, "is the download complete?");
    Reader reader(file, 0);
    if (reader.number<uint64_t>() != kMagic) return fail(ErrorKind::input, "is no OpenVDB file", path);
    VdbHeader header;
    header.version = reader.number<uint32_t>();
    reader.skip(8);  // the library's version
    const auto hasOffsets = reader.number<uint8_t>();
    reader.skip(36);  // an identifier
    if (!reader.isBad() && (header.version < kOldest || header.version > kNewest))
        return fail(
            ErrorKind::input,
            fmt::format("is an OpenVDB file of version {}; {} to {} are read", header.version, kOldest, kNewest), path,
            "write it again with another version of OpenVDB");
    if (!reader.isBad() && hasOffsets != 1)
        return fail(ErrorKind::input, "is an OpenVDB stream, whose grids have no places", path,
                    "write it again as a file");
    reader.metadata();
    const auto count = reader.number<uint32_t>();
    if (reader.isBad() || count > kMostGrids)
        return fail(ErrorKind::input, "ends within its header, or that is damaged", path, "is the download complete?");
    for (uint32_t i = 0; i < count; ++i) {
        STIPPLE_ASSIGN(VdbGrid grid, readGrid(file, reader, path));
        reader = Reader(file, grid.end);
        header.grids.push_back(std::move(grid));
    }
    return header;
}

Result<VdbChoice> chooseGrids(const VdbHeader& header, const std::string& name, const std::string& path) {
    VdbChoice choice;
    std::vector<std::string> all;
    bool isThere = name.empty();
    for (const VdbGrid& g : header.grids) {
        all.push_back(g.label());
        const bool isNamed = !name.empty() && g.name == name;
        isThere = isThere || isNamed;
        const bool isLevelSet = g.kind == VdbKind::levelSet || (isNamed && g.kind == VdbKind::unknownClass);
        if ((!name.empty() && !isNamed) || (!isLevelSet && g.kind != VdbKind::points)) {
            choice.leftOut.push_back(g.label());
            continue;
        }
        (isLevelSet ? choice.hasLevelSets : choice.hasPoints) = true;
        choice.voxels += g.voxels;
        choice.memoryBytes += g.memoryBytes;
    }
    if (header.grids.empty()) return fail(ErrorKind::input, "holds no grid", path);
    if (!isThere)
        return fail(ErrorKind::usage, fmt::format("has no grid '{}'; it has {}", name, joined(all)), path,
                    "name one of them, or leave --grid out");
    if (choice.hasLevelSets || choice.hasPoints) return choice;
    const auto isOf = [&](VdbKind kind) {
        return std::any_of(header.grids.begin(), header.grids.end(),
                           [&](const VdbGrid& g) { return g.kind == kind && (name.empty() || g.name == name); });
    };
    const char* const hint =
        isOf(VdbKind::fog) ? "fog volumes are not drawn: make a level set of it, at a density, where it comes from"
        : isOf(VdbKind::unknownClass) && name.empty()
            ? "if one is a level set whose class is not said, --grid NAME takes it"
            : "level sets of floats and grids of points are drawn";
    std::vector<std::string> refused;
    for (const VdbGrid& g : header.grids)
        if (name.empty() || g.name == name) refused.push_back(g.label());
    return fail(ErrorKind::input, "holds no level set and no points, but " + joined(refused), path, hint);
}

}  // namespace stipple::lod
