#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <thread>

#include "apps/stipple/build_patches.h"
#include "apps/stipple/common.h"
#include "apps/stipple/mpi_ranks.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/words.h"

namespace stipple::app {
namespace {

struct BuildCommand {
    std::vector<std::string> inputs;
    std::string output;
    BuildOptions build;
    bool json = false, quiet = false, mpi = false, force = false, restart = false;
    MaterialOptions material;
};

/// Of the output, also where its temporary file was being checked.
Error interruptedAt(Error error, const BuildCommand& o) {
    if (error.where.find(".partial") == std::string::npos) return error;
    return {ErrorKind::interrupted, "interrupted; nothing is written", o.output, ""};
}

/// `isSilent`: another rank says what there is to say.
/// On the input, and on what coarse levels are.
std::vector<std::string> allNotes(const lod::BuildReport& report) {
    std::vector<std::string> notes = report.notes;
    notes.insert(notes.end(), report.coarseNotes.begin(), report.coarseNotes.end());
    return notes;
}

Result<void> run(const BuildCommand& o, bool& isSilent) {
    catchStopSignals();
    MpiJob job;
    BuildOptions build = o.build;
    build.material = o.material.material();
    if (o.mpi) {
        STIPPLE_ASSIGN(job, joinMpi());
        build.ranks = job.ranks.get();
        isSilent = job.ranks->rank() > 0;
        const auto cores = static_cast<int>(std::thread::hardware_concurrency());
        if (build.threads == 0) build.threads = std::max(cores / job.onThisMachine, 1);
    }
    if (!o.quiet && !isSilent) build.say = printLine;
    if (!isSilent) build.loss = printLine;
    if (o.restart) build.leftovers = lod::Leftovers::replace;
    STIPPLE_ASSIGN(const lod::BuildSettings settings, build.settings());
    STIPPLE_TRY(agree(build.ranks,
                      isSilent ? Result<void>() : checkOutputs({{o.output, OutputKind::store}}, o.inputs, o.force)));
    const int threads = build.threads > 0 ? build.threads : static_cast<int>(std::thread::hardware_concurrency());
    keepFreeMemory(settings.memoryBytes, threads);
    const auto executor = makeTbbExecutor(build.threads);
    Result<lod::BuildReport> built = [&] {
        Progress progress(build.styleOf(o.quiet || isSilent));
        if (build.patches.isAsked) return buildPatches(o.inputs, o.output, build, *executor, progress);
        return scene::buildAny(o.inputs, o.output, build, *executor, progress);
    }();
    if (!built && built.error().kind == ErrorKind::interrupted) built = tl::unexpected(interruptedAt(built.error(), o));
    if (!built) return tl::unexpected(built.error());
    if (isSilent) return {};
    const lod::BuildReport& r = *built;
    if (o.json) {
        const nlohmann::json j = {{"primitive", r.primitive + "s"},
                                  {"points_in", r.pointsIn},
                                  {"points_out", r.pointsOut},
                                  {"dropped", r.dropped},
                                  {"added", r.added},
                                  {"skipped_files", r.skippedFiles},
                                  {"seconds", r.seconds},
                                  {"stage_seconds", r.stageSeconds},
                                  {"points_per_second", static_cast<double>(r.pointsIn) / r.seconds},
                                  {"peak_rss_bytes", peakRssBytes()},
                                  {"bytes_out", r.bytesOut},
                                  {"nodes", r.nodes},
                                  {"records", r.records},
                                  {"patches", patchCountsJson(r.patches)},
                                  {"notes", allNotes(r)},
                                  {"temporary_bytes", r.temporaryBytes},
                                  {"resumed", r.isResumed},
                                  {"content_hash", hexDigits(r.contentHash)}};
        printJson("build", j);
        return {};
    }
    for (const std::string& note : allNotes(r)) fmt::print(stderr, "note: {}\n", printable(note));
    const std::string& what = r.primitive;
    const bool isMesh = what == "triangle" && !o.build.patches.isAsked;
    fmt::print("{}: {} in {}, {} ({:.1f} bytes a {}), {:.2f} s, {:.2f} M {}s/s, peak memory {}\n", o.output,
               counted(r.pointsOut, what), counted(r.nodes, isMesh ? "group" : "node"), humanBytes(r.bytesOut),
               static_cast<double>(r.bytesOut) / static_cast<double>(r.pointsOut), what, r.seconds,
               static_cast<double>(r.pointsIn) / r.seconds * 1e-6, what, humanBytes(peakRssBytes()));
    for (const auto& [reason, count] : r.added) fmt::print("added {} {}\n", counted(count, what), reason);
    for (const auto& [reason, count] : r.dropped)
        fmt::print("dropped {}: {}\n", what == "point" ? counted(count, "point") : fmt::format("{}", count), reason);
    return {};
}

}  // namespace

void setupBuild(CLI::App& app, int& status) {
    auto o = std::make_shared<BuildCommand>();
    CLI::App* sub = app.add_subcommand("build",
                                       "build the hierarchy of scans (.ply, .las, .laz, .vdb), of a mesh (.ply with "
                                       "faces, .vdb, .gltf, .glb, .obj) or of "
                                       "curves (.swc, .trk, .hair, cylinder models)");
    sub->add_option("INPUT", o->inputs,
                    "scans that together make the scene: files, folders, patterns, ept.json, cloud.js")
        ->required();
    sub->add_option("-o,--output", o->output, "the scene to write (.stipple)")->type_name("STORE")->required();
    o->build.addTo(*sub);
    o->material.addTo(*sub, "points or patches (without: what the input says)");
    addPatchBuildOptions(*sub, o->build.patches);
    addForce(*sub, o->force);
    sub->add_flag("--surfel-weights", o->build.surfelWeights,
                  "of points: measure by how much each counts where discs are blended (render --mode ewa --normalise "
                  "surfel), and keep it in the scene");
    sub->add_flag("--restart", o->restart,
                  "begin anew where an interrupted build of other input or with other settings is in the way");
    sub->add_flag("--json", o->json, "print the report as JSON (stipple help json)");
    sub->add_flag("--quiet", o->quiet, "neither progress nor notes");
    sub->add_flag("--mpi", o->mpi,
                  "build as a rank of an MPI job (mpirun -n N stipple build --mpi ...); all ranks must see the "
                  "inputs and the folder for temporary files; --memory and --threads are of each rank");
    sub->callback([o, &status] {
        bool isSilent = false;
        if (const auto result = run(*o, isSilent); !result)
            status = isSilent ? 0 : report(result.error());  // (a rank that fails first would silence the others)
    });
}

}  // namespace stipple::app
