#include "engine/base/own_places.h"

#include <dlfcn.h>
#include <link.h>

#include <filesystem>

namespace stipple {
namespace {

namespace fs = std::filesystem;

fs::path folderOfProgram() {
    std::error_code ignored;
    return fs::read_symlink("/proc/self/exe", ignored).parent_path();
}

/// Of libstipple.so in somebody else's program; empty: this is the program itself, whose name here is what it was
/// called by, and may be any file's in the current folder.
fs::path folderOfLibrary() {
    Dl_info info{};
    link_map* map = nullptr;
    if (::dladdr1(reinterpret_cast<const void*>(&folderOfLibrary), &info, reinterpret_cast<void**>(&map),
                  RTLD_DL_LINKMAP) == 0 ||
        map == nullptr || map->l_name == nullptr || *map->l_name == 0)
        return {};
    std::error_code ignored;
    return fs::canonical(map->l_name, ignored).parent_path();
}

}  // namespace

std::vector<std::string> ownPlaces(const std::string& name, const std::string& installed, const std::string& built) {
    std::vector<std::string> places;
    if (const fs::path library = folderOfLibrary(); !library.empty())
        places = {(library / "stipple" / name).string(), (library / name).string()};
    if (const fs::path program = folderOfProgram(); !program.empty())
        places.insert(places.end(), {(program / name).string(), (program / installed).string()});
    places.push_back(built);
    return places;
}

}  // namespace stipple
