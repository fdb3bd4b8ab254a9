// Elevation patches: a piece of surface as heights over a tilted plane, on a regular grid with an irregular support
// (Ochotta & Hiller 2006, 3.1).
//
//   sample (i, j)   stands at origin + step (i U + j V) + quantum code(i, j) N; code 0: there is none
//   cell (i, j)     lies between the samples (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1); where its bit is set it is
//                   two triangles, cut along the diagonal whose heights differ less (no bit is kept for that)
//
// A sample is there where one of the four cells around it is. The plane lies one quantum below the lowest sample.
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <vector>

namespace stipple::lod {

/// Attributes of a patch at a resolution of their own: texels on the corners of a lattice 2, 4 or 8 times as fine as
/// that of its samples (k), row by row, (width - 1) k + 1 of them in the first. Those that no drawn cell touches say
/// nothing. What sends light, or is not lit, and has colours of its samples, has light alone, of k = 1.
struct PatchMap {
    static constexpr uint32_t kMostDensity = 3;
    uint32_t density = 0;           ///< log2 k; 0: neither colours nor normals
    bool hasMaterials = false;      ///< numbers of materialGrid() stand above the colours
    std::vector<uint32_t> colours;  ///< sRGB 8 + 8 + 8
    std::vector<uint32_t> normals;  ///< octahedral 16 + 16 of (U, V, N); empty: those of the samples are mixed
    std::vector<uint32_t> light;    ///< mapEmission (shaders/shared/patch_map.h); empty: lit, and sends none
    bool isThere() const { return density > 0 || !light.empty(); }
    bool operator==(const PatchMap&) const = default;
};

struct Patch {
    static constexpr uint32_t kMostSide = 4096;  ///< samples

    glm::dvec3 origin{0};            ///< scene units
    glm::quat turn{1, 0, 0, 0};      ///< from (x, y, z) to (U, V, N); normalised in fp64 where it is used
    float step = 1;                  ///< between samples, scene units
    int32_t quantumExponent = 0;     ///< a height code is 2^that scene units
    uint32_t width = 0, height = 0;  ///< samples
    std::vector<uint8_t> cells;      ///< (width - 1) (height - 1), 0 or 1, row by row
    std::vector<uint16_t> heights;   ///< width * height codes
    std::vector<uint32_t> normals;   ///< octahedral 16 + 16 of (U, V, N), as long as `heights`
    std::vector<uint32_t> colours;   ///< sRGB 8 + 8 + 8, as long as `heights`
    /// Numbers in the list of materials that the patches come with, as long as `heights`; empty: all have the first.
    std::vector<uint8_t> materials;
    PatchMap map;  ///< where there is one, samples have the colours of its mips (sampleColours)
    /// Bounds, scene units: no place of the patch is farther from the source than the first, no place of the source
    /// that the patch stands for farther from the patch than the second.
    double errorToSource = 0, errorFromSource = 0;

    double quantum() const { return std::ldexp(1.0, quantumExponent); }
    size_t at(uint32_t i, uint32_t j) const { return size_t{j} * width + i; }
    bool hasCell(uint32_t i, uint32_t j) const { return cells[size_t{j} * (width - 1) + i] != 0; }
    /// Columns U, V, N.
    glm::dmat3 frame() const { return glm::mat3_cast(glm::normalize(glm::dquat(turn))); }
    size_t samples() const;
    size_t drawnCells() const;
};

/// The corners of a cell's two triangles as offsets 0 to 3 (1: right, 2: up), counter-clockwise seen from above. Codes
/// of its lower left, lower right, upper left and upper right sample; where both diagonals differ alike, it is 0 to 3.
inline const std::array<uint8_t, 6>& cellTriangles(int h0, int h1, int h2, int h3) {
    static constexpr std::array<uint8_t, 6> kRising{0, 1, 3, 0, 3, 2}, kFalling{0, 1, 2, 1, 3, 2};
    return std::abs(h0 - h3) <= std::abs(h1 - h2) ? kRising : kFalling;
}

/// Samples of a patch in scene units, and what a cell is drawn as.
class PatchSurface {
  public:
    explicit PatchSurface(const Patch& patch) : patch_(patch), frame_(patch.frame()), quantum_(patch.quantum()) {}
    glm::dvec3 position(size_t sample) const {
        const auto i = static_cast<double>(sample % patch_.width), j = static_cast<double>(sample / patch_.width);
        return patch_.origin +
               frame_ * glm::dvec3(i * double{patch_.step}, j * double{patch_.step}, quantum_ * patch_.heights[sample]);
    }
    /// Calls use(a, b, c) with samples, for each triangle.
    template <typename Use>
    void triangles(const Use& use) const {
        for (uint32_t j = 0; j + 1 < patch_.height; ++j)
            for (uint32_t i = 0; i + 1 < patch_.width; ++i)
                if (patch_.hasCell(i, j)) trianglesOf(i, j, use);
    }
    template <typename Use>
    void trianglesOf(uint32_t i, uint32_t j, const Use& use) const {
        const size_t at = patch_.at(i, j);
        const std::array<size_t, 4> corner{at, at + 1, at + patch_.width, at + patch_.width + 1};
        const auto& h = patch_.heights;
        const auto& t = cellTriangles(h[corner[0]], h[corner[1]], h[corner[2]], h[corner[3]]);
        use(corner[t[0]], corner[t[1]], corner[t[2]]);
        use(corner[t[3]], corner[t[4]], corner[t[5]]);
    }
    const glm::dmat3& frame() const { return frame_; }

  private:
    const Patch& patch_;
    glm::dmat3 frame_;
    double quantum_;
};

/// What is wrong with a patch: sizes of arrays, sides, numbers that are none, cells without samples, samples without
/// cells; empty: nothing.
std::string patchFault(const Patch& patch);

}  // namespace stipple::lod
