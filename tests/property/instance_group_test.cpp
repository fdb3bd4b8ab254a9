// Stochastic stores and instance groups attacked: any beginning stands for the whole, every member is drawn exactly
// once whatever is resident, discs are no larger than the error allows.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "engine/scene/camera.h"
#include "lod/builder/curves/curve_coverage.h"
#include "tests/support/forests.h"

namespace stipple {
namespace {

/// How unevenly the first `count` samples lie over eight octants of the whole, against all of them: largest difference
/// of shares.
double unevenness(const std::vector<glm::dvec3>& position, size_t count, const glm::dvec3& middle) {
    std::array<double, 8> some{}, all{};
    for (size_t k = 0; k < position.size(); ++k) {
        const glm::dvec3& p = position[k];
        const size_t o = (p.x > middle.x ? 1u : 0u) + (p.y > middle.y ? 2u : 0u) + (p.z > middle.z ? 4u : 0u);
        all.at(o) += 1.0 / static_cast<double>(position.size());
        if (k < count) some.at(o) += 1.0 / static_cast<double>(count);
    }
    double worst = 0;
    for (size_t o = 0; o < 8; ++o) worst = std::max(worst, std::abs(some.at(o) - all.at(o)));
    return worst;
}

TEST(CurveSamples, AnyBeginningIsSpreadOverTheWhole) {
    const lod::CurveSet tree = test::oak(5000);
    const lod::CurveSamples samples = lod::sampleCurves(tree, 10'000);
    const std::vector<glm::dvec3>& p = samples.points.position;
    ASSERT_NEAR(static_cast<double>(p.size()), 10'000, 2);
    glm::dvec3 middle(0);
    for (const glm::dvec3& at : p) middle += at / static_cast<double>(p.size());
    for (const size_t count : {100u, 333u, 1000u, 4097u}) {
        // By chance alone shares of n would differ by about sqrt(1/8 * 7/8 / n); eight of them, so three times that.
        const double byChance = 3 * std::sqrt(0.11 / static_cast<double>(count));
        EXPECT_LE(unevenness(p, count, middle), byChance) << count;
    }
    // Negative control: the order of the curves themselves is not spread.
    std::vector<glm::dvec3> sorted = p;
    std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.y < b.y; });
    EXPECT_GT(unevenness(sorted, 1000, middle), 3 * std::sqrt(0.11 / 1000));
}

TEST(CurveSamples, CoverWhatTheCurvesCover) {
    const auto executor = makeTbbExecutor(0);
    // Far apart: ribbons do not hide each other, so areas are all there is, and few discs need no correction.
    lod::CurveSet apart;
    Rng rng(3);
    for (int k = 0; k < 400; ++k) {
        const glm::dvec3 at(rng.uniform(0, 100), rng.uniform(0, 100), rng.uniform(0, 100));
        const glm::dvec3 d(rng.normal(), rng.normal(), rng.normal());
        const glm::vec3 n(glm::normalize(glm::cross(d, glm::dvec3(rng.normal(), rng.normal(), rng.normal()))));
        apart.addVertex(at, 0.3f, n, 0x30a030u);
        apart.addVertex(at + glm::normalize(d), 0.3f, n, 0x30a030u);
        apart.endCurve(true);
    }
    apart = lod::cleanCurves(std::move(apart), 0);
    const std::vector<float> far = lod::coverageFactors(apart, lod::sampleCurves(apart, 4000), *executor);
    ASSERT_GE(far.size(), 6u);
    EXPECT_GT(far[0], 1.05f);                                                  // ten discs on one ribbon overlap
    for (size_t k = 4; k < far.size(); ++k) EXPECT_NEAR(far[k], 1, 0.1) << k;  // one, or none
    // A tree's leaves hide each other: fewer, larger discs hide each other less, so they are drawn smaller.
    const lod::CurveSet tree = test::oak(20'000);
    const std::vector<float> factors = lod::coverageFactors(tree, lod::sampleCurves(tree, 16'384), *executor);
    ASSERT_GE(factors.size(), 8u);
    EXPECT_LT(factors.back(), 0.9f * factors.front());
    for (const float factor : factors) EXPECT_GT(factor, 0.3f);
}

TEST(CurveHierarchy, MergedPartsKeepTheArea) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto store = test::buildCurves(test::oak(4000), folder / "a.stipple", *executor, 512);
    const auto areaAt = [&](uint32_t code) {
        double area = 0;
        const lod::Hierarchy& h = store->hierarchy;
        for (uint32_t i = 0; i < h.nodes.size(); ++i) {
            const auto chunk = lod::readChunk(*store, i);
            const uint32_t count =
                i == 0 ? h.nodes[i].records : h.countGreater(h.nodes[i].parentCounts, h.nodes[i].records, code);
            for (uint32_t k = 0; k < count; ++k) {
                const reference::Segment s = reference::decodeSegment(h, h.nodes[i], chunk->segments[k]);
                if (s.errorCode <= code) area += glm::length(s.b - s.a) * (s.radiusA + s.radiusB);
            }
        }
        return area;
    };
    const double whole = areaAt(0);
    // Leaves are thin at both ends: a chord with the radii of its ends would keep a fifth of them.
    for (const double error : {0.02, 0.05, 0.1, 0.3})
        EXPECT_NEAR(areaAt(store->hierarchy.errors.encodeUp(error / store->hierarchy.unit)) / whole, 1, 0.1) << error;
}

class InstanceGroups : public testing::Test {
  protected:
    lod::View viewFrom(const glm::dvec3& eye, const glm::dvec3& target) const {
        scene::Camera camera;
        camera.eye = eye;
        camera.target = target;
        camera.up = {0, 1, 0};
        camera.fovDegrees = 100;
        return scene::makeView(camera, 1600, 1200, 0.05);
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    test::Forest forest_ = test::plantForest(folder_.path(), 12, *executor_);
};

/// What draws each member: itself (or what stands in for it), or the nodes of the instance group's points above its
/// leaf.
std::string whatIsWrong(const lod::CutScene& scene, const lod::Cut& cut) {
    std::map<uint32_t, int> times;  // by member
    const lod::InstanceGroup& group = scene.groups[0];
    std::map<uint32_t, uint32_t> memberOf;
    for (const uint32_t m : group.members)
        for (uint32_t i = m; i != lod::Instance::kNone; i = scene.instances[i].proxy) memberOf[i] = m;
    const lod::Hierarchy& h = *scene.hierarchies[scene.instances[group.points].hierarchy];
    std::map<uint32_t, bool> own;
    for (const lod::CutDraw& d : cut.draw) {
        if (d.instance != group.points) {
            own[memberOf.at(d.instance)] = true;  // several nodes of one store are one drawing
            continue;
        }
        for (uint32_t leaf = 0; leaf < h.nodes.size(); ++leaf) {
            if (!h.nodes[leaf].isLeaf()) continue;
            bool isBelow = false;
            for (uint32_t n = leaf;; n = h.nodes[n].parent) {
                isBelow = isBelow || n == d.node;
                if (n == 0) break;
            }
            for (uint32_t k = group.first[leaf]; isBelow && k < group.first[leaf + 1]; ++k) ++times[group.members[k]];
        }
    }
    for (const auto& [m, is] : own) times[m] += is ? 1 : 0;
    for (const uint32_t m : group.members)
        if (times[m] != 1) return "member " + std::to_string(m) + " is drawn " + std::to_string(times[m]) + " times";
    return {};
}

TEST_F(InstanceGroups, DrawEveryMemberOnceWhateverIsResident) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto state = render::makeFrameState(forest_.placed, *backend, *executor_, {}, forest_.groups);
    const lod::CutScene scene = state->scene();
    const lod::InstanceGroup& group = scene.groups[0];
    std::vector<std::vector<uint8_t>> drawable;
    const auto resize = [&](const lod::Instance& i) {
        if (drawable.size() <= i.source) drawable.resize(i.source + 1);
        drawable[i.source].assign(scene.hierarchies[i.hierarchy]->nodes.size(), 1);
    };
    for (const lod::Instance& i : scene.instances) resize(i);
    Rng rng(5);
    lod::CutScratch scratch;
    lod::Cut cut;
    size_t mixed = 0;
    for (int round = 0; round < 300; ++round) {
        const glm::dvec3 middle(44, 8, 44);
        const double distance = std::exp2(rng.uniform(6.6, 8.5));  // all of the forest is in view
        const double a = rng.uniform(0, 6.28);
        const lod::View view =
            viewFrom(middle + distance * glm::dvec3(std::cos(a), rng.uniform(0.1, 1), std::sin(a)), middle);
        const double tau = std::exp2(rng.uniform(1, 4));
        const bool isWhole = round % 3 == 0;
        for (const lod::Instance& i : scene.instances)
            for (uint8_t& d : drawable[i.source]) d = isWhole || rng.below(4) > 0 ? 1 : 0;
        // Roots are asked for first; without them nothing can be drawn.
        for (auto& of : drawable) of[0] = 1;
        lod::selectCut(scene, {drawable}, view, {tau, std::numeric_limits<uint64_t>::max()}, scratch, cut);
        ASSERT_EQ(whatIsWrong(scene, cut), "") << "round " << round << ", distance " << distance << ", tau " << tau;
        for (const lod::CutDraw& d : cut.draw)
            if (isWhole) ASSERT_LE(d.errorPixels, tau * 1.0001) << "node " << d.node << " of " << d.instance;
        mixed += cut.counters.groupMembers > 0 && cut.counters.groupMembers < group.members.size() ? 1 : 0;
        // The same again is the same to the last record.
        lod::Cut again;
        lod::CutScratch fresh;
        lod::selectCut(scene, {drawable}, view, {tau, std::numeric_limits<uint64_t>::max()}, fresh, again);
        ASSERT_EQ(again.draw.size(), cut.draw.size());
        for (size_t k = 0; k < cut.draw.size(); ++k) {
            ASSERT_EQ(again.draw[k].node, cut.draw[k].node);
            ASSERT_EQ(again.draw[k].count, cut.draw[k].count);
        }
        // Negative control: without one of its drawings a member is missing.
        if (cut.draw.size() < 2) continue;
        lod::Cut holed = cut;
        const uint32_t first = holed.draw.front().instance, node = holed.draw.front().node;
        std::erase_if(holed.draw,
                      [&](const auto& d) { return d.instance == first && (first != group.points || d.node == node); });
        ASSERT_NE(whatIsWrong(scene, holed), "");
    }
    EXPECT_GT(mixed, 20u) << "some views must have both";
}

TEST_F(InstanceGroups, AreNotDrawnWhereTheirMembersWouldSwayFartherThanTheError) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto state = render::makeFrameState(forest_.placed, *backend, *executor_, {}, forest_.groups);
    const lod::CutScene scene = state->scene();
    const lod::InstanceGroup& group = scene.groups[0];
    std::vector<std::vector<uint8_t>> drawable;
    for (const lod::Instance& i : scene.instances) {
        if (drawable.size() <= i.source) drawable.resize(i.source + 1);
        drawable[i.source].assign(scene.hierarchies[i.hierarchy]->nodes.size(), 1);
    }
    /// Of 40 views: draws of the group whose stated error is less than what one of its trees moves at the far end of
    /// the node; draws of it in all; members that are drawn themselves.
    struct Found {
        size_t wrong = 0, drawn = 0, members = 0;
    };
    const auto found = [&](double strength, bool isTold) {
        render::setSway(
            {strength, 1.3, {1, 0, 0}}, state->hierarchies, state->instances,
            isTold ? std::span<const lod::InstanceGroup>(state->groups) : std::span<const lod::InstanceGroup>());
        if (!isTold) state->instances[group.points].sway = state->instances[group.points].inputError = 0;
        double sway = 0;
        for (const uint32_t m : group.members)
            for (uint32_t k = m; k != lod::Instance::kNone; k = state->instances[k].proxy)
                sway = std::max(sway, state->instances[k].sway);
        Found of;
        Rng rng(7);
        lod::CutScratch scratch;
        lod::Cut cut;
        for (int round = 0; round < 40; ++round) {
            const glm::dvec3 middle(44, 8, 44);
            const double distance = std::exp2(rng.uniform(6.6, 13)), a = rng.uniform(0, 6.28);
            const lod::View view =
                viewFrom(middle + distance * glm::dvec3(std::cos(a), rng.uniform(0.1, 1), std::sin(a)), middle);
            const double tau = std::exp2(rng.uniform(0, 4));
            lod::selectCut(scene, {drawable}, view, {tau, std::numeric_limits<uint64_t>::max()}, scratch, cut);
            EXPECT_EQ(whatIsWrong(scene, cut), "") << "round " << round;
            EXPECT_LE(cut.tauEffective, tau * 1.0001);
            of.members += cut.counters.groupMembers;
            for (const lod::CutDraw& d : cut.draw) {
                if (d.instance != group.points) continue;
                const lod::Instance& place = scene.instances[d.instance];
                const lod::Hierarchy& h = *scene.hierarchies[place.hierarchy];
                const lod::Node& node = h.nodes[d.node];
                const glm::dvec3 centre =
                    place.translation + place.rotation * (place.scale * (h.origin + h.unit * node.centre));
                const double farthest = glm::length(centre - view.eye) + place.scale * h.unit * node.radius;
                of.wrong += sway * view.focalPixels / farthest > d.errorPixels ? 1 : 0;
                ++of.drawn;
            }
        }
        return of;
    };
    const Found calm = found(0, true), gale = found(0.5, true), untold = found(0.5, false);
    EXPECT_EQ(gale.wrong, 0u);
    EXPECT_GT(gale.drawn, 0u) << "from far enough away the group is as good";
    EXPECT_GT(gale.members, calm.members);
    EXPECT_GT(untold.wrong, 20u) << "negative control: nobody tells the group";
}

TEST_F(InstanceGroups, StayWithinABudgetAndAskForWhatTheyNeed) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto state = render::makeFrameState(forest_.placed, *backend, *executor_, {}, forest_.groups);
    const lod::View view = viewFrom({44, 40, 130}, {44, 5, 44});
    render::FrameSettings settings;
    settings.budgets = {0.5, 20'000};
    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
    EXPECT_LE(state->counters.recordsDrawn, 20'000u);
    EXPECT_GT(state->counters.tauEffectivePixels, 0.5);
    settings.budgets.records = std::numeric_limits<uint64_t>::max();
    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
    EXPECT_DOUBLE_EQ(state->counters.tauEffectivePixels, 0.5);
    EXPECT_GT(state->counters.groupMembers, 0u);
}

TEST_F(InstanceGroups, StoresAreTheSameForAnyNumberOfThreads) {
    const test::TempFolder other;
    const auto one = makeTbbExecutor(1);
    test::plantForest(other.path(), 12, *one);
    for (const char* name : {"/afar.stipple", "/group.stipple", "/tree.stipple"})
        EXPECT_EQ(test::slurp(folder_.path() + name), test::slurp(other.path() + name)) << name;
}

}  // namespace
}  // namespace stipple
