// Real scans from the data folder: every LAS and PLY in it must be read or refused in one line; some are built and
// drawn.
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "lod/import/import.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

TEST(Data, EveryFileIsReadOrRefused) {
    const std::string root = test::dataFile("02_scans");
    if (root.empty()) return;
    size_t read = 0, refused = 0;
    for (const char* folder : {"02_scans", "01_meshes", "09_hostile"})
        for (const auto& entry : std::filesystem::recursive_directory_iterator(test::dataFile(folder))) {
            const std::string extension = entry.path().extension().string();
            if (!entry.is_regular_file() || (extension != ".las" && extension != ".ply" && extension != ".laz"))
                continue;
            auto source = lod::openPointSource(entry.path().string());
            uint64_t points = 0;
            bool fine = source.has_value();
            if (fine) {
                const auto count = lod::readPoints(*source);
                fine = count.has_value();
                points = count.value_or(0);
            }
            fine ? ++read : ++refused;
            if (fine)
                ASSERT_EQ(points, source->info.points) << entry.path();
            else if (!source)
                EXPECT_EQ(source.error().line().find('\n'), std::string::npos) << entry.path();
        }
    EXPECT_GT(read, 70u);
    EXPECT_GT(refused, 10u) << "there are hostile and compressed files among them";
}

TEST(Data, RealScansAreBuiltAndDrawnAsTheOracleDraws) {
    const auto executor = makeTbbExecutor(0);
    // The last is a field of random heights and colours: where two of its points have nearly the same depth, fp32 and
    // fp64 may disagree about which is in front.
    for (const auto& [name, psnr] : {std::pair{"01_meshes/bunny/bun_zipper.ply", 50.0},
                                     {"01_meshes/misc/horse.ply", 50.0},
                                     {"02_scans/pdal_testdata/las/autzen_trim_7.las", 50.0},
                                     {"02_scans/las_versions/test1_4.las", 50.0},
                                     {"02_scans/pdal_testdata/las/epsg_4326.las", 50.0},
                                     {"02_scans/las_versions/simple1_4.las", 42.0}}) {
        const std::string path = test::dataFile(name);
        if (path.empty()) continue;
        const test::TempFolder folder;
        const auto store = test::buildAndOpen(path, folder / "a.stipple", *executor, 2048);
        const auto backend = cpu::makeCpuBackend(*executor);
        const auto oracle = reference::makeReferenceBackend(*executor);
        render::FrameSettings settings;
        settings.draw.lit = !store->description.hasColour;
        const lod::View view = test::fitView(*store, 480, 360);
        const auto d =
            reference::compareImages(test::renderView(store, *backend, *executor, view, settings),
                                     test::renderView(store, *oracle, *executor, view, settings), 4, nullptr);
        ASSERT_TRUE(d);
        EXPECT_LE(d->differingFraction, 0.002) << name;
        EXPECT_GE(d->psnr, psnr) << name;
    }
}

}  // namespace
}  // namespace stipple
