// What a ray sees where it meets a triangle, in fp64: textures, material, light. For the restated frame and for traced
// rays alike.
#pragma once

#include <array>
#include <functional>
#include <glm/glm.hpp>

#include "engine/reference/decode.h"
#include "engine/reference/restate.h"
#include "engine/reference/shadow.h"

namespace stipple::reference {

struct Corner {
    glm::dvec3 at{0}, normal{0};  ///< camera space
    glm::dvec4 colour{1};         ///< linear
    glm::dvec2 uv{0};
    glm::dvec2 finish{1};  ///< metallic and roughness, times those of the material
};
using Corners = std::array<Corner, 3>;

/// Camera-space corner of a vertex at `place` on the lattice.
Corner cornerOf(const lod::Hierarchy& h, const lod::Instance& instance, const shared::MeshVertex& v,
                const glm::dvec3& place, const lod::View& view);

/// Weights of the second and third corner where the ray meets the triangle's plane. `face`: (b - a) x (c - a).
glm::dvec2 weightsOn(const ViewRay& ray, const Corners& c, const glm::dvec3& face);

/// Texture coordinates per `step` of the ray's x and y (the longer of both), on the triangle's plane: those of its
/// direction, or, orthographic, of its origin.
double footprintOn(const ViewRay& ray, bool isOrthographic, double step, const Corners& c, const glm::dvec3& face);

/// What of a place's surface and normal (camera space, any length) is not of its corners.
using ShowPlace = std::function<void(const glm::dvec2& uv, double footprint, Sample& s, glm::dvec3& n)>;

/// Textures of one mesh.
struct TextureReader {
    const render::MeshTextures& textures;
    const Chunks& chunks;
    const ShowPlace* show = nullptr;  ///< or what else there is

    /// Trilinear, from the finest level that is there; `out` stays where none is, and the answer is false.
    bool sample(const shared::TextureSlot& slot, glm::dvec2 at, double footprint, glm::dvec4& out) const;

  private:
    bool level(const shared::TextureInfo& info, uint32_t l, glm::dvec2 uv, glm::dvec4& out) const;
};

/// The surface where the ray (its direction) meets the triangle: colour, material, and the unit normal `n`, turned to
/// the eye. False where an alpha mask cuts it out.
bool surfaceOn(const glm::dvec3& ray, const glm::dvec2& weights, double footprint, const Corners& c,
               const glm::dvec3& face, uint32_t surface, const shared::SurfaceMaterial& m,
               const TextureReader& textures, Sample& s, glm::dvec3& n);

/// What a mirror of that roughness sees of the environment in a direction of its map.
glm::dvec3 mirrored(const render::Environment& environment, const glm::dvec3& direction, double roughness);

/// What a white diffuse surface sends back of it, by its normal there.
glm::dvec3 irradianceOf(const render::Environment& environment, const glm::dvec3& n);
/// What lights of the scene's own, or the sun, send back. `dielectric`: what is reflected straight on by what is no
/// metal; `past`: what of each light comes there, else that past the frame's shadow maps.
glm::dvec3 lightsOn(const Sample& s, const glm::dvec3& n, const glm::dvec3& point, const glm::dvec3& dielectric,
                    const render::DrawList& draws, const LightPast& past = {});

/// What a mirror of that roughness sees where nothing is in its way, at ambient light 1. `n`: of its surface.
glm::dvec3 surroundingsOf(const glm::dvec3& mirror, const glm::dvec3& n, double roughness,
                          const render::DrawList& draws);
/// What of that a sample sends on; `facing`: cosine between its normal and the eye.
glm::dvec3 mirrorShareOf(const Sample& s, double facing);

/// What a sample sends to the eye under the frame's light. `n`: towards the eye; `point`: camera space; `areLit`: are
/// points?
glm::dvec3 sentBy(const Sample& s, const glm::dvec3& n, const glm::dvec3& point, const render::DrawList& draws,
                  bool areLit);

/// Light from a triangle's pixel to the eye. `n`: towards the eye; `point`: camera space.
glm::dvec3 shadeTriangle(const Sample& s, const glm::dvec3& n, const glm::dvec3& point, const render::DrawList& draws,
                         const LightPast& past = {});

}  // namespace stipple::reference
