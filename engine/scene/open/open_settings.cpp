#include "engine/scene/open/open_settings.h"

#include <fmt/format.h>

#include <sstream>

#include "engine/base/process.h"
#include "engine/base/units.h"
#include "engine/scene/open/open_scene.h"
#include "engine/scene/scene_bytes.h"
#include "lod/store/colour.h"
#include "lod/store/file_kind.h"

namespace stipple::scene {
namespace {

std::vector<std::string> namesOf(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream in(list);
    for (std::string name; std::getline(in, name, ',');)
        if (!name.empty() && name != "none" && name != "all") names.push_back(lod::attributeBehind(name));
    return names;
}

}  // namespace

ReadSettings OpenSettings::reading() const {
    ReadSettings reading;
    reading.allowOutside = allowOutside;
    if (const uint64_t bytes = parseBytes(memory); bytes > 0) reading.memoryBytes = bytes;
    return reading;
}

lod::FormatOptions OpenSettings::formatOptions() const {
    const uint64_t bytes = reading().memoryBytes;
    return {.part = grid,
            .onlyPoints = onlyPoints,
            .tempFolder = temp,
            .memoryBytes = bytes,
            .openingBytes = bytes,
            .kept = kept,
            .isStopped = isStopped};
}

Result<lod::BuildSettings> OpenSettings::settings() const {
    lod::BuildSettings s;
    s.material = material;
    s.surfelWeights = surfelWeights;
    s.memoryBytes = parseBytes(memory);
    if (s.memoryBytes == 0)
        return fail(ErrorKind::usage, fmt::format("'{}' is not a size", memory), "--memory", "e.g. 2G");
    s.normals = normals == "none"   ? lod::NormalsMode::none
                : normals == "keep" ? lod::NormalsMode::keep
                                    : lod::NormalsMode::automatic;
    s.fineNormals = normals == "fine";
    s.mergeDuplicates = duplicates == "merge";
    s.dropOutliers = dropOutliers;
    s.tempFolder = temp;
    s.isStopped = isStopped;
    s.ranks = ranks;
    s.leftovers = leftovers;
    s.estimateRadii = radii != "keep";
    s.skipBad = skipBad;
    s.open = [count = surfels, how = reading(), told = loss, more = formatOptions()](const std::string& path,
                                                                                     const lod::ReadOptions& o) {
        return openInput(path, o, count, how, told, more);
    };
    s.allAttributes = attributes == "all";
    s.attributes = namesOf(attributes);
    if (!up.empty()) s.up = static_cast<lod::UpAxis>(up[0] - 'x');
    return s;
}

void say(const OpenSettings& to, const std::string& line) {
    if (to.say) to.say(line);
}

bool isSceneFile(const std::string& path) { return isScene(path, lod::fileKindOf(path)); }

}  // namespace stipple::scene
