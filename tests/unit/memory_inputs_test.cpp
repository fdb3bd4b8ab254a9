// Readers take bytes from wherever they are: what a file gives, its bytes in memory give, too.
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/base/file.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"
#include "tests/support/laz_encoder.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// Bytes of a file that is gone; the name says where they were.
std::shared_ptr<const ByteSource> inMemory(const std::string& path) {
    auto bytes = readWhole(path);
    EXPECT_TRUE(bytes);
    std::filesystem::remove(path);
    return std::make_shared<const MemorySource>(path, std::move(*bytes));
}

/// All that a source says of its points.
lod::PointBlock allOf(const Result<lod::PointSource>& source) {
    lod::PointBlock all;
    if (!source) {
        ADD_FAILURE() << source.error().line();
        return all;
    }
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    const auto count = lod::readPoints(*source, [&](const lod::PointBlock& block) -> Result<void> {
        append(all.position, block.position);
        append(all.lattice, block.lattice);
        append(all.colour, block.colour);
        append(all.colour16, block.colour16);
        append(all.normal, block.normal);
        all.attributes.resize(block.attributes.size());
        for (size_t k = 0; k < block.attributes.size(); ++k) append(all.attributes[k], block.attributes[k]);
        return {};
    });
    EXPECT_TRUE(count) << count.error().line();
    EXPECT_EQ(*count, source->info.points);
    EXPECT_EQ(*count, all.position.size() + all.lattice.size());
    return all;
}

void expectSame(const lod::PointBlock& a, const lod::PointBlock& b) {
    EXPECT_EQ(a.position, b.position);
    EXPECT_EQ(a.lattice, b.lattice);
    EXPECT_EQ(a.colour, b.colour);
    EXPECT_EQ(a.colour16, b.colour16);
    EXPECT_EQ(a.normal, b.normal);
    EXPECT_EQ(a.attributes, b.attributes);
}

TEST(MemoryInputs, PointsAreThoseOfTheFile) {
    const test::TempFolder folder;
    Rng rng(5);
    test::LazSpec spec;
    const auto records = test::makeRecords(spec, 5000, rng);
    for (const bool isCompressed : {false, true}) {
        const auto bytes = test::encodeLas(spec, records, isCompressed, rng);
        ASSERT_TRUE(writeWholeFile(folder / (isCompressed ? "b.laz" : "a.las"), bytes.data(), bytes.size()));
    }
    test::writePly(folder / "c.ply", test::bumpySphere(2'000, 1));
    for (const auto& [name, attribute] : {std::pair{"a.las", "intensity"}, {"b.laz", "intensity"}, {"c.ply", ""}}) {
        SCOPED_TRACE(name);
        lod::ReadOptions options;
        if (*attribute != 0) options.attributes = {attribute};
        const std::string path = folder / name;
        const lod::PointBlock ofFile = allOf(lod::openPointSource(path, options));
        EXPECT_GT(ofFile.position.size() + ofFile.lattice.size(), 1000u);
        const auto memory = inMemory(path);
        expectSame(ofFile, allOf(lod::openPointSource(lod::fromBytes(memory), options)));
        EXPECT_FALSE(lod::openPointSource(path, options)) << "the file is gone";
        // Half of them: what is wrong is said of their name.
        std::vector<uint8_t> half(memory->sizeBytes() / 2);
        ASSERT_TRUE(memory->readAt(0, half.data(), half.size()));
        const auto source = lod::openPointSource(
            lod::fromBytes(std::make_shared<const MemorySource>("half", std::move(half))), options);
        if (source) {
            const auto count = lod::readPoints(*source);
            ASSERT_FALSE(count);
            EXPECT_NE(count.error().line().find("half"), std::string::npos) << count.error().line();
        } else {
            EXPECT_NE(source.error().line().find("half"), std::string::npos) << source.error().line();
        }
    }
}

TEST(MemoryInputs, MeshesAndCurvesAreThoseOfTheFile) {
    const test::TempFolder folder;
    test::spit(folder / "a.ply",
               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
               "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
               "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
    test::spit(folder / "b.swc", "1 1 0 0 0 1 -1\n2 3 0 0 1 0.5 1\n3 3 0 0 2 0.5 2\n4 3 1 0 2 0.25 2\n");
    const auto triangles = [&](const Result<lod::MeshSource>& source) {
        EXPECT_TRUE(source);
        return test::collect(*source);
    };
    const lod::TriangleMesh mesh = triangles(lod::openPlyMesh(folder / "a.ply", 1 << 20, folder.path()));
    const lod::TriangleMesh again = triangles(lod::openPlyMesh(inMemory(folder / "a.ply"), 1 << 20, folder.path()));
    EXPECT_EQ(mesh.position.size(), again.position.size());
    EXPECT_EQ(mesh.position, again.position);
    const auto lines = lod::openCurves(folder / "b.swc");
    ASSERT_TRUE(lines);
    const auto ofFile = lod::collect(*lines);
    const auto moved = lod::openCurves(inMemory(folder / "b.swc"));
    ASSERT_TRUE(moved);
    const auto ofMemory = lod::collect(*moved);
    ASSERT_TRUE(ofFile && ofMemory);
    EXPECT_GT(ofFile->curves(), 1u);
    EXPECT_EQ(ofFile->position, ofMemory->position);
    EXPECT_EQ(ofFile->radius, ofMemory->radius);
}

}  // namespace
}  // namespace stipple
