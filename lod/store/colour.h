// Colour by attribute: decoded records get the colour of a value instead of their own. It happens when a chunk is
// decoded, so backends and shaders know nothing of it, and a change of colours is a change of chunks.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lod/store/store.h"

namespace stipple::lod {

enum class ColourMode : uint8_t { own, normal, height, attribute };
enum class ColourMap : uint8_t { grey, viridis, magma, turbo, relief };
inline constexpr std::array<const char*, 5> kColourMapNames{"grey", "viridis", "magma", "turbo", "relief"};

struct ColourBy {
    ColourMode mode = ColourMode::own;
    size_t attribute = 0;        ///< of StoreDescription::attributes
    bool isCategorical = false;  ///< a colour for each whole value, instead of a map over a range
    ColourMap map = ColourMap::viridis;
    double low = 0, high = 1;   ///< values at the ends of the map; beyond them it stays at its ends
    glm::dvec3 up{0, 0, 1};     ///< heights are along it
    bool isChosenHere = false;  ///< nobody asked for it: a scan without colours is easier to read
    bool isConstant = false;    ///< all values are `low`; `high` only keeps the map a map
    std::string title;          ///< for the legend
    bool needsAttributes() const { return mode == ColourMode::attribute; }
};

/// "LOW,HIGH": finite, the lower one first; nothing where it is none.
std::optional<std::pair<double, double>> parseRange(const std::string& text);

/// What a person asks for: auto (own colours, or of points without any the height), plain (own colours, or grey), rgb,
/// intensity, class, return, height, normal or the name of an attribute; `map` a name or empty; `range` "LOW,HIGH" or
/// empty for the 2nd to 98th percentile.
Result<ColourBy> parseColourBy(const std::string& what, const std::string& map, const std::string& range,
                               const StoreDescription& description);
/// The attribute that `what` needs; empty: none.
std::string attributeBehind(const std::string& what);

/// sRGB colour of records whose attribute has no data: grey, whatever the map.
inline constexpr uint32_t kNoDataColour = 0x808080u;
/// r | g << 8 | b << 16, sRGB.
uint32_t colourOf(const ColourBy& by, double value);
/// What a category is called: the ASPRS name of a class, otherwise the number.
std::string categoryName(const ColourBy& by, double value);

/// Gives the records of a chunk their colours, and the samples of its patches theirs by height or normal: those have no
/// attributes, and no maps then. `values`: the attribute's stream, if `by` needs one.
void recolour(const ColourBy& by, const Store& store, uint32_t node, Chunk& chunk, const std::vector<uint8_t>& values);

}  // namespace stipple::lod
