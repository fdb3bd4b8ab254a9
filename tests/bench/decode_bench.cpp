// Chunks from their compressed bytes to records, one core: the figure of the README.
#include <benchmark/benchmark.h>

#include "tests/support/support.h"

namespace {

void decodeChunks(benchmark::State& state) {
    using namespace stipple;
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(1'000'000, 1));
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
    const auto store = lod::openStore(folder / "a.stipple");
    std::vector<std::vector<uint8_t>> chunks;
    for (const lod::Node& n : store->hierarchy.nodes) {
        chunks.emplace_back(n.chunkBytes);
        benchmark::DoNotOptimize(store->file->readAt(n.chunkOffset, chunks.back().data(), n.chunkBytes));
    }
    int64_t records = 0;
    for (auto _ : state)
        for (uint32_t i = 0; i < chunks.size(); ++i) {
            const auto chunk = lod::decodeStored(store->hierarchy, i, chunks[i].data(), chunks[i].size(), "", false);
            records += static_cast<int64_t>(chunk->records.size());
        }
    state.SetItemsProcessed(records);
}
BENCHMARK(decodeChunks)->Name("DecodeChunks")->Unit(benchmark::kMillisecond);

}  // namespace
