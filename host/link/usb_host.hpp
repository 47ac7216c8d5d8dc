// A USB host's controller in virtual time, with cable and driver, between the host's program and a board
// whose own USB stack is at the other end (boards/lockstep/usb_record.hpp).
//
// What a device that comes goes through is USB 2.0's: a cable that is put in settles for 100 ms (7.1.7.3), a
// reset takes 10 ms, and 10 ms are the device's (7.1.7.5); then enumeration (usb_enumeration.hpp). The link
// is open from there on, until the device goes.
//
// In a frame of the bus tokens take their time (usb_time.hpp): packets to the device, and questions whether
// it has one, in turn. It is asked 8 times a frame after it had something, else twice. How long an answer is
// shows when it comes back, two ticks later: what it took is taken off the frame that is planned then.
//
// An error hits a transaction's packets: from the host (token, data, acknowledgement of what it has asked
// for) as direction 0, from the device (data, handshake) as direction 1. What is hit goes again, with its
// toggle, until it arrives; a real controller gives up after three in a row and leaves the rest to its
// driver.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "host/link/bus_direction.hpp"
#include "host/link/bus_errors.hpp"
#include "host/link/usb_enumeration.hpp"
#include "host/link/usb_pipes.hpp"
#include "host/link/usb_records.hpp"
#include "host/link/usb_time.hpp"

namespace palpate::link {

// Of what the host's program hands over each submission is a frame, and a transfer. What the medium `down`
// delivers, and `up` takes, are records of the bus. Ticks never decrease, those of both taken together; a
// frame is planned when a tick is named for the first time. One thread.
class UsbHost {
 public:
  // `queue_limit_bytes`: most bytes that may wait, to the device. Throws std::invalid_argument if it is 0,
  // and for errors out of their range.
  explicit UsbHost(std::size_t queue_limit_bytes = 1u << 20, BusErrors errors = {});
  UsbHost(const UsbHost&) = delete;
  UsbHost& operator=(const UsbHost&) = delete;

  Medium& down() { return down_; }
  Medium& up() { return up_; }

  // The cable. What has crossed before it is out arrives; frames that wait do not (frames_unsent()).
  void set_plugged(bool plugged, std::uint32_t tick);
  // A program that stands still takes what its driver has buffers for, and no more.
  void set_program_runs(bool runs) { program_runs_ = runs; }
  // The device refuses all that is asked of its two endpoints.
  void set_refused(bool refused) { is_refused_ = refused; }

  // Is there a device with its endpoints? Was there ever one?
  [[nodiscard]] bool is_open() const { return phase_ == Phase::open; }
  [[nodiscard]] bool was_open() const { return was_open_; }
  // Frames of the program for which there was no device, or which it took no more.
  [[nodiscard]] std::uint64_t frames_unsent() const { return frames_unsent_; }

 private:
  friend class BusDirection<UsbHost>;
  static constexpr std::size_t kDirections = 2;
  enum class Phase : std::uint8_t { none, settling, resetting, enumerating, open, failed };
  // A token on its way.
  struct Asked {
    enum class Kind : std::uint8_t { nobodys, control, out, in } kind;
    bool is_taken = true;         // the host hears the answer
    bool is_acknowledged = true;  // and the device hears that it has
    std::uint8_t address = 0;
    std::size_t record_bytes = 0;
  };

  void advance(std::uint32_t tick);
  void plan(std::uint32_t tick);
  void plan_control(std::uint32_t tick);
  void plan_bulk(std::uint32_t tick);
  // Each returns whether there was something to do and time for it.
  bool plan_out(std::uint32_t tick, std::uint64_t& left);
  bool plan_in(std::uint32_t tick, std::uint64_t& left);
  void ask(const Asked& asked, std::size_t records_before);
  void take(const UsbAnswer& answer, std::uint32_t tick);
  void take_in(const Asked& asked, const UsbAnswer& answer);
  void settle(std::uint32_t tick, std::uint32_t ticks);
  // The device is gone, or is begun with anew: what waits for it is lost.
  void close();
  bool is_hit(std::size_t direction, std::uint32_t tick);

  bool submit(std::size_t direction, std::span<const std::uint8_t> bytes, std::uint32_t tick);
  std::vector<std::uint8_t> deliver(std::size_t direction, std::uint32_t tick);
  // Of a tick behind the newest: as of the newest.
  [[nodiscard]] std::size_t backlog_bytes(std::size_t direction, std::uint32_t tick) const;
  [[nodiscard]] double bytes_per_tick() const {
    return static_cast<double>(kUsbPacketsPerFrame * kUsbPacketBytes);
  }
  [[nodiscard]] MediumCounters counters(std::size_t direction) const;

  std::size_t queue_limit_bytes_;
  BusErrors errors_;
  std::uint32_t tick_ = 0;
  bool is_attached_ = false, is_plugged_ = true, was_open_ = false;
  bool program_runs_ = true, is_refused_ = false;
  Phase phase_ = Phase::none;
  std::uint32_t due_tick_ = 0;  // of the phase's end
  std::size_t tries_ = 0;       // at this device
  UsbEnumeration enumeration_;
  UsbOutPipe out_;
  UsbInPipe in_;
  UsbAnswerReader reader_;
  std::deque<Asked> asked_;
  std::size_t asked_bytes_ = 0;
  std::vector<std::uint8_t> records_;  // for the board
  std::deque<std::pair<std::uint32_t, std::vector<std::uint8_t>>> received_;
  bool had_data_ = false;  // among the answers since the frame before
  std::size_t in_buffers_ = 0;
  std::uint64_t debt_ = 0;  // bytes of the bus that answers have taken
  std::uint64_t draws_ = 0;
  std::uint64_t frames_unsent_ = 0;
  struct Side {
    std::uint64_t bytes_accepted = 0, bytes_delivered = 0, bytes_dropped = 0, submissions_dropped = 0;
    std::uint64_t attempts_failed = 0, busy = 0;
  };
  std::array<Side, kDirections> sides_{};
  BusDirection<UsbHost> down_{*this, 0}, up_{*this, 1};
};

}  // namespace palpate::link
