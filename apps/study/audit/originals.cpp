#include "apps/study/audit/originals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "engine/base/hash.h"
#include "engine/reference/decode.h"
#include "lod/import/import.h"

namespace stipple::study {
namespace {

using glm::dvec3;

/// A leaf record, and how far its point may be from it.
struct Kept {
    dvec3 place{0}, normal{0};
    std::array<uint8_t, 3> colour{};
    double rounding = 0;
};

Result<std::vector<Kept>> keptOf(const lod::Store& store) {
    STIPPLE_TRY(lod::readWholeTable(store));
    std::vector<Kept> all;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        STIPPLE_ASSIGN(const lod::Chunk chunk, lod::readChunk(store, n));
        const double step = std::ldexp(h.unit, h.nodes[n].stepShift);
        for (const shared::PointRecord& r : chunk.records) {
            const reference::Disc d = reference::decodeDisc(h, h.nodes[n], r);
            const auto byte = [&](uint32_t shift) { return static_cast<uint8_t>(r.colour >> shift & 255u); };
            // Floats of a file have digits that a lattice has not: what is lost there is stated apart.
            all.push_back({d.position,
                           d.normal,
                           {byte(0), byte(8), byte(16)},
                           std::sqrt(3.0) * (0.5 * step + store.description.roundingUnits) * (1 + 1e-9) +
                               4 * 0x1p-52 * glm::length(d.position)});
        }
    }
    return all;
}

/// Records by cubes as wide as any of them may be off.
class Grid {
  public:
    explicit Grid(const std::vector<Kept>& kept) : kept_(kept) {
        for (const Kept& k : kept) edge_ = std::max(edge_, k.rounding);
        for (uint32_t i = 0; i < kept.size(); ++i) cells_.emplace(keyOf(cellOf(kept[i].place)), i);
    }
    double edge() const { return edge_; }
    template <typename Use>
    void forNear(const dvec3& place, const Use& use) const {
        const std::array<int64_t, 3> c = cellOf(place);
        for (int64_t x = -1; x <= 1; ++x)
            for (int64_t y = -1; y <= 1; ++y)
                for (int64_t z = -1; z <= 1; ++z) {
                    const auto [first, last] = cells_.equal_range(keyOf({c[0] + x, c[1] + y, c[2] + z}));
                    for (auto at = first; at != last; ++at) use(kept_[at->second]);
                }
    }

  private:
    std::array<int64_t, 3> cellOf(const dvec3& p) const {
        return {std::llround(std::floor(p.x / edge_)), std::llround(std::floor(p.y / edge_)),
                std::llround(std::floor(p.z / edge_))};
    }
    static uint64_t keyOf(const std::array<int64_t, 3>& cell) { return hashBytes(cell.data(), sizeof cell); }
    const std::vector<Kept>& kept_;
    double edge_ = 1e-300;
    std::unordered_multimap<uint64_t, uint32_t> cells_;
};

double degreesBetween(const dvec3& a, const dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 57.29577951308232;
}

}  // namespace

Result<Originals> readOriginals(const std::string& path, size_t most) {
    STIPPLE_ASSIGN(const lod::PointSource source, lod::openPointSource(path));
    if (source.info.points > most) return fail(ErrorKind::budget, fmt::format("has more than {} points", most), path);
    Originals all;
    STIPPLE_TRY(lod::readPoints(source, [&](const lod::PointBlock& block) -> Result<void> {
        const lod::SourceInfo& info = source.info;
        const size_t count = info.isLattice ? block.lattice.size() : block.position.size();
        for (size_t i = 0; i < count; ++i) {
            const dvec3 p = info.isLattice ? dvec3(block.lattice[i]) * info.scale + info.offset : block.position[i];
            if (!std::isfinite(p.x + p.y + p.z)) continue;
            all.place.push_back(p);
            if (!block.normal.empty()) {
                const dvec3 n(block.normal[i]);
                const double length = glm::length(n);
                all.normal.push_back(length > 0 && std::isfinite(length) ? n / length : dvec3(0));
            }
            if (!block.colour.empty() && block.colour16.empty()) {
                const uint32_t c = block.colour[i];
                all.colour.push_back({static_cast<uint8_t>(c & 255u), static_cast<uint8_t>(c >> 8 & 255u),
                                      static_cast<uint8_t>(c >> 16 & 255u)});
            }
        }
        return {};
    }));
    return all;
}

Result<KeptAudit> auditOriginals(const Originals& originals, const lod::Store& store) {
    STIPPLE_ASSIGN(const std::vector<Kept> kept, keptOf(store));
    KeptAudit audit;
    audit.points = originals.place.size();
    audit.records = kept.size();
    for (const Kept& k : kept) audit.statedRounding = std::max(audit.statedRounding, k.rounding);
    const Grid grid(kept);
    for (size_t i = 0; i < originals.place.size(); ++i) {
        const bool hasNormal = !originals.normal.empty() && originals.normal[i] != dvec3(0);
        const bool hasColour = !originals.colour.empty();
        double rounding = 1e300, degrees = 1e300;
        bool isFound = false, isSame = false;
        grid.forNear(originals.place[i], [&](const Kept& k) {
            const double off = glm::length(k.place - originals.place[i]);
            if (off > k.rounding) return;
            isFound = true;
            rounding = std::min(rounding, off);
            if (hasNormal) degrees = std::min(degrees, degreesBetween(k.normal, originals.normal[i]));
            isSame = isSame || (hasColour && k.colour == originals.colour[i]);
        });
        audit.placeBeyond += !isFound;
        if (!isFound) continue;
        audit.worstRounding = std::max(audit.worstRounding, rounding);
        if (hasNormal) {
            ++audit.normals;
            audit.worstNormal = std::max(audit.worstNormal, degrees);
            audit.normalBeyond += degrees > kNormalDegrees;
        }
        if (hasColour) {
            ++audit.colours;
            audit.colourBeyond += !isSame;
        }
    }
    return audit;
}

}  // namespace stipple::study
