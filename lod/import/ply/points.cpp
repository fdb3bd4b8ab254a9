// PLY as points. Read in blocks; a header that promises more than the file can hold is refused.
#include <fmt/format.h>

#include <optional>

#include "engine/base/one_at_a_time.h"
#include "lod/import/import.h"
#include "lod/import/ply/rows.h"

namespace stipple::lod {

namespace {

/// Materials say both. One alone is an attribute: of scans "roughness" is that of the ground, in its units.
void keepWholeMaterials(PlyElement& vertex) {
    const auto has = [&](PlyRole role) {
        return std::any_of(vertex.properties.begin(), vertex.properties.end(),
                           [&](const PlyProperty& p) { return p.role == role; });
    };
    if (has(PlyRole::roughness) && has(PlyRole::metallic)) return;
    for (PlyProperty& p : vertex.properties)
        if (p.role == PlyRole::roughness || p.role == PlyRole::metallic) {
            p.role = PlyRole::none;
            p.slot = -1;
        }
}

}  // namespace

Result<PointSource> openPly(const std::string& path, const ReadOptions& options) {
    return openPly(fromFile(path), options);
}

Result<PointSource> openPly(const OpenBytes& open, const ReadOptions& options) {
    STIPPLE_ASSIGN(const std::shared_ptr<const ByteSource> file, open());
    const std::string& path = file->path();
    STIPPLE_ASSIGN(PlyHeader header, parsePlyHeader(*file));
    auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                               [](const PlyElement& e) { return e.name == "vertex"; });
    if (vertex == header.elements.end())
        return fail(ErrorKind::input, "has no element 'vertex'", path, "Stipple reads the vertices of a PLY file");
    PointSource source;
    SourceInfo& info = source.info;
    unsigned roles = 0;
    const size_t wanted = std::min(options.attributes.size(), kMostAttributes);
    keepWholeMaterials(*vertex);
    for (PlyProperty& p : vertex->properties) {
        if (!p.isList && p.role == PlyRole::none) {
            AttributeInfo attribute;
            attribute.name = p.name;
            attribute.type = isWide(p.type) ? ScalarType::f64 : ScalarType::f32;
            info.attributes.push_back(attribute);
            for (size_t k = 0; k < wanted; ++k)
                if (options.attributes[k] == p.name) p.slot = static_cast<int>(kPlyRoles + k);
        }
        if (p.role != PlyRole::none) roles |= 1u << static_cast<unsigned>(p.role);
        if (p.isList) info.notes.push_back(fmt::format("list property '{}' of the vertices is skipped", p.name));
    }
    if (header.unknownLines > 0)
        info.notes.push_back(
            fmt::format("header lines with unknown keywords are passed over: {}", header.unknownLines));
    if ((roles & 7u) != 7u) return fail(ErrorKind::input, "the vertices have no x, y and z", path);
    // The smallest that the declared rows can be: a promise of more is a lie, found before anything is allocated.
    const uint64_t body = file->sizeBytes() - header.bytes;
    uint64_t smallest = 0;
    for (const PlyElement& e : header.elements) {
        uint64_t row = 0;
        for (const PlyProperty& p : e.properties)
            row += header.encoding == PlyEncoding::ascii
                       ? 2
                       : kPlyTypeBytes.at(static_cast<size_t>(p.isList ? p.countType : p.type));
        row = std::max<uint64_t>(row, 1);
        const bool isVertex = e.name == "vertex";
        if (header.encoding == PlyEncoding::ascii && row > 1) --row;  // the last row may lack its end of line
        const bool impossible =
            e.count > 0 && (e.count > body || e.count > (body - std::min(body, smallest)) / row + 1);
        if (impossible)
            return fail(ErrorKind::input,
                        fmt::format("the header declares {} of element '{}', but {} bytes cannot hold them", e.count,
                                    e.name, body),
                        path, "the file is truncated or its header lies");
        smallest += row * e.count;
        if (isVertex) break;
    }
    info.path = path;
    static const std::array<const char*, 3> names{"ascii", "binary little endian", "binary big endian"};
    info.format = fmt::format("PLY {}", names.at(static_cast<size_t>(header.encoding)));
    info.points = vertex->count;
    info.hasNormal = (roles >> 3 & 7u) == 7u;
    info.hasColour = (roles >> 6 & 7u) == 7u;
    info.hasRadius = (roles >> 9 & 1u) != 0;
    if ((roles >> 10 & 3u) != 0) {
        info.materials = materialGrid();
        info.isReflectance = true;
    }
    info.up = UpAxis::y;
    source.parts = {info.points};
    // Read once, whoever reads first.
    auto scale = std::make_shared<std::optional<double>>();
    auto once = std::make_shared<OneAtATime>();
    source.openPart = [open, header, wanted, scale, once](size_t) -> Result<PointReader> {
        STIPPLE_ASSIGN(std::shared_ptr<const ByteSource> again, open());
        const double colourScale = (*once)([&] {
            if (!*scale) *scale = PlyReader::colourScaleOf(again, header);
            return **scale;
        });
        auto reader = std::make_shared<PlyReader>(std::move(again), header, wanted, colourScale);
        return PointReader([reader](PointBlock& block, size_t limit) { return reader->read(block, limit); });
    };
    return source;
}

}  // namespace stipple::lod
