#include "host/reference/contact_study.hpp"

#include <Eigen/LU>
#include <cmath>
#include <cstddef>

namespace palpate::host::paper {
namespace {

constexpr double kTick_s = 1e-3;
constexpr double kAlwaysSticks = 1e9;  // mu of the default contact where the paper's only sticks

double default_friction(const FrictionCase& c) {
  if (c.kind == PaperFriction::sticking) return kAlwaysSticks;
  return c.kind == PaperFriction::frictionless ? 0.0 : c.friction;
}

Friction<double> equal_friction(double friction) {
  return {friction, friction};
}

std::vector<Vec3d> forces(const std::vector<ForceSample>& samples, bool momentum = false) {
  std::vector<Vec3d> result;
  result.reserve(samples.size());
  for (const ForceSample& s : samples) result.push_back(momentum ? s.momentum_force_N : s.force_N);
  return result;
}

// Means over 1 ms of the default contact with `steps` ticks in it.
std::vector<Vec3d> default_forces(const LinearPatch& patch, double friction, const plant::TipPath& path,
                                  double duration_s, int steps) {
  const auto samples = run_default(patch, equal_friction(friction), path, {duration_s, kTick_s / steps});
  std::vector<Vec3d> mean(samples.size() / static_cast<std::size_t>(steps));
  for (std::size_t i = 0; i < mean.size() * static_cast<std::size_t>(steps); ++i)
    mean[i / static_cast<std::size_t>(steps)] += samples[i].force_N * (1.0 / steps);
  return mean;
}

template <class Difference>
double root_mean_square(std::size_t count, Difference difference) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += difference(i) * difference(i);
  return std::sqrt(sum / static_cast<double>(count));
}

double distance(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  return root_mean_square(a.size(), [&](std::size_t i) { return norm(a[i] - b[i]); });
}

double tangential(const Vec3d& f) {
  return std::hypot(f.x, f.y);
}

// Forces of vanishing steps, of a method of first order.
struct Limit {
  std::vector<Vec3d> equation_N, momentum_N;
};
Limit paper_limit(const LinearPatch& patch, const PaperLaw<double>& law, const PressAndDrag& motion,
                  int steps_per_ms) {
  const auto coarse = run_paper(patch, law, motion.path(), {motion.duration_s(), kTick_s}, steps_per_ms);
  const auto fine = run_paper(patch, law, motion.path(), {motion.duration_s(), kTick_s}, 2 * steps_per_ms);
  Limit limit;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    limit.equation_N.push_back(fine[i].force_N * 2.0 - coarse[i].force_N);
    limit.momentum_N.push_back(fine[i].momentum_force_N * 2.0 - coarse[i].momentum_force_N);
  }
  return limit;
}

// The triangle's weights at a point of the undeformed patch.
struct RestPoint {
  std::array<int, 3> corner{};
  Vec3d barycentric{};
};
RestPoint rest_point(const LinearPatch& patch, const Vec3d& point_m) {
  RestPoint best;
  double best_m = -1;
  for (const auto& corner : patch.corner) {
    Vec3d x[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d at = patch.rest_position_m.segment<3>(3 * static_cast<Eigen::Index>(corner[k]));
      x[k] = {at.x(), at.y(), at.z()};
    }
    const auto nearest = closest_point(point_m, x[0], x[1], x[2]);
    const double away_m = norm(point_m - nearest.position);
    if (best_m >= 0 && away_m >= best_m) continue;
    best_m = away_m;
    best = {corner, nearest.barycentric};
  }
  return best;
}

}  // namespace

std::vector<FrictionCase> friction_cases() {
  constexpr double kFriction = 0.3;
  return {{"stick", PaperFriction::sticking, 0},
          {"frictionless", PaperFriction::frictionless, 0},
          {"coulomb", PaperFriction::coulomb, kFriction}};
}

plant::TipPath PressAndDrag::path() const {
  const Vec3d pressed_m = start_m - Vec3d{0, 0, press_m};
  return plant::TipPath::minimum_jerk(
      {{0, start_m}, {phase_s, pressed_m}, {2 * phase_s, pressed_m + drag_m}});
}

Convergence measure_convergence(const LinearPatch& patch, const FrictionCase& friction,
                                const PressAndDrag& motion, const std::vector<int>& steps_per_ms,
                                int limit_steps_per_ms) {
  const PaperLaw<double> held{friction.kind, friction.friction, PaperPointVelocity::held};
  const PaperLaw<double> carried{friction.kind, friction.friction, PaperPointVelocity::carried};
  const Limit held_limit = paper_limit(patch, held, motion, limit_steps_per_ms),
              limit = paper_limit(patch, carried, motion, limit_steps_per_ms);
  const double largest_step_s = largest_stable_step_s(patch);
  Convergence result;
  result.force_N = distance(limit.momentum_N, std::vector<Vec3d>(limit.momentum_N.size()));
  for (const int steps : steps_per_ms) {
    const auto f =
        default_forces(patch, default_friction(friction), motion.path(), motion.duration_s(), steps);
    ConvergenceRow row;
    row.steps_per_ms = steps;
    row.default_N = distance(f, limit.momentum_N);
    row.default_normal_N =
        root_mean_square(f.size(), [&](std::size_t i) { return f[i].z - limit.momentum_N[i].z; });
    row.default_tangential_N = root_mean_square(
        f.size(), [&](std::size_t i) { return tangential(f[i]) - tangential(limit.momentum_N[i]); });
    row.default_to_carried_N = distance(f, limit.equation_N);
    row.default_to_held_N = distance(f, held_limit.equation_N);
    if (kTick_s / steps <= largest_step_s)
      row.paper_N = distance(
          forces(run_paper(patch, carried, motion.path(), {motion.duration_s(), kTick_s}, steps), true),
          limit.momentum_N);
    result.rows.push_back(row);
  }
  return result;
}

double order(double coarse_error, double fine_error, int coarse_steps_per_ms, int fine_steps_per_ms) {
  return std::log2(coarse_error / fine_error) /
         std::log2(static_cast<double>(fine_steps_per_ms) / coarse_steps_per_ms);
}

ApproachRow measure_approach(const LinearPatch& patch, const Vec3d& start_m, double speed_m_s,
                             int steps_per_ms) {
  constexpr double kDuration_s = 5e-3;
  const Vec3d end_m = start_m - Vec3d{0, 0, speed_m_s * kDuration_s};
  const auto path = plant::TipPath::samples({{0, start_m}, {kDuration_s, end_m}});
  ApproachRow row;
  row.steps_per_ms = steps_per_ms;
  for (const Vec3d& f : default_forces(patch, kAlwaysSticks, path, kDuration_s, steps_per_ms))
    row.default_N_s += f.z * kTick_s;
  const PaperLaw<double> law{PaperFriction::sticking, 0, PaperPointVelocity::carried};
  for (const ForceSample& s : run_paper(patch, law, path, {kDuration_s, kTick_s}, steps_per_ms)) {
    row.equation_15_N_s += s.force_N.z * kTick_s;
    row.momentum_N_s += s.momentum_force_N.z * kTick_s;
  }
  const RestPoint point = rest_point(patch, start_m);
  double mobility_1_kg = 0;
  for (std::size_t k = 0; k < 3; ++k)
    mobility_1_kg += point.barycentric[k] * point.barycentric[k] / patch.mass_kg[3 * point.corner[k]];
  row.omitted_N_s = speed_m_s / mobility_1_kg;
  return row;
}

MassRatioRow measure_mass_ratio(LinearPatch patch, const Vec3d& start_m, double depth_m, double mass_ratio) {
  const RestPoint point = rest_point(patch, start_m);
  patch.mass_kg.segment<3>(3 * static_cast<Eigen::Index>(point.corner[0])) *= mass_ratio;
  MassRatioRow row;
  row.mass_ratio = mass_ratio;

  // W' y = d. Exact: K y = W l. Paper: f = M W c, the only internal forces that P M^-1 takes away.
  Eigen::MatrixXd w = Eigen::MatrixXd::Zero(patch.mass_kg.size(), 3);
  for (std::size_t k = 0; k < 3; ++k)
    w.block<3, 3>(3 * static_cast<Eigen::Index>(point.corner[k]), 0) =
        point.barycentric[k] * Eigen::Matrix3d::Identity();
  const Eigen::PartialPivLU<Eigen::MatrixXd> df_dx(patch.df_dx_N_m);
  const Eigen::Vector3d d_m(0, 0, -depth_m);
  const Eigen::MatrixXd mw = patch.mass_kg.asDiagonal() * w;
  row.exact_N = (w.transpose() * df_dx.solve(w)).inverse().row(2).dot(d_m);
  const Eigen::Vector3d c = (w.transpose() * df_dx.solve(mw)).inverse() * d_m;
  const double s = dot(point.barycentric, point.barycentric);
  row.predicted_N = (w.transpose() * mw * c).z() / s;

  constexpr double kPress_s = 0.05, kRest_s = 0.4;
  const Vec3d end_m = start_m - Vec3d{0, 0, depth_m};
  const auto path = plant::TipPath::minimum_jerk({{0, start_m}, {kPress_s, end_m}});
  const RunLength length{kPress_s + kRest_s, kTick_s};
  const int substeps = static_cast<int>(std::ceil(kTick_s / largest_stable_step_s(patch)));
  row.default_N = run_default(patch, equal_friction(kAlwaysSticks), path, length).back().force_N.z;
  const PaperLaw<double> law{PaperFriction::sticking, 0, PaperPointVelocity::held};
  row.paper_N = run_paper(patch, law, path, length, substeps).back().force_N.z;
  return row;
}

LiftRow measure_lift(const LinearPatch& patch, const Vec3d& start_m, PaperPointVelocity point,
                     int steps_per_ms) {
  constexpr double kPress_s = 0.05, kRest_s = 0.05, kDepth_m = 0.002, kLift_m_s = 0.01;
  const Vec3d pressed_m = start_m - Vec3d{0, 0, kDepth_m};
  // Smooth press; the lift at constant speed.
  std::vector<plant::TimedPosition> samples;
  const auto press = plant::TipPath::minimum_jerk({{0, start_m}, {kPress_s, pressed_m}});
  constexpr int kPressSamples = 50;
  for (int i = 0; i <= kPressSamples; ++i)
    samples.push_back({kPress_s * i / kPressSamples, press.at(kPress_s * i / kPressSamples).position_m});
  samples.push_back({kPress_s + kRest_s, pressed_m});
  const double end_s = kPress_s + kRest_s + kDepth_m / kLift_m_s;
  samples.push_back({end_s, start_m});
  const auto path = plant::TipPath::samples(std::move(samples));

  const RunLength length{end_s, kTick_s};
  const auto expected = run_default(patch, equal_friction(kAlwaysSticks), path, length);
  const auto paper = run_paper(patch, {PaperFriction::sticking, 0, point}, path, length, steps_per_ms);
  LiftRow row;
  row.steps_per_ms = steps_per_ms;
  double steps = 0, in_contact = 0, force_N = 0, expected_N = 0;
  for (std::size_t i = 0; i < paper.size(); ++i) {
    if (paper[i].time_s <= kPress_s + kRest_s || expected[i].mode == ContactMode::free) continue;
    steps += steps_per_ms;
    in_contact += paper[i].contact_steps;
    force_N += paper[i].force_N.z;
    expected_N += expected[i].force_N.z;
  }
  row.contact_share = in_contact / steps;
  row.force_share = force_N / expected_N;
  return row;
}

}  // namespace palpate::host::paper
