#include "host/linearize/basis_store.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "host/linearize/test_folder.hpp"
#include "host/msd/lattice.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

namespace fs = std::filesystem;

class Store : public testing::Test {
 protected:
  [[nodiscard]] Ports ports(int i) const {
    const LatticeShape& lattice = *body_.lattice();
    return {lattice.node(i, 1, 4), lattice.node(i + 1, 1, 4), lattice.node(i, 2, 4)};
  }
  [[nodiscard]] fs::path only_file() const { return fs::directory_iterator(folder_.path())->path(); }

  Body body_ = make_lattice(test::reference_spec(5));
  std::vector<double> shifts_{0.0, 100.0};
  test::Folder folder_;
  BasisCacheConfig cache_{folder_.path()};
};

bool same(const StoredBasis& a, const StoredBasis& b) {
  return a.lambda_rad2_s2 == b.lambda_rad2_s2 && a.damping_1_s == b.damping_1_s &&
         a.basis_1_sqrt_kg == b.basis_1_sqrt_kg;
}

TEST_F(Store, IsTheReduction) {
  BasisStore store(body_, shifts_);
  const StoredBasis direct = stored(WholeBodyReduction(body_, shifts_).reduce(ports(1)));
  EXPECT_TRUE(same(*store.basis(ports(1)), direct));
  (void)store.basis(ports(1));
  EXPECT_EQ(store.counts().computed, 1U);
}

TEST_F(Store, GivesTheSameBitsWithAndWithoutFiles) {
  BasisStore without(body_, shifts_), first(body_, shifts_, cache_), second(body_, shifts_, cache_);
  const auto computed = without.basis(ports(1)), written = first.basis(ports(1)),
             read = second.basis(ports(1));
  EXPECT_EQ(first.counts().computed, 1U);
  EXPECT_EQ(second.counts().computed, 0U);
  EXPECT_EQ(second.counts().read, 1U);
  EXPECT_TRUE(same(*computed, *written));
  EXPECT_TRUE(same(*computed, *read));
  // Another body's are not mistaken for it.
  LatticeSpec harder = test::reference_spec(5);
  harder.stiffness_N_m *= 2.0;
  const Body other = make_lattice(harder);
  BasisStore third(other, shifts_, cache_);
  EXPECT_FALSE(same(*computed, *third.basis(ports(1))));
  EXPECT_EQ(third.counts().computed, 1U);
}

TEST_F(Store, ComputesAnewWhatIsDamaged) {
  StoredBasis good;
  {
    BasisStore store(body_, shifts_, cache_);
    good = *store.basis(ports(1));
  }
  {
    std::fstream file(only_file(), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(200);
    file.put('\x5a');
  }
  {
    BasisStore store(body_, shifts_, cache_);
    EXPECT_TRUE(same(*store.basis(ports(1)), good));
    EXPECT_EQ(store.counts().computed, 1U);
    EXPECT_EQ(store.counts().refused, 1U);
    EXPECT_NE(store.counts().problem.find("damaged"), std::string::npos);
  }
  // And put in its place.
  BasisStore store(body_, shifts_, cache_);
  EXPECT_TRUE(same(*store.basis(ports(1)), good));
  EXPECT_EQ(store.counts().read, 1U);
}

TEST_F(Store, WorksWithoutAFolderItCanWrite) {
  const fs::path no_folder = folder_.path() / "file";
  std::ofstream(no_folder) << "in the way";
  BasisStore store(body_, shifts_, BasisCacheConfig{no_folder});
  EXPECT_GT(store.basis(ports(1))->lambda_rad2_s2.size(), 0);
  EXPECT_EQ(store.counts().unsaved, 1U);
  EXPECT_NE(store.counts().problem, "");
}

TEST_F(Store, ComputesInTheBackgroundWhatIsRequested) {
  BasisStore store(body_, shifts_);
  EXPECT_EQ(store.find(ports(0)), nullptr);
  store.request({ports(0), ports(1)});
  while (!store.find(ports(1))) std::this_thread::yield();
  EXPECT_NE(store.find(ports(0)), nullptr);
  EXPECT_EQ(store.counts().computed, 2U);
}

TEST_F(Store, ServesSeveralThreads) {
  BasisStore store(body_, shifts_, cache_);
  std::vector<std::thread> users;
  for (int u = 0; u < 4; ++u) {
    users.emplace_back([&, u] {
      for (int round = 0; round < 3; ++round) {
        store.request({ports((u + round) % 3), ports((u + round + 1) % 3)});
        EXPECT_NE(store.basis(ports((u + 2 * round) % 3)), nullptr);
      }
    });
  }
  for (std::thread& user : users) user.join();
  EXPECT_LE(store.counts().computed, 3U);
}

TEST_F(Store, StopsWithWorkLeft) {
  BasisStore store(body_, shifts_);
  store.request({ports(0), ports(1), ports(2)});
}

TEST_F(Store, SaysWhatCannotBeComputed) {
  EXPECT_THROW(BasisStore(body_, {}), std::invalid_argument);
  LatticeSpec loose = test::reference_spec(5);
  loose.neighbours = Neighbours::axis;
  const Body floating = make_lattice(loose);
  BasisStore store(floating, shifts_);
  EXPECT_THROW((void)store.basis(ports(1)), std::invalid_argument);
  EXPECT_THROW((void)store.find(ports(1)), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::host
