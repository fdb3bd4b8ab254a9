#include "lod/primitives/mesh_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "engine/base/hash.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockTriangles = 65536;
constexpr size_t kSlots = size_t{1} << 19;  ///< more than twice the corners of a block

/// Of a place, evenly spread: the two zeros are one place.
uint64_t hashOf(const glm::dvec3& p) {
    const std::array<double, 3> words{p.x + 0, p.y + 0, p.z + 0};
    return hashBytes(words.data(), sizeof(words));
}
bool isKept(const glm::dvec3& p, uint32_t thinned) { return thinned == 0 || hashOf(p) >> (64 - thinned) == 0; }

}  // namespace

void MeshSource::Bounds::add(const glm::dvec3& p) {
    if (!std::isfinite(p.x + p.y + p.z)) return;
    lo = glm::min(lo, p);
    hi = glm::max(hi, p);
    keep(p);
}

void MeshSource::Bounds::add(const Bounds& other) {
    lo = glm::min(lo, other.lo);
    hi = glm::max(hi, other.hi);
    thinned_ = std::max(thinned_, other.thinned_);
    std::erase_if(sample, [&](const glm::dvec3& p) { return !isKept(p, thinned_); });
    for (const glm::dvec3& p : other.sample) keep(p);
}

void MeshSource::Bounds::keep(const glm::dvec3& p) {
    constexpr size_t kMost = 16384;
    constexpr uint32_t kMostThinned = 60;  // (what is left then is one place)
    if (!isKept(p, thinned_)) return;
    sample.push_back(p);
    while (sample.size() > kMost && thinned_ < kMostThinned) {
        ++thinned_;
        std::erase_if(sample, [&](const glm::dvec3& q) { return !isKept(q, thinned_); });
    }
}

Result<void> BlockMaker::triangle(uint64_t a, uint64_t b, uint64_t c) {
    if (table_.empty()) table_.assign(kSlots, 0);
    for (const uint64_t vertex : {a, b, c}) {
        // Vertices that are used together mostly have numbers side by side: eight of them share a line of memory. The
        // places of the eights are mixed twice, so that no stride of numbers, as of instances, puts them side by side.
        constexpr uint64_t kTogether = 8;
        uint64_t mixed = vertex / kTogether * 0xbf58476d1ce4e5b9ull;
        mixed = (mixed ^ mixed >> 32) * 0x94d049bb133111ebull;
        size_t at = (mixed >> 48) * kTogether + vertex % kTogether;
        static_assert(kSlots == (size_t{1} << 16) * kTogether);
        while (table_[at] != 0 && table_[at] >> 24 != vertex + 1) at = (at + 1) % kSlots;
        if (table_[at] == 0) {
            table_[at] = (vertex + 1) << 24 | block_.position.size();
            used_.push_back(static_cast<uint32_t>(at));
            copy_(vertex, block_);
        }
        block_.indices.push_back(static_cast<uint32_t>(table_[at] & 0xffffffu));
    }
    if (block_.indices.size() < 3 * kBlockTriangles) return {};
    return finish();
}

Result<void> BlockMaker::finish() {
    if (block_.indices.empty()) return {};
    STIPPLE_TRY(take_(block_));
    for (const uint32_t at : used_) table_[at] = 0;
    used_.clear();
    block_.position.clear();
    block_.normal.clear();
    block_.uv.clear();
    block_.colour.clear();
    block_.surface.clear();
    block_.indices.clear();
    return {};
}

MeshSource sourceOf(TriangleMesh given) {
    const auto mesh = std::make_shared<const TriangleMesh>(std::move(given));
    MeshSource source;
    source.triangles = mesh->indices.size() / 3;
    source.vertices = mesh->position.size();
    source.identity = [mesh] {
        return hashBytes(mesh->indices.data(), mesh->indices.size() * 4) ^
               hashBytes(mesh->position.data(), mesh->position.size() * sizeof(glm::dvec3));
    };
    source.survey = [mesh](const MeshSource::Tell&) -> Result<MeshSource::Bounds> {
        MeshSource::Bounds bounds;
        for (const glm::dvec3& p : mesh->position) bounds.add(p);
        return bounds;
    };
    source.read = [mesh](const MeshSource::Take& take) -> Result<void> {
        if (mesh->indices.size() <= 3 * kBlockTriangles) return mesh->indices.empty() ? Result<void>() : take(*mesh);
        BlockMaker blocks(
            [&](uint64_t v, TriangleMesh& to) {
                to.position.push_back(mesh->position[v]);
                if (!mesh->normal.empty()) to.normal.push_back(mesh->normal[v]);
                if (!mesh->uv.empty()) to.uv.push_back(mesh->uv[v]);
                if (!mesh->colour.empty()) to.colour.push_back(mesh->colour[v]);
                if (!mesh->surface.empty()) to.surface.push_back(mesh->surface[v]);
            },
            take);
        for (size_t i = 0; i + 3 <= mesh->indices.size(); i += 3)
            STIPPLE_TRY(blocks.triangle(mesh->indices[i], mesh->indices[i + 1], mesh->indices[i + 2]));
        return blocks.finish();
    };
    return source;
}

MeshSource joined(std::vector<MeshSource> given) {
    const auto sources = std::make_shared<const std::vector<MeshSource>>(std::move(given));
    MeshSource all;
    for (const MeshSource& s : *sources) {
        all.triangles += s.triangles;
        all.vertices += s.vertices > 0 ? s.vertices : 3 * s.triangles;
        all.surveyBytes += s.surveyBytes;
        all.readBytes += s.readBytes;
    }
    all.identity = [sources] {
        std::vector<uint64_t> each;
        for (const MeshSource& s : *sources) each.push_back(s.identity());
        return hashBytes(each.data(), each.size() * sizeof(uint64_t));
    };
    all.survey = [sources](const MeshSource::Tell& tell) -> Result<MeshSource::Bounds> {
        MeshSource::Bounds bounds;
        constexpr uint64_t kParts = 10'000;  // of each
        for (size_t i = 0; i < sources->size(); ++i) {
            const auto tellPart = [&](uint64_t done, uint64_t of) {
                const double share = of > 0 ? static_cast<double>(std::min(done, of)) / static_cast<double>(of) : 1;
                return tell(i * kParts + static_cast<uint64_t>(share * kParts), sources->size() * kParts);
            };
            STIPPLE_ASSIGN(const MeshSource::Bounds own, (*sources)[i].survey(tellPart));
            bounds.add(own);
        }
        return bounds;
    };
    all.read = [sources](const MeshSource::Take& take) -> Result<void> {
        for (const MeshSource& s : *sources) STIPPLE_TRY(s.read(take));
        return {};
    };
    all.badTriangles = [sources] {
        uint64_t bad = 0;
        for (const MeshSource& s : *sources) bad += s.badTriangles ? s.badTriangles() : 0;
        return bad;
    };
    return all;
}

void append(TriangleMesh& to, const TriangleMesh& block) {
    const auto first = static_cast<uint32_t>(to.position.size());
    const auto add = [](auto& all, const auto& more) { all.insert(all.end(), more.begin(), more.end()); };
    add(to.position, block.position);
    add(to.normal, block.normal);
    add(to.uv, block.uv);
    add(to.colour, block.colour);
    add(to.surface, block.surface);
    for (const uint32_t i : block.indices) to.indices.push_back(first + i);
}

}  // namespace stipple::lod
