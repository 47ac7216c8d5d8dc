// Which basis is which: a hash of all that a basis depends on.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "host/linearize/whole_body_basis.hpp"
#include "host/msd/body.hpp"

namespace palpate::host {

// 128 bits: two different bases share a key with a probability of 3e-39. It guards against mistakes, not
// against someone who looks for a collision.
struct BasisKey {
  std::uint64_t high = 0, low = 0;

  friend auto operator<=>(const BasisKey&, const BasisKey&) = default;
  [[nodiscard]] std::string hex() const;  // 32 digits
};

// Keys of the bases of one body.
class BasisKeys {
 public:
  // Hashes masses, rest positions, fixed nodes, springs and plane of the body, the frequencies, and the
  // reduction itself: its version, and the bits that it gives for a small body here, which tell processors
  // and libraries with other rounding apart. Gravity has no part in a basis.
  BasisKeys(const Body& body, const Shifts& shifts);

  // For ports in their order.
  [[nodiscard]] BasisKey of(const std::vector<int>& ports) const;

 private:
  BasisKey body_;
};

// FNV-1a with 128 bits (Fowler, Noll, Vo; offset basis and prime as published by its authors).
class Hash128 {
 public:
  void add(std::span<const std::byte> bytes);
  template <class T>
  requires std::is_arithmetic_v<T>  // a struct may have padding
  void add(const T& value) { add(std::as_bytes(std::span<const T, 1>(&value, 1))); }
  [[nodiscard]] BasisKey value() const { return {high_, low_}; }

 private:
  std::uint64_t high_ = 0x6c62272e07bb0142U, low_ = 0x62b821756295c58dU;
};

}  // namespace palpate::host
