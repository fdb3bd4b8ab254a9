#include "engine/scene/gltf/check.h"

#include <fmt/format.h>

#include "engine/scene/gltf/draco.h"
#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {

using nlohmann::json;

Result<Problems> checkAll(Container& c, Buffers& buffers) {
    Problems p;
    Mends mends;
    checkStructure(c.json, p, mends);
    if (mattersAny(p) || !mends.empty()) return p;  // what follows relies on the structure
    checkGraph(c.json, p);
    checkExtents(c.json, c.isBinary, c.hasBinaryChunk, c.binary.size(), p);
    if (mattersAny(p)) return p;
    checkMeshes(c.json, p);
    checkAnimationsAndSkins(c.json, p);
    checkMaterialsAndExtensions(c.json, p);
    if (mattersAny(p)) return p;
    STIPPLE_TRY(buffers.load(p));
    STIPPLE_TRY(unpackDraco(c, buffers, p));
    STIPPLE_TRY(checkValues(c, buffers, p));
    STIPPLE_TRY(checkImageBytes(c, buffers, p));
    return p;
}

namespace {

/// Extensions without which nothing right could be drawn are refused by name, the others are a note.
Result<void> checkRequired(const Container& c, bool isStrict, std::vector<std::string>& passedOver) {
    const auto& known = knownExtensions();
    for (const json& name : arrayOf(c.json, "extensionsRequired")) {
        if (!name.is_string()) continue;  // said by the check of the structure
        const auto& text = name.get_ref<const std::string&>();
        if (std::find(known.begin(), known.end(), text) != known.end()) continue;
        if (!isStrict && isAboutLooks(text)) {
            // Said texture by texture.
            if (text == "KHR_texture_basisu") continue;
            passedOver.push_back("/extensionsRequired: requires " + text + ", which is not drawn");
            continue;
        }
        return fail(ErrorKind::input, fmt::format("requires the extension {}, which is not supported", text), c.path);
    }
    return {};
}

Result<void> refuse(const Container& c, const Problems& problems, bool isStrict) {
    // What matters first.
    const auto found = std::find_if(problems.begin(), problems.end(), [](const auto& p) { return !isHarmless(p); });
    const std::string& first = found == problems.end() ? problems.front() : *found;
    const std::string more = problems.size() > 1 ? fmt::format(" (and {} more)", problems.size() - 1) : "";
    return fail(ErrorKind::input, (isHarmless(first) ? first.substr(1) : first) + more, c.path,
                isStrict && !mattersAny(problems) ? "the file is not valid glTF 2.0, but can be drawn"
                                                  : "the file is not valid glTF 2.0");
}

/// Until the structure is one that all that follows can rely on.
Result<void> mendStructure(Container& c, std::vector<std::string>& passedOver) {
    constexpr int kRounds = 5;  // what is left out may be missed elsewhere
    for (int round = 0;; ++round) {
        Problems problems;
        Mends mends;
        checkStructure(c.json, problems, mends);
        if (mattersAny(problems) || (!mends.empty() && round == kRounds)) return refuse(c, problems, false);
        if (mends.empty()) return {};
        for (const std::string& text : problems) passedOver.push_back(text.substr(1));
        applyMends(mends, c.json);
    }
}

}  // namespace

Result<std::vector<std::string>> requireGood(Container& c, Buffers& buffers, bool isStrict) {
    if (isStrict && !c.oddities.empty())
        return fail(ErrorKind::input, c.oddities.front(), c.path, "the file is not valid glTF 2.0, but can be drawn");
    std::vector<std::string> passedOver = c.oddities;
    STIPPLE_TRY(checkRequired(c, isStrict, passedOver));
    if (!isStrict) STIPPLE_TRY(mendStructure(c, passedOver));
    STIPPLE_ASSIGN(const Problems problems, checkAll(c, buffers));
    if (mattersAny(problems) || (isStrict && !problems.empty()))
        return tl::unexpected(refuse(c, problems, isStrict).error());
    for (const std::string& text : problems)
        if (std::find(passedOver.begin(), passedOver.end(), text.substr(1)) == passedOver.end())
            passedOver.push_back(text.substr(1));
    return passedOver;
}

}  // namespace stipple::scene::gltf
