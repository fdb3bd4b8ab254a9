// The LAZ decoder against the tests' own encoder, and against bytes that no encoder writes.
#include <gtest/gtest.h>

#include <cstring>
#include <memory>

#include "lod/import/las/header.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/support.h"

namespace stipple::las {
namespace {

using test::LazSpec;

/// All point formats, item versions, with and without extra bytes.
std::vector<LazSpec> allSpecs() {
    std::vector<LazSpec> specs;
    for (unsigned format = 0; format <= 10; ++format)
        for (const uint32_t extra : {0u, 3u})
            for (const int version : format <= 5 ? std::vector<int>{2} : std::vector<int>{3, 4}) {
                LazSpec s;
                s.format = format;
                s.version = static_cast<uint16_t>(version);
                s.extraBytes = extra;
                specs.push_back(s);
            }
    return specs;
}

std::string nameOf(const LazSpec& s) {
    return "format " + std::to_string(s.format) + ", item version " + std::to_string(s.version) + ", " +
           std::to_string(s.extraBytes) + " extra bytes, chunks of " + std::to_string(s.chunkPoints);
}

LazPlan planOf(const LazSpec& s) {
    const auto payload = test::lazPayload(s);
    const auto plan = parseLazPlan(payload.data(), payload.size(), s.format, test::lazRecordBytes(s));
    if (!plan) ADD_FAILURE() << plan.error().line();
    return *plan;
}

Result<std::vector<uint8_t>> decodeFile(const std::vector<uint8_t>& file, uint32_t parts = kLazAll, size_t step = 777) {
    const Bytes in = Bytes::ofMemory(file.data(), file.size());
    STIPPLE_ASSIGN(const LasHeader h, readLasHeader(in, "memory", false));
    STIPPLE_ASSIGN(const std::vector<LazChunk> chunks, readChunkTable(in, *h.laz, h.dataOffset, h.points));
    std::vector<uint8_t> records(h.points * h.recordBytes);
    LazDecoder decoder(*h.laz, parts);
    for (const LazChunk& c : chunks) {
        STIPPLE_TRY(decoder.begin(in, c.begin, c.end, c.count));
        for (uint64_t done = 0; done < c.count;) {
            STIPPLE_ASSIGN(const size_t got, decoder.decode(records.data() + (c.first + done) * h.recordBytes, step));
            done += got;
        }
        STIPPLE_TRY(decoder.finish(true));
    }
    return records;
}

TEST(Laz, EveryFormatComesBackBitByBit) {
    Rng rng(1);
    for (LazSpec spec : allSpecs())
        for (const uint32_t chunk : {1u, 100u, 1500u, 0xffffffffu}) {
            spec.chunkPoints = chunk;
            SCOPED_TRACE(nameOf(spec));
            for (const size_t count : {size_t{1}, size_t{2}, size_t{3000}}) {
                const auto records = test::makeRecords(spec, chunk == 1 ? std::min<size_t>(count, 40) : count, rng);
                const auto decoded = decodeFile(test::encodeLas(spec, records, true, rng));
                ASSERT_TRUE(decoded) << decoded.error().line();
                ASSERT_EQ(*decoded, records);
            }
        }
}

TEST(Laz, LongChunksAdaptEveryModelAndCrossTheReadWindow) {
    Rng rng(2);
    for (const unsigned format : {3u, 8u}) {
        LazSpec spec;
        spec.format = format;
        spec.version = format > 5 ? 3 : 2;
        spec.chunkPoints = 60'000;
        const auto records = test::makeRecords(spec, 130'000, rng);
        const auto decoded = decodeFile(test::encodeLas(spec, records, true, rng));
        ASSERT_TRUE(decoded) << decoded.error().line();
        EXPECT_EQ(*decoded, records);
    }
}

TEST(Laz, LayersThatAreNotWantedChangeNothingElse) {
    Rng rng(3);
    for (LazSpec spec : allSpecs()) {
        if (spec.format < 6) continue;
        SCOPED_TRACE(nameOf(spec));
        const uint32_t bytes = test::lazRecordBytes(spec);
        const auto records = test::makeRecords(spec, 2000, rng);
        const auto file = test::encodeLas(spec, records, true, rng);
        const auto positions = decodeFile(file, kLazPosition);
        const auto flat = decodeFile(file, kLazIntensity | kLazColour);
        ASSERT_TRUE(positions && flat);
        const bool hasColour = spec.format == 7 || spec.format == 8 || spec.format == 10;
        for (size_t i = 0; i < 2000; ++i) {
            ASSERT_EQ(std::memcmp(positions->data() + i * bytes, records.data() + i * bytes, 12), 0) << i;
            ASSERT_EQ(std::memcmp(flat->data() + i * bytes, records.data() + i * bytes, 8), 0) << i;
            ASSERT_EQ(std::memcmp(flat->data() + i * bytes + 12, records.data() + i * bytes + 12, 2), 0) << i;
            if (hasColour)
                ASSERT_EQ(std::memcmp(flat->data() + i * bytes + 30, records.data() + i * bytes + 30, 6), 0) << i;
        }
    }
}

TEST(Laz, EveryTruncatedLengthOfAChunkIsAnError) {
    Rng rng(4);
    for (const LazSpec& spec : allSpecs()) {
        if (spec.extraBytes != 0 && spec.format % 3 != 0) continue;
        SCOPED_TRACE(nameOf(spec));
        constexpr size_t kPoints = 30;
        const auto records = test::makeRecords(spec, kPoints, rng);
        const auto chunk = test::encodeLazChunk(spec, records.data(), kPoints, rng);
        const LazPlan plan = planOf(spec);
        LazDecoder decoder(plan, kLazAll);
        std::vector<uint8_t> out(kPoints * plan.recordBytes);
        for (size_t length = 0; length <= chunk.size(); ++length) {
            // A block of exactly this size: a sanitizer sees every byte read beyond it.
            const std::unique_ptr<uint8_t[]> exact(new uint8_t[length]);
            std::memcpy(exact.get(), chunk.data(), length);
            const Bytes in = Bytes::ofMemory(exact.get(), length);
            bool good = decoder.begin(in, 0, length, kPoints).has_value();
            if (good) good = decoder.decode(out.data(), kPoints).has_value();
            if (good) good = decoder.finish(true).has_value();
            ASSERT_EQ(good, length == chunk.size()) << "length " << length << " of " << chunk.size();
        }
        EXPECT_EQ(out, records);
    }
}

TEST(Laz, EveryTruncatedLengthOfAFileIsAnError) {
    Rng rng(8);
    for (LazSpec spec : allSpecs()) {
        if (spec.extraBytes != 0) continue;
        SCOPED_TRACE(nameOf(spec));
        spec.chunkPoints = 10;
        const auto file = test::encodeLas(spec, test::makeRecords(spec, 25, rng), true, rng);
        for (size_t length = 0; length < file.size(); ++length) {
            const std::vector<uint8_t> exact(file.begin(), file.begin() + static_cast<ptrdiff_t>(length));
            ASSERT_FALSE(decodeFile(exact)) << "length " << length << " of " << file.size();
        }
    }
}

TEST(Laz, ChangedBytesNeverBreakTheDecoder) {
    Rng rng(5);
    size_t noticed = 0, tried = 0;
    for (const LazSpec& spec : allSpecs()) {
        constexpr size_t kPoints = 200;
        const auto records = test::makeRecords(spec, kPoints, rng);
        const auto chunk = test::encodeLazChunk(spec, records.data(), kPoints, rng);
        const LazPlan plan = planOf(spec);
        LazDecoder decoder(plan, kLazAll);
        std::vector<uint8_t> out(kPoints * plan.recordBytes);
        for (int k = 0; k < 200; ++k) {
            auto changed = chunk;
            const size_t at = plan.recordBytes + rng.below(changed.size() - plan.recordBytes);
            changed[at] = static_cast<uint8_t>(changed[at] + 1 + rng.below(255));
            if (k % 4 == 0)
                for (size_t i = at; i < changed.size(); ++i)
                    changed[i] = k % 8 == 0 ? 0xff : static_cast<uint8_t>(rng.next());
            const Bytes in = Bytes::ofMemory(changed.data(), changed.size());
            bool good = decoder.begin(in, 0, changed.size(), kPoints).has_value();
            if (good) good = decoder.decode(out.data(), kPoints).has_value();
            if (good) good = decoder.finish(true).has_value();
            ++tried;
            if (!good) ++noticed;
        }
        // The decoder is fit for use again.
        const Bytes in = Bytes::ofMemory(chunk.data(), chunk.size());
        ASSERT_TRUE(decoder.begin(in, 0, chunk.size(), kPoints));
        ASSERT_TRUE(decoder.decode(out.data(), kPoints));
        ASSERT_EQ(out, records);
    }
    // There is no checksum in LAZ; that a chunk's points end where its bytes do is what gives most damage away.
    EXPECT_GT(noticed, tried * 17 / 20) << noticed << " of " << tried;
}

TEST(Laz, ChunkTablesThatLieAreRefused) {
    Rng rng(6);
    LazSpec spec;
    spec.chunkPoints = 50;
    const auto records = test::makeRecords(spec, 500, rng);
    const auto file = test::encodeLas(spec, records, true, rng);
    const Bytes in = Bytes::ofMemory(file.data(), file.size());
    const auto header = readLasHeader(in, "memory", false);
    ASSERT_TRUE(header);
    int64_t table = 0;
    std::memcpy(&table, file.data() + header->dataOffset, 8);
    const auto withChange = [&](size_t at, auto value) {
        auto changed = file;
        std::memcpy(changed.data() + at, &value, sizeof(value));
        return decodeFile(changed);
    };
    const auto expectRefused = [&](const Result<std::vector<uint8_t>>& r, const char* text) {
        ASSERT_FALSE(r);
        EXPECT_NE(r.error().line().find(text), std::string::npos) << r.error().line();
    };
    expectRefused(withChange(header->dataOffset, int64_t{1} << 50), "chunk table");
    expectRefused(withChange(header->dataOffset, int64_t{3}), "chunk table");
    expectRefused(withChange(static_cast<size_t>(table), uint32_t{7}), "version 7");
    for (const uint32_t count : {0u, 9u, 11u, 0xffffffffu})
        expectRefused(withChange(static_cast<size_t>(table) + 4, count), "chunk table");
    expectRefused(withChange(247, uint64_t{501}), "chunk table");
    expectRefused(withChange(247, uint64_t{1} << 60), "cannot hold");
    for (size_t at = static_cast<size_t>(table) + 8; at < file.size(); ++at)
        for (int k = 0; k < 8; ++k) {  // an error, or (a change that cancels out) the right points
            const auto r = withChange(at, static_cast<uint8_t>(rng.next()));
            if (r) EXPECT_EQ(*r, records);
        }
}

TEST(Laz, RecordsOfTheCompressorAreChecked) {
    LazSpec spec;
    const auto payload = test::lazPayload(spec);
    const uint32_t bytes = test::lazRecordBytes(spec);
    const auto refusal = [&](const std::vector<uint8_t>& p, unsigned format, uint32_t recordBytes) {
        const auto plan = parseLazPlan(p.data(), p.size(), format, recordBytes);
        return plan ? std::string("none") : plan.error().line();
    };
    EXPECT_EQ(refusal(payload, 2, bytes), "none");
    const auto changed = [&](size_t at, uint8_t value) {
        auto p = payload;
        p[at] = value;
        return refusal(p, 2, bytes);
    };
    EXPECT_NE(changed(0, 9).find("compressor 9"), std::string::npos);
    EXPECT_NE(changed(2, 1).find("coder 1"), std::string::npos);
    EXPECT_NE(changed(32, 3).find("3 items"), std::string::npos);
    EXPECT_NE(changed(34, 99).find("unknown type 99"), std::string::npos);
    EXPECT_NE(changed(36, 21).find("21 bytes"), std::string::npos);
    EXPECT_NE(changed(38, 3).find("version 3"), std::string::npos);
    EXPECT_NE(refusal(payload, 3, bytes).find("point format 3"), std::string::npos);
    EXPECT_NE(refusal(payload, 2, bytes + 1).find("the records 27"), std::string::npos);
    EXPECT_NE(refusal({payload.begin(), payload.begin() + 20}, 2, bytes).find("20 bytes"), std::string::npos);
    LazSpec fat;
    fat.extraBytes = 3000;
    EXPECT_NE(refusal(test::lazPayload(fat), 2, test::lazRecordBytes(fat)).find("3000 extra bytes"), std::string::npos);
}

}  // namespace
}  // namespace stipple::las
