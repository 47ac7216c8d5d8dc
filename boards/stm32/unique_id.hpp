#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::stm32 {

// The 96 bits of a chip, which its family has at `address`, filled up with the part's name.
inline std::array<std::uint8_t, 16> unique_id(std::uintptr_t address, const char (&part)[5]) {
  constexpr std::size_t kChip_bytes = 12;
  std::array<std::uint8_t, 16> id{};
  const auto* const chip =
      reinterpret_cast<const volatile std::uint32_t*>(address);  // NOLINT: a fixed address
  for (std::size_t i = 0; i < kChip_bytes; ++i)
    id[i] = static_cast<std::uint8_t>(chip[i / 4] >> (8 * (i % 4)));
  for (std::size_t i = kChip_bytes; i < id.size(); ++i)
    id[i] = static_cast<std::uint8_t>(part[i - kChip_bytes]);
  return id;
}

}  // namespace palpate::stm32
