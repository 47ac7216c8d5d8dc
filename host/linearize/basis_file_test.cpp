#include "host/linearize/basis_file.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "host/linearize/basis_cache.hpp"
#include "host/linearize/test_folder.hpp"

namespace palpate::host {
namespace {

namespace fs = std::filesystem;
constexpr BasisKey kKey{1, 2};
constexpr Eigen::Index kDofs = 11, kModes = 3;

StoredBasis some_basis() {
  return {Eigen::VectorXd::Random(kModes), Eigen::MatrixXd::Random(kModes, kModes),
          Eigen::MatrixXf::Random(kDofs, kModes)};
}

bool same(const StoredBasis& a, const StoredBasis& b) {
  return a.lambda_rad2_s2 == b.lambda_rad2_s2 && a.damping_1_s == b.damping_1_s &&
         a.basis_1_sqrt_kg == b.basis_1_sqrt_kg;
}

std::vector<char> content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void replace(const fs::path& file, const std::vector<char>& bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc).write(bytes.data(), std::ssize(bytes));
}

// The reason, or "used".
std::string verdict(const fs::path& file, const BasisKey& key = kKey, Eigen::Index dofs = kDofs) {
  const auto read = read_basis_file(file, key, dofs, kModes);
  const auto* refused = std::get_if<Refusal>(&read);
  return refused ? refused->reason : "used";
}

class BasisFile : public testing::Test {
 protected:
  test::Folder folder_;
  fs::path file_ = folder_.path() / "some.basis";
  StoredBasis basis_ = some_basis();
};

TEST_F(BasisFile, GivesBackTheSameBits) {
  ASSERT_EQ(write_basis_file(file_, kKey, basis_), "");
  const auto read = read_basis_file(file_, kKey, kDofs, kModes);
  ASSERT_TRUE(std::holds_alternative<StoredBasis>(read));
  EXPECT_TRUE(same(std::get<StoredBasis>(read), basis_));
  // Nothing else is left behind.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), {}), 1);
  // The format's own account of its length (basis_file.hpp).
  EXPECT_EQ(fs::file_size(file_), 40U + 8U * 3U + 8U * 9U + 4U * 33U + 4U);
}

TEST_F(BasisFile, IsNeverUsedWithAFlippedBit) {
  ASSERT_EQ(write_basis_file(file_, kKey, basis_), "");
  const std::vector<char> good = content(file_);
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::vector<char> bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    replace(file_, bad);
    ASSERT_NE(verdict(file_), "used") << "byte " << at;
  }
}

TEST_F(BasisFile, IsNeverUsedCutOffOrLonger) {
  ASSERT_EQ(write_basis_file(file_, kKey, basis_), "");
  const std::vector<char> good = content(file_);
  for (std::size_t length = 0; length < good.size(); ++length) {
    replace(file_, {good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length)});
    ASSERT_NE(verdict(file_).find("cut off"), std::string::npos) << length << " bytes";
  }
  std::vector<char> longer = good;
  longer.push_back(0);
  replace(file_, longer);
  EXPECT_NE(verdict(file_).find("too long"), std::string::npos);
}

TEST_F(BasisFile, SaysWhatIsWrong) {
  EXPECT_NE(verdict(file_).find("cannot be read"), std::string::npos);
  ASSERT_EQ(write_basis_file(file_, kKey, basis_), "");
  EXPECT_NE(verdict(file_, {1, 3}).find("something else"), std::string::npos);
  EXPECT_NE(verdict(file_, kKey, 12).find("11 degrees of freedom"), std::string::npos);
  std::vector<char> bytes = content(file_);
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  replace(file_, bytes);
  EXPECT_NE(verdict(file_).find("damaged"), std::string::npos);
  bytes[8] = 2;
  replace(file_, bytes);
  EXPECT_NE(verdict(file_).find("version 2"), std::string::npos);
  bytes[0] = 'x';
  replace(file_, bytes);
  EXPECT_EQ(verdict(file_), "is no basis");
}

TEST_F(BasisFile, CannotBeWrittenWhereThereIsNoFolder) {
  EXPECT_NE(write_basis_file(folder_.path() / "none" / "some.basis", kKey, basis_), "");
}

TEST_F(BasisFile, TheCacheDropsWhatWasUnusedForLongest) {
  // Room for two.
  BasisCache cache({folder_.path(), 2 * basis_.bytes() + 100});
  std::string refusal;
  const auto has = [&](std::uint64_t key) {
    return cache.load({0, key}, kDofs, kModes, refusal).has_value();
  };
  const auto age = [&](std::uint64_t key, int hours) {
    fs::last_write_time(folder_.path() / (BasisKey{0, key}.hex() + ".basis"),
                        fs::file_time_type::clock::now() - std::chrono::hours(hours));
  };
  ASSERT_EQ(cache.save({0, 1}, basis_), "");
  ASSERT_EQ(cache.save({0, 2}, basis_), "");
  age(1, 2);
  age(2, 1);
  EXPECT_TRUE(has(1));  // used now
  ASSERT_EQ(cache.save({0, 3}, basis_), "");
  EXPECT_TRUE(has(1));
  EXPECT_FALSE(has(2));
  EXPECT_TRUE(has(3));
  EXPECT_EQ(refusal, "");
  // What can never fit is not written, and displaces nothing.
  BasisCache small({folder_.path(), 10});
  EXPECT_EQ(small.save({0, 4}, basis_), "");
  EXPECT_TRUE(has(1));
  EXPECT_FALSE(has(4));
}

}  // namespace
}  // namespace palpate::host
