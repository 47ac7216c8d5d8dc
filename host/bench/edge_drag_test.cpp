#include "host/bench/edge_drag.hpp"

#include <gtest/gtest.h>

namespace palpate::host {
namespace {

// The bound: smooth surfaces have jumps at least 20 times smaller.
constexpr double kTimesSmaller = 20.0;

class EdgeJumpsTest : public ::testing::TestWithParam<double> {};

TEST_P(EdgeJumpsTest, ASmoothSurfaceHasFarSmallerOnesAndLosesNoTick) {
  EdgeDrag drag;
  drag.nodes = {10, 8, 6};
  drag.cells = 5;
  drag.friction = GetParam();
  drag.surface = SurfaceKind::flat;
  const EdgeJumps flat = measure_edge_jumps(drag);
  drag.surface = SurfaceKind::smooth;
  const EdgeJumps smooth = measure_edge_jumps(drag);
  // The place that is touched is drawn along with friction: it need not pass over all cells.
  EXPECT_GE(smooth.crossings, static_cast<unsigned>(drag.cells));
  EXPECT_EQ(smooth.free_ticks, 0u);
  EXPECT_GT(smooth.largest_force_N, 1.0);
  EXPECT_LE(smooth.jump_N * kTimesSmaller, flat.jump_N);
}
INSTANTIATE_TEST_SUITE_P(Friction, EdgeJumpsTest, ::testing::Values(0.0, 0.3, 1.0));

}  // namespace
}  // namespace palpate::host
