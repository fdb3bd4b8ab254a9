// The .stipple file: head | streams | tables | description | foot. Little-endian; every section has a length and a
// hash; the head is written last. A plain web server with range requests can serve it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/file.h"
#include "lod/store/chunk.h"
#include "lod/store/description.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// Of the file format; a store of another version must be built again.
inline constexpr uint32_t kStoreVersion = 10;
/// The same with light of their own in maps of patches, which programs before that do not know.
inline constexpr uint32_t kLightVersion = 11;
/// With an overview (Hierarchy::overviewOf) before the records of the root, which they would draw on top of these.
inline constexpr uint32_t kOverviewVersion = 12;
/// Still read: with one payload a node; such meshes whose coordinates have more than 30 bits; without spacings of
/// records (or with them, and taken for damaged by programs of then); without pages of nodes.
inline constexpr uint32_t kOldVersion = 6, kOldWideMeshVersion = 7, kVersionBefore = 8, kUnpagedVersion = 9;

class NodePages;  // pages.h

/// An opened store. Reading chunks is safe from several threads.
struct Store {
    Hierarchy hierarchy;
    StoreDescription description;
    uint64_t contentHash = 0;
    uint64_t fileBytes = 0;
    std::string path;
    std::shared_ptr<const ByteSource> file;
    std::shared_ptr<NodePages> pages;  ///< of a table that is read as it is needed; such a store is not copied
};

/// Nodes of a page of the table: 2^10, about 100 kB.
inline constexpr uint32_t kLog2PageNodes = 10;

class StoreWriter {
  public:
    static Result<StoreWriter> create(const std::string& path);
    /// Goes on with a file that was left at `temporaryPath` (OutputFile::resume); `bytes` 0: begins.
    static Result<StoreWriter> resume(const std::string& path, const std::string& temporaryPath, uint64_t bytes);
    /// Appends encoded records and their attributes, and says where in `payload`.
    Result<void> appendChunk(const std::vector<uint8_t>& bytes, const std::vector<uint8_t>& attributes,
                             Payload& payload);
    /// Appends a stream of another id; it goes to Hierarchy::streams, those of one payload next to each other.
    Result<Stream> appendStream(StreamId id, const std::vector<uint8_t>& bytes);
    /// Appends chunks that are encoded and described already; returns where they begin.
    Result<uint64_t> appendEncoded(const std::vector<uint8_t>& bytes);
    /// Writes node table, description, foot, then the head. The file stays under its temporary name.
    /// `log2PageNodes`: nodes of a page of the table.
    Result<void> finish(const Hierarchy& hierarchy, const StoreDescription& description,
                        uint32_t log2PageNodes = kLog2PageNodes);
    const std::string& temporaryPath() const { return file_.temporaryPath(); }
    uint64_t contentHash() const { return contentHash_; }
    uint64_t bytes() const { return file_.position(); }
    Result<void> commit() { return file_.commit(); }

  private:
    explicit StoreWriter(OutputFile file) : file_(std::move(file)) {}
    OutputFile file_;
    uint64_t contentHash_ = 0;
};

/// How much of a node table is read when a store is opened: all of it, or the first page, as far as a store has pages
/// (trees that are no stochastic points, from version 10 on). Those who walk along all nodes need all.
enum class Tables : uint8_t { whole, asNeeded };
/// Reads and checks head, foot, node table and description (not the chunks).
Result<Store> openStore(const std::string& path, Tables tables = Tables::whole);
/// Of bytes that are a .stipple file, wherever they are.
Result<Store> openStore(std::shared_ptr<const ByteSource> source, Tables tables = Tables::whole);
/// Reads what is not there of the node table, so that all nodes can be walked along.
Result<void> readWholeTable(const Store& store);
/// Where a chunk lies in the file.
struct ChunkPlace {
    uint64_t offset, hash;
    uint32_t bytes;
};
ChunkPlace chunkPlace(const Hierarchy& h, uint32_t index);
/// Decodes a chunk, whatever it holds.
Result<Chunk> decodeStored(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count,
                           const std::string& where, bool wantLowBits);
/// Reads one chunk, checks its hash, decodes it: what the node holds itself.
Result<Chunk> readChunk(const Store& store, uint32_t chunk, bool wantLowBits = false);
/// The same with an overview before that (Hierarchy::overviewOf), as it is drawn.
Result<Chunk> readDrawnChunk(const Store& store, uint32_t chunk, bool wantLowBits = false);

/// The stream of that id, if the payload has one.
std::optional<Stream> findStream(const Hierarchy& h, uint32_t chunk, StreamId id);
/// Its bytes, as they are in the file; their hash is checked.
Result<std::vector<uint8_t>> readStream(const Store& store, uint32_t chunk, const Stream& stream);
/// Checks the hash of a chunk's attribute streams and decodes the one of attribute `index`, of what readChunk reads.
Result<std::vector<uint8_t>> readAttribute(const Store& store, uint32_t chunk, size_t index);

struct VerifyReport {
    uint64_t nodes = 0, payloads = 0, records = 0, leafRecords = 0;
    uint64_t errorsMeasured = 0;  ///< records (segments, triangles) whose error was measured again
};
/// Reads every chunk and checks all that the cut relies on: hashes, counts per code, order, codes monotone, spheres
/// nested, positions inside their cells; the errors of points and curves are measured again against the leaves, those
/// of simplifications against their triangles. `nodes`: of about that many nodes only, evenly spread (0: all).
Result<VerifyReport> verifyStore(const Store& store, Executor& executor, uint64_t nodes = 0);

}  // namespace stipple::lod
