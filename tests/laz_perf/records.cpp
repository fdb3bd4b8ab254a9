// Our LAS and LAZ reader as a program, for comparisons:
//   laz_records records FILE OUT       the records of a LAZ file as they would stand in LAS
//   laz_records bench PATH REPEATS     seconds (median) to read a file or folder: positions and colour, everything
//   laz_records write FILE FORMAT N    a LAZ file of N points (LAS if FILE ends in .las), from the tests' encoder
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <string>

#include "engine/base/executor.h"
#include "engine/base/file.h"
#include "engine/base/process.h"
#include "lod/import/import.h"
#include "lod/import/las/header.h"
#include "tests/support/laz_encoder.h"

namespace stipple {
namespace {

Result<void> writeRecords(const std::string& path, const std::string& out) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    const las::Bytes bytes{file.sizeBytes(),
                           [&](uint64_t at, void* to, size_t count) { return file.readAt(at, to, count); }};
    STIPPLE_ASSIGN(const las::LasHeader h, las::readLasHeader(bytes, path, false));
    if (!h.laz) return fail(ErrorKind::usage, "is not compressed", path);
    STIPPLE_ASSIGN(const std::vector<las::LazChunk> chunks, las::readChunkTable(bytes, *h.laz, h.dataOffset, h.points));
    las::LazDecoder decoder(*h.laz, las::kLazAll);
    std::vector<uint8_t> records(h.points * h.recordBytes);
    for (const las::LazChunk& c : chunks) {
        STIPPLE_TRY(decoder.begin(bytes, c.begin, c.end, c.count));
        STIPPLE_TRY(decoder.decode(records.data() + c.first * h.recordBytes, c.count));
        STIPPLE_TRY(decoder.finish(true));
    }
    return writeWholeFile(out, records.data(), records.size());
}

/// Reads every part of every source; seconds.
Result<double> timeOnce(const std::vector<std::string>& files, bool everything, Executor& executor, uint64_t& points) {
    const double start = nowSeconds();
    points = 0;
    std::vector<lod::PointSource> sources;
    std::vector<std::pair<size_t, size_t>> parts;
    for (const std::string& path : files) {
        STIPPLE_ASSIGN(lod::PointSource source, lod::openPointSource(path));
        if (everything) {
            lod::ReadOptions all;
            for (const lod::AttributeInfo& a : source.info.attributes) all.attributes.push_back(a.name);
            STIPPLE_ASSIGN(source, lod::openPointSource(path, all));
        }
        points += source.info.points;
        for (size_t p = 0; p < source.parts.size(); ++p) parts.emplace_back(sources.size(), p);
        sources.push_back(std::move(source));
    }
    std::atomic<uint64_t> got{0};
    executor.parallelFor(parts.size(), 1, [&](size_t begin, size_t end) {
        lod::PointBlock block;
        for (size_t i = begin; i < end; ++i) {
            const auto read = sources[parts[i].first].openPart(parts[i].second);
            for (size_t count = read ? 1 : 0; count > 0;) {
                block.clear();
                count = (*read)(block, 65536).value_or(0);
                got += count;
            }
        }
    });
    if (got != points)
        return fail(ErrorKind::input, fmt::format("{} of {} points were read", got.load(), points), files[0]);
    return nowSeconds() - start;
}

Result<void> bench(const std::string& path, int repeats) {
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs({path}));
    const auto one = makeSerialExecutor(), two = makeTbbExecutor(2);
    uint64_t points = 0;
    const auto median = [&](bool everything, Executor& executor) -> Result<double> {
        std::vector<double> seconds;
        for (int i = 0; i < repeats; ++i) {
            STIPPLE_ASSIGN(const double s, timeOnce(files, everything, executor, points));
            seconds.push_back(s);
        }
        std::sort(seconds.begin(), seconds.end());
        return seconds[seconds.size() / 2];
    };
    STIPPLE_ASSIGN(const double colourOne, median(false, *one));
    STIPPLE_ASSIGN(const double colourTwo, median(false, *two));
    STIPPLE_ASSIGN(const double allOne, median(true, *one));
    // The floor of an uncompressed file: the same bytes through the same reads, without a look at them.
    std::vector<uint8_t> buffer(size_t{4} << 20);
    double bytes = 0;
    const double start = nowSeconds();
    for (const std::string& name : files) {
        STIPPLE_ASSIGN(const InputFile file, InputFile::open(name));
        for (uint64_t at = 0; at < file.sizeBytes(); at += buffer.size())
            STIPPLE_TRY(file.readAt(at, buffer.data(), std::min<uint64_t>(buffer.size(), file.sizeBytes() - at)));
        bytes += static_cast<double>(file.sizeBytes());
    }
    fmt::print(
        R"({{"points": {}, "bytes": {}, "colour_one_core_s": {}, "colour_two_cores_s": {}, "all_one_core_s": {}, )"
        R"("read_only_s": {}, "peak_rss_bytes": {}}})"
        "\n",
        points, bytes, colourOne, colourTwo, allOne, nowSeconds() - start, peakRssBytes());
    return {};
}

Result<void> write(const std::string& path, unsigned format, size_t points) {
    Rng rng(1);
    test::LazSpec spec;
    spec.format = format;
    spec.version = format > 5 ? 3 : 2;
    spec.chunkPoints = 50'000;
    const bool compressed = path.size() < 4 || path.substr(path.size() - 4) != ".las";
    const auto file = test::encodeLas(spec, test::makeRecords(spec, points, rng), compressed, rng);
    return writeWholeFile(path, file.data(), file.size());
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
    const std::string what = argc > 1 ? argv[1] : "";
    stipple::Result<void> result = stipple::fail(
        stipple::ErrorKind::usage, "usage: laz_records records FILE OUT | bench PATH N | write FILE FORMAT N");
    if (what == "records" && argc == 4) result = stipple::writeRecords(argv[2], argv[3]);
    if (what == "bench" && argc == 4) result = stipple::bench(argv[2], std::stoi(argv[3]));
    if (what == "write" && argc == 5)
        result = stipple::write(argv[2], static_cast<unsigned>(std::stoi(argv[3])), std::stoull(argv[4]));
    if (result) return 0;
    std::fprintf(stderr, "%s\n", result.error().line().c_str());
    return static_cast<int>(result.error().kind);
}
