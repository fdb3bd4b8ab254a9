// Animations and skins: Stipple plays neither, so that what is wrong with them changes nothing that is drawn.
#include <fmt/format.h>

#include <set>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

void checkChannel(const json& root, const json& animation, const json& channel, const std::string& path,
                  std::set<std::string>& targets, Problems& p) {
    const auto index = channel["sampler"].get<size_t>();
    if (index >= animation["samplers"].size())
        return sayHarmless(p, path, fmt::format("refers to sampler {}, which is not there", index));
    const json &sampler = animation["samplers"][index], &target = channel["target"];
    const auto what = target["path"].get<std::string>();
    const bool isPointer = target.contains("extensions") && target["extensions"].contains("KHR_animation_pointer");
    if (isPointer && (what != "pointer" || target.contains("node")))
        sayHarmless(p, path, "an animation pointer has the path 'pointer' and no node");
    static const std::set<std::string> paths{"translation", "rotation", "scale", "weights"};
    if (!isPointer && what != "pointer" && paths.count(what) == 0)
        sayHarmless(p, path, fmt::format("animates '{}', which glTF does not know", what));
    const json& accessors = arrayOf(root, "accessors");
    const json &input = accessors[sampler["input"].get<size_t>()], &output = accessors[sampler["output"].get<size_t>()];
    const std::string interpolation = sampler.value("interpolation", "LINEAR");
    size_t perKey = interpolation == "CUBICSPLINE" ? 3 : 1;
    if (target.contains("node")) {
        const json& node = root["nodes"][target["node"].get<size_t>()];
        if (node.contains("matrix") && what != "weights") sayHarmless(p, path, "animates a node that has a matrix");
        const json* mesh = node.contains("mesh") ? &root["meshes"][node["mesh"].get<size_t>()] : nullptr;
        const size_t morphs = mesh ? (*mesh)["primitives"][0].value("targets", json::array()).size() : 0;
        if (what == "weights" && morphs == 0)
            sayHarmless(p, path, "animates the weights of a node without morph targets");
        if (what == "weights") perKey *= std::max<size_t>(1, morphs);
        if (!targets.insert(fmt::format("{} {}", target["node"].dump(), what)).second)
            sayHarmless(p, path, "animates what another channel animates");
    }
    const std::string type = output["type"].get<std::string>();
    const int component = output["componentType"].get<int>();
    const bool normalised = output.value("normalized", false) && component != 5125;
    const bool typeFits = what == "rotation"  ? type == "VEC4"
                          : what == "weights" ? type == "SCALAR"
                          : paths.count(what) ? type == "VEC3"
                                              : true;
    const bool componentFits =
        component == 5126 || ((what == "rotation" || what == "weights" || paths.count(what) == 0) && normalised);
    if (!typeFits || !componentFits)
        sayHarmless(p, path, fmt::format("'{}' cannot be {} of {}", what, type, component));
    if (paths.count(what) != 0 && output["count"].get<size_t>() != input["count"].get<size_t>() * perKey)
        sayHarmless(p, path, fmt::format("{} values for {} keys", output["count"].dump(), input["count"].dump()));
    if (interpolation == "CUBICSPLINE" && input["count"].get<size_t>() < 2)
        sayHarmless(p, path, "a cubic spline needs two keys");
}

}  // namespace

void checkAnimationsAndSkins(const json& root, Problems& p) {
    const json& accessors = arrayOf(root, "accessors");
    const json& animations = arrayOf(root, "animations");
    for (size_t a = 0; a < animations.size(); ++a) {
        std::set<std::string> targets;
        for (size_t c = 0; c < animations[a]["channels"].size(); ++c)
            checkChannel(root, animations[a], animations[a]["channels"][c],
                         fmt::format("/animations/{}/channels/{}", a, c), targets, p);
        for (size_t s = 0; s < animations[a]["samplers"].size(); ++s) {
            const std::string path = fmt::format("/animations/{}/samplers/{}", a, s);
            const json& sampler = animations[a]["samplers"][s];
            const json& input = accessors[sampler["input"].get<size_t>()];
            if (input["type"] != "SCALAR" || input["componentType"] != 5126)
                sayHarmless(p, path, "times must be scalar floats");
            if (!input.contains("min") || !input.contains("max")) sayHarmless(p, path, "times need 'min' and 'max'");
            if (hasStride(root, input) || hasStride(root, accessors[sampler["output"].get<size_t>()]))
                sayHarmless(p, path, "buffer views of animations have no 'byteStride'");
        }
    }
    const json& skins = arrayOf(root, "skins");
    std::vector<int64_t> parent(arrayOf(root, "nodes").size(), -1);
    for (size_t n = 0; n < parent.size(); ++n)
        for (const json& child : root["nodes"][n].value("children", json::array()))
            parent[child.get<size_t>()] = static_cast<int64_t>(n);
    const auto rootOf = [&](size_t n) {
        size_t steps = 0;
        while (parent[n] >= 0 && ++steps <= parent.size()) n = static_cast<size_t>(parent[n]);
        return n;
    };
    for (size_t s = 0; s < skins.size(); ++s) {
        const std::string path = fmt::format("/skins/{}", s);
        const json& joints = skins[s]["joints"];
        for (const json& joint : joints)
            if (rootOf(joint.get<size_t>()) != rootOf(joints[0].get<size_t>())) {
                sayHarmless(p, path, "its joints have no common root");
                break;
            }
        if (skins[s].contains("skeleton")) {
            const auto skeleton = skins[s]["skeleton"].get<size_t>();
            for (const json& joint : joints) {
                auto n = static_cast<int64_t>(joint.get<size_t>());
                for (size_t steps = 0; n >= 0 && n != static_cast<int64_t>(skeleton) && steps <= parent.size(); ++steps)
                    n = parent[static_cast<size_t>(n)];
                if (n < 0) {
                    sayHarmless(p, path, fmt::format("node {} is not a common root of its joints", skeleton));
                    break;
                }
            }
        }
        if (!skins[s].contains("inverseBindMatrices")) continue;
        const json& a = accessors[skins[s]["inverseBindMatrices"].get<size_t>()];
        if (a["type"] != "MAT4" || a["componentType"] != 5126)
            sayHarmless(p, path, "inverse bind matrices must be MAT4 of floats");
        if (a["count"].get<size_t>() < joints.size()) sayHarmless(p, path, "fewer inverse bind matrices than joints");
        if (hasStride(root, a)) sayHarmless(p, path, "the buffer view of inverse bind matrices has no 'byteStride'");
    }
    for (size_t n = 0; n < parent.size(); ++n) {
        if (!root["nodes"][n].contains("skin")) continue;
        const auto skin = root["nodes"][n]["skin"].get<size_t>();
        const size_t joint = rootOf(skins[skin]["joints"][0].get<size_t>()), mine = rootOf(n);
        for (const json& scene : arrayOf(root, "scenes")) {
            const json list = scene.value("nodes", json::array());
            const auto has = [&](size_t node) { return std::find(list.begin(), list.end(), json(node)) != list.end(); };
            if (has(mine) && !has(joint))
                sayHarmless(p, fmt::format("/nodes/{}", n), "the joints of its skin are not in its scene");
        }
    }
}

}  // namespace stipple::scene::gltf
