#include "lod/builder/weights/add.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <span>

#include "engine/base/queue.h"
#include "lod/builder/weights/measure.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/overview_levels.h"
#include "lod/store/surfel_weights.h"
#include "shaders/shared/ewa.h"

namespace stipple::lod {
namespace {

using Chunks = std::map<uint32_t, Chunk>;

/// The node whose records are drawn in a cell of a level beside nodes of that level: it, or the leaf above. `nodes`
/// where there is none.
uint32_t nodeAt(const Hierarchy& h, uint32_t level, const std::array<uint64_t, 3>& cell) {
    uint32_t at = 0;
    while (h.nodes[at].level < level && !h.nodes[at].isLeaf()) {
        const Node& n = h.nodes[at];
        uint32_t octant = 0;
        for (size_t a = 0; a < 3; ++a) octant |= static_cast<uint32_t>(cell.at(a) >> (level - n.level - 1u) & 1u) << a;
        if ((n.childMask >> octant & 1u) == 0) return static_cast<uint32_t>(h.nodes.size());
        at = n.firstChild + static_cast<uint32_t>(__builtin_popcount(n.childMask & ((1u << octant) - 1u)));
    }
    return at;
}

/// The node and those about it, each once, in order.
std::vector<uint32_t> nodesAbout(const Hierarchy& h, uint32_t node) {
    const Node& n = h.nodes[node];
    const auto cells = static_cast<int64_t>(uint64_t{1} << n.level);
    std::vector<uint32_t> out;
    for (int64_t k = 0; k < 27; ++k) {
        const std::array<int64_t, 3> by{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
        std::array<uint64_t, 3> cell{};
        bool isInside = true;
        for (size_t a = 0; a < 3; ++a) {
            const int64_t c = static_cast<int64_t>(n.cell.at(a)) + by.at(a);
            isInside = isInside && c >= 0 && c < cells;
            cell.at(a) = static_cast<uint64_t>(c);
        }
        if (!isInside) continue;
        if (const uint32_t at = nodeAt(h, n.level, cell); at < h.nodes.size()) out.push_back(at);
    }
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
}

class Weigher {
  public:
    explicit Weigher(const Store& store) : store_(store), h_(store.hierarchy) {}

    /// Codes of the records of a node.
    Result<std::vector<uint8_t>> weigh(uint32_t node, Chunks& chunks) const {
        STIPPLE_TRY(take(node, chunks));
        const Chunk& own = chunks.at(node);
        std::vector<Surfel> surfels;
        const glm::dvec3 origin = h_.recordOrigin(h_.nodes[node]);
        append(node, own.records, stepsOf(node, own), origin, glm::vec3(-HUGE_VALF), glm::vec3(HUGE_VALF), surfels);
        // Three rounds look as far as three kernels reach.
        constexpr float kReaches = 3, kMostMeans = 1.5f;
        float reach = 0, largest = 0;
        glm::vec3 lo(1e30f), hi(-1e30f);
        for (const Surfel& s : surfels) {
            reach += s.radius * (2 / shared::kOpaqueSigmas);
            largest = std::max(largest, s.radius * (2 / shared::kOpaqueSigmas));
            lo = glm::min(lo, s.place);
            hi = glm::max(hi, s.place);
        }
        const float mean = reach / std::max(1.0f, static_cast<float>(surfels.size()));
        const float margin = kReaches * std::min(largest, kMostMeans * mean);
        const size_t ofNode = surfels.size();
        for (const uint32_t other : nodesAbout(h_, node)) {
            if (other == node) continue;
            STIPPLE_TRY(take(other, chunks));
            const Chunk& beside = chunks.at(other);
            append(other, beside.records, stepsOf(other, beside), origin, lo - margin, hi + margin, surfels);
        }
        const std::vector<float> weights = surfelWeights(surfels);
        STIPPLE_ASSIGN(std::vector<uint8_t> codes, weighOverview(node));
        std::transform(weights.begin(), weights.begin() + static_cast<ptrdiff_t>(ofNode), std::back_inserter(codes),
                       weightCode);
        return codes;
    }

  private:
    float stepsOf(uint32_t node, const Chunk& chunk) const {
        const uint8_t code = h_.nodes[node].spacingCode;
        return code != 0 ? spacingOfCode(code) : recordSpacing(chunk.records);
    }
    /// Codes of the records of an overview, each level by itself.
    Result<std::vector<uint8_t>> weighOverview(uint32_t node) const {
        std::vector<uint8_t> codes;
        const uint32_t overview = h_.overviewOf(h_.nodes[node]);
        if (overview == 0) return codes;
        STIPPLE_ASSIGN(const Chunk chunk, readDrawnChunk(store_, node));
        const glm::dvec3 origin = h_.recordOrigin(h_.nodes[node]);
        const auto records = std::span(chunk.records).first(overview);
        forEachOverviewLevel(records, [&](size_t begin, size_t end) {
            std::vector<Surfel> level;
            append(node, records.subspan(begin, end - begin), 0, origin, glm::vec3(-HUGE_VALF), glm::vec3(HUGE_VALF),
                   level);
            const std::vector<float> weights = surfelWeights(level);
            std::transform(weights.begin(), weights.end(), std::back_inserter(codes), weightCode);
        });
        return codes;
    }
    Result<void> take(uint32_t node, Chunks& chunks) const {
        if (chunks.find(node) != chunks.end()) return {};
        STIPPLE_ASSIGN(Chunk chunk, readChunk(store_, node));
        chunks[node] = std::move(chunk);
        return {};
    }
    /// Discs as mode ewa draws them; places in lattice units from `origin`. Those from `lo` to `hi`. `steps`: between
    /// them.
    void append(uint32_t node, std::span<const shared::PointRecord> records, float steps, const glm::dvec3& origin,
                const glm::vec3& lo, const glm::vec3& hi, std::vector<Surfel>& to) const {
        const Node& n = h_.nodes[node];
        const double step = std::exp2(n.stepShift);
        const glm::dvec3 base = h_.recordOrigin(n) - origin;
        const auto edge = static_cast<float>(h_.cellSize(n));
        const float spacing = steps * static_cast<float>(step);
        for (const shared::PointRecord& r : records) {
            const uint32_t flags = shared::recordFlags(r);
            Surfel s;
            s.place = glm::vec3(base + step * glm::dvec3(shared::recordX(r), shared::recordY(r), shared::recordZ(r)));
            if (glm::any(glm::lessThan(s.place, lo)) || glm::any(glm::greaterThan(s.place, hi))) continue;
            if ((flags & shared::kFlagNoNormal) == 0) s.normal = glm::vec3(shared::octDecode(r.normal));
            s.radius = shared::opaqueRadius(edge * shared::radiusFractionFast(shared::recordRadiusCode(r)), spacing);
            s.isTwoSided = (flags & shared::kFlagTwoSided) != 0;
            s.isLeaf = (flags & shared::kFlagLeaf) != 0;
            to.push_back(s);
        }
    }

    const Store& store_;
    const Hierarchy& h_;
};

/// Nodes whose parents are the same share most of what they look at.
std::vector<uint32_t> firstOfSiblings(const Hierarchy& h) {
    std::vector<uint32_t> first;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        if (n == 0 || h.nodes[n].parent != h.nodes[n - 1].parent || n == 1) first.push_back(n);
    first.push_back(static_cast<uint32_t>(h.nodes.size()));
    return first;
}

Result<std::vector<std::vector<uint8_t>>> weighAll(const Store& store, Executor& executor, Progress& progress,
                                                   const std::function<bool()>& isStopped) {
    const Hierarchy& h = store.hierarchy;
    std::vector<std::vector<uint8_t>> codes(h.nodes.size());
    const std::vector<uint32_t> first = firstOfSiblings(h);
    CompletionQueue<Error> errors;
    std::atomic<uint64_t> done{0};
    const Weigher weigher(store);
    std::atomic<bool> stops{false};
    executor.parallelFor(first.size() - 1, 1, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end && !stops; ++k) {
            if (isStopped && isStopped()) stops = true;
            Chunks chunks;
            for (uint32_t n = first[k]; n < first[k + 1]; ++n) {
                Result<std::vector<uint8_t>> of = weigher.weigh(n, chunks);
                if (!of) return errors.push(std::move(of.error()));
                codes[n] = std::move(*of);
            }
            progress.update("weights of surfels", done += first[k + 1] - first[k], h.nodes.size());
        }
    });
    if (stops) return fail(ErrorKind::interrupted, "interrupted; it has no weights", store.path);
    if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    return codes;
}

/// All that lies before the tables, as it is.
Result<void> copyStreams(const Store& store, StoreWriter& writer) {
    uint64_t end = 0;
    const Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        end = std::max(end, h.nodes[n].chunkOffset + h.nodes[n].chunkBytes + h.nodes[n].attributeBytes);
    for (const Stream& s : h.streams) end = std::max(end, s.offset + s.bytes);
    constexpr uint64_t kAtOnce = uint64_t{8} << 20;
    std::vector<uint8_t> bytes;
    while (writer.bytes() < end) {
        bytes.resize(std::min(kAtOnce, end - writer.bytes()));
        STIPPLE_TRY(store.file->readAt(writer.bytes(), bytes.data(), bytes.size()));
        STIPPLE_TRY(writer.appendEncoded(bytes));
    }
    return {};
}

}  // namespace

Result<WeightReport> addSurfelWeights(const std::string& path, Executor& executor, Progress& progress,
                                      const std::string& to, const std::function<bool()>& isStopped) {
    const double start = nowSeconds();
    STIPPLE_ASSIGN(const Store store, openStore(path));
    const Hierarchy& h = store.hierarchy;
    const bool isOfPoints = !h.isGraph && !h.isMixed && !h.isCurves && !h.isStochastic;
    if (!isOfPoints)
        return fail(ErrorKind::usage, "has no surfels alone, so that they get no weights", path,
                    "leave out --surfel-weights");
    if (hasWeights(h)) return fail(ErrorKind::usage, "has weights of surfels already", path);
    STIPPLE_ASSIGN(const std::vector<std::vector<uint8_t>> codes, weighAll(store, executor, progress, isStopped));
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(to.empty() ? path : to));
    STIPPLE_TRY(copyStreams(store, writer));
    Hierarchy with = h;
    with.streams.clear();
    WeightReport report;
    for (uint32_t n = 0; n < with.nodes.size(); ++n) {
        Node& node = with.nodes[n];
        const uint32_t before = static_cast<uint32_t>(with.streams.size());
        for (uint32_t k = 0; k < node.streams; ++k) with.streams.push_back(h.streams[node.firstStream + k]);
        STIPPLE_ASSIGN(const Stream stream, writer.appendStream(StreamId::surfelWeights, encodeWeights(codes[n])));
        with.streams.push_back(stream);
        node.firstStream = before;
        node.streams = static_cast<uint32_t>(with.streams.size()) - before;
        report.surfels += codes[n].size();
        report.bytes += stream.bytes;
    }
    STIPPLE_TRY(writer.finish(with, store.description));
    report.contentHash = writer.contentHash();
    report.fileBytes = writer.bytes();
    STIPPLE_TRY(writer.commit());
    report.seconds = nowSeconds() - start;
    return report;
}

}  // namespace stipple::lod
