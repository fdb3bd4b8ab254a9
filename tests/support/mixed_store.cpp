#include "tests/support/mixed_store.h"

#include <cmath>
#include <stdexcept>

#include "lod/builder/counts.h"
#include "lod/primitives/octahedral.h"

namespace stipple::test {
namespace {

using lod::Kind;

constexpr uint32_t kRootLog2 = 20;
constexpr double kCells = 1 << kRootLog2;  // lattice steps across the root, which is the unit cube
constexpr double kFloor = 0.25, kRoof = 0.45;

template <typename T>
T valueOf(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().line());
    return std::move(*result);
}

std::vector<Kind> only(const std::vector<Kind>& kinds, uint32_t parts) {
    std::vector<Kind> out;
    for (const Kind kind : kinds)
        if (parts & (kind == Kind::points ? kMixedPoints : kind == Kind::triangles ? kMixedTriangles : kMixedCurves))
            out.push_back(kind);
    return out;
}

std::vector<Kind> kindsOfQuarter(uint32_t octant, uint32_t parts) {
    static const std::vector<std::vector<Kind>> all{{Kind::points},
                                                    {Kind::triangles, Kind::curves},
                                                    {Kind::triangles, Kind::points},
                                                    {Kind::points, Kind::triangles, Kind::curves}};
    return only(all[octant], parts);
}

class MixedWriter {
  public:
    explicit MixedWriter(uint32_t parts) : parts_(parts) {
        h_.unit = 1 / kCells;
        h_.rootLog2 = kRootLog2;
        h_.errors.smallest = 64;
        h_.isMixed = true;
    }

    void write(const std::string& path) {
        auto writer = valueOf(lod::StoreWriter::create(path));
        const auto kinds = mixedKinds(parts_);
        makeTree();
        for (uint32_t n = 0; n < h_.nodes.size(); ++n) {
            std::vector<lod::Payload> payloads;
            for (const Kind kind : kinds[n]) payloads.push_back(makePayload(n, kind, writer));
            static_cast<lod::Payload&>(h_.nodes[n]) = payloads[0];
            h_.nodes[n].firstFurther = static_cast<uint32_t>(h_.further.size());
            h_.nodes[n].furtherPayloads = static_cast<uint8_t>(payloads.size() - 1);
            for (size_t k = 1; k < payloads.size(); ++k) {
                lod::FurtherPayload further;
                static_cast<lod::Payload&>(further) = payloads[k];
                further.node = n;
                h_.further.push_back(further);
            }
        }
        addStream(writer);
        lod::StoreDescription d;
        d.hasColour = d.hasNormals = d.isReflectance = true;
        d.boundsMax = d.focusMax = glm::dvec3(1, 1, 0.5);
        d.highHeight = 0.5;
        d.source = "by hand";
        d.isCurves = parts_ == kMixedCurves;
        d.records = records_;
        d.points = d.pointsIn = leafRecords_;
        if (const auto done = writer.finish(h_, d); !done) throw std::runtime_error(done.error().line());
        if (const auto done = writer.commit(); !done) throw std::runtime_error(done.error().line());
    }

  private:
    void makeTree() {
        h_.nodes.resize(mixedKinds(parts_).size());
        lod::Node& root = h_.nodes[0];
        root.centre = glm::dvec3(0.5, 0.5, kFloor) * kCells;
        root.radius = 1.1 * kCells;
        root.firstChild = 1;
        octants_ = {0};
        for (uint32_t o = 0; o < 4; ++o)
            if (!kindsOfQuarter(o, parts_).empty()) octants_.push_back(o);
        for (size_t n = 1; n < h_.nodes.size(); ++n) {
            lod::Node& child = h_.nodes[n];
            const uint32_t octant = octants_[n];
            root.childMask = static_cast<uint8_t>(root.childMask | 1u << octant);
            child.level = 1;
            child.cell = {octant & 1u, octant >> 1, 0};
            child.centre = (lowOf(n) + glm::dvec3(0.25, 0.25, kFloor)) * kCells;
            child.radius = 0.6 * kCells;
        }
    }
    /// Of the cell, world units.
    glm::dvec3 lowOf(size_t n) const {
        const auto& cell = h_.nodes[n].cell;
        return h_.nodes[n].level == 0 ? glm::dvec3(0) : 0.5 * glm::dvec3(cell[0], cell[1], cell[2]);
    }
    double sizeOf(size_t n) const { return h_.nodes[n].level == 0 ? 1 : 0.5; }
    /// Coarse records are a 64th and a 32nd of the cube off.
    uint32_t codeOf(size_t n, Kind kind) const {
        return n > 0 ? 0 : h_.errors.encodeUp(kCells / (kind == Kind::points ? 64 : 32));
    }

    lod::Payload makePayload(uint32_t n, Kind kind, lod::StoreWriter& writer) {
        lod::Payload p;
        setKind(p, kind);
        p.errorCode = static_cast<uint8_t>(codeOf(n, kind));
        lod::Chunk chunk;
        const int level = h_.nodes[n].level;
        if (kind == Kind::points) {
            p.stepShift = static_cast<int8_t>(static_cast<int>(kRootLog2) - level - 16);
            addPoints(n, p, chunk);
            p.records = static_cast<uint32_t>(chunk.records.size());
        } else if (kind == Kind::curves) {
            p.stepShift = static_cast<int8_t>(static_cast<int>(kRootLog2) - level - 15);
            addTubes(n, chunk);
            p.records = static_cast<uint32_t>(chunk.segments.size());
        } else {
            addTriangles(n, p, chunk);
            p.records = static_cast<uint32_t>(chunk.triangles.size());
        }
        std::vector<uint32_t> own(256, 0), parents(256, 0);
        own[p.errorCode] = p.records;
        // What replaces the root's: the floor its points, the rest its roof (where a store has one, else as if).
        const uint32_t parent = n == 0                 ? lod::ErrorScale::kNoParent
                                : kind == Kind::points ? codeOf(0, Kind::points)
                                                       : codeOf(0, Kind::triangles);
        parents[parent] = p.records;
        p.parentCounts = lod::makeCodeCounts(parents, p.records, h_.greaterThan);
        p.ownCounts = lod::makeCodeCounts(own, p.records, h_.greaterThan);
        records_ += p.records;
        if (n > 0) leafRecords_ += p.records;
        const auto bytes = kind == Kind::points   ? lod::encodeChunk(chunk)
                           : kind == Kind::curves ? lod::encodeCurveChunk(chunk)
                                                  : lod::encodeMeshChunk(chunk);
        if (const auto done = writer.appendChunk(bytes, {}, p); !done) throw std::runtime_error(done.error().line());
        return p;
    }

    void addPoints(uint32_t n, const lod::Payload& p, lod::Chunk& chunk) const {
        // Above the triangles of a quarter a few; in the quarter that has none the floor itself.
        const bool isFloor = n == 0 || octants_[n] == 0;
        const uint32_t count = n == 0 ? 16 : isFloor ? 32 : 6;
        const double size = sizeOf(n), spacing = size / count, radius = isFloor ? 0.8 * spacing : 0.02;
        const double step = std::exp2(p.stepShift), shift = 0.5 * (step - 1);
        const auto code = static_cast<uint32_t>(std::min(255.0, std::ceil(255 + 16 * std::log2(radius / size))));
        for (uint32_t y = 0; y < count; ++y)
            for (uint32_t x = 0; x < count; ++x) {
                const glm::dvec3 at((x + 0.5) * spacing, (y + 0.5) * spacing, isFloor ? kFloor : 0.33);
                const auto q = [&](double v) { return static_cast<uint32_t>(std::floor((v * kCells - shift) / step)); };
                chunk.records.push_back({q(at.x) | q(at.y) << 16, q(at.z) | code << 16 | uint32_t{p.errorCode} << 24,
                                         lod::octEncode({0, 0, 1}), 0x605040u + 0x3u * x + 0x300u * y});
            }
    }

    void addTubes(uint32_t n, lod::Chunk& chunk) const {
        const double size = sizeOf(n);
        const glm::dvec3 low = lowOf(n);
        const auto vertex = [&](const glm::dvec3& at, uint32_t high) {
            const auto q = [&](int a) {
                const double cells = (at[a] - low[a]) / size;
                return static_cast<uint32_t>(std::floor((cells + double{shared::kCurveMargin}) * 32768));
            };
            const uint32_t radius = shared::curveRadiusCode(static_cast<float>(0.012 / size));
            return shared::CurveVertex{q(0) | q(1) << 16, q(2) | radius << 16 | 1u << 31, lod::octEncode({1, 0, 0}),
                                       0x30a050u | high << 24};
        };
        for (int k = 0; k < 3; ++k) {
            const glm::dvec3 from = low + glm::dvec3(0.06, 0.12 + 0.12 * k, 0.4);
            const glm::dvec3 to = from + glm::dvec3(0.38, 0, 0);
            const uint32_t octants = 1u;
            chunk.segments.push_back({vertex(from, 0), vertex(to, octants)});
        }
    }

    void addTriangles(uint32_t n, lod::Payload& p, lod::Chunk& chunk) {
        p.group = static_cast<uint32_t>(h_.groups.size());
        lod::MeshGroup group;
        group.firstRun = static_cast<uint32_t>(h_.runs.size());
        if (n == 0) {  // a run for what each child replaces
            for (uint32_t o = 0; o < 4; ++o)
                if (h_.nodes[0].childMask >> o & 1u)
                    addGrid(glm::dvec3(0.5 * (o & 1u), 0.5 * (o >> 1), kRoof), 0.5, 1, o, 0xa03030, chunk);
        } else {
            addGrid(lowOf(n) + glm::dvec3(0, 0, kFloor), 0.5, 10, 0, 0xb09060, chunk);
        }
        group.runs = static_cast<uint32_t>(h_.runs.size()) - group.firstRun;
        group.vertices = static_cast<uint32_t>(chunk.vertices.size());
        group.clusters = static_cast<uint32_t>(chunk.clusters.size());
        h_.groups.push_back(group);
    }
    /// A square of count x count quads, as a cluster and a run of its own.
    void addGrid(const glm::dvec3& low, double size, uint32_t count, uint32_t octant, uint32_t colour,
                 lod::Chunk& chunk) {
        const auto firstVertex = static_cast<uint32_t>(chunk.vertices.size());
        const auto firstTriangle = static_cast<uint32_t>(chunk.triangles.size());
        for (uint32_t y = 0; y <= count; ++y)
            for (uint32_t x = 0; x <= count; ++x) {
                const glm::dvec3 at = (low + glm::dvec3(x, y, 0) * (size / count)) * kCells;
                chunk.vertices.push_back({static_cast<int>(at.x), static_cast<int>(at.y), static_cast<int>(at.z),
                                          lod::octEncode({0, 0, 1}), 0xff000000u | colour, 0, 0,
                                          shared::kSurfaceTwoSided});
            }
        for (uint32_t y = 0; y < count; ++y)
            for (uint32_t x = 0; x < count; ++x) {
                const uint32_t a = y * (count + 1) + x, b = a + 1, c = a + count + 1, d = c + 1;
                chunk.triangles.push_back(a | b << 8 | d << 16);
                chunk.triangles.push_back(a | d << 8 | c << 16);
            }
        const auto vertices = static_cast<uint32_t>(chunk.vertices.size()) - firstVertex;
        const auto triangles = static_cast<uint32_t>(chunk.triangles.size()) - firstTriangle;
        const auto cluster = static_cast<uint32_t>(chunk.clusters.size());
        chunk.clusters.push_back({firstVertex, firstTriangle, vertices | triangles << 16});
        h_.runs.push_back({octant, cluster, 1, triangles});
    }

    /// A stream that no reader asks for yet.
    void addStream(lod::StoreWriter& writer) {
        h_.nodes[0].firstStream = 0;
        h_.nodes[0].streams = 1;
        h_.streams.push_back(valueOf(writer.appendStream(lod::StreamId::spacingCode, mixedStream())));
    }

    uint32_t parts_;
    lod::Hierarchy h_;
    std::vector<uint32_t> octants_;  ///< of each node
    uint64_t records_ = 0, leafRecords_ = 0;
};

}  // namespace

std::vector<std::vector<lod::Kind>> mixedKinds(uint32_t parts) {
    // (Tubes have no coarse version of their own: where there is nothing else, the root has them, too.)
    std::vector<std::vector<Kind>> out{parts == kMixedCurves ? std::vector{Kind::curves}
                                                             : only({Kind::points, Kind::triangles}, parts)};
    for (uint32_t o = 0; o < 4; ++o)
        if (auto kinds = kindsOfQuarter(o, parts); !kinds.empty()) out.push_back(kinds);
    return out;
}

std::vector<uint8_t> mixedStream() { return {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13}; }

void writeMixedStore(const std::string& path, uint32_t parts) { MixedWriter(parts).write(path); }

}  // namespace stipple::test
