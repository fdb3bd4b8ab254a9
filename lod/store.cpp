#include "lod/store.h"

#include <fmt/format.h>
#include <zstd.h>

#include <bit>
#include <cstring>
#include <type_traits>

#include "engine/base/hash.h"
#include "lod/attributes.h"
#include "lod/description.h"

namespace stipple::lod {
namespace {

static_assert(std::endian::native == std::endian::little, "the store is little-endian and copied as it is");

constexpr uint64_t kMagic = 0x31454c5050495453ull;      // "STIPPLE1"
constexpr uint64_t kFootMagic = 0x444e45454c505053ull;  // "SPPLEEND"
constexpr uint64_t kSizeLimit = uint64_t{1} << 40;      // of an uncompressed table

struct Section {
    uint64_t offset, bytes, rawBytes, hash;
};

struct Head {
    uint64_t magic;
    uint32_t version, rootLog2;
    std::array<double, 3> origin;
    double unit, smallestError;
    uint64_t nodeCount, fileBytes, contentHash;
    Section nodes, counts, description, mesh;
    uint64_t hash;  // of everything before
};
static_assert(sizeof(Head) == 16 + 24 + 16 + 24 + 128 + 8 && std::is_trivially_copyable_v<Head>);

struct Foot {
    uint64_t headHash, magic;
};

struct NodeOnDisk {
    std::array<double, 4> sphere;
    uint64_t chunkOffset, chunkHash, attributeHash;
    std::array<uint32_t, 3> cell;
    uint32_t parent, firstChild, records, chunkBytes, attributeBytes, parentCodes, ownCodes, normalCone;
    float normalConeCosine;
    uint8_t level, childMask, errorCode;
    int8_t stepShift;
};
static_assert(sizeof(NodeOnDisk) == 32 + 24 + 12 + 32 + 4 + 4 + 4);  // the last for alignment

/// (code, count) of one code that occurs in a node.
struct CodeCount {
    uint32_t code, count;
};

std::vector<uint8_t> packed(const void* bytes, size_t count) {
    std::vector<uint8_t> out(ZSTD_compressBound(count));
    out.resize(ZSTD_compress(out.data(), out.size(), bytes, count, 3));
    return out;
}

Error damaged(const std::string& where, const std::string& what) {
    return Error{ErrorKind::input, what, where, "the store is damaged or not whole; build it again"};
}

/// Turns (code, count) pairs into the step function of CodeCounts.
CodeCounts makeCounts(const CodeCount* pairs, uint32_t count, std::vector<uint32_t>& greaterThan) {
    CodeCounts counts;
    counts.first = static_cast<uint32_t>(greaterThan.size());
    if (count == 0) return counts;
    counts.lo = static_cast<uint8_t>(pairs[0].code);
    counts.hi = static_cast<uint8_t>(pairs[count - 1].code);
    uint32_t left = 0;
    for (uint32_t i = 0; i < count; ++i) left += pairs[i].count;
    uint32_t next = 0;
    for (uint32_t code = counts.lo; code < counts.hi; ++code) {
        if (pairs[next].code == code) left -= pairs[next++].count;
        greaterThan.push_back(left);
    }
    return counts;
}

void appendPairs(const Hierarchy& h, const CodeCounts& c, uint32_t records, std::vector<CodeCount>& out, uint32_t& n) {
    n = 0;
    uint32_t before = records;
    for (uint32_t code = c.lo; code <= c.hi && before > 0; ++code) {
        const uint32_t after = h.countGreater(c, records, code);
        if (before != after) {
            out.push_back({code, before - after});
            ++n;
        }
        before = after;
    }
}

Result<std::vector<uint8_t>> readSection(const InputFile& file, const Section& s, const char* name) {
    const std::string where = fmt::format("{}: {}", file.path(), name);
    if (s.offset > file.sizeBytes() || s.bytes > file.sizeBytes() - s.offset)
        return tl::unexpected(
            damaged(where, fmt::format("{} bytes at offset {} lie outside the file", s.bytes, s.offset)));
    // zstd gains at most about 2^17 to 1 on the densest input; a head that claims more lies.
    if (s.rawBytes > kSizeLimit || s.rawBytes / 131072 > s.bytes)
        return tl::unexpected(damaged(where, fmt::format("{} bytes cannot come from {}", s.rawBytes, s.bytes)));
    std::vector<uint8_t> bytes(s.bytes);
    STIPPLE_TRY(file.readAt(s.offset, bytes.data(), bytes.size()));
    if (hashBytes(bytes.data(), bytes.size()) != s.hash)
        return tl::unexpected(damaged(where, "the hash does not match"));
    std::vector<uint8_t> raw(s.rawBytes);
    const size_t got = ZSTD_decompress(raw.data(), raw.size(), bytes.data(), bytes.size());
    if (ZSTD_isError(got) || got != raw.size()) return tl::unexpected(damaged(where, "cannot be decompressed"));
    return raw;
}

/// Of the mesh section: the counts, then groups, runs and parents.
struct MeshHead {
    uint64_t groups, runs, parents, groupTextures, textures, tiles;
};

std::vector<uint8_t> meshBytes(const Hierarchy& h) {
    const MeshHead head{h.groups.size(),        h.runs.size(),     h.parents.size(),
                        h.groupTextures.size(), h.textures.size(), h.tiles.size()};
    std::vector<uint8_t> out;
    const auto append = [&](const void* from, size_t count) {
        const auto* bytes = static_cast<const uint8_t*>(from);
        out.insert(out.end(), bytes, bytes + count);
    };
    append(&head, sizeof(head));
    append(h.groups.data(), h.groups.size() * sizeof(MeshGroup));
    append(h.runs.data(), h.runs.size() * sizeof(MeshRun));
    append(h.parents.data(), h.parents.size() * sizeof(uint32_t));
    append(h.groupTextures.data(), h.groupTextures.size() * sizeof(uint32_t));
    append(h.textures.data(), h.textures.size() * sizeof(shared::TextureInfo));
    append(h.tiles.data(), h.tiles.size() * sizeof(TextureTile));
    return out;
}

Result<void> readMesh(const std::vector<uint8_t>& bytes, const std::string& path, Hierarchy& h) {
    MeshHead head{};
    const auto bad = [&] { return tl::unexpected(damaged(path, "the groups of the mesh are not possible")); };
    if (bytes.size() < sizeof(head)) return bad();
    std::memcpy(&head, bytes.data(), sizeof(head));
    const uint64_t most = bytes.size();  // of each, so that the sums below cannot overflow
    if (std::max({head.groups, head.runs, head.parents, head.groupTextures, head.textures, head.tiles}) > most ||
        sizeof(head) + head.groups * sizeof(MeshGroup) + head.runs * sizeof(MeshRun) +
                (head.parents + head.groupTextures) * 4 + head.textures * sizeof(shared::TextureInfo) +
                head.tiles * sizeof(TextureTile) !=
            bytes.size())
        return bad();
    if (head.groups != 0 && head.groups != h.nodes.size()) return bad();
    const uint8_t* at = bytes.data() + sizeof(head);
    const auto take = [&](auto& to, uint64_t count) {
        to.resize(count);
        if (count > 0) std::memcpy(to.data(), at, count * sizeof(to[0]));
        at += count * sizeof(to[0]);
    };
    take(h.groups, head.groups);
    take(h.runs, head.runs);
    take(h.parents, head.parents);
    take(h.groupTextures, head.groupTextures);
    take(h.textures, head.textures);
    take(h.tiles, head.tiles);
    return {};
}

/// Every level of a texture has its tiles, and they lie in the file.
Result<void> checkTextures(const Store& store, uint64_t chunksEnd) {
    const Hierarchy& h = store.hierarchy;
    uint64_t tiles = 0;
    bool fits = true;
    for (const shared::TextureInfo& t : h.textures) {
        fits = fits && t.width > 0 && t.height > 0 && t.width <= 65536 && t.height <= 65536 && t.levels > 0 &&
               t.levels <= shared::kTextureLevels && t.wrapU <= 2 && t.wrapV <= 2;
        for (uint32_t l = 0; fits && l < t.levels; ++l) {
            fits = t.firstTile[l] == tiles;
            tiles += uint64_t{shared::tilesAcross(t.width, l)} * shared::tilesAcross(t.height, l);
        }
    }
    fits = fits && tiles == h.tiles.size();
    for (const TextureTile& t : h.tiles) fits = fits && t.offset <= chunksEnd && t.bytes <= chunksEnd - t.offset;
    for (const uint32_t t : h.groupTextures) fits = fits && t < h.textures.size();
    for (const MeshGroup& g : h.groups)
        fits = fits && uint64_t{g.firstTexture} + g.textures <= h.groupTextures.size() &&
               std::isfinite(g.lowU + g.lowV + g.highU + g.highV + g.uvPerStep);
    for (const shared::SurfaceMaterial& m : store.description.materials)
        for (const shared::TextureSlot* slot :
             {&m.baseTexture, &m.surfaceTexture, &m.normalTexture, &m.occlusionTexture, &m.emissiveTexture})
            fits = fits && slot->texture <= h.textures.size();
    if (!fits) return tl::unexpected(damaged(store.path, "the textures of the mesh are not possible"));
    return {};
}

/// The same for groups: parents before children, producers after the groups that hold what they gave.
Result<void> checkGroups(const Store& store, uint64_t chunksEnd) {
    const Hierarchy& h = store.hierarchy;
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        const Node& n = h.nodes[i];
        const MeshGroup& g = h.groups[i];
        bool fits = n.chunkOffset <= chunksEnd && n.chunkBytes <= chunksEnd - n.chunkOffset && n.attributeBytes == 0 &&
                    std::isfinite(n.radius) && n.radius >= 0 && std::isfinite(n.centre.x + n.centre.y + n.centre.z) &&
                    uint64_t{g.firstRun} + g.runs <= h.runs.size() && g.runs > 0 &&
                    uint64_t{g.firstParent} + g.parents <= h.parents.size() &&
                    (g.parents > 0) == (n.errorCode != 255) && (i > 0 || g.parents == 0);
        // Each vertex of a cluster is used and each cluster has a triangle, so sizes that agree with a chunk of these
        // bytes are bounded; zstd gains at most about 2^17 to 1.
        fits = fits && (uint64_t{g.vertices} * 32 + uint64_t{n.records} * 4) / 131072 <= n.chunkBytes;
        uint64_t triangles = 0, clusters = 0;
        for (uint32_t r = 0; fits && r < g.runs; ++r) {
            const MeshRun& run = h.runs[g.firstRun + r];
            fits = run.firstCluster == clusters &&
                   (run.producer == MeshRun::kOriginal || (run.producer > i && run.producer < h.nodes.size()));
            clusters += run.clusters;
            triangles += run.triangles;
        }
        for (uint32_t k = 0; fits && k < g.parents; ++k) fits = h.parents[g.firstParent + k] < i;
        if (!fits || triangles != n.records || clusters != g.clusters || n.records == 0)
            return tl::unexpected(damaged(store.path, fmt::format("group {} of the mesh is not possible", i)));
    }
    return {};
}

/// What selectCut and the streamer index with must be in range before anyone uses it.
Result<void> checkNodes(const Store& store, uint64_t chunksEnd) {
    const auto& nodes = store.hierarchy.nodes;
    for (size_t i = 0; i < nodes.size(); ++i) {
        const Node& n = nodes[i];
        const auto children = static_cast<uint64_t>(__builtin_popcount(n.childMask));
        const bool childrenFit = n.isLeaf() || (n.firstChild > i && n.firstChild + children <= nodes.size());
        const bool parentFits = i == 0 ? n.level == 0 : n.parent < i && nodes[n.parent].level + 1 == n.level;
        const bool chunkFits =
            n.chunkOffset <= chunksEnd && uint64_t{n.chunkBytes} + n.attributeBytes <= chunksEnd - n.chunkOffset;
        const bool finite =
            std::isfinite(n.radius) && n.radius >= 0 && std::isfinite(n.centre.x + n.centre.y + n.centre.z);
        if (!childrenFit || !parentFits || !chunkFits || !finite || n.records == 0 ||
            n.level > store.hierarchy.rootLog2 ||
            n.stepShift != static_cast<int>(store.hierarchy.rootLog2) - n.level - (store.hierarchy.isLoose() ? 15 : 16))
            return tl::unexpected(damaged(store.path, fmt::format("node {} of the node table is not possible", i)));
    }
    return {};
}

}  // namespace

Result<StoreWriter> StoreWriter::create(const std::string& path) {
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    const Head empty{};
    STIPPLE_TRY(file.append(&empty, sizeof(empty)));
    return StoreWriter(std::move(file));
}

Result<StoreWriter> StoreWriter::resume(const std::string& path, const std::string& temporaryPath, uint64_t bytes) {
    STIPPLE_ASSIGN(OutputFile file, OutputFile::resume(path, temporaryPath, bytes));
    const Head empty{};
    if (bytes == 0) STIPPLE_TRY(file.append(&empty, sizeof(empty)));
    return StoreWriter(std::move(file));
}

Result<uint64_t> StoreWriter::appendEncoded(const std::vector<uint8_t>& bytes) {
    const uint64_t at = file_.position();
    STIPPLE_TRY(file_.append(bytes.data(), bytes.size()));
    return at;
}

Result<void> StoreWriter::appendChunk(const std::vector<uint8_t>& bytes, const std::vector<uint8_t>& attributes,
                                      Node& node) {
    node.chunkOffset = file_.position();
    node.chunkBytes = static_cast<uint32_t>(bytes.size());
    node.chunkHash = hashBytes(bytes.data(), bytes.size());
    node.attributeBytes = static_cast<uint32_t>(attributes.size());
    node.attributeHash = hashBytes(attributes.data(), attributes.size());
    STIPPLE_TRY(file_.append(bytes.data(), bytes.size()));
    return attributes.empty() ? Result<void>() : file_.append(attributes.data(), attributes.size());
}

Result<void> StoreWriter::finish(const Hierarchy& h, const StoreDescription& description) {
    std::vector<NodeOnDisk> nodes;
    std::vector<CodeCount> pairs;
    nodes.reserve(h.nodes.size());
    for (const Node& n : h.nodes) {
        NodeOnDisk d{};
        d.sphere = {n.centre.x, n.centre.y, n.centre.z, n.radius};
        d.chunkOffset = n.chunkOffset;
        d.chunkHash = n.chunkHash;
        d.attributeHash = n.attributeHash;
        d.attributeBytes = n.attributeBytes;
        d.cell = n.cell;
        d.parent = n.parent;
        d.firstChild = n.firstChild;
        d.records = n.records;
        d.chunkBytes = n.chunkBytes;
        d.normalCone = n.normalCone;
        d.normalConeCosine = n.normalConeCosine;
        d.level = n.level;
        d.childMask = n.childMask;
        d.errorCode = n.errorCode;
        d.stepShift = n.stepShift;
        if (!h.isMesh()) {
            appendPairs(h, n.parentCounts, n.records, pairs, d.parentCodes);
            appendPairs(h, n.ownCounts, n.records, pairs, d.ownCodes);
        }
        nodes.push_back(d);
    }
    const std::string text = describeAsText(description);
    Head head{};
    auto write = [&](const void* raw, size_t count, Section& section) -> Result<void> {
        const std::vector<uint8_t> bytes = packed(raw, count);
        section = {file_.position(), bytes.size(), count, hashBytes(bytes.data(), bytes.size())};
        return file_.append(bytes.data(), bytes.size());
    };
    STIPPLE_TRY(write(nodes.data(), nodes.size() * sizeof(NodeOnDisk), head.nodes));
    STIPPLE_TRY(write(pairs.data(), pairs.size() * sizeof(CodeCount), head.counts));
    STIPPLE_TRY(write(text.data(), text.size(), head.description));
    const std::vector<uint8_t> mesh = meshBytes(h);
    STIPPLE_TRY(write(mesh.data(), mesh.size(), head.mesh));
    head.magic = kMagic;
    head.version = kStoreVersion;
    head.rootLog2 = h.rootLog2;
    head.origin = {h.origin.x, h.origin.y, h.origin.z};
    head.unit = h.unit;
    head.smallestError = h.errors.smallest;
    head.nodeCount = nodes.size();
    head.fileBytes = file_.position() + sizeof(Foot);
    // The node table holds the hash of every chunk, so these stand for the whole content.
    const std::array<uint64_t, 7> parts{head.nodes.hash,
                                        head.counts.hash,
                                        head.description.hash,
                                        head.mesh.hash,
                                        head.rootLog2,
                                        std::bit_cast<uint64_t>(head.unit),
                                        hashBytes(head.origin.data(), sizeof(head.origin))};
    head.contentHash = contentHash_ = hashBytes(parts.data(), sizeof(parts));
    head.hash = hashBytes(&head, offsetof(Head, hash));
    const Foot foot{head.hash, kFootMagic};
    STIPPLE_TRY(file_.append(&foot, sizeof(foot)));
    STIPPLE_TRY(file_.writeAt(0, &head, sizeof(head)));
    return file_.flush();
}

Result<Store> openStore(const std::string& path) {
    STIPPLE_ASSIGN(InputFile opened, InputFile::open(path));
    Store store;
    store.path = path;
    store.file = std::make_shared<const InputFile>(std::move(opened));
    const InputFile& file = *store.file;
    Head head{};
    if (file.sizeBytes() < sizeof(Head) + sizeof(Foot))
        return fail(ErrorKind::input, fmt::format("has {} bytes, too few for a store", file.sizeBytes()), path,
                    "build it with: stipple build INPUT -o SCENE.stipple");
    STIPPLE_TRY(file.readAt(0, &head, sizeof(head)));
    if (head.magic != kMagic)
        return fail(ErrorKind::input, "is not a stipple store", path,
                    "build one with: stipple build INPUT -o SCENE.stipple");
    if (head.version != kStoreVersion)
        return fail(ErrorKind::input,
                    fmt::format("has store version {}; this program reads version {}", head.version, kStoreVersion),
                    path, "build it again with this program");
    if (head.hash != hashBytes(&head, offsetof(Head, hash)))
        return tl::unexpected(damaged(path, "the head is damaged"));
    if (head.fileBytes != file.sizeBytes())
        return tl::unexpected(
            damaged(path, fmt::format("has {} bytes instead of {}", file.sizeBytes(), head.fileBytes)));
    Foot foot{};
    STIPPLE_TRY(file.readAt(file.sizeBytes() - sizeof(foot), &foot, sizeof(foot)));
    if (foot.magic != kFootMagic || foot.headHash != head.hash)
        return tl::unexpected(damaged(path, "the foot is damaged"));
    if (!(head.unit > 0) || !std::isfinite(head.unit) || !(head.smallestError > 0) || head.rootLog2 > 62 ||
        head.nodes.rawBytes != head.nodeCount * sizeof(NodeOnDisk) || head.nodeCount == 0)
        return tl::unexpected(damaged(path, "the head holds values that are not possible"));

    STIPPLE_ASSIGN(const std::vector<uint8_t> nodeBytes, readSection(file, head.nodes, "node table"));
    STIPPLE_ASSIGN(const std::vector<uint8_t> countBytes, readSection(file, head.counts, "code counts"));
    STIPPLE_ASSIGN(const std::vector<uint8_t> text, readSection(file, head.description, "description"));
    STIPPLE_ASSIGN(const std::vector<uint8_t> mesh, readSection(file, head.mesh, "mesh groups"));
    Hierarchy& h = store.hierarchy;
    h.origin = {head.origin[0], head.origin[1], head.origin[2]};
    h.unit = head.unit;
    h.rootLog2 = head.rootLog2;
    h.errors.smallest = head.smallestError;
    std::vector<CodeCount> pairs(countBytes.size() / sizeof(CodeCount));
    if (!pairs.empty()) std::memcpy(pairs.data(), countBytes.data(), pairs.size() * sizeof(CodeCount));
    h.nodes.resize(head.nodeCount);
    uint64_t used = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        NodeOnDisk d{};
        std::memcpy(&d, nodeBytes.data() + i * sizeof(d), sizeof(d));
        Node& n = h.nodes[i];
        n.centre = {d.sphere[0], d.sphere[1], d.sphere[2]};
        n.radius = d.sphere[3];
        n.chunkOffset = d.chunkOffset;
        n.chunkHash = d.chunkHash;
        n.attributeHash = d.attributeHash;
        n.attributeBytes = d.attributeBytes;
        n.cell = d.cell;
        n.parent = d.parent;
        n.firstChild = d.firstChild;
        n.records = d.records;
        n.chunkBytes = d.chunkBytes;
        n.normalCone = d.normalCone;
        n.normalConeCosine = d.normalConeCosine;
        n.level = d.level;
        n.childMask = d.childMask;
        n.errorCode = d.errorCode;
        n.stepShift = d.stepShift;
        if (d.parentCodes == 0 && d.ownCodes == 0 && mesh.size() > sizeof(MeshHead)) continue;
        for (const auto& [codes, counts] :
             {std::pair{d.parentCodes, &n.parentCounts}, std::pair{d.ownCodes, &n.ownCounts}}) {
            uint64_t sum = 0;
            bool rising = codes > 0 && codes <= 256 && used + codes <= pairs.size();
            for (uint32_t k = 0; rising && k < codes; ++k) {
                sum += pairs[used + k].count;
                rising = pairs[used + k].code < 256 && (k == 0 || pairs[used + k].code > pairs[used + k - 1].code);
            }
            if (!rising || sum != n.records)
                return tl::unexpected(damaged(path, fmt::format("the code counts of node {} are not possible", i)));
            *counts = makeCounts(&pairs[used], codes, h.greaterThan);
            used += codes;
        }
    }
    try {
        store.description = descriptionFromText({text.begin(), text.end()});
    } catch (const std::exception& e) {
        return tl::unexpected(damaged(path, fmt::format("the description cannot be read: {}", e.what())));
    }
    h.isStrands = store.description.isStrands;
    h.isProgressive = store.description.isProgressive;
    for (const Node& n : h.nodes)
        if (n.isLeaf()) h.finestCode = std::max(h.finestCode, n.errorCode);
    h.discFactors = store.description.discFactors;
    h.smallestDisc = store.description.smallestDisc / h.unit;
    if (!h.discFactors.empty() && !(h.smallestDisc > 0 && std::isfinite(h.smallestDisc)))
        return tl::unexpected(damaged(path, "the size of its discs is not possible"));
    if (!(std::abs(glm::length(store.description.up) - 1) < 1e-6))
        return tl::unexpected(damaged(path, "the up direction has not the length 1"));
    store.contentHash = head.contentHash;
    store.fileBytes = head.fileBytes;
    STIPPLE_TRY(readMesh(mesh, path, h));
    if (h.isProgressive && (h.isStrands || h.isMesh()))
        return tl::unexpected(damaged(path, "holds progressive points and something else"));
    if (h.isStrands && h.isMesh()) return tl::unexpected(damaged(path, "holds strands and groups of triangles"));
    STIPPLE_TRY(checkTextures(store, head.nodes.offset));
    STIPPLE_TRY(h.isMesh() ? checkGroups(store, head.nodes.offset) : checkNodes(store, head.nodes.offset));
    return store;
}

Result<Chunk> readChunk(const Store& store, uint32_t index, bool wantLowBits) {
    const ChunkPlace place = chunkPlace(store.hierarchy, index);
    thread_local std::vector<uint8_t> bytes;
    bytes.resize(place.bytes);
    STIPPLE_TRY(store.file->readAt(place.offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: chunk {} at offset {}", store.path, index, place.offset);
    if (hashBytes(bytes.data(), bytes.size()) != place.hash)
        return tl::unexpected(damaged(where, "the hash does not match"));
    return decodeNode(store.hierarchy, index, bytes.data(), bytes.size(), where, wantLowBits);
}

ChunkPlace chunkPlace(const Hierarchy& h, uint32_t index) {
    if (index < h.nodes.size()) {
        const Node& n = h.nodes[index];
        return {n.chunkOffset, n.chunkHash, n.chunkBytes};
    }
    const TextureTile& t = h.tiles[index - h.nodes.size()];
    return {t.offset, t.hash, t.bytes};
}

Result<Chunk> decodeNode(const Hierarchy& h, uint32_t index, const uint8_t* bytes, size_t count,
                         const std::string& where, bool wantLowBits) {
    if (index >= h.nodes.size()) return decodeTile(bytes, count, where);
    const uint32_t records = h.nodes[index].records;
    if (h.isStrands) return decodeStrandChunk(bytes, count, records, where);
    return h.isMesh() ? decodeMeshChunk(bytes, count, records, h.groups[index], where)
                      : decodeChunk(bytes, count, records, where, wantLowBits);
}

Result<std::vector<uint8_t>> readAttribute(const Store& store, uint32_t index, size_t attribute) {
    const Node& node = store.hierarchy.nodes[index];
    std::vector<uint8_t> bytes(node.attributeBytes);
    const uint64_t offset = node.chunkOffset + node.chunkBytes;
    STIPPLE_TRY(store.file->readAt(offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: attributes of node {} at offset {}", store.path, index, offset);
    if (hashBytes(bytes.data(), bytes.size()) != node.attributeHash)
        return tl::unexpected(damaged(where, "the hash does not match"));
    return decodeAttribute(bytes.data(), bytes.size(), store.description.attributes, attribute, node.records, where);
}

}  // namespace stipple::lod
