// Hashes of what a store holds once it is decoded, wherever it lies in the file.
#pragma once

#include "lod/store/store.h"

namespace stipple::test {

/// Of every chunk (of the root's with and without its overview) and every attribute stream, in the order of the chunks.
uint64_t hashRecords(const lod::Store& store);
/// Of what the cut reads of the nodes: spheres, errors, counts, places; not where chunks lie in the file.
uint64_t hashTable(const lod::Store& store);

}  // namespace stipple::test
