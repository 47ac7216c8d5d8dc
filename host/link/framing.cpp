#include "host/link/framing.hpp"

#include <stdexcept>
#include <string>

#include "shared/wire/can_receiver.hpp"
#include "shared/wire/can_sender.hpp"
#include "shared/wire/frame_receiver.hpp"

namespace palpate::link {
namespace {

class SerialFraming final : public Framing {
 public:
  [[nodiscard]] std::vector<std::uint8_t> encode(const wire::FrameHeader& header,
                                                 std::span<const std::uint8_t> payload) const override {
    std::vector<std::uint8_t> bytes(wire::max_frame_bytes(payload.size()));
    bytes.resize(wire::encode_frame(header, payload, bytes));
    return bytes;
  }
  wire::Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t) override {
    return receiver_.receive(bytes);
  }
  [[nodiscard]] const wire::ReceiverCounters& counters() const override { return receiver_.counters(); }
  [[nodiscard]] unsigned transfer_id_bits() const override { return 64; }

 private:
  wire::FrameReceiver<kReceiverCapacity> receiver_;
};

// Ports of the board, each of which may be in the middle of a transfer: six subjects, two services, and one
// for what is none of ours.
constexpr std::size_t kTransfersAtOnce = 9;

class CanFraming final : public Framing {
 public:
  explicit CanFraming(wire::CanFormat format) : format_(format) {}

  [[nodiscard]] std::vector<std::uint8_t> encode(const wire::FrameHeader& header,
                                                 std::span<const std::uint8_t> payload) const override {
    wire::CanSender sender;
    if (sender.begin(header, payload, format_) != Status::ok)
      throw std::invalid_argument(
          "CAN: a transfer from node " + std::to_string(header.source) + " to " +
          std::to_string(header.destination) + " with specifier " + std::to_string(header.specifier) +
          "; nodes are 0..127, subjects 0..8191, services 0..511, and messages have no destination");
    std::vector<std::uint8_t> bytes(wire::can_transfer_bytes(payload.size(), format_));
    bytes.resize(sender.write(bytes));
    return bytes;
  }
  wire::Reception receive(std::span<const std::uint8_t> bytes, std::uint32_t tick) override {
    return receiver_.receive(bytes, tick);
  }
  [[nodiscard]] const wire::ReceiverCounters& counters() const override { return receiver_.counters(); }
  [[nodiscard]] unsigned transfer_id_bits() const override { return wire::kCanTransferIdBits; }

 private:
  wire::CanFormat format_;
  wire::CanReceiver<kReceiverCapacity, kTransfersAtOnce> receiver_;
};

}  // namespace

std::unique_ptr<Framing> make_framing(FramingKind kind) {
  switch (kind) {
    case FramingKind::serial:
      return std::make_unique<SerialFraming>();
    case FramingKind::can_classic:
      return std::make_unique<CanFraming>(wire::CanFormat::classic);
    case FramingKind::can_fd:
      return std::make_unique<CanFraming>(wire::CanFormat::fd);
  }
  throw std::invalid_argument("make_framing: unknown kind " + std::to_string(static_cast<int>(kind)));
}

}  // namespace palpate::link
