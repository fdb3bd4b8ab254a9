// What programs are around their commands: the parser, errors, exit codes.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct Program {
    /// Adds the commands; what they end with goes to `status`.
    std::function<void(CLI::App& app, int& status)> setup;
    /// Whose commands another program has: gives its exit code if it took over. May be empty.
    std::function<std::optional<int>(const std::vector<std::string>& arguments)> elsewhere;
};

/// All of main(). Gives the exit code.
int runProgram(int argc, char** argv, const Program& program);

}  // namespace stipple::app
