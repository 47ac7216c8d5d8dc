#include "firmware/link/registers.hpp"

#include <algorithm>
#include <bit>

#include "firmware/ports/ports.hpp"

namespace palpate::firmware {
namespace {

using wire::RegisterType;
using wire::RegisterValue;

// What the standard puts behind a register's name: itself, its largest, smallest and default value.
constexpr std::string_view kSuffixes[] = {"", "<", ">", "="};
constexpr std::size_t kKinds = 4;
constexpr std::size_t kFieldRegisters = kTuningFields.size() * kKinds;
constexpr std::array<std::string_view, 3> kReadOnly{"encoder.count", "arm.sample", "reset.record"};
constexpr std::uint8_t kEncoderCount = kFieldRegisters, kArmSample = kFieldRegisters + 1;
constexpr std::uint8_t kResetRecord = kFieldRegisters + 2;  // the last: not every board has it
constexpr std::uint8_t kRegisters = kFieldRegisters + kReadOnly.size();
constexpr Tuning kDefaults{};

static_assert(is_allowed(kDefaults));
static_assert(std::all_of(kTuningFields.begin(), kTuningFields.end(), [](const TuningField& field) {
  return field.name.size() < wire::kMaxRegisterName;
}));

std::uint8_t index_of(std::string_view name) {
  for (std::size_t i = 0; i < kFieldRegisters; ++i) {
    const std::string_view stem = kTuningFields[i / kKinds].name;
    if (name.starts_with(stem) && name.substr(stem.size()) == kSuffixes[i % kKinds])
      return static_cast<std::uint8_t>(i);
  }
  const auto* const found = std::find(kReadOnly.begin(), kReadOnly.end(), name);
  return static_cast<std::uint8_t>(kFieldRegisters + static_cast<std::size_t>(found - kReadOnly.begin()));
}

bool is_writable(std::uint8_t index) {
  return index < kFieldRegisters && index % kKinds == 0;
}

void append(RegisterValue& value, const JointValues& values) {
  value.type = RegisterType::real32;
  for (const float one : values) value.bits[value.count++] = std::bit_cast<std::uint32_t>(one);
}

}  // namespace

void Registers::begin(const Tuning& tuning, bool persistent, const ResetReport& reset,
                      const KeptTick& before) {
  tuning_ = tuning;
  persistent_ = persistent;
  knows_reset_ = reset.is_known;
  reset_record_ = {reset.causes, reset.reason, reset.detail,        reset.program_counter, reset.cfsr,
                   reset.hfsr,   reset.bfar,   reset.failed_starts, before.tick,           before.faults};
}

bool Registers::take(const wire::RegisterAccessRequest& request, const Requester& requester) {
  if (access_count_ == accesses_.size()) return false;
  Access& access = accesses_[access_count_++];
  access = {.requester = requester,
            .index = index_of(request.name),
            .writes = request.value.type != RegisterType::empty,
            .fits = request.value.type == RegisterType::real32 && request.value.count == 3};
  for (std::size_t i = 0; i < 3; ++i) access.values[i] = std::bit_cast<float>(request.value.bits[i]);
  return true;
}

bool Registers::next(Answer& answer, std::uint32_t tick) {
  static_assert(1000 * kServoRate_Hz == 1'000'000);
  if (access_count_ == 0) return false;
  const Access& access = accesses_.front();
  answer = {.requester = access.requester};
  answer.response.read_us = std::uint64_t{1000} * tick;
  if (access.index == kEncoderCount || access.index == kArmSample) {
    if (!sample_comes(answer, access.index)) return false;
  } else if (access.index < kFieldRegisters) {
    if (access.writes && is_writable(access.index) && !write_ends(access)) return false;
    answer.response.is_mutable = is_writable(access.index);
    // Limits and defaults are the firmware's own.
    answer.response.is_persistent = persistent_ || !is_writable(access.index);
    answer.response.value = value_of(access.index);
  } else if (access.index == kResetRecord && knows_reset_) {
    RegisterValue& value = answer.response.value;
    value.type = RegisterType::integer32;
    for (const std::uint32_t word : reset_record_) value.bits[value.count++] = word;
  }
  std::copy(accesses_.begin() + 1, accesses_.end(), accesses_.begin());
  --access_count_;
  return true;
}

bool Registers::sample_comes(Answer& answer, std::uint8_t index) {
  ArmSample sample;
  if (!mailbox_.samples_wanted.load(std::memory_order_relaxed)) {
    mailbox_.samples_wanted.store(true, std::memory_order_relaxed);
    (void)mailbox_.samples.pop(sample);  // of long ago
    return false;
  }
  if (!mailbox_.samples.pop(sample)) return false;
  mailbox_.samples_wanted.store(false, std::memory_order_relaxed);
  answer.response.read_us = std::uint64_t{1000} * sample.tick;
  RegisterValue& value = answer.response.value;
  if (index == kEncoderCount) {
    value.type = RegisterType::integer32;
    for (const std::int32_t one : sample.encoder_count)
      value.bits[value.count++] = static_cast<std::uint32_t>(one);
    return true;
  }
  for (const JointValues& values :
       {sample.joint_rad, sample.joint_rad_s, sample.setpoint_A, sample.measured_current_A})
    append(value, values);
  return true;
}

bool Registers::write_ends(const Access& access) {
  const TuningField& field = kTuningFields[access.index / kKinds];
  switch (mailbox_.tuning_step.load(std::memory_order_acquire)) {
    case TuningStep::idle:
      // What is there already needs no store.
      if (!access.fits || !is_allowed(field, access.values) || tuning_.*field.values == access.values)
        return true;
      mailbox_.tuning = tuning_;
      mailbox_.tuning.*field.values = access.values;
      mailbox_.tuning_step.store(TuningStep::asked, std::memory_order_release);
      return false;
    case TuningStep::done:
      tuning_ = mailbox_.tuning;
      mailbox_.tuning_step.store(TuningStep::idle, std::memory_order_release);
      return true;
    case TuningStep::refused:
      mailbox_.tuning_step.store(TuningStep::idle, std::memory_order_release);
      return true;
    case TuningStep::asked:
    case TuningStep::agreed:
    case TuningStep::commit:
      break;
  }
  return false;
}

const Tuning* Registers::to_store() const {
  return mailbox_.tuning_step.load(std::memory_order_acquire) == TuningStep::agreed ? &mailbox_.tuning
                                                                                    : nullptr;
}

void Registers::stored(bool good) {
  mailbox_.tuning_step.store(good ? TuningStep::commit : TuningStep::refused, std::memory_order_release);
}

RegisterValue Registers::value_of(std::uint8_t index) const {
  const TuningField& field = kTuningFields[index / kKinds];
  RegisterValue value;
  switch (index % kKinds) {
    case 0:
      append(value, tuning_.*field.values);
      break;
    case 1:
      append(value, field.most);
      break;
    case 2:
      append(value, field.least);
      break;
    default:
      append(value, kDefaults.*field.values);
  }
  return value;
}

std::string_view Registers::name(std::uint16_t index) {
  if (index >= kRegisters || (index == kResetRecord && !knows_reset_)) return {};
  if (index >= kFieldRegisters) return kReadOnly[index - kFieldRegisters];
  const std::string_view stem = kTuningFields[index / kKinds].name;
  const std::string_view suffix = kSuffixes[index % kKinds];
  char* const end = std::copy(stem.begin(), stem.end(), name_.data());
  std::copy(suffix.begin(), suffix.end(), end);
  return {name_.data(), stem.size() + suffix.size()};
}

}  // namespace palpate::firmware
