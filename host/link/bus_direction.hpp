// One direction of a bus that both directions share, as a medium.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host/link/medium.hpp"

namespace palpate::link {

// The bus does the work, by the direction's index; it is a friend of this.
template <class Bus>
class BusDirection final : public Medium {
 public:
  BusDirection(Bus& bus, std::size_t index) : bus_(bus), index_(index) {}
  bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) override {
    return bus_.submit(index_, bytes, tick);
  }
  std::vector<std::uint8_t> deliver(std::uint32_t tick) override { return bus_.deliver(index_, tick); }
  [[nodiscard]] std::size_t backlog_bytes(std::uint32_t tick) const override {
    return bus_.backlog_bytes(index_, tick);
  }
  // When the other direction is silent.
  [[nodiscard]] double bytes_per_tick() const override { return bus_.bytes_per_tick(); }
  [[nodiscard]] MediumCounters counters() const override { return bus_.counters(index_); }
  bool fail_attempts(std::uint64_t count) override {
    if constexpr (requires { bus_.fail_attempts(index_, count); }) {
      bus_.fail_attempts(index_, count);
      return true;
    } else {
      return Medium::fail_attempts(count);
    }
  }

 private:
  Bus& bus_;
  std::size_t index_;
};

}  // namespace palpate::link
