// Bytes on the link as a fuzzer wants them: noise, good transfers with any content, and transfers with a
// damaged byte. A fuzzer would not find the CRCs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "host/fuzz/input.hpp"
#include "host/link/framing.hpp"

namespace palpate::fuzz {

// Nothing, where the framing cannot carry such a header.
inline std::vector<std::uint8_t> transfer_of(const link::Framing& framing, const wire::FrameHeader& header,
                                             std::span<const std::uint8_t> payload) {
  try {
    return framing.encode(header, payload);
  } catch (const std::invalid_argument&) {
    return {};
  }
}

// The next piece of a line from `source` to `destination`. Its transfers have one of the
// `specifiers`, mostly, and identifiers that count up, mostly.
inline std::vector<std::uint8_t> next_piece(Input& input, const link::Framing& framing, std::uint16_t source,
                                            std::uint16_t destination,
                                            std::span<const std::uint16_t> specifiers,
                                            std::uint64_t& transfer_id) {
  enum Kind : std::uint8_t { noise, good, odd_header, damaged, kinds };
  const auto kind = static_cast<std::uint8_t>(input.take<std::uint8_t>() % kinds);
  if (kind == noise) {
    const std::span<const std::uint8_t> bytes = input.bytes(input.take<std::uint8_t>());
    return {bytes.begin(), bytes.end()};
  }
  wire::FrameHeader header{.source = source, .destination = destination, .transfer_id = transfer_id++};
  header.specifier = specifiers[input.take<std::uint8_t>() % specifiers.size()];
  if (kind == odd_header) {
    header.priority = static_cast<wire::Priority>(input.take<std::uint8_t>() % 8);
    header.source = input.take<std::uint16_t>();
    header.destination = input.take<std::uint16_t>();
    header.specifier = input.take<std::uint16_t>();
    header.transfer_id = transfer_id = input.take<std::uint64_t>();
  }
  const std::size_t length = input.take<std::uint16_t>() % 2048;
  std::vector<std::uint8_t> transfer = transfer_of(framing, header, input.bytes(length));
  if (kind == damaged && !transfer.empty()) {
    const std::size_t at = input.take<std::uint16_t>() % transfer.size();
    transfer[at] = static_cast<std::uint8_t>(transfer[at] ^ input.take<std::uint8_t>());
  }
  return transfer;
}

}  // namespace palpate::fuzz
