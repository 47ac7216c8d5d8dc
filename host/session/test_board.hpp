// A board for tests: the firmware in memory, behind the lock-step exchange.
#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "boards/lockstep/byte_wire.hpp"
#include "boards/lockstep/emulated_board.hpp"
#include "firmware/app/app.hpp"
#include "host/session/lockstep_peer.hpp"

namespace palpate::host::test {

// One SensorFrame at a time goes in, one ActuatorFrame comes out.
struct MemoryPlatform {
  lockstep::SensorFrame sensors{};
  lockstep::ActuatorFrame actuators{};
  std::optional<lockstep::ExitCode> exited{};

  [[nodiscard]] bool has_plant() const { return true; }
  bool read_sensors(std::span<std::byte> bytes) {
    std::memcpy(bytes.data(), &sensors, bytes.size());
    return true;
  }
  bool write_actuators(std::span<const std::byte> bytes) {
    std::memcpy(&actuators, bytes.data(), bytes.size());
    return true;
  }
  void exit(lockstep::ExitCode code) { exited = code; }
  [[nodiscard]] std::uint32_t clock_count() const { return 0; }
  [[nodiscard]] std::uint32_t clock_Hz() const { return 0; }
  [[nodiscard]] std::uint32_t first_due_count() const { return 0; }
  void burn() {}
  void crash() {}
  void reset() {}  // MemoryPeer does
  void transmit(firmware::LinkBuffers&) {}
};

// Wire: what the link's bytes in the exchange are.
template <class Wire>
class MemoryPeerOn final : public LockstepPeer {
 public:
  // `name`: what it calls itself, for as long as there is a program; "memory" is none that a host knows.
  explicit MemoryPeerOn(std::string_view name = "memory") : identity_{name, "0", {1}} { board_->begin(); }
  void send(const lockstep::SensorFrame& frame) override {
    if ((frame.flags & lockstep::kReset) == 0) {
      platform_.sensors = frame;
      return;
    }
    *frames_ = {};
    board_ = std::make_unique<Board>(platform_, *frames_, hardware_, identity_.unique_id);
    app_ = std::make_unique<firmware::App<Board>>(*board_, identity_, firmware::kCatchUpCortexM4);
  }
  void receive(lockstep::ActuatorFrame& frame) override {
    app_->isr_tick();
    app_->background();
    frame = platform_.actuators;
  }
  [[nodiscard]] bool has_shut_down() const { return platform_.exited == lockstep::ExitCode::shutdown; }

 private:
  using Board = board::EmulatedBoard<MemoryPlatform, Wire>;
  const firmware::BoardIdentity identity_;
  MemoryPlatform platform_;
  std::unique_ptr<board::ExchangeFrames> frames_ = std::make_unique<board::ExchangeFrames>();
  typename Wire::Hardware hardware_;
  std::unique_ptr<Board> board_ =
      std::make_unique<Board>(platform_, *frames_, hardware_, identity_.unique_id);
  std::unique_ptr<firmware::App<Board>> app_ =
      std::make_unique<firmware::App<Board>>(*board_, identity_, firmware::kCatchUpCortexM4);
};
using MemoryPeer = MemoryPeerOn<board::ByteWire>;

}  // namespace palpate::host::test
