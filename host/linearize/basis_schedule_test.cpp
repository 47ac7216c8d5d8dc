#include "host/linearize/basis_schedule.hpp"

#include <gtest/gtest.h>

namespace palpate::host {
namespace {

const Ports kA{1}, kB{2}, kC{3};

TEST(BasisSchedule, HasABasisALatencyAfterItWasWanted) {
  BasisSchedule schedule(100);
  schedule.want(10, {kA});
  EXPECT_EQ(schedule.current(), kA);
  schedule.want(109, {kA});
  EXPECT_FALSE(schedule.ready(kA));
  schedule.want(110, {kA});
  EXPECT_TRUE(schedule.ready(kA));
  EXPECT_FALSE(schedule.current());
  schedule.want(5000, {});
  EXPECT_TRUE(schedule.ready(kA));
}

TEST(BasisSchedule, ComputesOneAfterTheOther) {
  BasisSchedule schedule(100);
  schedule.want(0, {kA, kB});
  schedule.want(150, {kA, kB});
  EXPECT_TRUE(schedule.ready(kA));
  EXPECT_EQ(schedule.current(), kB);
  // Begun at 100, as soon as the first was done, although nobody looked then.
  schedule.want(199, {kA, kB});
  EXPECT_FALSE(schedule.ready(kB));
  schedule.want(200, {kA, kB});
  EXPECT_TRUE(schedule.ready(kB));
}

TEST(BasisSchedule, ForgetsWhatIsNoLongerWantedAndHasNotBegun) {
  BasisSchedule schedule(100);
  schedule.want(0, {kA, kB});
  schedule.want(50, {kC, kB});
  schedule.want(120, {kC, kB});
  EXPECT_TRUE(schedule.ready(kA));  // had begun
  EXPECT_EQ(schedule.current(), kC);
  schedule.want(1000, {});
  EXPECT_TRUE(schedule.ready(kB));
}

TEST(BasisSchedule, WithoutLatencyAllIsThereAtOnce) {
  BasisSchedule schedule(0);
  schedule.want(7, {kA, kB});
  EXPECT_TRUE(schedule.ready(kA));
  EXPECT_TRUE(schedule.ready(kB));
}

}  // namespace
}  // namespace palpate::host
