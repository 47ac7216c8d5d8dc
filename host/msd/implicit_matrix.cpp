#include "host/msd/implicit_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "host/msd/forces.hpp"
#include "host/msd/step_input.hpp"

namespace palpate::host {
namespace {

// Far above what lattices of 200 nodes a side take (the count grows with the side, not with the number of
// nodes).
constexpr int kMaxIterations = 2000;

double dot(const NodalArray& a, const NodalArray& b) {
  return a.cwiseProduct(b).sum();
}

}  // namespace

ImplicitMatrix::ImplicitMatrix(const Body& body) : layout_(make_spring_layout(body)) {
  const NodalArray inverse = inverse_mass_1_kg(body);
  movable_ = (inverse.array() > 0).cast<double>();
  mass_kg_.resize(body.node_count(), 3);
  for (int node = 0; node < body.node_count(); ++node) mass_kg_.row(node).setConstant(body.mass_kg(node));
  for (const SpringBand& band : layout_.bands) {
    const std::size_t count = band.present.size();
    LinearBand linear{{}, std::vector<double>(4 * count)};
    double* const start = linear.storage.data();
    linear.view = {band.first,
                   static_cast<std::ptrdiff_t>(count),
                   band.offset,
                   0.0,
                   start,
                   start + count,
                   start + 2 * count,
                   start + 3 * count};
    bands_.push_back(std::move(linear));
  }
  for (const Spring& spring : layout_.loose) loose_.push_back({spring.i, spring.j, Eigen::Matrix3d::Zero()});
}

void ImplicitMatrix::linearize(const NodalArray& position_m, const NodalArray& velocity_m_s,
                               double stage_step_s, bool only_stretched) {
  const LinearWeights weights{stage_step_s * stage_step_s, stage_step_s, only_stretched};
  for (std::size_t b = 0; b < bands_.size(); ++b) {
    const BandView band = layout_.bands[b].view();
    bands_[b].view.axial = weights.stiffness * band.stiffness_N_m + weights.damping * band.damping_N_s_m;
    linearize_band(band, weights, view(position_m), view(velocity_m_s), bands_[b].view);
  }
  for (std::size_t s = 0; s < loose_.size(); ++s) {
    const Spring& spring = layout_.loose[s];
    loose_[s].block.setZero();
    const Eigen::Vector3d separation_m = (position_m.row(spring.j) - position_m.row(spring.i)).transpose();
    const double length_m = separation_m.norm();
    if (length_m <= kSmallestSpringLength_m) continue;
    const Eigen::Vector3d n = separation_m / length_m;
    const double closing_m_s = (velocity_m_s.row(spring.j) - velocity_m_s.row(spring.i)).dot(n);
    const double tension_N =
        spring.stiffness_N_m * (length_m - spring.rest_length_m) + spring.damping_N_s_m * closing_m_s;
    const double axial = weights.stiffness * spring.stiffness_N_m + weights.damping * spring.damping_N_s_m;
    double transverse = weights.stiffness * tension_N / length_m;
    if (only_stretched) transverse = std::max(transverse, 0.0);
    loose_[s].block = transverse * Eigen::Matrix3d::Identity() + (axial - transverse) * n * n.transpose();
  }
  add_diagonal();
}

void ImplicitMatrix::add_diagonal() {
  NodalArray diagonal = mass_kg_;
  Eigen::ArrayXd block;
  for (const LinearBand& band : bands_) {
    const LinearBandView& v = band.view;
    const Eigen::Map<const Eigen::ArrayXd> transverse(v.transverse, v.count);
    for (const int axis : {0, 1, 2}) {
      const double* const direction = axis == 0 ? v.direction_x : (axis == 1 ? v.direction_y : v.direction_z);
      block =
          transverse + (v.axial - transverse) * Eigen::Map<const Eigen::ArrayXd>(direction, v.count).square();
      diagonal.col(axis).segment(v.first, v.count).array() += block;
      diagonal.col(axis).segment(v.first + v.offset, v.count).array() += block;
    }
  }
  for (const LinearSpring& spring : loose_) {
    diagonal.row(spring.i) += spring.block.diagonal().transpose();
    diagonal.row(spring.j) += spring.block.diagonal().transpose();
  }
  // Where compression makes an entry negative, the mass alone still makes a usable preconditioner.
  inverse_diagonal_ = (diagonal.array() > 0).select(diagonal.array(), mass_kg_.array()).inverse();
}

void ImplicitMatrix::apply(const NodalArray& operand, NodalArray& product) const {
  product = mass_kg_.cwiseProduct(operand);
  for (const LinearBand& band : bands_) apply_band(band.view, view(operand), mutable_view(product));
  for (const LinearSpring& spring : loose_) {
    const Eigen::Vector3d difference = (operand.row(spring.i) - operand.row(spring.j)).transpose();
    const Eigen::RowVector3d force = (spring.block * difference).transpose();
    product.row(spring.i) += force;
    product.row(spring.j) -= force;
  }
  product.array() *= movable_.array();
}

bool ImplicitMatrix::solve(const NodalArray& b, double reduction, NodalArray& x) {
  x.setZero(b.rows(), 3);
  residual_ = b;
  preconditioned_ = inverse_diagonal_.cwiseProduct(residual_);
  direction_ = preconditioned_;
  double size = dot(residual_, preconditioned_);
  const double goal = size * reduction * reduction;
  for (int iteration = 0; size > goal && iteration < kMaxIterations; ++iteration) {
    apply(direction_, product_);
    const double curvature = dot(direction_, product_);
    if (!(curvature > 0)) return false;
    const double length = size / curvature;
    x += length * direction_;
    residual_ -= length * product_;
    preconditioned_ = inverse_diagonal_.cwiseProduct(residual_);
    const double new_size = dot(residual_, preconditioned_);
    direction_ = preconditioned_ + (new_size / size) * direction_;
    size = new_size;
  }
  return size <= goal;
}

}  // namespace palpate::host
