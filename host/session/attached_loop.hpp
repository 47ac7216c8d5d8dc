// The host beside a board that runs by itself, in real time: over a link of the operating system, with a
// device in a person's hand or a virtual one (virtual_device.hpp).
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/link/transport.hpp"
#include "host/msd/body.hpp"
#include "host/plant/arm_plant.hpp"
#include "host/plant/plant.hpp"
#include "host/session/board_clock.hpp"
#include "host/session/closed_loop_config.hpp"
#include "host/session/live_feed.hpp"
#include "host/session/loop_host.hpp"
#include "shared/device/encoders.hpp"

namespace palpate::host {

struct AttachedSetup {
  Body body;
  BodyState start;
  plant::PlantParameters plant{};  // of the arm: for encoder counts, which a trace does not have
  std::string address;             // of the link, as open_transport() takes it
  ClosedLoopConfig loop{};         // what is the plant's and the medium's has no effect; traces are full ones
};

// A board that renders though this loop has not armed it, for a host that has gone, is disarmed. A link that
// goes is opened again as soon as it is there, and a board that has waited for it goes on (docs/safety.md); a
// board that has started again is served as a new one, and waits to be armed.
class AttachedLoop {
 public:
  // Opens the link. Throws TransportError, and what LoopHost throws.
  explicit AttachedLoop(AttachedSetup setup);
  // Stops.
  ~AttachedLoop();
  AttachedLoop(const AttachedLoop&) = delete;
  AttachedLoop& operator=(const AttachedLoop&) = delete;

  // Once.
  void start();
  // Disarms the board, if this loop has armed it: repeated until it says so, for half a second at most.
  // Closes the link and ends the thread; any number of times.
  void stop();

  // Controls, from any thread.
  void arm();
  void command(firmware::Action action);
  // std::invalid_argument above 1 s.
  void set_host_delay(std::uint32_t ticks);

  // Of a tick it has what the board's trace says: tip, force, contact, mode and faults; encoder counts are
  // those of an arm whose tip is there, the link's bytes those since the tick before; the rest is zero.
  [[nodiscard]] LiveFeed& feed() { return feed_; }
  [[nodiscard]] const LiveFeed& feed() const { return feed_; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kReadPatience{1};   // commands wait no longer
  static constexpr std::chrono::milliseconds kReopenAfter{250};  // a plug that is being put in
  static constexpr double kPause_s = 0.5;                        // longer than any computer lets it wait
  static constexpr double kSilence_s = 0.5, kAskAgain_s = 0.25;  // five statuses of a board
  static constexpr std::chrono::milliseconds kLeavePatience{500}, kLeaveAgain{50};
  static constexpr std::uint32_t kMostTicksAtOnce = 100;  // after a pause of the computer

  void run();
  void run_once();
  void leave();
  void begin_anew();
  void disarm_a_foundling();
  // A process that was stopped finds bytes that are as old: the board's clock would seem to have jumped back.
  void forget_what_waited();
  // Over UDP a board answers whom it has heard.
  void ask_a_silent_board();
  void post(std::function<void()> control);
  // False: it is not there.
  bool open_again();
  void take(const palpate_ServoTrace_1_0& trace);
  void poll_until(std::uint32_t tick);
  void write(const link::OutgoingFrame& frame);
  [[nodiscard]] double now_s() const;
  void note_models();
  [[nodiscard]] device::EncoderCounts counts_at(const Vec3d& tip_m) const;
  // Of the link since the tick before.
  void add_traffic(LoopTick& tick);

  const Body body_;
  const std::string address_;
  const plant::ArmPlant arm_;
  const device::EncoderCounts encoder_reference_;
  // The thread's alone.
  std::unique_ptr<link::Transport> link_;
  LoopHost host_;
  BoardClock clock_;
  Clock::time_point began_ = Clock::now(), tried_{}, disarmed_{};
  std::optional<std::uint32_t> fed_tick_;  // newest in the feed
  double last_bytes_s_ = -1.0, asked_at_s_ = -1.0;
  double heard_at_s_ = 0.0;  // the bytes that are being taken
  double ran_at_s_ = 0.0;
  std::uint32_t polled_tick_ = 0;
  double backlog_bytes_ = 0.0, backlog_at_s_ = 0.0;  // in the driver, by the link's rate
  std::uint64_t links_opened_ = 1;
  std::uint64_t bytes_down_ = 0, bytes_up_ = 0;            // of links before this one
  std::uint64_t bytes_seen_down_ = 0, bytes_seen_up_ = 0;  // in ticks
  bool armed_ = false;
  struct Taken {
    std::uint32_t sequence = 0, model_tick = 0;
  };
  Taken newest_model_{};

  std::mutex mutex_;  // of the controls
  std::vector<std::function<void()>> controls_;
  LiveFeed feed_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace palpate::host
