#include "lod/store.h"

#include <fmt/format.h>
#include <zstd.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "engine/base/hash.h"
#include "lod/attributes.h"

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
    Section nodes, counts, description;
    uint64_t hash;  // of everything before
};
static_assert(sizeof(Head) == 16 + 24 + 16 + 24 + 96 + 8 && std::is_trivially_copyable_v<Head>);

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

nlohmann::json toJson(const StoreDescription& d) {
    nlohmann::json attributes = nlohmann::json::array();
    for (const AttributeInfo& a : d.attributes)
        attributes.push_back({{"name", a.name},
                              {"type", kScalarNames.at(static_cast<size_t>(a.type))},
                              {"aggregate", kAggregateNames.at(static_cast<size_t>(a.aggregate))},
                              {"scale", a.scale},
                              {"offset", a.offset},
                              {"description", a.description},
                              {"least", a.least},
                              {"greatest", a.greatest},
                              {"low", a.low},
                              {"high", a.high},
                              {"counts", a.counts}});
    return {
        {"metres_per_unit", d.metresPerUnit},
        {"up", {d.up.x, d.up.y, d.up.z}},
        {"crs", {{"name", d.crs.name}, {"epsg", d.crs.epsg}, {"text", d.crs.text}, {"is_degrees", d.crs.isDegrees}}},
        {"attributes", attributes},
        {"low_height", d.lowHeight},
        {"high_height", d.highHeight},
        {"points", d.points},
        {"records", d.records},
        {"rounding", d.roundingUnits},
        {"min", {d.boundsMin.x, d.boundsMin.y, d.boundsMin.z}},
        {"max", {d.boundsMax.x, d.boundsMax.y, d.boundsMax.z}},
        {"focus_min", {d.focusMin.x, d.focusMin.y, d.focusMin.z}},
        {"focus_max", {d.focusMax.x, d.focusMax.y, d.focusMax.z}},
        {"has_colour", d.hasColour},
        {"is_reflectance", d.isReflectance},
        {"has_normals", d.hasNormals},
        {"source", d.source}};
}

template <size_t N>
size_t indexOf(const std::array<const char*, N>& names, const std::string& name) {
    for (size_t i = 0; i < N; ++i)
        if (name == names.at(i)) return i;
    throw std::runtime_error("unknown name '" + name + "'");
}

AttributeInfo attributeFromJson(const nlohmann::json& j) {
    AttributeInfo a;
    a.name = j.at("name").get<std::string>();
    a.type = static_cast<ScalarType>(indexOf(kScalarNames, j.at("type").get<std::string>()));
    a.aggregate = static_cast<Aggregate>(indexOf(kAggregateNames, j.at("aggregate").get<std::string>()));
    a.scale = j.at("scale").get<double>();
    a.offset = j.at("offset").get<double>();
    a.description = j.at("description").get<std::string>();
    a.least = j.at("least").get<double>();
    a.greatest = j.at("greatest").get<double>();
    a.low = j.at("low").get<double>();
    a.high = j.at("high").get<double>();
    a.counts = j.at("counts").get<std::vector<std::pair<double, uint64_t>>>();
    return a;
}

StoreDescription fromJson(const nlohmann::json& j) {
    StoreDescription d;
    d.metresPerUnit = j.at("metres_per_unit").get<double>();
    const nlohmann::json& crs = j.at("crs");
    d.crs.name = crs.at("name").get<std::string>();
    d.crs.epsg = crs.at("epsg").get<int>();
    d.crs.text = crs.at("text").get<std::string>();
    d.crs.isDegrees = crs.at("is_degrees").get<bool>();
    d.crs.metresPerUnit = d.metresPerUnit;
    for (const nlohmann::json& a : j.at("attributes")) d.attributes.push_back(attributeFromJson(a));
    d.lowHeight = j.at("low_height").get<double>();
    d.highHeight = j.at("high_height").get<double>();
    d.points = j.at("points").get<uint64_t>();
    d.records = j.at("records").get<uint64_t>();
    d.roundingUnits = j.at("rounding").get<double>();
    for (int i = 0; i < 3; ++i) {
        d.boundsMin[i] = j.at("min").at(static_cast<size_t>(i)).get<double>();
        d.focusMin[i] = j.at("focus_min").at(static_cast<size_t>(i)).get<double>();
        d.focusMax[i] = j.at("focus_max").at(static_cast<size_t>(i)).get<double>();
        d.up[i] = j.at("up").at(static_cast<size_t>(i)).get<double>();
        d.boundsMax[i] = j.at("max").at(static_cast<size_t>(i)).get<double>();
    }
    d.hasColour = j.at("has_colour").get<bool>();
    d.isReflectance = j.at("is_reflectance").get<bool>();
    d.hasNormals = j.at("has_normals").get<bool>();
    d.source = j.at("source").get<std::string>();
    return d;
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
            n.stepShift != static_cast<int>(store.hierarchy.rootLog2) - n.level - 16)
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
        appendPairs(h, n.parentCounts, n.records, pairs, d.parentCodes);
        appendPairs(h, n.ownCounts, n.records, pairs, d.ownCodes);
        nodes.push_back(d);
    }
    const std::string text = toJson(description).dump();
    Head head{};
    auto write = [&](const void* raw, size_t count, Section& section) -> Result<void> {
        const std::vector<uint8_t> bytes = packed(raw, count);
        section = {file_.position(), bytes.size(), count, hashBytes(bytes.data(), bytes.size())};
        return file_.append(bytes.data(), bytes.size());
    };
    STIPPLE_TRY(write(nodes.data(), nodes.size() * sizeof(NodeOnDisk), head.nodes));
    STIPPLE_TRY(write(pairs.data(), pairs.size() * sizeof(CodeCount), head.counts));
    STIPPLE_TRY(write(text.data(), text.size(), head.description));
    head.magic = kMagic;
    head.version = kStoreVersion;
    head.rootLog2 = h.rootLog2;
    head.origin = {h.origin.x, h.origin.y, h.origin.z};
    head.unit = h.unit;
    head.smallestError = h.errors.smallest;
    head.nodeCount = nodes.size();
    head.fileBytes = file_.position() + sizeof(Foot);
    // The node table holds the hash of every chunk, so these three stand for the whole content.
    const std::array<uint64_t, 6> parts{head.nodes.hash,
                                        head.counts.hash,
                                        head.description.hash,
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
        store.description = fromJson(nlohmann::json::parse(text.begin(), text.end()));
    } catch (const std::exception& e) {
        return tl::unexpected(damaged(path, fmt::format("the description cannot be read: {}", e.what())));
    }
    if (!(std::abs(glm::length(store.description.up) - 1) < 1e-6))
        return tl::unexpected(damaged(path, "the up direction has not the length 1"));
    store.contentHash = head.contentHash;
    store.fileBytes = head.fileBytes;
    STIPPLE_TRY(checkNodes(store, head.nodes.offset));
    return store;
}

Result<Chunk> readChunk(const Store& store, uint32_t index, bool wantLowBits) {
    const Node& node = store.hierarchy.nodes[index];
    thread_local std::vector<uint8_t> bytes;
    bytes.resize(node.chunkBytes);
    STIPPLE_TRY(store.file->readAt(node.chunkOffset, bytes.data(), bytes.size()));
    const std::string where = fmt::format("{}: chunk of node {} at offset {}", store.path, index, node.chunkOffset);
    if (hashBytes(bytes.data(), bytes.size()) != node.chunkHash)
        return tl::unexpected(damaged(where, "the hash does not match"));
    return decodeChunk(bytes.data(), bytes.size(), node.records, where, wantLowBits);
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
