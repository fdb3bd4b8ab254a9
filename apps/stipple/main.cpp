#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "apps/stipple/common.h"
#include "apps/stipple/help.h"
#include "apps/stipple/options.h"
#include "apps/stipple/program.h"
#include "apps/stipple/study_commands.h"
#include "engine/base/own_places.h"

namespace {

using namespace stipple;

void setupAll(CLI::App& app, int& status) {
    app::setupBuild(app, status);
    app::setupInfo(app, status);
    app::setupRender(app, status);
    app::setupView(app, status);
    app::setupCompare(app, status);
    for (const app::StudyCommandName& name : app::kStudyCommands) app.add_subcommand(name.name, name.about);
    app::setupGrow(app, status);
    app::setupConvert(app, status);
    app::setupCache(app, status);
    app::setupHelp(app, status);
    for (const char* command : {"render", "view"}) app::arrangeOptions(*app.get_subcommand(command));
    app.add_flag("--version")->description("print version, backends and devices");
    app.footer(
        "A newcomer's three lines:\n"
        "  stipple build scan.las -o scan.stipple\n"
        "  stipple render scan.stipple -o scan.png --size 1920x1080\n"
        "  stipple view scan.stipple        (or just: stipple scan.las)\n"
        "stipple COMMAND --help says what a command can do.");
}

/// Studies are a program of their own: what they need is not loaded, and not compiled, before anything else is drawn.
std::optional<int> study(std::vector<std::string> arguments) {
    if (arguments.size() == 2 && arguments.front() == "help") arguments = {arguments[1], "--help"};
    if (std::none_of(app::kStudyCommands.begin(), app::kStudyCommands.end(),
                     [&](const auto& command) { return arguments.front() == command.name; }))
        return {};
    const std::vector<std::string> places = ownPlaces("stipple_study", STIPPLE_INSTALLED_STUDY, STIPPLE_BUILT_STUDY);
    std::vector<char*> given{nullptr};
    for (std::string& argument : arguments) given.push_back(argument.data());
    given.push_back(nullptr);
    for (std::string place : places) {
        given.front() = place.data();
        ::execv(place.c_str(), given.data());
    }
    return app::report({ErrorKind::input,
                        fmt::format("the program of studies does not start: {}", std::strerror(errno)), places.front(),
                        "build the target stipple_studies, or install stipple anew"});
}

}  // namespace

int main(int argc, char** argv) { return app::runProgram(argc, argv, {setupAll, study}); }
