#include "host/linearize/projection.hpp"

#include <algorithm>
#include <array>

namespace palpate::host {
namespace {

// Sums of 4 rows apart: the additions do not wait for each other.
using Lanes = Eigen::Array4d;

double total(const Lanes& sum) {
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Two columns of Phi, and where those come from that are next.
struct Pair {
  const float *a, *b, *next_a, *next_b;
};

// a' e, a' f, b' e and b' f: every number is loaded once and used twice. The next columns are fetched
// meanwhile: with Phi in far caches that takes 132 us instead of 257 for 96 modes of 4,356 degrees of
// freedom.
std::array<double, 4> two_by_two(const Pair& phi, const double* e, const double* f, Eigen::Index rows) {
  const float *a = phi.a, *b = phi.b;
  Lanes ae = Lanes::Zero(), af = Lanes::Zero(), be = Lanes::Zero(), bf = Lanes::Zero();
  const auto four = [](const double* at) { return Eigen::Map<const Lanes>(at); };
  const auto wider = [](const float* at) { return Eigen::Map<const Eigen::Array4f>(at).cast<double>(); };
  Eigen::Index r = 0;
  for (; r + 4 <= rows; r += 4) {
    __builtin_prefetch(phi.next_a + r);
    __builtin_prefetch(phi.next_b + r);
    const Lanes x = wider(a + r), y = wider(b + r), u = four(e + r), v = four(f + r);
    ae += x * u;
    af += x * v;
    be += y * u;
    bf += y * v;
  }
  for (; r < rows; ++r) {
    const double x = a[r], y = b[r];
    ae[0] += x * e[r];
    af[0] += x * f[r];
    be[0] += y * e[r];
    bf[0] += y * f[r];
  }
  return {total(ae), total(af), total(be), total(bf)};
}

}  // namespace

Eigen::MatrixXd project(const Eigen::MatrixXf& basis, const Eigen::MatrixXd& excitation) {
  Eigen::MatrixXd modal(basis.cols(), excitation.cols());
  // The last column goes with itself where the number is odd.
  for (Eigen::Index e = 0; e < modal.cols(); e += 2) {
    const Eigen::Index f = std::min(e + 1, modal.cols() - 1);
    for (Eigen::Index m = 0; m < modal.rows(); m += 2) {
      const auto column = [&](Eigen::Index c) { return basis.col(std::min(c, modal.rows() - 1)).data(); };
      const Eigen::Index n = std::min(m + 1, modal.rows() - 1);
      const auto [me, mf, ne, nf] =
          two_by_two({column(m), column(n), column(m + 2), column(m + 3)}, excitation.col(e).data(),
                     excitation.col(f).data(), basis.rows());
      modal(m, e) = me;
      modal(m, f) = mf;
      modal(n, e) = ne;
      modal(n, f) = nf;
    }
  }
  return modal;
}

}  // namespace palpate::host
