// Where what belongs to this program or library may lie: modules, and programs of its own.
#pragma once

#include <string>
#include <vector>

namespace stipple {

/// A file `name`, the likeliest place first: where libstipple.so is in somebody else's program, in its folder stipple/
/// or beside it; beside the program (build tree); at `installed`, from there (an installation); `built`. Whole paths:
/// what lies in the current folder is nobody's.
std::vector<std::string> ownPlaces(const std::string& name, const std::string& installed, const std::string& built);

}  // namespace stipple
