#include "firmware/core/basis_store.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "shared/wire/packed_model.hpp"

namespace palpate::firmware {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct Basis {
  explicit Basis(std::size_t length, unsigned seed) : bytes(length) {
    std::mt19937 random(seed);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    id = wire::basis_id(bytes);
  }
  [[nodiscard]] std::vector<palpate_ModelPart_1_0> parts() const { return wire::parts_of(bytes, id); }
  Bytes bytes;
  std::uint32_t id;
};

class BasisStoreTest : public ::testing::Test {
 protected:
  void add(const palpate_ModelPart_1_0& part, std::uint32_t in_use = 0) { note(store_->add(part, in_use)); }
  void add_all(const Basis& basis, std::uint32_t in_use = 0) {
    for (const auto& part : basis.parts()) add(part, in_use);
  }
  void check() { note(store_->check()); }
  void expect_complete(const Basis& basis) {
    const std::uint32_t slot = store_->find_complete(basis.id);
    ASSERT_NE(slot, BasisStore::kNone);
    const auto bytes = store_->bytes(slot);
    EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), basis.bytes.begin(), basis.bytes.end()));
    EXPECT_EQ(store_->held(slot), basis.id);
  }
  void expect_event(std::uint32_t id, Status status) {
    ASSERT_EQ(events_.size(), 1u);
    EXPECT_EQ(events_[0].id, id);
    EXPECT_EQ(events_[0].status, status);
    events_.clear();
  }
  void note(const BasisStore::Events& events) {
    events_.insert(events_.end(), events.event.begin(),
                   events.event.begin() + static_cast<std::ptrdiff_t>(events.count));
  }

  std::unique_ptr<BasisStore> store_ = std::make_unique<BasisStore>();
  std::vector<BasisStore::Event> events_;
};

TEST_F(BasisStoreTest, PiecesInOrderMakeABasis) {
  for (const std::size_t length : {std::size_t{1}, std::size_t{256}, std::size_t{257}, std::size_t{1024},
                                   std::size_t{13'001}, wire::kMaxBasisBytes}) {
    const Basis basis(length, static_cast<unsigned>(length));
    EXPECT_EQ(store_->find_complete(basis.id), BasisStore::kNone);
    add_all(basis);
    expect_event(basis.id, Status::ok);
    expect_complete(basis);
  }
}

// Lost, twice, and in any order, of any length: 200 random ways, with the missing ones sent again as asked.
TEST_F(BasisStoreTest, PiecesInAnyOrderMakeABasis) {
  std::mt19937 random(3);
  for (unsigned trial = 0; trial < 200; ++trial) {
    const Basis basis(1 + random() % wire::kMaxBasisBytes, 1000 + trial);
    std::vector<palpate_ModelPart_1_0> parts;
    for (std::uint16_t block = 0; block * kBasisBlockBytes < basis.bytes.size();) {
      const std::size_t blocks = 1 + random() % 4;
      parts.push_back(wire::part_of(basis.bytes, basis.id, block, blocks));
      block = static_cast<std::uint16_t>(block + blocks);
    }
    std::shuffle(parts.begin(), parts.end(), random);
    for (const auto& part : parts) {
      if (random() % 8 == 0) continue;
      add(part);
      if (random() % 8 == 0) add(part);
    }
    BasisStore::Blocks missing;
    const std::size_t length = store_->missing(basis.id, missing);
    for (std::uint16_t block = 0; block * kBasisBlockBytes < basis.bytes.size(); ++block)
      if (length == 0 || (unsigned{missing[block / 8]} >> block % 8 & 1u) != 0u)
        add(wire::part_of(basis.bytes, basis.id, block, 1));
    for (int run = 0; run < 8; ++run) check();
    expect_complete(basis);
    EXPECT_EQ(std::count_if(
                  events_.begin(), events_.end(),
                  [](const auto& e) { return e.status != Status::ok && e.status != Status::basis_missing; }),
              0);
    events_.clear();
  }
}

TEST_F(BasisStoreTest, TheLastPieceSaysWhatIsMissing) {
  const Basis basis(5000, 1);
  const auto parts = basis.parts();
  add(parts[0]);
  add(parts[4]);
  expect_event(basis.id, Status::basis_missing);
  BasisStore::Blocks missing;
  EXPECT_EQ(store_->missing(basis.id, missing), 5000u);
  EXPECT_EQ(missing[0], 0xF0);
  EXPECT_EQ(missing[1], 0xFF);
  EXPECT_EQ(missing[2], 0x00);
  EXPECT_EQ(store_->missing(12345, missing), 0u);
}

TEST_F(BasisStoreTest, TheLastPieceOfACompleteBasisIsAnswered) {
  const Basis basis(3000, 1);
  add_all(basis);
  events_.clear();
  add(basis.parts()[0]);
  EXPECT_TRUE(events_.empty());
  add(basis.parts()[2]);
  expect_event(basis.id, Status::ok);
}

TEST_F(BasisStoreTest, OtherBytesThanTheIdentifierSaysAreRefused) {
  const Basis basis(3000, 1);
  for (const auto& part : basis.parts()) {
    auto bad = part;
    if (part.first_block == 4) bad.data.elements[5] ^= 1u;
    add(bad);
  }
  expect_event(basis.id, Status::basis_crc_mismatch);
  EXPECT_EQ(store_->find_complete(basis.id), BasisStore::kNone);
  add_all(basis);
  expect_event(basis.id, Status::ok);
}

TEST_F(BasisStoreTest, PiecesThatDoNotFitAreRefused) {
  const Basis basis(3000, 1);
  const auto expect_invalid = [&](const auto& spoil) {
    palpate_ModelPart_1_0 part = basis.parts()[1];
    spoil(part);
    add(part);
    expect_event(part.basis_id, Status::basis_part_invalid);
  };
  expect_invalid([](auto& part) { part.basis_id = 0; });
  expect_invalid([](auto& part) { part.basis_bytes = wire::kMaxBasisBytes + 1; });
  expect_invalid([](auto& part) { part.data.count = 0; });
  expect_invalid([](auto& part) { part.data.count = 700; });
  expect_invalid([](auto& part) { part.first_block = 8; });
  expect_invalid([](auto& part) { part.first_block = 65535; });
  add(basis.parts()[0]);
  expect_invalid([](auto& part) { part.basis_bytes = 4000; });
  add_all(basis);
  expect_event(basis.id, Status::ok);
}

TEST_F(BasisStoreTest, ANewOneTakesTheRoomThatWasAskedForLongestAgo) {
  const Basis a(2000, 1), b(2000, 2), c(2000, 3), d(2000, 4), e(2000, 5);
  for (const Basis* basis : {&a, &b, &c}) add_all(*basis);
  const std::uint32_t slot_of_b = store_->find_complete(b.id);
  (void)store_->find_complete(c.id);
  (void)store_->find_complete(a.id);
  events_.clear();
  add_all(d, 1u << slot_of_b);  // b is the oldest, but in use: c goes
  expect_event(d.id, Status::ok);
  expect_complete(a);
  expect_complete(b);
  EXPECT_EQ(store_->find_complete(c.id), BasisStore::kNone);
  // Both others in use: what is under way in the third is dropped, and that is said.
  const std::uint32_t in_use = 1u << store_->find_complete(a.id) | 1u << slot_of_b;
  add(e.parts()[0], in_use);
  add(c.parts()[0], in_use);
  expect_event(e.id, Status::basis_dropped);
  expect_complete(a);
  expect_complete(b);
}

TEST_F(BasisStoreTest, TakesNothingWhereAllSlotsAreInUse) {
  std::vector<Basis> bases;
  for (unsigned seed = 1; seed <= kBasisSlots; ++seed) add_all(bases.emplace_back(2000, seed));
  events_.clear();
  const Basis another(2000, 77);
  add_all(another, (1u << kBasisSlots) - 1u);
  expect_event(another.id, Status::basis_dropped);
  for (const Basis& basis : bases) {
    expect_complete(basis);
    EXPECT_EQ(store_->slot_bit(basis.id), 1u << store_->find_complete(basis.id));
  }
  EXPECT_EQ(store_->slot_bit(another.id), 0u);
}

// Where the first piece comes last the CRC of the rest is left: bounded work in each run.
TEST_F(BasisStoreTest, TheCrcIsTakenInPieces) {
  const Basis basis(wire::kMaxBasisBytes, 1);
  const auto parts = basis.parts();
  for (std::size_t i = parts.size(); i-- > 0;) add(parts[i]);
  events_.clear();
  std::size_t runs = 0;
  for (; store_->find_complete(basis.id) == BasisStore::kNone; ++runs) {
    ASSERT_LT(runs, 10u);
    check();
  }
  EXPECT_EQ(runs, (wire::kMaxBasisBytes - 1) / kCheckedBytesPerRun);
  expect_event(basis.id, Status::ok);
}

}  // namespace
}  // namespace palpate::firmware
