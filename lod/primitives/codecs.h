// How the records of a payload are coded: one record per codec. The kind owns what records are, the source owns how
// they are coded, so that files of others can be drawn as they are.
#pragma once

#include <string>
#include <string_view>

#include "engine/base/result.h"
#include "lod/store/chunk.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

struct CodecTraits {
    const char* name;  ///< in files: at most 23 letters, and never another meaning
    Kind kind;         ///< of what is decoded
    Result<Chunk> (*decode)(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count,
                            const std::string& where, bool wantLowBits);
    /// Fewest bytes that the payload takes once zstd is undone: what claims more records than its bytes can hold is
    /// refused before memory is taken.
    uint64_t (*fewestBytes)(const Hierarchy& h, uint32_t chunk);
};

#define STIPPLE_KIND(name) extern const CodecTraits name##Codec;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

const CodecTraits& traitsOf(Codec codec);

}  // namespace stipple::lod
