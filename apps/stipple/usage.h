// Arguments that cannot be understood, in our own words; and what the program does with what is no command.
#pragma once

#include <string>
#include <vector>

#include "engine/base/result.h"

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace stipple::app {

/// "stipple", "stipple render", "stipple grow forest": whose --help helps with these arguments.
std::string commandOf(const CLI::App& app, const std::vector<std::string>& arguments);

/// A first argument that is a file is viewed: `stipple scan.las`. What is neither file nor command is an error.
Result<void> completeCommand(const CLI::App& app, std::vector<std::string>& arguments);

/// "--ortho=" has no value, and must not take the next word for one.
Result<void> checkValues(const std::vector<std::string>& arguments);

/// What is wrong with the arguments that `app` refused, with the likely word where one is misspelt.
Error usageError(const CLI::App& app, const CLI::ParseError& error);

}  // namespace stipple::app
