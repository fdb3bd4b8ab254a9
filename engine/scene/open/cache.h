// Stores that were built from raw inputs, kept for the next time.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/scene/open/open_scene.h"

namespace stipple::scene {

Result<std::shared_ptr<const lod::Store>> openStoreFile(const std::string& path,
                                                        lod::Tables tables = lod::Tables::whole);

/// Builds a store into a path.
using StoreMaker = std::function<Result<lod::BuildReport>(const std::string& path, Progress& progress)>;

/// The store that `inputs` and `build` give, made if it is not in the cache, or not whole there. `part`: which of their
/// stores. What somebody else is making is waited for. What the cache holds beyond its limit goes then, the least
/// recently used first; what is open stays.
Result<std::shared_ptr<const lod::Store>> openCached(const std::vector<std::string>& inputs, const OpenSettings& build,
                                                     const std::string& part, const StoreMaker& make);

}  // namespace stipple::scene
