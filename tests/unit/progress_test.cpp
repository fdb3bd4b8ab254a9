// One bar and one time left for a job of several stages.
#include "engine/base/progress.h"

#include <gtest/gtest.h>

#include "engine/scene/open/builds_of_scene.h"

namespace stipple {
namespace {

TEST(JobPlan, StagesAddUpToTheWholeJob) {
    JobPlan plan({{"survey", 1}, {"build", 8}, {"verify", 1}});
    EXPECT_DOUBLE_EQ(plan.advance("survey", 0.5), 0.05);
    EXPECT_DOUBLE_EQ(plan.advance("build", 0), 0.1);
    EXPECT_DOUBLE_EQ(plan.advance("build", 0.5), 0.5);
    EXPECT_DOUBLE_EQ(plan.advance("verify", 1), 1.0);
}

TEST(JobPlan, NeverGoesBack) {
    JobPlan plan({{"survey", 1}, {"build", 9}});
    EXPECT_DOUBLE_EQ(plan.advance("build", 1), 1.0);
    EXPECT_DOUBLE_EQ(plan.advance("survey", 0.5), 1.0) << "a stage that is told late";
    JobPlan other({{"survey", 1}, {"build", 9}});
    EXPECT_DOUBLE_EQ(other.advance("survey", 1), 0.1);
    EXPECT_DOUBLE_EQ(other.advance("something else", 0.9), 0.1);
    EXPECT_DOUBLE_EQ(other.advance("build", 7), 1.0) << "more than was declared";
}

TEST(JobPlan, SeveralJobsOfOneSceneAreOneJob) {
    // Three builds, of 2, 1 and 1 units, the second found in the cache: nothing begins anew.
    JobPlan plan;
    plan.beginPart(0, 2, 2);
    EXPECT_DOUBLE_EQ(plan.advance("read", 0.5), 0.25) << "before it has stages";
    plan.setStages({{"survey", 1}, {"build", 3}});
    EXPECT_DOUBLE_EQ(plan.advance("survey", 0.5), 0.25) << "never back";
    EXPECT_DOUBLE_EQ(plan.advance("build", 1.0 / 3), 0.25);
    EXPECT_DOUBLE_EQ(plan.advance("build", 1), 0.5);
    plan.beginPart(2, 1, 0);
    plan.setStages({{"survey", 1}, {"build", 3}});
    EXPECT_DOUBLE_EQ(plan.advance("survey", 0), 2.0 / 3);
    EXPECT_DOUBLE_EQ(plan.advance("build", 1), 1.0);
    JobPlan alone;  // negative control: what each build had to itself
    alone.setStages({{"survey", 1}, {"build", 3}});
    EXPECT_LT(alone.advance("survey", 0), 0.5);
}

TEST(BuildsOfScene, ShareOneBar) {
    scene::BuildsOfScene builds(ProgressStyle::silent, {}, {"a.glb: a note"});
    builds.expect("mesh 0", 10);
    builds.expect("mesh 0, proxy", 10);
    builds.expect("curves", 20);
    Progress* const first = &builds.begin("mesh 0");
    builds.settle("mesh 0");
    builds.settle("mesh 0, proxy");  // found
    EXPECT_EQ(&builds.begin("curves"), first);
    builds.settle("curves");
    EXPECT_EQ(&builds.begin("what nobody expected"), first);
    EXPECT_TRUE(builds.says("a.glb: a note"));
    EXPECT_FALSE(builds.says("another"));
}

TEST(JobPlan, WithoutAPlanAStageIsTheJob) {
    JobPlan plan;
    EXPECT_DOUBLE_EQ(plan.advance("read", 0.25), 0.25);
}

}  // namespace
}  // namespace stipple
