#include "lod/store/patch_map_bytes.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/smooth_streams.h"
#include "shaders/shared/patch_map.h"

namespace stipple::lod {

using namespace streams;

namespace {

constexpr size_t kStreams = 4;  ///< what each patch has, colours, normals, materials
constexpr uint8_t kHasNormals = shared::kMapNormals, kHasMaterials = shared::kMapMaterials,
                  kHasLight = shared::kMapLight;

struct MapSizes {
    std::array<uint32_t, kStreams> packed, plain;
};
static_assert(sizeof(MapSizes) == 32);
/// Behind it, where there is light.
struct LightSizes {
    uint32_t packed, plain;
};

/// Texels of all grids at most: so many, and so many times those that the blocks have (as cells, patch_bytes.cpp).
constexpr uint64_t kMostTexels = uint64_t{1} << 22, kGridsABlock = 8;
uint64_t texelsOfBlock(uint32_t density) {
    return ((uint64_t{shared::kPatchCellsAcross} << density) + 1) * ((uint64_t{shared::kPatchCellsUp} << density) + 1);
}

/// Neighbours of a texel that are known before it.
struct Before {
    size_t left, below, corner;
    bool hasLeft, hasBelow, hasCorner;
};
Before before(const MapLevel& m, uint32_t i, uint32_t j) {
    const size_t t = m.at(i, j);
    Before b{t - 1, t - m.width, t - m.width - 1, i > 0, j > 0, i > 0 && j > 0};
    b.hasLeft = b.hasLeft && m.isKnown[b.left] != 0;
    b.hasBelow = b.hasBelow && m.isKnown[b.below] != 0;
    b.hasCorner = b.hasCorner && m.isKnown[b.corner] != 0;
    return b;
}
/// Of a value of each texel, from those before it.
template <typename ValueOf>
uint32_t predicted(const Before& b, uint32_t last, const ValueOf& valueOf) {
    if (!b.hasLeft || !b.hasBelow || !b.hasCorner)
        return b.hasLeft ? valueOf(b.left) : b.hasBelow ? valueOf(b.below) : last;
    const uint32_t left = valueOf(b.left), below = valueOf(b.below), corner = valueOf(b.corner);
    const uint32_t least = std::min(left, below), most = std::max(left, below);
    return corner >= most ? least : corner <= least ? most : left + below - corner;
}

template <typename Use>
void forEachTexel(const MapLevel& m, const Use& use) {
    for (uint32_t j = 0; j < m.height; ++j)
        for (uint32_t i = 0; i < m.width; ++i)
            if (m.isKnown[m.at(i, j)] != 0) use(m.at(i, j), before(m, i, j));
}

/// Of the texels of all patches: green, then red and blue without green's difference.
struct Written {
    std::array<Bytes, 3> colours;
    std::vector<uint16_t> normalX, normalY;
    Bytes materials;
    std::array<Bytes, 4> light;  ///< likewise, and what is above them

    void addLight(const MapLevel& m) {
        uint32_t last = 0;
        forEachTexel(m, [&](size_t t, const Before& b) {
            const uint32_t here = m.light[t];
            const auto off = [&](int c) {
                const auto of = [&](size_t s) { return channel(m.light[s], c); };
                return channel(here, c) - predicted(b, channel(last, c), of);
            };
            const uint32_t green = off(1);
            light[0].push_back(static_cast<uint8_t>(green));
            light[1].push_back(static_cast<uint8_t>(off(0) - green));
            light[2].push_back(static_cast<uint8_t>(off(2) - green));
            light[3].push_back(static_cast<uint8_t>(off(3)));
            last = here;
        });
    }

    void add(const MapLevel& m, const PatchMap& map) {
        uint32_t last = 0, lastNormal = 0;
        forEachTexel(m, [&](size_t t, const Before& b) {
            const uint32_t here = m.colours[t];
            const auto off = [&](int c) {
                const auto of = [&](size_t s) { return channel(m.colours[s], c); };
                return channel(here, c) - predicted(b, channel(last, c), of);
            };
            const uint32_t green = off(1);
            colours[0].push_back(static_cast<uint8_t>(green));
            colours[1].push_back(static_cast<uint8_t>(off(0) - green));
            colours[2].push_back(static_cast<uint8_t>(off(2) - green));
            if (map.hasMaterials) materials.push_back(static_cast<uint8_t>(off(3)));
            last = here;
            if (map.normals.empty()) return;
            const auto step = [&](size_t axis) {
                const auto of = [&](size_t s) { return stepsOf(m.normals[s], kMapNormalStep).at(axis); };
                const uint32_t before = stepsOf(lastNormal, kMapNormalStep).at(axis);
                return zigzag(static_cast<uint16_t>(of(t) - predicted(b, before, of)));
            };
            normalX.push_back(step(0));
            normalY.push_back(step(1));
            lastNormal = m.normals[t];
        });
    }
};

/// The same, read.
struct Plain {
    Bytes colours, normals, materials, light;
    size_t texels = 0, withNormals = 0, withMaterials = 0, withLight = 0;  ///< of all patches
    size_t next = 0, nextNormal = 0, nextMaterial = 0, nextLight = 0;

    void takeLight(MapLevel& m) {
        uint32_t last = 0;
        forEachTexel(m, [&](size_t t, const Before& b) {
            const auto value = [&](int c, size_t plane, uint32_t more) {
                const auto of = [&](size_t s) { return channel(m.light[s], c); };
                return ((predicted(b, channel(last, c), of) + light[plane * withLight + nextLight] + more) & 255u)
                       << (8 * c);
            };
            const uint32_t green = light[nextLight];
            m.light[t] = last = value(1, 0, 0) | value(0, 1, green) | value(2, 2, green) | value(3, 3, 0);
            ++nextLight;
        });
    }

    void take(MapLevel& m, const PatchMap& map, bool hasNormals) {
        uint32_t last = 0, lastNormal = 0;
        forEachTexel(m, [&](size_t t, const Before& b) {
            const auto value = [&](int c, uint32_t off) {
                const auto of = [&](size_t s) { return channel(m.colours[s], c); };
                return ((predicted(b, channel(last, c), of) + off) & 255u) << (8 * c);
            };
            const uint32_t green = colours[next], red = colours[texels + next], blue = colours[2 * texels + next];
            uint32_t here = value(1, green) | value(0, red + green) | value(2, blue + green);
            if (map.hasMaterials) here |= value(3, materials[nextMaterial++]);
            m.colours[t] = last = here;
            ++next;
            if (!hasNormals) return;
            const auto step = [&](size_t axis) {
                const auto of = [&](size_t s) { return stepsOf(m.normals[s], kMapNormalStep).at(axis); };
                const uint32_t before = stepsOf(lastNormal, kMapNormalStep).at(axis);
                const uint16_t off = unzigzag(fromPlanes(normals, axis * withNormals + nextNormal));
                return std::min((predicted(b, before, of) + off) & 0xffffu, uint32_t{65536 / kMapNormalStep});
            };
            m.normals[t] = lastNormal = codeOf(step(0), step(1), kMapNormalStep);
            ++nextNormal;
        });
    }
};

}  // namespace

PatchMapBytes encodeMaps(std::span<const Patch> patches) {
    PatchMapBytes out;
    Bytes has;
    Written written;
    for (const Patch& p : patches) {
        has.push_back(static_cast<uint8_t>(p.map.density | (p.map.normals.empty() ? 0 : kHasNormals) |
                                           (p.map.hasMaterials ? kHasMaterials : 0) |
                                           (p.map.light.empty() ? 0 : kHasLight)));
        if (!p.map.isThere()) continue;
        const MapLevel map = mapOf(p);
        if (p.map.density > 0) written.add(map, p.map);
        if (!p.map.light.empty()) written.addLight(map);
    }
    if (written.colours[0].empty() && written.light[0].empty()) return out;
    for (size_t k = 1; k < 3; ++k)
        written.colours[0].insert(written.colours[0].end(), written.colours.at(k).begin(), written.colours.at(k).end());
    written.normalX.insert(written.normalX.end(), written.normalY.begin(), written.normalY.end());
    const std::array<Bytes, kStreams> plain{std::move(has), std::move(written.colours[0]), planes(written.normalX),
                                            std::move(written.materials)};
    MapSizes sizes{};
    std::array<Bytes, kStreams> packed;
    for (size_t k = 0; k < kStreams; ++k) {
        packed.at(k) = compress(plain.at(k));
        sizes.packed.at(k) = static_cast<uint32_t>(packed.at(k).size());
        sizes.plain.at(k) = static_cast<uint32_t>(plain.at(k).size());
    }
    out.bytes.resize(sizeof(sizes));
    std::memcpy(out.bytes.data(), &sizes, sizeof(sizes));
    Bytes light;
    if (!written.light[0].empty()) {
        for (size_t k = 1; k < 4; ++k)
            written.light[0].insert(written.light[0].end(), written.light.at(k).begin(), written.light.at(k).end());
        light = compress(written.light[0]);
        const LightSizes more{static_cast<uint32_t>(light.size()), static_cast<uint32_t>(written.light[0].size())};
        out.bytes.resize(sizeof(sizes) + sizeof(more));
        std::memcpy(out.bytes.data() + sizeof(sizes), &more, sizeof(more));
        out.light = sizeof(more) + light.size();
    }
    for (const Bytes& b : packed) out.bytes.insert(out.bytes.end(), b.begin(), b.end());
    out.bytes.insert(out.bytes.end(), light.begin(), light.end());
    out.colours = sizeof(sizes) + packed[0].size() + packed[1].size();
    out.normals = packed[2].size();
    out.materials = packed[3].size();
    return out;
}

namespace {

constexpr uint64_t kTexelBytes = 4;  // of any stream, at most

/// What maps each patch has; false: others than are allowed, or so large that no streams of colours and light of those
/// sizes (bytes) justify them.
bool takeKinds(const Bytes& has, uint64_t colours, uint64_t light, const MapLimits& limits, std::span<Patch> patches) {
    const uint32_t mostDensity = limits.most & shared::kMapDensity;
    uint64_t grid = 0, drawn = 0, drawnLight = 0;
    for (size_t k = 0; k < patches.size(); ++k) {
        Patch& p = patches[k];
        p.map.density = has[k] & shared::kMapDensity;
        if (has[k] > 31 || (p.map.density == 0 && (has[k] & ~kHasLight) != 0) || p.map.density > mostDensity)
            return false;
        if ((has[k] & (kHasNormals | kHasLight) & ~limits.most) != 0) return false;
        if (has[k] == 0) continue;
        grid += ((uint64_t{p.width - 1} << p.map.density) + 1) * ((uint64_t{p.height - 1} << p.map.density) + 1);
        const uint64_t texels = uint64_t{p.drawnCells()} << 2 * p.map.density;  // at least
        drawn += p.map.density > 0 ? texels : 0;
        drawnLight += (has[k] & kHasLight) != 0 ? texels : 0;
    }
    return 3 * drawn <= colours && kTexelBytes * drawnLight <= light &&
           grid <= kMostTexels + kGridsABlock * texelsOfBlock(mostDensity) * limits.blocks;
}

}  // namespace

bool decodeMaps(std::span<const uint8_t> bytes, std::span<Patch> patches, const MapLimits& limits) {
    MapSizes sizes{};
    if (bytes.size() < sizeof(sizes)) return false;
    std::memcpy(&sizes, bytes.data(), sizeof(sizes));
    LightSizes more{};
    size_t at = sizeof(sizes);
    if (limits.hasLight) {
        if (bytes.size() < at + sizeof(more)) return false;
        std::memcpy(&more, bytes.data() + at, sizeof(more));
        at += sizeof(more);
    }
    uint64_t end = uint64_t{at} + more.packed;
    for (const uint32_t size : sizes.packed) end += size;
    const uint64_t mostTexels = texelsOfBlock(limits.most & shared::kMapDensity) * limits.blocks;
    if (end != bytes.size() || sizes.plain[0] != patches.size()) return false;
    for (const uint32_t plain : sizes.plain)
        if (plain > std::max<uint64_t>(kTexelBytes * mostTexels, patches.size())) return false;
    if (more.plain > kTexelBytes * mostTexels) return false;
    std::array<Bytes, kStreams> streams;
    for (size_t k = 0; k < kStreams; ++k) {
        auto stream = decompress(bytes.subspan(at, sizes.packed.at(k)), sizes.plain.at(k));
        if (!stream) return false;
        streams.at(k) = std::move(*stream);
        at += sizes.packed.at(k);
    }
    Plain plain;
    if (limits.hasLight) {
        auto stream = decompress(bytes.subspan(at, more.packed), more.plain);
        if (!stream || stream->empty()) return false;
        plain.light = std::move(*stream);
    }
    const Bytes& has = streams[0];
    if (!takeKinds(has, streams[1].size(), plain.light.size(), limits, patches)) return false;
    std::vector<MapLevel> levels(patches.size());
    for (size_t k = 0; k < patches.size(); ++k) {
        Patch& p = patches[k];
        if (has[k] == 0) continue;
        levels[k] = mapOf(p);
        const auto known = static_cast<size_t>(std::count(levels[k].isKnown.begin(), levels[k].isKnown.end(), 1));
        plain.texels += p.map.density > 0 ? known : 0;
        plain.withLight += (has[k] & kHasLight) != 0 ? known : 0;
        plain.withNormals += (has[k] & kHasNormals) != 0 ? known : 0;
        p.map.hasMaterials = (has[k] & kHasMaterials) != 0;
        plain.withMaterials += p.map.hasMaterials ? known : 0;
    }
    plain.colours = std::move(streams[1]);
    plain.normals = std::move(streams[2]);
    plain.materials = std::move(streams[3]);
    if (plain.texels + plain.withLight == 0 || plain.colours.size() != 3 * plain.texels ||
        plain.normals.size() != 4 * plain.withNormals || plain.materials.size() != plain.withMaterials ||
        plain.light.size() != kTexelBytes * plain.withLight)
        return false;
    for (size_t k = 0; k < patches.size(); ++k) {
        Patch& p = patches[k];
        MapLevel& m = levels[k];
        if ((has[k] & kHasLight) != 0) {
            m.light.assign(m.isKnown.size(), 0);
            plain.takeLight(m);
            p.map.light = std::move(m.light);
        }
        if (p.map.density == 0) continue;
        const bool hasNormals = (has[k] & kHasNormals) != 0;
        m.colours.assign(m.isKnown.size(), 0);
        if (hasNormals) m.normals.assign(m.isKnown.size(), 0);
        plain.take(m, p.map, hasNormals);
        p.map.colours = std::move(m.colours);
        p.map.normals = std::move(m.normals);
        m = {};
    }
    return true;
}

}  // namespace stipple::lod
