#include "host/link/can_errors.hpp"

#include <linux/can/error.h>

#include <string_view>

namespace palpate::link {
namespace {

constexpr std::uint8_t kOverflows = CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW;
constexpr std::uint8_t kWarnings =
    CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;

}  // namespace

void count_error(const can_frame& frame, CanErrors& errors, bool& is_bus_off) {
  const auto count = [&frame](std::uint64_t& counter, canid_t kind) {
    if ((frame.can_id & kind) != 0) ++counter;
  };
  count(errors.transmit_timeouts, CAN_ERR_TX_TIMEOUT);
  count(errors.lost_arbitrations, CAN_ERR_LOSTARB);
  count(errors.protocol_violations, CAN_ERR_PROT);
  count(errors.transceiver_faults, CAN_ERR_TRX);
  count(errors.unacknowledged, CAN_ERR_ACK);
  count(errors.bus_errors, CAN_ERR_BUSERROR);
  count(errors.bus_offs, CAN_ERR_BUSOFF);
  count(errors.restarts, CAN_ERR_RESTARTED);
  if ((frame.can_id & CAN_ERR_CRTL) != 0) {
    if ((frame.data[1] & kOverflows) != 0) ++errors.controller_overflows;
    if ((frame.data[1] & kWarnings) != 0) ++errors.controller_warnings;
  }
  if ((frame.can_id & CAN_ERR_BUSOFF) != 0) is_bus_off = true;
  if ((frame.can_id & CAN_ERR_RESTARTED) != 0) is_bus_off = false;
}

std::string text_of(const CanErrors& errors, bool is_bus_off) {
  std::string text;
  const auto add = [&text](std::string_view what, std::uint64_t count) {
    if (count == 0) return;
    text.append(text.empty() ? "" : ", ").append(what).append(" ").append(std::to_string(count));
  };
  add("bus-off", errors.bus_offs);
  add("restarts", errors.restarts);
  add("bus errors", errors.bus_errors);
  add("protocol violations", errors.protocol_violations);
  add("not acknowledged", errors.unacknowledged);
  add("transceiver faults", errors.transceiver_faults);
  add("controller warnings", errors.controller_warnings);
  add("controller overflows", errors.controller_overflows);
  add("transmit timeouts", errors.transmit_timeouts);
  add("frames missed by this program", errors.frames_missed);
  if (!is_bus_off) return text;
  return text.empty() ? "off the bus now" : "off the bus now; " + text;
}

}  // namespace palpate::link
