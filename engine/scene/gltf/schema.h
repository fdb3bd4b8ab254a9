// The structure of glTF 2.0 (Khronos, "glTF 2.0 Specification", chapter 5) and of the extensions that are understood,
// as one table, and the check of a file against it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stipple::scene::gltf {

/// What is wrong, and where: "/accessors/0/count: is 0, must be at least 1".
using Problems = std::vector<std::string>;

/// Types, ranges, required properties, enumerations, and that every index points to something.
void checkStructure(const nlohmann::json& root, Problems& problems);

/// Extensions that are understood; a file that requires another one is refused by name.
const std::vector<std::string>& knownExtensions();

}  // namespace stipple::scene::gltf
