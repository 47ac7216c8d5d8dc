// The host's USB controller in virtual time under any bytes of a board: it refuses what no device sends with
// std::runtime_error, or goes on; what it asks for are whole records within what the exchange carries, and it
// hands over no more than it was given. A good device is behind the bytes at times, so that it is enumerated.
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "boards/lockstep/exchange.hpp"
#include "host/fuzz/input.hpp"
#include "host/link/usb_host.hpp"
#include "host/link/usb_ideal_device.hpp"

using namespace palpate;
using fuzz::require;

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kQueueBytes = 4096;

void require_records(const Bytes& records) {
  require(records.size() <= lockstep::kLinkBytesPerTick, "a tick's records fit in the exchange");
  std::size_t at = 0;
  while (at < records.size()) {
    require(records.size() - at >= lockstep::kUsbHeaderBytes, "a record has a head");
    require(records[at + 2] <= lockstep::kUsbPacketBytes, "a packet has 64 bytes at most");
    at += lockstep::kUsbHeaderBytes + records[at + 2];
  }
  require(at == records.size(), "records are whole");
}

// What the board says in this tick, of what a good device would have.
Bytes answers(fuzz::Input& input, const Bytes& good) {
  enum Form : std::uint8_t { as_it_is, changed, cut, replaced, silent, forms };
  Bytes bytes = good;
  switch (static_cast<Form>(input.take<std::uint8_t>() % (4 * forms))) {
    case changed:
      if (!bytes.empty()) bytes[input.take<std::uint8_t>() % bytes.size()] = input.take<std::uint8_t>();
      break;
    case cut:
      bytes.resize(bytes.size() - input.take<std::uint8_t>() % (bytes.size() + 1));
      break;
    case replaced: {
      const std::span<const std::uint8_t> own = input.bytes(input.take<std::uint8_t>());
      bytes.assign(own.begin(), own.end());
      break;
    }
    case silent:
      bytes.clear();
      break;
    case as_it_is:
    case forms:
    default:
      break;
  }
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const double chance = input.take<std::uint8_t>() % 4 == 0 ? 0.3 : 0.0;
  link::UsbHost host(kQueueBytes,
                     {.errors = {{.direction = 0, .chance = chance}, {.direction = 1, .chance = chance}}});
  link::UsbIdealDevice device;
  std::uint64_t given = 0, got = 0;
  // A good device is enumerated in some 50 ticks.
  constexpr std::uint32_t kGood_ticks = 60;
  const std::uint32_t good_until = input.take<std::uint8_t>() % 2 == 0 ? 0 : kGood_ticks;
  try {
    for (std::uint32_t tick = 0; tick < good_until || !input.empty(); ++tick) {
      const Bytes records = host.down().deliver(tick);
      require_records(records);
      const Bytes good = device.tick(records);
      const Bytes said = tick < good_until ? good : answers(input, good);
      given += said.size();
      (void)host.up().submit(said, tick);
      got += host.up().deliver(tick + 1).size();
      require(got <= given, "nothing comes that was not said");
      if (tick < good_until) continue;
      const auto act = input.take<std::uint8_t>();
      (void)host.down().submit(Bytes(act % 200, act), tick + 1);
      if (act % 16 == 15) host.set_plugged(act < 128, tick + 1);
      host.set_program_runs(act % 8 != 7);
      device.say(Bytes(act % 100, act));
      if (act % 32 == 31) device.refuse(2);
    }
  } catch (const std::runtime_error&) {
    return 0;  // said why
  }
  // What was on its way in two frames of the bus waits again where it was refused.
  require(host.down().backlog_bytes(0) <= kQueueBytes + 2 * 1216, "the queue has its limit");
  return 0;
}
