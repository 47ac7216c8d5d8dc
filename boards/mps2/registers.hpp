// Registers of Arm's MPS2 board with application note AN386 (Cortex-M4F) or AN500 (Cortex-M7), as far as they
// are used here: the same in both. Sources: Arm DAI 0386 and DAI 0500, memory maps; Cortex-M System Design
// Kit (DDI 0479) for timer and UART; ARMv7-M (DDI 0403).
#pragma once

#include <cstdint>

namespace palpate::board {

inline constexpr std::uint32_t kSystemClock_Hz = 25'000'000;

// CMSDK APB timer: counts down to 0 and starts again from `reload`.
struct TimerRegisters {
  volatile std::uint32_t control;  // bit 0 enable, bit 3 interrupt enable
  volatile std::uint32_t value;
  volatile std::uint32_t reload;
  volatile std::uint32_t interrupt_status;  // write 1 to clear
};
inline constexpr std::uint32_t kTimerEnable = 1u << 0;
inline constexpr std::uint32_t kTimerInterruptEnable = 1u << 3;

// CMSDK APB UART.
struct UartRegisters {
  volatile std::uint32_t data;
  volatile std::uint32_t state;             // bit 0 transmit buffer full, bit 1 receive buffer full
  volatile std::uint32_t control;           // bit 0 TX enable, bit 1 RX enable, bit 3 RX interrupt enable
  volatile std::uint32_t interrupt_status;  // bit 1 RX interrupt; write 1 to clear
  volatile std::uint32_t baud_divider;
};
inline constexpr std::uint32_t kUartTransmitFull = 1u << 0;
inline constexpr std::uint32_t kUartReceiveFull = 1u << 1;
inline constexpr std::uint32_t kUartTransmitEnable = 1u << 0;
inline constexpr std::uint32_t kUartReceiveEnable = 1u << 1;
inline constexpr std::uint32_t kUartReceiveInterruptEnable = 1u << 3;
inline constexpr std::uint32_t kUartReceiveInterrupt = 1u << 1;

// System control block of the processor, as far as a fault report needs it.
struct FaultRegisters {
  volatile std::uint32_t configurable_status;  // CFSR, 0xE000ED28
  volatile std::uint32_t hard_status;          // HFSR
  volatile std::uint32_t debug_status;         // DFSR
  volatile std::uint32_t memory_address;       // MMFAR
  volatile std::uint32_t bus_address;          // BFAR
};

// Functions, not objects of namespace scope: those would be initialized too late for start-up code and
// faults.
template <class Registers>
Registers& at(std::uintptr_t address) {
  return *reinterpret_cast<Registers*>(address);
}
inline TimerRegisters& timer0() {
  return at<TimerRegisters>(0x40000000u);
}  // interrupt 8
inline TimerRegisters& timer1() {
  return at<TimerRegisters>(0x40001000u);
}
inline UartRegisters& uart0() {
  return at<UartRegisters>(0x40004000u);
}
inline UartRegisters& uart1() {
  return at<UartRegisters>(0x40005000u);
}  // receive interrupt 2
inline FaultRegisters& faults() {
  return at<FaultRegisters>(0xE000ED28u);
}
inline volatile std::uint32_t& reset_control() {
  return at<volatile std::uint32_t>(0xE000ED0Cu);
}  // AIRCR
inline constexpr std::uint32_t kResetRequest = 0x05FA0004u;

inline constexpr unsigned kTimer0Interrupt = 8;
inline constexpr unsigned kUart1ReceiveInterrupt = 2;

// Enables an interrupt at a priority; smaller numbers come first.
inline void enable_interrupt(unsigned number, std::uint8_t priority) {
  at<volatile std::uint8_t>(0xE000E400u + number) = priority;
  at<volatile std::uint32_t>(0xE000E100u + 4 * (number / 32)) = 1u << (number % 32);
}

}  // namespace palpate::board
