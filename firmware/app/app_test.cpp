#include "firmware/app/app.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>

#include "firmware/test_support.hpp"

namespace palpate::firmware {
namespace {

using test::HostPeer;
using test::MemoryBoard;

class AppTest : public ::testing::Test {
 protected:
  void tick() {
    app_->isr_tick();
    if (app_->background_due()) app_->background();
    host_.pump();
    board_->now_count += MemoryBoard::kCountPerTick;
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) tick();
  }
  palpate_Command_Response_1_0 command(std::uint8_t action, std::uint32_t token = 0) {
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    host_.send(request);
    ticks(2);
    const auto responses = host_.take<palpate_Command_Response_1_0>();
    EXPECT_EQ(responses.size(), 1u);
    return responses.empty() ? palpate_Command_Response_1_0{} : responses.back();
  }
  void arm() {
    ticks(30);
    const auto challenge = command(palpate_Command_Request_1_0_ARM_REQUEST);
    ASSERT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token).status, 0);
  }

  void start_again() {
    app_ = std::make_unique<App<MemoryBoard>>(*board_, BoardIdentity{"memory", "0", {1}}, kCatchUpCortexM4);
  }

  std::unique_ptr<MemoryBoard> board_ = std::make_unique<MemoryBoard>();
  std::unique_ptr<App<MemoryBoard>> app_ =
      std::make_unique<App<MemoryBoard>>(*board_, BoardIdentity{"memory", "0", {1}}, kCatchUpCortexM4);
  HostPeer host_{board_->buffers};
};

TEST_F(AppTest, OutputsAreOffAtBootAndOnOnlyAfterArming) {
  for (int i = 0; i < 500; ++i) {
    tick();
    ASSERT_FALSE(board_->enabled);
  }
  arm();
  EXPECT_TRUE(board_->enabled);
  EXPECT_NE(board_->setpoint_A[1], 0.0f);  // carries the arm
  command(palpate_Command_Request_1_0_DISARM);
  EXPECT_FALSE(board_->enabled);
  EXPECT_EQ(board_->setpoint_A, (std::array<float, 3>{}));
}

TEST_F(AppTest, AFaultSwitchesOffWithinItsTick) {
  arm();
  board_->emergency_stop_open = true;
  app_->isr_tick();
  EXPECT_FALSE(board_->enabled);
  EXPECT_EQ(board_->setpoint_A, (std::array<float, 3>{}));
  EXPECT_EQ(board_->report.faults, bit(Fault::emergency_stop));
}

// With memory that a reset leaves; without it they begin as the board's limits say.
TEST_F(AppTest, MotorsAreAsHotAfterAResetAsBefore) {
  board_->over_reset.assign(kKeptWords, 0);
  start_again();
  board_->current_A = {7.0f, 0.0f, 0.0f};  // outputs are off: somebody else drives it
  ticks(1500);
  KeptTick last;
  ASSERT_TRUE(recall(board_->kept_words(), last));
  EXPECT_EQ(last.tick, board_->report.tick);
  EXPECT_GT(last.heat.winding[0], 3.0f);
  board_->current_A = {};
  start_again();
  ticks(1);
  KeptTick first;
  ASSERT_TRUE(recall(board_->kept_words(), first));
  EXPECT_NEAR(first.heat.winding[0], last.heat.winding[0] * (1.0f - 1e-3f / 12.0f), 1e-5f);  // a tick of 12 s
  EXPECT_EQ(first.heat.housing, last.heat.housing);

  board_->over_reset[3] ^= 1u;
  start_again();
  ticks(1);
  ASSERT_TRUE(recall(board_->kept_words(), first));
  EXPECT_EQ(hottest(first.heat, kDefaultLimits), 0.0f);
}

TEST_F(AppTest, BackgroundIsDueOncePerTick) {
  EXPECT_FALSE(app_->background_due());
  app_->isr_tick();
  EXPECT_TRUE(app_->background_due());
  app_->background();
  EXPECT_FALSE(app_->background_due());
}

TEST_F(AppTest, ABackgroundThatIsLateIsCounted) {
  ticks(5);
  EXPECT_EQ(board_->report.background_overruns, 0u);
  for (int i = 0; i < 3; ++i) {
    app_->isr_tick();
    board_->now_count += MemoryBoard::kCountPerTick;
  }
  EXPECT_EQ(board_->report.background_overruns, 2u);
  app_->background();
  EXPECT_FALSE(app_->background_due());
  ticks(5);
  EXPECT_EQ(board_->report.background_overruns, 2u);
}

TEST_F(AppTest, AnOverlongTickIsAMissedDeadline) {
  ticks(10);
  board_->burn_count = 5 * MemoryBoard::kCountPerTick / 2;
  app_->isr_tick();
  EXPECT_EQ(board_->report.tick, 10u);
  EXPECT_EQ(board_->report.missed_deadlines, 2u);
  EXPECT_EQ(board_->report.next_tick, 12u);
  app_->background();
  app_->isr_tick();  // at once: it was pending
  EXPECT_EQ(board_->report.tick, 12u);
  EXPECT_EQ(board_->report.missed_deadlines, 2u);
  EXPECT_EQ(board_->report.tick_count, 5 * MemoryBoard::kCountPerTick / 2);
}

TEST_F(AppTest, ManyMissedDeadlinesWhileRenderingAreAFault) {
  arm();
  board_->burn_count = 13 * MemoryBoard::kCountPerTick / 2;  // six deadlines
  app_->isr_tick();
  EXPECT_TRUE(board_->enabled);  // known only when the tick is over
  app_->isr_tick();
  EXPECT_FALSE(board_->enabled);
  EXPECT_EQ(board_->report.faults, bit(Fault::deadline_missed));
}

TEST_F(AppTest, ReportsWhatItRenders) {
  arm();
  ticks(120);
  host_.send(test::square_model(5, board_->report.tick, {0.0f, 0.0f, -0.002f}));
  ticks(20);
  EXPECT_EQ(board_->report.model_sequence, 5u);
  for (int i = 0; i < 30; ++i) {
    board_->count[1] -= 1;
    tick();
  }
  const float resolution_m = 0.0294e-3f;  // of joint 2 at the tip (shared/device)
  EXPECT_NEAR(board_->report.tip_m.z, -30 * resolution_m, 0.1f * 30 * resolution_m);
  EXPECT_EQ(board_->report.mode, static_cast<std::uint32_t>(Mode::render));
}

// The same inputs give the same bytes, whatever the objects held before.
TEST_F(AppTest, IsRepeatable) {
  const auto run = [] {
    auto board = std::make_unique<MemoryBoard>();
    auto app =
        std::make_unique<App<MemoryBoard>>(*board, BoardIdentity{"memory", "0", {1}}, kCatchUpCortexM4);
    HostPeer host(board->buffers);
    std::vector<std::uint8_t> bytes;
    for (int i = 0; i < 300; ++i) {
      board->count = {i, -i, i / 2};
      if (i == 100) host.send(test::square_model(5, 99, {0.0f, 0.0f, -0.002f}));
      app->isr_tick();
      app->background();
      board->now_count += MemoryBoard::kCountPerTick;
      std::vector<std::uint8_t> sent(kLinkTransmitCapacity);
      sent.resize(board->buffers.transmit.read(sent));
      bytes.insert(bytes.end(), sent.begin(), sent.end());
    }
    return bytes;
  };
  EXPECT_EQ(run(), run());
}

// Interrupt and background at the same time, as on a board, but on two cores, which is worse. The link's
// driver and the host are on the interrupt's side. ThreadSanitizer watches (preset host-tsan).
TEST(AppThreads, InterruptAndBackgroundShareNothingUnguarded) {
  auto board = std::make_unique<MemoryBoard>();
  auto app = std::make_unique<App<MemoryBoard>>(*board, BoardIdentity{"memory", "0", {1}}, kCatchUpCortexM4);
  constexpr std::uint32_t kTicks = 3000;
  std::atomic<bool> done{false};

  std::size_t models_reported = 0, commands_answered = 0, traces = 0;
  std::thread interrupt([&] {
    HostPeer host(board->buffers);
    std::vector<std::uint8_t> line;  // on its way to the board
    const auto send = [&](const auto& message, std::uint16_t specifier) {
      const auto frame = HostPeer::frame(specifier, host.transfer_id++, HostPeer::payload(message));
      line.insert(line.end(), frame.begin(), frame.end());
    };
    for (std::uint32_t tick = 0; tick < kTicks; ++tick) {
      board->count[1] = -static_cast<std::int32_t>(tick / 4 % 100);
      if (tick % 40 == 0) {
        palpate_Command_Request_1_0 request{};
        request.action = static_cast<std::uint8_t>(tick / 40 % 7);
        send(request, wire::MessageTraits<palpate_Command_Request_1_0>::kSpecifier);
      }
      if (tick % 100 == 50) {
        const wire::PackedModel packed =
            wire::pack(test::square_model(tick, tick - 1, {0.0f, 0.0f, -0.001f}));
        for (const auto& part : wire::parts_of(*packed.basis, packed.state.basis_id))
          send(part, wire::MessageTraits<palpate_ModelPart_1_0>::kSpecifier);
        send(packed.state, wire::MessageTraits<palpate_ModelState_1_0>::kSpecifier);
      }
      if (tick % 60 == 30) {
        palpate_TraceRequest_1_0 request{};
        request.first_tick = tick - 30;
        request.count = 30;
        send(request, wire::MessageTraits<palpate_TraceRequest_1_0>::kSpecifier);
      }
      const std::size_t count = std::min<std::size_t>({line.size(), 500, board->buffers.received.free()});
      EXPECT_TRUE(board->buffers.received.write(std::span(line).first(count)));
      line.erase(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(count));
      app->isr_tick();
      board->now_count += MemoryBoard::kCountPerTick;
      models_reported += host.take<palpate_ModelReport_1_0>().size();
      commands_answered += host.take<palpate_Command_Response_1_0>().size();
      traces += host.take<palpate_ServoTrace_1_0>().size();
      // Keeps the background within some ticks, not in step.
      while (tick % 8 == 0 && app->background_due()) std::this_thread::yield();
    }
    done.store(true, std::memory_order_release);
  });
  while (!done.load(std::memory_order_acquire)) {
    if (app->background_due()) {
      app->background();
    } else {
      std::this_thread::yield();
    }
  }
  interrupt.join();
  EXPECT_GT(models_reported, 10u);
  EXPECT_GT(commands_answered, 30u);
  EXPECT_GT(traces, 100u);
}

}  // namespace
}  // namespace palpate::firmware
