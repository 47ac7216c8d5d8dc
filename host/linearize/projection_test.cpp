#include "host/linearize/projection.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <limits>

namespace palpate::host {
namespace {

TEST(Project, IsTheProductOfAnySize) {
  for (const int rows : {0, 1, 4, 7, 131}) {
    for (const int modes : {0, 1, 2, 5, 48}) {
      for (const int columns : {1, 2, 3}) {
        const Eigen::MatrixXf basis = Eigen::MatrixXf::Random(rows, modes);
        const Eigen::MatrixXd excitation = Eigen::MatrixXd::Random(rows, columns);
        const Eigen::MatrixXd exact = basis.cast<double>().transpose() * excitation;
        const Eigen::MatrixXd modal = project(basis, excitation);
        ASSERT_EQ(modal.rows(), modes);
        ASSERT_EQ(modal.cols(), columns);
        // Numbers up to 1: each sum of `rows` products rounds by at most rows^2 epsilon.
        if (modal.size() > 0) {
          EXPECT_LE((modal - exact).cwiseAbs().maxCoeff(),
                    2.0 * rows * rows * std::numeric_limits<double>::epsilon());
        }
      }
    }
  }
}

}  // namespace
}  // namespace palpate::host
