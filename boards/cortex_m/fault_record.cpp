#include "boards/cortex_m/fault_record.hpp"

#include <initializer_list>

#include "boards/cortex_m/core_registers.hpp"

extern "C" {
[[gnu::section(".noinit"), gnu::used]] palpate::cortex_m::FaultRecord palpate_fault_record;
[[gnu::section(".noinit"), gnu::used]] std::array<std::uint32_t, palpate::firmware::kKeptWords>
    palpate_kept_tick;
[[gnu::used]] palpate::cortex_m::BootReport palpate_boot_report;
}

namespace palpate::cortex_m {
namespace {

// Not zero and not all ones for a record of zeros or ones, as memory may come up.
std::uint32_t check_of(const FaultRecord& record) {
  std::uint32_t sum = 0x50414C50;
  for (const std::uint32_t word :
       {static_cast<std::uint32_t>(record.reason), record.detail, record.program_counter, record.cfsr,
        record.hfsr, record.bfar, record.failed_starts}) {
    sum = ((sum << 5) | (sum >> 27)) ^ word;
  }
  return sum;
}

void write(FaultRecord record) {
  record.check = check_of(record);
  palpate_fault_record = record;
}

}  // namespace

firmware::ResetReport reset_report() {
  const FaultRecord& fault = palpate_boot_report.fault;
  return {.is_known = true,
          .causes = palpate_boot_report.reset_flags,
          .reason = static_cast<std::uint32_t>(fault.reason),
          .detail = fault.detail,
          .program_counter = fault.program_counter,
          .cfsr = fault.cfsr,
          .hfsr = fault.hfsr,
          .bfar = fault.bfar,
          .failed_starts = fault.failed_starts};
}

std::span<std::uint32_t> kept_words() {
  return palpate_kept_tick;
}

void note_reset(std::uint32_t reset_flags) {
  const FaultRecord record = palpate_fault_record;
  palpate_boot_report.reset_flags = reset_flags;
  if (record.check == check_of(record)) palpate_boot_report.fault = record;
  write({.failed_starts = palpate_boot_report.fault.failed_starts});
}

void note_started() {
  write({});
}

void record_fault(FaultReason reason, std::uint32_t detail, const ProcessorState& processor) {
  write({.reason = reason,
         .detail = detail,
         .program_counter = processor.program_counter,
         .cfsr = processor.cfsr,
         .hfsr = processor.hfsr,
         .bfar = processor.bfar});
}

void fail_to_start(const Register& waited_for) {
  const std::uint32_t failed_starts = palpate_boot_report.fault.failed_starts + 1;
  const auto address = reinterpret_cast<std::uintptr_t>(&waited_for);
  write({.reason = FaultReason::not_ready,
         .detail = static_cast<std::uint32_t>(address),
         .failed_starts = failed_starts});
  if (failed_starts < kMostFailedStarts) reset_processor();
  for (;;) asm volatile("wfi");
}

}  // namespace palpate::cortex_m
