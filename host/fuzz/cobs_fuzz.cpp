// Any bytes decode within bounds, in pieces as in one; any packet comes back from its encoding.
#include <array>
#include <vector>

#include "host/fuzz/input.hpp"
#include "shared/wire/cobs.hpp"

using palpate::fuzz::Input;
using palpate::fuzz::require;
using namespace palpate::wire;

namespace {

struct Decoded {
  std::vector<std::uint8_t> bytes;
  std::vector<bool> whole;  // of each packet
  bool operator==(const Decoded&) const = default;
};

Decoded decode(std::span<const std::uint8_t> in, std::size_t piece) {
  Decoded result;
  CobsDecoder decoder;
  std::array<std::uint8_t, 300> out{};
  while (!in.empty()) {
    const auto step = decoder.decode(in.first(std::min(piece, in.size())),
                                     std::span(out).first(std::min(piece, out.size())));
    require(step.consumed <= in.size() && step.written <= std::min(piece, out.size()),
            "a step stays within its spans");
    require(step.consumed + step.written > 0, "a step gets on");
    in = in.subspan(step.consumed);
    result.bytes.insert(result.bytes.end(), out.begin(),
                        out.begin() + static_cast<std::ptrdiff_t>(step.written));
    if (step.stop == CobsDecoder::Stop::delimiter) {
      result.whole.push_back(decoder.whole());
      decoder.reset();
    }
  }
  return result;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  const std::size_t piece = 1 + input.take<std::uint8_t>();
  const std::span<const std::uint8_t> bytes = input.bytes(size);
  require(decode(bytes, bytes.size() + 1) == decode(bytes, piece), "pieces decode as the whole does");

  std::vector<std::uint8_t> encoded(cobs_max_bytes(bytes.size()));
  CobsEncoder encoder(encoded);
  const std::size_t first = std::min(piece, bytes.size());
  encoder.put(bytes.first(first));
  encoder.put(bytes.subspan(first));
  const std::size_t length = encoder.finish();
  require(length > 0 && length <= encoded.size(), "cobs_max_bytes() suffices");
  encoded.resize(length);
  require(std::count(encoded.begin(), encoded.end(), kCobsDelimiter) == 0, "no delimiter in an encoding");
  encoded.push_back(kCobsDelimiter);
  const Decoded back = decode(encoded, piece);
  require(back.whole == std::vector{true}, "an encoding is whole");
  require(std::equal(back.bytes.begin(), back.bytes.end(), bytes.begin(), bytes.end()),
          "a packet comes back");
  return 0;
}
