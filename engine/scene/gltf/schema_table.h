// What glTF files may hold, property by property.
#pragma once

namespace stipple::scene::gltf {

/// One line per property: type of object, property ("!" required), what it must be:
///   int/num [low [high]]   with ">" before a bound that is excluded      bool   string   uri   any
///   enum A B ...           numbers or words                              @name  an index into the root's array `name`
///   array MIN MAX what     of so many items ("*": no limit)              set    an array without equal items
///   map what               an object with values of one kind             NAME   an object of that type
///   stride                 of the elements of a buffer view
inline constexpr const char* kTable = R"(
root asset! asset
root scene @scenes
root scenes array 1 * scene
root nodes array 1 * node
root meshes array 1 * mesh
root accessors array 1 * accessor
root buffers array 1 * buffer
root bufferViews array 1 * bufferView
root materials array 1 * material
root textures array 1 * texture
root images array 1 * image
root samplers array 1 * sampler
root cameras array 1 * camera
root skins array 1 * skin
root animations array 1 * animation
root extensionsUsed set 1 * string
root extensionsRequired set 1 * string
asset version! version
asset minVersion version
asset generator string
asset copyright string
scene name string
scene nodes set 1 * @nodes
node name string
node children set 1 * @nodes
node camera @cameras
node mesh @meshes
node skin @skins
node matrix array 16 16 num
node translation array 3 3 num
node rotation array 4 4 num -1 1
node scale array 3 3 num
node weights array 1 * num
mesh name string
mesh primitives! array 1 * primitive
mesh weights array 1 * num
primitive attributes! map @accessors
primitive indices @accessors
primitive material @materials
primitive mode enum 0 1 2 3 4 5 6
primitive targets array 1 * target
accessor name string
accessor bufferView @bufferViews
accessor byteOffset int 0
accessor componentType! enum 5120 5121 5122 5123 5125 5126
accessor normalized bool
accessor count! int 0
accessor type! enum SCALAR VEC2 VEC3 VEC4 MAT2 MAT3 MAT4
accessor min array 1 16 num
accessor max array 1 16 num
accessor sparse sparse
sparse count! int 1
sparse indices! sparseIndices
sparse values! sparseValues
sparseIndices bufferView! @bufferViews
sparseIndices byteOffset int 0
sparseIndices componentType! enum 5121 5123 5125
sparseValues bufferView! @bufferViews
sparseValues byteOffset int 0
buffer name string
buffer uri uri
buffer byteLength! int 0
bufferView name string
bufferView buffer! @buffers
bufferView byteOffset int 0
bufferView byteLength! int 0
bufferView byteStride stride
bufferView target enum 34962 34963
material name string
material pbrMetallicRoughness pbr
material normalTexture normalTexture
material occlusionTexture occlusionTexture
material emissiveTexture textureInfo
material emissiveFactor array 3 3 num 0 1
material alphaMode enum OPAQUE MASK BLEND
material alphaCutoff num 0
material doubleSided bool
pbr baseColorFactor array 4 4 num 0 1
pbr baseColorTexture textureInfo
pbr metallicFactor num 0 1
pbr roughnessFactor num 0 1
pbr metallicRoughnessTexture textureInfo
textureInfo index! @textures
textureInfo texCoord int 0
normalTexture index! @textures
normalTexture texCoord int 0
normalTexture scale num
occlusionTexture index! @textures
occlusionTexture texCoord int 0
occlusionTexture strength num 0 1
texture name string
texture sampler @samplers
texture source @images
image name string
image uri uri
image mimeType string
image bufferView @bufferViews
sampler name string
sampler magFilter enum 9728 9729
sampler minFilter enum 9728 9729 9984 9985 9986 9987
sampler wrapS enum 33071 33648 10497
sampler wrapT enum 33071 33648 10497
camera name string
camera type! enum perspective orthographic
camera perspective perspective
camera orthographic orthographic
perspective aspectRatio num >0
perspective yfov! num >0
perspective znear! num >0
perspective zfar num >0
orthographic xmag! num
orthographic ymag! num
orthographic znear! num 0
orthographic zfar! num >0
skin name string
skin inverseBindMatrices @accessors
skin skeleton @nodes
skin joints! set 1 * @nodes
animation name string
animation channels! array 1 * channel
animation samplers! array 1 * animationSampler
channel sampler! int 0
channel target! channelTarget
channelTarget node @nodes
channelTarget path! string
animationSampler input! @accessors
animationSampler output! @accessors
animationSampler interpolation enum LINEAR STEP CUBICSPLINE
KHR_lights_punctual lights array 1 * light
light name string
light type! string
light color array 3 3 num 0 1
light intensity num 0
light range num >0
light spot spot
spot innerConeAngle num 0 1.5707963267949
spot outerConeAngle num >0 1.5707963267949
KHR_texture_transform offset array 2 2 num
KHR_texture_transform rotation num
KHR_texture_transform scale array 2 2 num
KHR_texture_transform texCoord int 0
EXT_mesh_gpu_instancing attributes! map @accessors
EXT_meshopt_compression buffer! @buffers
EXT_meshopt_compression byteOffset int 0
EXT_meshopt_compression byteLength! int 1
EXT_meshopt_compression byteStride! int 1 256
EXT_meshopt_compression count! int 1
EXT_meshopt_compression mode! enum ATTRIBUTES TRIANGLES INDICES
EXT_meshopt_compression filter enum NONE OCTAHEDRAL QUATERNION EXPONENTIAL
KHR_meshopt_compression buffer! @buffers
KHR_meshopt_compression byteOffset int 0
KHR_meshopt_compression byteLength! int 1
KHR_meshopt_compression byteStride! int 1 256
KHR_meshopt_compression count! int 1
KHR_meshopt_compression mode! enum ATTRIBUTES TRIANGLES INDICES
KHR_meshopt_compression filter enum NONE OCTAHEDRAL QUATERNION EXPONENTIAL COLOR
STIPPLE_store uri! uri
EXT_texture_webp source @images
KHR_texture_basisu source @images
KHR_node_visibility visible bool
KHR_materials_anisotropy anisotropyStrength num 0 1
KHR_materials_anisotropy anisotropyRotation num
KHR_materials_clearcoat clearcoatFactor num 0 1
KHR_materials_clearcoat clearcoatRoughnessFactor num 0 1
KHR_materials_dispersion dispersion num 0
KHR_materials_emissive_strength emissiveStrength num 0
KHR_materials_ior ior ior
KHR_materials_sheen sheenRoughnessFactor num 0 1
KHR_materials_specular specularFactor num 0 1
KHR_materials_specular specularColorFactor array 3 3 num 0
KHR_materials_transmission transmissionFactor num 0 1
KHR_materials_volume thicknessFactor num 0
KHR_materials_volume attenuationDistance num >0
KHR_materials_volume attenuationColor array 3 3 num 0 1
KHR_materials_variants variants array 1 * variant
variant name! string
KHR_animation_pointer pointer! string
KHR_materials_variants mappings array 1 * mapping
mapping material! @materials
mapping variants! set 1 * int 0
mapping name string
)";

}  // namespace stipple::scene::gltf
