// verifyStore: everything that the cut relies on, checked on the finished file, through the reader that users run.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>

#include "engine/base/process.h"
#include "engine/base/queue.h"
#include "lod/kinds.h"
#include "lod/store.h"
#include "lod/verify_errors.h"

namespace stipple::lod {

Result<VerifyReport> verifyStore(const Store& store, Executor& executor, uint64_t nodes) {
    const Hierarchy& h = store.hierarchy;
    const KindTraits& kind = traitsOf(h);
    // Of a sample of nodes a sample of their discs is held against the leaves.
    const uint64_t discs = nodes == 0 ? std::numeric_limits<uint64_t>::max() : 64;
    const size_t stride = nodes == 0 ? 1 : h.nodes.size() / nodes + 1;
    std::atomic<uint64_t> checked{0}, measured{0};
    CompletionQueue<std::pair<size_t, Error>> problems;
    std::atomic<uint64_t> records{0}, leafRecords{0};
    executor.parallelFor((h.nodes.size() + stride - 1) / stride, 1, [&](size_t begin, size_t end) {
        for (size_t i = begin * stride; i < end * stride && i < h.nodes.size() && !isStopRequested(); i += stride) {
            ++checked;
            const auto chunk = readChunk(store, static_cast<uint32_t>(i), true);
            if (!chunk) {
                problems.push({i, chunk.error()});
                continue;
            }
            const auto index = static_cast<uint32_t>(i);
            if (std::string text = kind.check(h, index, *chunk); !text.empty())
                problems.push({i, Error{ErrorKind::input, std::move(text), fmt::format("{}: node {}", store.path, i),
                                        "this is a fault of the build; please report it with the input"}});
            if (!h.isProgressive) {
                const auto worst = kind.measure(store, index, *chunk, discs);
                if (!worst)
                    problems.push({i, worst.error()});
                else
                    measured += *worst;
            }
            if (const auto drawn = checkDrawnPlaces(store, index, *chunk); !drawn) problems.push({i, drawn.error()});
            for (size_t a = 0; a < store.description.attributes.size(); ++a)
                if (const auto values = readAttribute(store, static_cast<uint32_t>(i), a); !values)
                    problems.push({i, values.error()});
            records += h.nodes[i].records;
            leafRecords += kind.leafRecords(h, index);
        }
    });
    executor.parallelFor(h.tiles.size(), 1, [&](size_t begin, size_t end) {
        for (size_t t = begin; t < end && !isStopRequested(); ++t)
            if (const auto tile = readChunk(store, static_cast<uint32_t>(h.nodes.size() + t)); !tile)
                problems.push({h.nodes.size() + t, tile.error()});
    });
    if (isStopRequested()) return fail(ErrorKind::interrupted, "interrupted; not all of it was checked", store.path);
    auto found = problems.takeAll();
    if (!found.empty())
        return tl::unexpected(std::min_element(found.begin(), found.end(), [](const auto& a, const auto& b) {
                                  return a.first < b.first;
                              })->second);
    if (stride == 1 && leafRecords != store.description.points)
        return fail(ErrorKind::input,
                    fmt::format("{} leaf records, but {} points", leafRecords.load(), store.description.points),
                    store.path);
    return VerifyReport{checked, records, leafRecords, measured};
}

}  // namespace stipple::lod
