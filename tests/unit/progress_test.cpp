// One bar and one time left for a job of several stages.
#include "engine/base/progress.h"

#include <gtest/gtest.h>

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

TEST(JobPlan, WithoutAPlanAStageIsTheJob) {
    JobPlan plan;
    EXPECT_DOUBLE_EQ(plan.advance("read", 0.25), 0.25);
}

}  // namespace
}  // namespace stipple
