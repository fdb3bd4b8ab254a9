// The numbers themselves: are they what the accessors and their users promise?
#include <fmt/format.h>

#include <cmath>
#include <set>

#include "engine/scene/gltf/accessors.h"
#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

/// Declared bounds against the values. `stored`: as in the file, not normalised.
void checkBounds(const json& a, const std::vector<double>& stored, size_t components, const std::string& path,
                 Problems& p) {
    std::vector<double> least(components, HUGE_VAL), greatest(components, -HUGE_VAL);
    for (size_t i = 0; i < stored.size(); ++i) {
        if (!std::isfinite(stored[i])) return sayHarmless(p, path, fmt::format("value {} is not finite", i));
        least[i % components] = std::min(least[i % components], stored[i]);
        greatest[i % components] = std::max(greatest[i % components], stored[i]);
    }
    const bool isFloat = a["componentType"] == 5126;
    const auto same = [&](double declared, double found) {
        return isFloat ? static_cast<float>(declared) == static_cast<float>(found) : declared == found;
    };
    const auto hasAll = [&](const char* bound) { return a.contains(bound) && a[bound].size() == components; };
    for (size_t k = 0; k < components; ++k) {
        if (hasAll("min") && !same(a["min"][k].get<double>(), least[k]))
            sayHarmless(
                p, path,
                fmt::format("'min' {} of component {}, but the values begin at {}", a["min"][k].dump(), k, least[k]));
        if (hasAll("max") && !same(a["max"][k].get<double>(), greatest[k]))
            sayHarmless(
                p, path,
                fmt::format("'max' {} of component {}, but the values end at {}", a["max"][k].dump(), k, greatest[k]));
    }
}

void checkUnit(const std::vector<double>& v, size_t components, size_t used, const std::string& path, Problems& p) {
    for (size_t i = 0; i + components <= v.size(); i += components) {
        double square = 0;
        for (size_t k = 0; k < used; ++k) square += v[i + k] * v[i + k];
        if (std::abs(std::sqrt(square) - 1) > 0.03)
            return sayHarmless(p, path, fmt::format("element {} has not the length 1", i / components));
    }
}

bool hasFrameHeader(const std::vector<uint8_t>& jpeg) {
    for (size_t i = 2; i + 4 <= jpeg.size() && jpeg[i] == 0xff;) {
        const uint8_t marker = jpeg[i + 1];
        if (marker == 0xff) {
            ++i;
            continue;
        }
        const bool isFrame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (isFrame) return true;
        i += 2 + (static_cast<size_t>(jpeg[i + 2]) << 8 | jpeg[i + 3]);
    }
    return false;
}

class ValueChecker {
  public:
    ValueChecker(const json& root, Buffers& buffers, Problems& problems)
        : root_(root), buffers_(buffers), p_(problems) {}

    Result<void> run() {
        const json& accessors = arrayOf(root_, "accessors");
        for (size_t i = 0; i < accessors.size(); ++i) {
            if (!buffers_.hasData(accessors[i])) continue;  // a placeholder
            STIPPLE_ASSIGN(std::vector<double> stored, buffers_.values(i));
            if (accessors[i].value("normalized", false)) {
                const int type = accessors[i]["componentType"].get<int>();
                const double most = type == 5120 ? 127 : type == 5121 ? 255 : type == 5122 ? 32767 : 65535;
                for (double& x : stored) x = std::round(x * most);
            }
            checkBounds(accessors[i], stored, componentsOf(accessors[i]["type"].get<std::string>()),
                        path("accessors", i), p_);
        }
        STIPPLE_TRY(meshes());
        return animationsAndSkins();
    }

  private:
    static std::string path(const char* name, size_t i) { return fmt::format("/{}/{}", name, i); }

    Result<void> meshes() {
        const json& meshes = arrayOf(root_, "meshes");
        for (size_t m = 0; m < meshes.size(); ++m)
            for (const json& primitive : meshes[m]["primitives"])
                STIPPLE_TRY(checkPrimitive(primitive, path("meshes", m)));
        return {};
    }

    Result<void> checkPrimitive(const json& primitive, const std::string& where) {
        size_t count = 0, joints = SIZE_MAX;
        const json& accessors = root_["accessors"];
        for (const auto& [name, index] : primitive["attributes"].items()) {
            const json& a = accessors[index.get<size_t>()];
            count = a["count"].get<size_t>();
            const bool isFloat = a["componentType"] == 5126;
            if (!buffers_.hasData(a)) continue;
            STIPPLE_ASSIGN(const std::vector<double> v, buffers_.values(index.get<size_t>()));
            if (name == "NORMAL" && isFloat) checkUnit(v, 3, 3, where + "/NORMAL", p_);
            if (name == "TANGENT" && isFloat) {
                checkUnit(v, 4, 3, where + "/TANGENT", p_);
                for (size_t i = 3; i < v.size(); i += 4)
                    if (std::abs(v[i]) != 1) {
                        sayHarmless(p_, where + "/TANGENT", fmt::format("the sign of element {} is {}", i / 4, v[i]));
                        break;
                    }
            }
            if (name.rfind("COLOR_", 0) == 0)
                for (const double c : v)
                    if (c < 0 || c > 1) {
                        sayHarmless(p_, below(where, name), fmt::format("{} is not between 0 and 1", c));
                        break;
                    }
            if (name.rfind("WEIGHTS_", 0) == 0) checkWeights(v, isFloat, below(where, name));
            if (name.rfind("JOINTS_", 0) == 0) joints = std::min(joints, fewestJoints(primitive));
            if (name.rfind("JOINTS_", 0) == 0) STIPPLE_TRY(checkJoints(v, primitive, name, below(where, name), joints));
        }
        if (!primitive.contains("indices")) return {};
        const auto index = primitive["indices"].get<size_t>();
        if (!buffers_.hasData(accessors[index])) return {};
        STIPPLE_ASSIGN(const std::vector<uint32_t> v, buffers_.indices(index));
        const int type = accessors[index]["componentType"].get<int>();
        const uint32_t restart = type == 5121 ? 0xffu : type == 5123 ? 0xffffu : 0xffffffffu;
        for (const uint32_t i : v) {
            if (i == restart) {
                sayHarmless(p_, where + "/indices", "holds the primitive restart value");
                break;
            }
            if (i >= count) {
                sayHarmless(p_, where + "/indices", fmt::format("refers to vertex {}, but there are {}", i, count));
                break;
            }
        }
        return {};
    }

    void checkWeights(const std::vector<double>& v, bool isFloat, const std::string& where) {
        for (size_t i = 0; i + 4 <= v.size(); i += 4) {
            double sum = 0;
            for (size_t k = 0; k < 4; ++k) {
                if (v[i + k] < 0) return sayHarmless(p_, where, fmt::format("weight {} is negative", i + k));
                sum += v[i + k];
            }
            if (std::abs(sum - 1) > (isFloat ? 2e-4 : 5e-3) && sum != 0)
                return sayHarmless(p_, where, fmt::format("the weights of vertex {} sum up to {}", i / 4, sum));
        }
    }

    /// Joints of the smallest skin that a mesh with this primitive is used with.
    size_t fewestJoints(const json& primitive) const {
        size_t fewest = SIZE_MAX;
        for (const json& node : arrayOf(root_, "nodes")) {
            if (!node.contains("skin") || !node.contains("mesh")) continue;
            for (const json& other : root_["meshes"][node["mesh"].get<size_t>()]["primitives"])
                if (other == primitive)
                    fewest = std::min(fewest, root_["skins"][node["skin"].get<size_t>()]["joints"].size());
        }
        return fewest;
    }

    Result<void> checkJoints(const std::vector<double>& v, const json& primitive, const std::string& name,
                             const std::string& where, size_t joints) {
        std::string weightName = name;
        weightName.replace(0, 6, "WEIGHTS");
        std::vector<double> weights(v.size(), 1.0);
        if (primitive["attributes"].contains(weightName)) {
            STIPPLE_ASSIGN(weights, buffers_.values(primitive["attributes"][weightName].get<size_t>()));
        }
        for (size_t i = 0; i + 4 <= v.size() && weights.size() == v.size(); i += 4) {
            std::set<double> seen;
            for (size_t k = i; k < i + 4; ++k) {
                if (v[k] >= static_cast<double>(joints)) {
                    sayHarmless(p_, where,
                                fmt::format("vertex {} refers to joint {}, but there are {}", i / 4, v[k], joints));
                    return {};
                }
                if (weights[k] > 0 && !seen.insert(v[k]).second) {
                    sayHarmless(p_, where, fmt::format("vertex {} refers to joint {} twice", i / 4, v[k]));
                    return {};
                }
            }
        }
        return {};
    }

    Result<void> animationsAndSkins() {
        const json& animations = arrayOf(root_, "animations");
        for (size_t a = 0; a < animations.size(); ++a) {
            for (const json& sampler : animations[a]["samplers"]) {
                if (!buffers_.hasData(root_["accessors"][sampler["input"].get<size_t>()])) continue;
                STIPPLE_ASSIGN(const std::vector<double> times, buffers_.values(sampler["input"].get<size_t>()));
                for (size_t i = 0; i < times.size(); ++i)
                    if (times[i] < 0 || (i > 0 && !(times[i] > times[i - 1]))) {
                        sayHarmless(
                            p_, path("animations", a),
                            fmt::format("key {} at {} s is negative or not later than the one before", i, times[i]));
                        break;
                    }
            }
            for (const json& channel : animations[a]["channels"]) {
                if (channel["target"]["path"] != "rotation") continue;
                const json& sampler = animations[a]["samplers"][channel["sampler"].get<size_t>()];
                if (!buffers_.hasData(root_["accessors"][sampler["output"].get<size_t>()])) continue;
                STIPPLE_ASSIGN(std::vector<double> v, buffers_.values(sampler["output"].get<size_t>()));
                if (sampler.value("interpolation", "LINEAR") == "CUBICSPLINE") {  // tangents are no rotations
                    std::vector<double> keys;
                    for (size_t i = 4; i + 8 <= v.size(); i += 12)
                        keys.insert(keys.end(), v.begin() + static_cast<ptrdiff_t>(i),
                                    v.begin() + static_cast<ptrdiff_t>(i + 4));
                    v = keys;
                }
                checkUnit(v, 4, 4, path("animations", a), p_);
            }
        }
        const json& skins = arrayOf(root_, "skins");
        for (size_t s = 0; s < skins.size(); ++s) {
            if (!skins[s].contains("inverseBindMatrices")) continue;
            if (!buffers_.hasData(root_["accessors"][skins[s]["inverseBindMatrices"].get<size_t>()])) continue;
            STIPPLE_ASSIGN(const std::vector<double> v, buffers_.values(skins[s]["inverseBindMatrices"].get<size_t>()));
            for (size_t i = 0; i + 16 <= v.size(); i += 16)
                if (v[i + 3] != 0 || v[i + 7] != 0 || v[i + 11] != 0 || v[i + 15] != 1) {
                    sayHarmless(p_, path("skins", s),
                                fmt::format("inverse bind matrix {} does not end in 0 0 0 1", i / 16));
                    break;
                }
        }
        return {};
    }

    const json& root_;
    Buffers& buffers_;
    Problems& p_;
};

}  // namespace

Result<void> checkImageBytes(const Container& container, Buffers& buffers, Problems& problems) {
    const json& images = arrayOf(container.json, "images");
    constexpr size_t kPngHead = 33;  // signature and IHDR
    for (size_t i = 0; i < images.size(); ++i) {
        if (images[i].contains("bufferView") && !buffers.hasData(images[i])) continue;
        const auto read = buffers.image(i);
        if (!read) {
            sayHarmless(problems, fmt::format("/images/{}", i), read.error().line());
            continue;
        }
        const std::vector<uint8_t>& bytes = *read;
        const std::string head(bytes.begin(),
                               bytes.begin() + static_cast<ptrdiff_t>(std::min<size_t>(bytes.size(), 12)));
        const bool isPng = head.rfind("\x89PNG\r\n\x1a\n", 0) == 0, isJpeg = head.rfind("\xff\xd8\xff", 0) == 0;
        const bool isWebp = head.size() == 12 && head.rfind("RIFF", 0) == 0 && head.substr(8) == "WEBP",
                   isKtx = head.rfind("\xabKTX 20", 0) == 0;
        if (!isPng && !isJpeg && !isWebp && !isKtx)
            sayHarmless(problems, fmt::format("/images/{}", i), "is neither PNG nor JPEG, WebP or KTX2");
        // A JPEG is a chain of markers up to the frame header.
        if (isJpeg && !hasFrameHeader(bytes))
            sayHarmless(problems, fmt::format("/images/{}", i), "the JPEG has no frame header");
        if (isPng && bytes.size() < kPngHead)
            sayHarmless(problems, fmt::format("/images/{}", i), "the PNG ends within its header");
    }
    return {};
}

Result<void> checkValues(const Container& container, Buffers& buffers, Problems& problems) {
    return ValueChecker(container.json, buffers, problems).run();
}

}  // namespace stipple::scene::gltf
