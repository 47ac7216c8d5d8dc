// The whole system in virtual time: arm and hand, the board behind its lock-step exchange, a metered link,
// the session.
//
// One servo tick: the board reads encoders and the bytes that the link has brought, computes, and hands back
// set-points and its own bytes; the plant lets the millisecond pass; what has arrived at the host is taken by
// the session, which answers after its computing delay. Nothing here looks at the wall clock: equal scenes
// give equal records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "host/link/fault_plan.hpp"
#include "host/link/medium.hpp"
#include "host/plant/plant.hpp"
#include "host/session/closed_loop_config.hpp"
#include "host/session/emulated_device.hpp"
#include "host/session/lockstep_peer.hpp"
#include "host/session/loop_host.hpp"
#include "host/session/loop_record.hpp"
#include "host/session/simulation.hpp"
#include "host/session/troubled_link.hpp"

namespace palpate::host {

// What it is given must outlive it. `down` carries bytes to the board, `up` to the host; `usb` is theirs
// where they are USB (MeteredLink::usb_host). One thread. Throws
// what plant, session and peer throw; std::invalid_argument for Feedback::paper without full traces.
class ClosedLoop {
 public:
  ClosedLoop(const Body& body, const BodyState& start, plant::Plant& plant, LockstepPeer& board,
             link::Medium& down, link::Medium& up, const ClosedLoopConfig& config,
             link::UsbHost* usb = nullptr);

  // The next servo tick.
  [[nodiscard]] std::uint32_t tick() const { return device_.tick(); }
  // Runs it, and those after it whose deadlines the board missed.
  LoopTick advance();
  // Tells the board to end.
  void shut_down() { device_.shut_down(); }

  [[nodiscard]] LoopHost& host() { return host_; }
  [[nodiscard]] const LoopHost& host() const { return host_; }
  // Opens the chain of the emergency stop, or closes it.
  void set_emergency_stop(bool open) { emergency_stop_ = open; }
  // The cable is out, or in again; what has passed it arrives.
  void set_unplugged(bool unplugged) { link_.set_unplugged(unplugged); }
  // TroubledLink::set_babbling.
  void set_babbling(bool babbling) { link_.set_babbling(babbling); }
  // The board computes for 2.5 ticks more in the next one.
  void burn_next_tick() { burn_ = true; }
  // A fault of a frame to come, on the link to the board or to the host (TroubledLink::add_fault); the first
  // one that is planned for a frame counts.
  void add_fault(bool to_board, const link::Fault& fault) { link_.add_fault(to_board, fault); }
  [[nodiscard]] TroubleCounters troubles() const { return link_.counters(); }
  // TroubledDirection::hit_ticks.
  [[nodiscard]] const std::vector<std::uint32_t>& hit_ticks(bool to_board) const {
    return link_.hit_ticks(to_board);
  }
  // Is told which of the run's ticks have come to the host (LoopHost::listen_to_ticks), but for those of a
  // board that has started again.
  void listen_to_ticks(std::function<void(std::uint32_t, std::uint32_t, std::uint32_t)> listener) {
    listener_ = std::move(listener);
  }
  // How often the host has found that the board had started again.
  [[nodiscard]] std::uint32_t board_restarts() const { return board_restarts_; }

 private:
  [[nodiscard]] lockstep::SensorFrame sensors();
  // The host keeps the board's time: the run's, until it finds that the board has started again.
  [[nodiscard]] std::uint32_t host_tick() const { return tick() - board_began_tick_; }
  void hear_of_ticks(std::uint32_t first, std::uint32_t count, std::uint32_t now);

  plant::Plant& plant_;
  EmulatedDevice device_;
  link::Medium& down_;
  link::UsbHost* usb_;
  ClosedLoopConfig config_;
  LoopHost host_;
  TroubledLink link_;
  std::size_t next_grip_ = 0;
  bool emergency_stop_ = false, burn_ = false;
  std::function<void(std::uint32_t, std::uint32_t, std::uint32_t)> listener_;
  std::uint32_t newest_tick_ = 0;  // that the host has heard of
  std::uint32_t board_began_tick_ = 0;
  std::uint32_t board_restarts_ = 0;
};

// Runs `config.ticks` servo ticks and shuts the board down. Throws as ClosedLoop does;
// std::runtime_error("stopped") when progress says so.
ClosedLoopResult run_closed_loop(const Body& body, const BodyState& start, plant::Plant& plant,
                                 LockstepPeer& board, link::Medium& down, link::Medium& up,
                                 const ClosedLoopConfig& config, const Progress& progress,
                                 link::UsbHost* usb = nullptr);

}  // namespace palpate::host
