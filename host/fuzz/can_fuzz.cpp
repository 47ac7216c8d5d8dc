// CAN records to transfers: the same in pieces as in one, and nothing but what could have been sent, whatever
// comes between, is missing, doubled or damaged.
#include <algorithm>
#include <array>
#include <vector>

#include "host/fuzz/input.hpp"
#include "shared/wire/can_receiver.hpp"
#include "shared/wire/can_record.hpp"
#include "shared/wire/can_sender.hpp"

using namespace palpate;
using fuzz::require;

namespace {

constexpr std::size_t kCapacity = 300;  // less than the longest transfer of the fuzzer
constexpr std::size_t kAtOnce = 3;

struct Heard {
  std::vector<wire::FrameHeader> headers;
  std::vector<std::vector<std::uint8_t>> payloads;
  std::uint32_t refused = 0, repeated = 0;
  bool operator==(const Heard&) const = default;
};

Heard hear(std::span<const std::uint8_t> line, std::size_t piece) {
  wire::CanReceiver<kCapacity, kAtOnce> receiver;
  Heard heard;
  constexpr std::uint32_t kTick = 5;
  for (std::size_t at = 0; at < line.size(); at += piece) {
    std::span<const std::uint8_t> rest = line.subspan(at, std::min(piece, line.size() - at));
    for (bool complete = true; !rest.empty() || complete;) {
      const wire::Reception reception = receiver.receive(rest, kTick);
      require(reception.consumed <= rest.size(), "the receiver stays within its bytes");
      require(reception.consumed > 0 || reception.complete || rest.empty(), "the receiver gets on");
      rest = rest.subspan(reception.consumed);
      complete = reception.complete;
      if (!complete) continue;
      const std::span<const std::uint8_t> payload = reception.frame.payload;
      // Rooms are whole multiples of 8 bytes.
      require(payload.size() < kCapacity + wire::kCanReassemblyOverheadBytes + 8,
              "a payload fits its receiver");
      heard.headers.push_back(reception.frame.header);
      heard.payloads.emplace_back(payload.begin(), payload.end());
    }
  }
  require(receiver.counters().frames == heard.headers.size(), "transfers are counted");
  heard.refused = receiver.counters().refused();
  heard.repeated = receiver.counters().repeated_can_frames;
  return heard;
}

void append(std::vector<std::uint8_t>& line, const wire::CanFrame& frame) {
  std::array<std::uint8_t, wire::kMaxCanRecordBytes> record{};
  const std::size_t length = wire::write_can_record(frame, record);
  line.insert(line.end(), record.begin(), record.begin() + static_cast<std::ptrdiff_t>(length));
}

// A transfer whose frames go missing, come twice or are damaged where a byte of the input says so.
void append_transfer(fuzz::Input& input, std::vector<std::uint8_t>& line) {
  const auto form = input.take<std::uint8_t>();
  wire::FrameHeader header{.source = static_cast<std::uint16_t>(form % 8),
                           .specifier = wire::message_specifier(wire::kServoTraceSubject)};
  if ((form & 8U) != 0) header.specifier = input.take<std::uint16_t>();
  if ((header.specifier & 0x8000U) != 0) header.destination = wire::kHostNode;
  header.transfer_id = input.take<std::uint8_t>();
  const std::span<const std::uint8_t> payload = input.bytes(input.take<std::uint16_t>() % 512);
  wire::CanSender sender;
  if (sender.begin(header, payload, (form & 16U) != 0 ? wire::CanFormat::fd : wire::CanFormat::classic) !=
      Status::ok)
    return;
  while (!sender.done()) {
    const wire::CanFrame frame = sender.next();
    const auto fate = (form & 32U) != 0 ? input.take<std::uint8_t>() : std::uint8_t{0};
    if (fate % 8 == 1) continue;
    const std::size_t begin = line.size();
    append(line, frame);
    if (fate % 8 == 2) append(line, frame);
    if (fate % 8 == 3) line[begin + fate / 8 % (line.size() - begin)] ^= input.take<std::uint8_t>();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const std::size_t piece = 1 + input.take<std::uint8_t>();
  std::vector<std::uint8_t> line;
  while (!input.empty()) {
    enum Kind : std::uint8_t { noise, any_frame, transfer, kinds };
    switch (static_cast<Kind>(input.take<std::uint8_t>() % kinds)) {
      case noise: {
        const std::span<const std::uint8_t> bytes = input.bytes(input.take<std::uint8_t>());
        line.insert(line.end(), bytes.begin(), bytes.end());
        break;
      }
      case any_frame: {
        wire::CanFrame frame{.identifier = input.take<std::uint32_t>() & 0x1FFFFFFFU};
        const auto code = input.take<std::uint8_t>();
        frame.fd = code >= 128;
        frame.data = input.bytes(wire::kCanDataLengths[code % (frame.fd ? 16 : 9)]);
        append(line, frame);
        break;
      }
      case transfer:
        append_transfer(input, line);
        break;
      case kinds:
        break;
    }
  }
  if (line.empty()) return 0;
  require(hear(line, line.size()) == hear(line, piece), "pieces are received as the whole is");
  return 0;
}
