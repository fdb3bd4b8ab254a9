#include "lod/store/colour.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <tuple>

#include "engine/base/words.h"
#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

/// Colour maps as evenly spaced colours, 0xRRGGBB, between which sRGB values are interpolated. Viridis and magma: van
/// der Walt and Smith 2015; turbo: Mikhailov 2019.
constexpr std::array<uint32_t, 2> kGrey{0x101010, 0xf0f0f0};
constexpr std::array<uint32_t, 10> kViridis{0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e,
                                            0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725};
constexpr std::array<uint32_t, 10> kMagma{0x000004, 0x180f3d, 0x440f76, 0x721f81, 0x9e2f7f,
                                          0xcd4071, 0xf1605d, 0xfd9668, 0xfeca8d, 0xfcfdbf};
constexpr std::array<uint32_t, 15> kTurbo{0x30123b, 0x4145ab, 0x4675ed, 0x39a2fc, 0x1bcfd4,
                                          0x24eca6, 0x61fc6c, 0xa4fc3b, 0xd1e834, 0xf3c63a,
                                          0xfe9b2d, 0xf36315, 0xd93806, 0xb11901, 0x7a0403};
/// Of heights that are also lit: no end is dark.
constexpr std::array<uint32_t, 6> kRelief{0x4a7c94, 0x5f9b82, 0x93b071, 0xccb873, 0xe6c79c, 0xf3e6da};

struct AsprsClass {
    const char* name;
    uint32_t colour;  ///< 0xRRGGBB
};
/// LAS 1.4, table 17.
constexpr std::array<AsprsClass, 19> kClasses{{{"never classified", 0x9a9a9a},
                                               {"unclassified", 0xc0c0c0},
                                               {"ground", 0xa0703c},
                                               {"low vegetation", 0xa8d878},
                                               {"medium vegetation", 0x58b048},
                                               {"high vegetation", 0x1f7a34},
                                               {"building", 0xe06040},
                                               {"low point (noise)", 0xff00ff},
                                               {"reserved (key point)", 0xf0f0a0},
                                               {"water", 0x3878e0},
                                               {"rail", 0x705890},
                                               {"road surface", 0x606870},
                                               {"reserved (overlap)", 0xd0b0ff},
                                               {"wire, guard", 0xf8d040},
                                               {"wire, conductor", 0xffb000},
                                               {"transmission tower", 0x00c8c8},
                                               {"wire connector", 0x80f0f0},
                                               {"bridge deck", 0x985040},
                                               {"high noise", 0xff60b0}}};
/// For other categories: hues far apart, in order.
constexpr std::array<uint32_t, 12> kCategories{0x8f8f8f, 0x4e79a7, 0xf28e2b, 0xe15759, 0x76b7b2, 0x59a14f,
                                               0xedc948, 0xb07aa1, 0xff9da7, 0x9c755f, 0x2f4b7c, 0xd4e157};

uint32_t reversed(uint32_t rrggbb) { return (rrggbb >> 16 & 255u) | (rrggbb & 0xff00u) | (rrggbb & 255u) << 16; }

template <size_t N>
uint32_t interpolate(const std::array<uint32_t, N>& map, double t) {
    const double at = std::clamp(std::isnan(t) ? 0.0 : t, 0.0, 1.0) * (N - 1);
    const auto i = std::min(static_cast<size_t>(at), N - 2);
    const double f = at - static_cast<double>(i);
    uint32_t c = 0;
    for (uint32_t shift = 0; shift < 24; shift += 8) {
        const double a = map.at(i) >> shift & 255u, b = map.at(i + 1) >> shift & 255u;
        c |= static_cast<uint32_t>(a + (b - a) * f + 0.5) << shift;
    }
    return reversed(c);
}

bool isClass(const ColourBy& by) { return by.title == "classification"; }

/// A two-sided normal has no sign of its own: the one that points up stands for both.
uint32_t colourOfNormal(const glm::vec3& n, bool isTwoSided) {
    const bool flip = isTwoSided && n.z < 0;
    const auto byte = [&](float v) { return static_cast<uint32_t>(((flip ? -v : v) * 0.5f + 0.5f) * 255.0f + 0.5f); };
    return byte(n.x) | byte(n.y) << 8 | byte(n.z) << 16;
}
uint32_t normalColour(const shared::PointRecord& r) {
    if ((shared::recordFlags(r) & shared::kFlagNoNormal) != 0) return 0x808080;
    const bool isTwoSided = (shared::recordFlags(r) & shared::kFlagTwoSided) != 0;
    return colourOfNormal(glm::vec3(shared::octDecode(r.normal)), isTwoSided);
}

}  // namespace

std::string attributeBehind(const std::string& what) {
    for (const char* own : {"", "auto", "plain", "rgb", "height", "normal"})
        if (what == own) return "";
    if (what == "class") return "classification";
    if (what == "return") return "return_number";
    return what;
}

std::optional<std::pair<double, double>> parseRange(const std::string& text) {
    std::istringstream in(text);
    double low = 0, high = 0;
    char comma = 0;
    if (!(in >> low >> comma >> high) || comma != ',' || !(in >> std::ws).eof() || !std::isfinite(low) ||
        !std::isfinite(high) || !std::isfinite(high - low) || !(low < high))
        return {};
    return std::pair(low, high);
}

Result<ColourBy> parseColourBy(const std::string& what, const std::string& map, const std::string& range,
                               const StoreDescription& description) {
    ColourBy by;
    by.title = what;
    by.up = description.up;
    by.isChosenHere = what == "auto" && !description.hasColour;
    if (!by.isChosenHere && (what.empty() || what == "auto" || what == "plain" || what == "rgb")) {
        if (what == "rgb" && !description.hasColour)
            return fail(ErrorKind::usage, "the scene has no colours of its own", "--colour rgb",
                        "leave --colour out to see it shaded");
        return by;
    }
    if (what == "normal") {
        if (!description.hasNormals) return fail(ErrorKind::usage, "the scene has no normals", "--colour normal");
        by.mode = ColourMode::normal;
        return by;
    }
    if (what == "height" || by.isChosenHere) {
        by.title = "height";
        if (by.isChosenHere) by.map = ColourMap::relief;
        by.mode = ColourMode::height;
        by.low = description.lowHeight;
        by.high = description.highHeight;
    } else {
        const std::string name = attributeBehind(what);
        const auto& attributes = description.attributes;
        const auto found =
            std::find_if(attributes.begin(), attributes.end(), [&](const AttributeInfo& a) { return a.name == name; });
        if (found == attributes.end()) {
            std::string known = "rgb, height, normal";
            std::vector<std::string> words{"rgb", "height", "normal", "class", "return", "auto", "plain"};
            for (const AttributeInfo& a : attributes) {
                known += ", " + a.name;
                words.push_back(a.name);
            }
            if (const std::string meant = nearestWord(name, words); !meant.empty())
                known = fmt::format("did you mean '{}'? It has {}", meant, known);
            else
                known = "it has " + known;
            return fail(ErrorKind::usage, fmt::format("the scene has no attribute '{}'", name), "--colour",
                        known + "; others are kept when it is built with --attributes");
        }
        by.mode = ColourMode::attribute;
        by.attribute = static_cast<size_t>(found - attributes.begin());
        by.title = name;
        by.low = found->low;
        by.high = found->high;
        by.isCategorical = found->aggregate == Aggregate::mode && range.empty() && map.empty();
        by.map = name == "intensity" ? ColourMap::grey : ColourMap::viridis;
    }
    if (!map.empty()) {
        const auto known = std::find(kColourMapNames.begin(), kColourMapNames.end(), map);
        if (known == kColourMapNames.end())
            return fail(ErrorKind::usage, fmt::format("'{}' is not a colour map", map), "--colour-map",
                        "grey, viridis, magma, turbo or relief");
        by.map = static_cast<ColourMap>(known - kColourMapNames.begin());
    }
    if (!range.empty()) {
        const auto ends = parseRange(range);
        if (!ends)
            return fail(ErrorKind::usage, fmt::format("'{}' is not a range", range), "--colour-range", "e.g. 0,255");
        std::tie(by.low, by.high) = *ends;
    }
    by.isConstant = by.low == by.high;
    if (by.isConstant) by.high = by.low + 1;
    return by;
}

uint32_t colourOf(const ColourBy& by, double value) {
    if (by.isCategorical) {
        const double whole = std::round(value);
        if (isClass(by) && whole >= 0 && whole < static_cast<double>(kClasses.size()))
            return reversed(kClasses.at(static_cast<size_t>(whole)).colour);
        const auto n = static_cast<uint64_t>(std::max(0.0, std::min(whole, 1e15)));
        return reversed(kCategories.at(n % kCategories.size()));
    }
    const double t = (value - by.low) / (by.high - by.low);
    switch (by.map) {
        case ColourMap::grey:
            return interpolate(kGrey, t);
        case ColourMap::magma:
            return interpolate(kMagma, t);
        case ColourMap::turbo:
            return interpolate(kTurbo, t);
        case ColourMap::relief:
            return interpolate(kRelief, t);
        case ColourMap::viridis:
            break;
    }
    return interpolate(kViridis, t);
}

std::string categoryName(const ColourBy& by, double value) {
    if (isClass(by) && value >= 0 && value < static_cast<double>(kClasses.size()))
        return fmt::format("{:.0f} {}", value, kClasses.at(static_cast<size_t>(value)).name);
    return fmt::format("{:.0f}", value);
}

namespace {

/// Of the samples of patches; what maps show is not that, so there are none.
void recolourPatches(const ColourBy& by, const Hierarchy& h, uint32_t index, Chunk& chunk) {
    const Node& node = h.nodes[h.nodeOf(index)];
    const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
    for (size_t b = 0; b < chunk.patchBlocks.size(); ++b) {
        shared::PatchBlock& block = chunk.patchBlocks[b];
        const PatchPlane& plane = chunk.patchPlanes[b];
        const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
        const glm::dvec3 along = by.up * frame * h.unit;  // heights of a step along U, V and N
        const double base = glm::dot(by.up, h.origin + h.unit * (corner + plane.origin));
        block.map = 0;
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            const uint32_t code = block.heights[s / 2] >> (16 * (s % 2)) & 0xffffu;
            const glm::dvec3 at((block.place % 65536 + s % shared::kPatchStride) * double{plane.step},
                                (block.place / 65536 + s / shared::kPatchStride) * double{plane.step},
                                std::ldexp(code, plane.quantumExponent));
            const uint32_t rgb =
                by.mode == ColourMode::height
                    ? colourOf(by, base + glm::dot(along, at))
                    : colourOfNormal(glm::vec3(frame * glm::dvec3(shared::octDecode(block.normals[s]))), true);
            block.colours[s] = (block.colours[s] & 0xff000000u) | rgb;
        }
    }
}

}  // namespace

void recolour(const ColourBy& by, const Store& store, uint32_t index, Chunk& chunk,
              const std::vector<uint8_t>& values) {
    const Hierarchy& h = store.hierarchy;
    const Payload& payload = h.payload(index);
    if (by.mode == ColourMode::height || by.mode == ColourMode::normal) recolourPatches(by, h, index, chunk);
    const auto set = [](shared::PointRecord& r, uint32_t rgb) { r.colour = (r.colour & 0xff000000u) | rgb; };
    if (by.mode == ColourMode::normal) {
        for (shared::PointRecord& r : chunk.records) set(r, normalColour(r));
    } else if (by.mode == ColourMode::height) {
        const glm::dvec3& up = by.up;
        const double base = glm::dot(up, h.origin + h.unit * h.recordOrigin(h.nodes[h.nodeOf(index)], payload));
        const glm::dvec3 step = up * (h.unit * std::exp2(payload.stepShift));
        for (shared::PointRecord& r : chunk.records) {
            const glm::dvec3 q(shared::recordX(r), shared::recordY(r), shared::recordZ(r));
            set(r, colourOf(by, base + glm::dot(step, q)));
        }
    } else if (by.mode == ColourMode::attribute) {
        const AttributeInfo& info = store.description.attributes.at(by.attribute);
        const size_t width = bytesOf(info.type);
        for (size_t i = 0; i < chunk.records.size(); ++i)
            set(chunk.records[i], isNoData(info, values.data() + i * width)
                                      ? kNoDataColour
                                      : colourOf(by, attributeValue(info, values.data() + i * width)));
    }
}

}  // namespace stipple::lod
