// Places that the survey of a build keeps: who asks for places alone needs the file no more.
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

void writeScan(const std::string& path, bool isCompressed) {
    test::LazSpec spec;
    spec.chunkPoints = 9000;
    Rng rng(3);
    const std::vector<uint8_t> bytes = test::encodeLas(spec, test::makeRecords(spec, kPoints, rng), isCompressed, rng);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

struct Read {
    std::vector<Place> places;
    std::string problem;
};
Read readAll(const PointInput& input, PointInput::Wanted wanted) {
    const auto executor = makeSerialExecutor();
    Progress progress(false);
    Read out;
    const auto result = input.read(
        *executor, 1, progress, "read", {},
        [&](int, const Points& block) -> Result<void> {
            for (size_t i = 0; i < block.size(); ++i) out.places.push_back(block.place(i));
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
    Surveyed(const std::vector<std::string>& paths, bool keepsPlaces, bool skipBad = false) {
        const auto executor = makeTbbExecutor(2);
        Progress progress(false);
        BuildSettings settings;
        settings.skipBad = skipBad;
        Result<PointInput> opened = PointInput::open(paths, settings, report);
        EXPECT_TRUE(opened);
        input.emplace(std::move(*opened));
        EXPECT_TRUE(input->survey(report, *executor, progress, keepsPlaces));
    }
    Read all() const { return readAll(*input, PointInput::Wanted::all); }
    Read places() const { return readAll(*input, PointInput::Wanted::places); }
};

TEST(KeptPlaces, AreThoseOfTheFileWhichIsNotReadAgain) {
    for (const bool isCompressed : {false, true}) {
        const test::TempFolder folder;
        const std::string path = folder / "a.laz";
        writeScan(path, isCompressed);
        Surveyed scan({path}, true);
        const Read before = scan.all();
        ASSERT_EQ(before.problem, "");
        ASSERT_EQ(before.places.size(), kPoints);
        std::filesystem::resize_file(path, 2000);
        EXPECT_NE(scan.all().problem, "") << "what is no place is in the file alone";
        const Read kept = scan.places();
        EXPECT_EQ(kept.problem, "");
        EXPECT_EQ(kept.places, before.places);
        scan.input->dropPlaces();
        EXPECT_NE(scan.places().problem, "");
    }
}

TEST(KeptPlaces, OfWhatIsDamagedAreAsManyAsOthersGet) {
    const test::TempFolder folder;
    writeScan(folder / "a.laz", true);
    writeScan(folder / "b.laz", true);
    std::filesystem::resize_file(folder / "b.laz", std::filesystem::file_size(folder / "b.laz") * 7 / 10);
    Surveyed scans({folder / "a.laz", folder / "b.laz"}, true, true);
    EXPECT_GT(scans.report.dropped["corrupt"], 0u);
    const Read all = scans.all(), kept = scans.places();
    EXPECT_EQ(all.problem, "");
    EXPECT_EQ(kept.problem, "");
    EXPECT_GE(all.places.size(), kPoints);
    EXPECT_LT(all.places.size(), 2 * kPoints);
    EXPECT_EQ(kept.places, all.places);
}

TEST(KeptPlaces, AreReadAgainWhereNobodyKeepsThem) {
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
