// What the survey of a build keeps: who asks for places alone needs the file no more, and nobody that of compressed
// ones.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <utility>
#include <vector>

#include "lod/builder/points/input.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

constexpr size_t kPoints = 20'000;  // of several chunks, and of several blocks of a reader

void writeScan(const std::string& path, bool isCompressed, unsigned format = 2) {
    test::LazSpec spec;
    spec.format = format;
    spec.version = format > 5 ? 4 : 2;
    spec.chunkPoints = 9000;
    Rng rng(3);
    const std::vector<uint8_t> bytes = test::encodeLas(spec, test::makeRecords(spec, kPoints, rng), isCompressed, rng);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

struct Read {
    std::vector<Place> places;
    std::vector<uint32_t> colours;
    std::vector<uint8_t> attributes;  ///< of each point all
    std::string problem;
    bool operator==(const Read&) const = default;
};
Read readAll(const PointInput& input, PointInput::Wanted wanted) {
    const auto executor = makeSerialExecutor();
    Progress progress(false);
    Read out;
    const auto result = input.read(
        *executor, 1, progress, "read", {},
        [&](int, const Points& block) -> Result<void> {
            for (size_t i = 0; i < block.size(); ++i) {
                out.places.push_back(block.place(i));
                if (wanted == PointInput::Wanted::places) continue;
                out.colours.push_back(block.colour[i]);
                for (const std::vector<uint8_t>& values : block.attributes) {
                    const size_t width = values.size() / block.size();
                    const auto from = values.begin() + static_cast<ptrdiff_t>(i * width);
                    out.attributes.insert(out.attributes.end(), from, from + static_cast<ptrdiff_t>(width));
                }
            }
            return {};
        },
        wanted);
    if (!result) out.problem = result.error().line();
    return out;
}

/// Files that were surveyed.
struct Surveyed {
    BuildReport report;
    std::optional<PointInput> input;
    Surveyed(const std::vector<std::string>& paths, bool keepsPoints, bool skipBad = false) {
        const auto executor = makeTbbExecutor(2);
        Progress progress(false);
        BuildSettings settings;
        settings.skipBad = skipBad;
        settings.allAttributes = true;
        Result<PointInput> opened = PointInput::open(paths, settings, report);
        EXPECT_TRUE(opened);
        input.emplace(std::move(*opened));
        EXPECT_TRUE(input->survey(report, *executor, progress, keepsPoints));
    }
    Read all() const { return readAll(*input, PointInput::Wanted::all); }
    Read places() const { return readAll(*input, PointInput::Wanted::places); }
};

TEST(KeptPoints, PlacesAreThoseOfTheFileWhichIsNotReadAgain) {
    for (const bool isCompressed : {false, true}) {
        const test::TempFolder folder;
        const std::string path = folder / "a.laz";
        writeScan(path, isCompressed);
        const Read before = Surveyed({path}, false).places();
        ASSERT_EQ(before.problem, "");
        ASSERT_EQ(before.places.size(), kPoints);
        Surveyed scan({path}, true);
        std::filesystem::resize_file(path, 2000);
        EXPECT_EQ(scan.places(), before);
        EXPECT_EQ(scan.places(), before) << "as often as one likes";
        if (isCompressed) continue;
        EXPECT_NE(scan.all().problem, "") << "what is no place is in the file alone";
        scan.input->dropPlaces();
        EXPECT_NE(scan.places().problem, "");
    }
}

TEST(KeptPoints, OfCompressedFilesAreWholeAndGivenOnce) {
    for (const unsigned format : {0u, 2u, 3u, 7u}) {  // without colours, with them and several attributes, layered
        SCOPED_TRACE(format);
        const test::TempFolder folder;
        const std::string path = folder / "a.laz";
        writeScan(path, true, format);
        const Read before = Surveyed({path}, false).all();
        ASSERT_EQ(before.problem, "");
        ASSERT_EQ(before.places.size(), kPoints);
        ASSERT_GT(before.attributes.size(), kPoints);
        if (format != 0) {
            EXPECT_NE(before.colours.front(), before.colours.back());
        }
        Surveyed scan({path}, true);
        std::filesystem::resize_file(path, 2000);
        scan.input->dropPlaces();  // not of what is whole
        EXPECT_EQ(scan.places().places, before.places);
        EXPECT_EQ(scan.all(), before);
        EXPECT_NE(scan.all().problem, "") << "it went as it was given";
    }
}

// Of two files one has what the other lacks.
TEST(KeptPoints, AreThoseOfEachFilesOwnKind) {
    const test::TempFolder folder;
    writeScan(folder / "a.laz", true, 0);
    writeScan(folder / "b.laz", true, 3);
    writeScan(folder / "c.las", false, 2);
    const std::vector<std::string> paths{folder / "a.laz", folder / "b.laz", folder / "c.las"};
    const Read before = Surveyed(paths, false).all();
    ASSERT_EQ(before.problem, "");
    ASSERT_EQ(before.places.size(), 3 * kPoints);
    Surveyed scans(paths, true);
    for (const char* name : {"a.laz", "b.laz"}) std::filesystem::resize_file(folder / name, 2000);
    EXPECT_EQ(scans.all(), before);
}

// What a source gives beside colours and attributes is in its file alone; so is a part that was not read to its end.
TEST(KeptPoints, OfMoreThanIsKeptThereAreNoWholeOnes) {
    using What = KeptPoints::What;
    KeptPoints kept({{2, What::all, true}, {2, What::all, true}, {2, What::all, false}, {2, What::places, true}}, {2});
    PointBlock block;
    block.lattice = {{1, 2, 3}, {-4, 5, 6}};
    block.colour16 = {0x0001'ffff'8000, 0xffff'0000'0102};
    block.attributes = {{7, 8, 9, 10}};
    for (const size_t part : {0, 1, 3}) kept.keep(part, 0, block);
    block.colour16.clear();
    block.normal.resize(2);
    kept.keep(2, 0, block);
    for (const size_t part : {0, 2, 3}) kept.finish(part);
    EXPECT_TRUE(kept.has(0, What::all));
    EXPECT_FALSE(kept.has(1, What::places)) << "its end is missing";
    EXPECT_TRUE(kept.has(2, What::places));
    EXPECT_FALSE(kept.has(2, What::all)) << "it has normals";
    EXPECT_FALSE(kept.has(3, What::all)) << "nobody asked for that";
    kept.releasePlaces();
    EXPECT_TRUE(kept.has(0, What::all));
    for (const size_t part : {1, 2, 3}) EXPECT_FALSE(kept.has(part, What::places));
    const PointReader read = kept.read(0, What::all);
    PointBlock again;
    EXPECT_EQ(*read(again, 1), 1u);
    EXPECT_EQ(again.lattice, (std::vector<glm::ivec3>{{1, 2, 3}}));
    again.clear();
    EXPECT_EQ(*read(again, 5), 1u);
    EXPECT_EQ(again.lattice, (std::vector<glm::ivec3>{{-4, 5, 6}}));
    EXPECT_EQ(again.colour16, (std::vector<uint64_t>{0xffff'0000'0102}));
    EXPECT_EQ(again.attributes, (std::vector<std::vector<uint8_t>>{{9, 10}}));
    EXPECT_EQ(*read(again, 5), 0u);
    kept.release(0);
    kept.release(0);
    EXPECT_FALSE(kept.has(0, What::places));
}

TEST(KeptPoints, OfWhatIsDamagedAreAsManyAsOthersGet) {
    const test::TempFolder folder;
    writeScan(folder / "a.laz", true);
    writeScan(folder / "b.laz", true);
    std::filesystem::resize_file(folder / "b.laz", std::filesystem::file_size(folder / "b.laz") * 7 / 10);
    const std::vector<std::string> paths{folder / "a.laz", folder / "b.laz"};
    const Read before = Surveyed(paths, false, true).all();
    EXPECT_EQ(before.problem, "");
    EXPECT_GE(before.places.size(), kPoints);
    EXPECT_LT(before.places.size(), 2 * kPoints);
    Surveyed scans(paths, true, true);
    EXPECT_GT(scans.report.dropped["corrupt"], 0u);
    EXPECT_EQ(scans.places().places, before.places);
    EXPECT_EQ(scans.all(), before);
}

TEST(KeptPoints, AreReadAgainWhereNobodyKeepsThem) {
    const test::TempFolder folder;
    const std::string path = folder / "a.laz";
    writeScan(path, true);
    const Surveyed scan({path}, false);
    const Read before = scan.places();
    EXPECT_EQ(before.places.size(), kPoints);
    EXPECT_EQ(before.places, scan.all().places);
    std::filesystem::resize_file(path, 2000);
    EXPECT_NE(scan.places().problem, "");
}

}  // namespace
}  // namespace stipple::lod
