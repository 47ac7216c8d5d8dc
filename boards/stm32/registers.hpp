// Peripherals that families of the STM32 have alike: the STM32G4 (RM0440) and the STM32F4 (RM0090). What lies
// elsewhere in each of them, the ports of pins, has its addresses in the family's registers.hpp, which also
// says what else there is. host/python/tests/test_registers.py reads this file with the STM32G4's.
#pragma once

#include "boards/cortex_m/register.hpp"

namespace palpate::stm32 {

using namespace cortex_m;  // how registers are touched

namespace gpio {
inline constexpr Offset MODER{0x00};
inline constexpr Offset OTYPER{0x04};
inline constexpr Offset OSPEEDR{0x08};
inline constexpr Offset PUPDR{0x0C};
inline constexpr Offset IDR{0x10};
inline constexpr Offset BSRR{0x18};
inline constexpr Offset AFRL{0x20};
inline constexpr Offset AFRH{0x24};
}  // namespace gpio

inline constexpr Base TIM2{0x40000000};
inline constexpr Base TIM3{0x40000400};
inline constexpr Base TIM4{0x40000800};
inline constexpr Base TIM5{0x40000C00};
namespace tim {
inline constexpr Offset CR1{0x00};
inline constexpr Bits CR1_CEN{0};
inline constexpr Offset SMCR{0x08};
inline constexpr Bits SMCR_SMS{0, 3};
inline constexpr Offset SR{0x10};
inline constexpr Bits SR_CC3IF{3};
inline constexpr Bits SR_CC4IF{4};
inline constexpr Offset EGR{0x14};
inline constexpr Bits EGR_UG{0};
inline constexpr Offset CCMR1{0x18};
inline constexpr Bits CCMR1_CC1S{0, 2};
inline constexpr Bits CCMR1_IC1F{4, 4};
inline constexpr Bits CCMR1_CC2S{8, 2};
inline constexpr Bits CCMR1_IC2F{12, 4};
inline constexpr Offset CCMR2{0x1C};
inline constexpr Bits CCMR2_CC3S{0, 2};
inline constexpr Bits CCMR2_IC3F{4, 4};
inline constexpr Bits CCMR2_CC4S{8, 2};
inline constexpr Bits CCMR2_IC4F{12, 4};
inline constexpr Offset CCER{0x20};
inline constexpr Bits CCER_CC3E{8};
inline constexpr Bits CCER_CC4E{12};
inline constexpr Offset CNT{0x24};
inline constexpr Offset PSC{0x28};
inline constexpr Offset ARR{0x2C};
inline constexpr Offset CCR3{0x3C};
inline constexpr Offset CCR4{0x40};
}  // namespace tim

inline constexpr Base TIM6{0x40001000};
inline constexpr Base TIM7{0x40001400};
namespace basic_tim {
inline constexpr Offset CR1{0x00};
inline constexpr Bits CR1_CEN{0};
inline constexpr Bits CR1_URS{2};
inline constexpr Offset CR2{0x04};
inline constexpr Bits CR2_MMS{4, 3};
inline constexpr Offset DIER{0x0C};
inline constexpr Bits DIER_UIE{0};
inline constexpr Offset SR{0x10};
inline constexpr Bits SR_UIF{0};
inline constexpr Offset EGR{0x14};
inline constexpr Bits EGR_UG{0};
inline constexpr Offset PSC{0x28};
inline constexpr Offset ARR{0x2C};
}  // namespace basic_tim

inline constexpr Base IWDG{0x40003000};
namespace iwdg {
inline constexpr Offset KR{0x00};
inline constexpr Offset PR{0x04};
inline constexpr Offset RLR{0x08};
inline constexpr Offset SR{0x0C};
inline constexpr Bits SR_PVU{0};
inline constexpr Bits SR_RVU{1};
}  // namespace iwdg

}  // namespace palpate::stm32
