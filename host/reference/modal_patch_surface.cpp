#include "host/reference/modal_patch_surface.hpp"

#include "host/linearize/modal_reduction.hpp"

namespace palpate::host::paper {

ModalPatchSurface::ModalPatchSurface(const LinearPatch& patch, double step_s, SurfaceKind kind,
                                     const Friction<double>& friction)
    : step_s_(step_s), kind_(kind), friction_(friction), rest_m_(patch.rest_position_m) {
  for (const auto& c : patch.corner)
    corner_.push_back({static_cast<std::uint32_t>(c[0]), static_cast<std::uint32_t>(c[1]),
                       static_cast<std::uint32_t>(c[2])});
  for (const auto& mine : corner_) {
    std::array<std::int32_t, 3> across{};
    for (std::size_t c = 0; c < 3; ++c) {
      across[c] = kNoTriangle;
      for (std::size_t other = 0; other < corner_.size(); ++other)
        for (std::size_t k = 0; k < 3; ++k)
          if (corner_[other][k] == mine[(c + 2) % 3] && corner_[other][(k + 1) % 3] == mine[(c + 1) % 3])
            across[c] = static_cast<std::int32_t>(other);
    }
    neighbour_.push_back(across);
  }

  const ModalBasis modes = reduce_to_modes(-patch.df_dx_N_m, -patch.df_dv_N_s_m, patch.mass_kg);
  basis_ = modes.basis_1_sqrt_kg;
  const Eigen::Index count = modes.lambda_rad2_s2.size();
  for (Eigen::ArrayXd* a : {&a11_, &a12_s_, &a21_1_s_, &a22_, &b1_s2_, &b2_s_}) a->resize(count);
  for (Eigen::Index m = 0; m < count; ++m) {
    const ModalCoefficients c = modal_coefficients(modes.lambda_rad2_s2[m], modes.damping_rad_s[m], step_s);
    a11_[m] = c.a11;
    a12_s_[m] = c.a12;
    a21_1_s_[m] = c.a21;
    a22_[m] = c.a22;
    b1_s2_[m] = c.b1;
    b2_s_[m] = c.b2;
  }
  q_ = Eigen::VectorXd::Zero(count);
  p_ = basis_.transpose() * patch.mass_kg.cwiseProduct(patch.rest_velocity_m_s);
  load_ = basis_.transpose() * patch.rest_force_N + modes.damping_rad_s.cwiseProduct(p_);
  update_positions();
  before_m_ = now_m_;
}

Vec3d ModalPatchSurface::area_normal_before(std::uint32_t triangle) const {
  const auto& c = corner_[triangle];
  const Vec3d a = position_before(c[0]);
  return cross(position_before(c[1]) - a, position_before(c[2]) - a);
}

Vec3d ModalPatchSurface::normal_before(std::uint32_t triangle, const Vec3d& barycentric) const {
  if (kind_ == SurfaceKind::flat) return normalized(area_normal_before(triangle));
  Vec3d sum{};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t node = corner_[triangle][k];
    Vec3d around{};
    for (std::uint32_t t = 0; t < triangle_count(); ++t)
      if (corner_[t][0] == node || corner_[t][1] == node || corner_[t][2] == node)
        around += area_normal_before(t);
    sum += normalized(around) * barycentric[k];
  }
  return normalized(sum);
}

void ModalPatchSurface::advance() {
  before_m_ = now_m_;
  const Eigen::ArrayXd q = q_.array(), p = p_.array(), u = load_.array();
  q_ = (q + (a11_ * q + a12_s_ * p + b1_s2_ * u)).matrix();
  p_ = (p + (a21_1_s_ * q + a22_ * p + b2_s_ * u)).matrix();
  update_positions();
}

Eigen::Matrix3Xd ModalPatchSurface::point_basis(std::uint32_t triangle, const Vec3d& barycentric) const {
  Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, basis_.cols());
  for (std::size_t k = 0; k < 3; ++k)
    result += barycentric[k] * basis_.middleRows(3 * static_cast<Eigen::Index>(corner_[triangle][k]), 3);
  return result;
}

PointResponse<double> ModalPatchSurface::respond(std::uint32_t triangle, const Vec3d& barycentric) {
  const Eigen::Matrix3Xd w = point_basis(triangle, barycentric);
  const double lead_s = target_extrapolation() * step_s_;
  const Eigen::Matrix3d c = w * (b1_s2_ + lead_s * b2_s_).matrix().asDiagonal() * w.transpose();
  const Eigen::Vector3d moved = w * (q_ + lead_s * p_);
  Vec3d rest{};
  for (std::size_t k = 0; k < 3; ++k) rest += node_of(rest_m_, corner_[triangle][k]) * barycentric[k];
  PointResponse<double> response{rest + Vec3d{moved.x(), moved.y(), moved.z()}, {}};
  for (Eigen::Index r = 0; r < 3; ++r)
    for (Eigen::Index k = 0; k < 3; ++k)
      response.compliance_m_N(static_cast<std::size_t>(r), static_cast<std::size_t>(k)) = c(r, k);
  return response;
}

void ModalPatchSurface::apply(std::uint32_t triangle, const Vec3d& barycentric, const Vec3d& force_N) {
  const Eigen::Array<double, Eigen::Dynamic, 1> u =
      (point_basis(triangle, barycentric).transpose() * Eigen::Vector3d(force_N.x, force_N.y, force_N.z))
          .array();
  q_ += (b1_s2_ * u).matrix();
  p_ += (b2_s_ * u).matrix();
  update_positions();
}

}  // namespace palpate::host::paper
