#include "lod/primitives/patch_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "lod/primitives/octahedral.h"

namespace stipple::lod {
namespace {

constexpr shared::PointRecord kEmpty{0, kNoSample << 24, 0, 0};

/// The smallest code whose radius is not smaller (record.h).
uint32_t radiusCodeOf(double radiusOfCell) {
    return static_cast<uint32_t>(std::clamp(std::ceil(255 + 16 * std::log2(std::max(radiusOfCell, 1e-6))), 0.0, 255.0));
}

/// Samples of the blocks of a chunk, each once: those at the ends of a block are the neighbour's, where there is one.
class Samples {
  public:
    Samples(const Chunk& of, const glm::dvec3& origin, double step) : of_(of), origin_(origin), step_(step) {
        for (const shared::PatchBlock& b : of.patchBlocks) known_.insert({b.number, b.place % 65536, b.place / 65536});
    }
    std::optional<shared::PointRecord> at(size_t number, uint32_t s) const {
        const shared::PatchBlock& block = of_.patchBlocks[number];
        const PatchPlane& plane = of_.patchPlanes[number];
        const uint32_t code = block.heights[s / 2] >> (16 * (s % 2)) & 0xffffu;
        const uint32_t u = s % shared::kPatchStride, v = s / shared::kPatchStride;
        if (code == 0 || isOfNeighbour(block, u, v)) return {};
        const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
        const double i = block.place % 65536 + u, j = block.place / 65536 + v;
        const glm::dvec3 place = plane.origin + frame * glm::dvec3(i * double{plane.step}, j * double{plane.step},
                                                                   std::ldexp(code, plane.quantumExponent));
        const glm::dvec3 q = glm::floor((place - origin_) / step_ + 0.5);
        for (int a = 0; a < 3; ++a)
            if (!(q[a] >= 0 && q[a] <= 65535)) return {};
        const glm::dvec3 local(shared::octDecode(block.normals[s]));
        const double radius = std::sqrt(0.5) * double{plane.step} / (0.1 + 0.9 * std::max(0.0, local.z));
        return shared::PointRecord{static_cast<uint32_t>(q.x) | static_cast<uint32_t>(q.y) << 16,
                                   static_cast<uint32_t>(q.z) | radiusCodeOf(radius / (65536 * step_)) << 16,
                                   octEncode(glm::vec3(frame * local)),
                                   (block.colours[s] & 0xffffffu) | shared::kFlagTwoSided << 24};
    }

  private:
    bool isOfNeighbour(const shared::PatchBlock& b, uint32_t u, uint32_t v) const {
        const uint32_t i = b.place % 65536, j = b.place / 65536;
        const auto has = [&](uint32_t right, uint32_t up) {
            return known_.contains({b.number, i + right * shared::kPatchCellsAcross, j + up * shared::kPatchCellsUp});
        };
        const bool atRight = u == shared::kPatchCellsAcross, atTop = v == shared::kPatchCellsUp;
        return (atRight && has(1, 0)) || (atTop && has(0, 1)) || (atRight && atTop && has(1, 1));
    }

    const Chunk& of_;
    const glm::dvec3 origin_;
    const double step_;
    std::set<std::array<uint32_t, 3>> known_;  ///< number of the patch, place
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
