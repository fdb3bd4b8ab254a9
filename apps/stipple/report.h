// What the program answers: errors as a line (and as JSON where that is asked for) and results as JSON with a schema.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "engine/base/result.h"

namespace stipple::app {

/// How errors are told: of which command ("stipple render"), whose --help a usage error names, and whether as JSON too.
void setReporting(std::string command, bool asJson);

/// The error's line on standard error; with --json also as JSON on standard output, unless the result stands there
/// already (a picture that is incomplete): output is one document. Gives its exit code.
int report(const Error& error);

/// An error where Ctrl-C or SIGTERM was seen (after catchStopSignals()); `state`: what is there of the output now.
Result<void> checkStopped(const std::string& output, const std::string& state = "nothing is written");

/// Prints a result with its schema, "stipple.KIND/VERSION". A field that changes its meaning or goes raises the
/// version; new fields do not.
void printJson(const std::string& kind, nlohmann::json value);
/// Numbers as JSON: infinity has no number there, so it becomes the string "inf".
nlohmann::json jsonNumber(double value);

}  // namespace stipple::app
