// A picture file as its channels have it, read by OpenImageIO directly: nothing between the file and the comparison.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple::test {

/// All channels of a picture. Floats keep their bits; bytes are 0 to 255.
struct Planes {
    uint32_t width = 0, height = 0;
    bool isFloat = false;
    std::vector<std::string> names;  ///< of the channels, as the file orders them
    std::vector<float> values;       ///< width x height x names.size(), row by row from the top
    /// Values of one channel; empty where there is none of that name.
    std::vector<float> plane(const std::string& name) const;
};

/// Throws std::runtime_error with the file's name where it cannot be read.
Planes readPlanes(const std::string& path);

/// Writes RGBA bytes, row by row from the top, in the format of the name's extension (.webp, ...). Throws likewise.
void writeBytes(const std::string& path, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba);
/// The same of RGB floats (.hdr, ...).
void writeFloats(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& rgb);

/// Of size, names and the bits of all values.
uint64_t hashPlanes(const Planes& planes);

struct PlanesDiffer {
    double psnr = 0;        ///< dB, of the channels R, G, B; floats against the largest value of either picture
    double largest = 0;     ///< difference, in the unit of its channel
    std::string largestIn;  ///< name of that channel
    uint64_t pixels = 0;    ///< with any difference, bit by bit
    bool areAlike = true;   ///< in size and channels: else nothing was compared
};
PlanesDiffer comparePlanes(const Planes& a, const Planes& b);

}  // namespace stipple::test
