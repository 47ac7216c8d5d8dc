#include "host/session/arming.hpp"

#include <gtest/gtest.h>

namespace palpate::host {
namespace {

palpate_BoardStatus_1_0 in_mode(unsigned mode) {
  palpate_BoardStatus_1_0 status{};
  status.mode = static_cast<std::uint8_t>(mode);
  return status;
}

palpate_Command_Response_1_0 answer(Status status, unsigned mode, std::uint32_t token) {
  palpate_Command_Response_1_0 response{};
  response.status = static_cast<std::uint8_t>(status);
  response.mode = static_cast<std::uint8_t>(mode);
  response._token = token;
  return response;
}

class ArmingTest : public ::testing::Test {
 protected:
  // What is asked at a tick; NOTHING where nothing is.
  palpate_Command_Request_1_0 asked(std::uint32_t tick) {
    return arming_.poll(tick).value_or(palpate_Command_Request_1_0{});
  }
  void expect_silence(std::uint32_t from, std::uint32_t until) {
    for (std::uint32_t tick = from; tick < until; ++tick) EXPECT_FALSE(arming_.poll(tick)) << tick;
  }

  Arming arming_;
};

TEST_F(ArmingTest, WaitsForABoardThatIsIdle) {
  expect_silence(0, 500);
  arming_.take(in_mode(palpate_BoardStatus_1_0_MODE_BOOT));
  expect_silence(500, 600);
  arming_.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  EXPECT_EQ(asked(600).action, palpate_Command_Request_1_0_ARM_REQUEST);
}

TEST_F(ArmingTest, ConfirmsOnceWithTheTokenOfTheBoard) {
  arming_.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  EXPECT_EQ(asked(10)._token, 0u);
  expect_silence(11, 15);
  arming_.take(answer(Status::ok, palpate_BoardStatus_1_0_MODE_IDLE, 77));
  const auto confirmation = asked(15);
  EXPECT_EQ(confirmation.action, palpate_Command_Request_1_0_ARM_CONFIRM);
  EXPECT_EQ(confirmation._token, 77u);
  expect_silence(16, 20);
  arming_.take(answer(Status::ok, palpate_BoardStatus_1_0_MODE_RENDER, 0));
  expect_silence(20, 1000);
}

TEST_F(ArmingTest, AsksAgainWhenAnAnswerIsLost) {
  arming_.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  EXPECT_EQ(asked(10).action, palpate_Command_Request_1_0_ARM_REQUEST);
  expect_silence(11, 210);
  EXPECT_EQ(asked(210).action, palpate_Command_Request_1_0_ARM_REQUEST);
  arming_.take(answer(Status::ok, palpate_BoardStatus_1_0_MODE_IDLE, 5));
  EXPECT_EQ(asked(220).action, palpate_Command_Request_1_0_ARM_CONFIRM);
  // The confirmation or its answer is lost: from the start.
  expect_silence(221, 420);
  const auto again = asked(420);
  EXPECT_EQ(again.action, palpate_Command_Request_1_0_ARM_REQUEST);
  EXPECT_EQ(again._token, 0u);
}

TEST_F(ArmingTest, ARefusalOpensNoToken) {
  arming_.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
  EXPECT_EQ(asked(10).action, palpate_Command_Request_1_0_ARM_REQUEST);
  arming_.take(answer(Status::command_refused, palpate_BoardStatus_1_0_MODE_IDLE, 9));
  expect_silence(11, 210);
  EXPECT_EQ(asked(210).action, palpate_Command_Request_1_0_ARM_REQUEST);
}

TEST_F(ArmingTest, NeverArmsAgainByItself) {
  for (const unsigned mode : {palpate_BoardStatus_1_0_MODE_RENDER, palpate_BoardStatus_1_0_MODE_FAULT}) {
    for (const bool by_response : {false, true}) {
      Arming arming;
      arming.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
      if (by_response) {
        arming.take(answer(Status::command_refused, mode, 0));
      } else {
        arming.take(in_mode(mode));
      }
      arming.take(in_mode(palpate_BoardStatus_1_0_MODE_IDLE));
      arming.take(answer(Status::ok, palpate_BoardStatus_1_0_MODE_IDLE, 3));
      for (std::uint32_t tick = 0; tick < 1000; tick += 50) EXPECT_FALSE(arming.poll(tick));
    }
  }
}

}  // namespace
}  // namespace palpate::host
