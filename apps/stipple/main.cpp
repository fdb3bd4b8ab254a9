#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "apps/stipple/common.h"

namespace {

int run(int argc, char** argv) {
    using namespace stipple;
    CLI::App app{"Stipple streams scans that do not fit in memory and draws them at a stated accuracy."};
    app.require_subcommand(1);
    app.footer(
        "A newcomer's three lines:\n"
        "  stipple build scan.las -o scan.stipple\n"
        "  stipple render scan.stipple -o scan.png --size 1920x1080\n"
        "  stipple view scan.stipple\n"
        "Exit codes: 0 fine, 2 usage, 3 input, 4 output, 5 device, 6 budget, 7 interrupted.");
    bool version = false;
    app.add_flag("--version", version, "print version, backends and devices");
    int status = 0;
    app::setupBuild(app, status);
    app::setupInfo(app, status);
    app::setupRender(app, status);
    app::setupView(app, status);
    app::setupCompare(app, status);
    app::setupGrow(app, status);
    app::setupConvert(app, status);
    app::setupCache(app, status);
    if (argc == 2 && std::string(argv[1]) == "--version") {
        fmt::print("stipple {}\n{}", STIPPLE_VERSION, app::listDevices());
        return 0;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForHelp& e) {
        return app.exit(e);
    } catch (const CLI::ParseError& e) {
        fmt::print(stderr, "stipple: {} (see stipple --help)\n", e.what());
        return static_cast<int>(ErrorKind::usage);
    } catch (const std::bad_alloc&) {
        fmt::print(stderr, "stipple: out of memory (give a smaller --memory or --budget-points)\n");
        return static_cast<int>(ErrorKind::budget);
    } catch (const std::exception& e) {
        fmt::print(stderr, "stipple: {}\n", e.what());
        return static_cast<int>(ErrorKind::input);
    }
    if (std::fflush(stdout) != 0 && status == 0) status = static_cast<int>(ErrorKind::output);
    return status;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return run(argc, argv);
    } catch (...) {  // what even printing the error could throw
        std::fputs("stipple: out of memory\n", stderr);
        return static_cast<int>(stipple::ErrorKind::budget);
    }
}
