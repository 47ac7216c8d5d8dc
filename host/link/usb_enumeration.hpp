// What a host does with a USB device that has come, behind the reset of the bus: it asks what the device is,
// gives it an address and a configuration (USB 2.0, chapter 9), and looks for the interface that it wants.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "host/link/usb_records.hpp"

namespace palpate::link {

// Endpoint addresses of an interface of the vendor's class with a bulk endpoint each way, and the
// configuration that has it.
struct UsbPipes {
  std::uint8_t out = 0, in = 0;
  std::uint8_t configuration = 0;
};

// In a configuration descriptor with all that belongs to it; nullopt: it has none, or is malformed.
std::optional<UsbPipes> find_vendor_pipes(std::span<const std::uint8_t> descriptor);

// Control transfers on endpoint 0, token by token. A device that stalls, does not answer, or answers with
// what does not belong there ends it as `failed`.
class UsbEnumeration {
 public:
  enum class State : std::uint8_t { running, done, failed };
  struct Token {
    UsbRecord kind;
    std::uint8_t address;
    std::vector<std::uint8_t> data;
  };

  // The next token; nothing while one is not answered or the device is given time.
  std::optional<Token> next(std::uint32_t tick);
  // The answer to it.
  void take(const UsbAnswer& answer, std::uint32_t tick);
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] const UsbPipes& pipes() const { return pipes_; }

 private:
  enum class Step : std::uint8_t { device, address, configuration_head, configuration, configure };
  enum class Stage : std::uint8_t { setup, data_in, status_out, status_in };

  void begin(Step step, std::uint32_t tick);
  void end_transfer(std::uint32_t tick);
  void take_data(const UsbAnswer& answer);

  State state_ = State::running;
  Step step_ = Step::device;
  Stage stage_ = Stage::setup;
  bool waits_ = false;
  std::uint8_t toggle_ = 1;
  std::uint32_t not_before_tick_ = 0;
  std::uint32_t stage_tick_ = 0;  // when this stage began
  bool has_begun_ = false;
  std::size_t asked_bytes_ = 18;
  std::size_t configuration_bytes_ = 0;
  std::vector<std::uint8_t> received_;
  UsbPipes pipes_;
};

}  // namespace palpate::link
