#include "firmware/link/registers.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <memory>
#include <set>
#include <string>

#include "firmware/app/app.hpp"
#include "firmware/test_support.hpp"

namespace palpate::firmware {
namespace {

using test::HostPeer;
using test::MemoryBoard;
using wire::RegisterAccessRequest;
using wire::RegisterAccessResponse;
using wire::RegisterType;
using wire::RegisterValue;

constexpr std::uint32_t kSomeTicks = 5;  // a write takes four: asked, agreed, used, answered

RegisterValue reals(const JointValues& values) {
  RegisterValue value{.type = RegisterType::real32};
  for (const float one : values) value.bits[value.count++] = std::bit_cast<std::uint32_t>(one);
  return value;
}

class RegistersTest : public ::testing::Test {
 protected:
  void SetUp() override { ticks(30); }
  void tick() {
    app_->isr_tick();
    if (app_->background_due()) app_->background();
    host_.pump();
    board_->now_count += MemoryBoard::kCountPerTick;
  }
  void ticks(std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) tick();
  }
  RegisterAccessResponse access(std::string_view name, const RegisterValue& value = {}) {
    host_.send(RegisterAccessRequest{name, value});
    ticks(kSomeTicks);
    const auto answers = host_.take<RegisterAccessResponse>();
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? RegisterAccessResponse{} : answers.back();
  }
  std::uint32_t command(std::uint8_t action, std::uint32_t token = 0) {
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    host_.send(request);
    ticks(2);
    const auto answers = host_.take<palpate_Command_Response_1_0>();
    EXPECT_TRUE(answers.size() == 1 && answers[0].status == 0);
    return answers.empty() ? 0 : answers[0]._token;
  }
  void arm() {
    const std::uint32_t token = command(palpate_Command_Request_1_0_ARM_REQUEST);
    command(palpate_Command_Request_1_0_ARM_CONFIRM, token);
    ASSERT_TRUE(board_->enabled);
  }
  // Each is there when it is asked for.
  std::set<std::string> listed() {
    std::set<std::string> names;
    for (std::uint16_t index = 0; index < 100; ++index) {
      host_.send(wire::RegisterListRequest{index});
      ticks(2);
      std::string name;
      for (const auto& one : host_.received) {
        wire::RegisterListResponse response;
        if (one.header.specifier != wire::MessageTraits<wire::RegisterListResponse>::kSpecifier) continue;
        EXPECT_EQ(wire::deserialize(one.payload, response), Status::ok);
        name = response.name;
      }
      host_.received.clear();
      if (name.empty()) return names;
      EXPECT_TRUE(names.insert(name).second) << name;
      EXPECT_NE(access(name).value.type, RegisterType::empty) << name;
    }
    ADD_FAILURE() << "the list does not end";
    return names;
  }
  void start_again() {
    app_ = std::make_unique<App<MemoryBoard>>(*board_, kIdentity, kCatchUpCortexM4);
    ticks(30);
  }

  static constexpr BoardIdentity kIdentity{"memory", "0", {1}};
  std::unique_ptr<MemoryBoard> board_ = std::make_unique<MemoryBoard>();
  std::unique_ptr<App<MemoryBoard>> app_ =
      std::make_unique<App<MemoryBoard>>(*board_, kIdentity, kCatchUpCortexM4);
  HostPeer host_{board_->buffers};
};

TEST_F(RegistersTest, TheListNamesEachOnceAndEnds) {
  const std::set<std::string> names = listed();
  EXPECT_EQ(names.size(), 4 * kTuningFields.size() + 2);
  EXPECT_TRUE(names.contains("friction.coulomb_n_m<"));
  board_->reset.is_known = true;
  start_again();
  EXPECT_EQ(listed().size(), names.size() + 1);
  EXPECT_TRUE(listed().contains("reset.record"));
}

TEST_F(RegistersTest, WhatIsWrittenIsUsedKeptAndRead) {
  const RegisterValue signs = reals({1.0f, -1.0f, 1.0f});
  const RegisterAccessResponse answer = access("encoder.sign", signs);
  EXPECT_EQ(answer.value, signs);
  EXPECT_TRUE(answer.is_mutable);
  EXPECT_TRUE(answer.is_persistent);
  EXPECT_GT(answer.read_us, 0u);
  board_->count = {0, 100, 0};
  tick();
  const Vec3f turned_m = board_->report.tip_m;
  start_again();
  EXPECT_EQ(access("encoder.sign").value, signs);
  tick();
  EXPECT_EQ(board_->report.tip_m, turned_m);
  EXPECT_LT(turned_m.z, 0.0f);  // as it counts, the upper arm goes up
}

TEST_F(RegistersTest, LimitsAndDefaultsStandBesideARegister) {
  EXPECT_EQ(access("friction.compensated_share<").value, reals({0.8f, 0.8f, 0.8f}));
  EXPECT_EQ(access("friction.compensated_share>").value, reals({}));
  EXPECT_EQ(access("setpoint.gain=").value, reals({1.0f, 1.0f, 1.0f}));
  const RegisterAccessResponse most = access("setpoint.gain<", reals({2.0f, 2.0f, 2.0f}));
  EXPECT_EQ(most.value, reals({1.25f, 1.25f, 1.25f}));
  EXPECT_FALSE(most.is_mutable);
}

TEST_F(RegistersTest, WhatIsNotThereIsEmpty) {
  for (const char* const name : {"no.such", "encoder.sig", "encoder.signs", "<", ""})
    EXPECT_EQ(access(name, reals({1.0f, 1.0f, 1.0f})).value.type, RegisterType::empty) << name;
}

// Out of range, of another type or length, or not a number: the old value stays, and is not stored again.
TEST_F(RegistersTest, ARefusedWriteLeavesWhatWasThere) {
  const RegisterValue before = reals({1.0f, 1.0f, 1.0f});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(access("setpoint.gain", reals({1.0f, 2.0f, 1.0f})).value, before);
  EXPECT_EQ(access("setpoint.gain", reals({1.0f, nan, 1.0f})).value, before);
  EXPECT_EQ(access("setpoint.gain", {RegisterType::integer32, 3, {1, 1, 1}}).value, before);
  EXPECT_EQ(access("setpoint.gain", {RegisterType::real32, 2, {0x3F800000, 0x3F800000}}).value, before);
  EXPECT_EQ(access("setpoint.gain", before).value, before);
  EXPECT_TRUE(board_->kept.empty());
}

TEST_F(RegistersTest, WhileItIsArmedNothingIsWritten) {
  arm();
  EXPECT_EQ(access("setpoint.gain", reals({1.1f, 1.1f, 1.1f})).value, reals({1.0f, 1.0f, 1.0f}));
  EXPECT_TRUE(board_->kept.empty());
  EXPECT_EQ(access("arm.sample").value.count, wire::kMaxRegisterValues);  // but read
  command(palpate_Command_Request_1_0_DISARM);
  EXPECT_EQ(access("setpoint.gain", reals({1.1f, 1.1f, 1.1f})).value, reals({1.1f, 1.1f, 1.1f}));
}

// Write and handshake of arming in one tick, in either order: never is anything written with outputs on.
// Who has asked for a challenge has seen the registers as they were: a write closes it.
TEST_F(RegistersTest, OfAWriteAndArmingAtOnceOneIsRefused) {
  for (const bool write_first : {true, false}) {
    for (int between = 0; between < 4; ++between) {
      const std::uint32_t token = command(palpate_Command_Request_1_0_ARM_REQUEST);
      const auto confirm = [&] {
        palpate_Command_Request_1_0 request{};
        request.action = palpate_Command_Request_1_0_ARM_CONFIRM;
        request._token = token;
        host_.send(request);
      };
      const float gain = 1.0f + 0.01f * static_cast<float>(between + (write_first ? 1 : 5));
      if (!write_first) confirm();
      if (!write_first) ticks(static_cast<std::uint32_t>(between));
      host_.send(RegisterAccessRequest{"setpoint.gain", reals({gain, gain, gain})});
      if (write_first) ticks(static_cast<std::uint32_t>(between));
      if (write_first) confirm();
      for (int i = 0; i < 8; ++i) {
        const bool was_enabled = board_->enabled;
        const auto before = board_->kept;
        tick();
        if (was_enabled && board_->enabled) {
          EXPECT_EQ(board_->kept, before);
        }
      }
      const auto written = host_.take<RegisterAccessResponse>();
      const auto confirmed = host_.take<palpate_Command_Response_1_0>();
      ASSERT_EQ(written.size(), 1u);
      ASSERT_EQ(confirmed.size(), 1u);
      const bool is_written = written[0].value == reals({gain, gain, gain});
      EXPECT_EQ(board_->enabled, confirmed[0].status == static_cast<std::uint8_t>(Status::ok));
      EXPECT_NE(board_->enabled, is_written);
      command(palpate_Command_Request_1_0_DISARM);
    }
  }
}

TEST_F(RegistersTest, WhatCannotBeStoredIsNotUsed) {
  board_->memory_works = false;
  EXPECT_EQ(access("encoder.sign", reals({-1.0f, 1.0f, 1.0f})).value, reals({1.0f, 1.0f, 1.0f}));
  board_->memory_works = true;
  EXPECT_EQ(access("encoder.sign", reals({-1.0f, 1.0f, 1.0f})).value, reals({-1.0f, 1.0f, 1.0f}));
}

TEST_F(RegistersTest, WhatIsKeptOutOfRangeIsNotUsed) {
  Tuning tuning;
  tuning.setpoint_gain[0] = 9.0f;
  board_->kept.resize(kTuningBytes);
  pack_tuning(tuning, std::span<std::uint8_t, kTuningBytes>(board_->kept));
  start_again();
  EXPECT_EQ(access("setpoint.gain").value, reals({1.0f, 1.0f, 1.0f}));
}

TEST_F(RegistersTest, SamplesAreOfTheTickThatTheyName) {
  board_->count = {10, -20, 30};
  board_->current_A = {0.5f, 0.25f, -0.5f};
  const RegisterAccessResponse counts = access("encoder.count");
  EXPECT_EQ(counts.value, (RegisterValue{RegisterType::integer32, 3, {10, 0xFFFFFFECu, 30}}));
  EXPECT_FALSE(counts.is_mutable);
  const RegisterAccessResponse sample = access("arm.sample");
  ASSERT_EQ(sample.value.count, 12);
  EXPECT_GT(sample.read_us, counts.read_us);
  const auto value = [&](std::size_t i) { return std::bit_cast<float>(sample.value.bits[i]); };
  EXPECT_FLOAT_EQ(value(0), 10.0f / device::kPremium15.joint[0].counts_per_rad);
  EXPECT_EQ(value(3), 0.0f);  // at rest
  EXPECT_EQ(value(7), 0.0f);  // outputs are off
  EXPECT_EQ(value(11), -0.5f);
}

// Of a board that knows: causes, fault record, and the last tick of before with what was latched.
TEST_F(RegistersTest, TheRecordOfAResetIsRead) {
  EXPECT_EQ(access("reset.record").value.type, RegisterType::empty);
  board_->reset = {.is_known = true,
                   .causes = 0x14000000,
                   .reason = 1,
                   .detail = 3,
                   .program_counter = 0x08001234,
                   .cfsr = 5,
                   .hfsr = 6,
                   .bfar = 7,
                   .failed_starts = 8};
  board_->over_reset.assign(kKeptWords, 0);  // as power leaves it
  start_again();
  const std::uint32_t causes = 0x14000000u, counter = 0x08001234u;
  EXPECT_EQ(access("reset.record").value,
            (RegisterValue{RegisterType::integer32, 10, {causes, 1, 3, counter, 5, 6, 7, 8, 0, 0}}));
  board_->emergency_stop_open = true;
  ticks(1);
  const std::uint32_t last_tick = board_->report.tick;
  board_->emergency_stop_open = false;
  start_again();
  const RegisterAccessResponse answer = access("reset.record", reals({1.0f, 1.0f, 1.0f}));
  EXPECT_EQ(answer.value,
            (RegisterValue{RegisterType::integer32,
                           10,
                           {causes, 1, 3, counter, 5, 6, 7, 8, last_tick, bit(Fault::emergency_stop)}}));
  EXPECT_FALSE(answer.is_mutable);
}

// More at once than may wait: those beyond are refused and counted, the others answered in order.
TEST_F(RegistersTest, AFloodIsBounded) {
  for (int i = 0; i < 6; ++i) host_.send(RegisterAccessRequest{"arm.sample", {}});
  ticks(20);
  EXPECT_EQ(host_.take<RegisterAccessResponse>().size(), kPendingAccesses);
  EXPECT_EQ(app_->endpoint().counters().frames_refused, 2u);
}

TEST_F(RegistersTest, ARequestThatIsNoneIsRefused) {
  const std::array<std::uint8_t, 2> bad{9, 'x'};
  host_.send_bytes(HostPeer::frame(wire::MessageTraits<RegisterAccessRequest>::kSpecifier, 50, bad));
  host_.send_bytes(HostPeer::frame(wire::MessageTraits<wire::RegisterListRequest>::kSpecifier, 50, {}));
  ticks(3);
  EXPECT_EQ(app_->endpoint().counters().frames_refused, 2u);
  EXPECT_EQ(app_->endpoint().counters().last_status, Status::payload_malformed);
}

}  // namespace
}  // namespace palpate::firmware
