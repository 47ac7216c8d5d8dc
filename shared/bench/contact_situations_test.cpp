#include "shared/bench/contact_situations.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <tuple>

namespace palpate::bench {
namespace {

class EachSize : public ::testing::TestWithParam<std::tuple<ModelSize, SurfaceKind>> {
 protected:
  ModelSize size_ = std::get<0>(GetParam());
  SurfaceKind surface_ = std::get<1>(GetParam());
};

TEST_P(EachSize, EveryKindOfTickIsAmongAThousand) {
  const auto situations = std::make_unique<ContactSituations>();
  std::array<int, kTickKinds> count{};
  for (std::uint32_t i = 0; i < 1000; ++i) {
    situations->prepare(size_, surface_, i);
    for (int tick = 0; tick < 2; ++tick) {
      situations->step();
      ++count[static_cast<std::size_t>(situations->finish())];
      EXPECT_TRUE(is_finite(situations->contact().force_N));
    }
  }
  constexpr int kEnough = 20;
  for (std::size_t kind = 0; kind < kTickKinds; ++kind) EXPECT_GE(count[kind], kEnough) << kind;
}

TEST_P(EachSize, ASituationDependsOnItsNumberOnly) {
  const auto one = std::make_unique<ContactSituations>(), other = std::make_unique<ContactSituations>();
  one->prepare(size_, surface_, 3);
  other->prepare(size_, surface_, ContactSituations::kSituationsPerModel + 1);
  other->prepare(size_, surface_, 3);
  one->step();
  other->step();
  EXPECT_EQ(one->finish(), other->finish());
  EXPECT_EQ(one->contact().force_N, other->contact().force_N);
}
INSTANTIATE_TEST_SUITE_P(Sizes, EachSize,
                         ::testing::Combine(::testing::Values(ModelSize::modes_96_nodes_32,
                                                              ModelSize::modes_192_nodes_16),
                                            ::testing::ValuesIn(kSurfaces)));

}  // namespace
}  // namespace palpate::bench
