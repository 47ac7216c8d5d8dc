// A linear patch as the default contact sees it, in double precision and for any step: the modes of the local
// model (host/linearize), stepped exactly, with all nodes. The counterpart of shared/model/modal_surface on
// the patch that the paper's contact works on.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "host/linearize/modal_coefficients.hpp"
#include "host/reference/linear_patch.hpp"
#include "shared/contact/contact.hpp"
#include "shared/contact/surface_kind.hpp"
#include "shared/model/modal_surface.hpp"

namespace palpate::host::paper {

// Models ContactSurface. Positions are in the device frame. The off-diagonal part of the modal damping is
// left out, as in every local model; it vanishes for a patch linearized at rest.
class ModalPatchSurface {
 public:
  using Real = double;
  [[nodiscard]] static constexpr double target_extrapolation() { return ModalSurface::kOutputExtrapolation; }

  // Starts at X0, V0. Throws as reduce_to_modes and modal_coefficients do.
  ModalPatchSurface(const LinearPatch& patch, double step_s, SurfaceKind kind,
                    const Friction<double>& friction);

  [[nodiscard]] SurfaceKind kind() const { return kind_; }
  [[nodiscard]] std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(corner_.size()); }
  [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t triangle) const {
    return corner_[triangle];
  }
  [[nodiscard]] std::int32_t neighbour(std::uint32_t triangle, std::uint32_t corner) const {
    return neighbour_[triangle][corner];
  }
  [[nodiscard]] Friction<double> friction(std::uint32_t) const { return friction_; }
  [[nodiscard]] double step_s() const { return step_s_; }
  Nearness nearness(const Vec3d&, const Vec3d&, double) { return Nearness::near; }
  void note_clearance(double) {}
  bool may_touch(std::uint32_t, const Vec3d&, const Vec3d&, double) { return true; }
  void prepare(std::uint32_t) {}
  [[nodiscard]] Vec3d position(std::uint32_t node) const { return node_of(now_m_, node); }
  [[nodiscard]] Vec3d position_before(std::uint32_t node) const { return node_of(before_m_, node); }
  [[nodiscard]] Vec3d normal_before(std::uint32_t triangle, const Vec3d& barycentric) const;
  void advance();
  PointResponse<double> respond(std::uint32_t triangle, const Vec3d& barycentric);
  void apply(std::uint32_t triangle, const Vec3d& barycentric, const Vec3d& force_N);

 private:
  static Vec3d node_of(const Eigen::VectorXd& values, std::uint32_t node) {
    const auto row = 3 * static_cast<Eigen::Index>(node);
    return {values[row], values[row + 1], values[row + 2]};
  }
  [[nodiscard]] Vec3d area_normal_before(std::uint32_t triangle) const;  // not of unit length
  [[nodiscard]] Eigen::Matrix3Xd point_basis(std::uint32_t triangle, const Vec3d& barycentric) const;
  void update_positions() { now_m_ = rest_m_ + basis_ * q_; }

  double step_s_;
  SurfaceKind kind_;
  Friction<double> friction_;
  std::vector<std::array<std::uint32_t, 3>> corner_;
  std::vector<std::array<std::int32_t, 3>> neighbour_;
  Eigen::VectorXd rest_m_, now_m_, before_m_;
  Eigen::MatrixXd basis_;  // 1 / sqrt(kg)
  Eigen::VectorXd load_;   // N / sqrt(kg)
  Eigen::ArrayXd a11_, a12_s_, a21_1_s_, a22_, b1_s2_, b2_s_;
  Eigen::VectorXd q_, p_;  // sqrt(kg) m, sqrt(kg) m / s
};

}  // namespace palpate::host::paper
