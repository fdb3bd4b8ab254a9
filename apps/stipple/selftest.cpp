// stipple selftest: hard cases on the machine and the devices that it runs on.
#include "apps/study/selftest/selftest.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "apps/stipple/study_commands.h"
#include "engine/base/process.h"
#include "engine/base/progress.h"

namespace stipple::app {
namespace {

struct SelfTestCommand {
    std::string device = "all";
    int threads = 0;
    bool json = false, quiet = false;
};

/// A folder of its own, gone at the end.
class OwnFolder {
  public:
    OwnFolder() {
        path_ = (std::filesystem::temp_directory_path() / "stipple-selftest-XXXXXX").string();
        isThere_ = mkdtemp(path_.data()) != nullptr;
    }
    OwnFolder(const OwnFolder&) = delete;
    OwnFolder& operator=(const OwnFolder&) = delete;
    OwnFolder(OwnFolder&&) = delete;
    OwnFolder& operator=(OwnFolder&&) = delete;
    ~OwnFolder() {
        std::error_code ignored;
        if (isThere_) std::filesystem::remove_all(path_, ignored);
    }
    bool isThere() const { return isThere_; }
    const std::string& path() const { return path_; }

  private:
    std::string path_;
    bool isThere_ = false;
};

Result<void> runSelfTestCommand(const SelfTestCommand& o, int& status) {
    catchStopSignals();
    const OwnFolder folder;
    if (!folder.isThere())
        return fail(ErrorKind::output, "no folder can be made there", folder.path(), "set TMPDIR to one that is yours");
    const auto executor = makeTbbExecutor(o.threads);
    Progress progress(!o.quiet && !o.json);
    const study::Host host{*executor, [&](const std::string& device) { return makeBackend(device, *executor); },
                           [&](const std::string& what, uint64_t done, uint64_t total) -> Result<void> {
                               progress.update("selftest: " + what, done, total);
                               return checkStopped("the test of this machine");
                           }};
    study::SelfTestSettings settings;
    settings.folder = folder.path();
    settings.threads = executor->threads();
    if (o.device != "all") settings = {{o.device}, false, folder.path(), executor->threads()};
    STIPPLE_ASSIGN(const study::SelfTestReport tested, study::runSelfTest(settings, host));
    if (o.json)
        printJson("selftest", study::jsonOfSelfTest(tested));
    else
        fmt::print("{}", study::describeSelfTest(tested));
    if (tested.failed() > 0) status = 5;  // the device does not do what it should
    return {};
}

}  // namespace

void setupSelfTest(CLI::App& app, int& status) {
    auto o = std::make_shared<SelfTestCommand>();
    CLI::App* sub = app.add_subcommand(kSelfTestCommand.name, kSelfTestCommand.about);
    sub->add_option("--device", o->device, "all (cpu, and gpu if there is one), cpu, gpu or gpu:NAME")
        ->type_name("DEVICE")
        ->capture_default_str();
    sub->add_option("--threads", o->threads, "that draw; 0: all")->transform(within(0, 1024))->capture_default_str();
    sub->add_flag("--json", o->json, "print what was measured as JSON (stipple help json)");
    sub->add_flag("--quiet", o->quiet, "no progress");
    sub->footer(
        "Scenes are made by formulas, so that what is right is known. Prints a line a case: what was measured and\n"
        "what it may be at most. Exit code 5 if one is not as it should be.");
    sub->callback([o, &status] {
        if (const auto result = runSelfTestCommand(*o, status); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
