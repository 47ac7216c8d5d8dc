// The hand that holds the tool: a mass on a spring and damper that follow an intended path, and a grip
// between them and the tip.
//
//   m x'' = k (path - x) + b (path' - x') - f,   f = grip (kg (x - tip) + bg (x' - tip'))
//
// f is the force of the hand on the tool. Parameters: docs/sources.md.
#pragma once

#include "host/plant/tip_path.hpp"
#include "shared/math/linear.hpp"

namespace palpate::plant {

// The defaults are a firm, attentive hold: the tip gives way by 1/3000 + 1/5000 m/N, 1.3 mm at 2.5 N.
struct HandParameters {
  double mass_kg = 0.2;
  double damping_N_s_m = 35.0;  // 0.71 of critical
  double stiffness_N_m = 3000.0;
  double grip_stiffness_N_m = 5000.0;  // at grip 1
  double grip_damping_N_s_m = 15.0;
};

struct HandState {
  Vec3d position_m{};  // device frame
  Vec3d velocity_m_s{};
};

class Hand {
 public:
  // Throws std::invalid_argument for parameters out of range.
  explicit Hand(const HandParameters& parameters);

  // Force of the hand on the tool. grip in [0, 1]: 1 as tight as the parameters say, 0 let go. The grip has
  // no slack and no reach: closing it at a distance pulls with that distance.
  [[nodiscard]] Vec3d force_N(const HandState& hand, const Vec3d& tip_m, const Vec3d& tip_m_s,
                              double grip) const;
  [[nodiscard]] Vec3d acceleration_m_s2(const HandState& hand, const PathPoint& intended,
                                        const Vec3d& force_on_tool_N) const;

 private:
  HandParameters parameters_;
};

}  // namespace palpate::plant
