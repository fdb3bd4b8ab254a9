#include "lod/primitives/patch_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_map.h"

namespace stipple::lod {
namespace {

/// Steps that the widest disc has as its radius: that of a surface 60 degrees from its plane. What is steeper stands at
/// creases, where another patch lies, too, and its disc would stand out on both sides.
constexpr double kWidest = 1.4142135623730951;
/// Steps that the rim of a disc may lie off the patch's own cells, for the sake of the sample's normal.
constexpr double kMostOff = 0.5;
constexpr shared::PointRecord kEmpty{0, kNoSample << 24, 0, 0};

/// The smallest code whose radius is not smaller (record.h).
uint32_t radiusCodeOf(double radiusOfCell) {
    return static_cast<uint32_t>(std::clamp(std::ceil(255 + 16 * std::log2(std::max(radiusOfCell, 1e-6))), 0.0, 255.0));
}

/// What a sample stands for: of each drawn cell around it the quarter that is nearest to it.
struct Share {
    glm::dvec3 middle{0};  ///< of those quarters
    double radius = 0;     ///< of a sphere about the middle that holds them
    glm::dvec3 normal{0};  ///< of those quarters, as long as their area
};

/// Samples of the blocks of a chunk, each once: those at the ends of a block are the neighbour's, where there is one.
class Samples {
  public:
    Samples(const Chunk& of, const glm::dvec3& origin, double step) : of_(of), origin_(origin), step_(step) {
        for (size_t n = 0; n < of.patchBlocks.size(); ++n) {
            const shared::PatchBlock& b = of.patchBlocks[n];
            blocks_.emplace(std::array<uint32_t, 3>{b.number, b.place % 65536, b.place / 65536}, n);
        }
    }
    std::optional<shared::PointRecord> at(size_t number, uint32_t s) const {
        const shared::PatchBlock& block = of_.patchBlocks[number];
        const PatchPlane& plane = of_.patchPlanes[number];
        const uint32_t u = s % shared::kPatchStride, v = s / shared::kPatchStride;
        if (codeOf(block, s) == 0 || isOfNeighbour(block, u, v)) return {};
        const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
        const Share share = shareOf(block, plane, u, v);
        if (!(share.radius > 0)) return {};  // no cell: damaged
        const glm::dvec3 place = plane.origin + frame * share.middle;
        const glm::dvec3 q = glm::floor((place - origin_) / step_ + 0.5);
        for (int a = 0; a < 3; ++a)
            if (!(q[a] >= 0 && q[a] <= 65535)) return {};
        const double step{plane.step}, radius = std::min(share.radius, kWidest * step);
        glm::dvec3 normal(shared::octDecode(block.normals[s]));
        const glm::dvec3 face = glm::normalize(share.normal);
        if (radius * glm::length(glm::cross(normal, face)) > kMostOff * step) normal = face;
        return shared::PointRecord{static_cast<uint32_t>(q.x) | static_cast<uint32_t>(q.y) << 16,
                                   static_cast<uint32_t>(q.z) | radiusCodeOf(radius / (65536 * step_)) << 16,
                                   octEncode(glm::vec3(frame * normal)),
                                   (colourOf(block, s) & 0xffffffu) | shared::kFlagTwoSided << 24};
    }

  private:
    static uint32_t codeOf(const shared::PatchBlock& b, uint32_t s) {
        return b.heights[s / 2] >> (16 * (s % 2)) & 0xffffu;
    }
    /// With what it sends by itself: the map has a level with a texel a sample.
    uint32_t colourOf(const shared::PatchBlock& b, uint32_t s) const {
        if ((b.map & shared::kMapLight) == 0) return b.colours[s];
        const uint32_t level = b.map & shared::kMapDensity;
        return withEmission(b.colours[s],
                            of_.patchMaps[(b.map >> shared::kMapFirstShift) + s + shared::mapLightFirst(b.map) +
                                          shared::mapLevelFirst(level, level)]);
    }
    /// That lies so many blocks to the right and up; nullptr: there is none.
    const shared::PatchBlock* besides(const shared::PatchBlock& b, int right, int up) const {
        const int64_t i = int64_t{b.place % 65536} + right * int64_t{shared::kPatchCellsAcross},
                      j = int64_t{b.place / 65536} + up * int64_t{shared::kPatchCellsUp};
        if (i < 0 || j < 0) return nullptr;
        const auto found = blocks_.find({b.number, static_cast<uint32_t>(i), static_cast<uint32_t>(j)});
        return found == blocks_.end() ? nullptr : &of_.patchBlocks[found->second];
    }
    bool isOfNeighbour(const shared::PatchBlock& b, uint32_t u, uint32_t v) const {
        const bool atRight = u == shared::kPatchCellsAcross, atTop = v == shared::kPatchCellsUp;
        return (atRight && besides(b, 1, 0) != nullptr) || (atTop && besides(b, 0, 1) != nullptr) ||
               (atRight && atTop && besides(b, 1, 1) != nullptr);
    }

    /// The quarter of a cell at its corner (right, up): that sample, the middles of the two edges there, and of the
    /// cell, in the order corner, along i, middle, along j. Empty: the cell is not drawn.
    std::optional<std::array<glm::dvec3, 4>> quarter(const shared::PatchBlock& b, const PatchPlane& plane, int cellI,
                                                     int cellJ, uint32_t right, uint32_t up) const {
        constexpr int kAcross = shared::kPatchCellsAcross, kUp = shared::kPatchCellsUp;
        const int blockRight = cellI < 0 ? -1 : cellI < kAcross ? 0 : 1, blockUp = cellJ < 0 ? -1 : cellJ < kUp ? 0 : 1;
        const shared::PatchBlock* of = besides(b, blockRight, blockUp);
        if (of == nullptr) return {};
        const auto i = static_cast<uint32_t>(cellI - blockRight * kAcross),
                   j = static_cast<uint32_t>(cellJ - blockUp * kUp), cell = j * kAcross + i;
        if ((of->cells[cell / 32] >> cell % 32 & 1u) == 0) return {};
        const auto place = [&](uint32_t x, uint32_t y) {
            const uint32_t code = codeOf(*of, (j + y) * shared::kPatchStride + i + x);
            return glm::dvec3(static_cast<double>(of->place % 65536 + i + x) * double{plane.step},
                              static_cast<double>(of->place / 65536 + j + y) * double{plane.step},
                              std::ldexp(code, plane.quantumExponent));
        };
        const glm::dvec3 p00 = place(0, 0), p10 = place(1, 0), p01 = place(0, 1), p11 = place(1, 1);
        const bool isRising = std::abs(p00.z - p11.z) <= std::abs(p10.z - p01.z);
        const glm::dvec3 own = place(right, up), middle = isRising ? 0.5 * (p00 + p11) : 0.5 * (p10 + p01);
        return std::array{own, 0.5 * (own + place(1 - right, up)), middle, 0.5 * (own + place(right, 1 - up))};
    }

    Share shareOf(const shared::PatchBlock& b, const PatchPlane& plane, uint32_t u, uint32_t v) const {
        Share out;
        std::array<std::array<glm::dvec3, 4>, 4> quarters;
        size_t count = 0;
        for (uint32_t k = 0; k < 4; ++k) {  // that to the lower left first: there the sample is the upper right one
            const uint32_t right = 1 - k % 2, up = 1 - k / 2;
            const auto q = quarter(b, plane, static_cast<int>(u) - static_cast<int>(right),
                                   static_cast<int>(v) - static_cast<int>(up), right, up);
            if (!q) continue;
            const glm::dvec3 area = 0.5 * glm::cross((*q)[2] - (*q)[0], (*q)[3] - (*q)[1]);
            out.normal += right == up ? area : -area;
            quarters.at(count++) = *q;
        }
        const bool isInside = count == 4;
        for (size_t k = 0; k < count; ++k)
            out.middle += isInside ? quarters[k][0] / 4.0
                                   : (quarters[k][0] + quarters[k][1] + quarters[k][2] + quarters[k][3]) /
                                         (4.0 * static_cast<double>(count));
        for (size_t k = 0; k < count; ++k)
            for (const glm::dvec3& p : quarters[k]) out.radius = std::max(out.radius, glm::distance(p, out.middle));
        return out;
    }

    const Chunk& of_;
    const glm::dvec3 origin_;
    const double step_;
    std::map<std::array<uint32_t, 3>, size_t> blocks_;  ///< by number of the patch, and place
};

}  // namespace

Payload payloadOfSamples(const Hierarchy& h, uint32_t chunk) {
    Payload p = h.payload(chunk);
    p.kind = Kind::points;
    p.maps = 0;
    p.stepShift = static_cast<int8_t>(static_cast<int>(h.rootLog2) - h.nodes[h.nodeOf(chunk)].level - 16);
    return p;
}

void samplesAsPoints(const Hierarchy& h, uint32_t chunk, Chunk& of) {
    const Node& node = h.nodes[h.nodeOf(chunk)];
    const Payload payload = payloadOfSamples(h, chunk);
    const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
    const Samples samples(of, h.recordOrigin(node, payload) - corner, std::exp2(payload.stepShift));
    std::vector<shared::PointRecord> records;
    std::vector<uint16_t> materials;
    const size_t places = recordsOfSamples(of.patchBlocks.size());
    records.reserve(places);
    for (size_t b = 0; b < of.patchBlocks.size(); ++b)
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            const auto record = samples.at(b, s);
            if (!record) continue;
            records.push_back(*record);
            if (!of.materials.empty()) materials.push_back(of.materials[b * shared::kPatchSamples + s]);
        }
    records.resize(places, kEmpty);
    if (!of.materials.empty()) materials.resize(places);
    if (places > 0) {
        of.records = std::move(records);
        of.materials = std::move(materials);
    }
    of.patchBlocks = {};  // with their memory
    of.patchPlanes = {};
    of.patchMaps = {};
}

bool hasPatches(const Hierarchy& h) {
    const auto isOne = [](const Payload& p) { return p.kind == Kind::patches; };
    return std::any_of(h.nodes.begin(), h.nodes.end(), isOne) || std::any_of(h.further.begin(), h.further.end(), isOne);
}

std::span<const shared::PointRecord> withoutEmpty(std::span<const shared::PointRecord> records) {
    const auto isEmpty = [](const shared::PointRecord& r) {
        return r.positionXY == 0 && r.positionZRadiusError == kEmpty.positionZRadiusError && r.normal == 0 &&
               r.colour == 0;
    };
    while (!records.empty() && isEmpty(records.back())) records = records.first(records.size() - 1);
    return records;
}

}  // namespace stipple::lod
