// The contact with the board's model of a real body does not ring at half the tick rate
// (docs/decisions/contact_output.md). The tip steps by 0.1 mm within one tick.
//
// The alternating part of a sequence f is |f[k] - 2 f[k+1] + f[k+2]| / 4. That also counts what is no ringing
// of the contact: a body that is hardly damped rings on by itself, here with up to 1.13 rad a tick, and the
// second difference shows sin(1.13 / 2)^2 = 29 % of it. So the part that alternates is taken
//   - at all damping ratios with the eighth difference / 256, which leaves sin(1.13 / 2)^8 = 0.7 % of it;
//   - with the second difference where the body's own ringing has died away within ten ticks;
//   - from the poles of the sampled system under the constraint: those that turn by more than 90 degrees a
//     tick.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <ostream>
#include <vector>

#include "host/bench/board_patch.hpp"
#include "host/msd/test_bodies.hpp"
#include "shared/contact/contact.hpp"
#include "shared/model/modal_surface.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host::bench {
namespace {

constexpr double kStepIn_m = 1e-4;
constexpr double kPreload_m = 1e-3;
constexpr double kTop_m = 0.07;  // of a body of 8 nodes a side
constexpr double kSticks = 1e6, kSlides = 0.0;
constexpr std::size_t kWithin_ticks = 10;
constexpr double kAlternating = 0.01;  // of the first sample

struct Material {
  double stiffness_N_m;
  double damping_ratio;
};
void PrintTo(const Material& material, std::ostream* out) {
  *out << material.stiffness_N_m << " N/m, damping ratio " << material.damping_ratio;
}

Body body_of(const Material& material) {
  LatticeSpec spec = test::reference_spec(8);
  spec.stiffness_N_m = material.stiffness_N_m;
  spec.damping_N_s_m = damping_from_ratio(material.damping_ratio, spec.mass_kg, spec.stiffness_N_m);
  return make_lattice(spec);
}

// Beside a node, the middle of an edge, the middle of a triangle.
const std::array<Vec3d, 3> kPlaces{
    {{0.0301, 0.0302, kTop_m}, {0.035, 0.03, kTop_m}, {0.03 + 0.01 / 3, 0.03 + 0.02 / 3, kTop_m}}};

// The runtime's patch around a place, with the tip on it.
class Probe {
 public:
  Probe(const Body& body, const Vec3d& place_m, double friction)
      : place_m_(place_m),
        patch_(body, body.rest_state(), to_eigen(place_m), SurfaceKind::smooth, friction),
        tip_(at(-kAbove_m)) {
    surface_.bind(patch_.view(), patch_.state());
    to(-kAbove_m, 1);
  }
  // Moves the tip to a depth in so many ticks.
  void to(double depth_m, int ticks) {
    const Vec3f from = tip_, end = at(depth_m);
    for (int i = 1; i <= ticks; ++i) {
      const Vec3f next = from + (end - from) * (static_cast<float>(i) / static_cast<float>(ticks));
      step_contact(surface_, contact_, ContactLaw<float>{}, tip_, next);
      tip_ = next;
    }
  }
  [[nodiscard]] bool touches() const { return contact_.mode != ContactMode::free; }
  [[nodiscard]] double pressing_N() const {
    return -static_cast<double>(dot(contact_.normal, contact_.force_N));
  }

 private:
  static constexpr double kAbove_m = 1e-6;
  [[nodiscard]] Vec3f at(double depth_m) const {
    return patch_.to_patch({place_m_.x, place_m_.y, place_m_.z - depth_m});
  }
  Vec3d place_m_;
  BoardPatch patch_;
  ModalSurface surface_;
  ContactState<float> contact_{};
  Vec3f tip_;
};

double second_difference(const std::vector<double>& f, std::size_t k) {
  return std::abs(f[k] - 2.0 * f[k + 1] + f[k + 2]) / 4.0;
}

double eighth_difference(const std::vector<double>& f, std::size_t k) {
  constexpr std::array<double, 9> kBinomial{1, -8, 28, -56, 70, -56, 28, -8, 1};
  double sum = 0;
  for (std::size_t i = 0; i < kBinomial.size(); ++i) sum += kBinomial[i] * f[k + i];
  return std::abs(sum) / 256.0;
}

class TipStep : public ::testing::TestWithParam<Material> {};

TEST_P(TipStep, DoesNotAlternateNorPull) {
  const Body body = body_of(GetParam());
  for (const Vec3d& place_m : kPlaces) {
    for (const double friction : {kSticks, kSlides}) {
      for (const double preload_m : {0.0, kPreload_m}) {
        SCOPED_TRACE(::testing::Message() << "at " << place_m.x << ", " << place_m.y << " m, friction "
                                          << friction << ", preload " << preload_m << " m");
        Probe probe(body, place_m, friction);
        if (preload_m > 0.0) {
          probe.to(preload_m, 1000);
          probe.to(preload_m, 2000);
          ASSERT_TRUE(probe.touches());
        }
        const double before_N = preload_m > 0.0 ? probe.pressing_N() : 0.0;
        std::vector<double> force_N;
        int without = 0;
        for (int tick = 0; tick < 60; ++tick) {
          probe.to(preload_m + kStepIn_m, 1);
          force_N.push_back(probe.pressing_N());
          EXPECT_GE(force_N.back(), 0.0) << "tick " << tick;
          without += !probe.touches();
          // A surface that a step from rest has set in motion, 0.1 m/s, flies off the tip: nothing pulls. It
          // comes back within a quarter of the slowest mode's period (0.45 rad a tick at 100 N/m).
          if (tick >= 10) {
            EXPECT_TRUE(probe.touches()) << "tick " << tick;
          }
        }
        if (preload_m > 0.0) {
          EXPECT_EQ(without, 0);
        }
        const double first_N = std::abs(force_N.front() - before_N);
        for (std::size_t k = kWithin_ticks; k + 9 <= force_N.size(); ++k) {
          EXPECT_LT(eighth_difference(force_N, k), kAlternating * first_N) << "tick " << k;
          if (GetParam().damping_ratio >= 0.1) {
            EXPECT_LT(second_difference(force_N, k), kAlternating * first_N) << "tick " << k;
          }
        }
      }
    }
  }
}

// One tick of the modes z = (q, p) with the force that keeps position plus half a tick of velocity of a point
// in place, along all axes (stick) or along the normal: z+ = (A - B (C B)^-1 C A) z.
Eigen::MatrixXd constrained_tick(const LocalModel& model, const SurfacePoint& point, bool stick) {
  const auto found = std::find(model.triangle.begin(), model.triangle.end(), point.triangle);
  const auto& corner = model.corner[static_cast<std::size_t>(found - model.triangle.begin())];
  const Eigen::Index modes = model.modes();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(3, modes);
  for (std::size_t c = 0; c < 3; ++c)
    basis += point.barycentric[static_cast<Eigen::Index>(c)] * model.basis.middleRows(3 * corner[c], 3);
  if (!stick) basis = basis.bottomRows(1).eval();
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(2 * modes, 2 * modes);
  Eigen::MatrixXd b(2 * modes, basis.rows()), c(basis.rows(), 2 * modes);
  for (Eigen::Index m = 0; m < modes; ++m) {
    const ModalCoefficients& k = model.coefficient[static_cast<std::size_t>(m)];
    a(m, m) += k.a11;
    a(m, modes + m) += k.a12;
    a(modes + m, m) += k.a21;
    a(modes + m, modes + m) += k.a22;
    b.row(m) = k.b1 * basis.col(m).transpose();
    b.row(modes + m) = k.b2 * basis.col(m).transpose();
    c.col(m) = basis.col(m);
    c.col(modes + m) = static_cast<double>(ModalSurface::kOutputExtrapolation) * kTick_s * basis.col(m);
  }
  return a - b * (c * b).partialPivLu().solve(c * a);
}

TEST_P(TipStep, PolesThatAlternateDieWithinATick) {
  // A tenth a tick: nothing is left after ten. Measured: 0.027 (100 N/m, damping ratio 0.001).
  constexpr double kLargest = 0.1;
  constexpr double kRounding = 1e-9;
  const Body body = body_of(GetParam());
  for (const Vec3d& place_m : kPlaces) {
    const SurfacePoint point = nearest_surface_point(body, body.rest_position_m(), to_eigen(place_m));
    const LocalModel model = build_patch(body, body.rest_state(), point, PatchSize{}, kTick_s);
    for (const bool stick : {true, false}) {
      const Eigen::VectorXcd poles = constrained_tick(model, point, stick).eigenvalues();
      for (const auto& pole : poles) {
        EXPECT_LE(std::abs(pole), 1.0 + kRounding);
        if (pole.real() < 0.0) {
          EXPECT_LE(std::abs(pole), kLargest) << place_m.x << " " << place_m.y;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Materials, TipStep,
                         ::testing::Values(Material{100, 0.001}, Material{100, 0.01}, Material{100, 0.1},
                                           Material{100, 1}, Material{100, 2}, Material{1e4, 0.001},
                                           Material{1e4, 0.01}, Material{1e4, 0.1}, Material{1e4, 1},
                                           Material{1e4, 2}));

}  // namespace
}  // namespace palpate::host::bench
