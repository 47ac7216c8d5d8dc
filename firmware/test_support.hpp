// For the firmware's tests: a board in memory, the host's end of its link, and a small local model as a
// message.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware/ports/ports.hpp"
#include "shared/model/test_model.hpp"
#include "shared/wire/frame_receiver.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::firmware::test {

// Fulfils the ports; a test sets the inputs and reads the outputs. The clock stands still but where the test
// moves it.
struct MemoryBoard {
  static constexpr std::uint32_t kClock_Hz = 25'000'000;
  static constexpr std::uint32_t kCountPerTick = kClock_Hz / kServoRate_Hz;

  std::array<std::int32_t, 3> count{};
  std::array<float, 3> current_A{};
  bool emergency_stop_open = false;
  bool supply_low = false;
  std::atomic<std::uint32_t> now_count{kCountPerTick};  // read by interrupt and background
  std::uint32_t burn_count = 0;                         // passes within the next tick

  std::array<float, 3> setpoint_A{};
  bool enabled = false;
  TickReport report{};
  LinkBuffers buffers{};

  void isr_begin_tick(std::uint32_t) {
    now_count += burn_count;
    burn_count = 0;
  }
  void isr_end_tick(const TickReport& tick_report) { report = tick_report; }
  std::array<std::int32_t, 3> isr_encoder_counts() { return count; }
  std::array<float, 3> isr_measured_currents_A() { return current_A; }
  bool isr_emergency_stop_open() { return emergency_stop_open; }
  bool isr_supply_low() { return supply_low; }
  void isr_set_currents(const std::array<float, 3>& wanted_A) { setpoint_A = wanted_A; }
  void isr_enable_amplifiers(EnableKey) { enabled = true; }
  void isr_disable_amplifiers() { enabled = false; }
  [[nodiscard]] std::uint32_t clock_count() const { return now_count; }
  [[nodiscard]] std::uint32_t clock_Hz() const { return kClock_Hz; }
  [[nodiscard]] std::uint32_t first_due_count() const { return kCountPerTick; }
  LinkBuffers& link() { return buffers; }
  void poll_receive() {}
  void start_transmit() {}

  ResetReport reset{};
  std::vector<std::uint32_t> over_reset{};  // a board that has such memory: kKeptWords
  [[nodiscard]] ResetReport reset_report() const { return reset; }
  std::span<std::uint32_t> kept_words() { return over_reset; }

  std::vector<std::uint8_t> kept{};  // parameters
  bool memory_works = true;
  [[nodiscard]] static bool keeps_parameters() { return true; }
  bool read_parameters(std::span<std::uint8_t> out) {
    if (kept.size() != out.size()) return false;
    std::copy(kept.begin(), kept.end(), out.begin());
    return true;
  }
  bool write_parameters(std::span<const std::uint8_t> in) {
    if (memory_works) kept.assign(in.begin(), in.end());
    return memory_works;
  }
};
static_assert(BoardPort<MemoryBoard>);

// The host's end of a link in memory.
class HostPeer {
 public:
  explicit HostPeer(LinkBuffers& link) : link_(link) {}

  struct Received {
    wire::FrameHeader header;
    std::vector<std::uint8_t> payload;
  };

  static std::vector<std::uint8_t> frame(std::uint16_t specifier, std::uint64_t transfer_id,
                                         std::span<const std::uint8_t> payload,
                                         std::uint16_t node = wire::kHostNode) {
    std::vector<std::uint8_t> bytes(wire::max_frame_bytes(payload.size()));
    bytes.resize(wire::encode_frame(
        {.source = node, .destination = wire::kBoardNode, .specifier = specifier, .transfer_id = transfer_id},
        payload, bytes));
    return bytes;
  }
  template <class Message>
  static std::vector<std::uint8_t> payload(const Message& message) {
    std::vector<std::uint8_t> bytes(wire::MessageTraits<Message>::kMaxBytes);
    std::size_t length = 0;
    EXPECT_EQ(wire::serialize(message, bytes, length), Status::ok);
    bytes.resize(length);
    return bytes;
  }

  void send_bytes(std::span<const std::uint8_t> bytes) { ASSERT_TRUE(link_.received.write(bytes)); }
  // Sends a message with the next transfer identifier of this peer.
  template <class Message>
  void send(const Message& message) {
    send_bytes(frame(wire::MessageTraits<Message>::kSpecifier, transfer_id++, payload(message), node));
  }

  // A model: its basis in pieces, and its state.
  void send(const wire::ModelContents& contents) {
    const wire::PackedModel packed = wire::pack(contents);
    if (packed.basis)
      for (const auto& part : wire::parts_of(*packed.basis, packed.state.basis_id)) send(part);
    send(packed.state);
  }

  // Takes what the board has sent so far; every frame must be good.
  void pump() {
    std::vector<std::uint8_t> bytes(kLinkTransmitCapacity);
    bytes.resize(link_.transmit.read(bytes));
    for (std::span<const std::uint8_t> rest(bytes); !rest.empty();) {
      const wire::Reception reception = receiver_.receive(rest);
      rest = rest.subspan(reception.consumed);
      if (!reception.complete) continue;
      received.push_back(
          {reception.frame.header, {reception.frame.payload.begin(), reception.frame.payload.end()}});
    }
    EXPECT_EQ(receiver_.counters().refused(), 0u);
  }
  // Messages of one type received so far, oldest first; forgets them.
  template <class Message>
  std::vector<Message> take() {
    pump();
    std::vector<Message> messages;
    std::erase_if(received, [&](const Received& one) {
      if (one.header.specifier != wire::MessageTraits<Message>::kSpecifier) return false;
      Message message;
      EXPECT_EQ(wire::deserialize<Message>(one.payload, message), Status::ok);
      messages.push_back(message);
      return true;
    });
    return messages;
  }

  std::vector<Received> received;
  std::uint64_t transfer_id = 0;
  std::uint16_t node = wire::kHostNode;  // who sends from now on

 private:
  LinkBuffers& link_;
  wire::FrameReceiver<wire::kLargestPayloadToHost> receiver_;
};

// A soft square, 1 cm wide, its surface upwards at `centre_m`, at rest at `tick`: four masses of 1 g whose
// modes, from 400 to 1,500 rad/s and well damped, hold some newtons at 2 mm.
inline wire::ModelContents square_model(std::uint32_t sequence, std::uint32_t tick, const Vec3f& centre_m) {
  const palpate::test::TestModel model(1e-3, 400.0, 1500.0, 1.0);
  wire::ModelContents message{};
  message.sequence = sequence;
  message.schema_hash = wire::kSchemaHash;
  message.tick = tick;
  message.valid_ticks = 1000;
  message.growth_ticks = 0xffff;
  message.modes = static_cast<std::uint16_t>(model.view.modes);
  message.nodes = message.surface_nodes = static_cast<std::uint8_t>(model.view.nodes);
  message.triangles = static_cast<std::uint8_t>(model.view.triangles);
  constexpr float kHalfWidth_m = 0.005f;
  const Vec3f corner_m = centre_m - Vec3f{kHalfWidth_m, kHalfWidth_m, 0.0f};
  for (std::size_t i = 0; i < 3; ++i) message.origin_m[i] = corner_m[i];
  const auto fill = [](auto& field, const auto& values) {
    field.count = values.size();
    std::copy(values.begin(), values.end(), field.elements);
  };
  const std::vector<float> rest(model.view.modes, 0.0f);
  fill(message.position_m, model.position_m);
  fill(message.triangle_id, model.triangle_id);
  fill(message.corner, model.corner);
  fill(message.triangle_friction, model.triangle_friction);
  fill(message.static_friction, model.static_friction);
  fill(message.kinetic_friction, model.kinetic_friction);
  fill(message.coefficient, model.coefficient);
  fill(message.load, model.load);
  fill(message.state_q, rest);
  fill(message.state_p, rest);
  fill(message.basis_scale, model.scale);
  fill(message.basis, model.basis);
  return message;
}

}  // namespace palpate::firmware::test
