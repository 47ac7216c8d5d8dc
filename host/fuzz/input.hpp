// The bytes of a fuzzer as the numbers that a target wants.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>

namespace palpate::fuzz {

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  // The next number; bytes that are missing at the end are 0.
  template <class T>
  T take() {
    T value{};
    const std::span<const std::uint8_t> bytes = this->bytes(sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  // The next bytes, at most so many.
  std::span<const std::uint8_t> bytes(std::size_t most) {
    const std::span<const std::uint8_t> taken = rest_.first(std::min(most, rest_.size()));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

// What must hold for every input; the fuzzer keeps one for which it does not.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

}  // namespace palpate::fuzz
