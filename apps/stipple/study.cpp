#include <fmt/format.h>

#include <filesystem>

#include "apps/stipple/common.h"
#include "apps/study/study.h"
#include "engine/base/process.h"
#include "engine/image/image_io.h"

namespace stipple::app {
namespace {

struct Options {
    std::string output, data;
    bool seeds = false, quick = false, json = false, quiet = false;
    int rounds = 5, threads = 0;
    std::string progress = "auto";
};

Result<void> run(const Options& o) {
    if (!o.seeds)
        return fail(ErrorKind::usage, "says what is to be studied, and is missing", "--seeds",
                    "stipple study --seeds -o FOLDER");
    catchStopSignals();
    STIPPLE_TRY(image::checkModule(true));
    const auto executor = makeTbbExecutor(o.threads);
    Progress progress(!o.quiet && !o.json);
    const study::Host host{*executor, [&](const std::string& device) { return makeBackend(device, *executor); },
                           [&](const std::string& what, uint64_t done, uint64_t total) -> Result<void> {
                               progress.update("study: " + what, done, total);
                               return checkStopped(o.output, "what was found so far is not written");
                           }};
    study::SeedsSettings settings{o.data, o.output, o.quick, o.rounds};
    auto studied = study::studySeeds(settings, host);
    if (!studied) return tl::unexpected(studied.error());
    if (o.json)
        printJson("study", study::jsonOfSeeds(*studied));
    else
        fmt::print("{}", study::describeSeeds(*studied));
    return {};
}

}  // namespace

void setupStudy(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("study", "what modes cost and how exact they are");
    sub->add_flag("--seeds", o->seeds, "the tables and figures of the papers that the modes stand on, made again");
    sub->add_option("-o,--output", o->output, "folder for index.md, seeds.json, pictures and the models' stores")
        ->type_name("FOLDER")
        ->required();
    sub->add_option("--data", o->data,
                    "folder of the models that stand in for the papers'; rows without theirs are named")
        ->type_name("FOLDER")
        ->envname("STIPPLE_DATA");
    sub->add_flag("--quick", o->quick, "models of at most 300,000 points, smaller pictures for errors, fewer poses");
    sub->add_option("--rounds", o->rounds, "frames that times are medians of")
        ->transform(within(1, 1000))
        ->capture_default_str();
    sub->add_option("--threads", o->threads, "threads (0: all cores)")
        ->transform(within(0, 1024))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "print what was measured as JSON (stipple help json)");
    sub->add_flag("--quiet", o->quiet, "no progress");
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
