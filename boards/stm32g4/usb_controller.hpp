// Driver of the part's USB device controller for TinyUSB (device/dcd.h), in place of TinyUSB's own: of that,
// faults are known in the version that is used here (docs/porting.md). One port, 4 endpoints each way,
// packets of 64 bytes at most, no isochronous transfers, no double buffers; the device does not wake the
// host.
//
// Registers: RCC_APB1ENR1.USBEN; CNTR = FRES with PDWN = 0, 1 us, CNTR = 0; BTABLE = 0, ISTR = 0; CNTR =
// RESETM, SUSPM, WKUPM, CTRM; BCDR.DPPU. Reset of the bus: EP0R, DADDR.EF. Packet memory at 0x40006000, by
// half words: 8 bytes an endpoint (ADDR_TX, COUNT_TX, ADDR_RX, COUNT_RX), behind them a buffer of 64 bytes
// for each endpoint and direction at a fixed place. RM0440, 45.5 and 45.6. Interrupt: USB_LP.
//
// A bit of an EPnR is changed by writing 1 (STAT, DTOG) or 0 (CTR), or holds what is written (type, address):
// each function writes only what it means to change. Contexts: transfers are started in the background, with
// the interrupt held back, and end in the interrupt.
#pragma once

namespace palpate::stm32g4 {

// Before TinyUSB starts: clocks.
void start_usb_controller();

}  // namespace palpate::stm32g4
