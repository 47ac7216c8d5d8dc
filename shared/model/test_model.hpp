// A small local model for tests: a square of four nodes on two triangles whose modes are random but
// orthogonal.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "shared/model/local_model.hpp"
#include "shared/model/modal_surface.hpp"

namespace palpate::test {

// exp(G h) - I and the response to a constant input of q'' = -lambda q - d q' + u, by a Taylor series in long
// double over 1/1024 of the step and ten squarings: independent of the host's own discretization.
inline std::array<double, 6> exact_coefficients(double lambda, double d, double step_s) {
  using Matrix = std::array<std::array<long double, 3>, 3>;
  const auto product = [](const Matrix& a, const Matrix& b) {
    Matrix c{};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
    return c;
  };
  const long double h = static_cast<long double>(step_s) / 1024.0L;
  const auto l = static_cast<long double>(lambda), b = static_cast<long double>(d);
  const Matrix g{{{0, h, 0}, {-l * h, -b * h, h}, {0, 0, 0}}};
  Matrix term = g, sum = g;  // exp - I
  for (int n = 2; n < 30; ++n) {
    term = product(term, g);
    for (auto& row : term)
      for (auto& value : row) value /= n;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) sum[i][j] += term[i][j];
  }
  for (int s = 0; s < 10; ++s) {
    const Matrix square = product(sum, sum);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) sum[i][j] = 2 * sum[i][j] + square[i][j];
  }
  const auto value = [&](std::size_t i, std::size_t j) { return static_cast<double>(sum[i][j]); };
  return {value(0, 0), value(0, 1), value(1, 0), value(1, 1), value(0, 2), value(1, 2)};
}

struct TestModel {
  std::vector<float> position_m{0, 0, 0, 0.01f, 0, 0, 0.01f, 0.01f, 0, 0, 0.01f, 0};
  std::vector<std::uint8_t> corner{0, 1, 2, 0, 2, 3};
  std::vector<std::uint16_t> triangle_id{7, 9};
  std::vector<float> static_friction{0.5f}, kinetic_friction{0.5f};
  std::vector<std::uint8_t> triangle_friction{0, 0};
  std::vector<float> coefficient, load, scale;
  std::vector<std::int16_t> basis;
  ModalState state;
  LocalModelView view;

  // 12 modes of four masses in 3D: a random rotation of node displacements, each mode with its own frequency.
  TestModel(double mass_kg, double lowest_rad_s, double highest_rad_s, double damping_ratio,
            unsigned seed = 1) {
    constexpr std::size_t kModes = 12;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::array<std::array<double, kModes>, kModes> q{};
    for (std::size_t m = 0; m < kModes; ++m) {  // Gram-Schmidt
      for (auto& value : q[m]) value = normal(random);
      for (std::size_t k = 0; k < m; ++k) {
        double overlap = 0;
        for (std::size_t i = 0; i < kModes; ++i) overlap += q[m][i] * q[k][i];
        for (std::size_t i = 0; i < kModes; ++i) q[m][i] -= overlap * q[k][i];
      }
      double length = 0;
      for (double value : q[m]) length += value * value;
      for (double& value : q[m]) value /= std::sqrt(length);
    }
    basis.resize(kModes * kModes);
    for (std::size_t m = 0; m < kModes; ++m) {
      const double ratio = static_cast<double>(m) / (kModes - 1);
      const double omega = lowest_rad_s * std::pow(highest_rad_s / lowest_rad_s, ratio);
      // Dampers in parallel to the springs: damping proportional to stiffness, `damping_ratio` at the highest
      // mode.
      const double d = 2 * damping_ratio * omega * omega / highest_rad_s;
      for (double c : exact_coefficients(omega * omega, d, 1e-3))
        coefficient.push_back(static_cast<float>(c));
      load.push_back(0.0f);
      double largest = 0;
      for (double value : q[m]) largest = std::max(largest, std::abs(value));
      const double step = largest / std::sqrt(mass_kg) / 32767.0;
      scale.push_back(static_cast<float>(step));
      for (std::size_t row = 0; row < kModes; ++row)
        basis[row * kModes + m] =
            static_cast<std::int16_t>(std::lround(q[m][row] / std::sqrt(mass_kg) / step));
    }
    view.modes = kModes;
    view.nodes = 4;
    view.surface_nodes = 4;
    view.triangles = 2;
    view.position_m = position_m.data();
    view.corner = corner.data();
    view.triangle_id = triangle_id.data();
    view.frictions = static_friction.size();
    view.static_friction = static_friction.data();
    view.kinetic_friction = kinetic_friction.data();
    view.triangle_friction = triangle_friction.data();
    view.coefficient = coefficient.data();
    view.load = load.data();
    view.basis_scale = scale.data();
    view.basis = basis.data();
  }
  TestModel(const TestModel&) = delete;
  TestModel& operator=(const TestModel&) = delete;
};

// Springs between all nodes of a TestModel, of two kinds, resting at positions of their own.
struct TestSprings {
  std::vector<float> rest_m;
  std::vector<std::uint8_t> end, kind;
  std::vector<float> stiffness_N_m{100.0f, 70.0f}, damping_N_s_m{0.4f, 0.3f}, length_m{0.01f, 0.014f};

  explicit TestSprings(TestModel& model) : rest_m(model.position_m) {
    rest_m[2] += 1e-3f;
    rest_m[4] -= 2e-3f;
    for (std::uint8_t j = 1; j < 4; ++j) {
      for (std::uint8_t i = 0; i < j; ++i) {
        end.insert(end.end(), {i, j});
        kind.push_back((j - i) % 2 == 0 ? 1 : 0);
      }
    }
    LocalModelView& view = model.view;
    view.springs = kind.size();
    view.rest_m = rest_m.data();
    view.spring_end = end.data();
    view.spring_kind = kind.data();
    view.spring_kinds = stiffness_N_m.size();
    view.spring_stiffness_N_m = stiffness_N_m.data();
    view.spring_damping_N_s_m = damping_N_s_m.data();
    view.spring_length_m = length_m.data();
  }
  TestSprings(const TestSprings&) = delete;
  TestSprings& operator=(const TestSprings&) = delete;
};

}  // namespace palpate::test
