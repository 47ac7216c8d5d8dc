// How the board is to send its servo ticks, and asking it to.
#pragma once

#include <cstdint>
#include <optional>

#include "host/session/tip_history.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::host {

enum class TraceForm : std::uint8_t {
  full = palpate_TraceRequest_1_0_FORM_FULL,  // palpate.ServoTrace
  tip = palpate_TraceRequest_1_0_FORM_TIP,    // palpate.TipTrace: all that a session needs
};

struct TraceWish {
  TraceForm form = TraceForm::full;
  std::uint8_t ticks = 4;  // in a message, 1 to 32
};

// The board says in its status how it sends them. Where that is otherwise than wished it is asked, until it
// does: neither a lost request nor a board that starts again changes what comes for longer than the time
// between two of its statuses.
class TraceChoice {
 public:
  explicit TraceChoice(const TraceWish& wish) : wish_(wish) {}

  void take(const palpate_BoardStatus_1_0& status);
  // The request to send now, if any.
  std::optional<palpate_TraceRequest_1_0> poll();
  // To send these ticks again, at most 256; every request says the wish, too.
  [[nodiscard]] palpate_TraceRequest_1_0 request(const TickRange& ticks) const;

 private:
  TraceWish wish_;
  bool ask_ = false;
};

}  // namespace palpate::host
