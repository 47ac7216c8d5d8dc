// A USB device controller in software, as TinyUSB wants one (device/dcd.h), on the bus of usb_record.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "boards/lockstep/usb_bus.hpp"

namespace palpate::board {

// Records that one background run handles: of what a full-speed bus carries in 1 ms (19 packets of 64 bytes;
// USB 2.0, table 5-9), of questions for packets that are not there, and of the frame's beginning.
inline constexpr std::size_t kUsbTransactionsPerTick = 32;

// One per program, for TinyUSB's drivers are functions. Background context, but where it says interrupt.
class VirtualController {
 public:
  static constexpr std::size_t kEndpoints = 4;

  explicit VirtualController(lockstep::UsbBus& bus);
  VirtualController(const VirtualController&) = delete;
  VirtualController& operator=(const VirtualController&) = delete;

  // Interrupt: the records of one tick. Interrupt: what there is for the far end; returns how many bytes.
  void isr_receive(std::span<const std::uint8_t> records);
  std::size_t isr_transmit(std::span<std::uint8_t> bytes) { return bus_.from_board.read(bytes); }

  enum class Step : std::uint8_t {
    none,   // no record, or no room for its answer
    quiet,  // one that changed nothing, such as a token that was refused
    event,  // one that TinyUSB has an event of
  };
  // Handles one record, at most.
  Step run_one();

  // Damaged records.
  [[nodiscard]] std::uint32_t records_refused() const { return records_refused_; }

  // TinyUSB's side. Addresses that do not exist are refused.
  void connect(bool is_connected);
  bool open(std::uint8_t address, std::uint16_t packet_bytes);
  void close_all();
  bool transfer(std::uint8_t address, std::uint8_t* data, std::uint16_t length);
  void stall(std::uint8_t address);
  void clear_stall(std::uint8_t address);
  void wake_host();

 private:
  // One direction of an endpoint.
  struct Pipe {
    std::uint8_t* data = nullptr;  // of TinyUSB's transfer
    std::uint16_t length = 0;
    std::uint16_t done = 0;
    std::uint16_t packet_bytes = 0;  // 0: not open
    bool armed = false;
    bool halted = false;
    bool refusing = false;  // up to a packet with kUsbAgain
    std::uint8_t toggle = 0;
  };

  Pipe* find(std::uint8_t address);
  void reset();
  // Each returns whether TinyUSB has an event.
  bool handle(lockstep::UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data);
  bool take_setup(std::span<const std::uint8_t> data);
  bool take_out(Pipe& pipe, std::uint8_t address, std::uint8_t toggle, std::span<const std::uint8_t> data);
  bool give_in(Pipe& pipe, std::uint8_t address, bool is_heard);
  // After a packet of `count` bytes.
  bool finish(Pipe& pipe, std::uint8_t address, std::size_t count, bool is_short);
  // False, for those of the functions above that have nothing else to report: TinyUSB has no event.
  bool answer(lockstep::UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data = {});
  void refuse_rest();

  lockstep::UsbBus& bus_;
  std::array<std::array<Pipe, 2>, kEndpoints> pipes_{};
  std::uint32_t records_refused_ = 0;
};

}  // namespace palpate::board
