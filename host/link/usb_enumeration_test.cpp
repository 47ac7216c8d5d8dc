#include "host/link/usb_enumeration.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes head(std::size_t bytes) {
  return {9, 2, static_cast<std::uint8_t>(bytes), 0, 1, 3, 0, 0x80, 50};
}
Bytes interface(std::uint8_t of_class, std::uint8_t alternate = 0) {
  return {9, 4, 0, alternate, 2, of_class, 0, 0, 0};
}
Bytes endpoint(std::uint8_t address, std::uint8_t kind = 2, std::uint8_t packet = 64) {
  return {7, 5, address, kind, packet, 0, 0};
}
Bytes joined(const std::vector<Bytes>& parts) {
  Bytes all = head(0);
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  all[2] = static_cast<std::uint8_t>(all.size());
  return all;
}

// The first interface of the vendor's class with a bulk endpoint of 64 bytes each way, and no other.
TEST(FindVendorPipes, FindsTheInterfaceAndNoOther) {
  const Bytes good = joined({interface(10), endpoint(0x02), endpoint(0x82), interface(0xFF),
                             endpoint(0x83, 3), endpoint(0x84), endpoint(0x05), endpoint(0x86)});
  const auto found = find_vendor_pipes(good);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->out, 0x05);
  EXPECT_EQ(found->in, 0x84);
  EXPECT_EQ(found->configuration, 3);
  EXPECT_FALSE(find_vendor_pipes(joined({interface(10), endpoint(0x02), endpoint(0x82)})));
  EXPECT_FALSE(find_vendor_pipes(joined({interface(0xFF), endpoint(0x02), interface(0xFF), endpoint(0x82)})));
  EXPECT_FALSE(find_vendor_pipes(joined({interface(0xFF, 1), endpoint(0x02), endpoint(0x82)})));
  EXPECT_FALSE(find_vendor_pipes(joined({interface(0xFF), endpoint(0x02, 2, 32), endpoint(0x82)})));
  for (std::size_t length = 0; length < good.size() - 7; ++length)
    EXPECT_FALSE(find_vendor_pipes(std::span(good).first(length))) << length;
  Bytes damaged = good;
  damaged[9] = 0;
  EXPECT_FALSE(find_vendor_pipes(damaged));
}

// Each token is answered badly once: it fails, and asks no more.
TEST(UsbEnumeration, ABadAnswerEndsIt) {
  const Bytes device{18, 1, 0, 2, 0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  const Bytes configuration = joined({interface(0xFF), endpoint(0x01), endpoint(0x81)});
  // Answers by token; the `bad`-th is a stall, or data of the wrong toggle.
  const auto run = [&](int bad, bool stalls) {
    UsbEnumeration one;
    Bytes answer;
    std::uint8_t toggle = 1;
    std::uint32_t tick = 0;
    int tokens = 0;
    for (; tick < 100 && one.state() == UsbEnumeration::State::running; ++tick) {
      const auto token = one.next(tick);
      if (!token) continue;
      EXPECT_FALSE(one.next(tick));  // not before it is answered
      const bool is_bad = tokens++ == bad;
      if (token->kind == UsbRecord::setup) {
        answer = token->data[1] != 6 ? Bytes{} : token->data[3] == 1 ? device : configuration;
        answer.resize(std::min<std::size_t>(answer.size(), token->data[6]));
        toggle = 1;
      }
      UsbAnswer said{.kind = UsbRecord::ack, .address = token->address, .data = {}};
      if (token->kind == UsbRecord::in)
        said = {.kind = (toggle == 1) != (is_bad && !stalls) ? UsbRecord::data1 : UsbRecord::data0,
                .address = token->address,
                .data = std::exchange(answer, {})};
      if (is_bad && (stalls || token->kind != UsbRecord::in)) said = {.kind = UsbRecord::stall, .data = {}};
      one.take({.kind = UsbRecord::nak, .data = {}}, tick);  // not yet
      if (!one.next(tick)) ADD_FAILURE() << "no token behind a refusal";
      one.take(said, tick);
    }
    EXPECT_EQ(one.state(), bad < 0 ? UsbEnumeration::State::done : UsbEnumeration::State::failed) << bad;
    EXPECT_FALSE(one.next(tick));
    return tokens;
  };
  const int tokens = run(-1, true);
  EXPECT_EQ(tokens, 3 + 2 + 3 + 3 + 2);
  for (int bad = 0; bad < tokens; ++bad)
    for (const bool stalls : {true, false}) run(bad, stalls);
}

TEST(UsbEnumeration, ADeviceThatOnlyRefusesIsGivenUp) {
  UsbEnumeration one;
  std::uint32_t tick = 0;
  for (; tick < 2000 && one.state() == UsbEnumeration::State::running; ++tick)
    if (one.next(tick)) one.take({.kind = UsbRecord::nak, .data = {}}, tick);
  EXPECT_EQ(one.state(), UsbEnumeration::State::failed);
  EXPECT_GT(tick, 400u);
}

}  // namespace
}  // namespace palpate::link
