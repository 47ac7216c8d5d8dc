// The board's USB (TinyUSB, what joins it to the link, the device controller in software) under any records
// of a far end, good requests and packets among them. Whatever comes, the board answers each token once at
// most, in records that it may send; and after a reset of the bus it says what device it is.
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "boards/lockstep/usb_wire.hpp"
#include "firmware/ports/ports.hpp"
#include "host/fuzz/input.hpp"

using namespace palpate;
using fuzz::require;
using lockstep::UsbRecord;

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kMostTokens = 40;      // of a tick: more than the board takes
constexpr std::size_t kAnyTokens = 100'000;  // one a byte at most
constexpr std::uint8_t kDeviceDescriptor = 1, kDeviceDescriptorBytes = 18;

// TinyUSB is one in a program, so its board is, too: each input begins with a cable that was out.
struct Rig {
  Rig() { wire.begin(); }
  firmware::LinkBuffers link;
  lockstep::UsbBus bus;
  board::UsbWire wire{link, bus, {0xAB, 0xCD, 1}};
};

Rig& rig() {
  static Rig the_rig;
  return the_rig;
}

void append(Bytes& records, UsbRecord kind, std::uint8_t address = 0,
            std::span<const std::uint8_t> data = {}) {
  records.insert(records.end(),
                 {static_cast<std::uint8_t>(kind), address, static_cast<std::uint8_t>(data.size())});
  records.insert(records.end(), data.begin(), data.end());
}

bool is_an_answer(UsbRecord kind) {
  return kind >= UsbRecord::ack && kind <= UsbRecord::refused;
}

// The records that the board sends; how many of them answer tokens.
struct Heard {
  std::vector<Bytes> records;
  std::size_t answers = 0;
};

Heard hear() {
  Bytes bytes(8192);
  bytes.resize(rig().wire.isr_transmit(bytes));
  Heard heard;
  for (std::size_t at = 0; at < bytes.size();) {
    require(bytes.size() - at >= lockstep::kUsbHeaderBytes, "a record has a head");
    const auto kind = static_cast<UsbRecord>(bytes[at]);
    const std::size_t length = bytes[at + 2];
    require(length <= lockstep::kUsbPacketBytes, "a packet has 64 bytes at most");
    require(bytes.size() - at >= lockstep::kUsbHeaderBytes + length, "a record is whole");
    require(is_an_answer(kind) || kind == UsbRecord::attach || kind == UsbRecord::detach ||
                kind == UsbRecord::wake,
            "a record is one of the board's");
    require(length == 0 || kind == UsbRecord::data0 || kind == UsbRecord::data1, "only data have bytes");
    heard.answers += is_an_answer(kind);
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    at += lockstep::kUsbHeaderBytes + length;
    heard.records.emplace_back(begin, bytes.begin() + static_cast<std::ptrdiff_t>(at));
  }
  return heard;
}

Heard tick(const Bytes& records) {
  rig().wire.isr_receive(records);
  rig().wire.poll_receive();
  rig().wire.start_transmit();
  return hear();
}

std::array<std::uint8_t, lockstep::kUsbSetupBytes> take_setup(fuzz::Input& input) {
  // Of requests that it knows, mostly: a fuzzer finds their numbers late.
  constexpr std::array<std::uint8_t, 8> kKinds{0x80, 0x00, 0x01, 0x02, 0x82, 0x21, 0xA1, 0xC0};
  constexpr std::array<std::uint8_t, 12> kRequests{0, 1, 3, 5, 6, 8, 9, 11, 0x20, 0x21, 0x22, 0x23};
  std::array<std::uint8_t, lockstep::kUsbSetupBytes> setup{};
  const auto choice = input.take<std::uint8_t>();
  setup[0] = kKinds[choice % kKinds.size()];
  setup[1] = kRequests[choice / kKinds.size() % kRequests.size()];
  for (std::size_t i = 2; i < setup.size(); ++i) setup[i] = input.take<std::uint8_t>();
  return setup;
}

void append_next(fuzz::Input& input, Bytes& records, std::size_t& tokens) {
  enum Kind : std::uint8_t { setup, out, in, signal, configure, noise, kinds };
  switch (static_cast<Kind>(input.take<std::uint8_t>() % kinds)) {
    case setup:
      append(records, UsbRecord::setup, 0, take_setup(input));
      ++tokens;
      return;
    case out: {
      const auto form = input.take<std::uint8_t>();
      const UsbRecord kind = (form & 0x80U) != 0 ? UsbRecord::out_data1 : UsbRecord::out_data0;
      append(records, kind, form % 4, input.bytes(input.take<std::uint8_t>() % 65));
      ++tokens;
      return;
    }
    case in:
      append(records, UsbRecord::in, static_cast<std::uint8_t>(0x80U | input.take<std::uint8_t>() % 4U));
      ++tokens;
      return;
    case signal: {
      constexpr std::array kSignals{UsbRecord::reset, UsbRecord::frame, UsbRecord::suspend, UsbRecord::resume,
                                    UsbRecord::unplug};
      append(records, kSignals[input.take<std::uint8_t>() % kSignals.size()]);
      return;
    }
    case configure: {
      // SET_CONFIGURATION 1 and its status: the endpoints are there from now on.
      constexpr std::array<std::uint8_t, lockstep::kUsbSetupBytes> kConfigure{0, 9, 1, 0, 0, 0, 0, 0};
      append(records, UsbRecord::setup, 0, kConfigure);
      append(records, UsbRecord::in, 0x80);
      tokens += 2;
      return;
    }
    case noise: {
      const std::span<const std::uint8_t> bytes = input.bytes(input.take<std::uint8_t>());
      records.insert(records.end(), bytes.begin(), bytes.end());
      tokens = kAnyTokens;  // and the records behind them mean anything
      return;
    }
    case kinds:
      return;
  }
}

void replug() {
  // First what an input has left in the wires: 4,096 bytes are 1,366 records at most.
  for (std::size_t i = 0; i <= 1366 / board::kUsbTransactionsPerTick && rig().bus.to_board.size() != 0; ++i)
    tick({});
  require(rig().bus.to_board.size() == 0, "records are handled");
  Bytes records;
  append(records, UsbRecord::unplug);
  append(records, UsbRecord::reset);
  append(records, UsbRecord::frame);
  tick(records);
  Bytes rest(firmware::kLinkReceiveCapacity);
  rig().link.received.read(rest);
}

void expect_device() {
  constexpr std::array<std::uint8_t, lockstep::kUsbSetupBytes> kGet{
      0x80, 6, 0, kDeviceDescriptor, 0, 0, kDeviceDescriptorBytes, 0};
  Bytes records;
  append(records, UsbRecord::setup, 0, kGet);
  const Heard acknowledged = tick(records);
  require(acknowledged.records.size() == 1 &&
              acknowledged.records[0][0] == static_cast<std::uint8_t>(UsbRecord::ack),
          "a request is acknowledged");
  records.clear();
  append(records, UsbRecord::in, 0x80);
  const Heard said = tick(records);
  require(said.records.size() == 1 &&
              said.records[0].size() == lockstep::kUsbHeaderBytes + kDeviceDescriptorBytes,
          "a device says what it is");
  const Bytes& answer = said.records[0];
  require(answer[0] == static_cast<std::uint8_t>(UsbRecord::data1) && answer[3] == kDeviceDescriptorBytes &&
              answer[4] == kDeviceDescriptor,
          "it is a device descriptor");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  replug();
  std::size_t open_tokens = 0;
  while (!input.empty()) {
    Bytes records;
    append(records, UsbRecord::frame);
    std::size_t tokens = 0;
    const std::size_t most = 1 + input.take<std::uint8_t>() % kMostTokens;
    while (tokens < most && records.size() < 1024 && !input.empty()) append_next(input, records, tokens);
    // What the board says meanwhile, and what it hears, as the firmware above would.
    const Bytes said(input.take<std::uint8_t>() % 200,
                     static_cast<std::uint8_t>(input.take<std::uint8_t>() % 2));
    (void)rig().link.transmit.write(said);
    open_tokens += std::min(tokens, records.size());
    const Heard heard = tick(records);
    require(heard.answers <= open_tokens, "tokens are answered once");
    open_tokens -= heard.answers;
    Bytes received(firmware::kLinkReceiveCapacity);
    if ((input.take<std::uint8_t>() & 3U) != 0) rig().link.received.read(received);
  }
  replug();
  expect_device();
  return 0;
}
