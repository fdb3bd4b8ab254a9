#include "engine/scene/gltf/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/schema_table.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

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
           extension == "KHR_meshopt_compression" || extension == "KHR_mesh_quantization" ||
           extension == "STIPPLE_store";
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
                const bool isEmpty = member.is_array() && member.empty() && rule->second.what != "any";
                if (isOptional && (isEmpty || member.is_null())) {
                    sayHarmless(at, isEmpty ? "is empty" : "is null");
                    mend(at);
                } else if (isEmpty && key == "primitives") {  // a mesh of nothing; others are counted from it
                    sayHarmless(at, "is empty");
                    mend(at, json::array({{{"attributes", json::object()}}}));
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
        if (value.is_null()) {
            sayHarmless(path, "is null");
            return mend(path);
        }
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
        // Only says what it is.
        if (name.find("_meshopt_compression") != std::string::npos && path.rfind("/buffers/", 0) == 0) return;
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
        if (what == "stride") {
            number(v, true, {"0"}, path);
            if (v != 0) return;  // others are checked with their views
            sayHarmless(path, "is 0, must be at least 4");
            return mend(path);
        }
        if (what == "version" && v.is_number()) {
            sayHarmless(path, fmt::format("is {}, must be a string", v.dump()));
            return mend(path, fmt::format("{:.1f}", v.get<double>()));
        }
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
    static const std::vector<std::string> known{"KHR_lights_punctual",        "KHR_texture_transform",
                                                "EXT_mesh_gpu_instancing",    "KHR_mesh_quantization",
                                                "KHR_materials_ior",          "EXT_meshopt_compression",
                                                "KHR_meshopt_compression",    "KHR_materials_transmission",
                                                "KHR_materials_unlit",        "KHR_materials_specular",
                                                "KHR_materials_volume",       "EXT_texture_webp",
                                                "KHR_draco_mesh_compression", "STIPPLE_store"};
    return known;
}

bool isAboutLooks(const std::string& extension) {
    static const std::set<std::string> more{
        "KHR_animation_pointer",    "KHR_technique_webgl",    "KHR_techniques_webgl", "KHR_node_visibility",
        "KHR_xmp_json_ld",          "EXT_lights_image_based", "MSFT_texture_dds",     "KHR_lights_environment",
        "EXT_mesh_features",        "EXT_instance_features",  "EXT_feature_metadata", "EXT_structural_metadata",
        "CESIUM_primitive_outline", "EXT_mesh_manifold",      "FB_ngon_encoding",     "KHR_xmp",
        "AGI_articulations",        "AGI_stk_metadata"};
    const auto begins = [&](const char* with) { return extension.rfind(with, 0) == 0; };
    return begins("KHR_materials_") || begins("KHR_texture_") || begins("EXT_texture_") || begins("GOOGLE_texture_") ||
           more.count(extension) != 0;
}

}  // namespace stipple::scene::gltf
