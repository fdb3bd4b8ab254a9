// Files that lie: never a crash, and never more memory than the file justifies. This program counts what is allocated.
#include <gtest/gtest.h>
#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <new>

#include "lod/import/import.h"
#include "lod/store/patch_bytes.h"
#include "lod/store/smooth_streams.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/support.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kCounts = false;  // the sanitizer has its own allocator
#else
constexpr bool kCounts = true;
std::atomic<size_t> live{0}, peak{0};

void* operator new(size_t bytes) {
    void* p = std::malloc(bytes);
    if (!p) throw std::bad_alloc();
    const size_t now = live += malloc_usable_size(p);
    size_t before = peak;
    while (now > before && !peak.compare_exchange_weak(before, now)) {
    }
    return p;
}
void operator delete(void* p) noexcept {
    if (p) live -= malloc_usable_size(p);
    std::free(p);
}
void operator delete(void* p, size_t) noexcept { operator delete(p); }
#endif

namespace stipple::lod {
namespace {

/// What opening and reading a file allocates at its peak.
size_t memoryToRead(const std::string& path, bool skipBad) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    peak = live.load();
    const size_t before = live;
#endif
    ReadOptions options;
    options.attributes = {"intensity", "gps_time", "classification"};
    options.skipBad = skipBad;
    if (const auto source = openPointSource(path, options)) {
        const auto read = readPoints(*source);
        if (!read) EXPECT_EQ(read.error().line().find('\n'), std::string::npos) << path;
    } else {
        EXPECT_EQ(source.error().line().find('\n'), std::string::npos) << path;
    }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    return peak - before;
#else
    return 0;
#endif
}

void expectModest(const std::string& path) {
    const size_t allowed = std::max<size_t>(size_t{16} << 20, 2 * std::filesystem::file_size(path));
    for (const bool skipBad : {false, true}) EXPECT_LE(memoryToRead(path, skipBad), allowed) << path;
}

TEST(Hostile, EveryBrokenFileOfTheDataFolderIsSurvivedWithModestMemory) {
    const std::string root = test::dataFile("09_hostile");
    if (root.empty()) return;
    size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const std::string extension = entry.path().extension();
        if (extension != ".las" && extension != ".laz" && extension != ".ply") continue;
        expectModest(entry.path());
        ++files;
    }
    EXPECT_GT(files, 50u);
}

TEST(Hostile, ChangedHeadersOfEveryFormatAreSurvivedWithModestMemory) {
    const test::TempFolder folder;
    Rng rng(11);
    for (unsigned format = 0; format <= 10; ++format)
        for (const bool compressed : {false, true}) {
            test::LazSpec spec;
            spec.format = format;
            spec.version = format > 5 ? 3 : 2;
            spec.extraBytes = 2;
            spec.chunkPoints = 20;
            const auto file = test::encodeLas(spec, test::makeRecords(spec, 60, rng), compressed, rng);
            for (int k = 0; k < 150; ++k) {
                auto changed = file;
                for (uint64_t n = 1 + rng.below(3); n > 0; --n) {
                    // The fields that sizes hang on, and anything.
                    static constexpr std::array<size_t, 12> fields{94,  96,  100, 104, 105, 107,
                                                                   235, 243, 247, 131, 155, 375};
                    const size_t at = rng.below(2) == 0 ? fields.at(rng.below(fields.size())) + rng.below(8)
                                                        : rng.below(changed.size());
                    if (at < changed.size())
                        changed[at] = rng.below(3) == 0 ? uint8_t{0xff} : static_cast<uint8_t>(rng.next());
                }
                if (k % 5 == 0) changed.resize(rng.below(changed.size()));
                std::ofstream(folder / "a.laz", std::ios::binary)
                    .write(reinterpret_cast<const char*>(changed.data()), static_cast<std::streamsize>(changed.size()));
                expectModest(folder / "a.laz");
            }
        }
}

TEST(Hostile, ABuildAllocatesNothingForPointsThatAreOnlyPromised) {
    const test::TempFolder folder;
    Rng rng(7);
    test::LazSpec spec;
    spec.hasTable = false;
    auto file = test::encodeLas(spec, test::makeRecords(spec, 40, rng), true, rng);
    const uint64_t promised = 8'000'000;  // 200 MB of cloud from some kilobytes
    std::memcpy(file.data() + 107, &promised, 4);
    std::memcpy(file.data() + 247, &promised, 8);
    file.resize(12'000);
    std::ofstream(folder / "a.laz", std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
    const auto executor = makeSerialExecutor();
    Progress silent(false);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    peak = live.load();
    const size_t before = live;
#endif
    const auto built = buildStore({folder / "a.laz"}, folder / "a.stipple", {}, *executor, silent);
    ASSERT_FALSE(built);
    EXPECT_NE(built.error().line().find("a.laz"), std::string::npos) << built.error().line();
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_LE(peak - before, size_t{16} << 20);
#endif
}

/// A payload of patches: one of so many samples each way, of which 128 x 128 cells are drawn, with a map of 8 x 8
/// texels a cell. Written without ever making the map.
std::vector<uint8_t> patchWithMap(uint32_t side) {
    constexpr uint32_t kDrawn = 128;
    Patch p;
    p.width = p.height = side;
    p.cells.assign(size_t{side - 1} * (side - 1), 0);
    p.heights.assign(size_t{side} * side, 0);
    p.normals = p.colours = std::vector<uint32_t>(p.heights.size(), 0);
    for (uint32_t j = 0; j <= kDrawn; ++j)
        for (uint32_t i = 0; i <= kDrawn; ++i) {
            if (i < kDrawn && j < kDrawn) p.cells[size_t{j} * (side - 1) + i] = 1;
            p.heights[p.at(i, j)] = 7;
        }
    std::vector<uint8_t> out = encodePatches(std::span(&p, 1)).bytes;
    std::array<uint32_t, 10> sizes{};  // of five streams, packed and plain; colours are the last
    constexpr size_t kHasMaps = 7, kSizes = 8;
    std::memcpy(sizes.data(), out.data() + kSizes, sizeof(sizes));
    const std::vector<uint8_t> none = streams::compress({});
    out.resize(out.size() - sizes[4]);
    out.insert(out.end(), none.begin(), none.end());
    sizes[4] = static_cast<uint32_t>(none.size());
    sizes[9] = 0;
    std::memcpy(out.data() + kSizes, sizes.data(), sizeof(sizes));
    out[kHasMaps] = 1;
    const size_t texels = size_t{8 * kDrawn + 1} * (8 * kDrawn + 1);
    const std::array<std::vector<uint8_t>, 4> plain{std::vector<uint8_t>{3}, std::vector<uint8_t>(3 * texels), {}, {}};
    std::vector<uint32_t> mapSizes;
    std::vector<uint8_t> packed;
    for (const auto& stream : plain) {
        const std::vector<uint8_t> bytes = streams::compress(stream);
        packed.insert(packed.end(), bytes.begin(), bytes.end());
        mapSizes.push_back(static_cast<uint32_t>(bytes.size()));
    }
    for (const auto& stream : plain) mapSizes.push_back(static_cast<uint32_t>(stream.size()));
    const auto count = static_cast<uint32_t>(packed.size() + mapSizes.size() * sizeof(uint32_t));
    const auto* first = reinterpret_cast<const uint8_t*>(&count);
    out.insert(out.begin() + kSizes + sizeof(sizes), first, first + sizeof(count));
    first = reinterpret_cast<const uint8_t*>(mapSizes.data());
    out.insert(out.end(), first, first + mapSizes.size() * sizeof(uint32_t));
    out.insert(out.end(), packed.begin(), packed.end());
    return out;
}

TEST(Hostile, MapsOfPatchesThatClaimGigabytesAreRefusedBeforeTheyAreTaken) {
    constexpr uint32_t kBlocks = 8 * 16;
    const auto memoryOf = [](uint32_t side, const PatchLimits& told, bool isRead) {
        const std::vector<uint8_t> bytes = patchWithMap(side);
        EXPECT_LT(bytes.size(), 10'000u);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        peak = live.load();
        const size_t before = live;
#endif
        EXPECT_EQ(decodePatches(bytes, "here", told).has_value(), isRead) << side;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        return peak - before;
#else
        return size_t{0};
#endif
    };
    // As large as what it draws: it is read, if the table tells of it.
    EXPECT_LE(memoryOf(129, {}, true), size_t{64} << 20);
    EXPECT_LE(memoryOf(129, {kBlocks, 3}, true), size_t{64} << 20);
    EXPECT_LE(memoryOf(129, {kBlocks, 2}, false), size_t{8} << 20) << "finer maps than are told";
    EXPECT_LE(memoryOf(129, {kBlocks - 1, 3}, false), size_t{8} << 20) << "more blocks than are told";
    // 2000 x 2000 samples would be 256 million texels, 9 bytes each.
    for (const uint32_t side : {500u, 1000u, 2000u})
        for (const PatchLimits& told : {PatchLimits{}, PatchLimits{kBlocks, 7}})
            EXPECT_LE(memoryOf(side, told, false), size_t{64} << 20) << side;
}

TEST(Hostile, TheCountingWorks) {
    if (!kCounts) return;
    const test::TempFolder folder;
    Rng rng(1);
    test::LazSpec spec;
    spec.chunkPoints = 60'000;
    const auto file = test::encodeLas(spec, test::makeRecords(spec, 60'000, rng), true, rng);
    std::ofstream(folder / "a.laz", std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
    EXPECT_GT(memoryToRead(folder / "a.laz", false), 60'000u * 26) << "the records of one block at least";
}

}  // namespace
}  // namespace stipple::lod
