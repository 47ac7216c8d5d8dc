// The contact of sections 4.1 and 4.2 with the operators as matrices: slow, and as close to the text as it
// goes.
#pragma once

#include <Eigen/Core>

#include "host/reference/linear_patch.hpp"
#include "host/reference/paper_operators.hpp"
#include "shared/contact/paper_contact.hpp"

namespace palpate::host::paper {

struct PatchState {
  Eigen::VectorXd x_m;
  Eigen::VectorXd v_m_s;
};

// (12): the unconstrained motion for `duration_s`, x with the new velocity.
PatchState advance_free(const LinearPatch& patch, const PatchState& from, double duration_s);

// The instrument's motion in one step.
struct InstrumentStep {
  Eigen::Vector3d from_m;
  Eigen::Vector3d to_m;
  double step_s = 0;
};

struct Collision {
  bool found = false;
  int triangle = 0;
  ContactPoint point;
  double after_s = 0;  // dt_c
};

// Section 4.1: which triangle does the instrument pass from outside during the step, and when, by binary
// subdivision of the step. The first one counts.
Collision find_first_contact(const LinearPatch& patch, const PatchState& at_start,
                             const InstrumentStep& motion);

// What the instrument feels, and what the nodes do not feel of their internal forces.
struct ConstraintForces {
  Eigen::VectorXd nodal_N;       // f_c of (15), (23); f^ of (27)
  Eigen::Vector3d instrument_N;  // (15), (23), (31)
};
ConstraintForces sticking_forces(const Eigen::MatrixXd& p_tilde, const Eigen::VectorXd& f_N,
                                 const ContactPoint& point);
ConstraintForces sliding_forces(const Eigen::MatrixXd& q_tilde, const Eigen::VectorXd& f_N,
                                const ContactPoint& point);
ConstraintForces frictional_forces(const Eigen::MatrixXd& p_tilde, const Eigen::VectorXd& f_N,
                                   const ContactPoint& point, const Eigen::Vector3d& normal, double friction);

// Patch and contact, advanced step by step by the flow of Figure 10. Readings: paper_contact.hpp.
class PaperReference {
 public:
  // Starts at X0, V0 without contact.
  PaperReference(LinearPatch patch, const PaperLaw<double>& law);

  void set_state(const PatchState& state) { state_ = state; }
  [[nodiscard]] const PatchState& state() const { return state_; }
  [[nodiscard]] const PaperContactState<double>& contact() const { return contact_; }

  void step(const InstrumentStep& motion);

 private:
  [[nodiscard]] Collision find_collision(const InstrumentStep& motion) const;
  void respond(const Collision& collision, const InstrumentStep& motion);

  LinearPatch patch_;
  PaperLaw<double> law_;
  PatchState state_;
  PaperContactState<double> contact_{};
};

}  // namespace palpate::host::paper
