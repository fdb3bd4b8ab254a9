#include "apps/stipple/render_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "apps/stipple/report.h"
#include "engine/base/process.h"
#include "engine/base/words.h"
#include "engine/image/coverage.h"
#include "shaders/shared/record.h"

namespace stipple::app {

void Timings::add(double frameMs, const std::vector<render::PassTime>& times) {
    frames.push_back(frameMs);
    // (Not every frame has every pass: copies come with new chunks. Some have one twice.)
    std::map<std::string, double> sums;
    for (const render::PassTime& time : times) {
        sums[time.name] += time.ms;
        if (std::find(passNames.begin(), passNames.end(), time.name) == passNames.end()) passNames.push_back(time.name);
    }
    passes.resize(passNames.size());
    for (size_t i = 0; i < passNames.size(); ++i)
        if (const auto sum = sums.find(passNames[i]); sum != sums.end()) passes[i].push_back(sum->second);
}

namespace {

/// Of the chunks that the last cut wants. What failed is read once more: it says whether it is bad or only lacked room.
MissingChunks missingOf(const render::FrameState& state) {
    MissingChunks missing;
    std::vector<const lod::Store*> storeOf;
    for (const lod::Instance& instance : state.instances) {
        storeOf.resize(std::max<size_t>(storeOf.size(), instance.source + 1));
        storeOf[instance.source] = state.stores[instance.hierarchy].get();
    }
    uint64_t toRead = state.streamer->counters().failures > 0 ? 1000 : 0;  // that many say enough
    for (const lod::CutWanted& w : state.cut.wanted) {
        const auto chunk = toRead > 0 ? lod::readDrawnChunk(*storeOf[w.source], w.chunk) : Result<lod::Chunk>();
        toRead -= toRead > 0 ? 1 : 0;
        ++(chunk ? missing.noRoom : missing.unreadable);
        if (!chunk) missing.failure = chunk.error().line();
    }
    return missing;
}

}  // namespace

bool showsNothing(const render::Image& image) {
    return std::none_of(image.rgba.begin(), image.rgba.end(), [](uint32_t c) { return c >> 24 != 0; });
}

void sayEmpty(size_t empty, size_t pictures, const std::string& output) {
    if (empty == 0) return;
    fmt::print(stderr, "note: {}: {} nothing of the scene (where is the camera? --eye, --target)\n", output,
               pictures == 1 ? "the view shows" : fmt::format("{} of {} views show", empty, pictures));
}

namespace {

bool missesAny(const render::FrameState& state) { return !state.cut.wanted.empty() || state.cut.truncated; }

/// The frame that was drawn last, of the picture that was counted last, where it is the worst so far. False: it is not.
bool takeIfWorst(Verdict& v, const render::FrameState& state, bool isFirst, bool worstMisses) {
    const double error = state.cut.truncated ? std::numeric_limits<double>::infinity() : state.cut.tauEffective;
    v.isTruncated = v.isTruncated || state.cut.truncated;
    if (!isFirst && (missesAny(state) != worstMisses ? worstMisses : error <= v.tauEffectivePixels)) return false;
    v.worst = v.pictures - 1;
    v.tauEffectivePixels = error;
    v.leavesAround = state.cut.counters.leavesAround;
    v.missing = missingOf(state);
    return true;
}

}  // namespace

void Verdict::judge(const render::FrameState& state, const lod::View* view) {
    const bool worstMisses = incomplete > 0;
    lastMisses = missesAny(state);
    ++pictures;
    incomplete += lastMisses ? 1 : 0;
    empty += !lastMisses && showsNothing(state.image) ? 1 : 0;
    if (!takeIfWorst(*this, state, pictures == 1, worstMisses)) return;
    // A chunk that cannot be read any more is told of where it is missed.
    if (view == nullptr) return;
    if (const auto measured = render::measurePruning(state, *view)) pruned = *measured;
}

void Verdict::judgeSample(const render::FrameState& state) {
    const bool worstMisses = incomplete > 0, misses = missesAny(state);
    incomplete += misses && !lastMisses ? 1 : 0;
    lastMisses = lastMisses || misses;
    takeIfWorst(*this, state, false, worstMisses);
}

std::string numbered(const std::string& path, size_t index) {
    const std::filesystem::path p(path);
    return (p.parent_path() / fmt::format("{}_{:04}{}", p.stem().string(), index, p.extension().string())).string();
}

namespace {

/// Asks for what the first view wants until its root can be drawn, or nothing more can come.
Result<void> awaitRoot(const FramesPlan& plan, const render::FrameSettings& settings, render::FrameState& state) {
    streaming::Streamer& streamer = *state.streamer;
    for (;;) {
        STIPPLE_TRY(checkStopped(plan.output));
        streamer.collect();
        streamer.upload();
        if (streamer.residency().drawable[0][0]) return {};
        lod::selectCut(state.scene(), streamer.residency(), plan.shot->views.front(), settings.budgets, state.scratch,
                       state.cut);
        const uint64_t before = streamer.counters().requests;
        streamer.request(state.cut);
        if (streamer.isIdle() && streamer.counters().requests == before) break;
        streamer.wait();  // helps where no other thread can be had
    }
    // Nothing is wanted where nothing is in view; otherwise there is nothing to show at all.
    const MissingChunks missing = missingOf(state);
    if (missing.unreadable > 0 && !plan.skipBad) return fail(ErrorKind::input, missing.failure);
    if (missing.noRoom > 0)
        return fail(ErrorKind::budget, "the first chunk does not fit", "--resident " + plan.resident,
                    "give more memory");
    return {};
}

/// The first view once more: what was waited for stays as it is.
Result<void> again(const FramesPlan& plan, const render::FrameSettings& settings, render::FrameState& state) {
    return plan.noWait ? render::renderFrame(state, plan.shot->views.front(), settings)
                       : render::renderResident(state, plan.shot->views.front(), settings);
}

/// The other frames of picture number `index`, whose middle is drawn, and their mean.
Result<void> accumulate(const FramesPlan& plan, size_t index, const render::FrameSettings& settings,
                        render::FrameState& state, Verdict& verdict) {
    const auto after = [&](double seconds) { return plan.shot->viewAfter(index, seconds); };
    const auto draw = [&](const lod::View& view, const render::FrameSettings& sample) -> Result<void> {
        STIPPLE_TRY(checkStopped("--accumulate"));
        if (plan.noWait)
            STIPPLE_TRY(render::renderFrame(state, view, sample));
        else
            STIPPLE_TRY(render::renderUntilComplete(state, view, sample));
        verdict.judgeSample(state);
        return {};
    };
    return render::expose(plan.exposure, after, settings, draw, state.image, *plan.executor);
}

}  // namespace

Result<void> runFrames(const FramesPlan& plan, const render::FrameSettings& settings, render::FrameState& state,
                       Timings& timings, Written& written, Verdict& verdict) {
    const std::vector<lod::View>& views = plan.shot->views;
    // The first image: as soon as the root is there, whatever is missing.
    STIPPLE_TRY(awaitRoot(plan, settings, state));
    STIPPLE_TRY(render::renderFrame(state, views.front(), settings));
    timings.firstImageMs = millisecondsSinceProcessStart();
    const bool isSingle = views.size() == 1;
    for (size_t i = 0; i < views.size(); ++i) {
        render::FrameSettings frame = settings;
        if (!plan.shot->seconds.empty()) frame.draw.wind.seconds += plan.shot->seconds[i];
        if (!plan.noWait)
            STIPPLE_TRY(render::renderUntilComplete(state, views[i], frame));
        else if (i > 0)
            STIPPLE_TRY(render::renderFrame(state, views[i], frame));
        if (i == 0) timings.completeMs = millisecondsSinceProcessStart();
        timings.add(state.counters.frameMs, state.backend->passTimes());
        for (int f = 1; isSingle && f < plan.repeats; ++f) {  // one view again and again, for timing
            STIPPLE_TRY(checkStopped(plan.output));
            STIPPLE_TRY(again(plan, settings, state));
            timings.add(state.counters.frameMs, state.backend->passTimes());
        }
        if (!isSingle) STIPPLE_TRY(checkStopped(plan.output));
        verdict.judge(state, &views[i]);
        written.walk.look(i, render::effectStatus(state, frame.draw));
        STIPPLE_TRY(accumulate(plan, i, frame, state, verdict));
        if (isSingle) break;
        if (plan.legend) drawLegend(*plan.legend, state.image);
        STIPPLE_TRY(image::writePicture(numbered(plan.output, i), state.image, plan.format));
        ++written.pictures;
        if (plan.printNames) fmt::print("{}\n", numbered(plan.output, i));
    }
    return {};
}

void sayIfUseless(const FramesPlan& plan, const render::FrameSettings& settings, const render::FrameState& state,
                  Verdict& verdict) {
    constexpr double kShare = 1.0 / 16;  // of the picture's shorter side
    const lod::View& view = plan.shot->views[verdict.worst];
    const double error = verdict.tauEffectivePixels;
    if (error <= kShare * std::min(view.width, view.height)) return;
    // As if everything were there.
    std::vector<std::vector<uint8_t>> all(state.streamer->residency().drawable.begin(),
                                          state.streamer->residency().drawable.end());
    for (auto& nodes : all) std::fill(nodes.begin(), nodes.end(), uint8_t{1});
    lod::CutScratch scratch;
    lod::Cut cut;
    lod::selectCut(state.scene(), {all}, view, {settings.budgets.errorPixels}, scratch, cut);
    verdict.recordsWanted = cut.counters.recordsDrawn + cut.counters.trianglesDrawn;
    if (plan.quiet || !std::isfinite(error)) return;  // (the latter is an error, which says it)
    fmt::print(stderr,
               "note: --budget-points {} leaves an error of {:.0f} px, with which the picture shows little; {} would "
               "bring it to {:g} px\n",
               settings.budgets.records, error, counted(verdict.recordsWanted, "record"), settings.budgets.errorPixels);
}

Result<void> checkVerdict(const FramesPlan& plan, const Verdict& verdict) {
    if (plan.noWait) return {};
    if (verdict.isTruncated)
        return fail(ErrorKind::budget,
                    fmt::format("{} only a part of the scene: {} coarsest level has more records than --budget-points "
                                "allows",
                                verdict.pictures == 1
                                    ? "the picture is written, but holds"
                                    : fmt::format("{} of {} pictures hold (all are written; this is the worst)",
                                                  verdict.incomplete, verdict.pictures),
                                verdict.pictures == 1 ? "its" : "the"),
                    verdict.pictures == 1 ? plan.output : numbered(plan.output, verdict.worst),
                    fmt::format("give more: {} would bring it to the error asked for; --no-wait permits it",
                                counted(verdict.recordsWanted, "record")));
    if (verdict.isComplete()) return {};
    const MissingChunks& missing = verdict.missing;
    Error error{ErrorKind::budget, "", plan.output, ""};
    const bool isBad = missing.unreadable > 0 && !(plan.skipBad && missing.noRoom > 0);
    if (isBad) {
        error.kind = ErrorKind::input;
        error.what = fmt::format("{} cannot be read: {}", missing.unreadable, missing.failure);
        error.hint = "build the store again; --skip-bad permits it";
    } else {
        error.what = fmt::format("{} do not fit into --resident {}", missing.noRoom, plan.resident);
        error.hint = "give more memory; --no-wait permits it";
    }
    std::string which = "the picture is written, but incomplete";
    if (verdict.pictures > 1) {
        which = fmt::format("{} of {} pictures are incomplete (all are written); this is the worst", verdict.incomplete,
                            verdict.pictures);
        error.where = numbered(plan.output, verdict.worst);
    }
    error.what = fmt::format("{}: of the chunks that it wants {}; delivered error {:.2f} px", which, error.what,
                             verdict.tauEffectivePixels);
    if (!isBad || !plan.skipBad) return tl::unexpected(error);
    if (!plan.quiet) fmt::print(stderr, "note: {}: {}\n", error.where, error.what);
    return {};
}

}  // namespace stipple::app
