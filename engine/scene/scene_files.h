// Which other files a scene file is made of.
#pragma once

#include <string>
#include <vector>

namespace stipple::scene {

/// The buffers and images that a .gltf or .glb names, the MTL files of an .obj and the textures that those name,
/// whether they are there or not; not the stores that nodes place. What cannot be read names none: whoever reads it
/// says why.
std::vector<std::string> filesOf(const std::string& path);

}  // namespace stipple::scene
