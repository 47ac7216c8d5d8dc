#include "firmware/core/deadline_monitor.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kPeriod = 25'000;

// A periodic timer that remembers one interrupt, as the hardware does.
class Timer {
 public:
  explicit Timer(std::uint64_t start) : now_(start), next_due_(start + kPeriod), first_due_(next_due_) {}

  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(now_); }
  [[nodiscard]] std::uint32_t first_due() const { return static_cast<std::uint32_t>(first_due_); }
  // The number that a tick has whose interrupt begins now: the newest due time.
  [[nodiscard]] std::uint32_t number() const {
    return static_cast<std::uint32_t>((now_ - first_due_) / kPeriod);
  }
  void pass(std::uint64_t counts) { now_ += counts; }
  // Time of the next interrupt's begin: at once when one is pending.
  void wait() {
    if (now_ < next_due_) now_ = next_due_;
    next_due_ += (now_ - next_due_) / kPeriod * kPeriod + kPeriod;
  }

 private:
  std::uint64_t now_, next_due_, first_due_;
};

std::uint32_t run_tick(Timer& timer, DeadlineMonitor& monitor, std::uint32_t length) {
  timer.wait();
  EXPECT_TRUE(monitor.isr_begin(timer.count()));
  timer.pass(length);
  const std::uint32_t missed = monitor.isr_check(timer.count());
  monitor.isr_end(timer.count());
  return missed;
}

TEST(DeadlineMonitor, CountsTicksThatAreInTime) {
  Timer timer(1000);
  DeadlineMonitor monitor;
  monitor.isr_start(kPeriod, timer.first_due());
  for (std::uint32_t tick = 0; tick < 100; ++tick) {
    EXPECT_EQ(run_tick(timer, monitor, kPeriod - 1), 0u);
    EXPECT_EQ(monitor.tick(), tick);
    EXPECT_EQ(monitor.next_tick(), tick + 1);
    EXPECT_EQ(monitor.elapsed_ticks(), 1u);
  }
  EXPECT_EQ(monitor.missed_deadlines(), 0u);
  EXPECT_EQ(monitor.worst_tick_count(), kPeriod - 1);
  (void)run_tick(timer, monitor, 100);
  EXPECT_EQ(monitor.tick_count(), 100u);
  EXPECT_EQ(monitor.worst_tick_count(), kPeriod - 1);
}

TEST(DeadlineMonitor, AnOverlongTickMissesEachDeadlineThatPasses) {
  for (const std::uint32_t periods : {1u, 2u, 5u, 40u}) {
    Timer timer(0);
    DeadlineMonitor monitor;
    monitor.isr_start(kPeriod, timer.first_due());
    (void)run_tick(timer, monitor, 100);
    EXPECT_EQ(run_tick(timer, monitor, periods * kPeriod + kPeriod / 2), periods);
    EXPECT_EQ(monitor.next_tick(), 1 + periods);
    // The next tick starts late, in the middle of its period, and is in time all the same.
    EXPECT_EQ(run_tick(timer, monitor, 100), 0u);
    EXPECT_EQ(monitor.tick(), 1 + periods);
    EXPECT_EQ(monitor.elapsed_ticks(), periods);
    EXPECT_EQ(monitor.missed_deadlines(), periods);
  }
}

// Whatever the ticks' lengths: the number of a tick is the time at which it begins, in ticks, across wraps of
// the clock.
TEST(DeadlineMonitor, TickNumberIsTime) {
  std::mt19937 random(7);
  std::uniform_int_distribution<std::uint32_t> length(10, 4 * kPeriod);
  Timer timer(0xFFFF0000u);
  DeadlineMonitor monitor;
  monitor.isr_start(kPeriod, timer.first_due());
  for (std::uint32_t i = 0; i < 200'000; ++i) {
    timer.wait();
    ASSERT_TRUE(monitor.isr_begin(timer.count()));
    ASSERT_EQ(monitor.tick(), timer.number());
    timer.pass(length(random) / (i % 3 + 1));
    (void)monitor.isr_check(timer.count());
    monitor.isr_end(timer.count());
  }
}

// A first due time that is a little early, and time between isr_check() and the end of the interrupt, may put
// single ticks on the wrong side of a boundary. The numbers must come back by themselves.
TEST(DeadlineMonitor, RecoversFromBoundaryCases) {
  constexpr std::uint32_t kEarly = kPeriod / 10;
  constexpr std::uint32_t kAfterCheck = kPeriod / 10;
  std::mt19937 random(11);
  std::uniform_int_distribution<std::uint32_t> length(1, 3 * kPeriod);
  Timer timer(0);
  DeadlineMonitor monitor;
  monitor.isr_start(kPeriod, timer.first_due() - kEarly);
  for (int i = 0; i < 50'000; ++i) {
    timer.wait();
    if (!monitor.isr_begin(timer.count())) {
      timer.pass(10);
      continue;
    }
    const auto error = static_cast<std::int32_t>(monitor.tick() - timer.number());
    ASSERT_LE(error, 1);
    ASSERT_GE(error, -1);
    timer.pass(length(random));
    (void)monitor.isr_check(timer.count());
    timer.pass(kAfterCheck);
    monitor.isr_end(timer.count());
  }
  for (int i = 0; i < 3; ++i) {
    timer.wait();
    if (!monitor.isr_begin(timer.count())) continue;
    (void)monitor.isr_check(timer.count() + 100);
  }
  EXPECT_EQ(monitor.tick(), timer.number());
}

// Half a tick is the border between one that comes early and one that has been counted as lost.
TEST(DeadlineMonitor, AnInterruptOfATickThatIsCountedAlreadyIsNone) {
  DeadlineMonitor monitor;
  monitor.isr_start(kPeriod, kPeriod);
  ASSERT_TRUE(monitor.isr_begin(kPeriod));
  EXPECT_EQ(monitor.isr_check(kPeriod + 100), 0u);
  monitor.isr_end(kPeriod + 100);
  EXPECT_FALSE(monitor.isr_begin(2 * kPeriod - kPeriod / 2 - 1));
  EXPECT_EQ(monitor.tick(), 0u);
  EXPECT_EQ(monitor.next_tick(), 1u);
  EXPECT_TRUE(monitor.isr_begin(2 * kPeriod - kPeriod / 2));
  EXPECT_EQ(monitor.tick(), 1u);
}

TEST(DeadlineMonitor, BeforeTheFirstTickNothingIsCounted) {
  DeadlineMonitor monitor;
  EXPECT_EQ(monitor.tick(), 0u);
  EXPECT_EQ(monitor.next_tick(), 0u);
  EXPECT_EQ(monitor.elapsed_ticks(), 1u);
  EXPECT_EQ(monitor.missed_deadlines(), 0u);
  EXPECT_EQ(monitor.tick_count(), 0u);
  EXPECT_EQ(monitor.worst_tick_count(), 0u);
  // One that nobody has started is one without a clock.
  EXPECT_TRUE(monitor.isr_begin(0));
  EXPECT_EQ(monitor.isr_check(7), 0u);
}

TEST(DeadlineMonitor, WithoutAClockNothingIsLate) {
  DeadlineMonitor monitor;
  monitor.isr_start(0, 0);
  ASSERT_TRUE(monitor.isr_begin(0));
  EXPECT_EQ(monitor.isr_check(5), 0u);  // whatever it says
  monitor.isr_start(0, 0);
  for (std::uint32_t tick = 0; tick < 10; ++tick) {
    ASSERT_TRUE(monitor.isr_begin(0));
    EXPECT_EQ(monitor.isr_check(0), 0u);
    monitor.isr_end(0);
    EXPECT_EQ(monitor.tick(), tick + 1);
  }
}

}  // namespace
}  // namespace palpate::firmware
