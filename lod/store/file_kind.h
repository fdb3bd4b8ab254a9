// What a file is, by its first bytes: a name may say anything.
#pragma once

#include <cstdint>
#include <string>

#include "engine/base/byte_source.h"

namespace stipple::lod {

/// Formats that begin with a mark of their own.
enum class FileKind : uint8_t { other, store, las, ply, glb, trk, hair };
/// `other` also of what is no regular file or cannot be read: whoever opens it says why.
FileKind fileKindOf(const std::string& path);
FileKind fileKindOf(const ByteSource& bytes);

/// A built scene: by its mark, or by its name where it has the mark of nothing else (it may be damaged).
bool isStoreFile(const std::string& path);

}  // namespace stipple::lod
