#include "lod/import/ply/mesh.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/base/file.h"
#include "engine/base/numbers.h"
#include "engine/base/paged_array.h"
#include "lod/import/import.h"
#include "lod/import/ply/rows.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/file_kind.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

/// Faces as fans, strips unrolled, whatever parts their rows come in.
template <typename Triangle>
class FaceTaker {
  public:
    explicit FaceTaker(const Triangle& triangle) : triangle_(triangle) {}
    Result<void> take(const PlyReader::Corners& corners) {
        if (corners.areTriangles) {
            for (size_t i = 0; i < corners.list.size(); i += 3)
                STIPPLE_TRY(triangle_(corners.list[i], corners.list[i + 1], corners.list[i + 2]));
            return {};
        }
        if (corners.isFirst) count_ = 0;
        for (const double v : corners.list) {
            if (corners.isStrip && v < 0) {  // -1 starts a new one
                count_ = 0;
                continue;
            }
            if (count_ >= 2) {
                const bool isTurned = corners.isStrip && count_ % 2 == 1;
                STIPPLE_TRY(triangle_(a_, isTurned ? v : b_, isTurned ? b_ : v));
            }
            if (count_ == 0 || (count_ >= 2 && corners.isStrip)) a_ = count_ == 0 ? v : b_;
            if (count_ >= 1) b_ = v;
            ++count_;
        }
        return {};
    }

  private:
    const Triangle& triangle_;
    uint64_t count_ = 0;
    double a_ = 0, b_ = 0;
};

struct Vertex {
    glm::dvec3 position{0};
    glm::vec3 normal{0};
    uint32_t colour = 0;
};
/// Vertices, no wider than what the file says of them.
class VertexStore {
  public:
    VertexStore(const PlyElement& vertex, uint64_t memoryBytes, const std::string& folder) : count_(vertex.count) {
        std::array<bool, kPlyRoles> has{};
        for (const PlyProperty& p : vertex.properties) {
            if (p.role == PlyRole::none) continue;
            has.at(static_cast<size_t>(p.role)) = true;
            isWide_ = isWide_ || (p.role <= PlyRole::z && isWide(p.type));
        }
        hasNormals_ = has[3] && has[4] && has[5];
        hasColours_ = has[6] && has[7] && has[8];
        memoryBytes_ = memoryBytes;
        folder_ = folder;
        begin();
    }
    /// Empty again.
    void begin() {
        isSumming_ = !hasNormals_;
        values_.emplace(folder_, memoryBytes_, bytes(), count_);
    }
    bool hasNormals() const { return hasNormals_; }
    size_t bytes() const { return placeBytes() + (isSumming_ ? 12u : 4u) + (hasColours_ ? 4u : 0u); }
    /// Normals are complete: their lengths do not matter any more.
    void endSums() {
        isSumming_ = false;
        const size_t place = placeBytes(), colour = hasColours_ ? 4 : 0;
        values_->narrow(count_, bytes(), [&](const uint8_t* from, uint8_t* to) {
            glm::vec3 sum(0);
            std::memcpy(&sum, from + place, sizeof(sum));
            const uint32_t code = codeOf(sum);
            std::memcpy(to, from, place);
            std::memcpy(to + place, &code, sizeof(code));
            std::memcpy(to + place + sizeof(code), from + place + sizeof(sum), colour);
        });
    }
    Result<void> status() const { return values_->status(); }

    void set(uint64_t i, const Vertex& v) {
        uint8_t* to = values_->write(i);
        const auto put = [&](const auto& value) {
            std::memcpy(to, &value, sizeof(value));
            to += sizeof(value);
        };
        if (isWide_)
            put(v.position);
        else
            put(glm::vec3(v.position));
        if (isSumming_)
            put(v.normal);
        else
            put(codeOf(v.normal));
        if (hasColours_) put(v.colour);
    }
    glm::dvec3 position(uint64_t i) { return positionOf(values_->read(i)); }
    /// Before endSums().
    void addNormal(uint64_t i, const glm::vec3& normal) {
        uint8_t* const at = values_->write(i) + placeBytes();
        glm::vec3 sum;
        std::memcpy(&sum, at, sizeof(sum));
        sum += normal;
        std::memcpy(at, &sum, sizeof(sum));
    }
    Vertex get(uint64_t i) {
        const uint8_t* from = values_->read(i);
        const auto take = [&](auto value) {
            std::memcpy(&value, from, sizeof(value));
            from += sizeof(value);
            return value;
        };
        Vertex v;
        v.position = positionOf(from);
        from += placeBytes();
        if (!isSumming_) {
            const uint32_t code = take(0u);
            if (code != ~0u) v.normal = shared::octDecode(code);
        } else {
            v.normal = take(glm::vec3(0));
        }
        v.colour = hasColours_ ? take(0u) : 0xff000000u | kPlainColour;
        return v;
    }

  private:
    size_t placeBytes() const { return isWide_ ? sizeof(glm::dvec3) : sizeof(glm::vec3); }
    glm::dvec3 positionOf(const uint8_t* from) const {
        glm::dvec3 wide(0);
        glm::vec3 narrow(0);
        if (isWide_)
            std::memcpy(&wide, from, sizeof(wide));
        else
            std::memcpy(&narrow, from, sizeof(narrow));
        return isWide_ ? wide : glm::dvec3(narrow);
    }
    static uint32_t codeOf(const glm::vec3& normal) { return hasDirection(normal) ? octEncode(normal) : ~0u; }
    bool isWide_ = false, hasNormals_ = false, hasColours_ = false, isSumming_ = false;
    uint64_t memoryBytes_ = 0, count_ = 0;
    std::string folder_;
    std::optional<PagedArray> values_;
};

class PlyMesh {
  public:
    PlyMesh(std::shared_ptr<const ByteSource> file, PlyHeader header, uint64_t memoryBytes, const std::string& folder)
        : file_(std::move(file)),
          header_(std::move(header)),
          vertices_(vertexOf(header_), memoryBytes, folder),
          count_(vertexOf(header_).count) {}

    /// Of all vertices: while normals are summed, and after that.
    uint64_t surveyBytes() const { return count_ * vertices_.bytes(); }
    uint64_t badFaces() const { return badFaces_; }
    uint64_t readBytes() const { return surveyBytes() - (vertices_.hasNormals() ? 0 : 8 * count_); }
    /// `triangles`: about how many there are.
    Result<MeshSource::Bounds> survey(const MeshSource::Tell& tell, uint64_t triangles) {
        const uint64_t all = count_ + (vertices_.hasNormals() ? 0 : triangles);

        MeshSource::Bounds bounds;
        vertices_.begin();
        PlyReader reader(file_, header_, 0, PlyReader::colourScaleOf(file_, header_));
        PointBlock block;
        uint64_t next = 0;
        for (;;) {
            block.clear();
            STIPPLE_ASSIGN(const size_t got, reader.read(block, 65536));
            if (got == 0) break;
            for (size_t i = 0; i < got; ++i, ++next) {
                Vertex v{block.position[i], {}, 0xff000000u | kPlainColour};
                if (!block.normal.empty()) v.normal = block.normal[i];
                if (!block.colour.empty()) v.colour = block.colour[i] | 0xff000000u;
                bounds.add(v.position);
                vertices_.set(next, v);
            }
            STIPPLE_TRY(tell(next, all));
        }
        facesAt_ = reader.offset();
        if (!vertices_.hasNormals()) {
            STIPPLE_TRY(sumNormals(bounds, [&](uint64_t done) { return tell(count_ + done, all); }));
            vertices_.endSums();
        }
        STIPPLE_TRY(vertices_.status());
        return bounds;
    }

    Result<void> read(const MeshSource::Take& take) {
        BlockMaker blocks(
            [&](uint64_t i, TriangleMesh& to) {
                const Vertex v = vertices_.get(i);
                to.position.push_back(v.position);
                to.normal.push_back(v.normal);
                to.colour.push_back(v.colour);
                // Which side is out is not known to many programs that write PLY.
                to.surface.push_back(shared::kSurfaceTwoSided);
            },
            take);
        badFaces_ = 0;
        const auto add = [&](double a, double b, double c) -> Result<void> {
            for (const double v : {a, b, c})
                if (!(v >= 0 && v < static_cast<double>(count_))) {
                    ++badFaces_;
                    return {};
                }
            return blocks.triangle(static_cast<uint64_t>(a), static_cast<uint64_t>(b), static_cast<uint64_t>(c));
        };
        STIPPLE_TRY(forTriangles(add));
        STIPPLE_TRY(blocks.finish());
        return vertices_.status();
    }

  private:
    template <typename Triangle>
    Result<void> forTriangles(const Triangle& triangle) {
        PlyReader reader(file_, header_, 0);
        FaceTaker<Triangle> faces(triangle);
        return reader.readCorners(facesAt_, [&](const PlyReader::Corners& corners) { return faces.take(corners); });
    }
    Result<void> sumNormals(const MeshSource::Bounds& bounds, const std::function<Result<void>(uint64_t done)>& tell) {
        constexpr uint64_t kOften = 65536;
        uint64_t done = 0;
        // Areas of meshes 1e-20 or 1e20 wide are no floats: sums are taken as of a mesh about 1 wide. A power of two,
        // so that it rounds nothing.
        const glm::dvec3 size = 0.5 * bounds.hi - 0.5 * bounds.lo;
        int exponent = 0;
        (void)std::frexp(std::max({size.x, size.y, size.z}), &exponent);
        const double scale = std::ldexp(1.0, -std::clamp(exponent, -1000, 1000));
        return forTriangles([&](double a, double b, double c) -> Result<void> {
            if (++done % kOften == 0) STIPPLE_TRY(tell(done));
            const auto n = static_cast<double>(count_);
            if (!(a >= 0 && a < n && b >= 0 && b < n && c >= 0 && c < n)) return {};
            const std::array<uint64_t, 3> corner{static_cast<uint64_t>(a), static_cast<uint64_t>(b),
                                                 static_cast<uint64_t>(c)};
            const glm::dvec3 first = vertices_.position(corner[0]);
            const glm::vec3 sum(glm::cross(scale * (vertices_.position(corner[1]) - first),
                                           scale * (vertices_.position(corner[2]) - first)));
            if (!isFinite(sum)) return {};
            for (const uint64_t i : corner) vertices_.addNormal(i, sum);
            return {};
        });
    }
    static const PlyElement& vertexOf(const PlyHeader& header) {
        return *std::find_if(header.elements.begin(), header.elements.end(),
                             [](const PlyElement& e) { return e.name == "vertex"; });
    }

    std::shared_ptr<const ByteSource> file_;
    PlyHeader header_;
    VertexStore vertices_;
    uint64_t count_ = 0, facesAt_ = 0, badFaces_ = 0;
};

}  // namespace

Result<PlyFaces> plyFaces(const std::string& path) {
    if (fileKindOf(path) != FileKind::ply) return PlyFaces();
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    return plyFaces(file);
}

Result<PlyFaces> plyFaces(const ByteSource& file) {
    PlyFaces out;
    if (fileKindOf(file) != FileKind::ply) return out;
    STIPPLE_ASSIGN(const PlyHeader header, parsePlyHeader(file));
    for (const PlyElement& e : header.elements)
        if (e.name != "vertex" && std::any_of(e.properties.begin(), e.properties.end(), isCornerList))
            (e.name == "tristrips" ? out.strips : out.faces) += e.count;
    return out;
}

Result<MeshSource> openPlyMesh(const std::string& path, uint64_t memoryBytes, const std::string& tempFolder) {
    STIPPLE_ASSIGN(const std::shared_ptr<const ByteSource> file, fromFile(path)());
    return openPlyMesh(file, memoryBytes, tempFolder);
}

Result<MeshSource> openPlyMesh(const std::shared_ptr<const ByteSource>& file, uint64_t memoryBytes,
                               const std::string& tempFolder) {
    STIPPLE_ASSIGN(const PointSource checked, openPly(fromBytes(file), {}));  // the same checks as for points
    STIPPLE_ASSIGN(PlyHeader header, parsePlyHeader(*file));
    MeshSource source;
    for (const PlyElement& e : header.elements)
        if (e.name == "vertex") {
            source.vertices += e.count;
        } else if (std::any_of(e.properties.begin(), e.properties.end(), isCornerList)) {
            // A strip's row may hold any number of triangles: as many corners as there is room for.
            const bool isStrip = e.name == "tristrips";
            source.triangles += isStrip ? file->sizeBytes() / 4 : 2 * e.count;
        }
    auto mesh = std::make_shared<PlyMesh>(file, std::move(header), memoryBytes, tempFolder);
    source.surveyBytes = mesh->surveyBytes() > memoryBytes ? mesh->surveyBytes() : 0;
    source.readBytes = source.surveyBytes > 0 ? mesh->readBytes() : 0;
    source.identity = [file] { return file->identity(); };
    source.survey = [mesh, all = source.triangles](const MeshSource::Tell& tell) { return mesh->survey(tell, all); };
    source.read = [mesh](const MeshSource::Take& take) { return mesh->read(take); };
    source.badTriangles = [mesh] { return mesh->badFaces(); };
    return source;
}

}  // namespace stipple::lod
