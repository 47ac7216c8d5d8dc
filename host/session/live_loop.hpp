// A closed loop without an end, in a thread of its own, paced by the wall clock: what a person's screen shows
// and a person's hand moves.
//
// The loop stays in virtual time; the thread only waits for the wall clock between two ticks, and where it
// has fallen behind too far it lets the wall clock go on without it. Nobody makes it wait: controls are
// picked up between two ticks, and what it has to show is left in a feed.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/link/metered_link.hpp"
#include "host/msd/body.hpp"
#include "host/plant/hand_guide.hpp"
#include "host/plant/plant.hpp"
#include "host/session/closed_loop.hpp"
#include "host/session/live_feed.hpp"
#include "host/session/pacer.hpp"

namespace palpate::host {

struct LiveSetup {
  Body body;
  BodyState start;
  plant::PlantParameters plant{};  // a hand of kind impedance
  plant::TipPath path;             // the hand begins at its beginning; play_path() follows it
  plant::HandGuideParameters guide{};
  std::unique_ptr<LockstepPeer> board;
  std::unique_ptr<link::MeteredLink> link;
  ClosedLoopConfig loop{};  // ticks, grip_changes and probe_node have no effect
};

class LiveLoop {
 public:
  static constexpr double kSlowest = 1e-3;  // but a pause
  // Throws what ClosedLoop, plant and guide throw.
  explicit LiveLoop(LiveSetup setup);
  // Stops.
  ~LiveLoop();
  LiveLoop(const LiveLoop&) = delete;
  LiveLoop& operator=(const LiveLoop&) = delete;

  // Once.
  void start();
  // Ends the thread and tells the board to end; any number of times.
  void stop();

  // Controls, from any thread; in effect from the next tick on. Those that throw std::invalid_argument have
  // no effect then. False, and no effect, where the arm cannot reach (a mouse goes anywhere).
  bool guide_hand(const Vec3d& target_m);
  // The hand follows the path from its beginning, after going there; guide_hand() ends it.
  void play_path();
  void set_grip(double grip);
  void arm();
  void command(firmware::Action action);
  void set_emergency_stop(bool open);
  void set_unplugged(bool unplugged);
  // On CAN; elsewhere it has no effect.
  void set_babbling(bool babbling);
  void burn_next_tick();
  // The next `count` frames in 1 to 1000. On CAN of the kinds drop, duplicate and flip_bit, the last of which
  // are attempts to send that fail: 32 in a row take the sender off the bus.
  void add_faults(bool to_board, link::FaultKind kind, std::size_t argument, std::uint32_t count);
  void set_host_delay(std::uint32_t ticks);
  // Of virtual over wall-clock time, kSlowest to 10; 0 pauses.
  void set_speed(double speed);

  [[nodiscard]] LiveFeed& feed() { return feed_; }
  [[nodiscard]] const LiveFeed& feed() const { return feed_; }

 private:
  void run();
  void post(std::function<void()> control);
  [[nodiscard]] plant::PathPoint intended();

  const Body body_;
  plant::TipPath path_;
  plant::ArmPlant reach_;  // for other threads: has no state
  std::unique_ptr<LockstepPeer> board_;
  std::unique_ptr<link::MeteredLink> link_;
  // The loop's thread alone.
  plant::Plant plant_;
  plant::HandGuide guide_;
  const bool is_can_;
  const std::uint32_t most_busy_ticks_;  // an update period: a model that takes longer is waited for
  ClosedLoop loop_;
  std::optional<double> path_began_s_;  // virtual time; none: the hand follows the guide
  bool going_to_path_ = false;
  double speed_ = 1.0;
  Pacer pacer_;
  LiveFeed feed_;

  mutable std::mutex mutex_;  // of what follows
  std::vector<std::function<void()>> controls_;
  bool has_ended_ = false;

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace palpate::host
