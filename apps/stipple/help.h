// How --help looks, and the topics of `stipple help`.
#pragma once

#include <memory>
#include <string>

namespace CLI {
class App;
class FormatterBase;
}  // namespace CLI

namespace stipple::app {

/// Two columns that fit 96 characters; values' kinds and defaults as a person reads them.
std::shared_ptr<CLI::FormatterBase> makeHelpFormatter();

/// Puts the options of a command with many under headings.
void arrangeOptions(CLI::App& command);

/// `stipple help [TOPIC]`: a page on what concerns several commands, or the help of a command.
void setupHelp(CLI::App& app, int& status);

}  // namespace stipple::app
