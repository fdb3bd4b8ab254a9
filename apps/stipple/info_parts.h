// `stipple info` for files of formats that describe their parts themselves (formats.h).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "apps/stipple/info_input.h"

namespace stipple::app {

Result<void> showParts(const InputInfoOptions& options, const lod::Format& format);

/// [x, y, z].
nlohmann::json vectorJson(const glm::dvec3& v);
/// {"name": value, ...}, with names in lower case and _ for spaces.
nlohmann::json factsJson(const std::vector<lod::Fact>& facts);

}  // namespace stipple::app
