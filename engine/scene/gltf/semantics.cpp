#include "engine/scene/gltf/semantics.h"
#include "engine/scene/gltf/json_tools.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <set>

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

std::string at(const char* name, size_t index) { return fmt::format("/{}/{}", name, index); }

bool isFormat(const json& accessor, std::initializer_list<const char*> types, std::initializer_list<int> components) {
    const auto type = accessor["type"].get<std::string>();
    const int component = accessor["componentType"].get<int>();
    return std::any_of(types.begin(), types.end(), [&](const char* t) { return type == t; }) &&
           std::find(components.begin(), components.end(), component) != components.end();
}

bool isNormalised(const json& accessor) { return accessor.value("normalized", false); }
bool isFloat(const json& accessor) { return accessor["componentType"] == 5126; }

/// Name and number of "TEXCOORD_2"; -1: without a number.
std::pair<std::string, int> splitSemantic(const std::string& name) {
    const size_t underscore = name.rfind('_');
    if (name.empty() || name[0] == '_' || underscore == std::string::npos) return {name, -1};
    const std::string digits = name.substr(underscore + 1);
    if (digits.empty() || digits.size() > 4 || digits.find_first_not_of("0123456789") != std::string::npos ||
        (digits.size() > 1 && digits[0] == '0'))
        return {name, -1};
    return {name.substr(0, underscore), std::stoi(digits)};
}

void checkAttributeFormat(const json& root, const std::string& name, const json& accessor, const std::string& path,
                          Problems& p) {
    const auto [kind, number] = splitSemantic(name);
    const bool quantised = listed(root, "extensionsUsed", "KHR_mesh_quantization");
    const bool exact = isFloat(accessor) && !isNormalised(accessor);
    const bool small = isFormat(accessor, {"VEC2", "VEC3", "VEC4"}, {5120, 5121, 5122, 5123});
    bool good = true;
    if (name == "POSITION") {
        good = isFormat(accessor, {"VEC3"}, {5126}) || (quantised && small && accessor["type"] == "VEC3");
        if (!accessor.contains("min") || !accessor.contains("max"))
            sayHarmless(p, path, "the positions have no 'min' and 'max'");
    } else if (name == "NORMAL") {
        good = isFormat(accessor, {"VEC3"}, {5126}) || (quantised && isFormat(accessor, {"VEC3"}, {5120, 5122}));
    } else if (name == "TANGENT") {
        good = isFormat(accessor, {"VEC4"}, {5126}) || (quantised && isFormat(accessor, {"VEC4"}, {5120, 5122}));
    } else if (kind == "TEXCOORD") {
        good = isFormat(accessor, {"VEC2"}, {5126}) ||
               (isFormat(accessor, {"VEC2"}, {5121, 5123}) && isNormalised(accessor)) ||
               (quantised && small && accessor["type"] == "VEC2");
    } else if (kind == "COLOR") {
        good = (isFormat(accessor, {"VEC3", "VEC4"}, {5126}) && exact) ||
               (isFormat(accessor, {"VEC3", "VEC4"}, {5121, 5123}) && isNormalised(accessor));
    } else if (kind == "JOINTS") {
        good = isFormat(accessor, {"VEC4"}, {5121, 5123}) && !isNormalised(accessor);
    } else if (kind == "WEIGHTS") {
        good = isFormat(accessor, {"VEC4"}, {5126}) ||
               (isFormat(accessor, {"VEC4"}, {5121, 5123}) && isNormalised(accessor));
    } else {
        good = accessor["componentType"] != 5125;
    }
    if (!good)
        sayHarmless(p, path,
                    fmt::format("{} cannot be {} of {}{}", name, accessor["type"].get<std::string>(),
                                accessor["componentType"].dump(), isNormalised(accessor) ? ", normalised" : ""));
    const size_t bytes = componentBytes(accessor["componentType"].get<int>());
    const bool hasView = accessor.contains("bufferView");
    const json* view = hasView ? &root["bufferViews"][accessor["bufferView"].get<size_t>()] : nullptr;
    if (accessor.value("byteOffset", size_t{0}) % 4 != 0 ||
        (view && view->value("byteStride",
                             elementBytes(accessor["type"].get<std::string>(), accessor["componentType"].get<int>())) %
                         4 !=
                     0))
        sayHarmless(p, path, fmt::format("{} does not begin at multiples of 4 bytes ({} a component)", name, bytes));
}

void checkAttributeNames(const json& attributes, const std::string& path, Problems& p) {
    static const std::set<std::string> plain{"POSITION", "NORMAL", "TANGENT"},
        numbered{"TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"};
    std::map<std::string, std::set<int>> numbers;
    for (const auto& [name, accessor] : attributes.items()) {
        const auto [kind, number] = splitSemantic(name);
        if (name.rfind('_', 0) == 0 && name.size() > 1) continue;
        if (number < 0 && plain.count(name) != 0) continue;
        if (number >= 0 && numbered.count(kind) != 0) {
            numbers[kind].insert(number);
            continue;
        }
        sayHarmless(p, path, fmt::format("'{}' is not an attribute that glTF knows", name));
    }
    for (const auto& [kind, set] : numbers)
        if (*set.rbegin() != static_cast<int>(set.size()) - 1)
            sayHarmless(p, path, fmt::format("{}_{} without those before it", kind, *set.rbegin()));
    if (numbers["JOINTS"].size() != numbers["WEIGHTS"].size()) sayHarmless(p, path, "not as many JOINTS as WEIGHTS");
}

void checkTargets(const json& root, const json& primitive, size_t count, const std::string& path, Problems& p) {
    if (!primitive.contains("targets")) return;
    const json& accessors = arrayOf(root, "accessors");
    for (size_t t = 0; t < primitive["targets"].size(); ++t) {
        const json& target = primitive["targets"][t];
        const std::string here = fmt::format("{}/targets/{}", path, t);
        if (!target.is_object() || target.empty()) {
            sayHarmless(p, here, "must be an object with attributes");
            continue;
        }
        for (const auto& [name, index] : target.items()) {
            const std::string kind = splitSemantic(name).first;
            const bool known = name == "POSITION" || name == "NORMAL" || name == "TANGENT" || kind == "TEXCOORD" ||
                               kind == "COLOR" || (name[0] == '_' && name.size() > 1);
            if (!known) sayHarmless(p, here, fmt::format("'{}' is not an attribute of a morph target", name));
            if (!primitive["attributes"].contains(name))
                sayHarmless(p, here, fmt::format("'{}' is not among the primitive's attributes", name));
            if (!index.is_number() || index.get<double>() < 0 ||
                index.get<double>() >= static_cast<double>(accessors.size())) {
                sayHarmless(p, here, fmt::format("'{}' refers to an accessor that is not there", name));
                continue;
            }
            const json& a = accessors[index.get<size_t>()];
            if (a["count"] != count)
                sayHarmless(p, here,
                            fmt::format("'{}' has {} elements, the primitive {}", name, a["count"].dump(), count));
            const bool isVector = a["type"] == "VEC3" || kind == "TEXCOORD" || kind == "COLOR";
            if (!isVector || (name == "POSITION" && (!a.contains("min") || !a.contains("max"))))
                sayHarmless(p, here, fmt::format("'{}' must be VEC3, positions with 'min' and 'max'", name));
        }
    }
}

/// Sets of texture coordinates that a material uses, or -1.
int largestTexCoord(const json& material) {
    int largest = -1;
    const auto look = [&](const json& info) {
        int set = info.value("texCoord", 0);
        if (info.contains("extensions") && info["extensions"].contains("KHR_texture_transform"))
            set = info["extensions"]["KHR_texture_transform"].value("texCoord", set);
        largest = std::max(largest, set);
    };
    const auto walk = [&](const auto& self, const json& value) -> void {
        if (!value.is_object()) return;
        for (const auto& [key, member] : value.items()) {
            if (member.is_object() && member.contains("index") && key.find("exture") != std::string::npos) look(member);
            self(self, member);
        }
    };
    walk(walk, material);
    return largest;
}

/// Does a material of these effects lack the tangents it needs, with these attributes? A normal map on triangles gets
/// tangents from positions and texture coordinates; the others need normals for that.
bool lacksTangents(const json& material, const json& attributes, int mode) {
    static const json none = json::object();
    const json& extensions = material.contains("extensions") ? material["extensions"] : none;
    const bool hasCoat = extensions.contains("KHR_materials_clearcoat") &&
                         extensions["KHR_materials_clearcoat"].contains("clearcoatNormalTexture");
    const bool needsNormals = hasCoat || extensions.contains("KHR_materials_anisotropy");
    if (attributes.contains("TANGENT")) return false;
    return (mode < 4 && (needsNormals || material.contains("normalTexture"))) ||
           (needsNormals && !attributes.contains("NORMAL"));
}

void checkPrimitive(const json& root, const json& primitive, const std::string& path, Problems& p) {
    const json& accessors = arrayOf(root, "accessors");
    const json& attributes = primitive["attributes"];
    checkAttributeNames(attributes, path + "/attributes", p);
    size_t count = 0;
    std::map<size_t, size_t> uses;  // of a buffer view
    for (const auto& [name, index] : attributes.items()) {
        const json& a = accessors[index.get<size_t>()];
        checkAttributeFormat(root, name, a, below(path + "/attributes", name), p);
        const auto n = a["count"].get<size_t>();
        if (count != 0 && n != count)
            sayHarmless(p, path, fmt::format("'{}' has {} elements, other attributes {}", name, n, count));
        count = n;
        if (a.contains("bufferView")) {
            const auto view = a["bufferView"].get<size_t>();
            if (uses[view]++ > 0 && !root["bufferViews"][view].contains("byteStride"))
                sayHarmless(p, path,
                            fmt::format("several attributes share buffer view {}, which has no 'byteStride'", view));
        }
    }
    if (primitive.contains("indices")) {
        const json& a = accessors[primitive["indices"].get<size_t>()];
        if (!isFormat(a, {"SCALAR"}, {5121, 5123, 5125}) || isNormalised(a))
            say(p, path + "/indices", "must be unsigned scalars");
        if (hasStride(root, a)) sayHarmless(p, path + "/indices", "its buffer view must not have a 'byteStride'");
    }
    checkTargets(root, primitive, count, path, p);
    if (primitive.contains("material")) {
        const json& material = root["materials"][primitive["material"].get<size_t>()];
        const int set = largestTexCoord(material);
        if (set >= 0 && !attributes.contains(fmt::format("TEXCOORD_{}", set)))
            sayHarmless(p, path, fmt::format("its material uses TEXCOORD_{}, which it does not have", set));
        const int mode = primitive.value("mode", 4);
        if (lacksTangents(material, attributes, mode))
            sayHarmless(p, path, "its material needs tangents, which do not follow from what it has");
    }
}

bool isDecomposable(const json& matrix) {
    glm::dmat3 m(0);
    for (size_t i = 0; i < 12; ++i)
        if (i % 4 < 3) m[static_cast<int>(i / 4)][static_cast<int>(i % 4)] = matrix[i].get<double>();
    const auto last = [&](size_t i) { return matrix[i].get<double>(); };
    if (last(3) != 0 || last(7) != 0 || last(11) != 0 || last(15) != 1) return false;
    for (int c = 0; c < 3; ++c) {
        const double length = glm::length(m[c]);
        if (!(length > 0)) return true;  // flat: allowed, drawn as nothing
        m[c] /= length;
    }
    return std::abs(glm::dot(m[0], m[1])) < 1e-4 && std::abs(glm::dot(m[0], m[2])) < 1e-4 &&
           std::abs(glm::dot(m[1], m[2])) < 1e-4;
}

}  // namespace

size_t componentBytes(int componentType) {
    return componentType == 5120 || componentType == 5121 ? 1 : componentType == 5122 || componentType == 5123 ? 2 : 4;
}
size_t componentsOf(const std::string& type) {
    return type == "SCALAR" ? 1
           : type == "VEC2" ? 2
           : type == "VEC3" ? 3
           : type == "MAT3" ? 9
           : type == "MAT4" ? 16
                            : 4;
}
size_t elementBytes(const std::string& type, int componentType) {
    const size_t bytes = componentBytes(componentType);
    if (type == "MAT2" && bytes == 1) return 6 + 2;
    if (type == "MAT3" && bytes < 4) return 3 * ((3 * bytes + 3) / 4 * 4);
    return componentsOf(type) * bytes;
}

size_t lastElementBytes(const std::string& type, int componentType) {
    const size_t bytes = componentBytes(componentType), rows = type == "MAT2" ? 2 : type == "MAT3" ? 3 : 0;
    const size_t padding = rows == 0 ? 0 : (4 - rows * bytes % 4) % 4;
    return elementBytes(type, componentType) - padding;
}

void checkGraph(const json& root, Problems& p) {
    const json& nodes = arrayOf(root, "nodes");
    std::vector<int64_t> parent(nodes.size(), -1);
    for (size_t i = 0; i < nodes.size(); ++i) {
        const json& n = nodes[i];
        if (n.contains("children"))
            for (const json& child : n["children"]) {
                auto& of = parent[child.get<size_t>()];
                if (of >= 0)
                    sayHarmless(p, at("nodes", i), fmt::format("node {} is a child of node {} too", child.dump(), of));
                of = static_cast<int64_t>(i);
            }
        const bool hasParts = n.contains("translation") || n.contains("rotation") || n.contains("scale");
        if (n.contains("matrix") && hasParts)
            sayHarmless(p, at("nodes", i), "has a matrix and also translation, rotation or scale");
        if (n.contains("matrix") && !isDecomposable(n["matrix"]))
            sayHarmless(p, at("nodes", i), "its matrix is not made of translation, rotation and scale");
        if (n.contains("rotation")) {
            double square = 0;
            for (const json& q : n["rotation"]) square += q.get<double>() * q.get<double>();
            if (std::abs(square - 1) > 5e-4 * 2)
                sayHarmless(p, at("nodes", i), "its rotation is not a unit quaternion");
        }
        const json* mesh = n.contains("mesh") ? &root["meshes"][n["mesh"].get<size_t>()] : nullptr;
        const size_t targets = mesh ? (*mesh)["primitives"][0].value("targets", json::array()).size() : 0;
        if (n.contains("weights") && (!mesh || n["weights"].size() != targets))
            sayHarmless(p, at("nodes", i),
                        fmt::format("has {} weights for {} morph targets", n["weights"].size(), targets));
        if (n.contains("skin") && (!mesh || !(*mesh)["primitives"][0]["attributes"].contains("JOINTS_0")))
            sayHarmless(p, at("nodes", i), "has a skin, but no mesh with joints");
    }
    // A node from which going up never ends is in or below a loop.
    std::vector<uint8_t> state(nodes.size(), 0);  // 1 on the way, 2 fine, 3 loop
    for (size_t i = 0; i < nodes.size(); ++i) {
        std::vector<size_t> way;
        auto n = static_cast<int64_t>(i);
        while (n >= 0 && state[static_cast<size_t>(n)] == 0) {
            state[static_cast<size_t>(n)] = 1;
            way.push_back(static_cast<size_t>(n));
            n = parent[static_cast<size_t>(n)];
        }
        const bool loops = n >= 0 && state[static_cast<size_t>(n)] != 2;
        if (n >= 0 && state[static_cast<size_t>(n)] == 1) say(p, at("nodes", i), "is its own ancestor");
        for (const size_t w : way) state[w] = loops ? 3 : 2;
    }
    const json& scenes = arrayOf(root, "scenes");
    for (size_t s = 0; s < scenes.size(); ++s)
        for (const json& n : scenes[s].value("nodes", json::array()))
            if (parent[n.get<size_t>()] >= 0)
                sayHarmless(p, at("scenes", s), fmt::format("node {} has a parent", n.dump()));
    const json& asset = root["asset"];
    const std::string version = asset["version"].get<std::string>();
    if (version.substr(0, version.find('.')) != "2") say(p, "/asset", fmt::format("is glTF {}, 2.0 is read", version));
    if (asset.contains("minVersion") && std::stod(asset["minVersion"].get<std::string>()) > std::stod(version))
        sayHarmless(p, "/asset", "needs a later version than it is");
}

void checkMeshes(const json& root, Problems& p) {
    const json& meshes = arrayOf(root, "meshes");
    for (size_t m = 0; m < meshes.size(); ++m) {
        const json& primitives = meshes[m]["primitives"];
        const size_t targets = primitives[0].value("targets", json::array()).size();
        for (size_t k = 0; k < primitives.size(); ++k) {
            const std::string path = fmt::format("/meshes/{}/primitives/{}", m, k);
            checkPrimitive(root, primitives[k], path, p);
            if (primitives[k].value("targets", json::array()).size() != targets)
                sayHarmless(p, path, "has another number of morph targets than the first primitive");
        }
        if (meshes[m].contains("weights") && meshes[m]["weights"].size() != targets)
            sayHarmless(p, at("meshes", m),
                        fmt::format("has {} weights for {} morph targets", meshes[m]["weights"].size(), targets));
    }
}

namespace {

void checkBuffers(const json& root, bool isBinary, bool hasBinaryChunk, uint64_t binaryBytes, Problems& p) {
    const json& buffers = arrayOf(root, "buffers");
    for (size_t i = 0; i < buffers.size(); ++i) {
        const bool isFallback = !meshoptOf(buffers[i]).is_null();
        const auto length = buffers[i]["byteLength"].get<uint64_t>();
        if (length == 0) sayHarmless(p, at("buffers", i), "has no bytes");
        if (buffers[i].contains("uri") || isFallback) continue;
        if (i == 0 && isBinary && !hasBinaryChunk)
            say(p, at("buffers", i), "has no 'uri' and there is no binary chunk for it");
        if (i == 0 && hasBinaryChunk && length > binaryBytes)
            sayHarmless(p, at("buffers", i),
                        fmt::format("declares {} bytes, the binary chunk has {}", length, binaryBytes));
    }
}

/// Returns what each view says that it is for (`target`), 0 where it says nothing.
std::vector<int> checkViews(const json& root, Problems& p) {
    const json &buffers = arrayOf(root, "buffers"), &views = arrayOf(root, "bufferViews");
    std::vector<int> target(views.size(), 0);
    for (size_t i = 0; i < views.size(); ++i) {
        const json& v = views[i];
        const auto bufferBytes = buffers[v["buffer"].get<size_t>()]["byteLength"].get<uint64_t>();
        const uint64_t offset = v.value("byteOffset", uint64_t{0}), length = v["byteLength"].get<uint64_t>();
        if (offset > bufferBytes || length > bufferBytes - offset)
            say(p, at("bufferViews", i),
                fmt::format("{} bytes at {} reach beyond the buffer's {}", length, offset, bufferBytes));
        if (length == 0) sayHarmless(p, at("bufferViews", i), "has no bytes");
        if (v.contains("byteStride")) {
            const auto stride = v["byteStride"].get<uint64_t>();
            if (stride < 4 || stride > 252)
                sayHarmless(p, at("bufferViews", i), fmt::format("'byteStride' {} is not 4 to 252", stride));
            if (stride % 4 != 0)
                sayHarmless(p, at("bufferViews", i), fmt::format("'byteStride' {} is not a multiple of 4", stride));
            if (stride > length)
                sayHarmless(p, at("bufferViews", i), fmt::format("'byteStride' {} is larger than the view", stride));
            if (v.value("target", 0) == 34963) sayHarmless(p, at("bufferViews", i), "indices have no 'byteStride'");
        }
        target[i] = v.value("target", 0);
    }
    return target;
}

/// Elements of `element` bytes each, the last one of `last`, from `offset` on in a view.
struct Range {
    size_t view;
    uint64_t offset, count, element, last, component;
    bool isStrided;
};

void checkRange(const json& views, const std::string& path, const Range& range, Problems& p) {
    const auto& [view, offset, count, element, last, component, strided] = range;
    const json& v = views[view];
    const uint64_t length = v["byteLength"].get<uint64_t>(),
                   stride = strided ? v.value("byteStride", element) : element;
    if (stride < element)
        sayHarmless(p, path, fmt::format("elements of {} bytes do not fit a 'byteStride' of {}", element, stride));
    if (offset % component != 0 || (v.value("byteOffset", uint64_t{0}) + offset) % component != 0)
        sayHarmless(p, path, fmt::format("does not begin at a multiple of {} bytes", component));
    if (count > 0 && (offset > length || last > length - offset || (count - 1) > (length - offset - last) / stride))
        say(p, path,
            fmt::format("{} elements at {} reach beyond the {} bytes of buffer view {}", count, offset, length, view));
}

void checkSparse(const json& views, const json& a, size_t i, Problems& p) {
    const auto type = a["type"].get<std::string>();
    const int component = a["componentType"].get<int>();
    const auto count = a["count"].get<uint64_t>();
    const json& s = a["sparse"];
    const auto n = s["count"].get<uint64_t>();
    if (n > count) say(p, at("accessors", i), fmt::format("replaces {} of {} elements", n, count));
    const int indexType = s["indices"]["componentType"].get<int>();
    for (const char* part : {"indices", "values"}) {
        const bool isIndex = part[0] == 'i';
        const auto view = s[part]["bufferView"].get<size_t>();
        const size_t element = isIndex ? componentBytes(indexType) : elementBytes(type, component);
        checkRange(views, fmt::format("/accessors/{}/sparse/{}", i, part),
                   {view, s[part].value("byteOffset", uint64_t{0}), n, element, element,
                    componentBytes(isIndex ? indexType : component), false},
                   p);
        if (views[view].contains("byteStride") || views[view].contains("target"))
            sayHarmless(p, at("accessors", i),
                        fmt::format("the buffer view of sparse {} has a stride or a target", part));
    }
}

void checkAccessors(const json& root, Problems& p) {
    const json &views = arrayOf(root, "bufferViews"), &accessors = arrayOf(root, "accessors");
    for (size_t i = 0; i < accessors.size(); ++i) {
        const json& a = accessors[i];
        const auto type = a["type"].get<std::string>();
        const int component = a["componentType"].get<int>();
        const auto count = a["count"].get<uint64_t>();
        if (count == 0) sayHarmless(p, at("accessors", i), "has no elements");
        if (a.contains("bufferView"))
            checkRange(
                views, at("accessors", i),
                {a["bufferView"].get<size_t>(), a.value("byteOffset", uint64_t{0}), count,
                 elementBytes(type, component), lastElementBytes(type, component), componentBytes(component), true},
                p);
        else if (a.contains("byteOffset"))
            sayHarmless(p, at("accessors", i), "'byteOffset' without 'bufferView'");
        if (type.rfind("MAT", 0) == 0 && a.value("byteOffset", uint64_t{0}) % 4 != 0)
            sayHarmless(p, at("accessors", i), "matrices begin at multiples of 4 bytes");
        if (isNormalised(a) && (component == 5126 || component == 5125))
            sayHarmless(p, at("accessors", i), "floats and 32-bit integers cannot be normalised");
        for (const char* bound : {"min", "max"})
            if (a.contains(bound) && a[bound].size() != componentsOf(type))
                sayHarmless(p, at("accessors", i),
                            fmt::format("'{}' has {} values for {}", bound, a[bound].size(), type));
        if (a.contains("sparse")) checkSparse(views, a, i, p);
    }
}

/// `target`: of each view what it is for.
void checkUses(const json& root, std::vector<int> target, Problems& p) {
    const json& accessors = arrayOf(root, "accessors");
    for (const json& mesh : arrayOf(root, "meshes"))
        for (const json& primitive : mesh["primitives"]) {
            const auto use = [&](const json& accessor, int as) {
                // Those of morph targets are checked later.
                if (!accessor.is_number_unsigned() || accessor.get<size_t>() >= accessors.size()) return;
                const json& a = accessors[accessor.get<size_t>()];
                if (!a.contains("bufferView")) return;
                int& is = target[a["bufferView"].get<size_t>()];
                if (is != 0 && is != as)
                    sayHarmless(p, at("bufferViews", a["bufferView"].get<size_t>()),
                                "serves both attributes and indices");
                is = as;
            };
            for (const auto& [name, accessor] : primitive["attributes"].items()) use(accessor, 34962);
            for (const json& morph : primitive.value("targets", json::array()))
                for (const auto& [name, accessor] : morph.items()) use(accessor, 34962);
            if (primitive.contains("indices")) use(primitive["indices"], 34963);
        }
}

}  // namespace

void checkExtents(const json& root, bool isBinary, bool hasBinaryChunk, uint64_t binaryBytes, Problems& p) {
    checkBuffers(root, isBinary, hasBinaryChunk, binaryBytes, p);
    const std::vector<int> target = checkViews(root, p);
    checkAccessors(root, p);
    checkUses(root, target, p);
}

}  // namespace stipple::scene::gltf
