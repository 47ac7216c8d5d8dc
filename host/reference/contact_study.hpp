// What separates the paper's contact from the default one: measured on a linear patch with a scripted
// instrument. The numbers are in docs/decisions/paper_contact.md.
#pragma once

#include <string>
#include <vector>

#include "host/reference/contact_runs.hpp"

namespace palpate::host::paper {

// Both contacts with the same friction.
struct FrictionCase {
  std::string name;
  PaperFriction kind = PaperFriction::sticking;
  double friction = 0;
};
// Stick, frictionless slip, and both with mu = 0.3.
std::vector<FrictionCase> friction_cases();

// A press of `press_m` into the patch's top and a drag over it, each within `phase_s`, starting at rest on
// the surface (z is up); the instrument stays on one triangle of the patch.
struct PressAndDrag {
  Vec3d start_m{};
  double press_m = 0.0015;
  Vec3d drag_m{0.001, 0.0003, 0};
  double phase_s = 0.04;

  [[nodiscard]] plant::TipPath path() const;
  [[nodiscard]] double duration_s() const { return 2 * phase_s; }
};

// Root mean square over the path, of forces averaged over 1 ms.
struct ConvergenceRow {
  int steps_per_ms = 1;
  // Default contact against the paper's limit of vanishing steps, with the contact point `carried` and the
  // omitted forces added; then of the normal (z) part and of the magnitude of the rest alone.
  double default_N = 0;
  double default_normal_N = 0;
  double default_tangential_N = 0;
  // Paper's contact with this step against the same limit; negative where the step is not stable.
  double paper_N = -1;
  // Default contact against the limit of what (15), (23), (31) say: `carried`, and `held` as written.
  double default_to_carried_N = 0;
  double default_to_held_N = 0;
};
struct Convergence {
  double force_N = 0;  // root mean square of the limit
  std::vector<ConvergenceRow> rows;
};
// The limit is extrapolated (Richardson) from `limit_steps_per_ms` and twice as many.
Convergence measure_convergence(const LinearPatch& patch, const FrictionCase& friction,
                                const PressAndDrag& motion, const std::vector<int>& steps_per_ms,
                                int limit_steps_per_ms = 64);

// log2 of the error's ratio between two rows, per halving of the step.
double order(double coarse_error, double fine_error, int coarse_steps_per_ms, int fine_steps_per_ms);

// An instrument that arrives at `speed_m_s` and goes on for 5 ms: normal impulses that it feels.
struct ApproachRow {
  int steps_per_ms = 1;
  double default_N_s = 0;
  double equation_15_N_s = 0;  // carried
  double momentum_N_s = 0;     // carried, with what (15) omits
  double omitted_N_s = 0;      // expected: m_eff v, with 1 / m_eff = sum of w_i^2 / m_i
};
ApproachRow measure_approach(const LinearPatch& patch, const Vec3d& start_m, double speed_m_s,
                             int steps_per_ms);

// Normal force on an instrument that has pressed `depth_m` and rests, on a patch where one corner of the
// triangle touched has `mass_ratio` times the mass of the others.
struct MassRatioRow {
  double mass_ratio = 1;
  double exact_N = 0;      // statics: independent of the masses
  double default_N = 0;    // run, 1 ms
  double paper_N = 0;      // run, (15)
  double predicted_N = 0;  // what (13) and (15) come to rest at: P M^-1 f = 0
};
MassRatioRow measure_mass_ratio(LinearPatch patch, const Vec3d& start_m, double depth_m, double mass_ratio);

// A press, a rest, and a lift at 1 cm/s, sticking: how the paper's contact holds on the way up, over the time
// in which the default contact does.
struct LiftRow {
  int steps_per_ms = 1;
  double contact_share = 0;  // of the steps
  double force_share = 0;    // mean normal force of (15) over that of the default contact
};
LiftRow measure_lift(const LinearPatch& patch, const Vec3d& start_m, PaperPointVelocity point,
                     int steps_per_ms);

}  // namespace palpate::host::paper
