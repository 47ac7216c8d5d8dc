// For tests of links.
#pragma once

#include <chrono>
#include <cstdint>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

#include "host/link/transport.hpp"

namespace palpate::link::testing {

using Bytes = std::vector<std::uint8_t>;

// Far beyond what any machine needs: only a broken link takes that long.
inline constexpr std::chrono::seconds kPatience{20};

// first, first + 1, ... modulo 256.
inline Bytes counting(std::size_t count, std::uint8_t first = 0) {
  Bytes bytes(count);
  std::iota(bytes.begin(), bytes.end(), first);
  return bytes;
}

// Reads until so many bytes have come, or none more comes.
inline Bytes read_all(Transport& link, std::size_t count) {
  Bytes all;
  while (all.size() < count) {
    const Bytes some = link.read(kPatience);
    if (some.empty()) break;
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

// Why an address cannot be opened; empty: it can.
inline std::string message_of(std::string_view address) {
  try {
    open_transport(address);
  } catch (const TransportError& error) {
    return error.what();
  }
  return "";
}

}  // namespace palpate::link::testing
