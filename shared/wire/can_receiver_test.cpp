#include "shared/wire/can_receiver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "shared/wire/can_sender.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/transfer_monitor.hpp"

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kCapacity = kLargestPayloadToBoard;
constexpr std::size_t kAtOnce = 3;
using Receiver = CanReceiver<kCapacity, kAtOnce>;

// A transfer, as sent and as delivered; transfer identifiers modulo 32.
struct Transfer {
  FrameHeader header;
  Bytes payload;
  bool operator==(const Transfer&) const = default;
};

// A frame that keeps its data.
struct OwnedFrame {
  std::uint32_t identifier = 0;
  bool fd = false;
  Bytes data;
  [[nodiscard]] CanFrame view() const { return {identifier, fd, data}; }
};
using Frames = std::vector<OwnedFrame>;

Frames frames_of(const Transfer& transfer, CanFormat format) {
  CanSender sender;
  EXPECT_EQ(sender.begin(transfer.header, transfer.payload, format), Status::ok);
  Frames frames;
  while (!sender.done()) {
    const CanFrame frame = sender.next();
    frames.push_back({frame.identifier, frame.fd, Bytes(frame.data.begin(), frame.data.end())});
  }
  return frames;
}

// The payload as CAN delivers it: in FD format with zeros behind it.
Transfer padded(Transfer transfer, CanFormat format) {
  const bool several = can_transfer_frames(transfer.payload.size(), format) > 1;
  transfer.payload.resize(can_content_bytes(transfer.payload.size(), format) -
                          (several ? kCanTransferCrcBytes : 0));
  return transfer;
}

template <class AnyReceiver>
std::vector<Transfer> feed(AnyReceiver& receiver, const Frames& frames, std::uint32_t now_tick = 0) {
  std::vector<Transfer> delivered;
  for (const OwnedFrame& frame : frames) {
    Frame out;
    if (!receiver.take(frame.view(), now_tick, out)) continue;
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(out.payload.data()) % 8, 0u);
    delivered.push_back({out.header, Bytes(out.payload.begin(), out.payload.end())});
  }
  return delivered;
}

Frames operator+(Frames left, const Frames& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

Transfer sample(std::size_t payload_bytes, std::uint32_t seed, std::uint16_t subject = kModelStateSubject,
                std::uint16_t source = kHostNode) {
  std::mt19937 random(seed);
  Transfer transfer{{.priority = Priority::nominal,
                     .source = source,
                     .specifier = message_specifier(subject),
                     .transfer_id = seed % 32},
                    Bytes(payload_bytes)};
  for (std::uint8_t& byte : transfer.payload) byte = static_cast<std::uint8_t>(random() & 0xFF);
  return transfer;
}

constexpr CanFormat kFormats[] = {CanFormat::classic, CanFormat::fd};

TEST(CanReceiver, EveryLengthOfPayload) {
  for (const CanFormat format : kFormats) {
    Receiver receiver;
    for (std::size_t length = 0; length <= kCapacity; length += length < 300 ? 1 : 31) {
      const Transfer sent = sample(length, static_cast<std::uint32_t>(length));
      ASSERT_EQ(feed(receiver, frames_of(sent, format)), (std::vector{padded(sent, format)})) << length;
    }
    EXPECT_EQ(receiver.counters().refused(), 0u);
  }
}

TEST(CanReceiver, MessagesRequestsAndResponses) {
  Receiver receiver;
  Transfer request = sample(30, 4), response = sample(31, 5), message = sample(32, 6);
  request.header.specifier = request_specifier(300);
  request.header.destination = kBoardNode;
  response.header.specifier = response_specifier(301);
  response.header.destination = 9;
  response.header.priority = Priority::exceptional;
  message.header.priority = Priority::optional;
  for (const Transfer& one : {request, response, message})
    EXPECT_EQ(feed(receiver, frames_of(one, CanFormat::classic)), (std::vector{one}));
}

// From a stream of records, cut anywhere.
TEST(CanReceiver, RecordsInRunsOfEveryLength) {
  for (const CanFormat format : kFormats) {
    std::vector<Transfer> sent;
    Bytes stream;
    for (std::uint32_t i = 0; i < 6; ++i) {
      sent.push_back(sample(i * i * 40, i));
      CanSender sender;
      ASSERT_EQ(sender.begin(sent.back().header, sent.back().payload, format), Status::ok);
      Bytes records(can_transfer_bytes(sent.back().payload.size(), format));
      ASSERT_EQ(sender.write(records), records.size());
      stream.insert(stream.end(), records.begin(), records.end());
      sent.back() = padded(sent.back(), format);
    }
    for (std::size_t run = 1; run <= stream.size(); run += run < 80 ? 1 : 211) {
      Receiver receiver;
      std::vector<Transfer> delivered;
      for (std::size_t at = 0; at < stream.size(); at += run) {
        std::span<const std::uint8_t> piece =
            std::span(stream).subspan(at, std::min(run, stream.size() - at));
        while (true) {
          const Reception reception = receiver.receive(piece, 0);
          piece = piece.subspan(reception.consumed);
          if (!reception.complete) break;
          delivered.push_back({reception.frame.header,
                               Bytes(reception.frame.payload.begin(), reception.frame.payload.end())});
        }
      }
      ASSERT_EQ(delivered, sent) << run;
      ASSERT_EQ(receiver.counters().frames, sent.size());
      ASSERT_EQ(receiver.counters().refused(), 0u);
    }
  }
}

// Every single-bit error in the data of a transfer in several frames: nothing is delivered of it, and the
// next one is. The error may make its first frame a transfer of its own (end bit); then it says so: on a bus
// that is left to the CRC of the frame, in a record to the record's.
TEST(CanReceiver, EverySingleBitErrorOfSeveralFramesIsDetected) {
  for (const CanFormat format : kFormats) {
    for (const std::size_t length : {8u, 13u, 70u, 200u}) {
      const Transfer sent = sample(length, 3), after = sample(50, 4);
      const Frames good = frames_of(sent, format);
      if (good.size() == 1) continue;
      for (std::size_t hit = 0; hit < good.size(); ++hit) {
        const std::size_t tail_bit_of_end = 8 * (good[hit].data.size() - 1) + 6;
        for (std::size_t bit = 0; bit < 8 * good[hit].data.size(); ++bit) {
          if (hit == 0 && bit == tail_bit_of_end) continue;
          Frames bad = good;
          bad[hit].data[bit / 8] = static_cast<std::uint8_t>(bad[hit].data[bit / 8] ^ (1u << (bit % 8)));
          Receiver receiver;
          ASSERT_EQ(feed(receiver, bad + frames_of(after, format)), (std::vector{padded(after, format)}))
              << length << " bytes, frame " << hit << ", bit " << bit;
          ASSERT_GE(receiver.counters().refused(), 1u);
        }
      }
    }
  }
}

// The same of identifiers. Of a frame that seems to be another port's a wrong transfer can only come from a
// single frame, so there is none.
TEST(CanReceiver, EverySingleBitErrorOfIdentifiersIsDetected) {
  const Transfer sent = sample(40, 3), after = sample(50, 4);
  const Frames good = frames_of(sent, CanFormat::classic);
  constexpr std::uint32_t kIgnored = 3u << 21;  // of messages, by the standard
  for (std::size_t hit = 0; hit < good.size(); ++hit)
    for (unsigned bit = 0; bit < 29; ++bit) {
      Frames bad = good;
      bad[hit].identifier ^= 1u << bit;
      Receiver receiver;
      std::vector<Transfer> expected{after};
      if ((kIgnored & (1u << bit)) != 0) expected = {sent, after};
      ASSERT_EQ(feed(receiver, bad + frames_of(after, CanFormat::classic)), expected) << hit << ' ' << bit;
      ASSERT_TRUE(expected.size() == 2 || receiver.counters().refused() >= 1);
    }
}

// Any run of frames missing, at any place: the transfer is refused, counted once, and the next one arrives.
TEST(CanReceiver, MissingFrames) {
  for (const CanFormat format : kFormats) {
    const Transfer sent = sample(400, 3), after = sample(50, 4);
    const Frames good = frames_of(sent, format);
    for (std::size_t first = 0; first < good.size(); ++first)
      for (std::size_t count = 1; first + count < good.size(); ++count) {
        Frames rest = good;
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(first),
                   rest.begin() + static_cast<std::ptrdiff_t>(first + count));
        Receiver receiver;
        ASSERT_EQ(feed(receiver, rest + frames_of(after, format)), (std::vector{padded(after, format)}));
        ASSERT_EQ(receiver.counters().refused(), 1u) << first << ' ' << count;
      }
  }
}

// A bus may bring any frame twice.
TEST(CanReceiver, RepeatedFramesAreLeftOut) {
  for (const CanFormat format : kFormats) {
    const Transfer sent = sample(200, 3);
    const Frames good = frames_of(sent, format);
    for (std::size_t hit = 0; hit < good.size(); ++hit) {
      Frames twice = good;
      twice.insert(twice.begin() + static_cast<std::ptrdiff_t>(hit), good[hit]);
      Receiver receiver;
      ASSERT_EQ(feed(receiver, twice), (std::vector{padded(sent, format)})) << hit;
      ASSERT_EQ(receiver.counters().refused(), 0u);
      ASSERT_EQ(receiver.counters().repeated_can_frames, 1u);
    }
  }
}

// Frames that are all alike: losing two of them looks like nothing but a repeated one, and the CRC tells.
TEST(CanReceiver, MissingFramesOfZeros) {
  Transfer sent = sample(100, 3);
  std::fill(sent.payload.begin(), sent.payload.end(), std::uint8_t{0});
  const Frames good = frames_of(sent, CanFormat::classic);
  for (std::size_t first = 1; first + 2 < good.size(); ++first)
    for (std::size_t count = 1; first + count < good.size() - 1; ++count) {
      Frames rest = good;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(first),
                 rest.begin() + static_cast<std::ptrdiff_t>(first + count));
      Receiver receiver;
      ASSERT_TRUE(feed(receiver, rest).empty()) << first << ' ' << count;
    }
}

// Transfers of different ports and sources interleaved at random, each sequence in its order.
TEST(CanReceiver, InterleavedTransfers) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const CanFormat format = kFormats[trial % 2];
    std::vector<Frames> queues;
    std::vector<Transfer> sent;
    for (std::uint32_t port = 0; port < kAtOnce; ++port) {
      Frames queue;
      for (std::uint32_t i = 0; i < 4; ++i) {
        const bool other_source = port == 2;
        sent.push_back(sample(random() % 500, 30 + i, static_cast<std::uint16_t>(1610 + port % 2),
                              other_source ? 11 : kHostNode));
        queue = queue + frames_of(sent.back(), format);
        sent.back() = padded(sent.back(), format);
      }
      queues.push_back(queue);
    }
    Frames mixed;
    std::vector<std::size_t> at(queues.size(), 0);
    for (std::size_t left = queues[0].size() + queues[1].size() + queues[2].size(); left > 0; --left) {
      std::size_t pick = random() % queues.size();
      while (at[pick] == queues[pick].size()) pick = (pick + 1) % queues.size();
      mixed.push_back(queues[pick][at[pick]++]);
    }
    Receiver receiver;
    const std::vector<Transfer> delivered = feed(receiver, mixed);
    ASSERT_EQ(delivered.size(), sent.size());
    EXPECT_TRUE(std::is_permutation(delivered.begin(), delivered.end(), sent.begin()));
    ASSERT_EQ(receiver.counters().refused(), 0u);
  }
}

// More at once than there is room for: those that began are delivered, the one too many is counted, once.
TEST(CanReceiver, MoreTransfersThanRoom) {
  Receiver receiver;
  std::vector<Frames> all;
  std::vector<Transfer> sent;
  for (std::uint16_t port = 0; port <= kAtOnce; ++port) {
    sent.push_back(sample(100, 1, static_cast<std::uint16_t>(1000 + port)));
    all.push_back(frames_of(sent.back(), CanFormat::classic));
  }
  Frames mixed;
  for (std::size_t i = 0; i < all[0].size(); ++i)
    for (auto port = all.begin(); port != all.end(); ++port)
      if (port != all.end() - 1 || i + 1 < all[0].size()) mixed.push_back((*port)[i]);
  EXPECT_EQ(feed(receiver, mixed), (std::vector(sent.begin(), sent.end() - 1)));
  EXPECT_EQ(receiver.counters().of(Status::too_many_transfers), 1u);
  EXPECT_EQ(receiver.counters().refused(), 1u);
  // There is room again.
  EXPECT_EQ(feed(receiver, all.back()), (std::vector{sent.back()}));
}

// A transfer that stops is given up after 2 s: its rest is refused, and its room is free for another.
TEST(CanReceiver, TransferThatStopsIsGivenUp) {
  const std::uint32_t start = 0xFFFFFFF0u;  // the tick counter wraps meanwhile
  const Transfer sent = sample(40, 3);
  const Frames all = frames_of(sent, CanFormat::classic);
  const Frames first(all.begin(), all.begin() + 3), rest(all.begin() + 3, all.end());
  {
    Receiver receiver;
    feed(receiver, first, start);
    EXPECT_EQ(feed(receiver, rest, start + kCanTransferTimeout_ticks - 1), (std::vector{sent}));
  }
  {
    Receiver receiver;
    feed(receiver, first, start);
    EXPECT_TRUE(feed(receiver, rest, start + kCanTransferTimeout_ticks).empty());
    EXPECT_EQ(receiver.counters().of(Status::transfer_incomplete), 1u);
    EXPECT_EQ(receiver.counters().refused(), 1u);
  }
  CanReceiver<100, 1> receiver;
  feed(receiver, first, start);
  const Transfer other = sample(40, 4, 1500);
  EXPECT_TRUE(
      feed(receiver, frames_of(other, CanFormat::classic), start + kCanTransferTimeout_ticks - 1).empty());
  EXPECT_EQ(receiver.counters().of(Status::too_many_transfers), 1u);
  EXPECT_EQ(feed(receiver, frames_of(other, CanFormat::classic), start + kCanTransferTimeout_ticks),
            (std::vector{other}));
  EXPECT_EQ(receiver.counters().of(Status::transfer_incomplete), 1u);
}

TEST(CanReceiver, TooLongForTheBuffer) {
  constexpr std::size_t kSmall = 100;
  CanReceiver<kSmall, 1> receiver;
  const Transfer after = sample(kSmall, 1);
  for (std::size_t excess = 30; excess < 200; ++excess) {
    const std::uint32_t before = receiver.counters().refused();
    EXPECT_EQ(feed(receiver, frames_of(sample(kSmall + excess, 2), CanFormat::classic) +
                                 frames_of(after, CanFormat::classic)),
              (std::vector{after}));
    EXPECT_EQ(receiver.counters().refused(), before + 1);
  }
  EXPECT_EQ(receiver.counters().last_fault, Status::frame_too_long);
  // The capacity is always there, with FD padding too.
  for (std::size_t length = 0; length <= kSmall; ++length)
    EXPECT_EQ(feed(receiver, frames_of(sample(length, 1), CanFormat::fd)).size(), 1u) << length;
}

// Rooms that are kept for some ports: whatever others send, they are there; what others send in several
// frames is passed over.
TEST(CanReceiver, RoomsKeptForPorts) {
  constexpr std::array<CanRoom, 2> kRooms{CanRoom{.capacity = 300, .specifier = kModelStateSubject},
                                          CanRoom{.capacity = 20, .specifier = kTraceRequestSubject}};
  CanRoomsReceiver<kRooms> receiver;
  const Transfer state = sample(300, 1), request = sample(20, 2, kTraceRequestSubject);
  const Transfer other = sample(20, 3, 1234), other_single = sample(5, 4, 1234);
  const Frames states = frames_of(state, CanFormat::classic),
               requests = frames_of(request, CanFormat::classic);
  const Frames others = frames_of(other, CanFormat::classic);
  ASSERT_EQ(requests.size(), others.size());
  Frames mixed;
  for (std::size_t i = 0; i < states.size(); ++i) {
    mixed.push_back(states[i]);
    if (i < requests.size()) mixed = mixed + Frames{others[i], requests[i]};
  }
  EXPECT_EQ(feed(receiver, mixed + frames_of(other_single, CanFormat::classic)),
            (std::vector{request, state, other_single}));
  EXPECT_EQ(receiver.counters().refused(), 0u);
  // Each has its own capacity, and its own memory.
  EXPECT_TRUE(feed(receiver, frames_of(sample(60, 5, kTraceRequestSubject), CanFormat::classic)).empty());
  EXPECT_EQ(receiver.counters().of(Status::frame_too_long), 1u);
}

TEST(CanReceiver, EachFaultHasItsStatusAndCounter) {
  Receiver receiver(kBoardNode);
  const auto expect_fault = [&receiver](const Frames& frames, Status fault) {
    const std::uint32_t before = receiver.counters().of(fault), all = receiver.counters().refused();
    EXPECT_TRUE(feed(receiver, frames).empty());
    EXPECT_EQ(receiver.counters().of(fault), before + 1);
    EXPECT_EQ(receiver.counters().refused(), all + 1);
    EXPECT_EQ(receiver.counters().last_fault, fault);
  };
  const std::uint32_t message = 0x1064D201u;
  expect_fault({{message, false, {}}}, Status::frame_too_short);
  expect_fault({{message | (1u << 23), false, {0xE0}}}, Status::header_version_unknown);
  expect_fault({{message | (1u << 7), false, {0xE0}}}, Status::header_version_unknown);
  expect_fault({{message, false, {0xC0}}},
               Status::header_version_unknown);  // version 0: toggle begins with 0
  expect_fault({{message | (1u << 24), false, {1, 2, 3, 4, 5, 6, 7, 0xA0}}}, Status::header_version_unknown);
  expect_fault({{message, false, {1, 2, 3, 0x40}}}, Status::transfer_incomplete);  // no start
  expect_fault({{message, false, {1, 2, 3, 4, 5, 6, 7, 0xA0}}, {message, false, {1, 2, 3, 0x40}}},
               Status::payload_crc_mismatch);
  // A frame between that is not full; a last one longer than the first.
  expect_fault({{message, false, {1, 2, 3, 4, 5, 6, 7, 0xA1}}, {message, false, {1, 2, 0x01}}},
               Status::transfer_incomplete);
  expect_fault({{message, true, {1, 2, 3, 4, 5, 6, 7, 0xA2}}, {message, true, Bytes(12, 0x42)}},
               Status::transfer_incomplete);
  // For another node: passed over. From a node without a number: taken.
  const std::uint32_t before = receiver.counters().refused();
  EXPECT_TRUE(feed(receiver, {{0x134B158Au, false, {1, 0xE0}}}).empty());
  EXPECT_EQ(receiver.counters().refused(), before);
  const std::vector<Transfer> anonymous = feed(receiver, {{message | (1u << 24), false, {1, 0xE0}}});
  ASSERT_EQ(anonymous.size(), 1u);
  EXPECT_EQ(anonymous[0].header.source, kBroadcast);
}

// What was lost is counted across the wrap of the transfer identifier, up to 30 transfers in a row.
TEST(CanReceiver, LossesAreCountedAcrossTheWrap) {
  Receiver receiver;
  TransferMonitor monitor(kCanTransferIdBits);
  std::mt19937 random(3);
  std::uint64_t id = 0;
  std::uint32_t lost = 0;
  for (int i = 0; i < 500; ++i) {
    Transfer transfer = sample(random() % 40, 1);
    transfer.header.transfer_id = id;
    Frame out;
    std::size_t delivered = 0;
    for (const OwnedFrame& frame : frames_of(transfer, CanFormat::classic)) {
      if (!receiver.take(frame.view(), static_cast<std::uint32_t>(i), out)) continue;
      ++delivered;
      EXPECT_EQ(monitor.observe(out.header, static_cast<std::uint32_t>(i)), TransferKind::fresh);
    }
    ASSERT_EQ(delivered, 1u);
    const auto gap = static_cast<std::uint32_t>(random() % 4 == 0 ? random() % 31 : 0);
    if (i < 499) lost += gap;
    id += gap + 1;
  }
  EXPECT_EQ(monitor.lost(), lost);
  EXPECT_GT(lost, 500u);
}

// Streams of records of interleaved transfers with bits flipped, bytes removed and doubled, and frames lost:
// what comes out is what went in, and those that were not hit all come out.
TEST(CanReceiver, DamagedStreamsDeliverOnlyWhatWasSent) {
  std::mt19937 random(2);
  std::size_t hit_transfers = 0, all_delivered = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const CanFormat format = kFormats[trial % 2];
    std::vector<Transfer> sent, unharmed;
    Bytes stream;
    for (std::uint32_t i = 0; i < 12; ++i) {
      const Transfer transfer = sample(random() % 300, i);
      sent.push_back(padded(transfer, format));
      Bytes bytes(can_transfer_bytes(transfer.payload.size(), format));
      CanSender sender;
      ASSERT_EQ(sender.begin(transfer.header, transfer.payload, format), Status::ok);
      ASSERT_EQ(sender.write(bytes), bytes.size());
      const auto position = [&] { return static_cast<std::ptrdiff_t>(random() % bytes.size()); };
      switch (random() % 8) {
        case 0: {
          const auto at = static_cast<std::size_t>(position());
          bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1u << (random() % 8)));
          break;
        }
        case 1:
          bytes.erase(bytes.begin() + position());
          break;
        case 2:
          bytes.erase(bytes.begin() + position(), bytes.end());
          break;
        case 3: {
          const std::ptrdiff_t at = position();
          bytes.erase(bytes.begin() + at,
                      bytes.begin() + std::min<std::ptrdiff_t>(at + 40, std::ssize(bytes)));
          break;
        }
        default:
          unharmed.push_back(sent.back());
      }
      stream.insert(stream.end(), bytes.begin(), bytes.end());
    }
    hit_transfers += sent.size() - unharmed.size();
    Receiver receiver;
    std::vector<Transfer> delivered;
    const std::size_t run = 1 + random() % 300;
    for (std::size_t at = 0; at < stream.size(); at += run) {
      std::span<const std::uint8_t> piece = std::span(stream).subspan(at, std::min(run, stream.size() - at));
      while (true) {
        const Reception reception = receiver.receive(piece, 0);
        piece = piece.subspan(reception.consumed);
        if (!reception.complete) break;
        delivered.push_back(
            {reception.frame.header, Bytes(reception.frame.payload.begin(), reception.frame.payload.end())});
      }
    }
    all_delivered += delivered.size();
    std::size_t at = 0, found = 0;
    for (const Transfer& transfer : delivered) {
      while (at < sent.size() && sent[at] != transfer) ++at;
      ASSERT_LT(at, sent.size()) << "a transfer that was not sent, or twice";
      ++at;
      if (std::find(unharmed.begin(), unharmed.end(), transfer) != unharmed.end()) ++found;
    }
    // Behind a damage the reader may hold the stream's end back until more comes.
    ASSERT_GE(found + 1, unharmed.size()) << trial;
  }
  EXPECT_GT(hit_transfers, 1000u);  // the test has hit something
  EXPECT_GT(all_delivered, 1000u);
}

// Frames with any identifier of a few, any tail and any content: nothing of several frames is delivered whose
// CRC is wrong by chance (2^-16 each) more often than that, and nothing breaks.
TEST(CanReceiver, RandomFrames) {
  std::mt19937 random(4);
  Receiver receiver;
  std::size_t several = 0, ends = 0;
  constexpr std::size_t kFrames = 500'000;
  for (std::size_t i = 0; i < kFrames; ++i) {
    Bytes data(kCanDataLengths[random() % 16]);
    for (std::uint8_t& byte : data) byte = static_cast<std::uint8_t>(random() & 0xFF);
    if (!data.empty())
      data.back() = static_cast<std::uint8_t>(data.back() & 0xE1);  // few transfer identifiers
    const auto identifier =
        static_cast<std::uint32_t>(0x1064D200u | (random() % 6) | (random() % 64 == 0 ? 1u << 24 : 0u));
    Frame out;
    const bool end = !data.empty() && (data.back() & 0x40) != 0, start = !data.empty() && data.back() >= 0x80;
    if (end && !start) ++ends;
    if (receiver.take({identifier, true, data}, static_cast<std::uint32_t>(i), out) && !start) ++several;
  }
  EXPECT_GT(ends, kFrames / 8);
  EXPECT_LE(several, 10u);
}

}  // namespace
}  // namespace palpate::wire
