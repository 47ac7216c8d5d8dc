#include "host/linearize/patch_bases.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>

#include "host/msd/lattice.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr int kPortLimit = 32;

class Patches : public testing::Test {
 protected:
  [[nodiscard]] SurfacePoint top_at(double x_m) const {
    const Eigen::Matrix3Xd& rest_m = body_.rest_position_m();
    const Eigen::Vector3d middle_m = 0.5 * (rest_m.rowwise().minCoeff() + rest_m.rowwise().maxCoeff());
    return nearest_surface_point(body_, rest_m, middle_m + Eigen::Vector3d(x_m, 0.0, 1.0));
  }
  [[nodiscard]] PatchBases patches(BasisTiming timing) const {
    return {body_, PatchSize{4, 4, 2}, kPortLimit, {0.0}, {timing, 100, std::nullopt}};
  }
  // 8 nodes a side, 1 cm apart; the middle is in a cell.
  Body body_ = make_lattice(test::reference_spec(8));
  SurfacePoint here_ = top_at(0.0), beside_ = top_at(0.01), far_ = top_at(-0.02);
};

TEST_F(Patches, WaitForTheirBasisWhereTheyMay) {
  PatchBases patches = this->patches(BasisTiming::waits);
  const PatchBasis* patch = patches.at(here_);
  ASSERT_NE(patch, nullptr);
  EXPECT_EQ(patch->nodes, select_patch(body_, here_, PatchSize{4, 4, 2}));
  EXPECT_EQ(patch->span->lambda_rad2_s2.size(), 3 * std::ssize(patch->surface.node));
  EXPECT_EQ(patches.waits(), 0U);
}

TEST_F(Patches, AreThereAfterTheLatencyInVirtualTime) {
  PatchBases patches = this->patches(BasisTiming::virtual_time);
  EXPECT_EQ(patches.at(here_), nullptr);
  patches.foresee(0, std::array{here_});
  EXPECT_EQ(patches.at(here_), nullptr);
  patches.foresee(99, std::array{here_});
  EXPECT_EQ(patches.at(here_), nullptr);
  patches.foresee(100, std::array{here_});
  EXPECT_NE(patches.at(here_), nullptr);
  EXPECT_EQ(patches.waits(), 3U);
}

TEST_F(Patches, GoOnWithTheOneBeforeWhileTheContactIsOnIt) {
  PatchBases patches = this->patches(BasisTiming::virtual_time);
  patches.foresee(0, std::array{here_});
  patches.foresee(100, std::array{here_});
  const std::vector<int> before = patches.at(here_)->nodes;
  patches.foresee(130, std::array{beside_});
  ASSERT_NE(patches.at(beside_), nullptr);
  EXPECT_EQ(patches.at(beside_)->nodes, before);
  EXPECT_EQ(patches.at(far_), nullptr);
  patches.foresee(230, std::array{beside_});
  EXPECT_EQ(patches.at(beside_)->nodes, select_patch(body_, beside_, PatchSize{4, 4, 2}));
}

TEST_F(Patches, AreThereInTimeWhenForeseen) {
  PatchBases patches = this->patches(BasisTiming::virtual_time);
  patches.foresee(0, std::array{here_, beside_});
  patches.foresee(200, std::array{beside_});
  EXPECT_EQ(patches.at(beside_)->nodes, select_patch(body_, beside_, PatchSize{4, 4, 2}));
  EXPECT_EQ(patches.waits(), 0U);
}

TEST_F(Patches, NeverWaitInRealTime) {
  PatchBases patches = this->patches(BasisTiming::as_it_comes);
  patches.foresee(0, std::array{here_});
  while (patches.at(here_) == nullptr) std::this_thread::yield();
  EXPECT_EQ(patches.at(here_)->nodes, select_patch(body_, here_, PatchSize{4, 4, 2}));
}

}  // namespace
}  // namespace palpate::host
