// What messages cost on a link: the host's processor time, the firmware's clock, and what the medium carries
// at most.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host/link/metered_link.hpp"
#include "host/session/lockstep_peer.hpp"

namespace palpate::host::bench {

// Of the largest message there is (ModelState of all modes), one behind the other for `ticks` ticks: what
// arrives in a second.
struct MediumLimit {
  double message_bytes_per_s = 0.0;  // payloads
  double link_bytes_per_s = 0.0;     // framing included
  double busy_share = 0.0;           // of the time
};
MediumLimit measure_medium_limit(const link::MeteredLinkOptions& options, std::uint32_t ticks);

// One message. Times are of this thread's processor clock, medians over blocks of messages.
struct HostMessageCost {
  std::string message;
  std::size_t message_bytes = 0, link_bytes = 0;
  bool to_board = false;  // encoded here; else decoded
  double seconds = 0.0;
  double copy_seconds = 0.0;  // of a memcpy of as many bytes as on the link, in turn
};
// Throws std::invalid_argument without a round.
std::vector<HostMessageCost> measure_host_cost(link::FramingKind framing, std::uint32_t rounds);

// One message on a board that is idle, from its clock: medians over `rounds`.
struct BoardMessageCost {
  std::string message;
  std::size_t message_bytes = 0, link_bytes = 0;
  bool to_board = false;
  double clock_counts = 0.0;  // in the tick and the background after it, beyond those of a tick without it
};
// `board` has just been started; it is told to end. Throws std::runtime_error for a board without a clock.
std::vector<BoardMessageCost> measure_board_cost(LockstepPeer& board, link::FramingKind framing,
                                                 std::uint32_t rounds);

}  // namespace palpate::host::bench
