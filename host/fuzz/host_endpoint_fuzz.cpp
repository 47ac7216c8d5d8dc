// The host's end of the link, serial or CAN, under any bytes: nothing throws, every transfer is counted once,
// and numbers that it passes on are finite.
#include <array>
#include <cmath>
#include <memory>

#include "host/fuzz/input.hpp"
#include "host/fuzz/line.hpp"
#include "host/link/host_endpoint.hpp"

using namespace palpate;
using fuzz::require;

namespace {

struct Judge {
  void operator()(const palpate_ServoTrace_1_0& trace) const {
    require(trace.samples.count <= palpate_ServoTrace_1_0_samples_ARRAY_CAPACITY_,
            "a trace is within its bound");
    for (std::size_t i = 0; i < trace.samples.count; ++i)
      for (const float coordinate_m : trace.samples.elements[i].tip_m)
        require(std::isfinite(coordinate_m), "a tip is finite");
  }
  void operator()(const palpate_TipTrace_1_0& trace) const {
    for (const float coordinate_m : trace.tip_m) require(std::isfinite(coordinate_m), "a tip is finite");
  }
  template <class Other>
  void operator()(const Other&) const {}
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  constexpr std::array kSpecifiers{wire::MessageTraits<palpate_ServoTrace_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_TipTrace_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_BoardStatus_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_ModelReport_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_BasisReport_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_Command_Response_1_0>::kSpecifier,
                                   wire::MessageTraits<palpate_GetInfo_Response_1_0>::kSpecifier};
  const auto kind = static_cast<link::FramingKind>(input.take<std::uint8_t>() % 3);
  const std::unique_ptr<link::Framing> framing = link::make_framing(kind);
  link::HostEndpoint host({.framing = kind});
  std::uint64_t transfer_id = 0, messages = 0, bytes = 0;
  for (std::uint32_t tick = 0; !input.empty(); tick += input.take<std::uint8_t>()) {
    const auto piece =
        fuzz::next_piece(input, *framing, wire::kBoardNode, wire::kHostNode, kSpecifiers, transfer_id);
    bytes += piece.size();
    for (const link::Incoming& message : host.receive(piece, tick)) {
      std::visit(Judge{}, message);
      ++messages;
    }
  }
  const link::EndpointCounters counters = host.counters();
  require(counters.bytes_received == bytes, "bytes are counted");
  require(counters.frames_received == messages + counters.frames_foreign + counters.frames_repeated +
                                          counters.ports_unknown + counters.payloads_malformed,
          "a frame is a message, or is counted as what it is");
  return 0;
}
