#include "host/session/basis_sender.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <random>
#include <vector>

#include "firmware/core/basis_store.hpp"

namespace palpate::host {
namespace {

BasisSender::Bytes random_bytes(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  auto bytes = std::make_shared<std::vector<std::uint8_t>>(count);
  for (std::uint8_t& byte : *bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

palpate_BasisReport_1_0 report_of(firmware::BasisStore& store, const firmware::BasisStore::Event& event) {
  palpate_BasisReport_1_0 report{};
  report.basis_id = event.id;
  report.status = static_cast<std::uint8_t>(event.status);
  firmware::BasisStore::Blocks missing;
  report.basis_bytes = static_cast<std::uint32_t>(store.missing(event.id, missing));
  if (event.status != Status::ok && report.basis_bytes != 0) {
    report.missing.count = missing.size();
    std::copy(missing.begin(), missing.end(), report.missing.elements);
  }
  for (std::uint32_t slot = 0; slot < firmware::kBasisSlots; ++slot)
    if (store.held(slot) != 0) report.held.elements[report.held.count++] = store.held(slot);
  return report;
}

TEST(BasisSender, SendsEachPieceOnce) {
  BasisSender sender;
  EXPECT_FALSE(sender.busy());
  EXPECT_FALSE(sender.next(4, 0));
  const auto bytes = random_bytes(5000, 1);
  sender.begin(77, bytes);
  EXPECT_TRUE(sender.busy());
  std::vector<std::uint8_t> sent;
  std::uint32_t tick = 0;
  while (const auto part = sender.next(3, tick++)) {
    EXPECT_EQ(part->first_block * 256u, sent.size());
    EXPECT_EQ(part->basis_bytes, 5000u);
    sent.insert(sent.end(), part->data.elements, part->data.elements + part->data.count);
  }
  EXPECT_EQ(sent, *bytes);
  palpate_BasisReport_1_0 report{};
  report.basis_id = 77;
  report.held.count = 1;
  report.held.elements[0] = 77;
  sender.take(report);
  EXPECT_FALSE(sender.busy());
  EXPECT_TRUE(sender.is_held(77));
  EXPECT_FALSE(sender.next(3, tick + 1000));
}

// Against the board's own store, over a line that loses every third message in both directions and swaps
// neighbours: all arrive, and every one is said to be held.
TEST(BasisSender, LossesAreMadeUpFor) {
  std::mt19937 random(5);
  const auto store = std::make_unique<firmware::BasisStore>();
  BasisSender sender;
  for (unsigned basis = 0; basis < 20; ++basis) {
    const auto bytes = random_bytes(1 + random() % wire::kMaxBasisBytes, basis);
    const std::uint32_t id = wire::basis_id(*bytes);
    sender.begin(id, bytes);
    std::deque<palpate_ModelPart_1_0> line;
    std::uint32_t tick = 0;
    for (; sender.busy(); ++tick) {
      ASSERT_LT(tick, 20'000u);
      if (const auto part = sender.next(4, tick)) {
        if (random() % 3 != 0) line.push_back(*part);
        if (line.size() > 1 && random() % 3 == 0) std::swap(line[line.size() - 1], line[line.size() - 2]);
      }
      firmware::BasisStore::Events events;
      if (line.size() > 2 || (tick % 10 == 0 && !line.empty())) {
        events = store->add(line.front(), 0);
        line.pop_front();
      } else {
        events = store->check();
      }
      for (std::size_t i = 0; i < events.count; ++i)
        if (random() % 3 != 0) sender.take(report_of(*store, events.event[i]));
    }
    EXPECT_TRUE(sender.is_held(id));
    EXPECT_NE(store->find_complete(id), firmware::BasisStore::kNone);
  }
}

TEST(BasisSender, ABoardThatHasForgottenIsToldAll) {
  BasisSender sender;
  sender.begin(77, random_bytes(1000, 1));
  while (sender.next(4, 0)) {
  }
  palpate_BasisReport_1_0 report{};
  report.basis_id = 77;
  report.held.count = 1;
  report.held.elements[0] = 77;
  sender.take(report);
  ASSERT_FALSE(sender.busy());
  report.status = static_cast<std::uint8_t>(Status::basis_missing);
  report.held.count = 0;
  sender.take(report);
  EXPECT_TRUE(sender.busy());
  std::size_t bytes = 0;
  while (const auto part = sender.next(4, 0)) bytes += part->data.count;
  EXPECT_EQ(bytes, 1000u);
}

}  // namespace
}  // namespace palpate::host
