// Patches and situations that the tests of host/reference share.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <random>

#include "host/msd/test_bodies.hpp"
#include "host/reference/linear_patch.hpp"

namespace palpate::host::paper::test {

using host::test::reference_spec;

// The paper's 4x4x2 patch on top of a body of the reference material, at rest.
inline LinearPatch reference_patch(double damping_ratio, const PatchSize& size = {4, 4, 2}) {
  const Body body = make_lattice(reference_spec(6, damping_ratio));
  const BodyState rest = body.rest_state();
  return linear_patch(body, rest, nearest_surface_point(body, rest.position_m, {0.025, 0.025, 0.06}), size);
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Eigen::VectorXd vector(Eigen::Index size, double magnitude) {
    Eigen::VectorXd v(size);
    for (double& x : v) x = (*this)(-magnitude, magnitude);
    return v;
  }
  // Weights of a point inside a triangle.
  Eigen::Vector3d barycentric() {
    double a = (*this)(0, 1), b = (*this)(0, 1);
    if (a + b > 1) {
      a = 1 - a;
      b = 1 - b;
    }
    return {a, b, 1 - a - b};
  }
  std::mt19937& engine() { return engine_; }

 private:
  std::mt19937 engine_;
};

// Six nodes of which three in any order form a triangle of 5 to 15 mm; masses within 1:8; dense symmetric
// stiffness and damping of the reference material's size; a state in motion, with forces on all nodes.
inline LinearPatch random_patch(Random& random) {
  constexpr std::size_t kNodes = 6;
  const Eigen::Index kDofs{3 * kNodes};
  LinearPatch patch;
  std::array<int, kNodes> order{0, 1, 2, 3, 4, 5};
  std::shuffle(order.begin(), order.end(), random.engine());
  for (int n = 0; n < static_cast<int>(kNodes); ++n) patch.node.push_back(n);
  patch.corner = {{order[0], order[1], order[2]}};
  patch.mass_kg.resize(kDofs);
  for (Eigen::Index n = 0; n < kDofs / 3; ++n)
    patch.mass_kg.segment<3>(3 * n).setConstant(random(0.5e-3, 4e-3));
  patch.rest_position_m = random.vector(kDofs, 0.005);
  const Eigen::Quaterniond turn(Eigen::Vector4d(random.vector(4, 1.0)).normalized());
  const double size_m = random(0.005, 0.015);
  const Eigen::Vector3d corners[3] = {
      {0, 0, 0}, {size_m, random(-0.3, 0.3) * size_m, 0}, {random(-0.2, 1.2) * size_m, size_m, 0}};
  for (std::size_t k = 0; k < 3; ++k)
    patch.rest_position_m.segment<3>(3 * static_cast<Eigen::Index>(order[k])) = turn * corners[k];
  patch.rest_velocity_m_s = random.vector(kDofs, 0.1);
  patch.rest_force_N = random.vector(kDofs, 1.0);
  const auto negative_definite = [&random, kDofs](double magnitude) {
    Eigen::MatrixXd a(kDofs, kDofs);
    for (Eigen::Index c = 0; c < kDofs; ++c) a.col(c) = random.vector(kDofs, 1.0);
    return Eigen::MatrixXd(-magnitude / static_cast<double>(kDofs) * a * a.transpose());
  };
  patch.df_dx_N_m = negative_definite(500.0);
  patch.df_dv_N_s_m = negative_definite(1.0);
  return patch;
}

}  // namespace palpate::host::paper::test
