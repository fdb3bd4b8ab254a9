// Nodes of which every disc faces away are not visited, and nothing that could be seen is among them: by their cones of
// normals (facesAway in lod/cut/view.h), held against every disc that a cut without cones would draw.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "engine/reference/decode.h"
#include "tests/support/crafted_store.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

std::vector<CutDraw> drawnOf(const Hierarchy& h, const Instance& place, const View& view, double tau) {
    const std::vector<const Hierarchy*> hierarchies{&h};
    const std::vector<Instance> instances{place};
    const std::vector<std::vector<uint8_t>> all{std::vector<uint8_t>(h.nodes.size(), 1)};
    CutScratch scratch;
    Cut cut;
    selectCut({hierarchies, instances, {}}, {all}, view, {tau, std::numeric_limits<uint64_t>::max()}, scratch, cut);
    return cut.draw;
}

struct ConeCut {
    size_t drawn = 0, spared = 0;  ///< nodes
    size_t wrong = 0;              ///< discs that could be seen, but are not drawn

    /// Adds what `view` shows of the store at `place`, with the cones of `withCones` and without any.
    void add(const Store& store, const Hierarchy& withCones, const Instance& place, const View& view, double tau) {
        Hierarchy bare = store.hierarchy;
        for (Node& n : bare.nodes) n.normalConeCosine = -1;
        std::map<uint32_t, CutDraw> kept;
        for (const CutDraw& d : drawnOf(withCones, place, view, tau)) kept[d.node] = d;
        for (const CutDraw& d : drawnOf(bare, place, view, tau)) {
            ++drawn;
            if (const auto k = kept.find(d.node); k != kept.end()) {
                wrong += k->second.count != d.count || k->second.errorCode != d.errorCode ||
                         k->second.octantMask != d.octantMask;
                continue;
            }
            ++spared;
            const auto chunk = readDrawnChunk(store, d.node);
            EXPECT_TRUE(chunk);
            if (d.first < bare.overviewOf(bare.nodes[d.node])) continue;  // whose faces look along axes
            for (uint32_t i = d.first; i < d.first + d.count; ++i) {
                const reference::Disc disc = reference::decodeDisc(bare, bare.nodes[d.node], chunk->records[i]);
                const glm::dvec3 position = place.translation + place.scale * (place.rotation * disc.position);
                wrong += (disc.flags & (shared::kFlagTwoSided | shared::kFlagNoNormal)) != 0 ||
                         glm::dot(place.rotation * disc.normal, position - view.eye) < 0;
            }
        }
    }
};

glm::dvec3 anyWay(Rng& rng) { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); }

View viewFrom(const glm::dvec3& eye, const glm::dvec3& forward) {
    View view;
    view.width = 800;
    view.height = 600;
    view.focalPixels = 700;
    view.nearPlane = 1e-3;
    view.eye = eye;
    view.forward = forward;
    view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 1, 0)));
    view.down = glm::cross(view.forward, view.right);
    return view;
}

/// A round room with a ball in it, normals away from either's walls, each turned by up to about `noise` radians: from
/// inside, all of the room is seen and half of the ball; from outside, the far side of the room.
std::vector<test::TestPoint> roomWithBall(double noise) {
    std::vector<test::TestPoint> room = test::bumpySphere(30'000, 1), ball = test::bumpySphere(20'000, 2);
    for (test::TestPoint& p : room) p.normal = -p.normal;
    for (test::TestPoint& p : ball) p.position = 0.5 * p.position + glm::dvec3(0.3, 0, 0);
    room.insert(room.end(), ball.begin(), ball.end());
    Rng rng(3);
    for (test::TestPoint& p : room)
        p.normal = glm::normalize(p.normal + glm::vec3(noise * rng.uniform() * anyWay(rng)));
    return room;
}

/// A sheet of which one normal in 100 leans aside.
std::vector<test::TestPoint> sheetWithBurrs() {
    Rng rng(4);
    std::vector<test::TestPoint> points(40'000);
    for (test::TestPoint& p : points) {
        const double around = rng.uniform(0, 2 * M_PI), lean = rng.below(100) == 0 ? 0.9 : 0;
        p.position = glm::dvec3(rng.uniform(), rng.uniform(), 0);
        p.normal = glm::normalize(glm::vec3(lean * std::cos(around), lean * std::sin(around), 1));
        p.colour = 0x808080;
    }
    return points;
}

class Cones : public testing::Test {
  protected:
    std::shared_ptr<const Store> built(const std::vector<test::TestPoint>& points) {
        test::writePly(folder_ / "a.ply", points);
        return test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
};

/// Negative control: cones that are those of other nodes.
Hierarchy withConesOfOthers(const Store& store) {
    Hierarchy h = store.hierarchy;
    for (size_t i = 1; i < h.nodes.size(); ++i) h.nodes[i].normalCone = store.hierarchy.nodes[i - 1].normalCone;
    return h;
}

/// A plate: normals of one side are exactly opposite to the axis of the cone.
TEST(Plates, HaveAConeOfAllDirections) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points;
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 30; ++x) {
            points.push_back({{x, y, 0.1}, {0, 0, 1}});
            if (x < 20) points.push_back({{x, y, 0}, {0, 0, -1}});
        }
    test::writePly(folder / "a.ply", points);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    ASSERT_TRUE(store);
    for (const Node& n : store->hierarchy.nodes) EXPECT_EQ(n.normalConeCosine, -1.0f);
}

TEST_F(Cones, WhatFacesAwayIsNotVisitedAndWhatDoesNotIs) {
    const auto store = built(test::bumpySphere(40'000, 1));
    const Hierarchy turned = withConesOfOthers(*store);
    Rng rng(17);
    ConeCut sum, control;
    for (int k = 0; k < 60; ++k) {
        const glm::dvec3 way = anyWay(rng);
        const View view = viewFrom(std::exp2(rng.uniform(0.2, 4)) * way, -way);
        const double tau = std::exp2(rng.uniform(-3, 3));
        sum.add(*store, store->hierarchy, {}, view, tau);
        control.add(*store, turned, {}, view, tau);
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_GT(sum.spared, sum.drawn / 5) << "of " << sum.drawn << " nodes";
    EXPECT_GT(control.wrong, 100u);
}

/// Scenes have no mirrored instances (open_scene.cpp refuses them); the cut takes any transform, so they are tried,
/// too.
TEST_F(Cones, InstancesThatAreTurnedScaledAndMirroredLoseNothing) {
    const auto store = built(roomWithBall(0.2));
    const Hierarchy turned = withConesOfOthers(*store);
    for (const bool isMirrored : {false, true})
        for (const bool isInside : {false, true}) {
            Rng rng(23 + (isMirrored ? 1u : 0u) + (isInside ? 2u : 0u));
            ConeCut sum, control;
            for (int k = 0; k < 40; ++k) {
                Instance place;
                const glm::dvec3 x = anyWay(rng), y = glm::normalize(glm::cross(x, anyWay(rng)));
                place.rotation = glm::dmat3(x, y, (isMirrored ? -1.0 : 1.0) * glm::cross(x, y));
                place.scale = std::exp2(rng.uniform(-8, 8));
                place.translation = 1000.0 * anyWay(rng);
                const double distance = isInside ? rng.uniform(0.0, 0.9) : std::exp2(rng.uniform(0.1, 4));
                const glm::dvec3 way = anyWay(rng);
                const View view =
                    viewFrom(place.translation + place.scale * distance * way, isInside ? anyWay(rng) : -way);
                const double tau = std::exp2(rng.uniform(-3, 3));
                sum.add(*store, store->hierarchy, place, view, tau);
                control.add(*store, turned, place, view, tau);
            }
            EXPECT_EQ(sum.wrong, 0u) << isMirrored << isInside;
            EXPECT_GT(sum.spared, sum.drawn / 20) << "of " << sum.drawn << " nodes, " << isMirrored << isInside;
            EXPECT_GT(control.wrong, 100u) << isMirrored << isInside;
        }
}

/// Verifies what `crafted` describes: what is wrong with it, or nothing.
std::string verified(const test::CraftedStore& crafted, const std::string& path, Executor& executor) {
    crafted.write(path);
    const auto store = openStore(path);
    if (!store) return "not opened: " + store.error().line();
    const auto report = verifyStore(*store, executor);
    return report ? "" : report.error().what;
}

TEST_F(Cones, VerifyingFindsThoseThatAreTooNarrow) {
    const auto store = built(test::bumpySphere(40'000, 1));
    test::CraftedStore narrow = test::CraftedStore::read(store->path);
    EXPECT_EQ(verified(narrow, folder_ / "b.stipple", *executor_), "");
    for (auto& node : narrow.nodes) node.normalConeCosine = std::min(1.0f, node.normalConeCosine + 0.2f);
    EXPECT_NE(verified(narrow, folder_ / "b.stipple", *executor_).find("cone"), std::string::npos);
}

/// A node above the leaves whose own normals are all alike may say so; but its cone hides the nodes below it, too.
TEST_F(Cones, VerifyingFindsOneThatHoldsItsOwnNormalsButNotThoseBelow) {
    const auto store = built(sheetWithBurrs());
    const test::CraftedStore whole = test::CraftedStore::read(store->path);
    size_t tried = 0;
    ConeCut lost;
    Rng rng(5);
    for (uint32_t i = 1; i < whole.nodes.size() && tried < 6; ++i) {
        const Node& node = store->hierarchy.nodes[i];
        if (node.isLeaf() || node.normalConeCosine <= 0) continue;
        ++tried;
        auto chunk = readChunk(*store, i, true);
        ASSERT_TRUE(chunk);
        for (shared::PointRecord& r : chunk->records) r.normal = node.normalCone;
        test::CraftedStore crafted = whole;
        crafted.replaceChunk(i, test::encodeAgain(*chunk));
        EXPECT_EQ(verified(crafted, folder_ / "b.stipple", *executor_), "") << "node " << i << ": other normals";
        crafted.nodes[i].normalConeCosine = 0.99999f;
        EXPECT_EQ(verified(crafted, folder_ / "b.stipple", *executor_),
                  "the cone of normals is not inside the parent's")
            << "node " << i;
        Hierarchy one = store->hierarchy;
        one.nodes[i].normalConeCosine = 0.99999f;
        const auto axis = glm::normalize(glm::dvec3(shared::octDecode(node.normalCone)));
        const glm::dvec3 centre = store->hierarchy.origin + store->hierarchy.unit * node.centre;
        for (int k = 0; k < 5; ++k) {
            // From behind and aside: of the node's own discs none is seen, of those that lean some are.
            const glm::dvec3 aside = glm::normalize(glm::cross(axis, anyWay(rng)));
            const double angle = rng.uniform(1.1, 1.3);
            const glm::dvec3 along = std::cos(angle) * axis + std::sin(angle) * aside;
            lost.add(*store, one, {}, viewFrom(centre - 20.0 * along, along), 0.1);
        }
    }
    EXPECT_EQ(tried, 6u);
    RecordProperty("lost", static_cast<int>(lost.wrong));
    EXPECT_GT(lost.wrong, 100u) << "nothing was lost by what verifying must find";
}

}  // namespace
}  // namespace stipple::lod
