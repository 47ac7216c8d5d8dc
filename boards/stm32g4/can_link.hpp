// The link on FDCAN2: records of shared/wire/can_record.hpp in the link's rings, frames on the bus.
//
// Registers: RCC_CCIPR.FDCANSEL = PCLK1; RCC_APB1ENR1.FDCANEN; CCCR.INIT = 1, waits for it; CCE, and FDOE and
// BRSE for FD; NBTP, DBTP (with TDC), TDCR; RXGFC (filters, all else rejected); message RAM to zero, then its
// filters; TXBTIE, IE (RF0N, RF1N, TC), ILE; CCCR.INIT = 0, waits for it. A received frame: RXFxS tells level
// and index, RXFxA releases. A frame to send: TXFQS tells room and index, TXBAR asks. Bus-off (PSR.BO) sets
// INIT; clearing it starts the wait for a quiet bus. RM0440, 44.3 and 44.4.
//
// Losses. Each of the two receive FIFOs has 3 elements, fixed, and a servo tick keeps the interrupt out. The
// shortest frame of 8 bytes takes 131 us on classic CAN, and one of 64 bytes 158 us on FD: back to back 3 fit
// into a servo tick of 0.39 and 0.47 ms (67,000 and 80,000 cycles). In a longer one a frame of a model is
// lost; the host sends the part again. Commands have a FIFO of their own. frames_lost() counts.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "boards/cortex_m/register.hpp"
#include "firmware/ports/ports.hpp"
#include "shared/wire/can_frame.hpp"
#include "shared/wire/can_record.hpp"

namespace palpate::stm32g4 {

class CanLink {
 public:
  CanLink(firmware::LinkBuffers& link, wire::CanFormat format) : link_(link), format_(format) {}

  // The pins are the board's.
  void begin();
  void poll_receive();
  void start_transmit();
  // Background, when there is nothing else to do: nothing here, interrupts do it all.
  void idle() {}
  [[nodiscard]] bool has_work() const { return false; }

  // Link interrupt.
  void isr_handle();

  // Frames that came while a FIFO or the ring was full, or a loss of several at once; times the bus was left.
  [[nodiscard]] std::uint32_t frames_lost() const { return frames_lost_; }
  [[nodiscard]] std::uint32_t bus_offs() const { return bus_offs_; }

 private:
  struct Fifo;
  void drain(const Fifo& fifo);
  void fill();
  bool next_to_send(wire::CanFrame& frame);

  firmware::LinkBuffers& link_;
  wire::CanFormat format_;
  wire::CanRecordReader reader_;
  std::uint32_t frames_lost_ = 0;  // link interrupt's own
  std::uint32_t bus_offs_ = 0;     // background's own
};

}  // namespace palpate::stm32g4
