// What the checks of glTF share.
#pragma once

#include <algorithm>

#include "engine/scene/gltf/schema.h"

namespace stipple::scene::gltf {

constexpr size_t kMostProblems = 100;

inline void say(Problems& problems, const std::string& path, const std::string& what) {
    if (problems.size() < kMostProblems) problems.push_back((path.empty() ? "/" : path) + ": " + what);
}

/// The same for what is against the rules but changes nothing that is drawn: can be passed over on request.
constexpr char kHarmless = '\x01';
inline void sayHarmless(Problems& problems, const std::string& path, const std::string& what) {
    // Room is left for those that matter: a file is only passed over if all that is wrong with it was said.
    if (problems.size() < kMostProblems / 2) problems.push_back(kHarmless + (path.empty() ? "/" : path) + ": " + what);
}

inline bool isHarmless(const std::string& problem) { return !problem.empty() && problem[0] == kHarmless; }
inline bool mattersAny(const Problems& problems) {
    return std::any_of(problems.begin(), problems.end(), [](const std::string& p) { return !isHarmless(p); });
}

/// "/meshes/0" and "name" -> "/meshes/0/name".
inline std::string below(const std::string& path, const std::string& name) {
    std::string out;
    out.reserve(path.size() + 1 + name.size());
    return out.append(path).append("/").append(name);
}

/// An array of the root; empty where there is none.
inline const nlohmann::json& arrayOf(const nlohmann::json& root, const char* name) {
    static const nlohmann::json none = nlohmann::json::array();
    const auto found = root.find(name);
    return found == root.end() ? none : *found;
}

/// A glm vector of an array with as many numbers.
template <typename V>
V vectorOf(const nlohmann::json& array) {
    V v;
    for (size_t i = 0; i < array.size(); ++i) v[static_cast<int>(i)] = array[i].get<typename V::value_type>();
    return v;
}

/// Is `name` in the root's list (extensionsUsed, extensionsRequired)?
inline bool listed(const nlohmann::json& root, const char* list, const std::string& name) {
    const nlohmann::json& names = arrayOf(root, list);
    return std::find(names.begin(), names.end(), nlohmann::json(name)) != names.end();
}

/// The object of an extension; null where there is none.
inline const nlohmann::json& extensionOf(const nlohmann::json& value, const char* name) {
    static const nlohmann::json none;
    const auto all = value.find("extensions");
    if (all == value.end() || !all->is_object()) return none;
    const auto found = all->find(name);
    return found == all->end() ? none : *found;
}

/// How a buffer view is compressed, or what a buffer stands for; null: it is plain. The extension of Khronos is the
/// older one with another version of the codec and one more filter.
inline const nlohmann::json& meshoptOf(const nlohmann::json& value) {
    const nlohmann::json& older = extensionOf(value, "EXT_meshopt_compression");
    return older.is_null() ? extensionOf(value, "KHR_meshopt_compression") : older;
}

inline bool hasStride(const nlohmann::json& root, const nlohmann::json& accessor) {
    return accessor.contains("bufferView") &&
           root["bufferViews"][accessor["bufferView"].get<size_t>()].contains("byteStride");
}

}  // namespace stipple::scene::gltf
