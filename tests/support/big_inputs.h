// Inputs that are large enough to be built out of core.
#pragma once

#include <cstdint>
#include <string>

namespace stipple::test {

/// A wavy ground as PLY of edge x edge vertices, finer by far in one corner; `seed` not 0: faces in random order.
void writeGround(const std::string& path, int edge, unsigned seed, bool withNormals = true);
/// A lawn (.hair) of `curves` blades of 20 segments, half of them around one place.
void writeLawn(const std::string& path, uint32_t curves);

}  // namespace stipple::test
