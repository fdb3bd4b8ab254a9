#include "engine/scene/gltf/check.h"

#include <fmt/format.h>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {

Result<Problems> checkAll(const Container& c, Buffers& buffers) {
    Problems p;
    checkStructure(c.json, p);
    if (mattersAny(p)) return p;
    checkGraph(c.json, p);
    checkExtents(c.json, c.isBinary, c.hasBinaryChunk, c.binary.size(), p);
    if (mattersAny(p)) return p;
    checkMeshes(c.json, p);
    checkAnimationsAndSkins(c.json, p);
    checkMaterialsAndExtensions(c.json, p);
    if (mattersAny(p)) return p;
    STIPPLE_TRY(buffers.load());
    STIPPLE_TRY(checkValues(c, buffers, p));
    STIPPLE_TRY(checkImageBytes(c, buffers, p));
    return p;
}

Result<std::vector<std::string>> requireGood(const Container& c, Buffers& buffers, bool repair) {
    for (const nlohmann::json& name : arrayOf(c.json, "extensionsRequired")) {
        const auto& known = knownExtensions();
        if (name.is_string() && std::find(known.begin(), known.end(), name.get<std::string>()) == known.end())
            return fail(ErrorKind::input,
                        fmt::format("requires the extension {}, which is not supported", name.get<std::string>()),
                        c.path);
    }
    STIPPLE_ASSIGN(Problems problems, checkAll(c, buffers));
    std::vector<std::string> passedOver;
    if (repair)
        std::erase_if(problems, [&](const std::string& text) {
            if (isHarmless(text)) passedOver.push_back(text.substr(1));
            return isHarmless(text);
        });
    if (problems.empty()) return passedOver;
    const std::string& first = problems.front();
    const std::string more = problems.size() > 1 ? fmt::format(" (and {} more)", problems.size() - 1) : "";
    return fail(ErrorKind::input, (isHarmless(first) ? first.substr(1) : first) + more, c.path,
                mattersAny(problems) ? "the file is not valid glTF 2.0"
                                     : "the file is not valid glTF 2.0; --repair passes over this");
}

}  // namespace stipple::scene::gltf
