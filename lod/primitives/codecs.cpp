// The table of codecs: the vertex codec of meshoptimizer under zstd (lod/store/chunk.h) of each kind.
#include "lod/primitives/codecs.h"

#include <array>

namespace stipple::lod {

const CodecTraits& traitsOf(Codec codec) {
    static constexpr std::array<const CodecTraits*, kCodecs> kTraits{
#define STIPPLE_KIND(name) &name##Codec,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
    };
    return *kTraits.at(static_cast<size_t>(codec));
}

}  // namespace stipple::lod
