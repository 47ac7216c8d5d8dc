// The near field of a local model: what the exact forces of the springs at the contact have beyond the linear
// ones that the modes contain.
//
// The modes have the stiffness of the body at rest. For a spring between nodes i and j with separation u and
// its rate w, exact force F(u, w) = (k (|u| - L) + b w . e) e, e = u / |u|, and the model's start U0, W0, the
// modes have
//   F(U0, W0) + k n n' (u - U0) + b n n' (w - W0),   n: unit separation at rest,
// so the correction on node i (its opposite on j) is
//   g = F(u, w) - F(U0, W0) - n n' (k (u - U0) + b (w - W0)).
// It is zero at the model's start. Forces are computed in one step and made modal forces in the next, each a
// part of the work, and then act until the forces after them do: the springs' ends are extrapolated to the
// middle of that time (ModalSurface). Only what is beyond the linear force is late, so that this is stable
// for stiff springs, too (docs/decisions/near_field.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shared/math/linear.hpp"
#include "shared/model/local_model.hpp"

namespace palpate {

// Springs at the three nodes of a triangle on a flat lattice face: 48. Further ones are left out.
inline constexpr std::size_t kMaxNearSprings = 48;

// Of one model: the same in all calls until the next bind().
class NearField {
 public:
  // Starts without springs, with no force; then, for each node, its velocity at the model's start.
  void bind();
  void start_with(const LocalModelView& model, std::uint32_t node, const Vec3f& velocity_m_s);

  // Takes the springs that end at a node of the triangle. False: they are that already.
  bool follow(const LocalModelView& model, std::uint32_t triangle);
  [[nodiscard]] bool is_empty() const { return count_ == 0; }

  // A step goes by without evaluate(): what is known of the positions before is of no use any more.
  void skip() { before_known_ = false; }
  // Forces `ahead_steps` steps after the positions of all nodes, which are `elapsed_steps` after those of the
  // call before, or after skip(), when the nodes are taken to rest; in the first call after the model's
  // start.
  void evaluate(const LocalModelView& model, const std::array<Vec3f, kMaxSurfaceNodes>& position_m,
                std::uint32_t elapsed_steps, float ahead_steps);
  // On each node; zero for those without a near spring.
  [[nodiscard]] const std::array<Vec3f, kMaxSurfaceNodes>& force_N() const { return force_N_; }
  [[nodiscard]] std::size_t springs() const { return count_; }

 private:
  struct NearSpring {
    std::uint8_t i, j, kind;
    Vec3f direction;   // n
    Vec3f constant_N;  // - F(U0, W0) + n n' (k U0 + b W0)
  };

  std::uint32_t triangle_ = 0xffffffffu;
  std::size_t count_ = 0;
  std::array<NearSpring, kMaxNearSprings> spring_{};
  std::array<Vec3f, kMaxSurfaceNodes> start_velocity_m_s_{}, before_m_{}, force_N_{};
  bool before_known_ = false;
};

}  // namespace palpate
