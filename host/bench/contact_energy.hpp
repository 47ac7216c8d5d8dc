// What the contact does with the hand's work while the tip goes round a closed loop on the surface.
//
// In each step the tip moves by dt, and the place of the surface that the force f (of the tip on the body,
// constant over the step) acts on by dx; n is the outward normal in which the force was found.
//   hand's work        f . dt
//   work on the body   f . dx     (exact for the sampled modes; for semi-implicit Euler the body's own error
//                                  is counted separately: EnergyLoop::integrator_J)
//   friction loss      f_t . (dt - dx) of a slipping contact, where it is positive; f_t = f - n (n . f)
//   created            f . dx - f . dt + friction loss
// What the body then does with the work it is given, springs, inertia and dampers, is not the contact's. In
// the step of a first contact the tip has moved before it touched: f . dt is then more than the body can
// get. That loss is counted as first_contact_J and makes up for nothing.
#pragma once

#include <vector>

#include "host/msd/body.hpp"
#include "shared/contact/contact_state.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/math/linear.hpp"

namespace palpate::host::bench {

struct EnergyAccount {
  double hand_J = 0;
  double body_J = 0;
  double friction_J = 0;
  double first_contact_J = 0;  // <= 0 where the surface does not come towards the tip
  double created_J = 0;        // negative: destroyed
  double largest_step_J = 0;   // the most that one step created

  // One step; `first`: the tip was free before it.
  void add(const ContactState<double>& contact, bool first, const Vec3d& tip_moved_m,
           const Vec3d& point_moved_m);
};

// A closed path of the tip over a surface that is level at z = top_m: down, around, up again.
struct Loop {
  enum class Shape { circle, rectangle };
  Shape shape = Shape::circle;
  double x_m = 0, y_m = 0;   // centre
  double half_width_m = 0;   // along x; the circle's radius
  double half_height_m = 0;  // along y; rectangle only
  double top_m = 0;
  double depth_m = 0;
  double speed_m_s = 0;  // the largest one
};

// The tip at the ends of servo ticks 0, 1, ...; first and last position are the same, above the surface.
std::vector<Vec3d> tip_path(const Loop& loop);

struct EnergyLoop {
  EnergyAccount account;
  double largest_force_N = 0;
  double mean_force_N = 0;  // of the ticks in contact
  int triangles_crossed = 0;
  int lost = 0;  // steps in which contact was lost, the final lift included
  // Energy of the body at the end minus that at the start, plus what its dampers took up (full body: sampled
  // once a tick; patch: not known, 0), minus the work on it: what the body's own time stepping creates. For
  // the patch it is minus the dampers' loss.
  double integrator_J = 0;
  // What is allowed: 1 mJ or 1 % of the hand's work.
  [[nodiscard]] double bound_J() const;
};

// The full body, semi-implicit Euler.
EnergyLoop full_body_loop(const Body& body, SurfaceKind kind, double friction, double step_s,
                          const std::vector<Vec3d>& tip_m);

// The board's runtime on the paper's patch around a point, linearized at rest.
EnergyLoop patch_loop(const Body& body, SurfaceKind kind, double friction, const Vec3d& centre_m,
                      const std::vector<Vec3d>& tip_m);

}  // namespace palpate::host::bench
