// The host's half of arming: outputs come on in two steps (palpate.Command, docs/safety.md).
#pragma once

#include <cstdint>
#include <optional>

#include "shared/wire/messages.hpp"

namespace palpate::host {

// Asks for a token once the board is idle and confirms with it. Tries again when no answer has come for a
// while; leaves the board alone once it has rendered or shown a fault: after that, arming again is a person's
// decision, begin().
class Arming {
 public:
  // by_itself: as if begin() had been called.
  explicit Arming(bool by_itself = true) : done_(!by_itself) {}
  void begin() { *this = Arming(idle_, false); }
  // Leaves the board alone: what a person does not want any more does not happen later.
  void cancel() {
    done_ = true;
    token_ = 0;
  }
  [[nodiscard]] bool is_wanted() const { return !done_; }
  // What to send now, if anything.
  std::optional<palpate_Command_Request_1_0> poll(std::uint32_t tick);
  void take(const palpate_BoardStatus_1_0& status);
  void take(const palpate_Command_Response_1_0& response);

 private:
  Arming(bool idle, bool done) : idle_(idle), done_(done) {}

  // An answer takes two crossings of the link and a tick; lost frames are noticed after this.
  static constexpr std::uint32_t kRetry_ticks = 200;

  bool idle_ = false;
  bool done_ = false;
  std::uint32_t token_ = 0;  // 0: none yet
  std::optional<std::uint32_t> asked_tick_;
};

}  // namespace palpate::host
