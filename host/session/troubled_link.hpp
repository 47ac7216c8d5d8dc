// The two directions of a closed loop's link with what goes wrong on it (LinkTroubles): between the two ends
// and the media that carry the bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "host/link/can_fault_plan.hpp"
#include "host/link/delay_line.hpp"
#include "host/link/fault_plan.hpp"
#include "host/link/host_endpoint.hpp"
#include "host/link/medium.hpp"
#include "host/link/usb_host.hpp"
#include "host/session/closed_loop_config.hpp"
#include "host/session/trouble_counters.hpp"

namespace palpate::host {

// One direction's frames, hit by chance or by plan, on a serial link or on CAN.
class TroubledDirection {
 public:
  // Throws as FaultPlan and CanFaultPlan do; std::invalid_argument for planned faults of frames on CAN.
  TroubledDirection(link::FramingKind framing, const std::vector<link::Fault>& planned,
                    const std::vector<link::RandomFault>& random, std::uint32_t seed);
  std::vector<std::uint8_t> apply(std::span<const std::uint8_t> bytes, std::uint32_t tick, bool unplugged);
  // FaultPlan::add, CanFaultPlan::add.
  void add(const link::Fault& fault) { (void)(is_can_ ? can_.add(fault) : serial_.add(fault)); }
  [[nodiscard]] const link::FaultCounts& hit() const {
    return is_can_ ? can_.faults_applied() : serial_.faults_applied();
  }
  [[nodiscard]] std::uint64_t frames() const { return is_can_ ? can_.frames_seen() : serial_.frames_seen(); }
  [[nodiscard]] std::uint64_t cut() const { return is_can_ ? can_.frames_cut() : kept_; }
  // Each tick in which a fault hit, in order.
  [[nodiscard]] const std::vector<std::uint32_t>& hit_ticks() const { return hit_ticks_; }
  // Serial frames, or transfers, that do not come whole.
  [[nodiscard]] std::uint64_t removed() const {
    return serial_.frames_spoilt() + kept_ + can_.transfers_spoilt();
  }

 private:
  std::vector<std::uint8_t> pass(std::span<const std::uint8_t> bytes, std::uint32_t tick, bool unplugged);

  bool is_can_;
  link::FaultPlan serial_;
  link::CanFaultPlan can_;
  std::uint64_t kept_ = 0;
  std::vector<std::uint32_t> hit_ticks_;
};

// `down` and `up` must outlive it. One thread; ticks never decrease. On USB the cable and the program's
// standing still are the host controller's, which knows what has crossed, and delays are the driver's: on the
// bus itself there are records, and what is on their way comes to the host later than it crosses.
class TroubledLink {
 public:
  // Throws as TroubledDirection does, and std::invalid_argument for a babbling node that is not on CAN, for a
  // device that refuses and is not on USB, and for what a USB bus cannot do. `usb`: of down and up, where
  // they are USB.
  TroubledLink(link::Medium& down, link::Medium& up, const ClosedLoopConfig& config,
               link::UsbHost* usb = nullptr);

  // Bytes of one end on their way to the other.
  void send_up(std::span<const std::uint8_t> bytes, std::uint32_t tick);
  void send_down(std::span<const std::uint8_t> frame, std::uint32_t tick);
  // What has arrived. Of a host that is stopped it waits for when it goes on.
  std::vector<std::uint8_t> to_host(std::uint32_t tick);
  std::vector<std::uint8_t> to_board(std::uint32_t tick) { return down_.deliver(tick); }
  // Does the host's process run?
  [[nodiscard]] bool host_runs(std::uint32_t tick) const;
  // What a second host sends in this tick, and what has been delayed until now; after send_down.
  void send_of_others(std::uint32_t tick);

  void set_unplugged(bool unplugged) { unplugged_ = unplugged; }
  // A node fills the bus with frames of the first priority. Throws std::invalid_argument but on CAN.
  void set_babbling(bool babbling);
  // TroubledDirection::add; of FaultKind::flip_bit on CAN: the next attempt to send fails.
  void add_fault(bool to_board, const link::Fault& fault);
  [[nodiscard]] const std::vector<std::uint32_t>& hit_ticks(bool to_board) const {
    return (to_board ? faults_down_ : faults_up_).hit_ticks();
  }
  [[nodiscard]] TroubleCounters counters() const;

 private:
  [[nodiscard]] bool is_unplugged(std::uint32_t tick) const;
  // Frames of a node that has nothing to do with the loop, so many bytes of them, rounded up.
  void add_foreign(double bytes, std::uint32_t identifier, std::vector<link::OutgoingFrame>& frames) const;

  link::Medium &down_, &up_;
  link::UsbHost* usb_;
  LinkTroubles troubles_;
  link::FramingKind framing_;
  TroubledDirection faults_down_, faults_up_;
  link::DelayLine delay_down_, delay_up_;
  link::HostEndpoint other_;
  bool unplugged_ = false, babbling_ = false;
  std::vector<std::uint8_t> waiting_;  // for a stopped host
  std::uint64_t foreign_ = 0;
  double babbled_bytes_ = 0.0;  // of the present tick, less what fits in it
};

}  // namespace palpate::host
