// Registers of the processor, as far as they are used: ARMv7-M (DDI 0403). They are in no SVD file of ST's.
#pragma once

#include "boards/cortex_m/register.hpp"

namespace palpate::cortex_m {

inline constexpr Base SCB{0xE000ED00};
namespace scb {
inline constexpr Offset VTOR{0x08};
inline constexpr Offset AIRCR{0x0C};
inline constexpr Offset CFSR{0x28};
inline constexpr Offset HFSR{0x2C};
inline constexpr Offset BFAR{0x38};
inline constexpr std::uint32_t kSystemReset = 0x05FA0004;  // AIRCR: key and SYSRESETREQ
}  // namespace scb

inline constexpr Base NVIC{0xE000E100};
namespace nvic {
inline constexpr Offset ISER{0x000};
inline constexpr Offset ICER{0x080};
inline constexpr Offset IPR{0x300};
}  // namespace nvic

// Of the 8 bits of a priority this part has the upper 4; smaller numbers come first.
inline constexpr std::uint8_t kServoPriority = 0x00;
inline constexpr std::uint8_t kLinkPriority = 0x40;

inline void enable_interrupt(std::uint32_t number) {
  NVIC[{nvic::ISER.bytes + 4 * (number / 32)}] = 1u << (number % 32);
}
inline void set_priority(std::uint32_t number, std::uint8_t priority) {
  *reinterpret_cast<volatile std::uint8_t*>(NVIC.address + nvic::IPR.bytes + number) = priority;
}
inline void enable_interrupt(std::uint32_t number, std::uint8_t priority) {
  set_priority(number, priority);
  enable_interrupt(number);
}
// It does not come any more when this returns.
inline void disable_interrupt(std::uint32_t number) {
  NVIC[{nvic::ICER.bytes + 4 * (number / 32)}] = 1u << (number % 32);
  asm volatile("dsb\n isb" ::: "memory");
}

// Keeps an interrupt out while it lives, if it was on. Background only.
class Masked {
 public:
  explicit Masked(std::uint32_t number)
      : number_(number), was_on_((NVIC[{nvic::ISER.bytes + 4 * (number / 32)}] >> (number % 32) & 1u) != 0) {
    disable_interrupt(number_);
  }
  ~Masked() {
    asm volatile("" ::: "memory");
    if (was_on_) enable_interrupt(number_);
  }
  Masked(const Masked&) = delete;
  Masked& operator=(const Masked&) = delete;

 private:
  std::uint32_t number_;
  bool was_on_;
};

[[noreturn]] inline void reset_processor() {
  asm volatile("dsb" ::: "memory");
  SCB[scb::AIRCR] = scb::kSystemReset;
  for (;;) asm volatile("");
}

}  // namespace palpate::cortex_m
