#pragma once

#include <cstdint>

namespace stipple::lod {

/// Of what the same input and settings give. Raise it with every change, in a reader, a build or the record layout,
/// that gives other bytes for input that could be read before: stores in the cache and interrupted builds of another
/// version are made anew. (kStoreVersion is of what this program can read.)
inline constexpr uint64_t kBuildVersion = 30;

}  // namespace stipple::lod
