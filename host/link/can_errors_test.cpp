#include "host/link/can_errors.hpp"

#include <gtest/gtest.h>
#include <linux/can/error.h>

namespace palpate::link {
namespace {

can_frame error_frame(canid_t kinds, std::uint8_t controller = 0) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | kinds;
  frame.can_dlc = CAN_ERR_DLC;
  frame.data[1] = controller;
  return frame;
}

TEST(CanErrors, EachKindHasItsCounter) {
  struct Case {
    canid_t kind;
    std::uint64_t CanErrors::*counter;
  };
  for (const auto& [kind, counter] :
       {Case{CAN_ERR_TX_TIMEOUT, &CanErrors::transmit_timeouts},
        Case{CAN_ERR_LOSTARB, &CanErrors::lost_arbitrations},
        Case{CAN_ERR_PROT, &CanErrors::protocol_violations},
        Case{CAN_ERR_TRX, &CanErrors::transceiver_faults}, Case{CAN_ERR_ACK, &CanErrors::unacknowledged},
        Case{CAN_ERR_BUSERROR, &CanErrors::bus_errors}, Case{CAN_ERR_BUSOFF, &CanErrors::bus_offs},
        Case{CAN_ERR_RESTARTED, &CanErrors::restarts}}) {
    CanErrors errors;
    bool is_bus_off = false;
    count_error(error_frame(kind), errors, is_bus_off);
    EXPECT_EQ(errors.*counter, 1u);
    EXPECT_EQ(errors.transmit_timeouts + errors.lost_arbitrations + errors.protocol_violations +
                  errors.transceiver_faults + errors.unacknowledged + errors.bus_errors + errors.bus_offs +
                  errors.restarts + errors.controller_overflows + errors.controller_warnings,
              1u);
  }
}

TEST(CanErrors, AFrameMayTellOfSeveral) {
  CanErrors errors;
  bool is_bus_off = false;
  count_error(error_frame(CAN_ERR_ACK | CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_PASSIVE),
              errors, is_bus_off);
  EXPECT_EQ(errors.unacknowledged, 1u);
  EXPECT_EQ(errors.controller_overflows, 1u);
  EXPECT_EQ(errors.controller_warnings, 1u);
  EXPECT_FALSE(is_bus_off);
}

TEST(CanErrors, InWords) {
  EXPECT_EQ(text_of({}, false), "");
  EXPECT_EQ(text_of({.lost_arbitrations = 9}, false), "");
  EXPECT_EQ(text_of({.bus_offs = 1}, true), "off the bus now; bus-off 1");
  EXPECT_EQ(
      text_of({.transmit_timeouts = 1,
               .controller_overflows = 2,
               .controller_warnings = 3,
               .protocol_violations = 4,
               .transceiver_faults = 5,
               .unacknowledged = 6,
               .bus_errors = 7,
               .bus_offs = 8,
               .restarts = 9,
               .frames_missed = 10},
              false),
      "bus-off 8, restarts 9, bus errors 7, protocol violations 4, not acknowledged 6, transceiver faults 5, "
      "controller warnings 3, controller overflows 2, transmit timeouts 1, frames missed by this program 10");
}

TEST(CanErrors, OffTheBusUntilRestarted) {
  CanErrors errors;
  bool is_bus_off = false;
  count_error(error_frame(CAN_ERR_BUSOFF), errors, is_bus_off);
  EXPECT_TRUE(is_bus_off);
  count_error(error_frame(CAN_ERR_PROT), errors, is_bus_off);
  EXPECT_TRUE(is_bus_off);
  count_error(error_frame(CAN_ERR_RESTARTED), errors, is_bus_off);
  EXPECT_FALSE(is_bus_off);
}

}  // namespace
}  // namespace palpate::link
