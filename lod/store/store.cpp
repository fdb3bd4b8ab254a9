#include "lod/store/store.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "engine/base/hash.h"
#include "lod/primitives/codecs.h"
#include "lod/store/attributes.h"
#include "lod/store/check.h"
#include "lod/store/description.h"
#include "lod/store/layout.h"
#include "lod/store/materials.h"
#include "lod/store/mesh_place.h"
#include "lod/store/pages.h"
#include "lod/store/tables.h"
#include "lod/store/zstd_memory.h"
#include "shaders/shared/patch_map.h"

namespace stipple::lod {
namespace {

using namespace layout;

constexpr uint64_t kMostText = uint64_t{128} << 20;  // of a description

std::vector<uint8_t> packed(const void* bytes, size_t count) {
    std::vector<uint8_t> out(ZSTD_compressBound(count));
    out.resize(written(ZSTD_compress(out.data(), out.size(), bytes, count, 3)));
    return out;
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
                                      Payload& p) {
    p.chunkOffset = file_.position();
    p.chunkBytes = static_cast<uint32_t>(bytes.size());
    p.chunkHash = hashBytes(bytes.data(), bytes.size());
    p.attributeBytes = static_cast<uint32_t>(attributes.size());
    p.attributeHash = hashBytes(attributes.data(), attributes.size());
    STIPPLE_TRY(file_.append(bytes.data(), bytes.size()));
    return attributes.empty() ? Result<void>() : file_.append(attributes.data(), attributes.size());
}

Result<Stream> StoreWriter::appendStream(StreamId id, const std::vector<uint8_t>& bytes) {
    const Stream stream{file_.position(), hashBytes(bytes.data(), bytes.size()), static_cast<uint32_t>(bytes.size()),
                        id};
    STIPPLE_TRY(file_.append(bytes.data(), bytes.size()));
    return stream;
}

namespace {
/// Of their own, in maps of patches.
bool hasLight(const Hierarchy& h) {
    const auto has = [](const Payload& p) { return p.kind == Kind::patches && (p.maps & shared::kMapLight) != 0; };
    return std::any_of(h.nodes.begin(), h.nodes.end(), has) || std::any_of(h.further.begin(), h.further.end(), has);
}
bool hasOverview(const Hierarchy& h) { return !h.nodes.empty() && h.overviewOf(h.nodes[0]) > 0; }
}  // namespace

Result<void> StoreWriter::finish(const Hierarchy& h, const StoreDescription& description, uint32_t log2PageNodes) {
    STIPPLE_TRY(checkSpace(h, description));
    const std::string text = describeAsText(description);
    Head head{};
    const auto write = [&](const auto& raw) -> Result<Section> {
        const std::vector<uint8_t> bytes = packed(raw.data(), raw.size());
        const Section section{file_.position(), bytes.size(), raw.size(), hashBytes(bytes.data(), bytes.size())};
        STIPPLE_TRY(file_.append(bytes.data(), bytes.size()));
        return section;
    };
    STIPPLE_ASSIGN(head.nodes, writePages(h, log2PageNodes, write));
    STIPPLE_ASSIGN(head.description, write(text));
    STIPPLE_ASSIGN(head.mesh, write(meshBytes(h)));
    head.magic = kMagic;
    head.version = hasOverview(h) ? kOverviewVersion : hasLight(h) ? kLightVersion : kStoreVersion;
    moveHead(h, head, kToDisk);
    head.nodeCount = h.nodes.size();
    head.fileBytes = file_.position() + sizeof(Foot);
    // Pages hold the hash of every stream, and their directory that of every page: these stand for the whole content.
    // Names of files are no content.
    StoreDescription nameless = description;
    nameless.source.clear();
    const std::string content = describeAsText(nameless);
    const std::array<uint64_t, 6> parts{
        head.nodes.hash, hashBytes(content.data(), content.size()), head.mesh.hash,
        head.rootLog2,   std::bit_cast<uint64_t>(head.unit),        hashBytes(head.origin.data(), sizeof(head.origin))};
    head.contentHash = contentHash_ = hashBytes(parts.data(), sizeof(parts));
    head.hash = hashBytes(&head, offsetof(Head, hash));
    const Foot foot{head.hash, kFootMagic};
    STIPPLE_TRY(file_.append(&foot, sizeof(foot)));
    STIPPLE_TRY(file_.writeAt(0, &head, sizeof(head)));
    return file_.flush();
}

namespace {

bool hasPages(const Head& head) { return head.version >= kStoreVersion && head.version <= kOverviewVersion; }
bool hasPayloadsInNodes(const Head& head) { return head.version == kOldVersion || head.version == kOldWideMeshVersion; }

/// The head, with its hash and the foot's checked; of old versions what they do not have is empty.
Result<Head> readHead(const ByteSource& file) {
    const std::string& path = file.path();
    Head head{};
    if (file.sizeBytes() < kOldHeadBytes + sizeof(Foot))
        return fail(ErrorKind::input, fmt::format("has {} bytes, too few for a store", file.sizeBytes()), path,
                    "build it with: stipple build INPUT -o SCENE.stipple");
    STIPPLE_TRY(file.readAt(0, &head, kOldHeadBytes));
    if (head.magic != kMagic)
        return fail(ErrorKind::input, "is not a stipple store", path,
                    "build one with: stipple build INPUT -o SCENE.stipple");
    const bool isOld = hasPayloadsInNodes(head);
    if (!hasPages(head) && head.version != kUnpagedVersion && head.version != kVersionBefore && !isOld)
        return fail(ErrorKind::input,
                    fmt::format("has store version {}; this program reads version {}", head.version, kOverviewVersion),
                    path, "build it again with this program");
    const auto damaged = [&](const std::string& what) { return tl::unexpected(damagedStore(path, what)); };
    if (isOld) {  // the hash stands where others have more
        std::memcpy(&head.hash, &head.payloads, sizeof(head.hash));
        head.payloads = {};
    } else {
        if (file.sizeBytes() < sizeof(Head) + sizeof(Foot)) return damaged("the head is damaged");
        STIPPLE_TRY(file.readAt(0, &head, sizeof(head)));
    }
    if (head.hash != hashBytes(&head, isOld ? offsetof(Head, payloads) : offsetof(Head, hash)))
        return damaged("the head is damaged");
    if (head.fileBytes != file.sizeBytes())
        return damaged(fmt::format("has {} bytes instead of {}", file.sizeBytes(), head.fileBytes));
    Foot foot{};
    STIPPLE_TRY(file.readAt(file.sizeBytes() - sizeof(foot), &foot, sizeof(foot)));
    if (foot.magic != kFootMagic || foot.headHash != head.hash) return damaged("the foot is damaged");
    const uint64_t nodeBytes = isOld ? sizeof(OldNodeOnDisk) : sizeof(NodeOnDisk);
    if (!(head.unit > 0) || !std::isfinite(head.unit) || !(head.smallestError > 0) || head.rootLog2 > 62 ||
        head.nodeCount == 0 || head.nodeCount > file.sizeBytes() / kFewestChunkBytes ||
        (!hasPages(head) && head.nodes.rawBytes != head.nodeCount * nodeBytes) || head.isGraph > 1)
        return damaged("the head holds values that are not possible");
    return head;
}

/// Stores of build version 15 state one distance of all their leaves of patches, and none states its own; `lattice`:
/// that one, lattice units. In later ones every leaf does. What is wrong; empty: nothing.
std::string tellSourceCodes(double lattice, Hierarchy& h) {
    const auto isPatchLeaf = [&](const Node& n) { return n.isLeaf() && n.kind == Kind::patches; };
    const auto isTold = [](const Node& n) { return n.sourceCode != 0; };
    const bool isAnyTold = std::any_of(h.nodes.begin(), h.nodes.end(), isTold);
    const auto leaves = std::count_if(h.nodes.begin(), h.nodes.end(), isPatchLeaf);
    if (h.isGraph || leaves == 0) return "";
    if (isAnyTold) {
        const bool isEach =
            std::all_of(h.nodes.begin(), h.nodes.end(), [&](const Node& n) { return !isPatchLeaf(n) || isTold(n); });
        return isEach ? "" : "a leaf of patches does not state its distance from the source";
    }
    if (!(lattice <= h.errors.decode(ErrorScale::kLargest))) return "no leaf can be as far from the source as it says";
    h.hasOneSourceCode = true;
    for (Node& n : h.nodes)
        if (n.isLeaf()) n.sourceCode = static_cast<uint8_t>(h.errors.encodeUp(lattice));
    return "";
}

Result<void> readDescription(const ByteSource& file, const Head& head, Store& store) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> text, readSection(file, head.description, kMostText, "description"));
    try {
        store.description = descriptionFromText({text.begin(), text.end()});
    } catch (const std::exception& e) {
        return tl::unexpected(damagedStore(store.path, fmt::format("the description cannot be read: {}", e.what())));
    }
    return {};
}

/// Bytes of textures and tiles, at most: each tile stands for bytes of the file.
uint64_t mostTextureBytes(const ByteSource& file) {
    return sizeof(MeshHead) +
           file.sizeBytes() / kFewestChunkBytes * (sizeof(TextureTile) + sizeof(shared::TextureInfo));
}

/// The tables of nodes and payloads, of versions before 10, and the description.
Result<void> readOldTables(const ByteSource& file, const Head& head, Store& store) {
    Hierarchy& h = store.hierarchy;
    const bool isOld = hasPayloadsInNodes(head);
    bool hasCounts = true;
    if (isOld) {
        STIPPLE_ASSIGN(hasCounts, readOldNodes(file, head, h));
    } else {
        STIPPLE_TRY(readNodes(file, head, h));
    }
    STIPPLE_TRY(readDescription(file, head, store));
    // Every group, run and parent stands for triangles.
    uint64_t triangles = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) { triangles += h.payload(chunk).records; });
    const uint64_t payloads = h.nodes.size() + h.further.size();
    const uint64_t mostMesh = mostTextureBytes(file) + payloads * sizeof(MeshGroup) + triangles * (sizeof(MeshRun) + 8);
    STIPPLE_ASSIGN(const std::vector<uint8_t> mesh, readSection(file, head.mesh, mostMesh, "mesh groups"));
    STIPPLE_TRY(readMesh(mesh, store.path, true, h));
    if (!isOld) return {};
    h.isGraph = !h.groups.empty();
    if (h.isGraph && store.description.isCurves)
        return tl::unexpected(damagedStore(store.path, "holds curves and groups of triangles"));
    setKindOfAll(h, h.isGraph ? Kind::triangles : store.description.isCurves ? Kind::curves : Kind::points);
    if ((head.version == kOldWideMeshVersion) != (h.isGraph && h.rootLog2 > kShortMeshBits))
        return tl::unexpected(damagedStore(store.path, "its version is not that of its coordinates"));
    if (hasCounts == h.isGraph) return tl::unexpected(damagedStore(store.path, "the code counts are not possible"));
    return {};
}

/// What follows from all nodes.
Result<void> describeNodes(Store& store) {
    Hierarchy& h = store.hierarchy;
    for (const Node& n : h.nodes) {
        if (n.isLeaf()) h.finestCode = std::max(h.finestCode, n.errorCode);
        h.hasMaterials = h.hasMaterials || (n.kind == Kind::patches && store.description.pointMaterials.size() > 1);
    }
    const std::string fault = tellSourceCodes(store.description.roundingUnits / h.unit, h);
    return fault.empty() ? Result<void>() : Result<void>(tl::unexpected(damagedStore(store.path, fault)));
}

/// The table of a store with pages, and the description; where streams end.
Result<uint64_t> readPagedTables(const Head& head, Tables tables, Store& store) {
    Hierarchy& h = store.hierarchy;
    STIPPLE_TRY(readDescription(*store.file, head, store));
    h.isStochastic = store.description.isStochastic;
    STIPPLE_ASSIGN(const std::vector<uint8_t> mesh,
                   readSection(*store.file, head.mesh, mostTextureBytes(*store.file), "textures"));
    STIPPLE_TRY(readMesh(mesh, store.path, false, h));
    STIPPLE_ASSIGN(store.pages, NodePages::open(store.file, head, h.isGraph));
    NodePages& pages = *store.pages;
    if (tables == Tables::whole || h.isGraph || h.isStochastic || pages.count() == 1) {
        STIPPLE_TRY(pages.readAll(h));
        describeKinds(h);
        if (((pages.flags() & kTableMixed) != 0) != h.isMixed)
            return tl::unexpected(damagedStore(store.path, "is not of the kind that it says it is"));
        const uint64_t end = pages.chunksEnd();
        store.pages = nullptr;
        return end;
    }
    const double source = store.description.roundingUnits / h.unit;
    h.hasOneSourceCode = (pages.flags() & kTableOneSourceCode) != 0;
    if (h.hasOneSourceCode && !(source <= h.errors.decode(ErrorScale::kLargest)))
        return tl::unexpected(damagedStore(store.path, "no leaf can be as far from the source as it says"));
    h.isMixed = (pages.flags() & kTableMixed) != 0;
    pages.prepare(h, h.hasOneSourceCode ? static_cast<uint8_t>(h.errors.encodeUp(source)) : uint8_t{0});
    STIPPLE_TRY(pages.load(h, 0));
    h.isCurves = !h.isMixed && h.nodes[0].kind == Kind::curves;
    return pages.chunksEnd();
}

}  // namespace

Result<Store> openStore(const std::string& path, Tables tables) {
    STIPPLE_ASSIGN(InputFile opened, InputFile::open(path));
    return openStore(std::make_shared<const InputFile>(std::move(opened)), tables);
}

Result<Store> openStore(std::shared_ptr<const ByteSource> source, Tables tables) {
    const std::string path = source->path();
    Store store;
    store.path = path;
    store.file = std::move(source);
    STIPPLE_ASSIGN(const Head head, readHead(*store.file));
    Hierarchy& h = store.hierarchy;
    moveHead(h, head, kFromDisk);
    uint64_t chunksEnd = head.nodes.offset;
    if (hasPages(head)) {
        STIPPLE_ASSIGN(chunksEnd, readPagedTables(head, tables, store));
    } else {
        STIPPLE_TRY(readOldTables(*store.file, head, store));
    }
    h.isRigid = store.description.isRigid;
    h.isStochastic = store.description.isStochastic;
    h.hasMaterials = materialAttribute(store.description).has_value();
    if (h.known.isWhole()) {
        STIPPLE_TRY(describeNodes(store));
    } else if ((store.pages->flags() & kTablePatches) != 0) {
        h.hasMaterials = h.hasMaterials || store.description.pointMaterials.size() > 1;
    }
    h.discFactors = store.description.discFactors;
    h.smallestDisc = store.description.smallestDisc / h.unit;
    store.contentHash = head.contentHash;
    store.fileBytes = head.fileBytes;
    STIPPLE_TRY(checkTables(store, chunksEnd));
    if (h.known.isWhole()) STIPPLE_TRY(checkLight(h, 0, h.nodes.size(), head.version, store.path));
    if (!h.groups.empty() && store.description.materials.empty()) {  // it is drawn with a plain one
        shared::SurfaceMaterial& plain = store.description.materials.emplace_back();
        plain.baseColour = {1, 1, 1};
        plain.alpha = plain.roughness = plain.normalScale = 1;
    }
    return store;
}

Result<void> readWholeTable(const Store& store) {
    if (!store.pages) return {};
    for (uint32_t page = 0; page < store.pages->count(); ++page) STIPPLE_TRY(store.pages->load(store.hierarchy, page));
    return {};
}

Result<Chunk> readDrawnChunk(const Store& store, uint32_t index, bool wantLowBits) {
    if (const Hierarchy& h = store.hierarchy; h.isUnknown(index))
        STIPPLE_TRY(store.pages->load(h, h.known.pageOf(index)));
    const ChunkPlace place = chunkPlace(store.hierarchy, index);
    thread_local std::vector<uint8_t> bytes;
    bytes.resize(place.bytes);
    STIPPLE_TRY(store.file->readAt(place.offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: chunk {} at offset {}", store.path, index, place.offset);
    if (hashBytes(bytes.data(), bytes.size()) != place.hash)
        return tl::unexpected(damagedStore(where, "the hash does not match"));
    STIPPLE_ASSIGN(Chunk chunk, decodeStored(store.hierarchy, index, bytes.data(), bytes.size(), where, wantLowBits));
    STIPPLE_TRY(checkMaterials(store, chunk, where));
    return chunk;
}

Result<Chunk> readChunk(const Store& store, uint32_t index, bool wantLowBits) {
    STIPPLE_ASSIGN(Chunk chunk, readDrawnChunk(store, index, wantLowBits));
    const Hierarchy& h = store.hierarchy;
    if (index != 0 || chunk.records.empty()) return chunk;
    const auto overview = static_cast<ptrdiff_t>(h.overviewOf(h.nodes[0]));
    chunk.records.erase(chunk.records.begin(), chunk.records.begin() + overview);
    if (!chunk.lowBits.empty()) chunk.lowBits.erase(chunk.lowBits.begin(), chunk.lowBits.begin() + 3 * overview);
    return chunk;
}

ChunkPlace chunkPlace(const Hierarchy& h, uint32_t index) {
    if (!h.isTile(index)) {
        const Payload& p = h.payload(index);
        return {p.chunkOffset, p.chunkHash, p.chunkBytes};
    }
    const TextureTile& t = h.tiles[index - h.nodes.size()];
    return {t.offset, t.hash, t.bytes};
}

Result<Chunk> decodeStored(const Hierarchy& h, uint32_t index, const uint8_t* bytes, size_t count,
                           const std::string& where, bool wantLowBits) {
    if (h.isTile(index)) return decodeTile(bytes, count, where);
    return traitsOf(h.payload(index).codec).decode(h, index, bytes, count, where, wantLowBits);
}

std::optional<Stream> findStream(const Hierarchy& h, uint32_t chunk, StreamId id) {
    const Payload& p = h.payload(chunk);
    if (id == StreamId::records) return Stream{p.chunkOffset, p.chunkHash, p.chunkBytes, id};
    if (id == StreamId::attributes && p.attributeBytes > 0)
        return Stream{p.chunkOffset + p.chunkBytes, p.attributeHash, p.attributeBytes, id};
    for (uint32_t k = p.firstStream; k < p.firstStream + p.streams; ++k)
        if (h.streams[k].id == id) return h.streams[k];
    return {};
}

Result<std::vector<uint8_t>> readStream(const Store& store, uint32_t chunk, const Stream& stream) {
    std::vector<uint8_t> bytes(stream.bytes);
    STIPPLE_TRY(store.file->readAt(stream.offset, bytes.data(), bytes.size()));
    if (hashBytes(bytes.data(), bytes.size()) != stream.hash)
        return tl::unexpected(damagedStore(fmt::format("{}: stream {} of chunk {} at offset {}", store.path,
                                                       static_cast<int>(stream.id), chunk, stream.offset),
                                           "the hash does not match"));
    return bytes;
}

Result<std::vector<uint8_t>> readAttribute(const Store& store, uint32_t index, size_t attribute) {
    const Payload& p = store.hierarchy.payload(index);
    std::vector<uint8_t> bytes(p.attributeBytes);
    const uint64_t offset = p.chunkOffset + p.chunkBytes;
    STIPPLE_TRY(store.file->readAt(offset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: attributes of chunk {} at offset {}", store.path, index, offset);
    if (hashBytes(bytes.data(), bytes.size()) != p.attributeHash)
        return tl::unexpected(damagedStore(where, "the hash does not match"));
    const std::vector<AttributeInfo>& infos = store.description.attributes;
    STIPPLE_ASSIGN(std::vector<uint8_t> values,
                   decodeAttribute(bytes.data(), bytes.size(), infos, attribute, p.records, where));
    if (index != 0 || p.kind != Kind::points) return values;
    const size_t overview = store.hierarchy.overviewOf(p) * bytesOf(infos[attribute].type);
    values.erase(values.begin(), values.begin() + static_cast<ptrdiff_t>(overview));
    return values;
}

}  // namespace stipple::lod
