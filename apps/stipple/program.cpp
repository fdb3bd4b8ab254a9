#include "apps/stipple/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <utility>

#include "apps/stipple/common.h"
#include "apps/stipple/exhaustion.h"
#include "apps/stipple/help.h"
#include "apps/stipple/options.h"
#include "apps/stipple/usage.h"

namespace stipple::app {
namespace {

/// At the end of every command's help.
void addExitCodes(CLI::App& app) {
    constexpr const char* kExitCodes =
        "Exit codes: 0 fine, 2 usage, 3 input, 4 output, 5 device, 6 budget, 7 interrupted.";
    app.footer(app.get_footer().empty() ? kExitCodes : app.get_footer() + "\n" + kExitCodes);
    for (CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
        if (!sub->get_name().empty()) addExitCodes(*sub);
}

/// A closed one would be the number of the next file that is opened, and messages would stand in that. What is written
/// to standard output still cannot be.
void holdStandardStreams() {
    for (const auto& [stream, how] : {std::pair{0, O_RDONLY}, {1, O_RDONLY}, {2, O_WRONLY}})
        if (::fcntl(stream, F_GETFD) < 0) (void)::open("/dev/null", how);
}

/// What the commands themselves did not turn into a Result.
Error errorOf(const std::exception& e) {
    if (isExhausted(e) || dynamic_cast<const std::length_error*>(&e) != nullptr)
        return {ErrorKind::budget, "out of memory", "", "give a smaller --memory, --resident or --budget-points"};
    return {ErrorKind::input, fmt::format("failed in a way that it should not: {}", e.what()), "",
            "please report it with the input"};
}

int run(const Program& program, std::vector<std::string> arguments) {
    CLI::App app{"Stipple streams scans that do not fit in memory and draws them at a stated accuracy.", "stipple"};
    int status = 0;
    app.formatter(makeHelpFormatter());  // (subcommands take both over)
    app.set_help_flag("-h,--help", "print this help");
    app.require_subcommand(1);
    program.setup(app, status);
    addExitCodes(app);
    const auto has = [&](const char* option) {
        return std::find(arguments.begin(), arguments.end(), option) != arguments.end();
    };
    setReporting(commandOf(app, arguments), has("--json"));
    if (arguments.empty()) {
        fmt::print("{}", app.help());
        return 0;
    }
    if (arguments.front() == "--version") {
        fmt::print("stipple {}\n{}", STIPPLE_VERSION, listDevices());
        return 0;
    }
    if (const auto complete = completeCommand(app, arguments); !complete) return report(complete.error());
    if (program.elsewhere)
        if (const std::optional<int> done = program.elsewhere(arguments)) return *done;
    setReporting(commandOf(app, arguments), has("--json"));
    if (const auto values = checkValues(arguments); !values) return report(values.error());
    try {
        std::reverse(arguments.begin(), arguments.end());  // (as the parser takes them)
        app.parse(std::move(arguments));
    } catch (const CLI::CallForHelp&) {
        fmt::print("{}", app.help());
    } catch (const CLI::ParseError& e) {
        return report(usageError(app, e));
    } catch (const std::exception& e) {
        return report(errorOf(e));
    }
    if (std::fflush(stdout) != 0 && status == 0)
        return report({ErrorKind::output, "cannot be written", "standard output", "is the disk full?"});
    return status;
}

}  // namespace

int runProgram(int argc, char** argv, const Program& program) {
    holdStandardStreams();
    exitWhereNothingCatches();
    std::signal(SIGXFSZ, SIG_IGN);  // a write beyond ulimit -f fails and is reported, instead of ending the program
    constexpr int kBudget = static_cast<int>(ErrorKind::budget);
    int status = kBudget;
    try {
        status = run(program, {argv + 1, argv + argc});
    } catch (...) {  // what even printing the error could throw
        std::fputs("stipple: out of memory\n", stderr);
    }
    // Where memory ran out, threads of TBB may still be on their way to a task; the destructors of statics, TBB's own
    // among them, would pull the ground from under them ("pure virtual method called", once in a thousand times).
    if (status == kBudget) {
        std::fflush(nullptr);
        ::_exit(status);
    }
    return status;
}

}  // namespace stipple::app
