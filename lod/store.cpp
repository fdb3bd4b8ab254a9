#include "lod/store.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <type_traits>

#include "engine/base/hash.h"
#include "lod/attributes.h"
#include "lod/description.h"
#include "lod/kinds.h"
#include "lod/mesh_place.h"
#include "lod/store_check.h"
#include "lod/store_layout.h"
#include "lod/zstd_memory.h"

namespace stipple::lod {
namespace {

using namespace layout;

constexpr uint64_t kMostText = uint64_t{128} << 20;  // of a description

std::vector<uint8_t> packed(const void* bytes, size_t count) {
    std::vector<uint8_t> out(ZSTD_compressBound(count));
    out.resize(written(ZSTD_compress(out.data(), out.size(), bytes, count, 3)));
    return out;
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

/// `most`: bytes that what was read before allows it to have; checked before any memory is taken.
Result<std::vector<uint8_t>> readSection(const InputFile& file, const Section& s, uint64_t most, const char* name) {
    const std::string where = fmt::format("{}: {}", file.path(), name);
    if (s.offset > file.sizeBytes() || s.bytes > file.sizeBytes() - s.offset)
        return tl::unexpected(
            damagedStore(where, fmt::format("{} bytes at offset {} lie outside the file", s.bytes, s.offset)));
    if (s.rawBytes > most || !isPossibleGain(s.bytes, s.rawBytes))
        return tl::unexpected(damagedStore(where, fmt::format("{} bytes cannot come from {}", s.rawBytes, s.bytes)));
    std::vector<uint8_t> bytes(s.bytes);
    STIPPLE_TRY(file.readAt(s.offset, bytes.data(), bytes.size()));
    if (hashBytes(bytes.data(), bytes.size()) != s.hash)
        return tl::unexpected(damagedStore(where, "the hash does not match"));
    std::vector<uint8_t> raw(s.rawBytes);
    const size_t got = unlessOutOfMemory(ZSTD_decompress(raw.data(), raw.size(), bytes.data(), bytes.size()));
    if (ZSTD_isError(got) || got != raw.size()) return tl::unexpected(damagedStore(where, "cannot be decompressed"));
    return raw;
}

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
    const auto bad = [&] { return tl::unexpected(damagedStore(path, "the groups of the mesh are not possible")); };
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

Node nodeOf(const NodeOnDisk& d) {
    Node n;
    n.centre = {d.sphere[0], d.sphere[1], d.sphere[2]};
    n.radius = d.sphere[3];
    n.chunkOffset = d.chunkOffset;
    n.chunkHash = d.chunkHash;
    n.attributeHash = d.attributeHash;
    n.attributeBytes = d.attributeBytes;
    n.cell = {d.cell[0], d.cell[1], d.cell[2]};
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
    return n;
}

/// The node table and the counts per code; has it any?
Result<bool> readNodes(const InputFile& file, const Head& head, Hierarchy& h) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> nodeBytes,
                   readSection(file, head.nodes, head.nodes.rawBytes, "node table"));
    std::vector<NodeOnDisk> onDisk(head.nodeCount);
    std::memcpy(onDisk.data(), nodeBytes.data(), nodeBytes.size());
    uint64_t codes = 0;
    for (const NodeOnDisk& d : onDisk) {
        const uint32_t most = std::min(d.records, 256u);
        if (d.parentCodes > most || d.ownCodes > most)
            return tl::unexpected(damagedStore(file.path(), "the code counts are not possible"));
        codes += uint64_t{d.parentCodes} + d.ownCodes;
    }
    STIPPLE_ASSIGN(const std::vector<uint8_t> countBytes,
                   readSection(file, head.counts, codes * sizeof(CodeCount), "code counts"));
    std::vector<CodeCount> pairs(countBytes.size() / sizeof(CodeCount));
    if (!pairs.empty()) std::memcpy(pairs.data(), countBytes.data(), pairs.size() * sizeof(CodeCount));
    h.nodes.resize(head.nodeCount);
    uint64_t used = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        const NodeOnDisk& d = onDisk[i];
        Node& n = h.nodes[i] = nodeOf(d);
        // Groups of triangles have none; whether it is one is known once the mesh section is read.
        if (pairs.empty()) continue;
        // On disk are the low 32 bits of a cell's index; the parent's tells the rest.
        for (size_t a = 0; a < 3 && n.level > 32 && n.parent < i; ++a)
            n.cell.at(a) |= 2 * h.nodes[n.parent].cell.at(a) >> 32 << 32;
        for (const auto& [count, counts] :
             {std::pair{d.parentCodes, &n.parentCounts}, std::pair{d.ownCodes, &n.ownCounts}}) {
            uint64_t sum = 0;
            bool rising = count > 0 && used + count <= pairs.size();
            for (uint32_t k = 0; rising && k < count; ++k) {
                sum += pairs[used + k].count;
                rising = pairs[used + k].code < 256 && (k == 0 || pairs[used + k].code > pairs[used + k - 1].code);
            }
            if (!rising || sum != n.records)
                return tl::unexpected(
                    damagedStore(file.path(), fmt::format("the code counts of node {} are not possible", i)));
            *counts = makeCounts(&pairs[used], count, h.greaterThan);
            used += count;
        }
    }
    if (used != pairs.size()) return tl::unexpected(damagedStore(file.path(), "there are more code counts than nodes"));
    return !pairs.empty();
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
    STIPPLE_TRY(checkSpace(h, description));
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
        for (size_t a = 0; a < 3; ++a) d.cell.at(a) = static_cast<uint32_t>(n.cell.at(a));  // the low 32 bits
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
    head.version = h.isMesh() && h.rootLog2 > kShortMeshBits ? kWideMeshVersion : kStoreVersion;
    head.rootLog2 = h.rootLog2;
    head.origin = {h.origin.x, h.origin.y, h.origin.z};
    head.unit = h.unit;
    head.smallestError = h.errors.smallest;
    head.nodeCount = nodes.size();
    head.fileBytes = file_.position() + sizeof(Foot);
    // The node table holds the hash of every chunk, so these stand for the whole content.
    // Names of files are no content.
    StoreDescription nameless = description;
    nameless.source.clear();
    const std::string content = describeAsText(nameless);
    const std::array<uint64_t, 7> parts{head.nodes.hash,
                                        head.counts.hash,
                                        hashBytes(content.data(), content.size()),
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
    if (head.version != kStoreVersion && head.version != kWideMeshVersion)
        return fail(ErrorKind::input,
                    fmt::format("has store version {}; this program reads version {}", head.version, kStoreVersion),
                    path, "build it again with this program");
    if (head.hash != hashBytes(&head, offsetof(Head, hash)))
        return tl::unexpected(damagedStore(path, "the head is damaged"));
    if (head.fileBytes != file.sizeBytes())
        return tl::unexpected(
            damagedStore(path, fmt::format("has {} bytes instead of {}", file.sizeBytes(), head.fileBytes)));
    Foot foot{};
    STIPPLE_TRY(file.readAt(file.sizeBytes() - sizeof(foot), &foot, sizeof(foot)));
    if (foot.magic != kFootMagic || foot.headHash != head.hash)
        return tl::unexpected(damagedStore(path, "the foot is damaged"));
    if (!(head.unit > 0) || !std::isfinite(head.unit) || !(head.smallestError > 0) || head.rootLog2 > 62 ||
        head.nodeCount == 0 || head.nodeCount > file.sizeBytes() / kFewestChunkBytes ||
        head.nodes.rawBytes != head.nodeCount * sizeof(NodeOnDisk))
        return tl::unexpected(damagedStore(path, "the head holds values that are not possible"));

    Hierarchy& h = store.hierarchy;
    h.origin = {head.origin[0], head.origin[1], head.origin[2]};
    h.unit = head.unit;
    h.rootLog2 = head.rootLog2;
    h.errors.smallest = head.smallestError;
    STIPPLE_ASSIGN(const bool hasCounts, readNodes(file, head, h));
    STIPPLE_ASSIGN(const std::vector<uint8_t> text, readSection(file, head.description, kMostText, "description"));
    // Every group, run and parent stands for triangles, every tile for bytes of the file.
    uint64_t triangles = 0;
    for (const Node& n : h.nodes) triangles += n.records;
    const uint64_t mostMesh =
        sizeof(MeshHead) + h.nodes.size() * sizeof(MeshGroup) + triangles * (sizeof(MeshRun) + 8) +
        file.sizeBytes() / kFewestChunkBytes * (sizeof(TextureTile) + sizeof(shared::TextureInfo));
    STIPPLE_ASSIGN(const std::vector<uint8_t> mesh, readSection(file, head.mesh, mostMesh, "mesh groups"));
    try {
        store.description = descriptionFromText({text.begin(), text.end()});
    } catch (const std::exception& e) {
        return tl::unexpected(damagedStore(path, fmt::format("the description cannot be read: {}", e.what())));
    }
    h.isStrands = store.description.isStrands;
    h.isRigid = store.description.isRigid;
    h.isProgressive = store.description.isProgressive;
    for (const Node& n : h.nodes)
        if (n.isLeaf()) h.finestCode = std::max(h.finestCode, n.errorCode);
    h.discFactors = store.description.discFactors;
    h.smallestDisc = store.description.smallestDisc / h.unit;
    store.contentHash = head.contentHash;
    store.fileBytes = head.fileBytes;
    STIPPLE_TRY(readMesh(mesh, path, h));
    if ((head.version == kWideMeshVersion) != (h.isMesh() && h.rootLog2 > kShortMeshBits))
        return tl::unexpected(damagedStore(path, "its version is not that of its coordinates"));
    if (hasCounts == h.isMesh()) return tl::unexpected(damagedStore(path, "the code counts are not possible"));
    STIPPLE_TRY(checkTables(store, head.nodes.offset));
    if (h.isMesh() && store.description.materials.empty()) {  // it is drawn with a plain one
        shared::SurfaceMaterial& plain = store.description.materials.emplace_back();
        plain.baseColour = {1, 1, 1};
        plain.alpha = plain.roughness = plain.normalScale = 1;
    }
    return store;
}

Result<Chunk> readChunk(const Store& store, uint32_t index, bool wantLowBits) {
    const ChunkPlace place = chunkPlace(store.hierarchy, index);
    thread_local std::vector<uint8_t> bytes;
    bytes.resize(place.bytes);
    STIPPLE_TRY(store.file->readAt(place.offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: chunk {} at offset {}", store.path, index, place.offset);
    if (hashBytes(bytes.data(), bytes.size()) != place.hash)
        return tl::unexpected(damagedStore(where, "the hash does not match"));
    STIPPLE_ASSIGN(Chunk chunk, decodeNode(store.hierarchy, index, bytes.data(), bytes.size(), where, wantLowBits));
    STIPPLE_TRY(checkMaterials(store, chunk, where));
    return chunk;
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
    return traitsOf(h).decode(h, index, bytes, count, where, wantLowBits);
}

Result<std::vector<uint8_t>> readAttribute(const Store& store, uint32_t index, size_t attribute) {
    const Node& node = store.hierarchy.nodes[index];
    std::vector<uint8_t> bytes(node.attributeBytes);
    const uint64_t offset = node.chunkOffset + node.chunkBytes;
    STIPPLE_TRY(store.file->readAt(offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: attributes of node {} at offset {}", store.path, index, offset);
    if (hashBytes(bytes.data(), bytes.size()) != node.attributeHash)
        return tl::unexpected(damagedStore(where, "the hash does not match"));
    return decodeAttribute(bytes.data(), bytes.size(), store.description.attributes, attribute, node.records, where);
}

}  // namespace stipple::lod
