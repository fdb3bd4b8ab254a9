// The thread of frames allocates nothing while chunks come and go, up to the list of what is drawn: not in the
// streamer, the cut or the list, nor where a backend takes chunks and gives them up.
#include <gtest/gtest.h>

#include "engine/render/draw_list.h"
#include "tests/support/allocations.h"
#include "tests/support/backends_here.h"

namespace stipple {
namespace {

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

/// What the thread of frames allocates up to the list of what is drawn, of a camera that flies round a ball of points
/// `laps` times; memory holds a part of what it sees. Tasks that read and decode are other threads', or run between
/// frames.
struct Flight {
    std::vector<uint64_t> allocated, uploads, evictions;  ///< of each lap
};
Flight flyStreamed(Executor& executor, render::Backend& backend, const std::shared_ptr<const lod::Store>& store,
                   size_t laps) {
    streaming::StreamSettings settings;
    settings.residentBytes = 1'100'000;
    settings.uploadBytesPerFrame = 100'000;
    settings.requestsInFlight = 16;
    const auto state = render::makeFrameState({store}, backend, executor, settings);
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<lod::View> views = test::viewsRound(h.origin + h.unit * h.nodes[0].centre, 1.5);
    const lod::View few = test::fitView(*store, 16, 16);
    Flight flight;
    streaming::Streamer& streamer = *state->streamer;
    for (size_t lap = 0; lap < laps; ++lap) {
        const streaming::StreamCounters before = streamer.counters();
        uint64_t allocated = 0;
        for (const lod::View& view : views)
            for (int stay = 0; stay < 3; ++stay) {
                const uint64_t start = test::ownAllocations();
                streamer.collect();
                streamer.upload();
                lod::selectCut(state->scene(), streamer.residency(), view, {1, kNoLimit}, state->scratch, state->cut);
                streamer.request(state->cut);
                render::makeDrawList(state->cut, state->hierarchies, state->instances, view, {}, state->draws);
                allocated += test::ownAllocations() - start;
                streamer.wait();
                EXPECT_TRUE(render::renderResident(*state, few, {}));  // chunks are on the device then
            }
        flight.allocated.push_back(allocated);
        flight.uploads.push_back(streamer.counters().uploads - before.uploads);
        flight.evictions.push_back(streamer.counters().evictions - before.evictions);
    }
    state->streamer.reset();
    return flight;
}

class StreamMemory : public test::BackendsHere {};

TEST_F(StreamMemory, FramesAllocateNothingOnceWarm) {
    const auto several = makeTbbExecutor(2), one = makeTbbExecutor(1), serial = makeSerialExecutor();
    test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *several);
    for (Executor* const executor : {serial.get(), one.get(), several.get()}) {
        const Flight flight = flyStreamed(*executor, usual(), store, 12);
        EXPECT_GT(flight.allocated.front(), 0u) << "the count must see what cold frames take";
        for (size_t lap = 9; lap < 12; ++lap) {  // (what is there differs from lap to lap: the most nodes come late)
            EXPECT_EQ(flight.allocated[lap], 0u) << flight.uploads[lap] << " chunks came";
            EXPECT_GT(flight.uploads[lap], 40u);
            EXPECT_GT(flight.evictions[lap], 40u);
        }
    }
}

}  // namespace
}  // namespace stipple
