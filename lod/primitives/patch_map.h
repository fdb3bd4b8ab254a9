// Maps of patches (patch.h) and their mips, as stores keep them and as blocks hold them (shaders/shared/patch_map.h).
//
// A texel of a mip is the mean, in linear light, of the finer one at its place (weight 1/2 along each axis) and of its
// neighbours (1/4 each), of those that there are: four texels around a place of a drawn cell are known on every level.
#pragma once

#include <span>
#include <vector>

#include "lod/primitives/patch.h"
#include "shaders/shared/patch_map.h"

namespace stipple::lod {

/// Lower bits of PatchBlock::map.
uint32_t mapCode(const Patch& patch);
/// The same of all patches of a payload, Payload::maps: the largest of each, without materials.
uint8_t mapCodeOf(std::span<const Patch> patches);

/// A word of PatchMap::light: the emission (linear; 2^15 at most), or that a place is shown as it is, and not lit.
uint32_t packLight(const glm::vec3& emission, bool isUnlit);
/// Is that what it says?
inline bool keepsColour(uint32_t light) { return (light & shared::kMapUnlit) != 0; }
/// Linear; of what is not lit 0.
glm::vec3 emissionOf(uint32_t light);
/// A colour (sRGB) and what a place beside it sends, as one colour: of records that send nothing by themselves.
uint32_t withEmission(uint32_t colour, uint32_t light);

/// Normals of maps stand on steps of so many of their 65535 codes: 0.5 degrees off at most.
constexpr int kMapNormalStep = 128;

/// Texels of a level of a map: 0 is the map itself. The last ones may lie beyond the patch.
struct MapLevel {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> isKnown;
    std::vector<uint32_t> colours, normals, light;  ///< as PatchMap has them
    size_t at(uint32_t i, uint32_t j) const { return size_t{j} * width + i; }
};

/// The map itself; `isKnown`: some drawn cell touches the texel. Of a patch without one, a texel a sample.
MapLevel mapOf(const Patch& patch);
/// The level above.
MapLevel coarser(const MapLevel& fine, bool hasMaterials);
/// The colours of the map's level with a texel a sample, in the places of those of the samples in use.
void sampleColours(Patch& patch);

/// All levels of a patch's map, to be cut into blocks.
class PatchMips {
  public:
    explicit PatchMips(const Patch& patch);
    /// Appends those of the block whose first sample is (i, j); returns its PatchBlock::map. Of a patch without a map:
    /// nothing, and 0.
    uint32_t appendTo(std::vector<uint32_t>& texels, uint32_t i, uint32_t j) const;

  private:
    uint32_t density_ = 0, flags_ = 0;
    std::vector<MapLevel> levels_;
};

}  // namespace stipple::lod
