// What nearly every command includes, see engine/base/precompiled.h.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
