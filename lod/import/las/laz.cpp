#include "lod/import/las/laz.h"

#include <fmt/format.h>

#include "lod/import/las/chunk_reader.h"

namespace stipple::las {
namespace {

template <typename T>
T get(const uint8_t* at) {
    T value{};
    std::memcpy(&value, at, sizeof(T));
    return value;
}

auto bad(const std::string& what, const std::string& hint = "") { return fail(ErrorKind::input, what, "", hint); }

/// Size and versions of an item type; zero bytes: any.
struct ItemKind {
    LazItemType type;
    uint16_t bytes, least, most;
    bool layered;
};
constexpr std::array<ItemKind, 9> kItemKinds{{{LazItemType::bytes, 0, 1, 2, false},
                                              {LazItemType::point10, 20, 1, 2, false},
                                              {LazItemType::gpsTime11, 8, 1, 2, false},
                                              {LazItemType::rgb12, 6, 1, 2, false},
                                              {LazItemType::wavePacket13, 29, 1, 1, false},
                                              {LazItemType::point14, 30, 3, 4, true},
                                              {LazItemType::rgb14, 6, 3, 4, true},
                                              {LazItemType::rgbNir14, 8, 3, 4, true},
                                              {LazItemType::bytes14, 0, 3, 4, true}}};
constexpr ItemKind kWave14{LazItemType::wavePacket14, 29, 3, 4, true};

const ItemKind* kindOf(uint16_t type) {
    if (type == static_cast<uint16_t>(kWave14.type)) return &kWave14;
    for (const ItemKind& k : kItemKinds)
        if (static_cast<uint16_t>(k.type) == type) return &k;
    return nullptr;
}

/// The items that a point format consists of, extra bytes apart.
std::vector<LazItemType> itemsOf(unsigned format) {
    std::vector<LazItemType> items;
    if (format <= 5) {
        items.push_back(LazItemType::point10);
        if (format == 1 || format >= 3) items.push_back(LazItemType::gpsTime11);
        if (format == 2 || format == 3 || format == 5) items.push_back(LazItemType::rgb12);
        if (format >= 4) items.push_back(LazItemType::wavePacket13);
    } else {
        items.push_back(LazItemType::point14);
        if (format == 7) items.push_back(LazItemType::rgb14);
        if (format == 8 || format == 10) items.push_back(LazItemType::rgbNir14);
        if (format >= 9) items.push_back(LazItemType::wavePacket14);
    }
    return items;
}

}  // namespace

Result<LazPlan> parseLazPlan(const uint8_t* payload, size_t count, unsigned pointFormat, uint32_t recordBytes) {
    constexpr size_t kHeadBytes = 34;
    if (count < kHeadBytes)
        return bad(fmt::format("the laszip record has {} bytes, at least {} are needed", count, kHeadBytes));
    const auto compressor = get<uint16_t>(payload), coder = get<uint16_t>(payload + 2);
    const auto items = get<uint16_t>(payload + 32);
    if (compressor < 1 || compressor > 3)
        return bad(fmt::format("the laszip record names compressor {}; 1 (pointwise), 2 (chunked), 3 (layered) exist",
                               compressor));
    if (coder != 0) return bad(fmt::format("the laszip record names coder {}; only 0 (arithmetic) exists", coder));
    if (count < kHeadBytes + 6 * size_t{items})
        return bad(fmt::format("the laszip record declares {} items, but {} bytes hold {}", items, count,
                               (count - kHeadBytes) / 6));
    LazPlan plan;
    plan.form = static_cast<LazForm>(compressor);
    plan.recordBytes = recordBytes;
    plan.chunkPoints = get<uint32_t>(payload + 12);
    if (plan.chunkPoints == 0) plan.chunkPoints = LazPlan::kVariableChunks;
    const std::vector<LazItemType> expected = itemsOf(pointFormat);
    uint32_t bytes = 0, extra = 0;
    for (size_t i = 0; i < items; ++i) {
        const uint8_t* at = payload + kHeadBytes + 6 * i;
        const LazItem item{get<uint16_t>(at), get<uint16_t>(at + 2), get<uint16_t>(at + 4)};
        const ItemKind* kind = kindOf(item.type);
        const bool layered = plan.form == LazForm::layered;
        if (kind == nullptr)
            return bad(fmt::format("item {} of the laszip record has the unknown type {}", i, item.type));
        if (kind->layered != layered || item.version < kind->least || item.version > kind->most)
            return bad(
                fmt::format("item {} of the laszip record (type {}) has version {}; with compressor {} {} to {} are "
                            "read",
                            i, item.type, item.version, compressor, kind->least, kind->most));
        if (kind->bytes != 0 && kind->bytes != item.bytes)
            return bad(fmt::format("item {} of the laszip record (type {}) has {} bytes, expected {}", i, item.type,
                                   item.bytes, kind->bytes));
        const bool isExtra = kind->bytes == 0;
        if (i < expected.size() ? kind->type != expected[i] : !isExtra)
            return bad(fmt::format("item {} of the laszip record (type {}) does not belong to point format {}", i,
                                   item.type, pointFormat));
        if (isExtra) extra += item.bytes;
        bytes += item.bytes;
        plan.items.push_back(item);
    }
    if (plan.items.size() < expected.size())
        return bad(fmt::format("the laszip record has {} items, point format {} needs {}", items, pointFormat,
                               expected.size()));
    if (bytes != recordBytes)
        return bad(fmt::format("the items of the laszip record have {} bytes, the records {}", bytes, recordBytes));
    if (extra > LazPlan::kMostExtraBytes)
        return bad(fmt::format("the points have {} extra bytes each; compressed, at most {} are read", extra,
                               LazPlan::kMostExtraBytes),
                   "unpack the file to LAS first");
    return plan;
}

LazDecoder::LazDecoder(const LazPlan& plan, uint32_t parts)
    : reader_(plan.form == LazForm::layered ? makeLayeredReader(plan, parts) : makeSequentialReader(plan)) {}
LazDecoder::LazDecoder(LazDecoder&&) noexcept = default;
LazDecoder& LazDecoder::operator=(LazDecoder&&) noexcept = default;
LazDecoder::~LazDecoder() = default;

Result<void> LazDecoder::begin(const Bytes& in, uint64_t begin, uint64_t end, uint64_t points) {
    left_ = points;
    return reader_->begin(in, begin, end, points);
}

Result<size_t> LazDecoder::decode(uint8_t* records, size_t limit) {
    const auto count = static_cast<size_t>(std::min<uint64_t>(limit, left_));
    if (count == 0) return size_t{0};
    STIPPLE_TRY(reader_->decode(records, count));
    left_ -= count;
    return count;
}

Result<void> LazDecoder::finish(bool endKnown) const { return reader_->finish(endKnown); }
uint64_t LazDecoder::endOfChunk() const { return reader_->endOfChunk(); }

Result<std::vector<LazChunk>> readChunkTable(const Bytes& in, const LazPlan& plan, uint64_t dataBegin,
                                             uint64_t points) {
    std::vector<LazChunk> chunks;
    if (plan.form == LazForm::pointwise || points == 0) return chunks;
    const bool variable = plan.chunkPoints == LazPlan::kVariableChunks;
    const uint64_t chunksBegin = dataBegin + 8;
    int64_t at = 0;
    if (chunksBegin > in.size)
        return bad(fmt::format("the points begin at {}, but the file has {} bytes", dataBegin, in.size));
    STIPPLE_TRY(in.readAt(dataBegin, &at, 8));
    if (at == -1 && in.size >= chunksBegin + 8) STIPPLE_TRY(in.readAt(in.size - 8, &at, 8));
    if (at <= 0 || static_cast<uint64_t>(at) == dataBegin) {
        if (variable)
            return bad("the file has chunks of different sizes but no chunk table",
                       "its writer was interrupted; there is nothing to find the chunks by");
        return chunks;
    }
    const auto table = static_cast<uint64_t>(at);
    if (table < chunksBegin || table + 8 > in.size)
        return bad(
            fmt::format("the chunk table is said to lie at offset {}, but the file has {} bytes", table, in.size),
            "the file is truncated");
    std::array<uint32_t, 2> head{};
    STIPPLE_TRY(in.readAt(table, head.data(), 8));
    const uint32_t count = head[1];
    const uint64_t most = (table - chunksBegin) / plan.recordBytes;
    if (head[0] != 0)
        return bad(fmt::format("the chunk table at offset {} has version {}, expected 0", table, head[0]));
    if (count > most)
        return bad(fmt::format("the chunk table at offset {} declares {} chunks, but {} bytes hold at most {}", table,
                               count, table - chunksBegin, most));
    if (!variable && count != (points + plan.chunkPoints - 1) / plan.chunkPoints)
        return bad(fmt::format("the chunk table declares {} chunks of {} points, the header {} points", count,
                               plan.chunkPoints, points));
    Decoder decoder;
    STIPPLE_TRY(decoder.stream.open(in, table + 8, in.size, 64));
    decoder.begin();
    IntegerModel numbers;
    numbers.make(32, 2);
    int32_t lastCount = 0, lastBytes = 0;
    uint64_t byte = chunksBegin, point = 0;
    for (uint32_t i = 0; i < count; ++i) {
        STIPPLE_TRY(decoder.stream.ensure());
        if (variable) lastCount = numbers.decode(decoder, lastCount, 0);
        lastBytes = numbers.decode(decoder, lastBytes, 1);
        const auto bytes = static_cast<uint32_t>(lastBytes);
        const uint64_t pointsHere =
            variable ? static_cast<uint32_t>(lastCount) : std::min<uint64_t>(plan.chunkPoints, points - point);
        if (bytes > table - byte || pointsHere > points - point || pointsHere > bytes * kMostPointsPerByte)
            return bad(fmt::format("chunk {} of {} ({} points, {} bytes) reaches beyond the {} points or the {} bytes "
                                   "that there are",
                                   i, count, pointsHere, bytes, points, table - chunksBegin),
                       "the chunk table is damaged");
        if (pointsHere > 0) chunks.push_back({byte, byte + bytes, point, pointsHere});
        byte += bytes;
        point += pointsHere;
    }
    if (decoder.corrupt()) return bad(fmt::format("the chunk table at offset {} is cut short", table));
    if (point != points)
        return bad(fmt::format("the chunks hold {} points, the header declares {}", point, points),
                   "the chunk table or the header is damaged");
    return chunks;
}

}  // namespace stipple::las
