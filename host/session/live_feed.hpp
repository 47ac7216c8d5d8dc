// What a loop in real time leaves for a screen: in buffers of fixed length, whose oldest entries go when
// nobody fetches them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "host/link/medium.hpp"
#include "host/msd/body.hpp"
#include "host/session/loop_host.hpp"
#include "host/session/loop_record.hpp"

namespace palpate::host {

// A tick, and how the wall clock saw it.
struct LiveTick {
  LoopTick loop{};
  float late_s = 0.0f;  // from when it should have begun to when it began; negative never
  float took_s = 0.0f;  // board, plant and host
};

// The body as the session has it, for drawing.
struct LivePicture {
  std::uint32_t tick = 0;
  BodyState state;
  std::vector<int> patch_nodes;  // of the newest model
};

struct LiveStatus {
  std::uint32_t tick = 0;
  LoopCounters counters{};
  std::optional<palpate_BoardStatus_1_0> board;  // as it came over the link
  link::MediumCounters down{}, up{};
  TroubleCounters troubles{};      // that were injected
  double slipped_s = 0.0;          // wall clock that went on without the loop
  std::uint64_t ticks_unseen = 0;  // went because nobody took them
  std::uint64_t links_opened = 0;  // of a board at a link of the operating system: more than 1: it had gone
  bool link_is_open = true;
  std::string link_trouble;  // of such a link: Transport::trouble
  bool running = false;
  std::string error;  // why it ended by itself; empty: it did not
};

class LiveFeed {
 public:
  // Seconds, for a window that is being moved or a disk that stalls; some megabytes.
  static constexpr std::size_t kMostTicks = 4000, kMostUpdates = 1000;
  // A status of the board for a model is waited for that long before its row is given away as it is: longer
  // than the board may hold it (docs/safety.md: 1,000 ticks).
  static constexpr std::uint32_t kUpdateSettles_ticks = 1500;

  // The loop's thread.
  void add(const LiveTick& tick);
  // Updates whose fate is known, the newest body if it is wanted, counters; the host forgets what is old.
  void look_at(LoopHost& host, std::uint32_t tick);
  void edit(const std::function<void(LiveStatus&)>& change);

  // Any thread. Ticks since the call before, at most the newest kMostTicks.
  std::vector<LiveTick> take_ticks();
  // Models of which no more news will come, oldest first.
  std::vector<UpdateRecord> take_updates();
  // The newest, or null where it is the one of the call before. None is made until this one is fetched.
  std::shared_ptr<const LivePicture> take_picture();
  [[nodiscard]] LiveStatus status() const;

 private:
  void take_over_updates(LoopHost& host, std::uint32_t tick);
  [[nodiscard]] std::shared_ptr<const LivePicture> new_picture(const LoopHost& host) const;

  std::size_t updates_given_ = 0;  // the loop's own
  mutable std::mutex mutex_;       // of what follows
  std::deque<LiveTick> ticks_;
  std::deque<UpdateRecord> updates_;
  std::shared_ptr<const LivePicture> picture_;
  bool picture_wanted_ = true;
  LiveStatus status_;
};

}  // namespace palpate::host
