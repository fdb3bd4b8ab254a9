#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "apps/stipple/study_commands.h"
#include "apps/stipple/study_scenes.h"
#include "apps/study/study.h"
#include "engine/base/process.h"
#include "engine/image/image_io.h"

namespace stipple::app {
namespace {

struct StudyCommand {
    StudyOptions scenes;
    std::string data;
    bool seeds = false;
    int rounds = 5;
};

/// What each of the two studies has and the other would ignore.
Result<void> checkOptions(const CLI::App& sub, const StudyCommand& o) {
    if (!o.seeds && o.scenes.scenes.empty())
        return fail(ErrorKind::usage, "says what is to be studied, and is missing", "SCENE",
                    "stipple study SCENE -o FOLDER, or stipple study --seeds -o FOLDER");
    for (const char* option :
         {"SCENE", "--full", "--modes", "--errors", "--sizes", "--budgets", "--builds", "--views", "--camera-path",
          "--against", "--blocks", "--frames", "--seed", "--device", "--resident"})
        if (o.seeds && sub.get_option(option)->count() > 0)
            return fail(ErrorKind::usage, "is of studies of scenes, not of --seeds", option, "leave one of them out");
    const char* const everywhere = std::getenv("STIPPLE_DATA");
    if (!o.seeds && sub.get_option("--data")->count() > 0 && (everywhere == nullptr || o.data != everywhere))
        return fail(ErrorKind::usage, "is of --seeds, not of scenes", "--data", "leave it out");
    for (const char* option : {"--output", "--quick", "--full", "--seeds"})
        if (o.scenes.calibrate && sub.get_option(option)->count() > 0)
            return fail(ErrorKind::usage, "is not of --calibrate, which is kept in the cache", option, "leave it out");
    if (!o.scenes.calibrate && o.scenes.output.empty())
        return fail(ErrorKind::usage, "says where results go, and is missing", "--output FOLDER");
    if (!o.seeds && sub.get_option("--rounds")->count() > 0)
        return fail(ErrorKind::usage, "is of --seeds, not of scenes", "--rounds", "take --frames and --blocks");
    return {};
}

Result<void> runSeeds(const StudyCommand& all) {
    const StudyOptions& o = all.scenes;
    catchStopSignals();
    STIPPLE_TRY(image::checkModule(true));
    const auto executor = makeTbbExecutor(o.build.threads);
    Progress progress(!o.quiet && !o.json);
    const study::Host host{*executor, [&](const std::string& device) { return makeBackend(device, *executor); },
                           [&](const std::string& what, uint64_t done, uint64_t total) -> Result<void> {
                               progress.update("study: " + what, done, total);
                               return checkStopped(o.output, "what was found so far is not written");
                           }};
    study::SeedsSettings settings{all.data, o.output, o.quick, all.rounds};
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
    auto o = std::make_shared<StudyCommand>();
    StudyOptions& scenes = o->scenes;
    CLI::App* sub = app.add_subcommand(kStudyCommand.name, kStudyCommand.about);
    sub->add_flag("--seeds", o->seeds, "the tables and figures of the papers that the modes stand on, made again");
    sub->add_option("-o,--output", scenes.output,
                    "folder for report.html, study.json, rows.csv; the same command goes on where it was stopped "
                    "(--seeds: index.md, seeds.json, pictures, stores)")
        ->type_name("FOLDER");
    sub->add_flag("--calibrate", scenes.calibrate,
                  "measure only what frames cost here, and keep it in the cache for --target-ms and --target-error of "
                  "render and view");
    sub->add_flag("--quick", scenes.quick,
                  "minutes: 640x360, one camera of each path (--seeds: models of at most 300,000 points)");
    scenes.addTo(*sub);
    sub->add_option("--data", o->data,
                    "--seeds: folder of the models that stand in for the papers'; rows without theirs are named")
        ->type_name("FOLDER")
        ->envname("STIPPLE_DATA");
    sub->add_option("--rounds", o->rounds, "--seeds: frames that times are medians of")
        ->transform(within(1, 1000))
        ->capture_default_str();
    sub->add_option("--threads", scenes.build.threads, "threads (0: all cores)")
        ->transform(within(0, 1024))
        ->capture_default_str();
    sub->add_flag("--json", scenes.json, "print what was measured as JSON (stipple help json)");
    sub->add_flag("--quiet", scenes.quiet, "no progress");
    sub->callback([o, sub, &status] {
        auto result = checkOptions(*sub, *o);
        if (result)
            result = o->seeds              ? runSeeds(*o)
                     : o->scenes.calibrate ? runCalibration(o->scenes)
                                           : runSceneStudy(o->scenes);
        if (!result) status = report(result.error());
    });
}

}  // namespace stipple::app
