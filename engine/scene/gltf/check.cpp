#include "engine/scene/gltf/check.h"

#include <fmt/format.h>

#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {

Result<Problems> checkAll(const Container& c, Buffers& buffers) {
    Problems p;
    checkStructure(c.json, p);
    if (!p.empty()) return p;
    checkGraph(c.json, p);
    checkExtents(c.json, c.isBinary, c.hasBinaryChunk, c.binary.size(), p);
    if (!p.empty()) return p;
    checkMeshes(c.json, p);
    checkAnimationsAndSkins(c.json, p);
    checkMaterialsAndExtensions(c.json, p);
    if (!p.empty()) return p;
    STIPPLE_TRY(buffers.load());
    STIPPLE_TRY(checkValues(c, buffers, p));
    STIPPLE_TRY(checkImageBytes(c, buffers, p));
    return p;
}

Result<void> requireGood(const Container& c, Buffers& buffers) {
    for (const nlohmann::json& name : arrayOf(c.json, "extensionsRequired")) {
        const auto& known = knownExtensions();
        if (name.is_string() && std::find(known.begin(), known.end(), name.get<std::string>()) == known.end())
            return fail(ErrorKind::input,
                        fmt::format("requires the extension {}, which is not supported", name.get<std::string>()),
                        c.path);
    }
    STIPPLE_ASSIGN(const Problems problems, checkAll(c, buffers));
    if (problems.empty()) return {};
    const std::string more = problems.size() > 1 ? fmt::format(" (and {} more)", problems.size() - 1) : "";
    return fail(ErrorKind::input, problems.front() + more, c.path, "the file is not valid glTF 2.0");
}

}  // namespace stipple::scene::gltf
