// The tables of a store as bytes: of nodes, payloads and their streams, and of meshes.
#pragma once

#include <cstring>
#include <string>
#include <vector>

#include "engine/base/file.h"
#include "lod/store/hierarchy.h"
#include "lod/store/layout.h"

namespace stipple::lod {

/// Streams of one payload, at most.
inline constexpr uint32_t kMostStreams = 16;

/// `most`: bytes that what was read before allows it to have; checked before any memory is taken.
Result<std::vector<uint8_t>> readSection(const ByteSource& file, const layout::Section& s, uint64_t most,
                                         const char* name);

/// The kinds and codecs of a file, by its own numbers.
struct Names {
    std::vector<Kind> kinds;
    std::vector<Codec> codecs;
};

/// What the table says of some nodes that follow each other, as it is in the file ...
struct PartOnDisk {
    std::vector<layout::NodeOnDisk> nodes;
    std::vector<layout::PayloadOnDisk> payloads;
    std::vector<layout::StreamOnDisk> streams;
    std::vector<layout::CodeCount> pairs;
    std::vector<MeshGroup> groups;
    std::vector<MeshRun> runs;
    std::vector<uint32_t> parents, groupTextures;
};
/// ... and in memory: parts of the arrays of a hierarchy.
struct TablePart {
    std::vector<Node> nodes;
    std::vector<FurtherPayload> further;
    std::vector<Stream> streams;
    std::vector<uint32_t> greaterThan;
    std::vector<MeshGroup> groups;
    std::vector<MeshRun> runs;
    std::vector<uint32_t> parents, groupTextures;
};
/// `first`: what stands before it. What it says of itself fits together; what it says is not checked (check.h).
Result<TablePart> partInMemory(const PartOnDisk& part, const Names& names, const layout::Places& first, bool isGraph,
                               const std::string& path);
/// What stands before the part that follows.
layout::Places placesAfter(const TablePart& part, const layout::Places& first);
/// Nodes `begin` to `end`; `group`: the first of their groups, which moves on.
PartOnDisk partOnDisk(const Hierarchy& h, uint32_t begin, uint32_t end, uint32_t& group);

/// Of versions 8 and 9: nodes, payloads, streams and counts per code.
Result<void> readNodes(const ByteSource& file, const layout::Head& head, Hierarchy& h);
/// The same of versions 6 and 7, but for the kinds; were there counts per code?
Result<bool> readOldNodes(const ByteSource& file, const layout::Head& head, Hierarchy& h);
/// Every node has one payload, of this kind.
void setKindOfAll(Hierarchy& h, Kind kind);
/// What of a hierarchy follows from its nodes, all of which are there.
void describeKinds(Hierarchy& h);
/// `hasGroups`: groups and their arrays stand there, too.
Result<void> readMesh(const std::vector<uint8_t>& bytes, const std::string& path, bool hasGroups, Hierarchy& h);
std::vector<uint8_t> meshBytes(const Hierarchy& h);

/// The names of this program.
std::vector<uint8_t> namesOnDisk();
/// `count` names each, from `at` on.
Result<Names> readNames(const uint8_t* at, uint64_t kinds, uint64_t codecs, const std::string& path);
inline constexpr uint64_t kMostNames = 64;

// ---- arrays as bytes

template <typename T>
void appendArray(const std::vector<T>& from, std::vector<uint8_t>& to) {
    const size_t at = to.size();
    to.resize(at + from.size() * sizeof(T));
    if (!from.empty()) std::memcpy(to.data() + at, from.data(), from.size() * sizeof(T));
}
/// `count` values of T from `at` on, which moves behind them.
template <typename T>
std::vector<T> takeArray(const uint8_t*& at, uint64_t count) {
    std::vector<T> out(count);
    if (count > 0) std::memcpy(static_cast<void*>(out.data()), at, count * sizeof(T));
    at += count * sizeof(T);
    return out;
}

}  // namespace stipple::lod
