// Effects that are asked for by their names.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stipple::app {

/// --effect NAME, for those of the table of effects that nothing else asks for; no option where there is none.
void addEffects(CLI::App& sub, std::vector<std::string>& effects);

}  // namespace stipple::app
