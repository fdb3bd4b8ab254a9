// Weights of surfels: kernels that count by them add up to about one wherever a surface is, however it was sampled.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "engine/base/hash.h"
#include "engine/base/rng.h"
#include "lod/builder/weights/add.h"
#include "lod/builder/weights/measure.h"
#include "lod/primitives/record_spacing.h"
#include "lod/store/surfel_weights.h"
#include "shaders/shared/surfel_weight.h"
#include "tests/support/crafted_store.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::Surfel;

constexpr int kEdge = 40;

/// A sheet of about a surfel a square, each moved by up to `jitter` along both axes.
std::vector<Surfel> sheet(double jitter, uint64_t seed) {
    Rng rng(seed);
    std::vector<Surfel> out;
    for (int y = 0; y < kEdge; ++y)
        for (int x = 0; x < kEdge; ++x) {
            Surfel s;
            s.place = glm::vec3(x + rng.uniform(-jitter, jitter), y + rng.uniform(-jitter, jitter), 0);
            s.normal = {0, 0, 1};
            s.radius = 1.0275f;
            out.push_back(s);
        }
    return out;
}

/// What weighted kernels add up to at a place of the sheet, from the definition: exp(-rho^2 / 2) down to 0 at 2 sigmas.
double sumAt(const std::vector<Surfel>& surfels, const std::vector<float>& weights, double x, double y) {
    double sum = 0;
    for (size_t i = 0; i < surfels.size(); ++i) {
        const double sigma = double{surfels[i].radius} / 1.5;
        const double rho2 =
            (std::pow(x - double{surfels[i].place.x}, 2) + std::pow(y - double{surfels[i].place.y}, 2)) /
            (sigma * sigma);
        if (rho2 < 4) sum += double{weights[i]} * (std::exp(-0.5 * rho2) - std::exp(-2)) / (1 - std::exp(-2));
    }
    return sum;
}

struct Spread {
    double low, p5, p95, high, rms;
};
/// Of the sums within the sheet.
Spread spreadOf(const std::vector<Surfel>& surfels, const std::vector<float>& weights) {
    Rng rng(9);
    std::vector<double> sums;
    double squares = 0;
    for (int i = 0; i < 2000; ++i) {
        sums.push_back(sumAt(surfels, weights, rng.uniform(5, kEdge - 6), rng.uniform(5, kEdge - 6)));
        squares += std::pow(sums.back() - 1, 2);
    }
    std::sort(sums.begin(), sums.end());
    return {sums.front(), sums[100], sums[1900], sums.back(), std::sqrt(squares / 2000)};
}

/// Bounds: of a grid 4 %; of places moved by a quarter of the spacing p95 8 % more than one and p5 22 % less; by half
/// of it 10 and 36 %. The control: where all count as those of a grid, p95 is 19 and 36 % more.
TEST(SurfelWeights, AddUpToAboutOneWhateverTheSampling) {
    struct Case {
        double jitter, low, high, controlHigh;
    };
    for (const Case& c : {Case{0, 0.96, 1.04, 0}, Case{0.25, 0.78, 1.08, 1.18}, Case{0.5, 0.62, 1.10, 1.33}}) {
        const std::vector<Surfel> surfels = sheet(c.jitter, 4);
        const Spread weighed = spreadOf(surfels, lod::surfelWeights(surfels)),
                     even = spreadOf(surfels, std::vector<float>(surfels.size(), shared::gridWeight(2)));
        std::printf("moved by %.2f: %.3f [%.3f %.3f] %.3f, rms %.4f; as a grid %.3f [%.3f %.3f] %.3f, rms %.4f\n",
                    c.jitter, weighed.low, weighed.p5, weighed.p95, weighed.high, weighed.rms, even.low, even.p5,
                    even.p95, even.high, even.rms);
        EXPECT_GE(c.jitter > 0 ? weighed.p5 : weighed.low, c.low);
        EXPECT_LE(c.jitter > 0 ? weighed.p95 : weighed.high, c.high);
        EXPECT_GE(even.p95, c.controlHigh);
        if (c.jitter > 0) EXPECT_LT(weighed.rms, 0.8 * even.rms);
    }
}

/// Surfels at a border miss the half of their neighbours, and count for more; outlines move by no more than a twelfth
/// of the spacing for that. The control: twice the weight moves them by more.
TEST(SurfelWeights, BordersStayWhereTheyAre) {
    const std::vector<Surfel> surfels = sheet(0, 1);
    const std::vector<float> weights = lod::surfelWeights(surfels);
    const std::vector<float> even(surfels.size(), shared::gridWeight(2));
    std::vector<float> twice = even;
    float most = 0;
    for (size_t i = 0; i < surfels.size(); ++i) {
        const bool isBorder = i % kEdge == 0 || i % kEdge == kEdge - 1 || i / kEdge == 0 || i / kEdge == kEdge - 1;
        if (isBorder) twice[i] *= 2;
        most = std::max(most, weights[i] / even[i]);
    }
    EXPECT_LE(most, 1.45f);                                   // a corner
    const auto outline = [&](const std::vector<float>& of) {  // along a row across the border, spacings
        double width = 0;
        for (int k = 0; k < 400; ++k) width += 0.01 * std::min(1.0, sumAt(surfels, of, -2 + 0.01 * k, 20.3));
        return 2 - width;
    };
    EXPECT_LT(std::abs(outline(weights) - outline(even)), 0.1);
    EXPECT_GT(std::abs(outline(twice) - outline(even)), 0.1);
}

/// The two sides of a sheet have nothing to do with each other, nor has what lies behind. The control: turned to one
/// side they are one surface, and count half.
TEST(SurfelWeights, OtherSurfacesDoNotCount) {
    const std::vector<Surfel> front = sheet(0.25, 3);
    const std::vector<float> alone = lod::surfelWeights(front);
    const auto middle = static_cast<size_t>(kEdge * kEdge / 2 + kEdge / 2);
    std::vector<Surfel> both = front;
    for (Surfel s : front) {
        s.place.z = -0.05f;
        s.normal = {0, 0, -1};
        both.push_back(s);
    }
    const auto ofBoth = [&] { return lod::surfelWeights(both)[middle]; };
    EXPECT_EQ(ofBoth(), alone[middle]);
    for (size_t i = front.size(); i < both.size(); ++i) both[i].normal = {0, 0, 1};
    EXPECT_NEAR(ofBoth() / alone[middle], 0.5, 0.02);
    for (size_t i = front.size(); i < both.size(); ++i) both[i].place.z = -2;  // thicker than a surface is
    EXPECT_EQ(ofBoth(), alone[middle]);
}

TEST(SurfelWeights, CodesAreTheNearestAndNeverNone) {
    EXPECT_EQ(lod::weightCode(0), 1u);
    EXPECT_EQ(lod::weightCode(std::nanf("")), 1u);
    EXPECT_EQ(lod::weightCode(5), 255u);
    Rng rng(6);
    for (int i = 0; i < 10'000; ++i) {
        const auto weight = static_cast<float>(rng.uniform(0.1, 1));
        EXPECT_NEAR(double{shared::surfelWeight(lod::weightCode(weight)) / weight}, 1, 0.013);
    }
    // Those of other kernels: of a grid they add up to one, too.
    EXPECT_NEAR(double{shared::surfelScale(lod::weightCode(shared::gridWeight(2)), 3) / shared::gridWeight(3)}, 1,
                0.006);
    EXPECT_EQ(shared::surfelScale(0, 3), shared::gridWeight(3));
}

/// A statue with weights, of leaves of 500 points, and its leaves as surfels.
class WeighedStore : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        folder_ = new test::TempFolder;
        const auto executor = makeTbbExecutor(4);
        test::writePly(path("a.ply"), test::samplesOf(test::Shape::statue, 20'000, 3));
        lod::BuildSettings settings;
        settings.leafRecords = 500;
        for (const char* name : {"without.stipple", "a.stipple", "b.stipple"})
            test::build({path("a.ply")}, path(name), *executor, settings);
        Progress silent(false);
        const auto added = lod::addSurfelWeights(path("a.stipple"), *executor, silent);
        ASSERT_TRUE(added) << added.error().line();
        const auto serial = makeSerialExecutor();
        ASSERT_TRUE(lod::addSurfelWeights(path("b.stipple"), *serial, silent));
    }
    static void TearDownTestSuite() { delete folder_; }
    static std::string path(const std::string& name) { return *folder_ / name; }
    inline static test::TempFolder* folder_ = nullptr;
};

TEST_F(WeighedStore, IsTheSameBytesForAnyThreadsAndOpensAsBefore) {
    EXPECT_EQ(test::slurp(path("a.stipple")), test::slurp(path("b.stipple")));
    const auto with = lod::openStore(path("a.stipple")), without = lod::openStore(path("without.stipple"));
    ASSERT_TRUE(with && without);
    EXPECT_TRUE(lod::hasWeights(with->hierarchy));
    EXPECT_FALSE(lod::hasWeights(without->hierarchy));
    const auto executor = makeTbbExecutor(2);
    EXPECT_TRUE(lod::verifyStore(*with, *executor));
    for (uint32_t n = 0; n < with->hierarchy.nodes.size(); ++n) {
        const auto a = lod::readChunk(*with, n), b = lod::readChunk(*without, n);
        ASSERT_TRUE(a && b);
        EXPECT_EQ(a->records.size(), b->records.size());
        EXPECT_EQ(with->hierarchy.nodes[n].chunkHash, without->hierarchy.nodes[n].chunkHash);
    }
    Progress silent(false);
    const auto twice = lod::addSurfelWeights(path("a.stipple"), *executor, silent);
    ASSERT_FALSE(twice);
    EXPECT_EQ(twice.error().what, "has weights of surfels already");
}

/// Neighbours in other nodes count: weights are those that all leaves together have, but for few beside nodes that go
/// deeper, of which the level counts. The control: those of each node alone are not.
TEST_F(WeighedStore, KnowsNoBordersOfNodes) {
    const auto store = lod::openStore(path("a.stipple"));
    ASSERT_TRUE(store);
    const lod::Hierarchy& h = store->hierarchy;
    std::vector<Surfel> all;
    std::vector<double> stored, alone;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        const lod::Node& node = h.nodes[n];
        if (!node.isLeaf()) continue;
        const auto chunk = lod::readChunk(*store, n);
        const auto bytes = lod::readStream(*store, n, *lod::weightsOf(h, n));
        const auto codes = lod::decodeWeights(bytes->data(), bytes->size(), node.records, "here");
        ASSERT_TRUE(chunk && codes);
        std::vector<Surfel> own;
        for (size_t i = 0; i < chunk->records.size(); ++i) {
            const shared::PointRecord& r = chunk->records[i];
            Surfel s;
            s.place = glm::vec3(h.recordOrigin(node) +
                                std::exp2(node.stepShift) * glm::dvec3(recordX(r), recordY(r), recordZ(r)));
            s.normal = glm::vec3(shared::octDecode(r.normal));
            const double radius = h.cellSize(node) * std::exp2((shared::recordRadiusCode(r) - 255.0) / 16);
            const double spacing = std::exp2(node.stepShift) * double{lod::spacingOfCode(node.spacingCode)};
            s.radius = static_cast<float>(std::max(radius, std::min(1.0275 * spacing, 1.5 * radius)));
            own.push_back(s);
            stored.push_back(std::pow((*codes)[i] / 255.0, 2));
        }
        for (const float w : lod::surfelWeights(own)) alone.push_back(double{w});
        all.insert(all.end(), own.begin(), own.end());
    }
    const std::vector<float> truth = lod::surfelWeights(all);
    size_t off = 0, offAlone = 0;
    for (size_t i = 0; i < all.size(); ++i) {
        off += std::abs(stored[i] / double{truth[i]} - 1) > 0.02;
        offAlone += std::abs(alone[i] / double{truth[i]} - 1) > 0.02;
    }
    std::printf("%zu of %zu weights differ from those of all leaves together; of nodes alone %zu\n", off, all.size(),
                offAlone);
    EXPECT_GT(all.size(), 15'000u);
    EXPECT_LE(off, all.size() / 40);
    EXPECT_GT(offAlone, all.size() / 20);
}

TEST_F(WeighedStore, DamagedWeightsAreFound) {
    auto crafted = test::CraftedStore::read(path("a.stipple"));
    size_t found = 0;
    for (auto& s : crafted.streams) {
        if (s.id != static_cast<uint16_t>(lod::StreamId::surfelWeights) || found++ > 0) continue;
        s.bytes -= 1;
    }
    EXPECT_GT(found, 10u);
    crafted.write(path("c.stipple"));
    const auto store = lod::openStore(path("c.stipple"));
    ASSERT_TRUE(store);
    const auto executor = makeSerialExecutor();
    const auto verified = lod::verifyStore(*store, *executor);
    ASSERT_FALSE(verified);
    EXPECT_NE(verified.error().line().find("weights of surfels"), std::string::npos) << verified.error().line();
}

TEST_F(WeighedStore, RecordsWithoutAWeightAreFound) {
    const auto right = lod::openStore(path("a.stipple"));
    ASSERT_TRUE(right);
    const lod::Stream& first = *lod::weightsOf(right->hierarchy, 0);
    const uint32_t records = right->hierarchy.nodes[0].records;
    const auto bytes = lod::readStream(*right, 0, first);
    auto codes = lod::decodeWeights(bytes->data(), bytes->size(), records, "here");
    ASSERT_TRUE(codes);
    codes->resize(records);
    const auto executor = makeSerialExecutor();
    for (const bool isDamaged : {false, true}) {
        if (isDamaged) codes->front() = 0;
        const std::vector<uint8_t> encoded = lod::encodeWeights(*codes);
        auto crafted = test::CraftedStore::read(path("a.stipple"));
        const auto stream = std::find_if(crafted.streams.begin(), crafted.streams.end(),
                                         [&](const auto& s) { return s.offset == first.offset; });
        ASSERT_NE(stream, crafted.streams.end());
        stream->offset = sizeof(lod::layout::Head) + crafted.body.size();
        stream->bytes = static_cast<uint32_t>(encoded.size());
        stream->hash = hashBytes(encoded.data(), encoded.size());
        crafted.body.insert(crafted.body.end(), encoded.begin(), encoded.end());
        crafted.write(path("d.stipple"));
        const auto store = lod::openStore(path("d.stipple"));
        ASSERT_TRUE(store) << store.error().line();
        const auto verified = lod::verifyStore(*store, *executor);
        EXPECT_EQ(verified.has_value(), !isDamaged);
        if (!verified) EXPECT_NE(verified.error().line().find("no weight"), std::string::npos);
    }
}

/// A build with weights gives what adding them gives. Stopped while it measures them, it leaves no store; where its
/// points lie on the disk, the same build goes on from there.
TEST_F(WeighedStore, ABuildStoppedBeforeItsWeightsLeavesNoStoreAndGoesOn) {
    namespace fs = std::filesystem;
    const auto executor = makeSerialExecutor();
    test::writePly(path("much.ply"), test::bumpySphere(400'000, 1), false);
    const std::string output = path("e.stipple");
    for (const bool isOnDisk : {false, true}) {
        const std::string input = path(isOnDisk ? "much.ply" : "a.ply");
        lod::BuildSettings settings;
        settings.leafRecords = isOnDisk ? 8192 : 500;
        if (isOnDisk) settings.memoryBytes = uint64_t{120} << 20;
        int asked = 0, most = 0;
        settings.isStopped = [&] { return ++asked > most && most > 0; };
        Progress silent(false);
        const auto build = [&] {
            asked = 0;
            return lod::buildStore({input}, output, settings, *executor, silent);
        };
        ASSERT_TRUE(build());
        EXPECT_FALSE(lod::hasWeights(lod::openStore(output)->hierarchy));
        fs::remove(output);
        const int without = asked;
        settings.surfelWeights = true;
        const auto whole = build();
        ASSERT_TRUE(whole) << whole.error().line();
        ASSERT_GT(asked, without + 4) << "asked while weights are measured";
        const std::string bytes = test::slurp(output);
        EXPECT_EQ(whole->bytesOut, bytes.size());
        EXPECT_EQ(whole->contentHash, lod::openStore(output)->contentHash);
        if (!isOnDisk) EXPECT_TRUE(bytes == test::slurp(path("a.stipple")));
        fs::remove(output);
        most = without + 3;
        const auto stopped = build();
        ASSERT_FALSE(stopped);
        EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted) << stopped.error().line();
        EXPECT_FALSE(fs::exists(output));
        most = 0;
        const auto again = build();
        ASSERT_TRUE(again) << again.error().line();
        EXPECT_EQ(again->isResumed, isOnDisk);
        EXPECT_TRUE(test::slurp(output) == bytes);
        for (const auto& entry : fs::directory_iterator(fs::path(output).parent_path()))
            EXPECT_EQ(entry.path().filename().string().find("e.stipple."), std::string::npos) << entry.path();
        fs::remove(output);
    }
}

/// What has no points alone is refused before anything is built, and what stood there stays.
TEST(SurfelWeights, OfMeshesAndCurvesAreRefusedBeforeTheyAreBuilt) {
    const test::TempFolder folder;
    ASSERT_EQ(test::runProgram(folder, "grow rock -o mesh.glb --triangles 1k").code, 0);
    test::spit(folder / "c.swc", "1 2 0 0 0 1 -1\n2 2 1 0 0 1 1\n3 2 2 0 0 1 2\n");
    for (const std::string input : {"mesh.glb", "c.swc"}) {
        SCOPED_TRACE(input);
        test::expectOneLine(test::runProgram(folder, "build " + input + " -o a.stipple --quiet --surfel-weights"), 2,
                            {"no weights of surfels"});
        EXPECT_FALSE(std::filesystem::exists(folder / "a.stipple"));
    }
    ASSERT_EQ(test::runProgram(folder, "build c.swc -o a.stipple --quiet").code, 0);
    const std::string before = test::slurp(folder / "a.stipple");
    EXPECT_EQ(test::runProgram(folder, "build mesh.glb -o a.stipple --quiet --surfel-weights").code, 2);
    EXPECT_TRUE(test::slurp(folder / "a.stipple") == before);
    EXPECT_EQ(test::runProgram(folder, "build mesh.glb -o a.stipple --quiet --surfels 2k --surfel-weights").code, 0);
    EXPECT_TRUE(lod::hasWeights(lod::openStore(folder / "a.stipple")->hierarchy));
}

}  // namespace
}  // namespace stipple
