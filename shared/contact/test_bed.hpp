// A surface for the tests of contact, and a tip that moves over it.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "shared/contact/contact.hpp"
#include "shared/contact/test_grid.hpp"

namespace palpate::test {

// A square grid of equal masses, each tied to its rest position: the simplest surface with dynamics of its
// own. Semi-implicit Euler, so that a force moves a node by step^2 / mass within the step.
class Bed {
 public:
  using Real = double;
  [[nodiscard]] static constexpr double target_extrapolation() { return 0.0; }
  static constexpr double kStep_s = 1e-4, kMass_kg = 1e-3, kStiffness_N_m = 300.0, kDamping_N_s_m = 0.5;
  static constexpr double kSpacing_m = 0.01;
  static constexpr std::uint32_t kSide = 6;

  // Starts at rest position, moving at `velocity_m_s`.
  explicit Bed(const Friction<double>& friction = {1.0, 1.0}, const Vec3d& velocity_m_s = {})
      : friction_(friction),
        rest_(kSide * kSide),
        now_(kSide * kSide),
        before_(kSide * kSide),
        velocity_(kSide * kSide, velocity_m_s) {
    for (std::uint32_t j = 0; j < kSide; ++j)
      for (std::uint32_t i = 0; i < kSide; ++i) rest_[j * kSide + i] = {i * kSpacing_m, j * kSpacing_m, 0.0};
    now_ = before_ = rest_;
  }

  static constexpr double step_s() { return kStep_s; }
  SurfaceKind kind() const { return SurfaceKind::smooth; }
  std::uint32_t triangle_count() const { return triangles_.count(); }
  std::array<std::uint32_t, 3> corners(std::uint32_t t) const { return triangles_[t]; }
  std::int32_t neighbour(std::uint32_t t, std::uint32_t c) const { return triangles_.neighbour(t, c); }
  Friction<double> friction(std::uint32_t) const { return friction_; }
  Nearness nearness(const Vec3d&, const Vec3d&, double) { return Nearness::near; }
  bool may_touch(std::uint32_t, const Vec3d&, const Vec3d&, double) const { return true; }
  Vec3d position(std::uint32_t n) { return now_[n]; }
  Vec3d position_before(std::uint32_t n) { return before_[n]; }
  void prepare(std::uint32_t) {}
  void note_clearance(double) {}
  Vec3d normal_before(std::uint32_t t, const Vec3d& barycentric) const {
    const auto vertex_normal = [&](std::uint32_t node) {
      Vec3d sum{};
      for (const auto& c : triangles_)
        if (c[0] == node || c[1] == node || c[2] == node)
          sum += cross(before_[c[1]] - before_[c[0]], before_[c[2]] - before_[c[0]]);
      return normalized(sum);
    };
    const auto& c = triangles_[t];
    return normalized(vertex_normal(c[0]) * barycentric.x + vertex_normal(c[1]) * barycentric.y +
                      vertex_normal(c[2]) * barycentric.z);
  }
  void advance() {
    before_ = now_;
    for (std::size_t n = 0; n < now_.size(); ++n) {
      const Vec3d force = (rest_[n] - now_[n]) * kStiffness_N_m - velocity_[n] * kDamping_N_s_m;
      velocity_[n] += force * (kStep_s / kMass_kg);
      now_[n] += velocity_[n] * kStep_s;
    }
  }
  PointResponse<double> respond(std::uint32_t t, const Vec3d& b) {
    const auto& c = triangles_[t];
    return {now_[c[0]] * b.x + now_[c[1]] * b.y + now_[c[2]] * b.z,
            Mat3d::identity(dot(b, b) * kStep_s * kStep_s / kMass_kg), 0.0};
  }
  void apply(std::uint32_t t, const Vec3d& b, const Vec3d& force) {
    for (std::size_t k = 0; k < 3; ++k) {
      velocity_[triangles_[t][k]] += force * (b[k] * kStep_s / kMass_kg);
      now_[triangles_[t][k]] += force * (b[k] * kStep_s * kStep_s / kMass_kg);
    }
  }
  Vec3d contact_point(const ContactState<double>& s) {
    const auto& c = triangles_[s.triangle];
    return now_[c[0]] * s.barycentric.x + now_[c[1]] * s.barycentric.y + now_[c[2]] * s.barycentric.z;
  }

 private:
  Friction<double> friction_;
  std::vector<Vec3d> rest_, now_, before_, velocity_;
  GridTriangles triangles_{kSide};
};
static_assert(ContactSurface<Bed>);

// Moves the tip in a straight line during `duration_s`, calling after each step.
template <class After>
Vec3d move(Bed& bed, ContactState<double>& state, const ContactLaw<double>& law, Vec3d from, Vec3d to,
           double duration_s, After after) {
  const int steps = static_cast<int>(std::lround(duration_s / Bed::kStep_s));
  Vec3d tip = from;
  for (int i = 1; i <= steps; ++i) {
    const Vec3d next = from + (to - from) * (static_cast<double>(i) / steps);
    step_contact(bed, state, law, tip, next);
    tip = next;
    after(tip);
  }
  return tip;
}

inline constexpr auto kNothing = [](const Vec3d&) {};

}  // namespace palpate::test
