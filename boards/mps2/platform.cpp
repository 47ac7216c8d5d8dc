#include "boards/mps2/platform.hpp"

#include <array>
#include <string_view>

#include "boards/lockstep/start_times.hpp"
#include "boards/mps2/console.hpp"

namespace palpate::board {
namespace {

constexpr std::uint32_t kCountPerTick = kSystemClock_Hz / firmware::kServoRate_Hz;
constexpr std::uint8_t kServoPriority = 0x00;
constexpr std::uint8_t kLinkPriority = 0x40;

// QEMU runs a block of code between two looks at its timers. In a slide of nops the servo interrupt comes in
// at the same instruction in every run, and about three times faster than from an empty loop; WFI under
// "-icount sleep=off" wakes up two timer periods late.
[[gnu::naked, gnu::noinline]] void nop_slide() {
  asm volatile(".rept 400\n nop\n .endr\n bx lr");
}

}  // namespace

void Mps2Platform::begin(firmware::Limits& limits) {
  std::array<char, kMaxStartTimes + 1> buffer{};
  const std::string_view said = semihosting::command_line(buffer);
  has_plant_ = said != "uart";
  if (is_start_times(said) && !take_start_times(said, limits)) {
    print("times of the supervisor out of range: ");
    print(said);
    print("\n");
    exit(lockstep::ExitCode::usage);
  }
  if (has_plant_) {
    actuators_ = semihosting::open("act.fifo", semihosting::OpenMode::write_binary);
    sensors_ = semihosting::open("sen.fifo", semihosting::OpenMode::read_binary);
    if (actuators_ == semihosting::kNoHandle || sensors_ == semihosting::kNoHandle) {
      exit(lockstep::ExitCode::no_channel);
    }
  } else {
    uart1().baud_divider = 16;
    uart1().control = kUartTransmitEnable | kUartReceiveEnable | kUartReceiveInterruptEnable;
  }
}

void Mps2Platform::start_ticks() {
  timer1().reload = UINT32_MAX;
  timer1().value = UINT32_MAX;
  timer1().control = kTimerEnable;
  timer0().reload = kCountPerTick - 1;
  timer0().value = kCountPerTick - 1;
  first_due_count_ = clock_count() + kCountPerTick;
  timer0().control = kTimerEnable | kTimerInterruptEnable;
  if (!has_plant_) enable_interrupt(kUart1ReceiveInterrupt, kLinkPriority);
  enable_interrupt(kTimer0Interrupt, kServoPriority);
}

void Mps2Platform::burn() {
  const std::uint32_t start = clock_count();
  while (clock_count() - start < kCountPerTick * 5 / 2) {
  }
}

void Mps2Platform::crash() {
  constexpr std::uintptr_t kNothingThere = 0xB0000000u;
  [[maybe_unused]] const std::uint32_t word = at<volatile std::uint32_t>(kNothingThere);
}

void Mps2Platform::reset() {
  reset_control() = kResetRequest;
  for (;;) {
  }
}

void Mps2Platform::transmit(firmware::LinkBuffers& link) {
  std::uint8_t byte = 0;
  while ((uart1().state & kUartTransmitFull) == 0 && link.transmit.pop(byte)) uart1().data = byte;
}

void Mps2Platform::isr_receive(firmware::LinkBuffers& link) {
  uart1().interrupt_status = kUartReceiveInterrupt;
  while ((uart1().state & kUartReceiveFull) != 0) {
    (void)link.received.push(static_cast<std::uint8_t>(uart1().data));  // full: lost, the framing notices
  }
}

void Mps2Platform::idle() {
  if (has_plant_) {
    nop_slide();
  } else {
    asm volatile("wfi");
  }
}

}  // namespace palpate::board
