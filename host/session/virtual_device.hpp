// A device without hardware, in real time: firmware on its board, arm and hand, and a link of the operating
// system at which any program finds the board as it would find a real one.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "host/link/transport.hpp"
#include "host/plant/hand_guide.hpp"
#include "host/plant/plant.hpp"
#include "host/session/emulated_device.hpp"
#include "host/session/lockstep_peer.hpp"
#include "host/session/pacer.hpp"

namespace palpate::host {

struct VirtualDeviceState {
  std::uint32_t tick = 0;
  Vec3d tip_m{};                   // where it is, not what the encoders say; device frame
  Vec3d hand_force_N{};            // of the hand on the tool
  std::array<float, 3> force_N{};  // of the tip on the body, as the firmware has it after limits
  std::uint32_t mode = 0;          // firmware::Mode
  std::uint32_t faults = 0;        // bits of firmware::Fault
  bool outputs_on = false;
  double slipped_s = 0.0;  // wall clock that went on without the device
  link::TransportCounters link{};
  bool running = false;
  std::string error;  // why it ended by itself; empty: it did not
};

class VirtualDevice {
 public:
  // `path`: of the hand; it is held at its beginning until play_path(). Throws what plant and guide throw.
  VirtualDevice(const plant::PlantParameters& parameters, plant::TipPath path,
                std::unique_ptr<LockstepPeer> board, std::unique_ptr<link::Transport> link);
  // Stops.
  ~VirtualDevice();
  VirtualDevice(const VirtualDevice&) = delete;
  VirtualDevice& operator=(const VirtualDevice&) = delete;

  // Once.
  void start();
  // Ends the thread and tells the board to end; any number of times.
  void stop();

  // From any thread, in effect from the next tick on. False, and no effect, where the arm cannot reach.
  bool guide_hand(const Vec3d& target_m);
  // The hand follows the path from its beginning, where it has to be.
  void play_path();
  void set_emergency_stop(bool open) { emergency_stop_ = open; }

  [[nodiscard]] VirtualDeviceState state() const;
  // Of the link, as a program opens it.
  [[nodiscard]] std::string address() const { return link_->address(); }

 private:
  void run();
  void run_tick();

  plant::TipPath path_;
  plant::ArmPlant reach_;  // for other threads: has no state
  std::unique_ptr<LockstepPeer> board_;
  std::unique_ptr<link::Transport> link_;
  // The thread's alone.
  plant::Plant plant_;
  plant::HandGuide guide_;
  EmulatedDevice device_;
  Pacer pacer_;
  double path_began_s_ = -1.0;  // virtual time; negative: the hand follows the guide

  mutable std::mutex mutex_;  // of what follows
  std::vector<std::function<void()>> controls_;
  VirtualDeviceState state_;

  std::atomic<bool> stop_{false}, emergency_stop_{false};
  std::thread thread_;
};

}  // namespace palpate::host
