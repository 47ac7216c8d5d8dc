#include "boards/stm32g4/encoders.hpp"

namespace palpate::stm32g4 {
namespace {

// 8 samples at 170 MHz / 4, 0.19 us: shorter pulses are noise. The fastest joint makes some 50,000 counts a
// second.
constexpr std::uint32_t kFilter = 7;
constexpr std::uint32_t kDirect = 1;       // CCxS: the channel's own input
constexpr std::uint32_t kBothInputs = 3;   // SMS: counts every edge of both
constexpr std::uint32_t kNarrow = 0xFFFF;  // ARR of 16 bits

void start_one(Base timer, std::uint32_t top, std::uint32_t index_capture, Bits index_enable) {
  timer[tim::ARR] = top;
  timer[tim::CCMR1] = tim::CCMR1_CC1S.of(kDirect) | tim::CCMR1_IC1F.of(kFilter) |
                      tim::CCMR1_CC2S.of(kDirect) | tim::CCMR1_IC2F.of(kFilter);
  timer[tim::CCMR2] = index_capture;
  timer[tim::CCER] = index_enable.mask();
  timer[tim::SMCR] = tim::SMCR_SMS.of(kBothInputs);
  timer[tim::CNT] = 0;
  set(timer[tim::CR1], tim::CR1_CEN);
}

constexpr std::uint32_t kIndexOn3 = tim::CCMR2_CC3S.of(kDirect) | tim::CCMR2_IC3F.of(kFilter);
constexpr std::uint32_t kIndexOn4 = tim::CCMR2_CC4S.of(kDirect) | tim::CCMR2_IC4F.of(kFilter);

// The difference of two counts that wrap after `Width`.
template <class Width>
std::int32_t moved(std::uint32_t from, std::uint32_t to) {
  return static_cast<Width>(to - from);
}

template <class Width>
void latch_one(Base timer, Bits index_flag, Offset index_capture, std::int32_t& count, EncoderIndex& index) {
  // The flag first: what passes from here on belongs to the next tick.
  const bool passed = is_set(timer[tim::SR], index_flag);
  const std::uint32_t now = timer[tim::CNT];
  // Unsigned: a count may wrap.
  const auto before = static_cast<std::uint32_t>(count);
  count = static_cast<std::int32_t>(before + static_cast<std::uint32_t>(moved<Width>(before, now)));
  if (!passed) return;
  const std::uint32_t at = timer[index_capture];
  index.count = static_cast<std::int32_t>(static_cast<std::uint32_t>(count) +
                                          static_cast<std::uint32_t>(moved<Width>(now, at)));
  ++index.passes;
}

}  // namespace

void Encoders::start() {
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_TIM2EN | rcc::APB1ENR1_TIM3EN | rcc::APB1ENR1_TIM4EN);
  start_one(TIM2, 0xFFFFFFFF, kIndexOn3, tim::CCER_CC3E);
  start_one(TIM3, kNarrow, kIndexOn3, tim::CCER_CC3E);
  start_one(TIM4, kNarrow, kIndexOn4, tim::CCER_CC4E);
}

void Encoders::isr_latch(std::array<EncoderIndex, 3>& index) {
  latch_one<std::int32_t>(TIM2, tim::SR_CC3IF, tim::CCR3, counts_[0], index[0]);
  latch_one<std::int16_t>(TIM3, tim::SR_CC3IF, tim::CCR3, counts_[1], index[1]);
  latch_one<std::int16_t>(TIM4, tim::SR_CC4IF, tim::CCR4, counts_[2], index[2]);
}

}  // namespace palpate::stm32g4
