#include "tests/support/laz_encoder.h"

#include "tests/support/laz_items.h"

namespace stipple::test {
namespace {

using laz::load;
using laz::put;
using laz::store;

struct Item {
    uint16_t type, bytes;
};

std::vector<Item> itemsOf(const LazSpec& s) {
    std::vector<Item> items;
    if (s.format <= 5) {
        items.push_back({6, 20});
        if (s.format == 1 || s.format >= 3) items.push_back({7, 8});
        if (s.format == 2 || s.format == 3 || s.format == 5) items.push_back({8, 6});
        if (s.format >= 4) items.push_back({9, 29});
        if (s.extraBytes > 0) items.push_back({0, static_cast<uint16_t>(s.extraBytes)});
    } else {
        items.push_back({10, 30});
        if (s.format == 7) items.push_back({11, 6});
        if (s.format == 8 || s.format == 10) items.push_back({12, 8});
        if (s.format >= 9) items.push_back({13, 29});
        if (s.extraBytes > 0) items.push_back({14, static_cast<uint16_t>(s.extraBytes)});
    }
    return items;
}

}  // namespace

uint32_t lazRecordBytes(const LazSpec& spec) {
    uint32_t bytes = 0;
    for (const Item& item : itemsOf(spec)) bytes += item.bytes;
    return bytes;
}

std::vector<uint8_t> makeRecords(const LazSpec& spec, size_t count, Rng& rng) {
    const uint32_t bytes = lazRecordBytes(spec);
    std::vector<uint8_t> records(count * bytes);
    const bool isNew = spec.format >= 6;
    const bool wild = rng.below(3) == 0;
    int64_t time = static_cast<int64_t>(rng.next() >> 2);
    for (size_t i = 0; i < count; ++i) {
        uint8_t* p = records.data() + i * bytes;
        if (i > 0) std::memcpy(p, p - bytes, bytes);
        for (size_t a = 0; a < 3; ++a) {
            const uint64_t spread = wild && rng.below(50) == 0 ? uint64_t{1} << 32 : uint64_t{1} << rng.below(12);
            store(p + 4 * a, static_cast<int32_t>(load<uint32_t>(p + 4 * a) + static_cast<uint32_t>(rng.below(spread)) -
                                                  static_cast<uint32_t>(spread / 2)));
        }
        // Now and then each of the other bytes changes; in wild runs to anything.
        for (size_t k = 12; k < bytes; ++k)
            if (rng.below(wild ? 4 : 12) == 0) p[k] = static_cast<uint8_t>(wild ? rng.next() : p[k] + rng.below(5));
        if (rng.below(3) == 0) time += static_cast<int64_t>(rng.below(1000));
        if (rng.below(200) == 0) time = static_cast<int64_t>(rng.next());
        if (isNew)
            store(p + 22, time);
        else if (spec.format == 1 || spec.format >= 3)
            store(p + 20, time);
        if (spec.format >= 4 && spec.format <= 5 && rng.below(2) == 0) {  // packets one after the other
            const size_t at = spec.format == 4 ? 28 : 34;
            if (i > 0) store(p + at + 1, load<uint64_t>(p - bytes + at + 1) + load<uint32_t>(p - bytes + at + 9));
        }
    }
    return records;
}

std::vector<uint8_t> encodeLazChunk(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng) {
    return spec.format >= 6 ? laz::encodeLayered(spec, records, count, rng)
                            : laz::encodeSequential(spec, records, count, rng);
}

std::vector<uint8_t> lazPayload(const LazSpec& spec) {
    std::vector<uint8_t> out;
    put<uint16_t>(out, spec.format >= 6 ? 3 : 2);
    put<uint16_t>(out, 0);
    put<uint32_t>(out, 0x00000302u);  // version 2.3, revision 0
    put<uint32_t>(out, 0);
    put<uint32_t>(out, spec.chunkPoints);
    put<int64_t>(out, -1);
    put<int64_t>(out, -1);
    const std::vector<Item> items = itemsOf(spec);
    put(out, static_cast<uint16_t>(items.size()));
    for (const Item& item : items) {
        put(out, item.type);
        put(out, item.bytes);
        const bool hasOneVersion = item.type == 9;
        put(out, hasOneVersion ? uint16_t{1} : spec.version);
    }
    return out;
}

std::vector<uint8_t> encodeLas(const LazSpec& spec, const std::vector<uint8_t>& records, bool compressed, Rng& rng) {
    const uint32_t bytes = lazRecordBytes(spec);
    const auto count = static_cast<uint32_t>(records.size() / bytes);
    const std::vector<uint8_t> payload = compressed ? lazPayload(spec) : std::vector<uint8_t>();
    const uint16_t headerBytes = 375;
    const auto dataOffset = static_cast<uint32_t>(headerBytes + (compressed ? 54 + payload.size() : 0));
    std::vector<uint8_t> out(dataOffset);
    std::memcpy(out.data(), "LASF", 4);
    out[24] = 1;
    out[25] = 4;
    std::memcpy(out.data() + 58, "stipple tests", 13);
    store(out.data() + 94, headerBytes);
    store(out.data() + 96, dataOffset);
    store<uint32_t>(out.data() + 100, compressed ? 1 : 0);
    out[104] = static_cast<uint8_t>(spec.format | (compressed ? 0x80u : 0u));
    store(out.data() + 105, static_cast<uint16_t>(bytes));
    if (spec.format <= 5) store(out.data() + 107, count);
    store<uint64_t>(out.data() + 247, count);
    std::array<uint64_t, 15> byReturn{};
    for (int a = 0; a < 3; ++a) {
        int32_t least = INT32_MAX, greatest = INT32_MIN;
        for (size_t i = 0; i < count; ++i) {
            const auto v = load<int32_t>(records.data() + i * bytes + 4 * static_cast<size_t>(a));
            least = std::min(least, v);
            greatest = std::max(greatest, v);
        }
        store(out.data() + 131 + 8 * a, spec.scale);
        store(out.data() + 155 + 8 * a, spec.offset);
        store(out.data() + 179 + 16 * a, greatest * spec.scale + spec.offset);
        store(out.data() + 187 + 16 * a, least * spec.scale + spec.offset);
    }
    for (size_t i = 0; i < count; ++i) {
        const uint32_t r = records[i * bytes + 14] & (spec.format >= 6 ? 15u : 7u);
        if (r > 0) ++byReturn.at(r - 1);
    }
    std::memcpy(out.data() + 255, byReturn.data(), sizeof(byReturn));
    if (!compressed) {
        out.insert(out.end(), records.begin(), records.end());
        return out;
    }
    std::memcpy(out.data() + headerBytes + 2, "laszip encoded", 14);
    store<uint16_t>(out.data() + headerBytes + 18, 22204);
    store(out.data() + headerBytes + 20, static_cast<uint16_t>(payload.size()));
    std::memcpy(out.data() + headerBytes + 54, payload.data(), payload.size());
    put<int64_t>(out, dataOffset);  // as an interrupted writer leaves it
    const bool variable = spec.chunkPoints == 0xffffffffu;
    laz::Encoder table;
    laz::Integer numbers(32, 2);
    int32_t lastCount = 0, lastBytes = 0;
    uint32_t chunks = 0;
    for (size_t first = 0; first < count; ++chunks) {
        const size_t want = variable ? 1 + rng.below(400) : spec.chunkPoints;
        const size_t here = std::min<size_t>(want, count - first);
        const std::vector<uint8_t> chunk = encodeLazChunk(spec, records.data() + first * bytes, here, rng);
        out.insert(out.end(), chunk.begin(), chunk.end());
        if (variable) numbers.encode(table, lastCount, static_cast<int32_t>(here), 0);
        numbers.encode(table, lastBytes, static_cast<int32_t>(chunk.size()), 1);
        lastCount = static_cast<int32_t>(here);
        lastBytes = static_cast<int32_t>(chunk.size());
        first += here;
    }
    if (!spec.hasTable) return out;
    store(out.data() + dataOffset, static_cast<int64_t>(out.size()));
    put<uint32_t>(out, 0);
    put(out, chunks);
    const std::vector<uint8_t> coded = table.finish();
    out.insert(out.end(), coded.begin(), coded.end());
    return out;
}

}  // namespace stipple::test
