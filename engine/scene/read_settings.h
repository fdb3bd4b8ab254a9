// How a scene file is read, and the files that it names.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::scene {

struct ReadSettings {
    bool isStrict = false;                     ///< glTF: refuse whatever the specification forbids, as a validator does
    bool allowOutside = false;                 ///< files that the scene names may lie outside its own folder
    uint64_t memoryBytes = uint64_t{2} << 30;  ///< of all that is read; what would take more is refused
};

/// Where the file lies that a scene in `folder` calls `name`. It must be below that folder, links resolved: a scene
/// from somewhere must not read (and put into a store) what else this machine holds.
Result<std::string> fileOfScene(const std::string& folder, const std::string& name, const ReadSettings& settings);
/// Its bytes. Only regular files are read.
Result<std::vector<uint8_t>> readFileOfScene(const std::string& folder, const std::string& name,
                                             const ReadSettings& settings);

/// The name that a URI stands for: %20 and its like decoded, and, as in files written on other systems, \\ for /.
std::string nameOfUri(const std::string& uri);
std::string decodePercent(const std::string& uri);
std::string withSlashes(std::string name);

/// "takes about 3 GiB, but --memory allows 2 GiB" as an error of the budget.
tl::unexpected<Error> overBudget(const std::string& what, uint64_t neededBytes, uint64_t memoryBytes,
                                 const std::string& where);

}  // namespace stipple::scene
