#include "tests/support/crafted_store.h"

#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "engine/base/hash.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/support.h"

namespace stipple::test {
namespace {

using namespace lod::layout;

std::vector<uint8_t> unpack(const std::string& file, const Section& s) {
    std::vector<uint8_t> raw(s.rawBytes);
    const size_t got = ZSTD_decompress(raw.data(), raw.size(), file.data() + s.offset, s.bytes);
    if (got != raw.size()) throw std::runtime_error("a section of a store to be crafted");
    return raw;
}

void append(std::vector<uint8_t>& out, const void* from, size_t count) {
    if (count == 0) return;
    const size_t at = out.size();
    out.resize(at + count);
    std::memcpy(out.data() + at, from, count);
}

/// Adds a section; what it claims to hold uncompressed, if not the truth.
Section pack(std::vector<uint8_t>& out, const void* from, size_t count, uint64_t claim) {
    std::vector<uint8_t> bytes(ZSTD_compressBound(count));
    bytes.resize(ZSTD_compress(bytes.data(), bytes.size(), from, count, 1));
    const Section s{out.size(), bytes.size(), claim != 0 ? claim : count, hashBytes(bytes.data(), bytes.size())};
    append(out, bytes.data(), bytes.size());
    return s;
}

}  // namespace

namespace {

/// Where streams end.
uint64_t streamsEnd(const lod::Hierarchy& h) {
    uint64_t end = sizeof(Head);
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) {
            const lod::Payload& p = h.payload(chunk);
            end = std::max(end, p.chunkOffset + p.chunkBytes + p.attributeBytes);
        });
    for (const lod::Stream& s : h.streams) end = std::max(end, s.offset + s.bytes);
    for (const lod::TextureTile& t : h.tiles) end = std::max(end, t.offset + t.bytes);
    return end;
}

}  // namespace

std::string withPages(const lod::Store& store, const std::string& path, uint32_t log2) {
    const auto need = [](const auto& result) {
        if (!result) throw std::runtime_error(result.error().line());
    };
    const std::string file = slurp(store.path);
    auto writer = lod::StoreWriter::create(path);
    need(writer);
    const auto end = static_cast<std::ptrdiff_t>(streamsEnd(store.hierarchy));
    need(writer->appendEncoded({file.begin() + sizeof(Head), file.begin() + end}));
    need(writer->finish(store.hierarchy, store.description, log2));
    need(writer->commit());
    return path;
}

std::string ofVersion(std::string bytes, uint32_t version) {
    Head head{};
    std::memcpy(&head, bytes.data(), sizeof(head));
    head.version = version;
    head.hash = hashBytes(&head, offsetof(Head, hash));
    const Foot foot{head.hash, kFootMagic};
    std::memcpy(bytes.data(), &head, sizeof(head));
    std::memcpy(bytes.data() + bytes.size() - sizeof(foot), &foot, sizeof(foot));
    return bytes;
}

CraftedStore CraftedStore::read(const std::string& path) {
    const std::string file = slurp(path);
    CraftedStore c;
    std::memcpy(&c.head, file.data(), sizeof(c.head));
    const std::vector<uint8_t> text = unpack(file, c.head.description);
    c.description.assign(text.begin(), text.end());
    const auto takeFrom = [](const std::vector<uint8_t>& raw, size_t& at, auto& to, uint64_t count) {
        const size_t before = to.size();
        to.resize(before + count);
        if (count > 0) std::memcpy(to.data() + before, raw.data() + at, count * sizeof(to[0]));
        at += count * sizeof(to[0]);
    };
    const std::vector<uint8_t> directory = unpack(file, c.head.nodes);
    TableHead table{};
    std::memcpy(&table, directory.data(), sizeof(table));
    size_t at = sizeof(table);
    takeFrom(directory, at, c.kinds, table.kinds);
    takeFrom(directory, at, c.codecs, table.codecs);
    std::vector<PageOnDisk> pages;
    takeFrom(directory, at, pages, table.pages);
    std::vector<lod::MeshGroup> groups;
    std::vector<lod::MeshRun> runs;
    std::vector<uint32_t> parents, groupTextures;
    for (size_t p = 0; p < pages.size(); ++p) {
        const std::vector<uint8_t> page = unpack(file, pages[p].section);
        const Places &first = pages[p].first, &next = p + 1 < pages.size() ? pages[p + 1].first : table.total;
        PageHead of{};
        std::memcpy(&of, page.data(), sizeof(of));
        size_t in = sizeof(of);
        takeFrom(page, in, c.nodes, next.nodes - first.nodes);
        takeFrom(page, in, c.payloads, next.nodes - first.nodes + next.further - first.further);
        takeFrom(page, in, c.streams, of.streams);
        takeFrom(page, in, c.counts, of.pairs);
        takeFrom(page, in, groups, next.groups - first.groups);
        takeFrom(page, in, runs, next.runs - first.runs);
        takeFrom(page, in, parents, next.parents - first.parents);
        takeFrom(page, in, groupTextures, next.groupTextures - first.groupTextures);
    }
    const std::vector<uint8_t> textures = unpack(file, c.head.mesh);
    MeshHead mesh{};
    std::memcpy(&mesh, textures.data(), sizeof(mesh));
    mesh.groups = groups.size();
    mesh.runs = runs.size();
    mesh.parents = parents.size();
    mesh.groupTextures = groupTextures.size();
    append(c.mesh, &mesh, sizeof(mesh));
    append(c.mesh, groups.data(), groups.size() * sizeof(lod::MeshGroup));
    append(c.mesh, runs.data(), runs.size() * sizeof(lod::MeshRun));
    append(c.mesh, parents.data(), parents.size() * 4);
    append(c.mesh, groupTextures.data(), groupTextures.size() * 4);
    append(c.mesh, textures.data() + sizeof(mesh), textures.size() - sizeof(mesh));
    c.body.assign(file.begin() + sizeof(Head), file.begin() + static_cast<std::ptrdiff_t>(pages.at(0).section.offset));
    c.head.version = lod::kUnpagedVersion;  // its sections are those of one page
    return c;
}

std::vector<uint8_t> CraftedStore::bytes() const {
    const auto hashOf = [&](uint64_t offset, uint64_t count) -> uint64_t {
        const uint64_t at = offset - sizeof(Head);
        if (offset < sizeof(Head) || at > body.size() || count > body.size() - at) return 0;
        return hashBytes(body.data() + at, count);
    };
    std::vector<StreamOnDisk> hashed = streams;
    for (StreamOnDisk& s : hashed) s.hash = hashOf(s.offset, s.bytes);
    const PayloadHead counted{claimKinds != 0 ? claimKinds : kinds.size(), codecs.size(),
                              claimPayloads != 0 ? claimPayloads : payloads.size(),
                              claimStreams != 0 ? claimStreams : streams.size()};
    std::vector<uint8_t> table;
    append(table, &counted, sizeof(counted));
    append(table, kinds.data(), kinds.size() * sizeof(NameOnDisk));
    append(table, codecs.data(), codecs.size() * sizeof(NameOnDisk));
    append(table, payloads.data(), payloads.size() * sizeof(PayloadOnDisk));
    append(table, hashed.data(), hashed.size() * sizeof(StreamOnDisk));
    std::vector<uint8_t> groups = mesh;
    const MeshHead of = meshHead();
    for (uint64_t t = 0; of.tiles <= groups.size() / sizeof(lod::TextureTile) && t < of.tiles; ++t) {
        lod::TextureTile tile;
        uint8_t* const at = groups.data() + tilesAt() + t * sizeof(tile);
        std::memcpy(&tile, at, sizeof(tile));
        tile.hash = hashOf(tile.offset, tile.bytes);
        std::memcpy(at, &tile, sizeof(tile));
    }
    std::vector<uint8_t> out(sizeof(Head));
    append(out, body.data(), body.size());
    Head h = head;
    h.nodes = pack(out, nodes.data(), nodes.size() * sizeof(NodeOnDisk), claimRawNodes);
    h.counts = pack(out, counts.data(), counts.size() * sizeof(CodeCount), claimRawCounts);
    h.description = pack(out, description.data(), description.size(), claimRawDescription);
    h.mesh = pack(out, groups.data(), groups.size(), claimRawMesh);
    h.payloads = pack(out, table.data(), table.size(), claimRawPayloads);
    h.nodeCount = claimNodeCount != 0 ? claimNodeCount : nodes.size();
    h.fileBytes = out.size() + sizeof(Foot);
    h.hash = hashBytes(&h, offsetof(Head, hash));
    const Foot foot{h.hash, kFootMagic};
    append(out, &foot, sizeof(foot));
    std::memcpy(out.data(), &h, sizeof(h));
    return out;
}

void CraftedStore::write(const std::string& path) const {
    const std::vector<uint8_t> all = bytes();
    spit(path, {all.begin(), all.end()});
}

StreamOnDisk& CraftedStore::streamOf(size_t i) {
    size_t first = 0;
    for (size_t k = 0; k < i; ++k) first += payloads.at(k).streams;
    return streams.at(std::min(first, streams.size() - 1));
}

void CraftedStore::replaceChunk(size_t i, const std::vector<uint8_t>& chunk) {
    StreamOnDisk& records = streamOf(i);
    const uint64_t end = records.offset + records.bytes;
    records.offset = sizeof(Head) + body.size();
    records.bytes = static_cast<uint32_t>(chunk.size());
    append(body, chunk.data(), chunk.size());
    // They follow the chunk, unless the payload was changed before and lies about it.
    StreamOnDisk* const next = &records + 1;
    const uint64_t at = end - sizeof(Head);
    if (payloads.at(i).streams < 2 || next > &streams.back() || next->offset != end || at > body.size() ||
        next->bytes > body.size() - at)
        return;
    const std::vector<uint8_t> attributes(body.begin() + static_cast<std::ptrdiff_t>(at),
                                          body.begin() + static_cast<std::ptrdiff_t>(at + next->bytes));
    next->offset = sizeof(Head) + body.size();
    append(body, attributes.data(), attributes.size());
}

MeshHead CraftedStore::meshHead() const {
    MeshHead h{};
    if (mesh.size() >= sizeof(h)) std::memcpy(&h, mesh.data(), sizeof(h));
    return h;
}

std::vector<uint8_t> encodeAgain(const lod::Chunk& chunk) {
    return !chunk.clusters.empty()   ? lod::encodeMeshChunk(chunk)
           : !chunk.segments.empty() ? lod::encodeCurveChunk(chunk)
                                     : lod::encodeChunk(chunk);
}

namespace {

/// Numbers that code forgets.
uint64_t oddNumber(const Dice& dice, uint64_t old) {
    switch (dice(10)) {
        case 0:
            return 0;
        case 1:
            return ~uint64_t{0};
        case 2:
            return old + 1;
        case 3:
            return old - 1;
        case 4:
            return old ^ uint64_t { 1 } << dice(64);
        case 5:
            return uint64_t{1} << dice(64);
        case 6:
            return (uint64_t{1} << dice(64)) - 1;
        case 7:
            return 0x7fc000007f800000ull >> 32 * dice(2);  // NaN and infinity of fp32
        case 8:
            return dice(2) == 0 ? 0x7ff0000000000000ull : 0x7ff8000000000001ull;  // of fp64
        default:
            return dice(~uint64_t{0});
    }
}

void changeBytes(void* at, size_t size, const Dice& dice) {
    static constexpr std::array<size_t, 4> widths{1, 2, 4, 8};
    const size_t width = std::min(widths.at(dice(4)), size), place = dice(size / width) * width;
    uint64_t value = 0;
    std::memcpy(&value, static_cast<uint8_t*>(at) + place, width);
    value = oddNumber(dice, value);
    std::memcpy(static_cast<uint8_t*>(at) + place, &value, width);
}

/// Another number in the place of one of the description's.
void changeText(std::string& text, const Dice& dice) {
    static constexpr std::array<const char*, 14> values{"0",          "-1",     "1e308", "-1e308", "1e38",
                                                        "4294967295", "1e-300", "65535", "65536",  "null",
                                                        "[]",         "true",   "\"x\"", "9e999"};
    if (text.empty()) return;
    size_t from = dice(text.size());
    from = text.find_first_of("0123456789", from);
    if (from == std::string::npos) return;
    size_t to = text.find_first_not_of("0123456789.eE+-", from);
    if (to == std::string::npos) to = text.size();
    text.replace(from, to - from, values.at(dice(values.size())));
}

void changeRecords(CraftedStore& c, const lod::Store& store, const Dice& dice) {
    // Payloads in the order of the file are those of the nodes, one after the other.
    std::vector<uint32_t> chunks;
    for (uint32_t n = 0; n < store.hierarchy.nodes.size(); ++n)
        store.hierarchy.forEachPayload(n, [&](uint32_t index) { chunks.push_back(index); });
    const size_t i = dice(c.payloads.size());
    if (i >= chunks.size()) return;
    auto chunk = lod::readDrawnChunk(store, chunks[i], true);
    if (!chunk) return;
    for (uint64_t n = 1 + dice(3); n > 0; --n) {
        const auto change = [&](auto& items) {
            if (!items.empty()) changeBytes(&items[dice(items.size())], sizeof(items[0]), dice);
        };
        switch (dice(4)) {
            case 0:
                change(chunk->triangles);
                break;
            case 1:
                change(chunk->clusters);
                break;
            default:
                change(chunk->vertices);
        }
        change(chunk->records);
        change(chunk->segments);
    }
    c.replaceChunk(i, encodeAgain(*chunk));
}

}  // namespace

std::string mutate(CraftedStore& c, const lod::Store& store, const Dice& dice) {
    std::string what;
    for (uint64_t n = 1 + dice(3); n > 0; --n) switch (dice(11)) {
            case 0: {
                // Of the head: what it says of space and errors, and what sizes it claims.
                std::array<double*, 5> numbers{&c.head.origin[0], &c.head.origin[1], &c.head.origin[2], &c.head.unit,
                                               &c.head.smallestError};
                std::array<uint64_t*, 9> claims{&c.claimNodeCount,      &c.claimRawNodes, &c.claimRawCounts,
                                                &c.claimRawDescription, &c.claimRawMesh,  &c.claimRawPayloads,
                                                &c.claimKinds,          &c.claimPayloads, &c.claimStreams};
                const uint64_t k = dice(16);
                if (k < 5) changeBytes(numbers.at(k), 8, dice);
                if (k >= 5 && k < 14) *claims.at(k - 5) = oddNumber(dice, 1000);
                if (k == 14) changeBytes(&c.head.rootLog2, 4, dice);
                if (k == 15) changeBytes(&c.head.isGraph, 4, dice);
                what += " head";
                break;
            }
            case 1:
            case 2:
                changeBytes(&c.nodes.at(dice(c.nodes.size())), sizeof(NodeOnDisk), dice);
                what += " node";
                break;
            case 3:
                if (!c.counts.empty()) changeBytes(&c.counts.at(dice(c.counts.size())), sizeof(CodeCount), dice);
                what += " counts";
                break;
            case 4:
                changeText(c.description, dice);
                what += " description";
                break;
            case 5:
                if (!c.mesh.empty()) changeBytes(c.mesh.data(), c.mesh.size(), dice);
                what += " mesh";
                break;
            case 6:
                changeBytes(&c.payloads.at(dice(c.payloads.size())), sizeof(PayloadOnDisk), dice);
                what += " payload";
                break;
            case 7:
                changeBytes(&c.streams.at(dice(c.streams.size())), sizeof(StreamOnDisk), dice);
                what += " stream";
                break;
            case 8: {
                auto& names = dice(2) == 0 ? c.kinds : c.codecs;
                if (!names.empty()) changeBytes(&names.at(dice(names.size())), sizeof(NameOnDisk), dice);
                what += " name";
                break;
            }
            default:
                changeRecords(c, store, dice);
                what += " records";
        }
    return what;
}

namespace {

lod::View lookAt(const glm::dvec3& eye, const glm::dvec3& target, double focal, double nearPlane) {
    lod::View view;
    view.width = 48;
    view.height = 32;
    view.focalPixels = focal;
    view.nearPlane = nearPlane;
    view.eye = eye;
    const glm::dvec3 along = target - eye;
    const double length = glm::length(along);
    view.forward = length > 0 && std::isfinite(length) ? along / length : glm::dvec3(0, 0, -1);
    const glm::dvec3 aside = std::abs(view.forward.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    view.right = glm::normalize(glm::cross(view.forward, aside));
    view.down = glm::cross(view.forward, view.right);
    return view;
}

std::vector<lod::View> viewsOf(const lod::StoreDescription& d) {
    const glm::dvec3 middle = 0.5 * d.focusMin + 0.5 * d.focusMax, size = d.focusMax - d.focusMin;
    const double length = std::max(glm::length(size), 1e-300), near = std::max(1e-300, 1e-6 * length);
    return {lookAt(middle + 1.3 * size, middle, 40, near), lookAt(middle, middle + size, 40, near),
            lookAt(d.focusMin, d.focusMax, 2, near),
            lookAt(middle + glm::dvec3(0, 0, 1e12 * length), middle, 1e9, near),
            lookAt(glm::dvec3(1e200, 0, 0), glm::dvec3(0), 40, 1e-300)};
}

}  // namespace

bool tryEverything(const std::string& path) {
    auto opened = lod::openStore(path);
    if (!opened) return false;
    const auto store = std::make_shared<const lod::Store>(std::move(*opened));
    const auto executor = makeSerialExecutor();
    for (const bool isReference : {false, true}) {
        const auto backend = isReference ? reference::makeReferenceBackend(*executor) : cpu::makeCpuBackend(*executor);
        streaming::StreamSettings stream;
        stream.residentBytes = uint64_t{64} << 20;
        auto state = render::makeFrameState(std::vector{store}, *backend, *executor, stream);
        for (const lod::View& view : viewsOf(store->description)) {
            render::FrameSettings settings;
            settings.wantDepthAndNormal = true;
            settings.draw.worldUp = store->description.up;
            settings.budgets.records = 200'000;
            (void)render::renderUntilComplete(*state, view, settings);
        }
    }
    (void)lod::verifyStore(*store, *executor);
    return true;
}

}  // namespace stipple::test
