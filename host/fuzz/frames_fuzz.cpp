// Bytes on a line to frames: the same in pieces as in one, and every frame is one that could have been sent.
#include <array>
#include <memory>
#include <vector>

#include "host/fuzz/input.hpp"
#include "host/fuzz/line.hpp"
#include "shared/wire/frame_receiver.hpp"

using namespace palpate;
using fuzz::require;

namespace {

constexpr std::size_t kCapacity = 500;  // less than the longest frame of the fuzzer

struct Received {
  wire::FrameHeader header;
  std::vector<std::uint8_t> payload;
  bool operator==(const Received&) const = default;
};
struct Heard {
  std::vector<Received> frames;
  decltype(wire::ReceiverCounters::faults) faults{};
  bool operator==(const Heard&) const = default;
};

Heard hear(std::span<const std::uint8_t> line, std::size_t piece) {
  wire::FrameReceiver<kCapacity> receiver;
  Heard heard;
  while (!line.empty()) {
    const wire::Reception reception = receiver.receive(line.first(std::min(piece, line.size())));
    require(reception.consumed > 0 && reception.consumed <= line.size(), "the receiver gets on");
    line = line.subspan(reception.consumed);
    if (!reception.complete) continue;
    const std::span<const std::uint8_t> payload = reception.frame.payload;
    require(payload.size() <= kCapacity, "a payload fits its receiver");
    heard.frames.push_back({reception.frame.header, {payload.begin(), payload.end()}});
  }
  require(receiver.counters().frames == heard.frames.size(), "frames are counted");
  heard.faults = receiver.counters().faults;
  return heard;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const std::unique_ptr<link::Framing> framing = link::make_framing(link::FramingKind::serial);
  const std::size_t piece = 1 + input.take<std::uint8_t>();
  constexpr std::array kSpecifiers{wire::message_specifier(wire::kModelStateSubject)};
  std::uint64_t transfer_id = 0;
  std::vector<std::uint8_t> line;
  while (!input.empty()) {
    const auto next =
        fuzz::next_piece(input, *framing, wire::kHostNode, wire::kBoardNode, kSpecifiers, transfer_id);
    line.insert(line.end(), next.begin(), next.end());
  }
  const Heard heard = hear(line, line.size());
  require(heard == hear(line, piece), "pieces are received as the whole is");
  for (const Received& frame : heard.frames) {
    const Heard again = hear(fuzz::transfer_of(*framing, frame.header, frame.payload), piece);
    require(again.frames == std::vector{frame}, "a frame comes back from its encoding");
  }
  return 0;
}
