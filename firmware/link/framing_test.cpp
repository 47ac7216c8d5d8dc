#include "firmware/link/framing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace palpate::firmware {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Framing>
class FramingTest : public testing::Test {};
using Framings = testing::Types<SerialFraming, ClassicCanFraming, CanFdFraming>;
TYPED_TEST_SUITE(FramingTest, Framings);

Bytes random_bytes(std::mt19937& random, std::size_t length) {
  Bytes bytes(length);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() & 0xFF);
  return bytes;
}

Bytes drain(TransmitRing& ring) {
  Bytes bytes(kLinkTransmitCapacity);
  bytes.resize(ring.read(bytes));
  return bytes;
}

// What a framing sends it takes, too: states and pieces of bases, of every length.
TYPED_TEST(FramingTest, RoundTrip) {
  std::mt19937 random(1);
  const auto ring = std::make_unique<TransmitRing>();
  const auto framing = std::make_unique<TypeParam>();
  std::uint64_t id = 0;
  for (std::size_t length = 0; length <= wire::kLargestPayloadToHost; length += 1 + length / 40) {
    const wire::FrameHeader header{
        .priority = wire::Priority::low,
        .source = wire::kHostNode,
        .specifier = length % 2 == 0 ? wire::kModelStateSubject : wire::kModelPartSubject,
        .transfer_id = id++};
    const Bytes payload = random_bytes(random, length);
    ASSERT_TRUE(framing->send(header, payload, *ring));
    const Bytes bytes = drain(*ring);
    ASSERT_LE(bytes.size(), TypeParam::kLargestSent);
    const wire::Reception reception = framing->receive(bytes, 0);
    ASSERT_TRUE(reception.complete) << length;
    EXPECT_EQ(reception.consumed, bytes.size());
    EXPECT_EQ(reception.frame.header.specifier, header.specifier);
    EXPECT_EQ(reception.frame.header.transfer_id,
              header.transfer_id & (~std::uint64_t{0} >> (64 - TypeParam::kTransferIdBits)));
    ASSERT_GE(reception.frame.payload.size(), payload.size());
    EXPECT_TRUE(std::equal(payload.begin(), payload.end(), reception.frame.payload.begin()));
  }
  EXPECT_EQ(framing->counters().frames, id);
  EXPECT_EQ(framing->counters().refused(), 0u);
}

// A transfer that does not fit is not begun: what is in the ring stays whole.
TYPED_TEST(FramingTest, FullRingTakesNothing) {
  std::mt19937 random(2);
  const auto ring = std::make_unique<TransmitRing>();
  const auto framing = std::make_unique<TypeParam>();
  const Bytes payload = random_bytes(random, 700);
  const wire::FrameHeader header{.source = wire::kHostNode, .specifier = wire::kModelStateSubject};
  std::size_t sent = 0;
  while (framing->send(header, payload, *ring)) ++sent;
  EXPECT_GE(sent, 2u);
  EXPECT_LT(ring->free(), TypeParam::kLargestSent);
  const Bytes bytes = drain(*ring);
  std::span<const std::uint8_t> rest(bytes);
  std::size_t taken = 0;
  for (bool more = true; more;) {
    const wire::Reception reception = framing->receive(rest, 0);
    rest = rest.subspan(reception.consumed);
    more = reception.complete;
    taken += more ? 1u : 0u;
  }
  EXPECT_EQ(taken, sent);
  EXPECT_EQ(framing->counters().refused(), 0u);
  EXPECT_TRUE(framing->send(header, payload, *ring));
}

// Everything that the host may send can come frame by frame among each other.
template <class Message>
Bytes largest() {
  constexpr std::uint16_t kSpecifier = wire::MessageTraits<Message>::kSpecifier;
  const Bytes payload(wire::MessageTraits<Message>::kMaxBytes, 0x5A);
  wire::CanSender sender;
  const std::uint16_t destination = kSpecifier >= 0x8000u ? wire::kBoardNode : wire::kBroadcast;
  EXPECT_EQ(sender.begin({.source = wire::kHostNode, .destination = destination, .specifier = kSpecifier},
                         payload, wire::CanFormat::classic),
            Status::ok);
  Bytes records(wire::can_transfer_bytes(payload.size(), wire::CanFormat::classic));
  EXPECT_EQ(sender.write(records), records.size());
  return records;
}

TEST(CanFraming, RoomForWhatTheHostSends) {
  ClassicCanFraming board;
  const std::vector<Bytes> transfers{largest<palpate_ModelState_1_0>(), largest<palpate_ModelPart_1_0>(),
                                     largest<palpate_TraceRequest_1_0>(),
                                     largest<palpate_Command_Request_1_0>(),
                                     largest<palpate_GetInfo_Request_1_0>()};
  constexpr std::size_t kFullRecord = 8 + wire::kCanRecordOverheadBytes;
  std::size_t complete = 0;
  for (std::size_t at = 0; at < transfers[0].size(); at += kFullRecord)
    for (const Bytes& transfer : transfers) {
      if (at >= transfer.size()) continue;
      const std::size_t length = std::min(kFullRecord, transfer.size() - at);
      complete += board.receive(std::span(transfer).subspan(at, length), 0).complete ? 1u : 0u;
    }
  EXPECT_EQ(complete, transfers.size());
  EXPECT_EQ(board.counters().refused(), 0u);
}

}  // namespace
}  // namespace palpate::firmware
