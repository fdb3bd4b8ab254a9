#include "engine/scene/gltf/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "engine/scene/gltf/json_tools.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

/// One line per property: type of object, property ("!" required), what it must be:
///   int/num [low [high]]   with ">" before a bound that is excluded      bool   string   uri   any
///   enum A B ...           numbers or words                              @name  an index into the root's array `name`
///   array MIN MAX what     of so many items ("*": no limit)              set    an array without equal items
///   map what               an object with values of one kind             NAME   an object of that type
constexpr const char* kTable = R"(
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
accessor count! int 1
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
buffer byteLength! int 1
bufferView name string
bufferView buffer! @buffers
bufferView byteOffset int 0
bufferView byteLength! int 1
bufferView byteStride int 4 252
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

struct Rule {
    std::string what;
    std::vector<std::string> arguments;
};
struct Type {
    std::map<std::string, Rule> rules;
    std::vector<std::string> required;
};

const std::map<std::string, Type>& types() {
    static const std::map<std::string, Type> all = [] {
        std::map<std::string, Type> t;
        std::istringstream lines(kTable);
        for (std::string line; std::getline(lines, line);) {
            std::istringstream words(line);
            std::string type, property, word;
            Rule rule;
            if (!(words >> type >> property >> rule.what)) continue;
            while (words >> word) rule.arguments.push_back(word);
            if (property.back() == '!') {
                property.pop_back();
                t[type].required.push_back(property);
            }
            t[type].rules[property] = rule;
        }
        t["target"];  // its attributes are checked with the primitive's
        return t;
    }();
    return all;
}

/// RFC 6901: empty, or parts that begin with a slash, with ~ only before 0 or 1.
bool isPointer(const std::string& s) {
    if (!s.empty() && s[0] != '/') return false;
    for (size_t i = 0; i < s.size(); ++i)
        if (s[i] == '~' && (i + 1 == s.size() || (s[i + 1] != '0' && s[i + 1] != '1'))) return false;
    return true;
}

/// Members that a picture can do without: where they are wrong they are left out.
bool canBeLeftOut(const std::string& name) {
    static const std::set<std::string> names{"name",
                                             "pbrMetallicRoughness",
                                             "generator",
                                             "copyright",
                                             "minVersion",
                                             "animations",
                                             "skins",
                                             "cameras",
                                             "camera",
                                             "skin",
                                             "weights",
                                             "targets",
                                             "target",
                                             "min",
                                             "max",
                                             "material",
                                             "sampler",
                                             "source",
                                             "magFilter",
                                             "minFilter",
                                             "wrapS",
                                             "wrapT",
                                             "mimeType",
                                             "doubleSided",
                                             "alphaMode",
                                             "alphaCutoff",
                                             "normalTexture",
                                             "occlusionTexture",
                                             "baseColorTexture",
                                             "emissiveTexture",
                                             "metallicRoughnessTexture",
                                             "aspectRatio",
                                             "zfar",
                                             "range",
                                             "texCoord",
                                             "scene"};
    return names.count(name) != 0;
}

/// Without these extensions something else would be drawn than what the file means.
bool decidesGeometry(const std::string& extension) {
    return extension == "EXT_mesh_gpu_instancing" || extension == "EXT_meshopt_compression" ||
           extension == "KHR_mesh_quantization" || extension == "STIPPLE_store";
}

class Checker {
  public:
    Checker(const json& root, Problems& problems, Mends& mends) : root_(root), problems_(problems), mends_(mends) {}

    void object(const json& value, const std::string& type, const std::string& path) {
        if (!value.is_object()) return say(path, "must be an object");
        const auto found = types().find(type);
        if (found == types().end()) return;
        for (const std::string& name : found->second.required)
            if (!value.contains(name)) say(path, fmt::format("lacks '{}'", name));
        for (const auto& [key, member] : value.items()) {
            const std::string at = below(path, key);
            if (key == "extensions") {
                extensions(member, at);
            } else if (const auto rule = found->second.rules.find(key); rule != found->second.rules.end()) {
                const auto& required = found->second.required;
                const bool isOptional = std::find(required.begin(), required.end(), key) == required.end();
                const auto test = [&, &member = member](Checker& by) {
                    by.check(member, rule->second.what, rule->second.arguments, at);
                };
                if (isOptional && member.is_array() && member.empty() && rule->second.what != "any") {
                    sayHarmless(at, "is empty");
                    mend(at);
                } else if (isOptional && canBeLeftOut(key))
                    orLeaveOut(at, test);
                else
                    test(*this);
            }
        }
    }

  private:
    void say(const std::string& path, const std::string& what) { gltf::say(problems_, path, what); }

    void sayHarmless(const std::string& path, const std::string& what) { gltf::sayHarmless(problems_, path, what); }
    void mend(const std::string& path, json value = nullptr) {
        if (path.find('~') == std::string::npos) mends_.push_back({json::json_pointer(path), std::move(value)});
    }

    /// What `test` finds wrong is harmless, since the member at `path` can be left out.
    template <typename Test>
    void orLeaveOut(const std::string& path, const Test& test) {
        Problems found;
        Mends mends;
        Checker inner(root_, found, mends);
        test(inner);
        const bool isLeftOut = mattersAny(found);
        for (const std::string& problem : found)
            if (problems_.size() < kMostProblems / 2)
                problems_.push_back(isHarmless(problem) ? problem : kHarmless + problem);
        if (isLeftOut)
            mend(path);
        else
            mends_.insert(mends_.end(), mends.begin(), mends.end());
    }

    void extensions(const json& value, const std::string& path) {
        if (!value.is_object()) return say(path, "must be an object");
        for (const auto& [name, member] : value.items()) {
            const std::string at = below(path, name);
            const auto test = [&, &key = name, &object = member](Checker& by) { by.extension(key, object, path, at); };
            if (decidesGeometry(name))
                test(*this);
            else
                orLeaveOut(at, test);
        }
    }

    void extension(const std::string& name, const json& member, const std::string& path, const std::string& at) {
        if (!member.is_object()) return say(at, "must be an object");
        const bool declared = root_.contains("extensionsUsed") && root_["extensionsUsed"].is_array() &&
                              std::find(root_["extensionsUsed"].begin(), root_["extensionsUsed"].end(), json(name)) !=
                                  root_["extensionsUsed"].end();
        if (!declared) sayHarmless(at, "the extension is not listed in 'extensionsUsed'");
        // At a node or primitive these two have other properties, which are checked with those.
        const bool isDefinition = path == "/extensions";
        if (isDefinition && name == "KHR_lights_punctual" && !member.contains("lights")) say(at, "lacks 'lights'");
        if (isDefinition && name == "KHR_materials_variants" && !member.contains("variants"))
            say(at, "lacks 'variants'");
        if (name == "EXT_meshopt_compression" && path.rfind("/buffers/", 0) == 0) return;  // only says what it is
        const bool isMapping = name == "KHR_materials_variants" && !isDefinition;
        if (isMapping && !member.contains("mappings")) say(at, "lacks 'mappings'");
        if (name == "KHR_animation_pointer" && member.contains("pointer") && member["pointer"].is_string() &&
            !isPointer(member["pointer"].get<std::string>()))
            say(at, "its pointer is not a JSON pointer");
        if (types().count(name) != 0) object(member, name, at);
    }

    void check(const json& v, const std::string& what, const std::vector<std::string>& arguments,
               const std::string& path) {
        if (what == "any") return;
        if (what == "bool" && !v.is_boolean()) return say(path, "must be true or false");
        if (what == "bool") return;
        if (what == "string" || what == "version" || what == "uri") return text(v, what, path);
        if (what == "int" || what == "num") return number(v, what == "int", arguments, path);
        if (what == "enum") return oneOf(v, arguments, path);
        if (what == "ior") {
            number(v, false, {"0"}, path);
            if (v.is_number() && v.get<double>() > 0 && v.get<double>() < 1)
                say(path, "an index of refraction is 0 or at least 1");
            return;
        }
        if (what[0] == '@') return index(v, what.substr(1), path);
        if (what == "array" || what == "set") return array(v, what == "set", arguments, path);
        if (what == "map") {
            if (!v.is_object()) return say(path, "must be an object");
            if (v.empty()) return sayHarmless(path, "is empty");
            for (const auto& [key, member] : v.items()) check(member, arguments[0], {}, below(path, key));
            return;
        }
        object(v, what, path);
    }

    void text(const json& v, const std::string& what, const std::string& path) {
        if (!v.is_string()) return say(path, "must be a string");
        const auto& s = v.get_ref<const std::string&>();
        if (what == "version") {
            const size_t dot = s.find('.');
            const bool good = s.size() <= 16 && dot != std::string::npos && dot > 0 && dot + 1 < s.size() &&
                              s.find_first_not_of("0123456789.") == std::string::npos &&
                              s.find('.', dot + 1) == std::string::npos;
            if (!good) say(path, fmt::format("'{}' is not a version such as 2.0", s));
        }
        if (what == "uri") {
            // Spaces are not allowed either, but many exporters write them.
            const bool isBroken = s.rfind("data:", 0) != 0 && s.find_first_of("\t\n\\") != std::string::npos;
            if (s.empty() || isBroken) sayHarmless(path, fmt::format("'{}' is not a URI", s.substr(0, 80)));
            for (size_t i = 0; i < s.size() && s.rfind("data:", 0) != 0; ++i)
                if (s[i] == '%' && (i + 2 >= s.size() || !std::isxdigit(static_cast<unsigned char>(s[i + 1])) ||
                                    !std::isxdigit(static_cast<unsigned char>(s[i + 2]))))
                    sayHarmless(path, fmt::format("'{}' has a % without two digits", s.substr(0, 80)));
        }
    }

    void number(const json& v, bool whole, const std::vector<std::string>& bounds, const std::string& path) {
        const bool isWhole = v.is_number() && v.get<double>() == std::floor(v.get<double>());
        if (!v.is_number() || (whole && !isWhole))
            return say(path, whole ? "must be a whole number" : "must be a number");
        const auto x = v.get<double>();
        if (!std::isfinite(x)) return say(path, "must be finite");
        for (size_t k = 0; k < bounds.size(); ++k) {
            const bool excluded = bounds[k][0] == '>';
            const double bound = std::stod(bounds[k].substr(excluded ? 1 : 0));
            const bool good = k == 0 ? (excluded ? x > bound : x >= bound) : x <= bound;
            if (good) continue;
            const std::string text = fmt::format("is {}, must be {} {}", x,
                                                 k == 1     ? "at most"
                                                 : excluded ? "above"
                                                            : "at least",
                                                 bound);
            if (whole || excluded) {
                say(path, text);
                continue;
            }
            sayHarmless(path, text);
            if (path.find("/rotation/") == std::string::npos) mend(path, bound);  // (those are made unit length)
        }
        if (whole && std::abs(x) > 9007199254740992.0) say(path, fmt::format("{} is too large", x));
    }

    void oneOf(const json& v, const std::vector<std::string>& values, const std::string& path) {
        const std::string s = v.is_string()   ? v.get<std::string>()
                              : v.is_number() ? fmt::format("{}", v.get<double>())
                                              : std::string("?");
        if (std::find(values.begin(), values.end(), s) == values.end())
            say(path, fmt::format("{} is none of {}", v.dump().substr(0, 60), fmt::join(values, ", ")));
    }

    void index(const json& v, const std::string& name, const std::string& path) {
        number(v, true, {"0"}, path);
        if (!v.is_number() || v.get<double>() < 0) return;
        const size_t count = root_.contains(name) && root_[name].is_array() ? root_[name].size() : 0;
        if (v.get<double>() >= static_cast<double>(count))
            say(path, fmt::format("refers to {} {}, but there are {}", name, v.dump(), count));
    }

    void array(const json& v, bool isSet, const std::vector<std::string>& a, const std::string& path) {
        if (!v.is_array()) return say(path, "must be an array");
        const auto least = static_cast<size_t>(std::stoul(a[0]));
        if (v.size() < least || (a[1] != "*" && v.size() > std::stoul(a[1])))
            say(path, fmt::format("has {} items, {} to {} are expected", v.size(), a[0], a[1]));
        const std::vector<std::string> rest(a.begin() + 3, a.end());
        for (size_t i = 0; i < v.size(); ++i) check(v[i], a[2], rest, path + "/" + std::to_string(i));
        if (isSet) {
            std::set<std::string> seen;
            for (const json& item : v)
                if (!seen.insert(item.dump()).second)
                    return sayHarmless(path, fmt::format("holds {} twice", item.dump().substr(0, 60)));
        }
    }

    const json& root_;
    Problems& problems_;
    Mends& mends_;
};

}  // namespace

void checkStructure(const json& root, Problems& problems, Mends& mends) {
    Checker(root, problems, mends).object(root, "root", "");
}

void applyMends(const Mends& mends, json& root) {
    for (const Mend& m : mends) {
        if (!root.contains(m.place)) continue;
        if (!m.value.is_null())
            root[m.place] = m.value;
        else if (json& parent = root[m.place.parent_pointer()]; parent.is_object())
            parent.erase(m.place.back());
    }
}

const std::vector<std::string>& knownExtensions() {
    static const std::vector<std::string> known{
        "KHR_lights_punctual",     "KHR_texture_transform", "EXT_mesh_gpu_instancing", "KHR_mesh_quantization",
        "EXT_meshopt_compression", "KHR_materials_unlit",   "EXT_texture_webp",        "STIPPLE_store"};
    return known;
}

bool isAboutLooks(const std::string& extension) {
    static const std::set<std::string> more{"KHR_animation_pointer", "KHR_technique_webgl",   "KHR_techniques_webgl",
                                            "KHR_node_visibility",   "KHR_xmp_json_ld",       "EXT_lights_image_based",
                                            "MSFT_texture_dds",      "KHR_lights_environment"};
    const auto begins = [&](const char* with) { return extension.rfind(with, 0) == 0; };
    return begins("KHR_materials_") || begins("KHR_texture_") || begins("EXT_texture_") || more.count(extension) != 0;
}

}  // namespace stipple::scene::gltf
