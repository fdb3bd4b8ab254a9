#include "engine/scene/scene_files.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "engine/scene/gltf/container.h"
#include "engine/scene/read_settings.h"
#include "lod/store/file_kind.h"

namespace stipple::scene {
namespace fs = std::filesystem;

namespace {

/// Every "uri" of the file, wherever it stands, but for those of placed stores.
void collectUris(const nlohmann::json& value, std::vector<std::string>& uris) {
    if (value.is_array())
        for (const nlohmann::json& item : value) collectUris(item, uris);
    if (!value.is_object()) return;
    for (const auto& [key, item] : value.items()) {
        if (key == "STIPPLE_store") continue;
        if (key == "uri" && item.is_string() && item.get_ref<const std::string&>().rfind("data:", 0) != 0)
            uris.push_back(nameOfUri(item.get<std::string>()));
        collectUris(item, uris);
    }
}

/// Calls with the first word of each line and the rest. Regular files only: nothing waits for a pipe.
void eachLine(const fs::path& path, const std::function<void(const std::string& word, const std::string& rest)>& take) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back()))) line.pop_back();
        const size_t begin = line.find_first_not_of(" \t");
        const size_t space = begin == std::string::npos ? begin : line.find_first_of(" \t", begin);
        if (space == std::string::npos) continue;
        take(line.substr(begin, space - begin), line.substr(line.find_first_not_of(" \t", space)));
    }
}

std::vector<std::string> filesOfObj(const fs::path& path) {
    const fs::path folder = path.parent_path();
    std::vector<std::string> files, materials;
    eachLine(path, [&](const std::string& word, const std::string& rest) {
        if (word != "mtllib") return;
        materials.push_back(rest);  // (a name may hold spaces, or the line several names)
        std::istringstream words(rest);
        for (std::string name; words >> name;)
            if (name != rest) materials.push_back(name);
    });
    for (const std::string& name : materials) {
        const fs::path library = folder / withSlashes(name);
        if (std::find(files.begin(), files.end(), library.string()) != files.end()) continue;
        files.push_back(library.string());
        eachLine(library, [&](const std::string& word, const std::string& rest) {
            if (word.rfind("map_", 0) != 0 && word != "bump" && word != "norm" && word != "disp" && word != "refl")
                return;
            std::string texture = rest.substr(rest.find_last_of(" \t") + 1);  // after its options
            for (const std::string& n : {rest, texture}) files.push_back((folder / withSlashes(n)).string());
        });
    }
    return files;
}

}  // namespace

std::vector<std::string> filesOf(const std::string& path) {
    std::vector<std::string> files;
    const std::string extension = fs::path(path).extension().string();
    const lod::FileKind kind = lod::fileKindOf(path);
    if (kind == lod::FileKind::other && extension == ".obj") {
        files = filesOfObj(path);
    } else if (kind == lod::FileKind::glb || extension == ".gltf") {
        const auto container = gltf::readContainerJson(path);
        if (!container) return {};
        std::vector<std::string> uris;
        collectUris(container->json, uris);
        for (const std::string& uri : uris) files.push_back((fs::path(container->folder) / uri).string());
    }
    std::sort(files.begin(), files.end());
    files.erase(std::unique(files.begin(), files.end()), files.end());
    return files;
}

}  // namespace stipple::scene
