// The error of a record bounds the distance between what it draws and the leaves, both ways, for what is full of holes
// too: no place of a drawn disc is farther from the full detail than stated. (build_test: no leaf is farther from the
// disc above it.)
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <unordered_map>

#include "engine/reference/decode.h"
#include "lod/verify/errors.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

using reference::Disc;

/// Rings of many sizes, turned at random.
std::vector<test::TestPoint> rings() {
    Rng rng(5);
    std::vector<test::TestPoint> points;
    for (int ring = 0; ring < 60; ++ring) {
        const glm::dvec3 centre(rng.uniform(), rng.uniform(), rng.uniform());
        const glm::dvec3 n = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        const glm::dvec3 t = glm::normalize(glm::cross(n, glm::dvec3(0.3, 0.4, 0.9))), b = glm::cross(n, t);
        const double radius = 0.3 * std::exp2(-5 * rng.uniform());
        for (int k = 0; k < 700; ++k) {
            const double a = 2 * M_PI * k / 700;
            points.push_back({centre + radius * (std::cos(a) * t + std::sin(a) * b), glm::vec3(n)});
        }
    }
    return points;
}
/// Upright slats with gaps between them.
std::vector<test::TestPoint> fence(double step) {
    std::vector<test::TestPoint> points;
    Rng rng(6);
    for (double x = 0; x < 4; x += step)
        for (double y = 0; y < 1; y += step)
            if (std::fmod(x, 0.08) < 0.02)
                points.push_back(
                    {{x + 0.3 * step * rng.uniform(), y + 0.3 * step * rng.uniform(), 0.002 * rng.normal()},
                     {0, 0, 1}});
    return points;
}
/// A wall of windows: frames, and bars across them.
std::vector<test::TestPoint> windows() {
    std::vector<test::TestPoint> points;
    for (double x = 0; x < 3; x += 0.01)
        for (double y = 0; y < 3; y += 0.01) {
            const double u = std::fmod(x, 0.5), v = std::fmod(y, 0.6);
            const bool isGlass = u > 0.1 && v > 0.1, isBar = std::abs(u - 0.3) < 0.011 || std::abs(v - 0.35) < 0.011;
            if (!isGlass || isBar) points.push_back({{x, y, 0.05 * std::sin(x)}, {0, 0, 1}});
        }
    return points;
}
/// Wires along all three axes.
std::vector<test::TestPoint> cage() {
    std::vector<test::TestPoint> points;
    for (int a = 0; a < 3; ++a)
        for (int i = 0; i <= 8; ++i)
            for (int j = 0; j <= 8; ++j)
                for (double s = 0; s < 1; s += 0.004) {
                    glm::dvec3 p(0);
                    p[a] = s;
                    p[(a + 1) % 3] = i / 8.0;
                    p[(a + 2) % 3] = j / 8.0;
                    glm::vec3 n(0);
                    n[(a + 1) % 3] = 1;
                    points.push_back({p, n});
                }
    return points;
}

/// All leaves of a store, for the nearest of them.
class Leaves {
  public:
    explicit Leaves(const Store& store) {
        const Hierarchy& h = store.hierarchy;
        for (uint32_t i = 0; i < h.nodes.size(); ++i) {
            if (!h.nodes[i].isLeaf()) continue;
            const auto chunk = readChunk(store, i, true);
            for (size_t k = 0; k < chunk->records.size(); ++k) {
                leaves_.push_back(reference::decodeDisc(h, h.nodes[i], chunk->records[k]));
                if (chunk->lowBits.empty()) continue;
                const uint32_t* const low = &chunk->lowBits[3 * k];
                leaves_.back().position +=
                    h.unit * (glm::dvec3(low[0], low[1], low[2]) - 0.5 * (std::exp2(h.nodes[i].stepShift) - 1));
            }
        }
        for (const Disc& d : leaves_) {
            widest_ = std::max(widest_, d.radius);
            low_ = glm::min(low_, d.position);
            high_ = glm::max(high_, d.position);
        }
        cell_ = glm::length(high_ - low_) / 100;
        for (size_t i = 0; i < leaves_.size(); ++i) cells_[cellOf(leaves_[i].position)].push_back(i);
    }
    /// Is any place of a leaf no farther from p?
    bool isWithin(const glm::dvec3& p, double distance, bool isBall) const {
        const double reach = distance + widest_;
        const auto most = static_cast<int>(std::ceil(reach / cell_));
        for (int shell = 0; shell <= most; ++shell)
            for (int x = -shell; x <= shell; ++x)
                for (int y = -shell; y <= shell; ++y) {
                    const bool isSide = std::abs(x) == shell || std::abs(y) == shell;
                    for (int z = -shell; z <= shell; z += isSide || shell == 0 ? 1 : 2 * shell) {
                        const auto found = cells_.find(cellOf(p + cell_ * glm::dvec3(x, y, z)));
                        if (found == cells_.end()) continue;
                        for (const size_t i : found->second)
                            if (distanceFrom(leaves_[i], p, isBall) <= distance) return true;
                    }
                }
        return false;
    }
    using Cells = std::unordered_map<uint64_t, std::vector<const Disc*>>;
    static uint64_t cellOf(const glm::dvec3& p, const glm::dvec3& origin, double size) {
        const glm::dvec3 at = glm::floor((p - origin) / size + 1e-9);
        return uint64_t(at.x) | uint64_t(at.y) << 21 | uint64_t(at.z) << 42;
    }
    Cells byCell(const glm::dvec3& origin, double size) const {
        Cells cells;
        for (const Disc& leaf : leaves_) cells[cellOf(leaf.position, origin, size)].push_back(&leaf);
        return cells;
    }

  private:
    /// Of the place of the disc that is nearest to p: straight down where it lies under p, else on the rim.
    static double distanceFrom(const Disc& leaf, const glm::dvec3& p, bool isBall) {
        const glm::dvec3 off = p - leaf.position;
        if ((leaf.flags & shared::kFlagNoNormal) != 0)
            return std::max(glm::length(off) - (isBall ? leaf.radius : 0.0), 0.0);
        glm::dvec3 inPlane = off - glm::dot(off, leaf.normal) * leaf.normal;
        if (glm::length(inPlane) > leaf.radius) inPlane *= leaf.radius / glm::length(inPlane);
        return glm::length(off - inPlane);
    }
    uint64_t cellOf(const glm::dvec3& p) const {
        const glm::dvec3 at = glm::floor((p - low_) / cell_) + 1000.0;
        return uint64_t(at.x) | uint64_t(at.y) << 20 | uint64_t(at.z) << 40;
    }
    std::vector<Disc> leaves_;
    double widest_ = 0, cell_ = 1;
    glm::dvec3 low_{1e300}, high_{-1e300};
    std::unordered_map<uint64_t, std::vector<size_t>> cells_;
};

struct Frame3 {
    glm::dvec3 n, t, b;
    explicit Frame3(const glm::dvec3& normal) : n(normal) {
        t = glm::normalize(glm::cross(n, std::abs(n.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
        b = glm::cross(n, t);
    }
};

/// Random places of a record's disc (of one without a normal: of the ball that it may turn through), on its rim as
/// well, that are farther than `error` from all leaves.
int strays(const Disc& record, double error, const Leaves& leaves, Rng& rng) {
    constexpr int kPlaces = 24;
    const bool isBall = (record.flags & shared::kFlagNoNormal) != 0;
    int count = 0;
    for (int k = 0; k < kPlaces; ++k) {
        const Frame3 f(isBall ? glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())) : record.normal);
        const double angle = rng.uniform(0, 2 * M_PI), r = record.radius * (k % 2 ? 1.0 : std::sqrt(rng.uniform()));
        const glm::dvec3 p = record.position + r * (std::cos(angle) * f.t + std::sin(angle) * f.b);
        count += !leaves.isWithin(p, error * (1 + 1e-5) + 1e-6 * record.radius, isBall);
    }
    return count;
}

/// What was stored once: leaves against the disc, and of the disc against the leaves only how far these reach in 16
/// directions, which is blind to what is inside.
double errorOfHulls(const Disc& record, const std::vector<const Disc*>& leaves) {
    const Frame3 f(record.normal);
    double height = 0, inner = 1e300;
    for (int k = 0; k < 16; ++k) {
        const glm::dvec3 u = std::cos(2 * M_PI * k / 16) * f.t + std::sin(2 * M_PI * k / 16) * f.b;
        double reach = -1e300;
        for (const Disc* leaf : leaves) {
            const double along = std::abs(glm::dot(leaf->normal, f.n)),
                         w = glm::dot(leaf->position - record.position, f.n);
            height = std::max(height, std::abs(w) + leaf->radius * std::sqrt(std::max(0.0, 1 - along * along)));
            reach = std::max(reach, glm::dot(leaf->position - record.position, u) + leaf->radius * along);
        }
        inner = std::min(inner, reach);
    }
    return std::hypot(height, std::max(0.0, record.radius - inner));
}

struct Case {
    const char* name;
    std::function<std::vector<test::TestPoint>()> points;
    NormalsMode normals = NormalsMode::automatic;
    uint32_t leafRecords = 400;
    bool hasHoles = true;  ///< hulls are a poor bound
    bool isFound = true;   ///< by more than what codes of errors round up
    friend void PrintTo(const Case& c, std::ostream* to) { *to << c.name; }
};

class Bounds : public ::testing::TestWithParam<Case> {
  protected:
    void SetUp() override {
        executor_ = makeTbbExecutor(0);
        test::writePly(folder_ / "a.ply", GetParam().points(), GetParam().normals != NormalsMode::none);
        BuildSettings settings;
        settings.leafRecords = GetParam().leafRecords;
        settings.normals = GetParam().normals;
        test::build({folder_ / "a.ply"}, folder_ / "a.stipple", *executor_, settings);
        auto store = openStore(folder_ / "a.stipple");
        ASSERT_TRUE(store);
        store_ = std::make_unique<Store>(std::move(*store));
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_;
    std::unique_ptr<Store> store_;
};

TEST_P(Bounds, NoPlaceOfADiscIsFartherFromTheLeavesThanItsErrorSays) {
    const Hierarchy& h = store_->hierarchy;
    const Leaves leaves(*store_);
    Rng rng(7);
    size_t records = 0, byHulls = 0, levels = 0;
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        const Node& node = h.nodes[i];
        if (node.isLeaf()) continue;
        levels = std::max<size_t>(levels, node.level + 1u);
        const auto chunk = readChunk(*store_, i);
        ASSERT_TRUE(chunk);
        // Leaves by the clusters' cells, for the negative control.
        const double size = h.unit * h.cellSize(node) / 64;
        const Leaves::Cells below = GetParam().hasHoles ? leaves.byCell(h.origin, size) : Leaves::Cells();
        for (const auto& r : chunk->records) {
            const Disc record = reference::decodeDisc(h, node, r);
            const double error = h.unit * h.errors.decode(shared::recordErrorCode(r));
            ASSERT_EQ(strays(record, error, leaves, rng), 0)
                << "level " << int(node.level) << ", radius " << record.radius << ", error " << error;
            ++records;
            const auto own = below.find(Leaves::cellOf(record.position, h.origin, size));
            if (own != below.end() && records % 4 == 0)
                byHulls += strays(record, errorOfHulls(record, own->second), leaves, rng) > 0;
        }
    }
    std::printf("%s: %zu records, of a quarter of them %zu with errors of hulls farther away\n", GetParam().name,
                records, byHulls);
    EXPECT_GT(records, 2000u);
    EXPECT_GE(levels, 3u);
    if (GetParam().hasHoles) EXPECT_GT(byHulls, 20u) << "the test must be able to fail";
}

/// Stores that were built with errors of hulls are found.
TEST_P(Bounds, VerifyFindsErrorsThatSeeOnlyHulls) {
    if (!GetParam().hasHoles) return;
    const Hierarchy& h = store_->hierarchy;
    const Leaves leaves(*store_);
    size_t nodes = 0, found = 0;
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        auto chunk = readDrawnChunk(*store_, i, true);
        ASSERT_TRUE(chunk);
        const uint32_t overview = h.overviewOf(h.nodes[i]);
        const auto measured = measureErrors(*store_, i, *chunk);
        ASSERT_TRUE(measured) << measured.error().what;
        if (*measured == 0) continue;
        ++nodes;
        const double size = h.unit * h.cellSize(h.nodes[i]) / 64;
        const auto below = leaves.byCell(h.origin, size);
        for (auto& r : std::span(chunk->records).subspan(overview)) {
            const Disc record = reference::decodeDisc(h, h.nodes[i], r);
            const auto own = below.find(Leaves::cellOf(record.position, h.origin, size));
            if (own == below.end() || own->second.size() < 2) continue;
            const double hulls = errorOfHulls(record, own->second) / h.unit;
            const uint32_t code = std::min(h.errors.encodeUp(hulls * (1 + 1e-5)), shared::recordErrorCode(r));
            r.positionZRadiusError = (r.positionZRadiusError & 0xffffffu) | code << 24;
        }
        const auto wrong = measureErrors(*store_, i, *chunk);
        if (wrong) continue;
        ++found;
        EXPECT_NE(wrong.error().what.find("a place of a record's disc is"), std::string::npos) << wrong.error().what;
    }
    std::printf("%s: found in %zu of %zu inner nodes\n", GetParam().name, found, nodes);
    EXPECT_GT(nodes, 3u);
    if (GetParam().isFound) EXPECT_GT(found, 0u);
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, Bounds,
    ::testing::Values(Case{"rings", rings}, Case{"fence", [] { return fence(0.005); }},
                      // Of more than the 131,072 points that are built at once.
                      Case{"largeFence", [] { return fence(0.0024); }, NormalsMode::automatic, 2000},
                      Case{"windows", windows, NormalsMode::automatic, 400, true, false}, Case{"cage", cage},
                      Case{"sphere", [] { return test::bumpySphere(60'000, 4); }, NormalsMode::automatic, 400, false},
                      Case{"ringsWithoutNormals", rings, NormalsMode::none, 400, false},
                      Case{"windowsWithoutNormals", windows, NormalsMode::none, 400, false}),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace stipple::lod
