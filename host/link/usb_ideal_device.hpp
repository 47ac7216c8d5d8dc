// A device at the far end of UsbHost that takes every packet at once and, where it is told to, has some to
// give: what is measured with it is the host's controller and the bus.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "host/link/usb_records.hpp"

namespace palpate::link {

class UsbIdealDevice {
 public:
  static constexpr std::uint8_t kOut = 0x01, kIn = 0x81;

  // The records of a tick; returns the answers to those of the tick before, as a board does. Damaged records
  // are a bug: std::logic_error.
  std::vector<std::uint8_t> tick(std::span<const std::uint8_t> records);

  // A transfer for the host.
  void say(std::span<const std::uint8_t> frame);
  // Packets to the device that are refused from now on.
  void refuse(std::size_t packets) { refusals_ = packets; }
  // From now on it answers nothing that is asked of it.
  void fall_silent() { is_silent_ = true; }
  [[nodiscard]] const std::vector<std::uint8_t>& heard() const { return heard_; }
  [[nodiscard]] std::size_t copies() const { return copies_; }
  [[nodiscard]] std::size_t resets() const { return resets_; }

 private:
  void take(UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data);
  void take_setup(std::span<const std::uint8_t> setup);
  void take_out(UsbRecord kind, bool again, std::span<const std::uint8_t> data);
  void give(bool is_heard);
  void answer(UsbRecord kind, std::uint8_t address, std::span<const std::uint8_t> data = {});

  std::vector<std::uint8_t> answers_;
  bool is_attached_ = false, is_silent_ = false, is_refusing_ = false;
  std::vector<std::uint8_t> descriptor_;  // that was asked for
  std::uint8_t control_toggle_ = 1, out_toggle_ = 0, in_toggle_ = 0;
  std::deque<std::vector<std::uint8_t>> packets_;
  std::vector<std::uint8_t> heard_;
  std::size_t refusals_ = 0, copies_ = 0, resets_ = 0;
};

}  // namespace palpate::link
