#include "lod/store/pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "engine/base/check.h"
#include "lod/store/check.h"

namespace stipple::lod {

using namespace layout;

namespace {

/// Every array of a part with where it begins: use(part's array, its length so far).
template <typename Part, typename Use>
void forEachArray(Part& part, const Places& first, const Use& use) {
    use(part.nodes, first.nodes);
    use(part.further, first.further);
    use(part.streams, first.streams);
    use(part.greaterThan, first.steps);
    use(part.groups, first.groups);
    use(part.runs, first.runs);
    use(part.parents, first.parents);
    use(part.groupTextures, first.groupTextures);
}

std::array<uint64_t, 9> valuesOf(const Places& p) {
    return {p.nodes, p.further, p.streams, p.steps, p.groups, p.runs, p.parents, p.groupTextures, p.children};
}

/// How much a page has of each array.
Places between(const Places& first, const Places& next) {
    return {next.nodes - first.nodes,      next.further - first.further,
            next.streams - first.streams,  next.steps - first.steps,
            next.groups - first.groups,    next.runs - first.runs,
            next.parents - first.parents,  next.groupTextures - first.groupTextures,
            next.children - first.children};
}

/// Bytes of a page but for its streams and pairs.
uint64_t fewestPageBytes(const Places& has) {
    return sizeof(PageHead) + has.nodes * sizeof(NodeOnDisk) + (has.nodes + has.further) * sizeof(PayloadOnDisk) +
           has.groups * sizeof(MeshGroup) + has.runs * sizeof(MeshRun) + (has.parents + has.groupTextures) * 4;
}

std::vector<uint8_t> pageBytes(const PartOnDisk& part) {
    std::vector<uint8_t> out;
    appendArray(std::vector{PageHead{part.streams.size(), part.pairs.size()}}, out);
    appendArray(part.nodes, out);
    appendArray(part.payloads, out);
    appendArray(part.streams, out);
    appendArray(part.pairs, out);
    appendArray(part.groups, out);
    appendArray(part.runs, out);
    appendArray(part.parents, out);
    appendArray(part.groupTextures, out);
    return out;
}

uint32_t flagsOf(const Hierarchy& h) {
    bool isMixed = !h.further.empty(), hasPatches = false, isLeaf = false, isTold = false;
    for (const Node& n : h.nodes) {
        isMixed = isMixed || n.kind != h.nodes[0].kind;
        hasPatches = hasPatches || n.kind == Kind::patches;
        isLeaf = isLeaf || (n.kind == Kind::patches && n.isLeaf());
        isTold = isTold || n.sourceCode != 0;
    }
    const bool isOne = !h.isGraph && isLeaf && (h.hasOneSourceCode || !isTold);
    return (isMixed ? kTableMixed : 0) | (hasPatches ? kTablePatches : 0) | (isOne ? kTableOneSourceCode : 0);
}

}  // namespace

Result<Section> writePages(const Hierarchy& h, uint32_t log2Nodes, const WriteSection& write) {
    Places first{};
    first.children = 1;
    uint32_t group = 0;
    std::vector<PageOnDisk> pages;
    const auto nodes = static_cast<uint32_t>(h.nodes.size());
    Names names;
    for (size_t k = 0; k < kKinds; ++k) names.kinds.push_back(static_cast<Kind>(k));
    for (size_t c = 0; c < kCodecs; ++c) names.codecs.push_back(static_cast<Codec>(c));
    for (uint32_t begin = 0; begin < nodes; begin += 1u << log2Nodes) {
        const PartOnDisk part = partOnDisk(h, begin, std::min(nodes, begin + (1u << log2Nodes)), group);
        STIPPLE_ASSIGN(const Section section, write(pageBytes(part)));
        pages.push_back({section, first});
        // As whoever reads it will count.
        STIPPLE_ASSIGN(const TablePart read, partInMemory(part, names, first, h.isGraph, "what is written"));
        first = placesAfter(read, first);
    }
    std::vector<uint8_t> out;
    appendArray(std::vector{TableHead{kKinds, kCodecs, pages.size(), log2Nodes, flagsOf(h), first}}, out);
    const std::vector<uint8_t> text = namesOnDisk();
    out.insert(out.end(), text.begin(), text.end());
    appendArray(pages, out);
    return write(out);
}

Result<std::shared_ptr<NodePages>> NodePages::open(std::shared_ptr<const ByteSource> file, const Head& head,
                                                   bool isGraph) {
    std::shared_ptr<NodePages> out(new NodePages);
    const auto bad = [&] { return tl::unexpected(damagedStore(file->path(), "the pages of nodes are not possible")); };
    const uint64_t most = sizeof(TableHead) + kMostNames * 2 * sizeof(NameOnDisk) + head.nodeCount * sizeof(PageOnDisk);
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readSection(*file, head.nodes, most, "pages of nodes"));
    TableHead& table = out->table_;
    if (bytes.size() < sizeof(table)) return bad();
    std::memcpy(&table, bytes.data(), sizeof(table));
    if (table.kinds > kMostNames || table.codecs > kMostNames || table.pages > head.nodeCount ||
        sizeof(table) + (table.kinds + table.codecs) * sizeof(NameOnDisk) + table.pages * sizeof(PageOnDisk) !=
            bytes.size())
        return bad();
    const uint8_t* at = bytes.data() + sizeof(table);
    STIPPLE_ASSIGN(out->names_, readNames(at, table.kinds, table.codecs, file->path()));
    at += (table.kinds + table.codecs) * sizeof(NameOnDisk);
    out->pages_ = takeArray<PageOnDisk>(at, table.pages);
    out->version_ = head.version;
    out->isGraph_ = isGraph;
    out->file_ = std::move(file);
    STIPPLE_TRY(out->checkDirectory(head));
    return out;
}

/// All that memory is taken for, before it is: each page has what its bytes can hold, and no byte of the file is in two
/// pages.
Result<void> NodePages::checkDirectory(const Head& head) const {
    const auto bad = [&] { return tl::unexpected(damagedStore(file_->path(), "the pages of nodes are not possible")); };
    const Places& total = table_.total;
    const auto isCountable = [](uint64_t count) { return count <= std::numeric_limits<uint32_t>::max(); };
    if (const auto counts = valuesOf(total); !std::all_of(counts.begin(), counts.end(), isCountable)) return bad();
    if (table_.log2Nodes > 20 || (table_.flags & ~kTableFlags) != 0 || total.nodes != head.nodeCount ||
        table_.pages != ((head.nodeCount - 1) >> table_.log2Nodes) + 1 ||
        total.children != (isGraph_ ? 1 : head.nodeCount) || (isGraph_ && total.groups != head.nodeCount))
        return bad();
    Places begin{};
    begin.children = 1;
    if (pages_.empty() || valuesOf(pages_[0].first) != valuesOf(begin)) return bad();
    uint64_t end = sizeof(Head), payloads = 0;
    for (size_t p = 0; p < pages_.size(); ++p) {
        const auto& [section, first] = pages_[p];
        const auto here = valuesOf(first), next = valuesOf(placesOf(p + 1));
        // (A node comes after its parent, so that the page of the parent is known.)
        bool fits = first.nodes == p << table_.log2Nodes &&
                    (isGraph_ || placesOf(p + 1).children >= placesOf(p + 1).nodes) && section.offset >= end &&
                    section.offset <= head.nodes.offset && section.bytes <= head.nodes.offset - section.offset &&
                    isPossibleGain(section.bytes, section.rawBytes);
        // (Each is bounded first, so that the sums cannot overflow.)
        for (size_t k = 0; fits && k < here.size(); ++k)
            fits = here.at(k) <= next.at(k) && next.at(k) - here.at(k) <= section.rawBytes * 255;
        if (!fits) return bad();
        const Places has = between(first, placesOf(p + 1));
        payloads += has.nodes + has.further;
        if (std::max({has.nodes, has.further, has.groups, has.runs, has.parents, has.groupTextures}) >
                section.rawBytes ||
            fewestPageBytes(has) + has.streams * sizeof(StreamOnDisk) > section.rawBytes ||
            has.steps > 510 * (has.nodes + has.further) || has.streams > kMostStreams * (has.nodes + has.further) ||
            has.groups > has.nodes + has.further ||
            (!isGraph_ && (has.runs > 8 * has.groups || has.parents + has.groupTextures > 0)) ||
            payloads > file_->sizeBytes() / kFewestChunkBytes)
            return bad();
        end = section.offset + section.bytes;
    }
    return {};
}

Result<TablePart> NodePages::read(uint32_t page) const {
    const Section& section = pages_[page].section;
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes,
                   readSection(*file_, section, section.rawBytes, fmt::format("page {} of the nodes", page).c_str()));
    const auto bad = [&] {
        return tl::unexpected(damagedStore(file_->path(), fmt::format("page {} of the nodes is not possible", page)));
    };
    const Places &first = pages_[page].first, has = between(first, placesOf(page + size_t{1}));
    PageHead head{};
    std::memcpy(&head, bytes.data(), sizeof(head));
    if (head.streams > bytes.size() || head.pairs > bytes.size() ||
        fewestPageBytes(has) + head.streams * sizeof(StreamOnDisk) + head.pairs * sizeof(CodeCount) != bytes.size())
        return bad();
    const uint8_t* at = bytes.data() + sizeof(head);
    PartOnDisk part;
    part.nodes = takeArray<NodeOnDisk>(at, has.nodes);
    part.payloads = takeArray<PayloadOnDisk>(at, has.nodes + has.further);
    part.streams = takeArray<StreamOnDisk>(at, head.streams);
    part.pairs = takeArray<CodeCount>(at, head.pairs);
    part.groups = takeArray<MeshGroup>(at, has.groups);
    part.runs = takeArray<MeshRun>(at, has.runs);
    part.parents = takeArray<uint32_t>(at, has.parents);
    part.groupTextures = takeArray<uint32_t>(at, has.groupTextures);
    STIPPLE_ASSIGN(TablePart out, partInMemory(part, names_, first, isGraph_, file_->path()));
    if (valuesOf(placesAfter(out, first)) != valuesOf(placesOf(page + size_t{1}))) return bad();
    return out;
}

namespace {

void makeRoom(Hierarchy& h, const Places& total) {
    forEachArray(h, total, [](auto& array, uint64_t count) { array.resize(count); });
}

template <typename T>
void copyTo(const std::vector<T>& from, T* to, uint64_t at) {
    std::copy(from.begin(), from.end(), to + at);
}

}  // namespace

void NodePages::place(const TablePart& part, const Places& first) {
    copyTo(part.nodes, room_.nodes, first.nodes);
    copyTo(part.further, room_.further, first.further);
    copyTo(part.streams, room_.streams, first.streams);
    copyTo(part.greaterThan, room_.greaterThan, first.steps);
    copyTo(part.groups, room_.groups, first.groups);
    copyTo(part.runs, room_.runs, first.runs);
    copyTo(part.parents, room_.parents, first.parents);
    copyTo(part.groupTextures, room_.groupTextures, first.groupTextures);
}

Result<void> NodePages::readAll(Hierarchy& h) const {
    for (uint32_t page = 0; page < pages_.size(); ++page) {
        STIPPLE_ASSIGN(const TablePart part, read(page));
        const auto append = [](const auto& from, auto& to) { to.insert(to.end(), from.begin(), from.end()); };
        append(part.nodes, h.nodes);
        append(part.further, h.further);
        append(part.streams, h.streams);
        append(part.greaterThan, h.greaterThan);
        append(part.groups, h.groups);
        append(part.runs, h.runs);
        append(part.parents, h.parents);
        append(part.groupTextures, h.groupTextures);
    }
    return {};
}

void NodePages::prepare(Hierarchy& h, uint8_t sourceCode) {
    makeRoom(h, table_.total);
    h.known = KnownPages(table_.log2Nodes, pages_.size());
    room_ = {h.nodes.data(),         h.further.data(), h.streams.data(), h.greaterThan.data(), h.parents.data(),
             h.groupTextures.data(), h.groups.data(),  h.runs.data(),    h.known.places()};
    sourceCode_ = (table_.flags & kTableOneSourceCode) != 0 ? sourceCode : 0;
}

uint32_t NodePages::pageOfParent(uint64_t node) const {
    const auto isAfter = [](uint64_t n, const PageOnDisk& p) { return n < p.first.children; };
    const auto after = std::upper_bound(pages_.begin(), pages_.end(), node, isAfter);
    return static_cast<uint32_t>(after - pages_.begin()) - 1;
}

/// In order: what is not there yet of the page and of what it builds on, however many levels that is.
std::set<uint32_t> NodePages::missingFor(const Hierarchy& h, uint32_t page) const {
    std::set<uint32_t> out;
    if (!h.known.isThere(page)) out.insert(page);
    // What is found on the way has lower numbers: it is come to.
    for (auto at = out.rbegin(); at != out.rend() && *at > 0; ++at) {
        const uint32_t last = std::min(pageOfParent(placesOf(*at + size_t{1}).nodes - 1), *at - 1);
        for (uint32_t above = pageOfParent(pages_[*at].first.nodes); above <= last; ++above)
            if (!h.known.isThere(above)) out.insert(above);
    }
    return out;
}

Result<void> NodePages::loadAlone(const Hierarchy& h, uint32_t page) {
    const Places &first = pages_[page].first, end = placesOf(page + size_t{1});
    STIPPLE_ASSIGN(TablePart part, read(page));
    for (Node& n : part.nodes)
        if (sourceCode_ != 0 && n.isLeaf()) n.sourceCode = sourceCode_;
    return placing_([&]() -> Result<void> {
        if (h.known.isThere(page)) return {};
        place(part, first);
        STIPPLE_TRY(checkPage(h, first, end, table_.flags, chunksEnd(), file_->path()));
        STIPPLE_TRY(checkLight(h, first.nodes, end.nodes, version_, file_->path()));
        room_.isThere[page].store(true, std::memory_order_release);
        return {};
    });
}

Result<NodePages::Loaded> NodePages::load(const Hierarchy& h, uint32_t page) {
    STIPPLE_CHECK(h.nodes.data() == room_.nodes, "pages of another hierarchy");
    Loaded loaded;
    for (const uint32_t one : missingFor(h, page)) {
        STIPPLE_TRY(loadAlone(h, one));
        loaded.pages += 1;
        loaded.bytes += bytesOf(one);
    }
    return loaded;
}

}  // namespace stipple::lod
