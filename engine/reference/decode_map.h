// Maps of patches in fp64, from the description of the format alone (shaders/shared/patch_map.h): levels of texels on
// the corners of ever coarser cells, trilinear.
#pragma once

#include "engine/reference/decode.h"

namespace stipple::reference {

class MapReader {
  public:
    /// `words`: of its chunk; `map`: what the block says: 2 bits log2 of texels along a cell (0: no colours), 1 bit has
    /// normals, 1 bit has materials, 1 bit has light, 27 bits first word.
    MapReader(const std::vector<uint32_t>& words, uint32_t map) : words_(words), map_(map) {
        const uint32_t k = 1u << map % 4;
        size_t at = map / 32;
        for (uint32_t edge = k; edge > 0; edge /= 2) addLevel(16 * edge, 8 * edge, at);
        for (uint32_t cells = 2; cells <= 8; cells *= 2) addLevel(16 / cells, 8 / cells, at);
        texels_ = at - map / 32;
    }
    bool isThere() const { return map_ != 0; }
    bool hasColours() const { return map_ % 4 != 0; }
    bool hasNormals() const { return map_ / 4 % 2 != 0; }
    bool hasMaterials() const { return map_ / 8 % 2 != 0; }
    bool hasLight() const { return map_ / 16 % 2 != 0; }

    struct Look {
        glm::dvec3 colour{0}, normal{0};  ///< linear; of (U, V, N), any length
        glm::dvec2 finish{0};             ///< metallic and roughness
        glm::dvec3 emission{0};           ///< linear
        double unlit = 0;                 ///< share of the place
    };
    /// `at`: samples from the block's first one; `cells`: that a pixel covers there.
    Look look(const glm::dvec2& at, double cells) const {
        const double texels = cells * static_cast<double>(levels_[0].across) / 16;
        const double lod = std::clamp(std::log2(std::max(texels, 1e-9)), 0.0, static_cast<double>(levels_.size() - 1));
        const auto finer = static_cast<size_t>(lod);
        Look out;
        add(levels_[finer], at, 1 - (lod - std::floor(lod)), out);
        add(levels_[std::min(finer + 1, levels_.size() - 1)], at, lod - std::floor(lod), out);
        return out;
    }

  private:
    struct Level {
        uint32_t across, up;  ///< cells of its own
        size_t first;
    };
    void addLevel(uint32_t across, uint32_t up, size_t& at) {
        levels_.push_back({across, up, at});
        at += (size_t{across} + 1) * (up + 1);
    }
    void add(const Level& of, const glm::dvec2& at, double share, Look& out) const {
        const glm::dvec2 most(of.across, of.up);
        const glm::dvec2 q = glm::clamp(at * (static_cast<double>(of.across) / 16), glm::dvec2(0), most);
        const glm::dvec2 low = glm::min(glm::floor(q), most - 1.0), part = q - low;
        for (uint32_t c = 0; c < 4; ++c) {
            const glm::dvec2 corner(c % 2, c / 2);
            const glm::dvec2 near = 1.0 - glm::abs(part - corner);
            const double w = share * near.x * near.y;
            const size_t texel = of.first + static_cast<size_t>(low.y + corner.y) * (of.across + 1) +
                                 static_cast<size_t>(low.x + corner.x);
            if (hasLight())
                addLight(words_[texel + texels_ * ((hasColours() ? 1 : 0) + (hasNormals() ? 1 : 0))], w, out);
            if (!hasColours()) continue;
            const uint32_t word = words_[texel];
            out.colour +=
                w * glm::dvec3(decodeSrgb(word % 256), decodeSrgb(word / 256 % 256), decodeSrgb(word / 65536 % 256));
            const uint32_t number = word >> 24;  // of 16 steps each: from rough to smooth, and from plain to metal
            out.finish += w * glm::dvec2(number / 16 / 15.0, 1 - number % 16 / 15.0);
            if (hasNormals()) out.normal += w * decodeDirection(words_[texel + texels_]);
        }
    }
    /// The highest bit: not lit; else four of a power of two, and a byte a colour.
    static void addLight(uint32_t word, double w, Look& out) {
        if (word >= 1u << 31) {
            out.unlit += w;
            return;
        }
        const double times = w * static_cast<double>(1u << (word >> 24) % 16);
        out.emission +=
            times * glm::dvec3(decodeSrgb(word % 256), decodeSrgb(word / 256 % 256), decodeSrgb(word / 65536 % 256));
    }

    const std::vector<uint32_t>& words_;
    uint32_t map_;
    std::vector<Level> levels_;
    size_t texels_ = 0;
};

}  // namespace stipple::reference
