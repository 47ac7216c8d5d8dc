#include "host/reference/paper_reference.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <utility>

namespace palpate::host::paper {
namespace {

Vec3d to_vec3(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Eigen::Vector3d node_of(const Eigen::VectorXd& values, int node) {
  return values.segment<3>(3 * static_cast<Eigen::Index>(node));
}

struct TriangleShape {
  Eigen::Matrix3d corner;  // columns

  TriangleShape(const Eigen::VectorXd& x_m, const std::array<int, 3>& nodes) {
    for (std::size_t k = 0; k < 3; ++k) corner.col(static_cast<Eigen::Index>(k)) = node_of(x_m, nodes[k]);
  }
  [[nodiscard]] Eigen::Vector3d normal() const {
    return (corner.col(1) - corner.col(0)).cross(corner.col(2) - corner.col(0)).normalized();
  }
  [[nodiscard]] TrianglePoint<double> closest(const Eigen::Vector3d& point_m) const {
    return closest_point(to_vec3(point_m), to_vec3(corner.col(0)), to_vec3(corner.col(1)),
                         to_vec3(corner.col(2)));
  }
  [[nodiscard]] double longest_edge() const {
    return std::sqrt(std::max({(corner.col(1) - corner.col(0)).squaredNorm(),
                               (corner.col(2) - corner.col(1)).squaredNorm(),
                               (corner.col(0) - corner.col(2)).squaredNorm()}));
  }
};

Eigen::Vector3d to_eigen(const Vec3d& v) {
  return {v.x, v.y, v.z};
}

Eigen::Vector3d sum_over_triangle(const Eigen::VectorXd& values, const ContactPoint& point) {
  return node_of(values, point.corner[0]) + node_of(values, point.corner[1]) +
         node_of(values, point.corner[2]);
}

// Tangential part of `force` scaled to mu |normal part|: (27), (31).
Eigen::Vector3d bounded(const Eigen::Vector3d& force, const Eigen::Vector3d& normal, double friction) {
  Eigen::Vector3d along_normal = normal * normal.transpose() * force;
  const Eigen::Vector3d tangential = force - along_normal;
  if (tangential.norm() == 0) return along_normal;
  return along_normal + friction * along_normal.norm() * tangential / tangential.norm();
}

// Velocities that have `value` as the leading coordinates of the transform, 0 as all others.
Eigen::VectorXd from_leading(const Eigen::MatrixXd& transform, const Eigen::VectorXd& value) {
  Eigen::VectorXd coordinates = Eigen::VectorXd::Zero(transform.rows());
  coordinates.head(value.size()) = value;
  return transform.inverse() * coordinates;
}

}  // namespace

PatchState advance_free(const LinearPatch& patch, const PatchState& from, double duration_s) {
  PatchState to;
  to.v_m_s = from.v_m_s + patch.force_N(from.x_m, from.v_m_s).cwiseQuotient(patch.mass_kg) * duration_s;
  to.x_m = from.x_m + to.v_m_s * duration_s;
  return to;
}

Collision find_first_contact(const LinearPatch& patch, const PatchState& at_start,
                             const InstrumentStep& motion) {
  const auto tip_at = [&motion](double fraction) -> Eigen::Vector3d {
    return motion.from_m + (motion.to_m - motion.from_m) * fraction;
  };
  Collision first;
  for (std::size_t t = 0; t < patch.corner.size(); ++t) {
    const auto outside = [&](double fraction) {
      const PatchState there = advance_free(patch, at_start, fraction * motion.step_s);
      const TriangleShape triangle(there.x_m, patch.corner[t]);
      return (tip_at(fraction) - triangle.corner.col(0)).dot(triangle.normal()) >= 0;
    };
    if (!outside(0.0) || outside(1.0)) continue;
    double low = 0, high = 1;
    for (int i = 0; i < kPaperBisections; ++i) {
      const double middle = 0.5 * (low + high);
      (outside(middle) ? low : high) = middle;
    }
    if (first.found && low * motion.step_s >= first.after_s) continue;
    const PatchState there = advance_free(patch, at_start, low * motion.step_s);
    const TriangleShape triangle(there.x_m, patch.corner[t]);
    const TrianglePoint<double> nearest = triangle.closest(tip_at(low));
    const Eigen::Vector3d offset_m = tip_at(low) - to_eigen(nearest.position);
    const Eigen::Vector3d normal = triangle.normal();
    if ((offset_m - normal * normal.dot(offset_m)).norm() >
        kPaperEdgeTolerance<double> * triangle.longest_edge())
      continue;
    first = {
        true, static_cast<int>(t), {patch.corner[t], to_eigen(nearest.barycentric)}, low * motion.step_s};
  }
  return first;
}

ConstraintForces sticking_forces(const Eigen::MatrixXd& p_tilde, const Eigen::VectorXd& f_N,
                                 const ContactPoint& point) {
  const Eigen::VectorXd f_c = p_tilde * f_N;
  return {f_c, sum_over_triangle(f_c, point)};
}

ConstraintForces sliding_forces(const Eigen::MatrixXd& q_tilde, const Eigen::VectorXd& f_N,
                                const ContactPoint& point) {
  const Eigen::VectorXd f_c = q_tilde * f_N;
  return {f_c, sum_over_triangle(f_c, point)};
}

ConstraintForces frictional_forces(const Eigen::MatrixXd& p_tilde, const Eigen::VectorXd& f_N,
                                   const ContactPoint& point, const Eigen::Vector3d& normal,
                                   double friction) {
  const ConstraintForces sticking = sticking_forces(p_tilde, f_N, point);
  ConstraintForces result{Eigen::VectorXd::Zero(f_N.size()),
                          bounded(sticking.instrument_N, normal, friction)};
  for (const int node : point.corner)
    result.nodal_N.segment<3>(3 * static_cast<Eigen::Index>(node)) =
        bounded(node_of(sticking.nodal_N, node), normal, friction);
  return result;
}

PaperReference::PaperReference(LinearPatch patch, const PaperLaw<double>& law)
    : patch_(std::move(patch)), law_(law), state_{patch_.rest_position_m, patch_.rest_velocity_m_s} {}

Collision PaperReference::find_collision(const InstrumentStep& motion) const {
  if (contact_.mode == ContactMode::free) return find_first_contact(patch_, state_, motion);
  Collision collision;
  collision.triangle = static_cast<int>(contact_.triangle);
  collision.point.barycentric = to_eigen(contact_.barycentric);
  if (contact_.mode == ContactMode::slip) {
    double best = 0;
    for (std::size_t t = 0; t < patch_.corner.size(); ++t) {
      const auto nearest = TriangleShape(state_.x_m, patch_.corner[t]).closest(motion.from_m);
      const double squared = (motion.from_m - to_eigen(nearest.position)).squaredNorm();
      if (t != 0 && squared >= best) continue;
      best = squared;
      collision.triangle = static_cast<int>(t);
      collision.point.barycentric = to_eigen(nearest.barycentric);
    }
  }
  collision.point.corner = patch_.corner[static_cast<std::size_t>(collision.triangle)];
  const PatchState end = advance_free(patch_, state_, motion.step_s);
  const TriangleShape triangle(end.x_m, collision.point.corner);
  collision.found = triangle.normal().dot(motion.to_m - triangle.corner * collision.point.barycentric) < 0;
  return collision;
}

void PaperReference::step(const InstrumentStep& motion) {
  const Collision collision = find_collision(motion);
  contact_.instrument_force_N = contact_.momentum_force_N = {};
  if (!collision.found) {
    state_ = advance_free(patch_, state_, motion.step_s);
    contact_.mode = ContactMode::free;
    return;
  }
  respond(collision, motion);
}

void PaperReference::respond(const Collision& collision, const InstrumentStep& motion) {
  const ContactPoint& point = collision.point;
  const int nodes = static_cast<int>(patch_.nodes());
  PatchState at_collision = state_;
  if (collision.after_s > 0) at_collision = advance_free(patch_, state_, collision.after_s);
  const double remaining_s = motion.step_s - collision.after_s;
  const TriangleShape triangle(at_collision.x_m, point.corner);
  const Eigen::Vector3d normal = triangle.normal();

  const Eigen::MatrixXd t = barycentric_transform(nodes, point);
  const Eigen::MatrixXd u = normal_transform(nodes, point, normal);
  const Eigen::MatrixXd p = velocity_projection(t, 3), p_tilde = force_projection(t, 3);
  const Eigen::MatrixXd q = velocity_projection(u, 1), q_tilde = force_projection(u, 1);

  // Push: change the leading coordinates of T x or U x.
  const Eigen::Vector3d gap_m = motion.to_m - (t * at_collision.x_m).head<3>();
  Eigen::VectorXd x_m = at_collision.x_m;
  if (law_.kind == PaperFriction::frictionless) {
    x_m += from_leading(u, Eigen::VectorXd::Constant(1, normal.dot(gap_m)));
  } else {
    x_m += from_leading(t, gap_m);
  }

  const Eigen::VectorXd& v = at_collision.v_m_s;
  const Eigen::VectorXd f_N = patch_.force_N(x_m, v);
  const ConstraintForces sticking = sticking_forces(p_tilde, f_N, point);
  const Eigen::Vector3d f_n = normal * normal.transpose() * sticking.instrument_N;
  const Eigen::Vector3d f_t = sticking.instrument_N - f_n;
  const bool within_cone = f_t.norm() <= law_.friction * f_n.norm();  // (4)
  const bool sticks =
      law_.kind == PaperFriction::sticking || (law_.kind == PaperFriction::coulomb && within_cone);

  ConstraintForces forces = sticking;
  const bool carried = law_.point == PaperPointVelocity::carried;
  const Eigen::Vector3d speed_m_s = (motion.to_m - motion.from_m) / motion.step_s;
  PatchState next;
  if (sticks) {
    next.v_m_s = p * (v + f_N.cwiseQuotient(patch_.mass_kg) * remaining_s);  // (13)
    Eigen::VectorXd moving = v;
    if (carried) {
      next.v_m_s += from_leading(t, speed_m_s);
      moving = p * v;
    }
    next.x_m = x_m + moving * remaining_s;
  } else {
    Eigen::VectorXd net_N = f_N;
    Eigen::VectorXd pushed = Eigen::VectorXd::Zero(v.size());
    const Eigen::VectorXd normal_speed = from_leading(u, Eigen::VectorXd::Constant(1, normal.dot(speed_m_s)));
    if (law_.kind == PaperFriction::frictionless) {
      forces = sliding_forces(q_tilde, f_N, point);
      if (carried) pushed = normal_speed;
    } else {
      forces = frictional_forces(p_tilde, f_N, point, normal, law_.friction);
      net_N -= forces.nodal_N;  // (28)
      if (carried) pushed = from_leading(t, speed_m_s);
    }
    next.v_m_s = q * (v + net_N.cwiseQuotient(patch_.mass_kg) * remaining_s);  // (21), (29)
    if (carried) next.v_m_s += normal_speed;
    next.x_m = x_m + (next.v_m_s - pushed) * remaining_s;
  }
  const Eigen::VectorXd momentum_N = f_N - patch_.mass_kg.cwiseProduct(next.v_m_s - v) / remaining_s;
  Eigen::Vector3d momentum_sum_N = Eigen::Vector3d::Zero();
  for (int n = 0; n < nodes; ++n) momentum_sum_N += node_of(momentum_N, n);

  state_ = std::move(next);
  contact_ = {sticks ? ContactMode::stick : ContactMode::slip,
              static_cast<std::uint32_t>(collision.triangle),
              to_vec3(point.barycentric),
              to_vec3(normal),
              collision.after_s,
              to_vec3(forces.instrument_N),
              to_vec3(momentum_sum_N)};
}

}  // namespace palpate::host::paper
