// The structure of glTF 2.0 (Khronos, "glTF 2.0 Specification", chapter 5) and of the extensions that are understood,
// as one table, and the check of a file against it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace stipple::scene::gltf {

/// What is wrong, and where: "/accessors/0/count: is 0, must be at least 1".
using Problems = std::vector<std::string>;

/// What makes a file with harmless faults readable: the member at this place gets the value, or is left out (null).
struct Mend {
    nlohmann::json::json_pointer place;
    nlohmann::json value;
};
using Mends = std::vector<Mend>;

/// Types, ranges, required properties, enumerations, and that every index points to something. What a picture does not
/// need (animations, names, a texture that is not there ...) and factors beyond their range are harmless if `mends` are
/// applied.
void checkStructure(const nlohmann::json& root, Problems& problems, Mends& mends);
void applyMends(const Mends& mends, nlohmann::json& root);

/// Extensions that are understood.
const std::vector<std::string>& knownExtensions();
/// Does it only change how something looks, or say what it is, so that a file that requires it can be drawn without?
bool isAboutLooks(const std::string& extension);

}  // namespace stipple::scene::gltf
