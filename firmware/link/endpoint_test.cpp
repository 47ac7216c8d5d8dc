#include "firmware/link/endpoint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "firmware/test_support.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::firmware {
namespace {

using test::HostPeer;

class EndpointTest : public ::testing::Test {
 protected:
  // One servo tick, then the background.
  void tick() {
    servo_->isr_tick(timing_, sensors_);
    ++timing_.tick;
    endpoint_->run();
  }
  void ticks(std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      tick();
      host_.pump();
    }
  }
  // Sends a request; its response comes within two ticks.
  template <class Response, class Request>
  Response ask(const Request& request) {
    host_.send(request);
    ticks(2);
    const auto responses = host_.take<Response>();
    EXPECT_EQ(responses.size(), 1u);
    return responses.empty() ? Response{} : responses.back();
  }
  palpate_Command_Response_1_0 command(std::uint8_t action, std::uint32_t token = 0) {
    palpate_Command_Request_1_0 request{};
    request.action = action;
    request._token = token;
    return ask<palpate_Command_Response_1_0>(request);
  }
  palpate_BoardStatus_1_0 status() {
    host_.take<palpate_BoardStatus_1_0>();
    ticks(kStatusPeriod_ticks);
    const auto all = host_.take<palpate_BoardStatus_1_0>();
    EXPECT_FALSE(all.empty());
    return all.empty() ? palpate_BoardStatus_1_0{} : all.back();
  }
  static palpate_TraceRequest_1_0 trace_request(std::uint32_t first_tick, std::uint32_t count,
                                                std::uint8_t form = palpate_TraceRequest_1_0_FORM_FULL,
                                                std::uint8_t ticks = kTraceTicks) {
    return {
        .first_tick = first_tick, .count = static_cast<std::uint16_t>(count), .form = form, .ticks = ticks};
  }
  std::vector<std::uint8_t> command_frame(std::uint64_t transfer_id, std::uint16_t port_specifier) {
    palpate_Command_Request_1_0 request{};
    return HostPeer::frame(port_specifier, transfer_id, HostPeer::payload(request));
  }

  // Those received so far; forgets them.
  std::vector<HostPeer::Received> heartbeats() { return of_subject(wire::kHeartbeatSubject); }
  std::vector<HostPeer::Received> of_subject(std::uint16_t subject) {
    std::vector<HostPeer::Received> heard;
    std::erase_if(host_.received, [&](const auto& one) {
      if (one.header.specifier != subject) return false;
      heard.push_back(one);
      return true;
    });
    return heard;
  }

  static constexpr std::uint32_t kClock_Hz = 25'000'000;
  const Limits limits_{};
  Mailbox mailbox_{};
  std::unique_ptr<LinkBuffers> link_ = std::make_unique<LinkBuffers>();
  std::unique_ptr<Renderer> renderer_ = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
  std::unique_ptr<Servo> servo_ =
      std::make_unique<Servo>(device::kPremium15, limits_, 1u, *renderer_, mailbox_);
  std::unique_ptr<Endpoint> endpoint_ = std::make_unique<Endpoint>(
      *renderer_, *servo_, limits_, mailbox_, *link_, BoardIdentity{"memory", "1.2.3", {1}}, kClock_Hz);
  HostPeer host_{*link_};
  ServoTiming timing_{};
  ServoSensors sensors_{};
};

TEST_F(EndpointTest, SaysWhatItIs) {
  const auto info = ask<palpate_GetInfo_Response_1_0>(palpate_GetInfo_Request_1_0{});
  EXPECT_EQ(info.schema_hash, wire::kSchemaHash);
  const auto text = [](const auto& field) {
    return std::string(field.elements, field.elements + field.count);
  };
  EXPECT_EQ(text(info.board), "memory");
  EXPECT_EQ(text(info.firmware), "1.2.3");
  EXPECT_EQ(info.max_modes, kMaxModes);
  EXPECT_EQ(info.max_basis, kMaxBasis);
  EXPECT_EQ(info.max_nodes, kMaxSurfaceNodes);
  EXPECT_EQ(info.max_triangles, kMaxTriangles);
  EXPECT_EQ(info.tick_rate_Hz, kServoRate_Hz);
  EXPECT_EQ(info.tip_history_ticks, kTipHistory);
}

TEST_F(EndpointTest, AResponseGoesToWhoAskedWithItsTransferId) {
  host_.transfer_id = 4711;
  host_.send(palpate_GetInfo_Request_1_0{});
  tick();
  host_.pump();
  const auto response = std::find_if(host_.received.begin(), host_.received.end(), [](const auto& one) {
    return one.header.specifier == wire::response_specifier(wire::kGetInfoService);
  });
  ASSERT_NE(response, host_.received.end());
  EXPECT_EQ(response->header.destination, wire::kHostNode);
  EXPECT_EQ(response->header.source, wire::kBoardNode);
  EXPECT_EQ(response->header.transfer_id, 4711u);
}

TEST_F(EndpointTest, ArmsInTwoSteps) {
  ticks(limits_.boot_ticks);
  const auto challenge = command(palpate_Command_Request_1_0_ARM_REQUEST);
  EXPECT_EQ(challenge.status, 0);
  ASSERT_NE(challenge._token, 0u);
  EXPECT_EQ(challenge.mode, palpate_BoardStatus_1_0_MODE_IDLE);
  const auto confirmed = command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token);
  EXPECT_EQ(confirmed.status, 0);
  EXPECT_EQ(confirmed.mode, palpate_BoardStatus_1_0_MODE_RENDER);
  const auto disarmed = command(palpate_Command_Request_1_0_DISARM);
  EXPECT_EQ(disarmed.mode, palpate_BoardStatus_1_0_MODE_IDLE);
}

TEST_F(EndpointTest, RefusesWhatTheSupervisorRefuses) {
  ticks(limits_.boot_ticks);
  EXPECT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, 5).status,
            static_cast<std::uint8_t>(Status::command_token_wrong));
  EXPECT_EQ(command(200).status, static_cast<std::uint8_t>(Status::command_refused));
  const auto stopped = command(palpate_Command_Request_1_0_STOP);
  EXPECT_EQ(stopped.mode, palpate_BoardStatus_1_0_MODE_FAULT);
  EXPECT_EQ(status().last_status, static_cast<std::uint8_t>(Status::command_refused));
}

TEST_F(EndpointTest, ARepeatedRequestIsRunOnce) {
  ticks(limits_.boot_ticks);
  const auto request = command_frame(9, wire::request_specifier(wire::kCommandService));
  host_.send_bytes(request);
  host_.send_bytes(request);
  ticks(3);
  EXPECT_EQ(host_.take<palpate_Command_Response_1_0>().size(), 1u);
}

TEST_F(EndpointTest, MoreCommandsThanItCanHoldAreRefusedAndCounted) {
  for (int i = 0; i < 6; ++i) host_.send(palpate_Command_Request_1_0{});
  ticks(10);
  EXPECT_EQ(host_.take<palpate_Command_Response_1_0>().size(), 4u);
  EXPECT_EQ(status().frames_refused, 2u);
}

// Another program's commands fill the ring in each tick ahead of the host's.
TEST_F(EndpointTest, AFloodOfCommandsHoldsUpNeitherStopNorDisarm) {
  constexpr std::uint16_t kOther = 11;
  struct Case {
    std::uint8_t action, mode;
  };
  for (const Case& one : {Case{palpate_Command_Request_1_0_STOP, palpate_BoardStatus_1_0_MODE_FAULT},
                          Case{palpate_Command_Request_1_0_DISARM, palpate_BoardStatus_1_0_MODE_IDLE}}) {
    ticks(limits_.boot_ticks);
    command(palpate_Command_Request_1_0_CLEAR_FAULT);
    const auto challenge = command(palpate_Command_Request_1_0_ARM_REQUEST);
    ASSERT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token).mode,
              palpate_BoardStatus_1_0_MODE_RENDER);
    for (int flood_tick = 0; flood_tick <= 20; ++flood_tick) {
      ASSERT_TRUE(mailbox_.is_armed);
      // They would clear the fault again, if they were obeyed after the STOP.
      palpate_Command_Request_1_0 flood{};
      flood.action = palpate_Command_Request_1_0_CLEAR_FAULT;
      host_.node = kOther;
      for (int i = 0; i < 6; ++i) host_.send(flood);
      host_.node = wire::kHostNode;
      if (flood_tick < 20) ticks(1);
    }
    host_.take<palpate_Command_Response_1_0>();
    const std::uint64_t transfer_id = host_.transfer_id;
    host_.send(palpate_Command_Request_1_0{.action = one.action, ._token = 0});
    ticks(2);
    EXPECT_FALSE(mailbox_.is_armed);
    const auto response = std::find_if(host_.received.begin(), host_.received.end(), [&](const auto& reply) {
      return reply.header.specifier == wire::response_specifier(wire::kCommandService) &&
             reply.header.transfer_id == transfer_id;
    });
    ASSERT_NE(response, host_.received.end());
    EXPECT_EQ(response->header.destination, wire::kHostNode);
    EXPECT_EQ(response->payload[0], static_cast<std::uint8_t>(Status::ok));
    EXPECT_EQ(response->payload[1], one.mode);
    ticks(10);
    EXPECT_EQ(status().mode, one.mode);
    host_.take<palpate_Command_Response_1_0>();
  }
}

TEST_F(EndpointTest, EveryStopIsObeyedAndAsManyAreAnsweredAsThereIsRoomFor) {
  ticks(limits_.boot_ticks);
  palpate_Command_Request_1_0 stop{};
  stop.action = palpate_Command_Request_1_0_STOP;
  for (std::size_t i = 0; i < kPendingUrgent + 2; ++i) host_.send(stop);
  ticks(3);
  EXPECT_EQ(host_.take<palpate_Command_Response_1_0>().size(), kPendingUrgent);
  const auto after = status();
  EXPECT_EQ(after.mode, palpate_BoardStatus_1_0_MODE_FAULT);
  EXPECT_EQ(after.frames_unsent, 2u);
  EXPECT_EQ(after.frames_refused, 0u);
}

TEST_F(EndpointTest, TracesEveryTickOnce) {
  for (int i = 0; i < 400; ++i) {
    sensors_.count[0] = i % 50;
    ticks(1);
  }
  std::uint32_t next_tick = 0;
  std::uint32_t sequence = 0;
  for (const auto& trace : host_.take<palpate_ServoTrace_1_0>()) {
    EXPECT_EQ(trace.sequence, sequence++);
    EXPECT_EQ(trace.first_tick, next_tick);
    EXPECT_EQ(trace.samples.count, kTraceTicks);
    for (std::size_t i = 0; i < trace.samples.count; ++i) {
      const device::Pose pose = device::evaluate(
          device::kPremium15,
          device::joint_angles(device::kPremium15,
                               {static_cast<std::int32_t>((trace.first_tick + i) % 50), 0, 0}, {}));
      EXPECT_EQ(trace.samples.elements[i].tip_m[0], pose.tip_m.x);
    }
    next_tick += kTraceTicks;
  }
  EXPECT_EQ(next_tick, 400u);
}

TEST_F(EndpointTest, SendsATraceAgain) {
  ticks(200);
  const auto live = host_.take<palpate_ServoTrace_1_0>();
  host_.send(trace_request(50, 100));
  ticks(8);
  std::uint32_t next_tick = 50;
  for (const auto& trace : host_.take<palpate_ServoTrace_1_0>()) {
    if (trace.first_tick >= 200) continue;  // live
    EXPECT_EQ(trace.first_tick, next_tick);
    next_tick += static_cast<std::uint32_t>(trace.samples.count);
    const auto& original = live[trace.first_tick / kTraceTicks];
    EXPECT_EQ(trace.samples.elements[0].tip_m[2],
              original.samples.elements[trace.first_tick % kTraceTicks].tip_m[2]);
  }
  EXPECT_EQ(next_tick, 150u);
}

TEST_F(EndpointTest, SendsAgainOnlyWhatTheHistoryHolds) {
  ticks(1000);
  host_.take<palpate_ServoTrace_1_0>();
  host_.send(trace_request(700, 200));  // 256 ticks of history: from about 748 on
  host_.send(trace_request(900, 256));  // to 1155: ends with what has happened
  ticks(20);
  std::uint32_t first = UINT32_MAX;
  std::vector<bool> seen(1200);
  for (const auto& trace : host_.take<palpate_ServoTrace_1_0>()) {
    first = std::min(first, trace.first_tick);
    for (std::uint32_t i = 0; i < trace.samples.count; ++i) seen[trace.first_tick + i] = true;
  }
  EXPECT_GT(first, 1000 - kTipHistory);
  EXPECT_LT(first, 1000 - kTipHistory + 25);
  for (std::uint32_t tick = first; tick < 1000; ++tick) EXPECT_TRUE(seen[tick]) << tick;
}

TEST_F(EndpointTest, RefusesTraceRequestsBeyondItsMeans) {
  const std::uint8_t tip = palpate_TraceRequest_1_0_FORM_TIP;
  for (const auto& bad : {trace_request(0, kTipHistory + 1, tip, 8), trace_request(0, 1, 3, 8),
                          trace_request(0, 1, tip, 0), trace_request(0, 1, tip, 33)}) {
    host_.send(bad);
    ticks(2);
    EXPECT_EQ(endpoint_->counters().last_status, Status::payload_malformed);
  }
  EXPECT_EQ(endpoint_->counters().frames_refused, 4u);
  for (std::size_t i = 0; i < kPendingTraceRequests; ++i) host_.send(trace_request(0, 1));
  host_.send(trace_request(0, 1, tip, 8));
  ticks(10);
  EXPECT_EQ(endpoint_->counters().frames_refused, 5u);
  EXPECT_EQ(endpoint_->counters().last_status, Status::command_refused);
  // What is refused changes nothing.
  EXPECT_TRUE(host_.take<palpate_TipTrace_1_0>().empty());
  const auto after = status();
  EXPECT_EQ(after.trace_form, palpate_TraceRequest_1_0_FORM_FULL);
  EXPECT_EQ(after.trace_ticks, kTraceTicks);
}

// Every tick once, in either form, however often that changes; and each where the tip was.
TEST_F(EndpointTest, SendsTracesInTheFormThatWasAskedForLast) {
  constexpr std::uint32_t kPerChange = 120;  // a multiple of all numbers of ticks
  struct Form {
    std::uint8_t form, ticks;
  };
  const std::uint8_t full = palpate_TraceRequest_1_0_FORM_FULL, tip = palpate_TraceRequest_1_0_FORM_TIP;
  std::uint32_t next_tick = 0;
  const auto expect_tip = [&](const Vec3d& tip_m, double bound_m) {
    const device::Pose pose = device::evaluate(
        device::kPremium15,
        device::joint_angles(device::kPremium15, {static_cast<std::int32_t>(next_tick % 50), 0, 0}, {}));
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(tip_m[axis], static_cast<double>(pose.tip_m[axis]), bound_m) << next_tick;
    ++next_tick;
  };
  for (const Form& form : {Form{full, 4}, Form{tip, 8}, Form{tip, 1}, Form{full, 10}, Form{tip, 30}}) {
    const std::uint32_t until = timing_.tick + kPerChange;
    for (bool asked = false; timing_.tick < until; asked = true) {
      sensors_.count[0] = static_cast<std::int32_t>(timing_.tick % 50);
      if (!asked) host_.send(trace_request(0, 0, form.form, form.ticks));
      ticks(1);
    }
    if (form.form == full) {
      for (const auto& trace : host_.take<palpate_ServoTrace_1_0>()) {
        EXPECT_EQ(trace.first_tick, next_tick);
        EXPECT_EQ(trace.samples.count, form.ticks);
        for (std::size_t i = 0; i < trace.samples.count; ++i) {
          const float* tip_m = trace.samples.elements[i].tip_m;
          expect_tip({tip_m[0], tip_m[1], tip_m[2]}, 0.0);
        }
      }
    } else {
      for (const auto& trace : host_.take<palpate_TipTrace_1_0>()) {
        EXPECT_EQ(trace.first_tick, next_tick);
        EXPECT_EQ(trace.offsets.count + 1, form.ticks);
        for (std::size_t i = 0; i <= trace.offsets.count; ++i)
          expect_tip(wire::read_tip(trace, i), wire::kTipError_steps * std::ldexp(1.0, trace.step_exponent));
      }
    }
    EXPECT_EQ(next_tick, until);
    EXPECT_TRUE(host_.take<palpate_ServoTrace_1_0>().empty());
    EXPECT_TRUE(host_.take<palpate_TipTrace_1_0>().empty());
  }
  const auto after = status();
  EXPECT_EQ(after.trace_form, tip);
  EXPECT_EQ(after.trace_ticks, 30);
  EXPECT_EQ(after.frames_unsent, 0u);
}

TEST_F(EndpointTest, SendsTipsAgain) {
  ticks(200);
  host_.send(trace_request(0, 0, palpate_TraceRequest_1_0_FORM_TIP, 8));
  ticks(8);
  host_.take<palpate_TipTrace_1_0>();
  host_.send(trace_request(50, 100, palpate_TraceRequest_1_0_FORM_TIP, 8));
  ticks(8);
  std::uint32_t next_tick = 50;
  for (const auto& trace : host_.take<palpate_TipTrace_1_0>()) {
    if (trace.first_tick >= 200) continue;  // live
    EXPECT_EQ(trace.first_tick, next_tick);
    next_tick += static_cast<std::uint32_t>(trace.offsets.count + 1);
  }
  EXPECT_EQ(next_tick, 150u);
}

TEST_F(EndpointTest, ModelIsTakenAndReported) {
  ticks(50);
  host_.send(test::square_model(12, 40, {0, 0, -0.002f}));
  ticks(20);
  const auto reports = host_.take<palpate_ModelReport_1_0>();
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_EQ(reports[0].sequence, 12u);
  EXPECT_EQ(reports[0].status, 0);
  EXPECT_EQ(reports[0].model_tick, 40u);
  EXPECT_GE(reports[0].swap_tick, 50u);
  EXPECT_EQ(renderer_->model_sequence(), 12u);
  EXPECT_EQ(status().models_taken, 1u);
}

TEST_F(EndpointTest, BadModelsAreRefusedCountedReportedAndHarmless) {
  ticks(50);
  host_.send(test::square_model(1, 49, {0, 0, -0.002f}));
  ticks(20);
  ASSERT_EQ(renderer_->model_sequence(), 1u);
  host_.take<palpate_ModelReport_1_0>();

  const auto expect_refused = [&](const wire::ModelContents& message, Status expected) {
    const std::uint32_t refused = endpoint_->counters().models_refused;
    host_.send(message);
    ticks(20);
    const auto reports = host_.take<palpate_ModelReport_1_0>();
    ASSERT_EQ(reports.size(), 1u);
    EXPECT_EQ(reports[0].status, static_cast<std::uint8_t>(expected));
    EXPECT_EQ(reports[0].sequence, 2u);
    EXPECT_EQ(endpoint_->counters().models_refused, refused + 1);
    EXPECT_EQ(endpoint_->counters().last_status, expected);
    EXPECT_EQ(renderer_->model_sequence(), 1u);
  };
  const auto model = [&] { return test::square_model(2, timing_.tick - 1, {0, 0, -0.002f}); };
  auto message = model();
  message.state_q.elements[3] = NAN;
  expect_refused(message, Status::model_not_finite);
  message = model();
  message.schema_hash ^= 1;
  expect_refused(message, Status::schema_mismatch);
  message = model();
  message.corner.elements[2] = 200;
  expect_refused(message, Status::model_inconsistent);
  message = model();
  message.tick += 1000;
  expect_refused(message, Status::model_from_future);
  ticks(2 * kTipHistory);
  message = model();
  message.tick -= kTipHistory + 10;
  expect_refused(message, Status::model_too_old);
}

TEST_F(EndpointTest, AnotherHostIsNotObeyedWhileItIsArmed) {
  constexpr std::uint16_t kOther = 11;
  ticks(50);
  host_.send(test::square_model(1, 49, {0, 0, -0.002f}));
  ticks(20);
  const auto challenge = command(palpate_Command_Request_1_0_ARM_REQUEST);
  ASSERT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token).status, 0);
  const auto before = endpoint_->counters();
  host_.node = kOther;
  host_.send(
      test::square_model(7, timing_.tick - 1, {0, 0, -0.002f}));  // a piece of its basis, and its state
  host_.send(trace_request(0, 0, palpate_TraceRequest_1_0_FORM_TIP, 8));
  ticks(20);
  EXPECT_EQ(renderer_->model_sequence(), 1u);
  EXPECT_EQ(endpoint_->counters().models_taken, before.models_taken);
  EXPECT_GE(endpoint_->counters().frames_refused, before.frames_refused + 3);
  EXPECT_EQ(endpoint_->counters().last_status, Status::command_refused);
  EXPECT_EQ(status().trace_form, palpate_TraceRequest_1_0_FORM_FULL);
  // Nor is what it says a sign of life of the one that has armed.
  for (std::uint32_t i = 0; i < 5000 && mailbox_.is_armed; ++i) {
    host_.send(trace_request(0, 0));
    ticks(1);
    if (status().mode == palpate_BoardStatus_1_0_MODE_SUSPENDED) break;
  }
  EXPECT_EQ(status().mode, palpate_BoardStatus_1_0_MODE_SUSPENDED);
  // Everybody may switch off; a response goes to who asked.
  palpate_Command_Request_1_0 disarm{};
  disarm.action = palpate_Command_Request_1_0_DISARM;
  host_.send(disarm);
  ticks(2);
  EXPECT_EQ(status().mode, palpate_BoardStatus_1_0_MODE_IDLE);
}

TEST_F(EndpointTest, WhoReadsTheTokenInTheStatusCannotArmWithIt) {
  ticks(limits_.boot_ticks);
  const auto challenge = command(palpate_Command_Request_1_0_ARM_REQUEST);
  ASSERT_NE(challenge._token, 0u);
  host_.node = 11;
  const auto of_another = command(palpate_Command_Request_1_0_ARM_CONFIRM, status()._token);
  EXPECT_EQ(of_another.status, static_cast<std::uint8_t>(Status::command_refused));
  EXPECT_EQ(of_another.mode, palpate_BoardStatus_1_0_MODE_IDLE);
  host_.node = wire::kHostNode;
  EXPECT_EQ(command(palpate_Command_Request_1_0_ARM_CONFIRM, challenge._token).mode,
            palpate_BoardStatus_1_0_MODE_RENDER);
}

TEST_F(EndpointTest, ModelsOfAnotherHostAreForgottenAtArming) {
  ticks(50);
  host_.send(test::square_model(1, 49, {0, 0, -0.002f}));
  ticks(20);
  ASSERT_EQ(renderer_->model_sequence(), 1u);
  host_.node = 11;
  palpate_Command_Request_1_0 request{};
  request.action = palpate_Command_Request_1_0_ARM_REQUEST;
  host_.send(request);
  ticks(2);
  request.action = palpate_Command_Request_1_0_ARM_CONFIRM;
  request._token = host_.take<palpate_Command_Response_1_0>().back()._token;
  host_.send(request);
  ticks(2);
  ASSERT_EQ(status().mode, palpate_BoardStatus_1_0_MODE_RENDER);
  EXPECT_EQ(renderer_->model_sequence(), 0u);
  host_.send(test::square_model(2, timing_.tick - 1, {0, 0, -0.002f}));
  ticks(20);
  EXPECT_EQ(renderer_->model_sequence(), 2u);
}

TEST_F(EndpointTest, CorruptFramesAreCountedAndCostOnlyThemselves) {
  ticks(limits_.boot_ticks);
  auto bad = HostPeer::frame(wire::request_specifier(wire::kGetInfoService), 1, {});
  bad[8] ^= 0x10;
  host_.send_bytes(bad);
  (void)ask<palpate_GetInfo_Response_1_0>(palpate_GetInfo_Request_1_0{});
  const auto after = status();
  EXPECT_EQ(after.frames_refused, 1u);
  EXPECT_EQ(after.frames_received, 1u);
  EXPECT_NE(after.last_status, 0);
}

TEST_F(EndpointTest, UnknownPortsAndShortPayloadsAreRefused) {
  host_.send_bytes(HostPeer::frame(wire::message_specifier(1234), 0, {}));
  ticks(2);
  EXPECT_EQ(endpoint_->counters().last_status, Status::port_unknown);
  host_.send_bytes(HostPeer::frame(wire::request_specifier(wire::kCommandService), 0, {}));
  ticks(2);
  EXPECT_EQ(endpoint_->counters().last_status, Status::payload_malformed);
  EXPECT_EQ(endpoint_->counters().frames_refused, 2u);
}

// What a node says of itself, by its bytes (shared/wire/node_test.cpp has the layouts).
TEST_F(EndpointTest, AHeartbeatComesOnceASecondFromTheFirstTickOn) {
  ticks(1);
  auto heard = heartbeats();
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_EQ(heard[0].payload[0], 0);
  EXPECT_EQ(heard[0].payload[5], static_cast<std::uint8_t>(wire::NodeMode::initialization));
  ticks(998);
  EXPECT_TRUE(heartbeats().empty());
  ticks(2001);
  heard = heartbeats();
  ASSERT_EQ(heard.size(), 3u);
  for (std::uint8_t i = 0; i < 3; ++i) {
    EXPECT_EQ(heard[i].header.transfer_id, i + 1u);
    EXPECT_EQ(heard[i].header.destination, wire::kBroadcast);
    EXPECT_EQ(heard[i].payload,
              (std::vector<std::uint8_t>{static_cast<std::uint8_t>(i + 1), 0, 0, 0, 0, 0, 0}));
  }
}

TEST_F(EndpointTest, AHeartbeatTellsOfFaults) {
  ticks(limits_.boot_ticks);
  command(palpate_Command_Request_1_0_STOP);
  ticks(1000);
  auto heard = heartbeats();
  EXPECT_EQ(heard.back().payload[4], static_cast<std::uint8_t>(wire::NodeHealth::caution));
  EXPECT_EQ(heard.back().payload[6], 2);  // stop_command is bit 1
  sensors_.count[0] = 100'000;            // no hand does that in a tick
  ticks(1000);
  heard = heartbeats();
  EXPECT_EQ(heard.back().payload[4], static_cast<std::uint8_t>(wire::NodeHealth::warning));
  EXPECT_EQ(heard.back().payload[6], 2);  // the first of them
  command(palpate_Command_Request_1_0_CLEAR_FAULT);
  ticks(1000);
  heard = heartbeats();
  EXPECT_EQ(heard.back().payload[4], static_cast<std::uint8_t>(wire::NodeHealth::nominal));
  EXPECT_EQ(heard.back().payload[6], 0);
}

TEST_F(EndpointTest, AHeartbeatTellsOfCalibration) {
  ticks(950);
  command(palpate_Command_Request_1_0_CALIBRATE);  // 100 ticks of rest
  ticks(60);
  EXPECT_EQ(heartbeats().back().payload[5], static_cast<std::uint8_t>(wire::NodeMode::maintenance));
}

TEST_F(EndpointTest, TellsANodeWhoItIs) {
  host_.transfer_id = 77;
  host_.send_bytes(HostPeer::frame(wire::request_specifier(wire::kNodeInfoService), 77, {}));
  ticks(1);
  const auto response = std::find_if(host_.received.begin(), host_.received.end(), [](const auto& one) {
    return one.header.specifier == wire::response_specifier(wire::kNodeInfoService);
  });
  ASSERT_NE(response, host_.received.end());
  EXPECT_EQ(response->header.destination, wire::kHostNode);
  EXPECT_EQ(response->header.transfer_id, 77u);
  std::vector<std::uint8_t> expected(wire::MessageTraits<wire::NodeInfo>::kMaxBytes);
  std::size_t length = 0;
  ASSERT_EQ(wire::serialize(wire::NodeInfo{{}, {1, 2}, {1}, "memory"}, expected, length), Status::ok);
  expected.resize(length);
  EXPECT_EQ(response->payload, expected);
  EXPECT_EQ(endpoint_->counters().frames_refused, 0u);
}

TEST_F(EndpointTest, HeartbeatsOfOthersAreNoFaultAndMayBeLost) {
  for (const std::uint64_t transfer_id : {0u, 7u})
    host_.send_bytes(HostPeer::frame(wire::kHeartbeatSubject, transfer_id, std::vector<std::uint8_t>(7)));
  const auto after = status();
  EXPECT_EQ(after.frames_received, 2u);
  EXPECT_EQ(after.frames_refused, 0u);
  EXPECT_EQ(after.frames_lost, 0u);
}

// Each says with which tick the one before went out; the first, that there was none.
TEST_F(EndpointTest, TheTimeGoesOutWhileAnotherNodesHeartbeatIsHeard) {
  ticks(1200);
  EXPECT_TRUE(of_subject(wire::kTimeSubject).empty());
  host_.send_bytes(HostPeer::frame(wire::kHeartbeatSubject, 0, std::vector<std::uint8_t>(7)));
  const std::uint32_t before_tick = servo_->next_tick();
  ticks(5000);
  const auto heard = of_subject(wire::kTimeSubject);
  ASSERT_EQ(heard.size(), 7u);  // from 0 to 3 s
  std::uint64_t previous_us = 0;
  for (std::size_t i = 0; i < heard.size(); ++i) {
    std::uint64_t said_us = 0;
    for (std::size_t byte = 0; byte < 7; ++byte)
      said_us |= std::uint64_t{heard[i].payload[byte]} << (8 * byte);
    EXPECT_EQ(said_us, previous_us);
    EXPECT_EQ(heard[i].header.transfer_id, i);
    EXPECT_EQ(heard[i].header.destination, wire::kBroadcast);
    previous_us = 1000u * (before_tick + 1 + 500 * i);
  }
  host_.send_bytes(HostPeer::frame(wire::kHeartbeatSubject, 1, std::vector<std::uint8_t>(7)));
  ticks(2);
  const auto again = of_subject(wire::kTimeSubject);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].payload, std::vector<std::uint8_t>(7));  // the one before is too old
}

TEST_F(EndpointTest, FramesForOthersAreNoBusinessOfOurs) {
  std::vector<std::uint8_t> frame(64);
  frame.resize(wire::encode_frame({.source = wire::kHostNode,
                                   .destination = 7,
                                   .specifier = wire::request_specifier(wire::kGetInfoService)},
                                  {}, frame));
  host_.send_bytes(frame);
  ticks(2);
  EXPECT_TRUE(host_.take<palpate_GetInfo_Response_1_0>().empty());
  EXPECT_EQ(endpoint_->counters().frames_refused, 0u);
}

TEST_F(EndpointTest, CountsTheHostsLostTransfers) {
  host_.send(palpate_GetInfo_Request_1_0{});
  host_.transfer_id += 3;
  host_.send(palpate_GetInfo_Request_1_0{});
  ticks(2);
  EXPECT_EQ(status().frames_lost, 3u);
}

// Nobody takes the bytes: frames are dropped whole, and those that come out later are good.
TEST_F(EndpointTest, AFullTransmitRingDropsWholeFramesAndCountsThem) {
  for (int i = 0; i < 1000; ++i) tick();
  const std::uint32_t unsent = endpoint_->counters().frames_unsent;
  EXPECT_GT(unsent, 100u);
  host_.pump();  // asserts that every frame is good
  EXPECT_GT(host_.received.size(), 10u);
  ticks(40);
  EXPECT_EQ(endpoint_->counters().frames_unsent, unsent);
  EXPECT_EQ(status().frames_unsent, unsent);
}

TEST_F(EndpointTest, SurvivesNoise) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint8_t> noise(2000);
    for (auto& value : noise) value = static_cast<std::uint8_t>(byte(random));
    host_.send_bytes(noise);
    ticks(1);
  }
  host_.send_bytes(std::vector<std::uint8_t>{0});
  ticks(2);
  EXPECT_GT(status().frames_refused, 1000u);
  (void)ask<palpate_GetInfo_Response_1_0>(palpate_GetInfo_Request_1_0{});
}

}  // namespace
}  // namespace palpate::firmware
