#include "firmware/core/outputs.hpp"

#include <gtest/gtest.h>

#include <string>
#include <type_traits>

namespace palpate::firmware {
namespace {

// No code but Outputs can make the key to the amplifiers.
static_assert(!std::is_default_constructible_v<EnableKey>);
static_assert(!std::is_aggregate_v<EnableKey>);

// Writes down what is asked of the amplifiers, in order.
struct Amplifiers {
  std::string log;
  std::array<float, 3> setpoint_A{};
  void isr_set_currents(const std::array<float, 3>& wanted_A) {
    setpoint_A = wanted_A;
    log += "set ";
  }
  void isr_enable_amplifiers(EnableKey) { log += "enable "; }
  void isr_disable_amplifiers() { log += "disable "; }
};

TEST(Outputs, SetPointsComeBeforeTheEnable) {
  Amplifiers amplifiers;
  Outputs outputs(amplifiers);
  outputs.isr_apply(true, {1.0f, 2.0f, 3.0f});
  EXPECT_EQ(amplifiers.log, "set enable ");
  EXPECT_EQ(amplifiers.setpoint_A, (std::array<float, 3>{1.0f, 2.0f, 3.0f}));
}

TEST(Outputs, OffMeansZeroAndDisabledWhateverIsAskedFor) {
  Amplifiers amplifiers;
  Outputs outputs(amplifiers);
  outputs.isr_apply(false, {1.0f, 2.0f, 3.0f});
  EXPECT_EQ(amplifiers.log, "set disable ");
  EXPECT_EQ(amplifiers.setpoint_A, (std::array<float, 3>{}));
}

}  // namespace
}  // namespace palpate::firmware
