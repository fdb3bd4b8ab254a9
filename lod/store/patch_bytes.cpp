#include "lod/store/patch_bytes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <functional>
#include <optional>

#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_blocks.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/patch_map_bytes.h"
#include "lod/store/smooth_streams.h"
#include "shaders/shared/patch.h"

namespace stipple::lod {

using namespace streams;

namespace {

/// Of roundedNormal: codes 0, s - 1, 2 s - 1 ... 65534. Mirrors have finer ones than the usual.
constexpr uint32_t kUsualStep = 32;
constexpr uint32_t kNoNormal = 32767u | 32767u << 16;  ///< up: what a first one is compared with
enum class NormalFrom : uint8_t { neighbour, slope };

struct Head {
    double origin[3];  // NOLINT: as it lies in the bytes
    double errorToSource, errorFromSource;
    float turn[4];  // NOLINT: x y z w
    float step;
    int32_t quantumExponent;
    uint32_t width, height;
};
static_assert(sizeof(Head) == 72);

/// Sizes of the streams that follow, packed and not.
struct Sizes {
    uint32_t patches;
    NormalFrom normalFrom;
    uint8_t hasMaterials;            ///< 1: SizesOfMaterials follow
    uint8_t finerNormals;            ///< log2 of kUsualStep / their step
    uint8_t hasMaps;                 ///< 1: SizeOfMaps follows; 2: and some have light of their own
    std::array<uint32_t, 5> packed;  ///< heads, cells, heights, normals, colours
    std::array<uint32_t, 5> plain;
};
static_assert(sizeof(Sizes) == 48);
/// Of a stream behind the others.
struct SizesOfMaterials {
    uint32_t packed, plain;
};
/// Of the bytes of maps (patch_map_bytes.h), the last of all.
struct SizeOfMaps {
    uint32_t bytes;
};

/// What is known of a sample from those before it. `value` in use: those whose height is not 0.
uint16_t predictedHeight(const Patch& p, uint32_t i, uint32_t j, uint16_t last) {
    const size_t s = p.at(i, j);
    const uint16_t left = i > 0 ? p.heights[s - 1] : uint16_t{0}, below = j > 0 ? p.heights[s - p.width] : uint16_t{0};
    const uint16_t corner = i > 0 && j > 0 ? p.heights[s - p.width - 1] : uint16_t{0};
    if (left != 0 && below != 0 && corner != 0) return static_cast<uint16_t>(left + below - corner);
    return left != 0 ? left : below != 0 ? below : last;
}

template <typename Value>
Value neighbour(const Patch& p, const std::vector<Value>& values, uint32_t i, uint32_t j, Value last) {
    const size_t s = p.at(i, j);
    if (i > 0 && p.heights[s - 1] != 0) return values[s - 1];
    if (j > 0 && p.heights[s - p.width] != 0) return values[s - p.width];
    return last;
}

uint32_t normalOfSlope(const Patch& p, uint32_t i, uint32_t j) {
    const size_t s = p.at(i, j);
    const auto slope = [&](bool hasLow, bool hasHigh, size_t stride) {
        const int here = p.heights[s];
        const int low = hasLow && p.heights[s - stride] != 0 ? p.heights[s - stride] : -1;
        const int high = hasHigh && p.heights[s + stride] != 0 ? p.heights[s + stride] : -1;
        if (low < 0 && high < 0) return 0.0f;
        const int rise = (high < 0 ? here : high) - (low < 0 ? here : low);
        return static_cast<float>(rise) / (low < 0 || high < 0 ? 1.0f : 2.0f);
    };
    const auto quanta = static_cast<float>(double{p.step} / p.quantum());
    const float x = slope(i > 0, i + 1 < p.width, 1), y = slope(j > 0, j + 1 < p.height, p.width);
    return roundedNormal({-x, -y, std::clamp(quanta, 1e-6f, 1e9f)});
}

uint32_t predictedNormal(const Patch& p, uint32_t i, uint32_t j, uint32_t last, NormalFrom from) {
    return from == NormalFrom::slope ? normalOfSlope(p, i, j) : neighbour(p, p.normals, i, j, last);
}

template <typename Use>
void forEachSample(const Patch& p, const Use& use) {
    for (uint32_t j = 0; j < p.height; ++j)
        for (uint32_t i = 0; i < p.width; ++i)
            if (p.heights[p.at(i, j)] != 0) use(i, j);
}

/// log2 of kUsualStep / the largest step that all normals stand on.
uint8_t finerNormals(std::span<const Patch> patches) {
    uint8_t finer = 0;
    for (const Patch& p : patches)
        forEachSample(p, [&](uint32_t i, uint32_t j) {
            const uint32_t code = p.normals[p.at(i, j)];
            const auto stands = [&](uint32_t step) {
                const auto steps = stepsOf(code, step);
                return codeOf(steps[0], steps[1], step) == code;
            };
            while ((kUsualStep >> finer) > 2 && !stands(kUsualStep >> finer)) ++finer;
        });
    return finer;
}

Bytes normalBytes(std::span<const Patch> patches, NormalFrom from, uint32_t step) {
    std::vector<uint16_t> x, y;
    for (const Patch& p : patches) {
        uint32_t last = kNoNormal;
        forEachSample(p, [&](uint32_t i, uint32_t j) {
            const auto predicted = stepsOf(predictedNormal(p, i, j, last, from), step);
            last = p.normals[p.at(i, j)];
            const auto steps = stepsOf(last, step);
            x.push_back(zigzag(static_cast<uint16_t>(steps[0] - predicted[0])));
            y.push_back(zigzag(static_cast<uint16_t>(steps[1] - predicted[1])));
        });
    }
    x.insert(x.end(), y.begin(), y.end());
    return planes(x);
}

Bytes colourBytes(std::span<const Patch> patches) {
    std::array<Bytes, 3> out;
    for (const Patch& p : patches) {
        if (p.map.density > 0) continue;
        uint32_t last = 0;
        forEachSample(p, [&](uint32_t i, uint32_t j) {
            const uint32_t before = neighbour(p, p.colours, i, j, last);
            last = p.colours[p.at(i, j)];
            const uint32_t green = channel(last, 1) - channel(before, 1);
            out[0].push_back(static_cast<uint8_t>(green));
            out[1].push_back(static_cast<uint8_t>(channel(last, 0) - channel(before, 0) - green));
            out[2].push_back(static_cast<uint8_t>(channel(last, 2) - channel(before, 2) - green));
        });
    }
    for (size_t k = 1; k < 3; ++k) out[0].insert(out[0].end(), out.at(k).begin(), out.at(k).end());
    return out[0];
}

/// Minus the neighbour's; empty where all patches have the first material.
Bytes materialBytes(std::span<const Patch> patches) {
    Bytes out;
    bool hasOther = false;
    for (const Patch& p : patches) {
        uint8_t last = 0;
        forEachSample(p, [&](uint32_t i, uint32_t j) {
            const uint8_t here = p.materials.empty() ? uint8_t{0} : p.materials[p.at(i, j)];
            const uint8_t before = p.materials.empty() ? uint8_t{0} : neighbour(p, p.materials, i, j, last);
            hasOther = hasOther || here != 0;
            out.push_back(static_cast<uint8_t>(here - before));
            last = here;
        });
    }
    return hasOther ? out : Bytes();
}

}  // namespace

PatchBytes encodePatches(std::span<const Patch> patches) {
    Bytes heads, cells;
    std::vector<uint16_t> heights;
    for (const Patch& p : patches) {
        Head h{};
        for (int k = 0; k < 3; ++k) h.origin[k] = p.origin[k];
        for (int k = 0; k < 4; ++k) h.turn[k] = p.turn[k];
        h.step = p.step;
        h.quantumExponent = p.quantumExponent;
        h.width = p.width;
        h.height = p.height;
        h.errorToSource = p.errorToSource;
        h.errorFromSource = p.errorFromSource;
        heads.resize(heads.size() + sizeof(h));
        std::memcpy(heads.data() + heads.size() - sizeof(h), &h, sizeof(h));
        const size_t first = cells.size();
        cells.resize(first + (p.cells.size() + 7) / 8);
        for (size_t c = 0; c < p.cells.size(); ++c)
            if (p.cells[c] != 0) cells[first + c / 8] |= static_cast<uint8_t>(1u << (c % 8));
        uint16_t last = 0;
        forEachSample(p, [&](uint32_t i, uint32_t j) {
            const uint16_t code = p.heights[p.at(i, j)];
            heights.push_back(zigzag(static_cast<uint16_t>(code - predictedHeight(p, i, j, last))));
            last = code;
        });
    }
    const uint8_t finer = finerNormals(patches);
    const Bytes fromNeighbour = normalBytes(patches, NormalFrom::neighbour, kUsualStep >> finer),
                fromSlope = normalBytes(patches, NormalFrom::slope, kUsualStep >> finer);
    const Bytes packedNeighbour = compress(fromNeighbour), packedSlope = compress(fromSlope);
    const bool bySlope = packedSlope.size() < packedNeighbour.size();
    const Bytes plainHeights = planes(heights), colours = colourBytes(patches);
    const std::array<Bytes, 5> packed{compress(heads), compress(cells), compress(plainHeights),
                                      bySlope ? packedSlope : packedNeighbour, compress(colours)};
    Sizes sizes{};
    sizes.patches = static_cast<uint32_t>(patches.size());
    sizes.finerNormals = finer;
    sizes.normalFrom = bySlope ? NormalFrom::slope : NormalFrom::neighbour;
    for (size_t k = 0; k < 5; ++k) sizes.packed.at(k) = static_cast<uint32_t>(packed.at(k).size());
    sizes.plain = {static_cast<uint32_t>(heads.size()), static_cast<uint32_t>(cells.size()),
                   static_cast<uint32_t>(plainHeights.size()), static_cast<uint32_t>(fromSlope.size()),
                   static_cast<uint32_t>(colours.size())};
    const Bytes plainMaterials = materialBytes(patches), materials = compress(plainMaterials);
    sizes.hasMaterials = plainMaterials.empty() ? 0 : 1;
    const PatchMapBytes maps = encodeMaps(patches);
    sizes.hasMaps = maps.bytes.empty() ? 0 : maps.light == 0 ? 1 : 2;
    const auto add = [](Bytes& to, const auto& value) {
        to.resize(to.size() + sizeof(value));
        std::memcpy(to.data() + to.size() - sizeof(value), &value, sizeof(value));
    };
    PatchBytes out;
    add(out.bytes, sizes);
    if (sizes.hasMaterials != 0)
        add(out.bytes,
            SizesOfMaterials{static_cast<uint32_t>(materials.size()), static_cast<uint32_t>(plainMaterials.size())});
    if (sizes.hasMaps != 0) add(out.bytes, SizeOfMaps{static_cast<uint32_t>(maps.bytes.size())});
    for (const Bytes& b : packed) out.bytes.insert(out.bytes.end(), b.begin(), b.end());
    if (sizes.hasMaterials != 0) {
        out.bytes.insert(out.bytes.end(), materials.begin(), materials.end());
        out.materials = sizeof(SizesOfMaterials) + materials.size();
    }
    out.bytes.insert(out.bytes.end(), maps.bytes.begin(), maps.bytes.end());
    out.mapColours = maps.colours + (sizes.hasMaps != 0 ? sizeof(SizeOfMaps) : 0);
    out.mapNormals = maps.normals;
    out.mapMaterials = maps.materials;
    out.mapLight = maps.light;
    out.geometry = sizeof(sizes) + packed[0].size() + packed[1].size() + packed[2].size();
    out.normals = packed[3].size();
    out.colours = packed[4].size();
    return out;
}

namespace {

/// Bounds of what a file may say of itself.
constexpr uint64_t kMostSamples = uint64_t{1} << 28;
/// Cells of a patch at most: so many, and so many more for each that is drawn (builds make far fewer).
constexpr uint64_t kMostCells = uint64_t{1} << 16, kCellsADrawn = 256;
/// Of all patches: so many, and so many more for each of their blocks. Builds divide what is mostly empty, and a
/// segment that hangs together crosses an eighth of its grid's blocks at least.
constexpr uint64_t kCellsABlock = uint64_t{8} * shared::kPatchCellsAcross * shared::kPatchCellsUp;

bool readHead(const Bytes& heads, size_t k, Patch& p) {
    Head h{};
    std::memcpy(&h, heads.data() + k * sizeof(h), sizeof(h));
    if (h.width < 2 || h.height < 2 || h.width > Patch::kMostSide || h.height > Patch::kMostSide) return false;
    for (int a = 0; a < 3; ++a) p.origin[a] = h.origin[a];
    for (int a = 0; a < 4; ++a) p.turn[a] = h.turn[a];
    p.step = h.step;
    p.quantumExponent = h.quantumExponent;
    p.width = h.width;
    p.height = h.height;
    p.errorToSource = h.errorToSource;
    p.errorFromSource = h.errorFromSource;
    return true;
}

/// Marks the samples beside cells with 1; returns their number.
size_t markSamples(Patch& p) {
    p.heights.assign(size_t{p.width} * p.height, 0);
    for (uint32_t j = 0; j + 1 < p.height; ++j)
        for (uint32_t i = 0; i + 1 < p.width; ++i)
            if (p.hasCell(i, j))
                for (const size_t s : {p.at(i, j), p.at(i + 1, j), p.at(i, j + 1), p.at(i + 1, j + 1)})
                    p.heights[s] = 1;
    return p.samples();
}

/// Values in the order of samples, over all patches.
struct Plain {
    Bytes heads, cells, heights, normals, colours;
    Bytes materials;  ///< empty: all have the first
    size_t samples = 0, next = 0;
    size_t coloured = 0, nextColour = 0;  ///< of patches without maps
};

/// False where a code is 0, which says "no sample".
bool readSamples(Patch& p, Plain& plain, NormalFrom from, uint32_t normalStep) {
    const size_t first = plain.next;
    uint16_t last = 0;
    std::vector<uint16_t> marks = std::move(p.heights);
    p.heights.assign(marks.size(), 0);
    const auto forEachMark = [&](const auto& use) {
        plain.next = first;
        for (uint32_t j = 0; j < p.height; ++j)
            for (uint32_t i = 0; i < p.width; ++i)
                if (marks[p.at(i, j)] != 0) use(i, j, plain.next++);
    };
    bool isWhole = true;
    forEachMark([&](uint32_t i, uint32_t j, size_t k) {
        last = static_cast<uint16_t>(predictedHeight(p, i, j, last) + unzigzag(fromPlanes(plain.heights, k)));
        p.heights[p.at(i, j)] = last;
        isWhole = isWhole && last != 0;
    });
    if (!isWhole) return false;
    p.normals.assign(marks.size(), 0);
    p.colours.assign(marks.size(), 0);
    uint32_t normal = kNoNormal, colour = 0;
    uint8_t material = 0;
    if (!plain.materials.empty()) p.materials.assign(marks.size(), 0);
    forEachMark([&](uint32_t i, uint32_t j, size_t k) {
        const auto predicted = stepsOf(predictedNormal(p, i, j, normal, from), normalStep);
        const auto step = [&](size_t axis) {
            const uint16_t difference = unzigzag(fromPlanes(plain.normals, axis * plain.samples + k));
            return std::min((predicted.at(axis) + difference) & 0xffffu, 65536 / normalStep);
        };
        p.normals[p.at(i, j)] = normal = codeOf(step(0), step(1), normalStep);
        if (p.map.density == 0) {
            const uint32_t before = neighbour(p, p.colours, i, j, colour), green = plain.colours[plain.nextColour];
            const auto value = [&](int c, size_t plane, uint32_t more) {
                const size_t at = plane * plain.coloured + plain.nextColour;
                return ((channel(before, c) + plain.colours[at] + more) & 255u) << (8 * c);
            };
            p.colours[p.at(i, j)] = colour = value(1, 0, 0) | value(0, 1, green) | value(2, 2, green);
            ++plain.nextColour;
        }
        if (p.materials.empty()) return;
        material = static_cast<uint8_t>(neighbour(p, p.materials, i, j, material) + plain.materials[k]);
        p.materials[p.at(i, j)] = material;
    });
    sampleColours(p);
    return true;
}

}  // namespace

Result<std::vector<Patch>> decodePatches(std::span<const uint8_t> bytes, const std::string& where,
                                         const PatchLimits& told) {
    const auto damaged = [&] { return fail(ErrorKind::input, "patches are damaged", where, "build it again"); };
    Sizes sizes{};
    if (bytes.size() < sizeof(sizes)) return damaged();
    std::memcpy(&sizes, bytes.data(), sizeof(sizes));
    if ((kUsualStep >> std::min<uint32_t>(sizes.finerNormals, 8)) < 2) return damaged();
    SizesOfMaterials more{};
    size_t at = sizeof(sizes);
    if (sizes.hasMaterials != 0) {
        if (sizes.hasMaterials != 1 || bytes.size() < at + sizeof(more)) return damaged();
        std::memcpy(&more, bytes.data() + at, sizeof(more));
        at += sizeof(more);
    }
    SizeOfMaps maps{};
    if (sizes.hasMaps != 0) {
        if (sizes.hasMaps > 2 || bytes.size() < at + sizeof(maps)) return damaged();
        std::memcpy(&maps, bytes.data() + at, sizeof(maps));
        at += sizeof(maps);
    }
    uint64_t end = uint64_t{at} + more.packed + maps.bytes;
    for (const uint32_t size : sizes.packed) end += size;
    constexpr uint64_t kSamplesABlock = 17 * 9, kHeight = 2, kNormal = 4, kColour = 3;
    const uint64_t most = told.blocks * kSamplesABlock;
    const uint64_t mostCells = kMostCells + kCellsABlock * std::min(told.blocks, kMostSamples);
    if (sizes.patches > told.blocks || sizes.plain[1] > mostCells / 8 + sizes.patches ||
        sizes.plain[2] > kHeight * most || sizes.plain[3] > kNormal * most || sizes.plain[4] > kColour * most ||
        more.plain > most || sizes.normalFrom > NormalFrom::slope)
        return damaged();
    if (end != bytes.size() || sizes.plain[0] != uint64_t{sizes.patches} * sizeof(Head)) return damaged();
    Plain plain;
    std::array<Bytes*, 5> streams{&plain.heads, &plain.cells, &plain.heights, &plain.normals, &plain.colours};
    for (size_t k = 0; k < 5; ++k) {
        auto stream = decompress(bytes.subspan(at, sizes.packed.at(k)), sizes.plain.at(k));
        if (!stream) return damaged();
        *streams.at(k) = std::move(*stream);
        at += sizes.packed.at(k);
    }
    if (sizes.hasMaterials != 0) {
        auto stream = decompress(bytes.subspan(at, more.packed), more.plain);
        if (!stream || stream->empty()) return damaged();
        plain.materials = std::move(*stream);
        at += more.packed;
    }
    std::vector<Patch> out(sizes.patches);
    size_t cell = 0;
    uint64_t grid = 0, allCells = 0, blocks = 0;
    for (size_t k = 0; k < out.size(); ++k) {
        Patch& p = out[k];
        if (!readHead(plain.heads, k, p)) return damaged();
        const size_t cells = size_t{p.width - 1} * (p.height - 1);
        grid += size_t{p.width} * p.height;
        if ((cells + 7) / 8 > plain.cells.size() - cell || grid > kMostSamples) return damaged();
        uint64_t drawn = 0;
        for (size_t byte = 0; byte < (cells + 7) / 8; ++byte)
            drawn += static_cast<uint64_t>(std::popcount(plain.cells[cell + byte]));
        // Of each, and of all together: no memory is taken for what draws next to nothing.
        allCells += cells;
        if (cells > kMostCells + kCellsADrawn * drawn || allCells > mostCells) return damaged();
        p.cells.resize(cells);
        for (size_t c = 0; c < cells; ++c) p.cells[c] = plain.cells[cell + c / 8] >> (c % 8) & 1u;
        cell += (cells + 7) / 8;
        blocks += countBlocks(p);
        if (blocks > told.blocks || allCells > kMostCells + kCellsABlock * blocks) return damaged();
        plain.samples += markSamples(p);
    }
    if (sizes.hasMaps != 0 && !decodeMaps(bytes.subspan(at), out, {blocks, told.map, sizes.hasMaps == 2}))
        return damaged();
    for (const Patch& p : out) plain.coloured += p.map.density == 0 ? p.samples() : 0;
    if (cell != plain.cells.size() || plain.heights.size() != 2 * plain.samples ||
        plain.normals.size() != 4 * plain.samples || plain.colours.size() != 3 * plain.coloured ||
        (!plain.materials.empty() && plain.materials.size() != plain.samples))
        return damaged();
    for (Patch& p : out)
        if (!readSamples(p, plain, sizes.normalFrom, kUsualStep >> sizes.finerNormals) || !patchFault(p).empty())
            return damaged();
    return out;
}

uint64_t mapBytesOf(std::span<const uint8_t> bytes) {
    static_assert(kPatchHeadBytes >= sizeof(Sizes) + sizeof(SizesOfMaterials) + sizeof(SizeOfMaps));
    Sizes sizes{};
    if (bytes.size() < kPatchHeadBytes) return 0;
    std::memcpy(&sizes, bytes.data(), sizeof(sizes));
    if (sizes.hasMaps == 0) return 0;
    SizeOfMaps maps{};
    const size_t at = sizeof(sizes) + (sizes.hasMaterials != 0 ? sizeof(SizesOfMaterials) : 0);
    std::memcpy(&maps, bytes.data() + at, sizeof(maps));
    return maps.bytes;
}

}  // namespace stipple::lod
