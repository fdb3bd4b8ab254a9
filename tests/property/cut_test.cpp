// The promises of selectCut, on real (built) hierarchies and random ones, with random views and random residency. Each
// property is a function that returns what is wrong, so that a negative control can show that it would find a fault.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/reference/decode.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

/// A hierarchy with its records' codes and, for each record, the record of the parent node that stands for it.
struct Tree {
    Hierarchy h;
    struct Record {
        uint32_t own, parentCode, octant, parent;  ///< parent: index in the parent node's records
    };
    std::vector<std::vector<Record>> records;  ///< by node, in file order
    uint32_t rootError = 0;                    ///< of the root's own ones, without an overview
};

/// Nested spheres.
void growNodes(Rng& rng, uint32_t levels, Tree& t) {
    struct Todo {
        uint32_t node;
        glm::dvec3 corner;
        double size;
    };
    std::vector<Todo> todo{{0, glm::dvec3(0), std::exp2(20)}};
    t.h.nodes.resize(1);
    for (size_t k = 0; k < todo.size(); ++k) {
        const Todo at = todo[k];
        Node& n = t.h.nodes[at.node];
        n.centre = at.corner + glm::dvec3(at.size / 2);
        n.radius = at.size * 0.9;  // children: 0.45 + 0.433 of the parent's size from its centre
        n.records = 0;
        if (n.level + 1u >= levels || (n.level > 0 && rng.below(5) == 0)) continue;
        n.childMask = static_cast<uint8_t>(1 + rng.below(255));
        n.firstChild = static_cast<uint32_t>(t.h.nodes.size());
        for (uint32_t o = 0; o < 8; ++o) {
            if (!(t.h.nodes[at.node].childMask >> o & 1u)) continue;
            Node child;
            child.parent = at.node;
            child.level = static_cast<uint8_t>(t.h.nodes[at.node].level + 1);
            todo.push_back({static_cast<uint32_t>(t.h.nodes.size()),
                            at.corner + at.size / 2 * glm::dvec3(o & 1, o >> 1 & 1, o >> 2 & 1), at.size / 2});
            t.h.nodes.push_back(child);
        }
    }
}

/// Leaves get some; each inner record stands for one to four records of one child.
void fillRecords(Rng& rng, Tree& t) {
    t.records.resize(t.h.nodes.size());
    for (size_t i = t.h.nodes.size(); i-- > 0;) {
        Node& n = t.h.nodes[i];
        if (n.isLeaf()) {
            t.records[i].assign(1 + rng.below(12), {0, 255, static_cast<uint32_t>(rng.below(8)), 0});
            continue;
        }
        uint32_t child = n.firstChild;
        for (uint32_t o = 0; o < 8; ++o) {
            if (!(n.childMask >> o & 1u)) continue;
            auto& below = t.records[child];
            for (size_t k = 0; k < below.size();) {
                const size_t count = std::min<size_t>(below.size() - k, 1 + rng.below(4));
                uint32_t code = static_cast<uint32_t>(rng.below(180));
                for (size_t j = k; j < k + count; ++j) code = std::max(code, below[j].own);
                for (size_t j = k; j < k + count; ++j) {
                    below[j].parentCode = code;
                    below[j].parent = static_cast<uint32_t>(t.records[i].size());
                }
                t.records[i].push_back({code, 255, o, 0});
                k += count;
            }
            ++child;
        }
    }
}

/// Up to three levels, of ever fewer records and one error each, that stand for all of the root's own (which is then
/// no leaf's record for certain, as theirs stand for none).
void addOverview(Rng& rng, Tree& t) {
    auto& own = t.records[0];
    uint32_t code = 0;
    for (const Tree::Record& r : own) code = std::max(code, r.own);
    t.rootError = code;
    size_t begin = 0, count = own.size();
    for (uint64_t level = rng.below(4); level > 0; --level) {
        code += 1 + static_cast<uint32_t>(rng.below(12));
        for (size_t k = begin; k < own.size(); ++k) own[k].parentCode = code;
        begin = own.size();
        count = (count + 2) / 3;
        for (size_t k = 0; k < count; ++k) own.push_back({code, 255, static_cast<uint32_t>(rng.below(8)), 0});
    }
}

/// File order; the children's parent indices follow. With the tables of counts.
void sortRecords(Tree& t) {
    for (size_t i = 0; i < t.h.nodes.size(); ++i) {
        auto& r = t.records[i];
        std::vector<uint32_t> order(r.size());
        for (uint32_t k = 0; k < order.size(); ++k) order[k] = k;
        std::stable_sort(order.begin(), order.end(),
                         [&](uint32_t a, uint32_t b) { return r[a].parentCode > r[b].parentCode; });
        std::vector<Tree::Record> sorted;
        std::vector<uint32_t> place(r.size());
        for (const uint32_t k : order) {
            place[k] = static_cast<uint32_t>(sorted.size());
            sorted.push_back(r[k]);
        }
        Node& n = t.h.nodes[i];
        if (!n.isLeaf())
            for (uint32_t c = n.firstChild; c < n.firstChild + static_cast<uint32_t>(__builtin_popcount(n.childMask));
                 ++c)
                for (auto& child : t.records[c]) child.parent = place[child.parent];
        r = sorted;
        n.records = static_cast<uint32_t>(r.size());
        for (const bool own : {false, true}) {
            CodeCounts c;
            c.first = static_cast<uint32_t>(t.h.greaterThan.size());
            c.lo = 0;
            c.hi = 255;
            for (uint32_t code = 0; code < 255; ++code)
                t.h.greaterThan.push_back(static_cast<uint32_t>(std::count_if(
                    r.begin(), r.end(), [&](const auto& x) { return (own ? x.own : x.parentCode) > code; })));
            (own ? n.ownCounts : n.parentCounts) = c;
        }
        for (const auto& x : r) n.errorCode = std::max(n.errorCode, static_cast<uint8_t>(x.own));
        if (i == 0) n.errorCode = static_cast<uint8_t>(t.rootError);
    }
}

/// A random tree with the shape that a build gives: nested spheres, monotone codes, records sorted by parent's code.
Tree randomTree(Rng& rng, uint32_t levels) {
    Tree t;
    t.h.errors.smallest = 1e-3;
    t.h.rootLog2 = 20;
    growNodes(rng, levels, t);
    fillRecords(rng, t);
    addOverview(rng, t);
    sortRecords(t);
    return t;
}

View randomView(Rng& rng, double size) {
    View v;
    v.eye = size * glm::dvec3(rng.uniform(-0.5, 1.5), rng.uniform(-0.5, 1.5), rng.uniform(-0.5, 1.5));
    v.forward = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
    v.right = glm::normalize(glm::cross(v.forward, glm::dvec3(0.3, 1, 0.2)));
    v.down = glm::cross(v.forward, v.right);
    v.focalPixels = 800;
    v.nearPlane = size * 1e-6;
    return v;
}

/// How often each leaf record is covered by the drawn records on its chain; -1: its own node is out of view.
std::string checkCoverage(const Tree& t, const Cut& cut, const std::vector<uint8_t>& drawable, const View& view) {
    std::map<uint32_t, CutDraw> drawn;
    for (const CutDraw& d : cut.draw) drawn[d.node] = d;
    const auto isDrawn = [&](uint32_t node, uint32_t record) {
        const auto d = drawn.find(node);
        if (d == drawn.end() || record < d->second.first || record >= d->second.first + d->second.count) return false;
        const Tree::Record& r = t.records[node][record];
        return r.own <= d->second.errorCode || (d->second.octantMask >> r.octant & 1u) != 0;
    };
    // A level of the overview covers all, if all of it is drawn.
    int byOverview = 0;
    const uint32_t overview = t.h.overviewOf(t.h.nodes[0]);
    for (uint32_t begin = 0, end = 0; begin < overview; begin = end) {
        uint32_t shown = 0;
        for (; end < overview && t.records[0][end].own == t.records[0][begin].own; ++end) shown += isDrawn(0, end);
        if (shown != 0 && shown != end - begin) return "a part of a level of the overview is drawn";
        byOverview += shown != 0 ? 1 : 0;
    }
    if (!drawable[0]) return cut.draw.empty() ? "" : "something is drawn without a root";
    for (uint32_t leaf = 0; leaf < t.h.nodes.size(); ++leaf) {
        if (!t.h.nodes[leaf].isLeaf()) continue;
        // In view for certain: the centre of the leaf's sphere projects into the image.
        const glm::dvec3 c = t.h.nodes[leaf].centre - view.eye;
        const double depth = glm::dot(c, view.forward);
        const bool inView = depth > view.nearPlane &&
                            std::abs(glm::dot(c, view.right)) / depth * view.focalPixels < view.width / 2.0 &&
                            std::abs(glm::dot(c, view.down)) / depth * view.focalPixels < view.height / 2.0;
        for (uint32_t k = 0; k < t.records[leaf].size(); ++k) {
            int times = byOverview;
            uint32_t node = leaf, record = k;
            for (;;) {
                times += isDrawn(node, record);
                if (node == 0) break;
                record = t.records[node][record].parent;
                node = t.h.nodes[node].parent;
            }
            if (times > 1) return "a leaf record is covered " + std::to_string(times) + " times";
            if (inView && times == 0) return "a leaf record in view is not covered";
        }
    }
    return "";
}

struct Selection {
    Cut cut;
    std::vector<std::vector<uint8_t>> drawable;
};

Selection select(const Hierarchy& h, std::vector<uint8_t> drawable, const View& view, const Budgets& budgets) {
    Selection s;
    s.drawable = {std::move(drawable)};
    const std::vector<const Hierarchy*> hierarchies{&h};
    const std::vector<Instance> instances(1);
    CutScratch scratch;
    selectCut({hierarchies, instances, {}}, {s.drawable}, view, budgets, scratch, s.cut);
    return s;
}

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

TEST(Cut, CoversEachLeafExactlyOnceForRandomTreesViewsAndResidency) {
    Rng rng(11);
    size_t partly = 0;
    for (int round = 0; round < 60; ++round) {
        const Tree t = randomTree(rng, 5);
        for (int k = 0; k < 170; ++k) {
            std::vector<uint8_t> drawable(t.h.nodes.size(), 1);
            const uint64_t keep = rng.below(5);
            if (keep < 4)
                for (auto& d : drawable) d = rng.below(4) <= keep;
            const View view = randomView(rng, std::exp2(20));
            const Budgets budgets{std::exp2(rng.uniform(-8, 8)), kNoLimit};
            const Selection s = select(t.h, drawable, view, budgets);
            partly += !s.cut.wanted.empty();
            ASSERT_EQ(checkCoverage(t, s.cut, s.drawable[0], view), "") << "round " << round << " view " << k;
        }
    }
    EXPECT_GT(partly, 1000u) << "the test must also see incomplete residency";
}

TEST(Cut, TheCoverageTestFindsABrokenCut) {
    Rng rng(12);
    int found = 0;
    for (int round = 0; round < 50; ++round) {
        const Tree t = randomTree(rng, 4);
        View view = randomView(rng, std::exp2(20));
        view.eye = glm::dvec3(std::exp2(19), std::exp2(19), -std::exp2(20));
        view.forward = {0, 0, 1};
        view.right = {1, 0, 0};
        view.down = {0, 1, 0};
        Selection s = select(t.h, std::vector<uint8_t>(t.h.nodes.size(), 1), view, {4, kNoLimit});
        if (s.cut.draw.empty()) continue;
        if (round % 2)
            s.cut.draw.pop_back();  // a hole
        else
            s.cut.draw.back().octantMask = 0xff;  // drawn twice
        found += !checkCoverage(t, s.cut, s.drawable[0], view).empty();
    }
    EXPECT_GT(found, 10);
}

TEST(Cut, TheBudgetIsNeverExceededAndTheErrorRisesToMeetIt) {
    Rng rng(13);
    for (int round = 0; round < 40; ++round) {
        const Tree t = randomTree(rng, 5);
        for (int k = 0; k < 50; ++k) {
            std::vector<uint8_t> drawable(t.h.nodes.size(), 1);
            if (k % 2)
                for (auto& d : drawable) d = rng.below(3) != 0;
            drawable[0] = 1;
            const View view = randomView(rng, std::exp2(20));
            const Budgets budgets{std::exp2(rng.uniform(-6, 2)), 1 + rng.below(2000)};
            const Selection s = select(t.h, drawable, view, budgets);
            uint64_t most = 0;
            for (const CutDraw& d : s.cut.draw) {
                uint64_t drawn = 0;
                for (uint32_t i = d.first; i < d.first + d.count; ++i) {
                    const auto& r = t.records[d.node][i];
                    drawn += r.own <= d.errorCode || (d.octantMask >> r.octant & 1u);
                }
                most += drawn;
            }
            ASSERT_LE(most, budgets.records);
            ASSERT_LE(s.cut.counters.recordsDrawn, budgets.records);
            ASSERT_GE(s.cut.tauEffective, s.cut.truncated ? 0 : budgets.errorPixels * 0.999);
            if (!s.cut.truncated) ASSERT_EQ(checkCoverage(t, s.cut, s.drawable[0], view), "");
        }
    }
}

TEST(Cut, EqualInputsGiveEqualCutsWhateverTheScratchHasSeen) {
    Rng rng(14);
    const Tree t = randomTree(rng, 6);
    const std::vector<const Hierarchy*> hierarchies{&t.h};
    const std::vector<Instance> instances(1);
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(t.h.nodes.size(), 1)};
    CutScratch used;
    for (int k = 0; k < 300; ++k) {
        const View view = randomView(rng, std::exp2(20));
        const Budgets budgets{std::exp2(rng.uniform(-4, 4)), 500};
        CutScratch fresh;
        Cut a, b;
        selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, used, a);
        selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, fresh, b);
        ASSERT_EQ(a.draw.size(), b.draw.size());
        for (size_t i = 0; i < a.draw.size(); ++i) {
            ASSERT_EQ(a.draw[i].node, b.draw[i].node);
            ASSERT_EQ(a.draw[i].count, b.draw[i].count);
            ASSERT_EQ(a.draw[i].errorCode, b.draw[i].errorCode);
        }
    }
}

TEST(Cut, FromInsideEverythingNearIsExact) {
    Rng rng(15);
    const Tree t = randomTree(rng, 5);
    View view = randomView(rng, std::exp2(20));
    view.eye = t.h.nodes[0].centre;
    const Selection s = select(t.h, std::vector<uint8_t>(t.h.nodes.size(), 1), view, {1e9, kNoLimit});
    for (const CutDraw& d : s.cut.draw)
        if (glm::length(t.h.nodes[d.node].centre - view.eye) < t.h.nodes[d.node].radius) EXPECT_EQ(d.errorCode, 0u);
}

/// From p to the nearest place of a disc.
double distanceToDisc(const reference::Disc& disc, const glm::dvec3& p) {
    const glm::dvec3 d = p - disc.position, n = glm::normalize(disc.normal);
    const double above = glm::dot(d, n), aside = glm::length(d - above * n);
    return std::hypot(above, std::max(0.0, aside - disc.radius));
}

/// Of points of the input that are in view and face the eye: the largest distance to what is drawn, as a share of what
/// `tau` pixels are there. Distances are measured in space; no code of an error is read.
double worstShare(const Store& store, const std::vector<test::TestPoint>& points, const View& view, double tau,
                  const Cut& cut) {
    const Hierarchy& h = store.hierarchy;
    std::vector<reference::Disc> drawn;
    for (const CutDraw& d : cut.draw) {
        const auto chunk = readDrawnChunk(store, d.node);
        EXPECT_TRUE(chunk);
        for (uint32_t i = d.first; i < d.first + d.count; ++i)
            if (shared::recordErrorCode(chunk->records[i]) <= d.errorCode)
                drawn.push_back(reference::decodeDisc(h, h.nodes[d.node], chunk->records[i]));
    }
    double worst = 0;
    for (const test::TestPoint& point : points) {
        const glm::dvec3 p = point.position - view.eye;
        const double depth = glm::dot(p, view.forward), distance = glm::length(p), cosine = depth / distance;
        if (depth <= view.nearPlane || glm::dot(p, glm::dvec3(point.normal)) > -0.1 * distance) continue;
        if (std::abs(glm::dot(p, view.right)) / depth * view.focalPixels > 0.5 * view.width ||
            std::abs(glm::dot(p, view.down)) / depth * view.focalPixels > 0.5 * view.height)
            continue;
        double nearest = 1e100;
        for (const reference::Disc& disc : drawn) {
            const double most = nearest + disc.radius;  // farther away it cannot be nearer
            const glm::dvec3 d = point.position - disc.position;
            if (glm::dot(d, d) < most * most) nearest = std::min(nearest, distanceToDisc(disc, point.position));
        }
        worst = std::max(worst, nearest * view.focalPixels / (distance * cosine * cosine) / tau);
    }
    return worst;
}

TEST(Cut, MeetsItsErrorInPixelsOnABuiltStore) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    const std::vector<test::TestPoint> points = test::bumpySphere(10'000, 1);
    test::writePly(folder / "a.ply", points);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const Hierarchy& h = store->hierarchy;
    Rng rng(16);
    double closest = 0, control = 0;
    for (int k = 0; k < 10; ++k) {
        View view = test::fitView(*store, 800, 600);
        view.eye = glm::dvec3(rng.uniform(-4, 4), rng.uniform(-4, 4), rng.uniform(-4, 4));
        view.forward = glm::normalize(-view.eye);
        view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 1, 0)));
        view.down = glm::cross(view.forward, view.right);
        const double tau = std::exp2(rng.uniform(-1, 5));
        const auto shareAt = [&](double asked) {
            const Selection s = select(h, std::vector<uint8_t>(h.nodes.size(), 1), view, {asked, kNoLimit});
            return worstShare(*store, points, view, tau, s.cut);
        };
        // Of leaves too: their places are rounded to 16 bits of a cell.
        const double share = shareAt(tau);
        ASSERT_LE(share, 1.0001) << "tau " << tau;
        closest = std::max(closest, share);
        control = std::max(control, shareAt(16 * tau));
    }
    EXPECT_GT(closest, 0.1) << "the bound is so far off that this shows nothing";
    EXPECT_GT(control, 1) << "a cut of sixteen times the error must be found";
}

}  // namespace
}  // namespace stipple::lod
