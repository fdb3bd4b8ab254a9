// Is a file a store? By its bytes, not by its name.
#pragma once

#include <string>

namespace stipple::lod {

/// Begins as a finished store does. False for what cannot be read.
bool isStoreFile(const std::string& path);

}  // namespace stipple::lod
