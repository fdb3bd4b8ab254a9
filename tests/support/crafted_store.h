// Stores that somebody wrote on purpose: any field changed, and every hash right again.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lod/store/layout.h"
#include "lod/store/store.h"

namespace stipple::test {

/// A store taken apart. Change what you like, then write it: as version 9, which has one section for all nodes (of
/// pages: tests/unit/pages_test.cpp).
struct CraftedStore {
    lod::layout::Head head{};  ///< lengths, places and hashes are computed anew, but for what `keep` names
    std::vector<lod::layout::NodeOnDisk> nodes;
    std::vector<lod::layout::NameOnDisk> kinds, codecs;
    std::vector<lod::layout::PayloadOnDisk> payloads;  ///< in the order of the nodes
    std::vector<lod::layout::StreamOnDisk> streams;    ///< in the order of the payloads
    std::vector<lod::layout::CodeCount> counts;
    std::string description;
    std::vector<uint8_t> mesh;  ///< section, uncompressed
    std::vector<uint8_t> body;  ///< of the file, from the head's end to the node table: the chunks

    // What the head claims instead of the truth; 0: the truth.
    uint64_t claimNodeCount = 0, claimRawNodes = 0, claimRawCounts = 0, claimRawDescription = 0, claimRawMesh = 0,
             claimRawPayloads = 0, claimKinds = 0, claimPayloads = 0, claimStreams = 0;

    static CraftedStore read(const std::string& path);
    /// Bytes of a file in which every hash is right.
    std::vector<uint8_t> bytes() const;
    void write(const std::string& path) const;

    /// The first stream of payload i.
    lod::layout::StreamOnDisk& streamOf(size_t i);
    /// Another chunk in the place of payload i's.
    void replaceChunk(size_t i, const std::vector<uint8_t>& chunk);
    lod::layout::MeshHead meshHead() const;
    /// Where the arrays of the mesh section begin.
    size_t groupsAt() const { return sizeof(lod::layout::MeshHead); }
    size_t runsAt() const { return groupsAt() + meshHead().groups * sizeof(lod::MeshGroup); }
    size_t parentsAt() const { return runsAt() + meshHead().runs * sizeof(lod::MeshRun); }
    size_t tilesAt() const { return mesh.size() - meshHead().tiles * sizeof(lod::TextureTile); }
};

/// The same store in a file whose node table has pages of 2^log2 nodes. Gives `path`.
std::string withPages(const lod::Store& store, const std::string& path, uint32_t log2);
/// The bytes of a store, told to be of another version; head and foot have their hashes.
std::string ofVersion(std::string bytes, uint32_t version);

/// A chunk of a store encoded again.
std::vector<uint8_t> encodeAgain(const lod::Chunk& chunk);

/// Numbers that a mutation hangs on: of a generator, or the bytes of a fuzzer.
using Dice = std::function<uint64_t(uint64_t below)>;

/// Changes some fields of `crafted`, made from `store`, anywhere: head, nodes, counts, mesh section, description,
/// records. Says what.
std::string mutate(CraftedStore& crafted, const lod::Store& store, const Dice& dice);

/// Small stores of every kind in `folder`: points with an attribute, triangles with a texture, curves, stochastic,
/// triangles of which some lie so far away that their groups have origins and pairs (lod/store/mesh_place.h), nodes
/// with several payloads (mixed_store.h).
std::vector<std::string> smallStores(const std::string& folder);

/// Opens a store, draws it from everywhere on both backends at a small size, and verifies it; whether it was opened.
bool tryEverything(const std::string& path);

}  // namespace stipple::test
