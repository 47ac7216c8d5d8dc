#include "boards/stm32g4/parameter_flash.hpp"

#include "boards/stm32g4/clock.hpp"
#include "boards/stm32g4/timebase.hpp"

namespace palpate::stm32g4 {
namespace {

constexpr std::uint32_t kBank_bytes = kFlash_bytes / 2;
constexpr std::uint32_t kPages = kBank_bytes / ParameterFlash::kSlot_bytes;
constexpr std::uint32_t kFirstPage = kPages - 2;
constexpr std::uint32_t kKey1 = 0x45670123, kKey2 = 0xCDEF89AB;
constexpr std::uint32_t kErrors = flash::SR_OPERR | flash::SR_PROGERR | flash::SR_WRPERR | flash::SR_PGAERR |
                                  flash::SR_SIZERR | flash::SR_PGSERR | flash::SR_MISSERR | flash::SR_FASTERR;
// A page takes 24.5 ms at most.
constexpr std::uint32_t kPatience_counts = kSystemClock_Hz / 10;

// Between the two, an unreadable word is the parameters'. One writer each: read() and the NMI, which comes
// while read() waits for its load.
volatile bool is_reading = false;
volatile bool was_unreadable = false;

std::uintptr_t address_of(std::uint32_t slot, std::uint32_t offset) {
  return kFlash_address + kBank_bytes + (kFirstPage + slot) * ParameterFlash::kSlot_bytes + offset;
}

bool wait_until_idle() {
  const std::uint32_t begin = Timebase::clock_count();
  return wait_until([] { return !is_set(FLASH[flash::SR], flash::SR_BSY); },
                    [begin] { return Timebase::clock_count() - begin > kPatience_counts; });
}

// Flash takes what `act` asks for; true if it has done it.
template <class Act>
bool with_flash(Act act) {
  if (!wait_until_idle()) return false;
  if (is_set(FLASH[flash::CR], flash::CR_LOCK)) {
    FLASH[flash::KEYR] = kKey1;
    FLASH[flash::KEYR] = kKey2;
  }
  FLASH[flash::SR] = kErrors | flash::SR_EOP;
  act();
  const bool ended = wait_until_idle();
  const bool good = (FLASH[flash::SR] & kErrors) == 0;
  FLASH[flash::CR] = flash::CR_LOCK.mask();
  // The cache is emptied while it is off.
  clear(FLASH[flash::ACR], flash::ACR_DCEN);
  set(FLASH[flash::ACR], flash::ACR_DCRST);
  clear(FLASH[flash::ACR], flash::ACR_DCRST);
  set(FLASH[flash::ACR], flash::ACR_DCEN);
  return ended && good;
}

}  // namespace

bool ParameterFlash::is_supported() {
  return is_set(FLASH[flash::OPTR], flash::OPTR_DBANK) && !is_set(FLASH[flash::OPTR], flash::OPTR_BFB2);
}

bool ParameterFlash::erase(std::uint32_t slot) {
  return with_flash([slot] {
    const std::uint32_t what = flash::CR_PER | flash::CR_BKER | flash::CR_PNB.of(kFirstPage + slot);
    FLASH[flash::CR] = what;
    FLASH[flash::CR] = what | flash::CR_STRT;
  });
}

bool ParameterFlash::program(std::uint32_t slot, std::uint32_t offset, std::uint64_t value) {
  return with_flash([&] {
    FLASH[flash::CR] = flash::CR_PG.mask();
    auto* const words = reinterpret_cast<volatile std::uint32_t*>(address_of(slot, offset));
    words[0] = static_cast<std::uint32_t>(value);
    words[1] = static_cast<std::uint32_t>(value >> 32);
    asm volatile("dsb" ::: "memory");
  });
}

bool ParameterFlash::read(std::uint32_t slot, std::uint32_t offset, std::uint64_t& value) {
  const auto* const words = reinterpret_cast<const volatile std::uint32_t*>(address_of(slot, offset));
  was_unreadable = false;
  is_reading = true;
  const std::uint32_t low = words[0];
  const std::uint32_t high = words[1];
  asm volatile("dsb\n isb" ::: "memory");
  is_reading = false;
  value = low | (std::uint64_t{high} << 32);
  return !was_unreadable;
}

bool ParameterFlash::note_unreadable() {
  if (!is_set(FLASH[flash::ECCR], flash::ECCR_ECCD) || !is_reading) return false;
  set(FLASH[flash::ECCR], flash::ECCR_ECCD);  // cleared by 1
  was_unreadable = true;
  return true;
}

}  // namespace palpate::stm32g4
