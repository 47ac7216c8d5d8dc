#include "boards/stm32g4/parameter_store.hpp"

#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <random>
#include <vector>

namespace palpate::stm32g4 {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Flash whose power fails in the middle of a step, which is an erase or the programming of 8 bytes.
class FailingFlash {
 public:
  static constexpr std::uint32_t kSlot_bytes = 256;

  // What an interrupted step leaves.
  enum class Damage { nothing_done, all_done, garbage, unreadable };

  bool erase(std::uint32_t slot) {
    if (!power()) return false;
    const bool fails = fails_now();
    for (std::uint32_t at = 0; at < kSlot_bytes; at += 8) {
      Word& one = words_[{slot, at}];
      if (!fails || damage_ == Damage::all_done)
        one = {};
      else
        damage(one);
    }
    return !fails;
  }
  bool program(std::uint32_t slot, std::uint32_t offset, std::uint64_t value) {
    EXPECT_EQ(offset % 8, 0u);
    EXPECT_LT(offset, kSlot_bytes);
    if (!power()) return false;
    Word& one = words_[{slot, offset}];
    EXPECT_EQ(one.value, kErased) << "programmed twice";
    if (!fails_now() || damage_ == Damage::all_done) {
      one.value = value;
    } else {
      damage(one);
    }
    return power();
  }
  bool read(std::uint32_t slot, std::uint32_t offset, std::uint64_t& value) {
    EXPECT_LT(offset, kSlot_bytes);
    const Word& one = words_[{slot, offset}];
    value = one.value;
    return one.readable;
  }

  void fail_at(int step, Damage damage) {
    steps_left_ = step;
    damage_ = damage;
  }
  void power_up() { steps_left_ = -1; }
  [[nodiscard]] bool power() const { return steps_left_ != 0; }
  [[nodiscard]] int steps() const { return steps_; }

 private:
  static constexpr std::uint64_t kErased = ~std::uint64_t{0};
  struct Word {
    std::uint64_t value = kErased;
    bool readable = true;
  };
  bool fails_now() {
    ++steps_;
    if (steps_left_ > 0) --steps_left_;
    return steps_left_ == 0;
  }
  void damage(Word& one) {
    if (damage_ == Damage::garbage) one.value &= random_();  // some bits are down, as programming leaves them
    if (damage_ == Damage::unreadable) one.readable = false;
  }

  std::map<std::pair<std::uint32_t, std::uint32_t>, Word> words_;
  int steps_left_ = -1;  // until the power fails; -1: never
  int steps_ = 0;
  Damage damage_ = Damage::nothing_done;
  std::mt19937_64 random_{7};
};

using Store = ParameterStore<FailingFlash>;
using Damage = FailingFlash::Damage;

Bytes content(std::size_t length, std::uint8_t first) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), first);
  return bytes;
}

TEST(ParameterStore, IsEmptyAtFirst) {
  FailingFlash flash;
  Bytes out(12, 0xAB);
  EXPECT_EQ(Store(flash).read(out), StoreResult::empty);
  EXPECT_EQ(out, Bytes(12, 0xAB));
}

TEST(ParameterStore, KeepsTheNewest) {
  FailingFlash flash;
  for (const std::size_t length :
       {std::size_t{0}, std::size_t{1}, std::size_t{8}, std::size_t{13}, std::size_t{Store::kMax_bytes}}) {
    for (std::uint8_t round = 0; round < 5; ++round) {
      ASSERT_EQ(Store(flash).write(content(length, round)), StoreResult::ok);
      Bytes out(length);
      ASSERT_EQ(Store(flash).read(out), StoreResult::ok);
      EXPECT_EQ(out, content(length, round));
    }
  }
  EXPECT_EQ(Store(flash).write(Bytes(Store::kMax_bytes + 1)), StoreResult::too_long);
}

TEST(ParameterStore, AnotherLengthIsNoneOfOurs) {
  FailingFlash flash;
  ASSERT_EQ(Store(flash).write(content(16, 1)), StoreResult::ok);
  Bytes shorter(15), longer(17);
  EXPECT_EQ(Store(flash).read(shorter), StoreResult::empty);
  EXPECT_EQ(Store(flash).read(longer), StoreResult::empty);
}

class PowerFails : public testing::TestWithParam<Damage> {};

// At every step of a write: afterwards there is what was before, or what is new, and the next write works.
TEST_P(PowerFails, AtEveryStep) {
  const Bytes before = content(48, 1), after = content(48, 101), next = content(48, 201);
  FailingFlash undisturbed;
  ASSERT_EQ(Store(undisturbed).write(before), StoreResult::ok);
  const int steps_before = undisturbed.steps();
  ASSERT_EQ(Store(undisturbed).write(after), StoreResult::ok);
  const int steps = undisturbed.steps() - steps_before;
  ASSERT_EQ(steps, 1 + 2 + 6 + 1);  // erase, head, content, check

  for (int step = 1; step <= steps; ++step) {
    SCOPED_TRACE(step);
    FailingFlash flash;
    // Twice, so that there is an older record to lose, too.
    ASSERT_EQ(Store(flash).write(content(48, 50)), StoreResult::ok);
    ASSERT_EQ(Store(flash).write(before), StoreResult::ok);
    flash.fail_at(step, GetParam());
    EXPECT_EQ(Store(flash).write(after), StoreResult::flash_failed);
    flash.power_up();
    Bytes out(48);
    ASSERT_EQ(Store(flash).read(out), StoreResult::ok);
    const bool complete = step == steps && GetParam() == Damage::all_done;
    EXPECT_EQ(out, complete ? after : before);
    ASSERT_EQ(Store(flash).write(next), StoreResult::ok);
    ASSERT_EQ(Store(flash).read(out), StoreResult::ok);
    EXPECT_EQ(out, next);
  }
}
INSTANTIATE_TEST_SUITE_P(Damage, PowerFails,
                         testing::Values(Damage::nothing_done, Damage::all_done, Damage::garbage,
                                         Damage::unreadable));

TEST(ParameterStore, TheVeryFirstWriteMayFail) {
  for (const Damage damage : {Damage::garbage, Damage::unreadable}) {
    FailingFlash flash;
    flash.fail_at(3, damage);
    EXPECT_EQ(Store(flash).write(content(48, 1)), StoreResult::flash_failed);
    flash.power_up();
    Bytes out(48);
    EXPECT_EQ(Store(flash).read(out), StoreResult::empty);
    EXPECT_EQ(Store(flash).write(content(48, 2)), StoreResult::ok);
  }
}

}  // namespace
}  // namespace palpate::stm32g4
