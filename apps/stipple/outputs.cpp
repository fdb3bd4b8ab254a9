#include "apps/stipple/outputs.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <compare>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "apps/stipple/options.h"
#include "engine/base/file.h"
#include "engine/scene/gltf/container.h"
#include "engine/scene/scene_files.h"
#include "lod/import/import.h"
#include "lod/store/file_kind.h"

namespace stipple::app {
namespace fs = std::filesystem;

namespace {

/// The same for all names of a file.
struct Identity {
    dev_t device = 0;
    ino_t number = 0;
    bool operator==(const Identity&) const = default;
};
std::optional<Identity> identityOf(const std::string& path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) return {};
    return Identity{info.st_dev, info.st_ino};
}

/// Of those that this program writes.
bool isPicture(const std::string& path) {
    using namespace std::string_view_literals;
    constexpr std::array kBegins{"\x89PNG\r\n\x1a\n"sv, "\x76\x2f\x31\x01"sv};
    std::array<char, 8> begin{};
    const auto file = InputFile::open(path);
    if (!file || file->sizeBytes() < begin.size() || !file->readAt(0, begin.data(), begin.size())) return false;
    const std::string_view text(begin.data(), begin.size());
    return std::any_of(kBegins.begin(), kBegins.end(), [&](std::string_view b) { return text.starts_with(b); });
}

/// Stores that the nodes of a .gltf or .glb place.
std::vector<std::string> storesOf(const std::string& path) {
    if (lod::fileKindOf(path) != lod::FileKind::glb && fs::path(path).extension() != ".gltf") return {};
    const auto container = scene::gltf::readContainerJson(path);
    if (!container || !container->json.contains("nodes") || !container->json["nodes"].is_array()) return {};
    std::vector<std::string> stores;
    for (const nlohmann::json& node : container->json["nodes"]) {
        const auto uri = node.is_object() ? node.value("/extensions/STIPPLE_store/uri"_json_pointer, nlohmann::json())
                                          : nlohmann::json();
        if (uri.is_string()) stores.push_back((fs::path(container->folder) / uri.get<std::string>()).string());
    }
    return stores;
}

/// Every file that is read where `input` is named; some may not be there.
std::vector<std::string> filesRead(const std::string& input) {
    std::vector<std::string> files{input};
    if (const auto expanded = lod::expandInputs({input})) files.insert(files.end(), expanded->begin(), expanded->end());
    for (const char* description : {"ept.json", "cloud.js"}) files.push_back((fs::path(input) / description).string());
    for (const auto& parts : {scene::filesOf(input), storesOf(input)})
        files.insert(files.end(), parts.begin(), parts.end());
    return files;
}

/// Found before hours of work, not after.
Result<void> checkFolder(const std::string& path) {
    const fs::path folder = fs::path(path).parent_path();
    std::error_code error;
    if (folder.empty() || fs::is_directory(folder, error)) return {};
    return fail(ErrorKind::output, fmt::format("cannot be written: there is no folder {}", folder.string()), path,
                "make it first, or name another");
}

Result<void> checkKind(const Output& output) {
    std::error_code error;
    if (fs::file_size(output.path, error) == 0) return {};  // nothing is lost
    const char* const advice = "choose another name, or give --force to replace it";
    if (output.kind == OutputKind::picture && !isPicture(output.path))
        return fail(ErrorKind::output, "is there already and is no picture (.png, .exr)", output.path, advice);
    if (output.kind == OutputKind::store && lod::fileKindOf(output.path) != lod::FileKind::store)
        return fail(ErrorKind::output, "is there already and is no built scene", output.path, advice);
    if (output.kind == OutputKind::other) return fail(ErrorKind::output, "is there already", output.path, advice);
    return {};
}

}  // namespace

Result<void> checkOutputs(const std::vector<Output>& outputs, const std::vector<std::string>& inputs, bool force) {
    std::vector<std::pair<Identity, const Output*>> there;
    for (const Output& output : outputs) {
        STIPPLE_TRY(outputTarget(output.path));
        STIPPLE_TRY(checkFolder(output.path));
        const auto identity = identityOf(output.path);
        if (!identity) continue;
        for (const auto& [before, other] : there)
            if (*identity == before && other->path != output.path)
                return fail(ErrorKind::output, "is another output of this command, too: " + other->path, output.path,
                            "choose another output");
        there.emplace_back(*identity, &output);
    }
    if (there.empty()) return {};  // what is not there is no input
    for (const std::string& input : inputs) {
        if (input.empty()) continue;
        for (const std::string& file : filesRead(input)) {
            const auto identity = identityOf(file);
            for (const auto& [written, output] : there)
                if (identity == written)
                    return fail(ErrorKind::output,
                                file == output->path ? std::string("is an input of this command")
                                                     : fmt::format("is an input of this command ({})", file),
                                output->path, "choose another output");
        }
    }
    for (const auto& [identity, output] : there)
        if (!force) STIPPLE_TRY(checkKind(*output));
    return {};
}

std::vector<Output> numberedPictures(const std::string& path) {
    const fs::path named(path);
    const fs::path folder = named.has_parent_path() ? named.parent_path() : fs::path(".");
    const std::string begin = named.stem().string() + "_", end = named.extension().string();
    std::vector<Output> found;
    std::error_code error;
    for (const fs::directory_entry& e : fs::directory_iterator(folder, error)) {
        const std::string name = e.path().filename().string();
        if (name.size() < begin.size() + 4 + end.size() || !name.starts_with(begin) || !name.ends_with(end)) continue;
        const std::string number = name.substr(begin.size(), name.size() - begin.size() - end.size());
        if (number.find_first_not_of("0123456789") == std::string::npos)
            found.push_back({e.path().string(), OutputKind::picture});
    }
    return found;
}

void addForce(CLI::App& app, bool& force) {
    app.add_flag("--force", force,
                 "replace a file that is there already, whatever it is (never an input of the same command)");
}

}  // namespace stipple::app
