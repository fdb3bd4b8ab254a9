// A scene: a graph of placed meshes, stores, lights and cameras. World scale is fp64 throughout; vertex data is what
// the file holds, relative to its node.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "engine/scene/read_settings.h"
#include "lod/primitives/optics.h"

namespace stipple::scene {

/// Which texture, by which coordinates. uv' = transform * (u, v, 1) (KHR_texture_transform).
struct TextureUse {
    int texture = -1;  ///< of Scene::textures; -1: none
    int uvSet = 0;
    glm::mat3 transform{1};
};

enum class AlphaMode : uint8_t { opaque, mask, blend };

/// Metallic-roughness material (glTF 2.0, 3.9). Factors are linear.
struct Material {
    std::string name;
    glm::vec4 baseColour{1};
    glm::vec3 emissive{0};
    float metallic = 1, roughness = 1, normalScale = 1, occlusionStrength = 1, alphaCutoff = 0.5f;
    TextureUse baseColourTexture, metallicRoughnessTexture, normalTexture, occlusionTexture, emissiveTexture;
    lod::Optics optics;  ///< in units of the scene
    AlphaMode alphaMode = AlphaMode::opaque;
    bool isDoubleSided = false, isUnlit = false;
};

enum class Wrap : uint8_t { repeat, mirror, clamp };
struct Texture {
    int image = -1;
    Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
};

/// An image as it stands in the file (PNG, JPEG, ...).
struct EncodedImage {
    std::string name;
    std::vector<uint8_t> bytes;
};

enum class PrimitiveKind : uint8_t { points, lines, triangles };

/// Strips and fans are unrolled, compressed and quantised data unpacked. Arrays are empty or as long as `position`.
struct Primitive {
    PrimitiveKind kind = PrimitiveKind::triangles;
    std::vector<glm::vec3> position, normal;
    std::vector<glm::vec4> tangent, colour;  ///< colour linear
    std::vector<std::vector<glm::vec2>> uv;  ///< by set
    std::vector<float> radius;               ///< of lines: attribute _RADIUS
    std::vector<uint32_t> indices;           ///< 1, 2 or 3 an element; every one below position.size()
    /// Where the file has doubles: what `position` leaves of them (together 48 bits).
    std::vector<glm::vec3> rest;
    int material = -1;
    glm::dvec3 at(size_t i) const {
        return rest.empty() ? glm::dvec3(position[i]) : glm::dvec3(position[i]) + glm::dvec3(rest[i]);
    }
};

struct Mesh {
    std::string name;
    std::vector<Primitive> primitives;
};

enum class LightKind : uint8_t { directional, point, spot };
/// KHR_lights_punctual: its light goes along -z of its node.
struct Light {
    LightKind kind = LightKind::point;
    glm::vec3 colour{1};  ///< linear
    float intensity = 1;  ///< candela, or lux for directional lights
    float range = 0;      ///< 0: no limit
    float innerCone = 0, outerCone = 0.7853982f;
};

struct SceneCamera {
    double fovDegrees = 50, nearPlane = 0.1;
    bool isOrthographic = false;
    double width = 1, height = 1;  ///< of an orthographic view, world units
    double farPlane = 0;           ///< of an orthographic view; 0: not known
};

struct Node {
    std::string name;
    glm::dmat4 local{1};
    int parent = -1;  ///< always before its children
    int mesh = -1, camera = -1, light = -1;
    std::string store;                  ///< path of a .stipple store that stands here
    std::vector<glm::dmat4> instances;  ///< EXT_mesh_gpu_instancing: each is put between the node and its mesh or store
    bool isVisible = true;              ///< with all below it
};

/// What a scene file asks of effects: names, and NAME.PARAMETER=VALUE.
struct SceneEffects {
    std::vector<std::string> names, values;
};

struct Scene {
    std::string path;
    std::vector<Node> nodes;
    std::vector<Mesh> meshes;
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<EncodedImage> images;
    std::vector<Light> lights;
    std::vector<SceneCamera> cameras;
    SceneEffects effects;
    std::vector<std::string> notes;  ///< what was repaired or left out, for a person

    /// From each node to the world, and whether it and all above it are visible.
    std::vector<glm::dmat4> worldTransforms() const;
    std::vector<bool> visibility() const;
};

struct Box {
    glm::dvec3 least{1e300}, greatest{-1e300};
    bool isEmpty() const { return least.x > greatest.x; }
    void add(const glm::dvec3& p) {
        least = glm::min(least, p);
        greatest = glm::max(greatest, p);
    }
};
/// Of all visible meshes, instances included.
Box meshBounds(const Scene& scene);

/// glTF 2.0 (.gltf, .glb) with KHR_lights_punctual, KHR_texture_transform, EXT_mesh_gpu_instancing,
/// KHR_draco_mesh_compression, KHR_mesh_quantization, EXT_meshopt_compression, KHR_materials_unlit, _transmission,
/// _ior, _volume and _specular (but for their textures), and STIPPLE_store (README). What cannot be drawn is refused
/// with the place; other faults of the file, and images that are missing, are counted in the notes.
Result<Scene> readGltf(const std::string& path, const ReadSettings& settings = {});

/// Writes .glb or .gltf (buffers inside). Shear of instances is lost, and what meshes have beyond floats goes to nodes
/// of their own, which move them (instances do without); everything else comes back as it was.
Result<void> writeGltf(const Scene& scene, const std::string& path);

/// Wavefront OBJ with its MTL files; one node. Missing textures and broken faces are noted.
Result<Scene> readObj(const std::string& path, const ReadSettings& settings = {});

/// readGltf or readObj, by extension.
Result<Scene> readScene(const std::string& path, const ReadSettings& settings = {});

}  // namespace stipple::scene
