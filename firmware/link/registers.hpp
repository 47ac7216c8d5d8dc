// The registers of the board's node: what may be asked for, and when a write comes into use.
//
// Each field of Tuning is a register of three float32, by joint, with its smallest, largest and default value
// beside it as the standard names them ("encoder.sign>", "<", "="). A write is checked, and refused while the
// board is armed; then it is stored, and used from the next tick on. A refused write leaves what was there,
// which the response says. Others are read only: the encoders' counts, arm.sample and, on a board that knows
// it, reset.record: what was before the last reset.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "firmware/core/kept_tick.hpp"
#include "firmware/core/mailbox.hpp"
#include "firmware/core/tuning.hpp"
#include "firmware/ports/ports.hpp"
#include "shared/wire/registers.hpp"

namespace palpate::firmware {

// Requests that may wait for their turn.
inline constexpr std::size_t kPendingAccesses = 4;

// Background context throughout; one owner.
class Registers {
 public:
  explicit Registers(Mailbox& mailbox) : mailbox_(mailbox) {}

  // Before the first tick: what the board has kept, and whether it keeps what is written; why it has started,
  // and the last tick before that, zeros where nobody knows.
  void begin(const Tuning& tuning, bool persistent, const ResetReport& reset, const KeptTick& before);

  // Its answer comes from next(). False: too many wait.
  bool take(const wire::RegisterAccessRequest& request, const Requester& requester);

  struct Answer {
    Requester requester{};
    wire::RegisterAccessResponse response{};
  };
  // False: none is ready. `tick`: the next one.
  bool next(Answer& answer, std::uint32_t tick);

  // The board is to store this now, with outputs off, and to say whether it has.
  [[nodiscard]] const Tuning* to_store() const;
  void stored(bool good);

  // The name of a register by its number in the list; empty: there are no more. Valid until the next call.
  std::string_view name(std::uint16_t index);

 private:
  struct Access {
    Requester requester{};
    std::uint8_t index = 0;  // kRegisters: there is none of that name
    bool writes = false;
    bool fits = false;  // of the register's type and length
    JointValues values{};
  };
  bool sample_comes(Answer& answer, std::uint8_t index);
  // True: it is decided.
  bool write_ends(const Access& access);
  [[nodiscard]] wire::RegisterValue value_of(std::uint8_t index) const;

  Mailbox& mailbox_;
  Tuning tuning_{};  // in use
  bool persistent_ = false;
  bool knows_reset_ = false;
  // Of reset.record, in its order (docs/protocol.md).
  std::array<std::uint32_t, 10> reset_record_{};
  std::array<Access, kPendingAccesses> accesses_{};
  std::size_t access_count_ = 0;
  std::array<char, wire::kMaxRegisterName> name_{};
};

}  // namespace palpate::firmware
