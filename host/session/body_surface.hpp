// The whole body's surface as contact sees it: the host's side of the contact code that the board runs too.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "host/msd/body.hpp"
#include "host/msd/node_drives.hpp"
#include "host/msd/semi_implicit_euler.hpp"
#include "host/session/surface_friction.hpp"
#include "shared/contact/contact.hpp"
#include "shared/contact/surface_kind.hpp"

namespace palpate::host {

// A ContactSurface over the full non-linear body, stepped by semi-implicit Euler. A force on a node of mass m
// moves it by step^2 / m within the step, so the response of a surface point is diagonal and its inversion
// does not ring. Fixed nodes, and nodes while they are driven, do not yield: there the tip touches the body
// through a spring (kSkinStiffness_N_m). The body must outlive this.
class BodySurface {
 public:
  using Real = double;
  [[nodiscard]] static constexpr double target_extrapolation() { return 0.0; }

  // Throws std::invalid_argument for a step that is not stable, naming it and the bound, and as NodeDrives
  // and SurfaceFriction do.
  BodySurface(const Body& body, BodyState start, double step_s, SurfaceKind kind = SurfaceKind::smooth,
              const std::vector<NodeDrive>& drives = {}, const FrictionSpec& friction = {});

  [[nodiscard]] SurfaceKind kind() const { return kind_; }
  [[nodiscard]] std::uint32_t triangle_count() const {
    return static_cast<std::uint32_t>(body_.triangles().size());
  }
  [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t triangle) const;
  [[nodiscard]] std::int32_t neighbour(std::uint32_t triangle, std::uint32_t corner) const;
  [[nodiscard]] Friction<double> friction(std::uint32_t triangle) const { return friction_.of(triangle); }
  [[nodiscard]] const SurfaceFriction& friction() const { return friction_; }
  [[nodiscard]] Nearness nearness(const Vec3d& from, const Vec3d& to, double tip_radius_m) const;
  [[nodiscard]] bool may_touch(std::uint32_t triangle, const Vec3d& from, const Vec3d& to,
                               double tip_radius_m) const;
  [[nodiscard]] Vec3d position(std::uint32_t node) const;
  [[nodiscard]] Vec3d position_before(std::uint32_t node) const;
  void prepare(std::uint32_t) {}
  void note_clearance(double) {}
  [[nodiscard]] Vec3d normal_before(std::uint32_t triangle, const Vec3d& barycentric) const;
  void advance();
  [[nodiscard]] PointResponse<double> respond(std::uint32_t triangle, const Vec3d& barycentric) const;
  void apply(std::uint32_t triangle, const Vec3d& barycentric, const Vec3d& force_N);

  // Puts a node elsewhere along one axis, with another velocity; one that is driven stays as it is.
  void overwrite(int node, int axis, double position_m, double velocity_m_s);

  [[nodiscard]] const Body& body() const { return body_; }
  [[nodiscard]] const BodyState& state() const { return state_; }
  [[nodiscard]] const NodeDrives& drives() const { return drives_; }
  [[nodiscard]] double step_s() const { return step_s_; }

 private:
  [[nodiscard]] double inverse_mass_1_kg(std::uint32_t node) const;
  // Normal of a triangle, as long as twice its area.
  [[nodiscard]] Vec3d area_before(std::uint32_t triangle) const;

  const Body& body_;
  SurfaceFriction friction_;
  SemiImplicitEuler integrator_;
  NodeDrives drives_;
  BodyState state_;
  Eigen::Matrix3Xd before_m_;
  double step_s_;
  SurfaceKind kind_;
  double longest_edge_m_ = 0;
  std::vector<std::vector<std::uint32_t>> triangles_of_;  // per node
};

static_assert(ContactSurface<BodySurface>);

// What the tip did to the body in one servo tick.
struct BodyTick {
  Vec3d mean_force_N{};            // of the tip on the body, averaged over the tick: what the hand feels
  ContactState<double> contact{};  // at the end of the tick
  // Outward unit normal in which mean_force_N was found: the mean of the steps' contact normals, weighted by
  // their forces, so that the force of a frictionless contact lies in it. Without a force that of the last
  // step; zero where there is no contact either.
  Vec3d normal{};
};

// Advances body and contact by one servo tick (kTick_s) in an integer number of the surface's steps; the tip
// moves in a straight line. The number of steps a tick is steps_per_tick(step_s).
BodyTick advance_tick(BodySurface& surface, ContactState<double>& contact, const ContactLaw<double>& law,
                      const Vec3d& tip_before_m, const Vec3d& tip_m);

// Throws std::invalid_argument, naming the value, unless the servo tick is an integer multiple of step_s.
int steps_per_tick(double step_s);

}  // namespace palpate::host
