#include "host/bench/contact_energy.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "host/bench/board_patch.hpp"
#include "host/linearize/patch_builder.hpp"
#include "host/msd/energy.hpp"
#include "host/msd/vectors.hpp"
#include "host/session/body_surface.hpp"
#include "shared/model/modal_surface.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host::bench {
namespace {

constexpr double kAbove_m = 0.001;
constexpr double kPress_s = 0.2;
constexpr double kSettle_s = 0.1;

int ticks(double duration_s) {
  return std::max(1, static_cast<int>(std::ceil(duration_s / kTick_s)));
}

double smooth(double u) {
  return u * u * (3.0 - 2.0 * u);
}

// Point of the loop at a share s of its length, relative to its centre; 0 and 1 are the same.
Vec3d around(const Loop& loop, double s) {
  if (loop.shape == Loop::Shape::circle) {
    const double angle = 2.0 * std::numbers::pi * s;
    return {loop.half_width_m * std::cos(angle), loop.half_width_m * std::sin(angle), 0.0};
  }
  const double w = 2.0 * loop.half_width_m, h = 2.0 * loop.half_height_m;
  double way = s * 2.0 * (w + h);
  const double x = loop.half_width_m, y = loop.half_height_m;
  if (way < h) return {x, -y + way, 0.0};
  way -= h;
  if (way < w) return {x - way, y, 0.0};
  way -= w;
  if (way < h) return {-x, y - way, 0.0};
  return {-x + way - h, -y, 0.0};
}

double length_m(const Loop& loop) {
  return loop.shape == Loop::Shape::circle ? 2.0 * std::numbers::pi * loop.half_width_m
                                           : 4.0 * (loop.half_width_m + loop.half_height_m);
}

// A surface that remembers the force it was given last, and where.
template <class Surface>
class Watched : public Surface {
 public:
  using Real = typename Surface::Real;
  using Surface::Surface;
  void apply(std::uint32_t triangle, const Vec3<Real>& barycentric, const Vec3<Real>& force_N) {
    triangle_ = triangle;
    barycentric_ = barycentric;
    Surface::apply(triangle, barycentric, force_N);
  }
  [[nodiscard]] std::uint32_t triangle() const { return triangle_; }
  [[nodiscard]] const Vec3<Real>& barycentric() const { return barycentric_; }

 private:
  std::uint32_t triangle_ = 0;
  Vec3<Real> barycentric_{};
};

// Counts what an observer of the contact sees.
class Observer {
 public:
  void add(const ContactState<double>& before, const ContactState<double>& after, const Vec3d& tip_moved_m,
           const Vec3d& point_moved_m) {
    const bool was_free = before.mode == ContactMode::free, is_free = after.mode == ContactMode::free;
    result_.lost += !was_free && is_free;
    result_.triangles_crossed += !was_free && !is_free && before.triangle != after.triangle;
    if (is_free) return;
    const double force_N = norm(after.force_N);
    result_.largest_force_N = std::max(result_.largest_force_N, force_N);
    sum_N_ += force_N;
    ++touched_;
    result_.account.add(after, was_free, tip_moved_m, point_moved_m);
  }
  [[nodiscard]] EnergyLoop result(double energy_gain_J, double damped_J) const {
    EnergyLoop result = result_;
    result.mean_force_N = touched_ > 0 ? sum_N_ / touched_ : 0.0;
    result.integrator_J = energy_gain_J + damped_J - result.account.body_J;
    return result;
  }

 private:
  EnergyLoop result_{};
  double sum_N_ = 0;
  int touched_ = 0;
};

double energy_J(const BodySurface& surface) {
  return potential_energy_J(surface.body(), surface.state()) +
         kinetic_energy_J(surface.body(), surface.state());
}

}  // namespace

void EnergyAccount::add(const ContactState<double>& contact, bool first, const Vec3d& tip_moved_m,
                        const Vec3d& point_moved_m) {
  const Vec3d& f = contact.force_N;
  const Vec3d slip_m = tip_moved_m - point_moved_m;
  hand_J += dot(f, tip_moved_m);
  body_J += dot(f, point_moved_m);
  if (first) {
    first_contact_J -= dot(f, slip_m);
    return;
  }
  const Vec3d tangential_N = f - contact.normal * dot(contact.normal, f);
  const double loss_J = contact.mode == ContactMode::slip ? std::max(dot(tangential_N, slip_m), 0.0) : 0.0;
  friction_J += loss_J;
  created_J += loss_J - dot(f, slip_m);
  largest_step_J = std::max(largest_step_J, loss_J - dot(f, slip_m));
}

double EnergyLoop::bound_J() const {
  constexpr double kAbsolute_J = 1e-3, kShare = 0.01;
  return std::max(kAbsolute_J, kShare * std::abs(account.hand_J));
}

std::vector<Vec3d> tip_path(const Loop& loop) {
  const Vec3d centre{loop.x_m, loop.y_m, 0.0};
  const auto at = [&](double s, double z_m) { return centre + around(loop, s) + Vec3d{0.0, 0.0, z_m}; };
  const double above_m = loop.top_m + kAbove_m, below_m = loop.top_m - loop.depth_m;
  std::vector<Vec3d> tip_m{at(0.0, above_m)};
  const auto phase = [&](double duration_s, auto position) {
    const int count = ticks(duration_s);
    for (int i = 1; i <= count; ++i) tip_m.push_back(position(smooth(static_cast<double>(i) / count)));
  };
  constexpr double kPeakOfSmooth = 1.5;  // largest slope
  phase(kPress_s, [&](double u) { return at(0.0, above_m + (below_m - above_m) * u); });
  phase(kSettle_s, [&](double) { return at(0.0, below_m); });
  phase(kPeakOfSmooth * length_m(loop) / loop.speed_m_s, [&](double u) { return at(u, below_m); });
  phase(kSettle_s, [&](double) { return at(1.0, below_m); });
  phase(kPress_s, [&](double u) { return at(1.0, below_m + (above_m - below_m) * u); });
  tip_m.back() = tip_m.front();
  return tip_m;
}

EnergyLoop full_body_loop(const Body& body, SurfaceKind kind, double friction, double step_s,
                          const std::vector<Vec3d>& tip_m) {
  Watched<BodySurface> surface(body, body.rest_state(), step_s, kind, std::vector<NodeDrive>{},
                               FrictionSpec{.elsewhere = {friction, friction}, .regions = {}});
  ContactState<double> contact;
  Observer observer;
  const double start_J = energy_J(surface);
  const int steps = steps_per_tick(step_s);
  double damped_J = 0, power_W = 0;
  Vec3d tip_moved_before_m{};
  Eigen::Matrix3Xd velocity_before_m_s;
  for (std::size_t tick = 1; tick < tip_m.size(); ++tick) {
    Vec3d from = tip_m[tick - 1];
    for (int i = 1; i <= steps; ++i) {
      const Vec3d to = tip_m[tick - 1] + (tip_m[tick] - tip_m[tick - 1]) * (static_cast<double>(i) / steps);
      const ContactState<double> before = contact;
      velocity_before_m_s = surface.state().velocity_m_s;
      step_contact(surface, contact, ContactLaw<double>{}, from, to);
      Vec3d mean_velocity_m_s{};
      const auto corner = surface.corners(surface.triangle());
      for (std::size_t c = 0; c < 3; ++c) {
        const auto node = static_cast<Eigen::Index>(corner[c]);
        mean_velocity_m_s +=
            from_eigen(velocity_before_m_s.col(node) + surface.state().velocity_m_s.col(node)) *
            (0.5 * surface.barycentric()[c]);
      }
      observer.add(before, contact, (to - from + tip_moved_before_m) * 0.5, mean_velocity_m_s * step_s);
      tip_moved_before_m = to - from;
      from = to;
    }
    const double now_W = dissipated_power_W(body, surface.state());
    damped_J += 0.5 * kTick_s * (power_W + now_W);
    power_W = now_W;
  }
  return observer.result(energy_J(surface) - start_J, damped_J);
}

EnergyLoop patch_loop(const Body& body, SurfaceKind kind, double friction, const Vec3d& centre_m,
                      const std::vector<Vec3d>& tip_m) {
  BoardPatch patch(body, body.rest_state(), to_eigen(centre_m), kind, friction);
  Watched<ModalSurface> surface;
  surface.bind(patch.view(), patch.state());
  ContactState<float> contact;
  Observer observer;
  const double start_J = patch.energy_J();
  Vec3f from = patch.to_patch(tip_m.front());
  for (std::size_t tick = 1; tick < tip_m.size(); ++tick) {
    const Vec3f to = patch.to_patch(tip_m[tick]);
    const ModalState before_state = patch.state();
    const ContactState<double> before = widen_contact(contact);
    step_contact(surface, contact, ContactLaw<float>{}, from, to);
    observer.add(before, widen_contact(contact), widen(to) - widen(from),
                 patch.moved_m(before_state, surface.triangle(), widen(surface.barycentric())));
    from = to;
  }
  return observer.result(patch.energy_J() - start_J, 0.0);
}

}  // namespace palpate::host::bench
