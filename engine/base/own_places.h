// Where what belongs to this program or library may lie: modules, and programs of its own.
#pragma once

#include <string>
#include <vector>

namespace stipple {

/// A file `name`, the likeliest place first: beside the program (build tree); at `installed`, from there (an
/// installation); beside libstipple.so or in its folder stipple/, where that is in somebody else's program; `built`.
std::vector<std::string> ownPlaces(const std::string& name, const std::string& installed, const std::string& built);

}  // namespace stipple
