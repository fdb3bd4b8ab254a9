// verifyStore: everything that the cut relies on, checked on the finished file, through the reader that users run.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>

#include "engine/base/process.h"
#include "engine/base/queue.h"
#include "lod/primitives/kinds.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/check.h"
#include "lod/store/materials.h"
#include "lod/store/store.h"
#include "lod/store/surfel_weights.h"
#include "lod/verify/errors.h"
#include "lod/verify/overviews.h"

namespace stipple::lod {

namespace {

constexpr uint64_t kLeavesOfAll = 256;  ///< records of a leaf that are held against overviews, at most

struct Counts {
    std::atomic<uint64_t> nodes{0}, payloads{0}, records{0}, leafRecords{0}, measured{0};
};

/// Every record has one: code 0, which stands for none, is never written.
Result<void> checkWeights(const Store& store, uint32_t index, const std::vector<uint8_t>& bytes) {
    const uint32_t records = store.hierarchy.payload(index).records;
    const std::string where = fmt::format("{}: node {}", store.path, store.hierarchy.nodeOf(index));
    STIPPLE_ASSIGN(const std::vector<uint8_t> codes, decodeWeights(bytes.data(), bytes.size(), records, where));
    if (std::find(codes.begin(), codes.begin() + records, 0) == codes.begin() + records) return {};
    return tl::unexpected(damagedStore(where, "a surfel has no weight"));
}

/// Reads one payload and all of its streams. `discs`: see measure.
Result<void> verifyPayload(const Store& store, uint32_t index, uint64_t discs, const OverviewLevels& overview,
                           Counts& counts) {
    const Hierarchy& h = store.hierarchy;
    const Payload& payload = h.payload(index);
    const KindTraits& kind = traitsOf(payload.kind);
    STIPPLE_ASSIGN(const Chunk chunk, readDrawnChunk(store, index, true));
    if (std::string text = kind.check(h, index, chunk); !text.empty())
        return fail(ErrorKind::input, std::move(text), fmt::format("{}: node {}", store.path, h.nodeOf(index)),
                    "this is a fault of the build; please report it with the input");
    const auto spaced = std::span(chunk.records).subspan(overviewOf(h, payload, chunk));
    if (payload.spacingCode != 0 && spacingCodeUp(recordSpacing(spaced)) != payload.spacingCode)
        return fail(ErrorKind::input,
                    fmt::format("its records lie {:.1f} steps apart, not {:.1f} as its table says",
                                recordSpacing(spaced), spacingOfCode(payload.spacingCode)),
                    fmt::format("{}: node {}", store.path, h.nodeOf(index)),
                    "this is a fault of the build; please report it with the input");
    // (What is beside patches has their error: they measure it.)
    if (!h.isStochastic && (!h.isMixed || payload.kind == Kind::patches)) {
        STIPPLE_ASSIGN(const uint64_t measured, kind.measure(store, index, chunk, discs));
        counts.measured += measured;
    }
    if (payload.kind == Kind::points && h.nodes[h.nodeOf(index)].isLeaf()) {
        STIPPLE_ASSIGN(const uint64_t seen, overview.measure(h.nodeOf(index), chunk, std::min(discs, kLeavesOfAll)));
        counts.measured += seen;
    }
    STIPPLE_TRY(checkDrawnPlaces(store, index, chunk));
    STIPPLE_TRY(checkSampleMaterials(store, index, chunk));
    const bool hasAttributes = payload.attributeBytes > 0 || !h.isMixed;
    for (size_t a = 0; hasAttributes && a < store.description.attributes.size(); ++a) {
        STIPPLE_ASSIGN(const std::vector<uint8_t> values, readAttribute(store, index, a));
        if (payload.kind == Kind::points && materialAttribute(store.description) == a)
            STIPPLE_TRY(checkMaterialIndices(store, index, values));
    }
    for (uint32_t k = payload.firstStream; k < payload.firstStream + payload.streams; ++k) {
        STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readStream(store, index, h.streams[k]));
        if (h.streams[k].id == StreamId::surfelWeights) STIPPLE_TRY(checkWeights(store, index, bytes));
    }
    ++counts.payloads;
    counts.records += payload.records;
    counts.leafRecords += kind.leafRecords(h, index);
    return {};
}

}  // namespace

Result<VerifyReport> verifyStore(const Store& store, Executor& executor, uint64_t nodes) {
    STIPPLE_TRY(readWholeTable(store));
    const Hierarchy& h = store.hierarchy;
    // Of a sample of nodes a sample of their discs is held against the leaves.
    const uint64_t discs = nodes == 0 ? std::numeric_limits<uint64_t>::max() : 64;
    const size_t stride = nodes == 0 ? 1 : h.nodes.size() / nodes + 1;
    const OverviewLevels overview(store);
    Counts counts;
    CompletionQueue<std::pair<size_t, Error>> problems;
    executor.parallelFor((h.nodes.size() + stride - 1) / stride, 1, [&](size_t begin, size_t end) {
        for (size_t i = begin * stride; i < end * stride && i < h.nodes.size() && !isStopRequested(); i += stride) {
            ++counts.nodes;
            h.forEachPayload(static_cast<uint32_t>(i), [&](uint32_t chunk) {
                if (const auto right = verifyPayload(store, chunk, discs, overview, counts); !right)
                    problems.push({i, right.error()});
            });
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
    if (stride == 1 && counts.leafRecords != store.description.points)
        return fail(ErrorKind::input,
                    fmt::format("{} leaf records, but {} points", counts.leafRecords.load(), store.description.points),
                    store.path);
    return VerifyReport{counts.nodes, counts.payloads, counts.records, counts.leafRecords, counts.measured};
}

}  // namespace stipple::lod
