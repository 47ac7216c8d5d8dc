#include "boards/stm32g4/currents.hpp"

#include <limits>

#include "boards/cortex_m/dma_circle.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32g4/dma.hpp"
#include "boards/stm32g4/registers.hpp"
#include "boards/stm32g4/timebase.hpp"

namespace palpate::stm32g4 {
namespace {

constexpr std::uint32_t kMidScale_raw = kRawSteps / 2;
constexpr std::uint32_t kAbove160MHz = 2;  // DAC_MCR.HFSEL
constexpr std::uint32_t kBothChannels = 16;

constexpr std::uint32_t kClockBy4 = 3;              // ADC_CCR.CKMODE
constexpr std::uint32_t kSample_47_5_clocks = 4;    // ADC_SMPR1
constexpr std::uint32_t kTrigger = 13;              // ADC_CFGR.EXTSEL: TIM6_TRGO
constexpr std::uint32_t kRisingEdge = 1;            // ADC_CFGR.EXTEN
constexpr std::uint32_t kOversample16 = 3;          // ADC_CFGR2.OVSR
constexpr std::uint32_t kShiftBy4 = 4;              // ADC_CFGR2.OVSS
constexpr std::uint32_t kUpdate = 2;                // TIM6_CR2.MMS
constexpr std::uint32_t kSequenceRate_Hz = 10'000;  // ten a tick: a reading is at most 0.17 ms old
constexpr std::uint32_t kFirstInput = 6;            // ADC12_IN6 to IN8

[[gnu::section(".bss.dma")]] std::array<std::uint16_t, 3> samples_raw;

std::uint32_t to_code(float raw) {
  // A NaN compares false and ends at mid-scale, which is nearest to nothing; the supervisor lets none come.
  if (!(raw >= 0.0f || raw < 0.0f)) return kMidScale_raw;
  if (raw <= 0.0f) return 0;
  constexpr float kMax_raw = kRawSteps - 1;
  return static_cast<std::uint32_t>((raw < kMax_raw ? raw : kMax_raw) + 0.5f);
}

void write_codes(std::uint32_t first, std::uint32_t second, std::uint32_t third) {
  DAC1[dac::DHR12RD] = first | (second << kBothChannels);
  DAC2[dac::DHR12R1] = third;
}

}  // namespace

void CurrentSetpoints::start() {
  switch_on(RCC[rcc::AHB2ENR], rcc::AHB2ENR_DAC1EN | rcc::AHB2ENR_DAC2EN);
  DAC1[dac::MCR] = dac::MCR_HFSEL.of(kAbove160MHz);
  DAC2[dac::MCR] = dac::MCR_HFSEL.of(kAbove160MHz);
  set_mid_scale();
  DAC1[dac::CR] = dac::CR_EN1 | dac::CR_EN2;
  DAC2[dac::CR] = dac::CR_EN1.mask();
  Timebase::wait_us(10);
}

void CurrentSetpoints::set_mid_scale() {
  write_codes(kMidScale_raw, kMidScale_raw, kMidScale_raw);
}

void CurrentSetpoints::isr_set(const std::array<float, 3>& setpoint_A) const {
  std::array<std::uint32_t, 3> code{};
  for (std::size_t i = 0; i < code.size(); ++i) {
    code[i] =
        to_code(calibration_.setpoint_offset_raw[i] + calibration_.setpoint_gain_raw_A[i] * setpoint_A[i]);
  }
  write_codes(code[0], code[1], code[2]);
}

void CurrentMonitors::start() {
  switch_on(RCC[rcc::AHB2ENR], rcc::AHB2ENR_ADC12EN);
  put(ADC12_Common[adc_common::CCR], adc_common::CCR_CKMODE, kClockBy4);
  clear(ADC1[adc::CR], adc::CR_DEEPPWD);
  set(ADC1[adc::CR], adc::CR_ADVREGEN);
  Timebase::wait_us(20);
  set(ADC1[adc::CR], adc::CR_ADCAL);
  require(wait_until([] { return !is_set(ADC1[adc::CR], adc::CR_ADCAL); }), ADC1[adc::CR]);
  Timebase::wait_us(1);  // four of its clocks at least before it is enabled

  ADC1[adc::SMPR1] = adc::SMPR1_SMP6.of(kSample_47_5_clocks) | adc::SMPR1_SMP7.of(kSample_47_5_clocks) |
                     adc::SMPR1_SMP8.of(kSample_47_5_clocks);
  ADC1[adc::SQR1] = adc::SQR1_L.of(2) | adc::SQR1_SQ1.of(kFirstInput) | adc::SQR1_SQ2.of(kFirstInput + 1) |
                    adc::SQR1_SQ3.of(kFirstInput + 2);
  put(ADC1[adc::CFGR], adc::CFGR_EXTSEL, kTrigger);
  put(ADC1[adc::CFGR], adc::CFGR_EXTEN, kRisingEdge);
  set(ADC1[adc::CFGR], adc::CFGR_DMACFG | adc::CFGR_DMAEN);
  ADC1[adc::CFGR2] = adc::CFGR2_ROVSE | adc::CFGR2_OVSR.of(kOversample16) | adc::CFGR2_OVSS.of(kShiftBy4);
  ADC1[adc::ISR] = adc::ISR_ADRDY.mask();
  set(ADC1[adc::CR], adc::CR_ADEN);
  require(wait_until([] { return is_set(ADC1[adc::ISR], adc::ISR_ADRDY); }), ADC1[adc::ISR]);

  start_dma({.channel = kMonitorChannel,
             .request = DmaRequest::adc1,
             .peripheral = &ADC1[adc::DR],
             .memory = samples_raw.data(),
             .items = samples_raw.size(),
             .item_bytes = 2,
             .circular = true});
  set(ADC1[adc::CR], adc::CR_ADSTART);

  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_TIM6EN);
  TIM6[basic_tim::PSC] = 0;
  TIM6[basic_tim::ARR] = kSystemClock_Hz / kSequenceRate_Hz - 1;
  put(TIM6[basic_tim::CR2], basic_tim::CR2_MMS, kUpdate);
  set(TIM6[basic_tim::CR1], basic_tim::CR1_CEN);
}

void CurrentMonitors::isr_latch() {
  dma_barrier();
  const bool fresh = (ADC1[adc::ISR] & (adc::ISR_EOS | adc::ISR_OVR)) == adc::ISR_EOS.mask();
  ADC1[adc::ISR] = adc::ISR_EOS.mask();
  for (std::size_t i = 0; i < current_A_.size(); ++i) {
    const float raw = static_cast<float>(samples_raw[i]);
    current_A_[i] = fresh ? calibration_.monitor_gain_A_raw[i] * (raw - calibration_.monitor_offset_raw[i])
                          : std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace palpate::stm32g4
