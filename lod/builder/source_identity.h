// Which input it was, and which build of it: the name of a store in the cache. (What an interrupted build left goes by
// Journal's identity, which is of the points that were read.)
#pragma once

#include <string>

namespace stipple::lod {

/// Of a file: path, size and the times of the last change of content and of place. A copy that keeps its time is
/// another file. As text, to be joined with that of others.
std::string sourceIdentity(const std::string& path);

/// 16 hex digits. `sources`: identities of all files that are read; `settings`: all that decides what the build gives,
/// as text. The versions of stores and builds are in it.
std::string cacheKey(const std::string& sources, const std::string& settings);

}  // namespace stipple::lod
