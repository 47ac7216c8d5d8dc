// Current set-points as voltages of three DAC channels, and current monitors as voltages of three ADC inputs.
//
// Set-points, registers: RCC_AHB2ENR.DAC1EN and DAC2EN; DACx_MCR (HFSEL above 160 MHz, buffered, on the pin);
// DHR12RD and DHR12R1 to mid-scale; CR.EN1 and EN2; 10 us for the buffers. Then DAC1_DHR12RD (both channels)
// and DAC2_DHR12R1.
//
// Monitors, registers: RCC_AHB2ENR.ADC12EN; ADC12_CCR.CKMODE (HCLK / 4, 42.5 MHz); ADC1_CR.DEEPPWD = 0,
// ADVREGEN = 1; 20 us; ADCAL, waits for its end; SMPR1, SQR1, CFGR (circular DMA, external trigger 13, which
// is TIM6_TRGO), CFGR2 (16 samples a result); ISR.ADRDY cleared, CR.ADEN, waits for ADRDY; DMA1 channel 3
// with DMAMUX request 5; CR.ADSTART; TIM6_PSC, ARR, CR2.MMS = 2 (update), CR1.CEN: 10,000 sequences of three
// a second, of 68 us each. In the tick ISR.EOS tells that they still come.
#pragma once

#include <array>
#include <cstdint>

namespace palpate::stm32g4 {

inline constexpr std::uint32_t kRawSteps = 4096;  // 12 bits, of DAC and ADC

// A straight line of each channel. Offsets are the codes at 0 A.
struct CurrentCalibration {
  std::array<float, 3> setpoint_offset_raw;
  std::array<float, 3> setpoint_gain_raw_A;  // codes per ampere
  std::array<float, 3> monitor_offset_raw;
  std::array<float, 3> monitor_gain_A_raw;  // amperes per code
};

class CurrentSetpoints {
 public:
  explicit CurrentSetpoints(const CurrentCalibration& calibration) : calibration_(calibration) {}

  // Channels come up at mid-scale. The pins are the board's.
  static void start();
  // Any context; registers only, so also before start() and from a fault.
  static void set_mid_scale();
  // Interrupt context.
  void isr_set(const std::array<float, 3>& setpoint_A) const;
  // 0 A of this board's calibration, which a little off mid-scale is.
  void isr_set_zero() const { isr_set({}); }

 private:
  const CurrentCalibration& calibration_;
};

class CurrentMonitors {
 public:
  explicit CurrentMonitors(const CurrentCalibration& calibration) : calibration_(calibration) {}

  static void start();
  // Interrupt context, once a tick.
  void isr_latch();
  // Not a number where the monitors have been silent since the last tick, or have once lost a reading (then
  // they stay so until the next start): the supervisor switches off.
  [[nodiscard]] const std::array<float, 3>& isr_currents_A() const { return current_A_; }

 private:
  const CurrentCalibration& calibration_;
  std::array<float, 3> current_A_{};
};

}  // namespace palpate::stm32g4
