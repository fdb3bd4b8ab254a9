#include "lod/store/tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <string_view>

#include "engine/base/hash.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "lod/store/check.h"
#include "lod/store/zstd_memory.h"

namespace stipple::lod {

using namespace layout;

/// `most`: bytes that what was read before allows it to have; checked before any memory is taken.
Result<std::vector<uint8_t>> readSection(const ByteSource& file, const Section& s, uint64_t most, const char* name) {
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

namespace {

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

NameOnDisk nameOnDisk(const char* text) {
    NameOnDisk name{};
    std::memcpy(name.data(), text, std::min(std::strlen(text), name.size() - 1));
    return name;
}

/// The names in a file as the values of this program: by the names in its own table.
template <typename Value>
Result<std::vector<Value>> valuesOf(const std::vector<NameOnDisk>& names, size_t values, const char* what,
                                    const std::string& path) {
    std::vector<Value> out;
    for (const NameOnDisk& raw : names) {
        const auto end = std::find(raw.begin(), raw.end(), '\0');
        const std::string name(raw.begin(), end);
        const bool isText = end != raw.end() && !name.empty() &&
                            std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < 127; });
        if (!isText) return tl::unexpected(damagedStore(path, fmt::format("a {} has no name", what)));
        std::optional<Value> known;
        for (size_t v = 0; v < values; ++v)
            if (name == traitsOf(static_cast<Value>(v)).name) known = static_cast<Value>(v);
        if (!known)
            return fail(ErrorKind::input,
                        fmt::format("holds payloads of {} \"{}\", which this program does not know", what, name), path,
                        "use a newer one");
        out.push_back(*known);
    }
    return out;
}

/// The counts per code of one payload, from pairs[used] on.
Result<void> readCounts(const std::vector<CodeCount>& pairs, uint32_t parentCodes, uint32_t ownCodes, size_t node,
                        const std::string& path, uint64_t& used, Payload& p, std::vector<uint32_t>& greaterThan) {
    for (const auto& [count, counts] : {std::pair{parentCodes, &p.parentCounts}, std::pair{ownCodes, &p.ownCounts}}) {
        uint64_t sum = 0;
        bool rising = count > 0 && used + count <= pairs.size();
        for (uint32_t k = 0; rising && k < count; ++k) {
            sum += pairs[used + k].count;
            rising = pairs[used + k].code < 256 && (k == 0 || pairs[used + k].code > pairs[used + k - 1].code);
        }
        if (!rising || sum != p.records)
            return tl::unexpected(damagedStore(path, fmt::format("the code counts of node {} are not possible", node)));
        *counts = makeCounts(&pairs[used], count, greaterThan);
        used += count;
    }
    return {};
}

/// Could a payload of so many records have so many codes? Adds them to `codes`.
bool isPossibleCount(uint32_t records, uint32_t parentCodes, uint32_t ownCodes, uint64_t& codes) {
    const uint32_t most = std::min(records, 256u);
    codes += uint64_t{parentCodes} + ownCodes;
    return parentCodes <= most && ownCodes <= most;
}

Result<std::vector<CodeCount>> readPairs(const ByteSource& file, const Head& head, uint64_t codes) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes,
                   readSection(file, head.counts, codes * sizeof(CodeCount), "code counts"));
    const uint8_t* at = bytes.data();
    return takeArray<CodeCount>(at, bytes.size() / sizeof(CodeCount));
}

/// Where what is in a payload's streams lies.
Result<void> placeStreams(const std::vector<StreamOnDisk>& streams, uint64_t first, uint32_t count, size_t node,
                          const std::string& path, Payload& p, std::vector<Stream>& further) {
    const auto bad = [&](const char* what) {
        return tl::unexpected(damagedStore(path, fmt::format("node {}: {}", node, what)));
    };
    p.attributeHash = hashBytes(nullptr, 0);
    p.firstStream = static_cast<uint32_t>(further.size());
    const Stream *records = nullptr, *attributes = nullptr;
    std::array<Stream, kMostStreams> all{};
    for (uint32_t k = 0; k < count; ++k) {
        Stream& s = all.at(k);
        moveStream(s, streams[first + k], kFromDisk);
        for (uint32_t other = 0; other < k; ++other)
            if (all.at(other).id == s.id) return bad("a stream is there twice");
        if (s.id == StreamId::records)
            records = &s;
        else if (s.id == StreamId::attributes)
            attributes = &s;
        else
            further.push_back(s);
    }
    p.streams = static_cast<uint32_t>(further.size()) - p.firstStream;
    if (records == nullptr) return bad("a payload has no records");
    p.chunkOffset = records->offset;
    p.chunkHash = records->hash;
    p.chunkBytes = records->bytes;
    if (attributes == nullptr) return {};
    if (attributes->offset != records->offset + records->bytes) return bad("attributes do not follow their records");
    p.attributeHash = attributes->hash;
    p.attributeBytes = attributes->bytes;
    return {};
}

/// The section of payloads: `part` gets payloads and streams.
Result<Names> readPayloads(const ByteSource& file, const Head& head, uint64_t count, PartOnDisk& part) {
    const uint64_t most = sizeof(PayloadHead) + kMostNames * sizeof(NameOnDisk) +
                          count * (sizeof(PayloadOnDisk) + kMostStreams * sizeof(StreamOnDisk));
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readSection(file, head.payloads, most, "payloads"));
    PayloadHead of{};
    const auto bad = [&] { return tl::unexpected(damagedStore(file.path(), "the payloads are not possible")); };
    if (bytes.size() < sizeof(of)) return bad();
    std::memcpy(&of, bytes.data(), sizeof(of));
    // (Each is bounded first, so that the sum cannot overflow.)
    if (of.payloads != count || of.kinds > kMostNames || of.codecs > kMostNames || of.streams > bytes.size() ||
        sizeof(of) + (of.kinds + of.codecs) * sizeof(NameOnDisk) + of.payloads * sizeof(PayloadOnDisk) +
                of.streams * sizeof(StreamOnDisk) !=
            bytes.size())
        return bad();
    const uint8_t* at = bytes.data() + sizeof(of);
    STIPPLE_ASSIGN(Names names, readNames(at, of.kinds, of.codecs, file.path()));
    at += (of.kinds + of.codecs) * sizeof(NameOnDisk);
    part.payloads = takeArray<PayloadOnDisk>(at, of.payloads);
    part.streams = takeArray<StreamOnDisk>(at, of.streams);
    return names;
}

}  // namespace

Result<Names> readNames(const uint8_t* at, uint64_t kinds, uint64_t codecs, const std::string& path) {
    const auto ofKinds = takeArray<NameOnDisk>(at, kinds), ofCodecs = takeArray<NameOnDisk>(at, codecs);
    Names names;
    STIPPLE_ASSIGN(names.kinds, valuesOf<Kind>(ofKinds, kKinds, "kind", path));
    STIPPLE_ASSIGN(names.codecs, valuesOf<Codec>(ofCodecs, kCodecs, "codec", path));
    return names;
}

std::vector<uint8_t> namesOnDisk() {
    std::vector<NameOnDisk> names;
    for (size_t k = 0; k < kKinds; ++k) names.push_back(nameOnDisk(traitsOf(static_cast<Kind>(k)).name));
    for (size_t c = 0; c < kCodecs; ++c) names.push_back(nameOnDisk(traitsOf(static_cast<Codec>(c)).name));
    std::vector<uint8_t> out;
    appendArray(names, out);
    return out;
}

void describeKinds(Hierarchy& h) {
    bool isOne = h.further.empty();
    for (const Node& n : h.nodes) isOne = isOne && n.kind == h.nodes[0].kind;
    h.isMixed = !isOne;
    h.isCurves = isOne && h.nodes[0].kind == Kind::curves;
    uint32_t groups = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        Node& node = h.nodes[n];
        if (node.kind == Kind::triangles) node.group = groups++;
        for (uint32_t k = 0; k < node.furtherPayloads; ++k)
            if (Payload& p = h.further[node.firstFurther + k]; p.kind == Kind::triangles) p.group = groups++;
    }
}

namespace {

tl::unexpected<Error> tooManyPayloads(const std::string& path) {
    return tl::unexpected(damagedStore(path, "a node has more payloads than nodes have"));
}

/// Do the arrays have as much as the payloads say?
Result<void> checkPart(const PartOnDisk& part, uint64_t payloads, const Names& names, bool isGraph,
                       const std::string& path) {
    const auto bad = [&](const char* what) { return tl::unexpected(damagedStore(path, what)); };
    if (part.payloads.size() != payloads) return bad("the payloads are not possible");
    uint64_t streams = 0, codes = 0;
    for (const PayloadOnDisk& d : part.payloads) {
        if (d.kind >= names.kinds.size() || d.codec >= names.codecs.size() || d.streams > kMostStreams)
            return bad("the payloads are not possible");
        streams += d.streams;
        if (!isPossibleCount(d.records, d.parentCodes, d.ownCodes, codes) ||
            (isGraph && d.parentCodes + d.ownCodes > 0))
            return bad("the code counts are not possible");
    }
    if (streams != part.streams.size()) return bad("the payloads are not possible");
    if (codes < part.pairs.size()) return bad("there are more code counts than nodes");
    return {};
}

}  // namespace

Result<TablePart> partInMemory(const PartOnDisk& part, const Names& names, const Places& first, bool isGraph,
                               const std::string& path) {
    TablePart out;
    uint64_t further = 0;
    for (const NodeOnDisk& d : part.nodes) {
        Node& n = out.nodes.emplace_back();
        moveNode(n, d, kFromDisk);
        if (n.furtherPayloads >= kMostPayloads) return tooManyPayloads(path);
        n.firstFurther = static_cast<uint32_t>(first.further + further);
        further += n.furtherPayloads;
    }
    STIPPLE_TRY(checkPart(part, part.nodes.size() + further, names, isGraph, path));
    out.further.reserve(further);
    uint64_t used = 0, stream = 0, payload = 0;
    auto group = static_cast<uint32_t>(first.groups);
    const auto read = [&](size_t node, Payload& p) -> Result<void> {
        const PayloadOnDisk& d = part.payloads[payload++];
        movePayload(p, d, kFromDisk);
        p.kind = names.kinds[d.kind];
        p.codec = names.codecs[d.codec];
        if (p.kind == Kind::triangles) p.group = group++;
        STIPPLE_TRY(placeStreams(part.streams, stream, d.streams, node, path, p, out.streams));
        p.firstStream += static_cast<uint32_t>(first.streams);
        stream += d.streams;
        if (isGraph) return {};
        STIPPLE_TRY(readCounts(part.pairs, d.parentCodes, d.ownCodes, node, path, used, p, out.greaterThan));
        p.parentCounts.first += static_cast<uint32_t>(first.steps);
        p.ownCounts.first += static_cast<uint32_t>(first.steps);
        return {};
    };
    for (size_t i = 0; i < out.nodes.size(); ++i) {
        const uint64_t number = first.nodes + i;
        STIPPLE_TRY(read(number, out.nodes[i]));
        for (uint32_t k = 0; k < out.nodes[i].furtherPayloads; ++k) {
            FurtherPayload& p = out.further.emplace_back();
            p.node = static_cast<uint32_t>(number);
            STIPPLE_TRY(read(number, p));
        }
    }
    if (used != part.pairs.size()) return tl::unexpected(damagedStore(path, "there are more code counts than nodes"));
    out.groups = part.groups;
    out.runs = part.runs;
    out.parents = part.parents;
    out.groupTextures = part.groupTextures;
    return out;
}

Places placesAfter(const TablePart& part, const Places& first) {
    Places after = first;
    after.nodes += part.nodes.size();
    after.further += part.further.size();
    after.streams += part.streams.size();
    after.steps += part.greaterThan.size();
    after.groups += part.groups.size();
    after.runs += part.runs.size();
    after.parents += part.parents.size();
    after.groupTextures += part.groupTextures.size();
    for (const Node& n : part.nodes) after.children += static_cast<uint64_t>(__builtin_popcount(n.childMask));
    return after;
}

Result<void> readNodes(const ByteSource& file, const Head& head, Hierarchy& h) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readSection(file, head.nodes, head.nodes.rawBytes, "node table"));
    const uint8_t* at = bytes.data();
    PartOnDisk part;
    part.nodes = takeArray<NodeOnDisk>(at, head.nodeCount);
    uint64_t payloads = head.nodeCount;
    for (const NodeOnDisk& d : part.nodes) {
        if (d.furtherPayloads >= kMostPayloads) return tooManyPayloads(file.path());
        payloads += d.furtherPayloads;
    }
    if (payloads > file.sizeBytes() / kFewestChunkBytes)
        return tl::unexpected(damagedStore(file.path(), "it has more payloads than its bytes can hold"));
    STIPPLE_ASSIGN(const Names names, readPayloads(file, head, payloads, part));
    uint64_t codes = 0;
    for (const PayloadOnDisk& d : part.payloads) codes += uint64_t{d.parentCodes} + d.ownCodes;
    STIPPLE_TRY(checkPart(part, payloads, names, h.isGraph, file.path()));  // before memory is taken for counts
    STIPPLE_ASSIGN(part.pairs, readPairs(file, head, codes));
    STIPPLE_ASSIGN(TablePart table, partInMemory(part, names, {}, h.isGraph, file.path()));
    h.nodes = std::move(table.nodes);
    h.further = std::move(table.further);
    h.streams = std::move(table.streams);
    h.greaterThan = std::move(table.greaterThan);
    describeKinds(h);
    return {};
}

Result<bool> readOldNodes(const ByteSource& file, const Head& head, Hierarchy& h) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readSection(file, head.nodes, head.nodes.rawBytes, "node table"));
    const uint8_t* at = bytes.data();
    const auto onDisk = takeArray<OldNodeOnDisk>(at, head.nodeCount);
    uint64_t codes = 0;
    for (const OldNodeOnDisk& d : onDisk)
        if (!isPossibleCount(d.records, d.parentCodes, d.ownCodes, codes))
            return tl::unexpected(damagedStore(file.path(), "the code counts are not possible"));
    STIPPLE_ASSIGN(const std::vector<CodeCount> pairs, readPairs(file, head, codes));
    h.nodes.resize(head.nodeCount);
    uint64_t used = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) {
        Node& n = h.nodes[i];
        moveNode(n, onDisk[i], kFromDisk);
        movePayload(n, onDisk[i], kFromDisk);
        // Groups of triangles have none; whether it is one is known once the mesh section is read.
        if (pairs.empty()) continue;
        for (size_t a = 0; a < 3 && n.level > 32 && n.parent < i; ++a)
            n.cell.at(a) |= 2 * h.nodes[n.parent].cell.at(a) >> 32 << 32;
        STIPPLE_TRY(
            readCounts(pairs, onDisk[i].parentCodes, onDisk[i].ownCodes, i, file.path(), used, n, h.greaterThan));
    }
    if (used != pairs.size()) return tl::unexpected(damagedStore(file.path(), "there are more code counts than nodes"));
    return !pairs.empty();
}

void setKindOfAll(Hierarchy& h, Kind kind) {
    for (Node& n : h.nodes) setKind(n, kind);
    describeKinds(h);
}

PartOnDisk partOnDisk(const Hierarchy& h, uint32_t begin, uint32_t end, uint32_t& group) {
    PartOnDisk out;
    const auto stream = [&](const Stream& s) { moveStream(s, out.streams.emplace_back(), kToDisk); };
    const auto payload = [&](const Payload& p) {
        PayloadOnDisk& d = out.payloads.emplace_back();
        movePayload(p, d, kToDisk);
        d.kind = static_cast<uint8_t>(p.kind);
        d.codec = static_cast<uint8_t>(p.codec);
        const size_t before = out.streams.size();
        stream({p.chunkOffset, p.chunkHash, p.chunkBytes, StreamId::records});
        if (p.attributeBytes > 0)
            stream({p.chunkOffset + p.chunkBytes, p.attributeHash, p.attributeBytes, StreamId::attributes});
        for (uint32_t k = 0; k < p.streams; ++k) stream(h.streams[p.firstStream + k]);
        d.streams = static_cast<uint16_t>(out.streams.size() - before);
        if (p.kind == Kind::triangles) {
            const MeshGroup& g = out.groups.emplace_back(h.groups.at(group++));
            // (Of what is not there nothing: whoever reads it finds that groups have more than there is.)
            const auto append = [](const auto& from, uint64_t first, uint64_t count, auto& to) {
                const auto at = [&](uint64_t i) {
                    return from.begin() + static_cast<std::ptrdiff_t>(std::min<uint64_t>(i, from.size()));
                };
                to.insert(to.end(), at(first), at(first + count));
            };
            append(h.runs, g.firstRun, g.runs, out.runs);
            append(h.parents, g.firstParent, g.parents, out.parents);
            append(h.groupTextures, g.firstTexture, g.textures, out.groupTextures);
        }
        if (h.isGraph) return;
        appendPairs(h, p.parentCounts, p.records, out.pairs, d.parentCodes);
        appendPairs(h, p.ownCounts, p.records, out.pairs, d.ownCodes);
    };
    for (uint32_t n = begin; n < end; ++n) {
        moveNode(h.nodes[n], out.nodes.emplace_back(), kToDisk);
        h.forEachPayload(n, [&](uint32_t chunk) { payload(h.payload(chunk)); });
    }
    return out;
}

std::vector<uint8_t> meshBytes(const Hierarchy& h) {
    std::vector<uint8_t> out;
    appendArray(std::vector{MeshHead{0, 0, 0, 0, h.textures.size(), h.tiles.size()}}, out);
    appendArray(h.textures, out);
    appendArray(h.tiles, out);
    return out;
}

Result<void> readMesh(const std::vector<uint8_t>& bytes, const std::string& path, bool hasGroups, Hierarchy& h) {
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
    if (!hasGroups && head.groups + head.runs + head.parents + head.groupTextures > 0) return bad();
    const uint8_t* at = bytes.data() + sizeof(head);
    const auto take = [&](auto& to, uint64_t count) {
        to.resize(count);
        if (count > 0) std::memcpy(to.data(), at, count * sizeof(to[0]));
        at += count * sizeof(to[0]);
    };
    if (hasGroups) {
        take(h.groups, head.groups);
        take(h.runs, head.runs);
        take(h.parents, head.parents);
        take(h.groupTextures, head.groupTextures);
    }
    take(h.textures, head.textures);
    take(h.tiles, head.tiles);
    return {};
}

}  // namespace stipple::lod
