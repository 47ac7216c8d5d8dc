#include "host/linearize/blas_lock.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <vector>

#include "host/linearize/whole_body_basis.hpp"
#include "host/msd/lattice.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

constexpr double k20Hz_rad_s = 2.0 * std::numbers::pi * 20.0;

// Sessions of one process share BLAS, which may be built for one thread (blas_lock.hpp).
TEST(BlasLock, LetsSeveralThreadsReduceABodyAtATime) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "the thread sanitizer does not see how CHOLMOD and libgomp synchronize their own threads";
#endif
  const Body body = make_lattice(test::reference_spec(8));
  std::vector<int> nodes;
  for (const int i : {3, 4})
    for (const int j : {3, 4}) nodes.push_back(body.lattice()->node(i, j, 7));
  const Shifts shifts({0.0}, {k20Hz_rad_s});
  const Eigen::MatrixXd alone = WholeBodyReduction(body, shifts).reduce(nodes).basis_1_sqrt_kg;
  constexpr int kThreads = 4, kRounds = 5;
  std::vector<int> same(kThreads);
  std::vector<std::thread> threads;
  for (int& count : same) {
    threads.emplace_back([&body, &nodes, &shifts, &alone, &count] {
      for (int round = 0; round < kRounds; ++round) {
        try {
          const Eigen::MatrixXd basis = WholeBodyReduction(body, shifts).reduce(nodes).basis_1_sqrt_kg;
          count += basis.rows() == alone.rows() && basis.cols() == alone.cols() && basis == alone;
        } catch (const std::invalid_argument&) {
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const int count : same) EXPECT_EQ(count, kRounds);
}

}  // namespace
}  // namespace palpate::host
