// The promises of a build: the same bytes for any number of threads, errors that bound the leaves, nothing lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

std::string slurp(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {(std::istreambuf_iterator<char>(in)), {}};
}

TEST(Build, GivesTheSameBytesForAnyNumberOfThreads) {
    const test::TempFolder folder;
    test::writePly(folder / "a.ply", test::bumpySphere(60'000, 1), false);
    BuildSettings settings;
    settings.leafRecords = 1000;
    std::string first;
    for (const int threads : {1, 2, 7}) {
        const auto executor = makeTbbExecutor(threads);
        const std::string out = folder / ("t" + std::to_string(threads));
        test::build({folder / "a.ply"}, out, *executor, settings);
        if (first.empty()) first = slurp(out);
        EXPECT_TRUE(first == slurp(out)) << threads << " threads";
    }
    const auto executor = makeSerialExecutor();
    settings.normals = NormalsMode::none;
    test::build({folder / "a.ply"}, folder / "other", *executor, settings);
    EXPECT_FALSE(first == slurp(folder / "other")) << "the comparison must be able to fail";
}

/// A disc with its leaves, found by position: the leaves below a record are those inside its cluster's cell.
struct Below {
    reference::Disc record;
    double error;
    std::vector<reference::Disc> leaves;
};

std::vector<Below> recordsWithLeaves(const Store& store, uint32_t level) {
    const Hierarchy& h = store.hierarchy;
    std::vector<Below> all;
    std::multimap<std::array<uint32_t, 3>, size_t> byCell;
    const auto cellOf = [&](const glm::dvec3& p) {
        const glm::dvec3 lattice = (p - h.origin) / h.unit;
        const double size = std::exp2(double(h.rootLog2) - level - 6);
        return std::array<uint32_t, 3>{uint32_t((lattice.x + 1e-6) / size), uint32_t((lattice.y + 1e-6) / size),
                                       uint32_t((lattice.z + 1e-6) / size)};
    };
    std::vector<uint32_t> inner;
    for (uint32_t i = 0; i < h.nodes.size(); ++i)
        if (h.nodes[i].level == level && !h.nodes[i].isLeaf()) {
            const auto chunk = readChunk(store, i);
            for (const auto& r : chunk->records) {
                byCell.emplace(cellOf(reference::decodeDisc(h, h.nodes[i], r).position), all.size());
                all.push_back({reference::decodeDisc(h, h.nodes[i], r),
                               h.unit * h.errors.decode(shared::recordErrorCode(r)),
                               {}});
            }
        }
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        if (!h.nodes[i].isLeaf() || h.nodes[i].level <= level) continue;
        const auto chunk = readChunk(store, i);
        for (const auto& r : chunk->records) {
            const reference::Disc d = reference::decodeDisc(h, h.nodes[i], r);
            // Of several records of a cell the one whose normal agrees best.
            const auto [first, last] = byCell.equal_range(cellOf(d.position));
            size_t best = all.size();
            double agrees = -2;
            for (auto at = first; at != last; ++at) {
                const double dot = glm::dot(all[at->second].record.normal, d.normal);
                const double agreement = (shared::recordFlags(r) & shared::kFlagTwoSided) != 0 ? std::abs(dot) : dot;
                if (agreement <= agrees) continue;
                agrees = agreement;
                best = at->second;
            }
            if (best < all.size()) all[best].leaves.push_back(d);
        }
    }
    return all;
}

/// Largest distance of a point of a leaf's disc from the record's disc, over random points; or how far the record
/// sticks out beyond its leaves in one of 16 directions of its plane.
double measuredDeviation(const Below& b, Rng& rng) {
    const glm::dvec3 n = b.record.normal;
    const glm::dvec3 t1 = glm::normalize(std::abs(n.x) < 0.7 ? glm::dvec3(0, -n.z, n.y) : glm::dvec3(-n.z, 0, n.x)),
                     t2 = glm::cross(n, t1);
    double worst = 0;
    std::array<double, 16> extent{};
    extent.fill(-1e300);
    for (const reference::Disc& leaf : b.leaves) {
        const glm::dvec3 l1 = glm::normalize(glm::cross(
                             leaf.normal, std::abs(leaf.normal.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0))),
                         l2 = glm::cross(leaf.normal, l1);
        for (int k = 0; k < 16; ++k) {
            const double a = 2 * M_PI * k / 16;
            const glm::dvec3 direction = std::cos(a) * t1 + std::sin(a) * t2;
            const double along = glm::dot(leaf.normal, direction);
            extent.at(static_cast<size_t>(k)) = std::max(extent.at(static_cast<size_t>(k)),
                                                         glm::dot(leaf.position - b.record.position, direction) +
                                                             leaf.radius * std::sqrt(std::max(0.0, 1 - along * along)));
            const double angle = rng.uniform(0, 2 * M_PI), distance = leaf.radius * std::sqrt(rng.uniform());
            const glm::dvec3 p =
                leaf.position + distance * (std::cos(angle) * l1 + std::sin(angle) * l2) - b.record.position;
            const double height = glm::dot(p, n),
                         sideways = std::max(0.0, glm::length(p - height * n) - b.record.radius);
            worst = std::max(worst, std::hypot(height, sideways));
        }
    }
    const double shortest = *std::min_element(extent.begin(), extent.end());
    return std::max(worst, b.record.radius - shortest);
}

TEST(Build, TheStoredErrorBoundsTheLeaves) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(150'000, 3));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 300);
    Rng rng(1);
    size_t checked = 0, shrunkWouldFail = 0;
    for (const uint32_t level : {0u, 1u, 2u, 3u})
        for (const Below& b : recordsWithLeaves(*store, level)) {
            if (b.leaves.empty()) continue;
            const double measured = measuredDeviation(b, rng);
            // The overhang is measured in 16 directions that start from an fp32 frame: between two of them the leaves
            // may reach less far by 1 - cos(pi/16) of the radius.
            ASSERT_LE(measured, b.error * (1 + 1e-6) + 0.02 * b.record.radius)
                << "level " << level << " radius " << b.record.radius << " leaves " << b.leaves.size();
            shrunkWouldFail += measured > b.error / 3;
            ++checked;
        }
    EXPECT_GT(checked, 10'000u);
    EXPECT_GT(shrunkWouldFail, checked / 20) << "the bound must be tight enough for this test to be able to fail";
}

TEST(Build, DuplicatesEndAndDrawAsOne) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writeLas(folder / "a.las", std::vector<glm::ivec3>(100'000, glm::ivec3(5, -7, 3)), 0.001, {1e6, 0, 0});
    const auto store = test::buildAndOpen(folder / "a.las", folder / "a.stipple", *executor);
    EXPECT_EQ(store->description.points, 100'000u);
    const std::vector<const Hierarchy*> hierarchies{&store->hierarchy};
    const std::vector<Instance> instances(1);
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(store->hierarchy.nodes.size(), 1)};
    CutScratch scratch;
    Cut cut;
    View view;
    view.eye = store->description.boundsMin + glm::dvec3(0, 0, 10);
    selectCut({hierarchies, instances, {}}, {drawable}, view, {1, std::numeric_limits<uint64_t>::max()}, scratch, cut);
    EXPECT_EQ(cut.counters.recordsDrawn, 1u);
}

TEST(Build, EveryCountFromOneToSixteenWorks) {
    const auto executor = makeSerialExecutor();
    for (size_t count = 1; count <= 16; ++count) {
        const test::TempFolder folder;
        const std::vector<test::TestPoint> points = test::bumpySphere(count, count);
        test::writePly(folder / "a.ply", points, false);
        double extent = 0;
        for (const test::TestPoint& a : points)
            for (const test::TestPoint& b : points) extent = std::max(extent, glm::distance(a.position, b.position));
        for (const uint32_t leafRecords : {1u, 4u, 8192u}) {
            SCOPED_TRACE(testing::Message() << count << " points, " << leafRecords << " a leaf");
            const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, leafRecords);
            EXPECT_EQ(store->description.points, count);
            const lod::Hierarchy& h = store->hierarchy;
            uint64_t records = 0;
            for (uint32_t n = 0; n < h.nodes.size(); ++n) {
                if (!h.nodes[n].isLeaf()) continue;
                const auto chunk = lod::readChunk(*store, n);
                ASSERT_TRUE(chunk);
                for (const shared::PointRecord& r : chunk->records) {
                    const reference::Disc d = reference::decodeDisc(h, h.nodes[n], r);
                    ++records;
                    EXPECT_GT(d.radius, 0);
                    double nearest = extent;
                    for (const test::TestPoint& other : points)
                        if (const double by = glm::distance(other.position, d.position); by > 1e-3 * extent)
                            nearest = std::min(nearest, by);
                    if (count > 1) {
                        EXPECT_LE(d.radius, 1.5 * extent) << "of neighbours that are there";
                        EXPECT_GE(d.radius, 0.25 * nearest) << "no dot";
                    }
                    EXPECT_TRUE(std::isfinite(d.normal.x + d.normal.y + d.normal.z));
                    if (count <= 2) EXPECT_NE(d.flags & shared::kFlagNoNormal, 0u) << "two points have no plane";
                }
            }
            EXPECT_EQ(records, count);
            const auto backend = cpu::makeCpuBackend(*executor);
            const render::Image image = test::renderView(store, *backend, *executor, test::fitView(*store, 64, 48),
                                                         test::drawnAs(render::Mode::pullpush, 1));
            EXPECT_GT(std::count_if(image.depth.begin(), image.depth.end(), [](float z) { return z > 0; }), 0);
        }
    }
}

TEST(Build, RefusesRatherThanExceedsItsMemory) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    test::writePly(folder / "a.ply", test::bumpySphere(5000, 1));
    BuildSettings settings;
    settings.memoryBytes = 1 << 20;
    Progress silent(false);
    const auto report = buildStore({folder / "a.ply"}, folder / "a.stipple", settings, *executor, silent);
    ASSERT_FALSE(report);
    EXPECT_EQ(report.error().kind, ErrorKind::budget);
    EXPECT_NE(report.error().hint.find("--memory"), std::string::npos);
    EXPECT_FALSE(std::ifstream(folder / "a.stipple").good());
}

TEST(Build, EstimatedNormalsAndRadiiFitTheSurface) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const size_t count = 200'000;
    const double spacing = std::sqrt(4 * M_PI / count);
    // A sphere whose truth is known, as it is and with noise of a fifth of the spacing along the normal.
    for (const double noise : {0.0, 0.2}) {
        Rng rng(9);
        auto points = test::bumpySphere(count, 9);
        for (auto& p : points) p.position = (1 + noise * spacing * rng.normal()) * glm::dvec3(p.normal);
        test::writePly(folder / "a.ply", points, false);
        double mean[2] = {};
        for (const bool isFine : {false, true}) {
            BuildSettings settings;
            settings.fineNormals = isFine;
            test::build({folder / "a.ply"}, folder / "a.stipple", *executor, settings);
            const auto store = openStore(folder / "a.stipple");
            ASSERT_TRUE(store);
            std::vector<double> angles;
            size_t odd = 0;
            for (uint32_t i = 0; i < store->hierarchy.nodes.size(); ++i) {
                if (!store->hierarchy.nodes[i].isLeaf()) continue;
                const auto chunk = readChunk(*store, i);
                ASSERT_TRUE(chunk);
                for (const auto& r : chunk->records) {
                    const reference::Disc d = reference::decodeDisc(store->hierarchy, store->hierarchy.nodes[i], r);
                    const double cosine = std::abs(glm::dot(d.normal, glm::normalize(d.position)));
                    angles.push_back(std::acos(std::min(cosine, 1.0)) * 180 / M_PI);
                    mean[isFine] += angles.back() / static_cast<double>(count);
                    odd += d.radius < 0.4 * spacing || d.radius > 2.4 * spacing;
                    ASSERT_EQ(d.flags & 3u, 3u) << "two-sided and estimated";
                }
            }
            EXPECT_EQ(angles.size(), count);
            std::sort(angles.begin(), angles.end());
            const double p99 = angles[count * 99 / 100];
            std::printf("normals of a sphere, noise %.1f spacings, %s: mean %.2f, 99 %% below %.2f degrees\n", noise,
                        isFine ? "fine" : "auto", mean[isFine], p99);
            EXPECT_LT(p99, noise > 0 ? (isFine ? 20 : 5) : (isFine ? 0.6 : 2));
            EXPECT_LT(double(odd) / double(count), 0.01);
        }
    }
}

}  // namespace
}  // namespace stipple::lod
