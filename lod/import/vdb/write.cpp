// Points and triangles into .vdb files: columns for the program (program/), which makes grids of them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/base/words.h"
#include "lod/import/import.h"
#include "lod/import/vdb/child.h"
#include "lod/import/vdb/header.h"
#include "lod/import/vdb/vdb.h"
#include "lod/store/attributes.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

/// Rows of one width, into a file that the program reads.
class Rows {
  public:
    static Result<Rows> create(const std::string& folder) {
        STIPPLE_ASSIGN(std::shared_ptr<const NamelessFile> file, NamelessFile::create(folder));
        return Rows(std::move(file));
    }
    template <typename T>
    void put(const T& value) {
        const size_t at = bytes_.size();
        bytes_.resize(at + sizeof(T));
        std::memcpy(bytes_.data() + at, &value, sizeof(T));
    }
    /// Where enough has come together.
    Result<void> flush(size_t least = 0) {
        if (bytes_.size() < std::max<size_t>(least, 1)) return {};
        STIPPLE_TRY(writeFileAt(file_->path(), written_, bytes_.data(), bytes_.size()));
        written_ += bytes_.size();
        bytes_.clear();
        return {};
    }
    const NamelessFile& file() const { return *file_; }

  private:
    explicit Rows(std::shared_ptr<const NamelessFile> file) : file_(std::move(file)) {}
    std::shared_ptr<const NamelessFile> file_;
    std::vector<char> bytes_;
    uint64_t written_ = 0;
};
constexpr size_t kBlock = size_t{4} << 20;

glm::vec3 linearColour(const PointBlock& block, size_t i) {
    glm::vec3 c(0);
    const bool isWide = !block.colour16.empty();
    for (int k = 0; k < 3; ++k) {
        const float whole = isWide ? static_cast<float>(block.colour16[i] >> (16 * k) & 0xffffu) / 65535.0f
                                   : static_cast<float>(block.colour[i] >> (8 * k) & 0xffu) / 255.0f;
        c[k] = whole <= 0.04045f ? whole / 12.92f : std::pow((whole + 0.055f) / 1.055f, 2.4f);
    }
    return c;
}

/// Names that mean something in a grid of points.
std::string attributeName(const std::string& name) {
    const bool isTaken = name == "P" || name == "Cd" || name == "N" || name == "pscale";
    return isTaken ? name + "_" : name;
}

struct Layout {
    nlohmann::json columns = nlohmann::json::array();
    size_t bytes = sizeof(glm::dvec3);
    void add(const std::string& name, const char* type, size_t size) {
        columns.push_back({{"name", name}, {"type", type}, {"offset", bytes}});
        bytes += size;
    }
};

/// The edge of a voxel in which some eight points of a surface lie.
double voxelFor(const glm::dvec3& least, const glm::dvec3& greatest, uint64_t points) {
    std::array<double, 3> size{greatest.x - least.x, greatest.y - least.y, greatest.z - least.z};
    std::sort(size.begin(), size.end());
    const double voxel = std::sqrt(8 * size[2] * std::max(size[1], size[2] * 1e-3) / static_cast<double>(points));
    return voxel > 0 ? voxel : 1;
}

/// The same grids, the same bytes: OpenVDB gives each file an identifier by chance, here it is made of what follows it.
Result<void> identify(const OutputFile& file) {
    constexpr uint64_t kAt = 21, kText = 36;
    STIPPLE_ASSIGN(const InputFile written, InputFile::open(file.temporaryPath()));
    std::vector<char> block(kBlock);
    uint64_t hash = 0;
    for (uint64_t at = kAt + kText; at < written.sizeBytes(); at += block.size()) {
        block.resize(std::min<uint64_t>(kBlock, written.sizeBytes() - at));
        STIPPLE_TRY(written.readAt(at, block.data(), block.size()));
        hash = hashBytes(block.data(), block.size(), hash);
    }
    const std::string text = fmt::format("{:08x}-0000-5000-8000-{:012x}", hash >> 32, hash & 0xffffffffffffu);
    return writeFileAt(file.temporaryPath(), kAt, text.data(), text.size());
}

/// What is written is read again as far as its header goes: a full disk shows there.
Result<nlohmann::json> writeFile(nlohmann::json request, const Rows& rows, const std::string& path,
                                 const FormatOptions& more) {
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    request["path"] = file.temporaryPath();
    request["memory"] = more.openingBytes;
    STIPPLE_ASSIGN(nlohmann::json answer, runVdbProgram(std::move(request), rows.file(), path, more.isStopped));
    const auto header = readVdbHeader(file.temporaryPath());
    STIPPLE_ASSIGN(const InputFile written, InputFile::open(file.temporaryPath()));
    if (!header || header->grids.empty() || header->grids.back().end != written.sizeBytes())
        return fail(ErrorKind::output, "could not be written as a whole", path, "is the disk full?");
    STIPPLE_TRY(identify(file));
    STIPPLE_TRY(file.commit());
    return answer;
}

}  // namespace

Result<WriteReport> writeVdbPoints(const PointSource& points, const std::string& path, double voxel,
                                   const FormatOptions& more) {
    const SourceInfo& info = points.info;
    Layout layout;
    if (info.hasColour) layout.add("Cd", "vec3s", sizeof(glm::vec3));
    if (info.hasNormal) layout.add("N", "vec3s", sizeof(glm::vec3));
    if (info.hasRadius) layout.add("pscale", "float", sizeof(float));
    for (const AttributeInfo& a : info.attributes) layout.add(attributeName(a.name), "double", sizeof(double));
    STIPPLE_ASSIGN(Rows rows, Rows::create(more.tempFolder));
    glm::dvec3 least(1e300), greatest(-1e300);
    uint64_t count = 0, notFinite = 0;
    STIPPLE_TRY(readPoints(points, [&](const PointBlock& block) -> Result<void> {
        const size_t n = std::max(block.position.size(), block.lattice.size());
        for (size_t i = 0; i < n; ++i) {
            const glm::dvec3 p =
                block.lattice.empty() ? block.position[i] : glm::dvec3(block.lattice[i]) * info.scale + info.offset;
            if (!isFinite(p)) {
                ++notFinite;
                continue;
            }
            least = glm::min(least, p);
            greatest = glm::max(greatest, p);
            rows.put(p);
            if (info.hasColour) rows.put(linearColour(block, i));
            if (info.hasNormal) rows.put(block.normal[i]);
            if (info.hasRadius) rows.put(block.radius[i]);
            for (size_t a = 0; a < info.attributes.size(); ++a)
                rows.put(attributeValue(info.attributes[a],
                                        block.attributes[a].data() + i * bytesOf(info.attributes[a].type)));
            ++count;
        }
        return rows.flush(kBlock);
    }));
    if (count == 0) return fail(ErrorKind::input, "holds no points", info.path);
    STIPPLE_TRY(rows.flush());
    const uint64_t bytes = 2 * count * layout.bytes;
    if (bytes > more.openingBytes)
        return fail(ErrorKind::budget,
                    fmt::format("{} points are held twice, which takes about {}, but --memory allows {}", count,
                                humanBytes(bytes), humanBytes(more.openingBytes)),
                    path, fmt::format("give --memory {}M or more", (bytes >> 20) + 1));
    const double edge = voxel > 0 ? voxel : voxelFor(least, greatest, count);
    STIPPLE_ASSIGN(const nlohmann::json answer,
                   writeFile({{"job", "write points"},
                              {"voxel", edge},
                              {"layout", {{"rows", count}, {"row_bytes", layout.bytes}, {"columns", layout.columns}}}},
                             rows, path, more));
    WriteReport report;
    report.line = fmt::format("{} in voxels of {:.6g}, positions to {:.2g}{}", counted(count, "point"), edge,
                              std::ldexp(edge, -24),
                              notFinite > 0 ? fmt::format("; {} without a place are left out", notFinite) : "");
    report.facts = {{"points", count}, {"voxel", edge}, {"not finite", notFinite}};
    return report;
}

Result<WriteReport> writeVdbMesh(const MeshSource& triangles, const std::string& path, double voxel,
                                 const FormatOptions& more) {
    if (!(voxel > 0))
        return fail(ErrorKind::usage, "are level sets, whose voxels have a size", "triangles in a .vdb file",
                    "give --voxel SIZE, in units of the file");
    if (triangles.survey) STIPPLE_TRY(triangles.survey([](uint64_t, uint64_t) { return Result<void>(); }));
    STIPPLE_ASSIGN(Rows rows, Rows::create(more.tempFolder));
    std::vector<uint32_t> indices;
    uint64_t vertices = 0;
    STIPPLE_TRY(triangles.read([&](const TriangleMesh& block) -> Result<void> {
        for (const glm::dvec3& p : block.position) {
            if (!isFinite(p)) return fail(ErrorKind::input, "has a vertex that is nowhere", path);
            rows.put(p);
        }
        for (const uint32_t i : block.indices) indices.push_back(static_cast<uint32_t>(vertices) + i);
        vertices += block.position.size();
        if (vertices > UINT32_MAX) return fail(ErrorKind::budget, "has more than 2^32 vertices", path);
        return rows.flush(kBlock);
    }));
    for (const uint32_t i : indices) rows.put(i);
    STIPPLE_TRY(rows.flush());
    const uint64_t count = indices.size() / 3;
    STIPPLE_ASSIGN(const nlohmann::json answer, writeFile({{"job", "write triangles"},
                                                           {"voxel", voxel},
                                                           {"layout", {{"vertices", vertices}, {"triangles", count}}}},
                                                          rows, path, more));
    const nlohmann::json& d = answer["deviation"];
    const auto lost = d["unmeasured"].get<uint64_t>(), open = answer["open_edges"].get<uint64_t>();
    WriteReport report;
    report.line = fmt::format(
        "{} as a level set of {} of {:.6g}: at most {:.3g} units ({:.3g} voxels) from each other, {:.3g} ({:.3g}) on "
        "average, at {} places",
        counted(count, "triangle"), counted(answer["voxels"].get<uint64_t>(), "voxel"), voxel,
        d["most_units"].get<double>(), d["most_voxels"].get<double>(), d["mean_units"].get<double>(),
        d["mean_voxels"].get<double>(), d["places"].get<uint64_t>());
    if (lost > 0) report.line += fmt::format("; {} places are lost: they are thinner than a voxel, or open", lost);
    if (open > 0) report.line += fmt::format("; the triangles have {}", counted(open, "open edge"));
    report.facts = {{"triangles", count},
                    {"voxels", answer["voxels"].get<uint64_t>()},
                    {"voxel", voxel},
                    {"deviation", d["most_units"].get<double>()},
                    {"in voxels", d["most_voxels"].get<double>()},
                    {"mean deviation", d["mean_units"].get<double>()},
                    {"mean in voxels", d["mean_voxels"].get<double>()},
                    {"lost places", lost},
                    {"open edges", open}};
    return report;
}

}  // namespace stipple::lod
