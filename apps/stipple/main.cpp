#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <stdexcept>

#include "apps/stipple/common.h"
#include "apps/stipple/exhaustion.h"
#include "apps/stipple/help.h"
#include "apps/stipple/options.h"
#include "apps/stipple/usage.h"

namespace {

using namespace stipple;

/// At the end of every command's help.
void addExitCodes(CLI::App& app) {
    constexpr const char* kExitCodes =
        "Exit codes: 0 fine, 2 usage, 3 input, 4 output, 5 device, 6 budget, 7 interrupted.";
    app.footer(app.get_footer().empty() ? kExitCodes : app.get_footer() + "\n" + kExitCodes);
    for (CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
        if (!sub->get_name().empty()) addExitCodes(*sub);
}

void setupAll(CLI::App& app, int& status) {
    app.formatter(app::makeHelpFormatter());  // (subcommands take both over)
    app.set_help_flag("-h,--help", "print this help");
    app::setupBuild(app, status);
    app::setupInfo(app, status);
    app::setupRender(app, status);
    app::setupView(app, status);
    app::setupCompare(app, status);
    app::setupStudy(app, status);
    app::setupSelfTest(app, status);
    app::setupGrow(app, status);
    app::setupConvert(app, status);
    app::setupCache(app, status);
    app::setupHelp(app, status);
    for (const char* command : {"render", "view"}) app::arrangeOptions(*app.get_subcommand(command));
    app.add_flag("--version")->description("print version, backends and devices");
    app.require_subcommand(1);
    addExitCodes(app);
    app.footer(
        "A newcomer's three lines:\n"
        "  stipple build scan.las -o scan.stipple\n"
        "  stipple render scan.stipple -o scan.png --size 1920x1080\n"
        "  stipple view scan.stipple        (or just: stipple scan.las)\n"
        "stipple COMMAND --help says what a command can do.\n" +
        app.get_footer());
}

/// What the commands themselves did not turn into a Result.
Error errorOf(const std::exception& e) {
    if (app::isExhausted(e) || dynamic_cast<const std::length_error*>(&e) != nullptr)
        return {ErrorKind::budget, "out of memory", "", "give a smaller --memory, --resident or --budget-points"};
    return {ErrorKind::input, fmt::format("failed in a way that it should not: {}", e.what()), "",
            "please report it with the input"};
}

int run(std::vector<std::string> arguments) {
    CLI::App app{"Stipple streams scans that do not fit in memory and draws them at a stated accuracy.", "stipple"};
    int status = 0;
    setupAll(app, status);
    const auto has = [&](const char* option) {
        return std::find(arguments.begin(), arguments.end(), option) != arguments.end();
    };
    app::setReporting(app::commandOf(app, arguments), has("--json"));
    if (arguments.empty()) {
        fmt::print("{}", app.help());
        return 0;
    }
    if (arguments.front() == "--version") {
        fmt::print("stipple {}\n{}", STIPPLE_VERSION, listDevices());
        return 0;
    }
    if (const auto complete = app::completeCommand(app, arguments); !complete) return app::report(complete.error());
    app::setReporting(app::commandOf(app, arguments), has("--json"));
    if (const auto values = app::checkValues(arguments); !values) return app::report(values.error());
    try {
        std::reverse(arguments.begin(), arguments.end());  // (as the parser takes them)
        app.parse(std::move(arguments));
    } catch (const CLI::CallForHelp&) {
        fmt::print("{}", app.help());
    } catch (const CLI::ParseError& e) {
        return app::report(app::usageError(app, e));
    } catch (const std::exception& e) {
        return app::report(errorOf(e));
    }
    if (std::fflush(stdout) != 0 && status == 0)
        return app::report({ErrorKind::output, "cannot be written", "standard output", "is the disk full?"});
    return status;
}

}  // namespace

int main(int argc, char** argv) {
    stipple::app::exitWhereNothingCatches();
    std::signal(SIGXFSZ, SIG_IGN);  // a write beyond ulimit -f fails and is reported, instead of ending the program
    constexpr int kBudget = static_cast<int>(stipple::ErrorKind::budget);
    int status = kBudget;
    try {
        status = run({argv + 1, argv + argc});
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
