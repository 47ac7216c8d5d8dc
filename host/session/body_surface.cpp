#include "host/session/body_surface.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "host/msd/vectors.hpp"
#include "shared/servo_tick.hpp"

namespace palpate::host {

BodySurface::BodySurface(const Body& body, BodyState start, double step_s, SurfaceKind kind,
                         const std::vector<NodeDrive>& drives, const FrictionSpec& friction)
    : body_(body),
      friction_(body, friction),
      integrator_(body),
      drives_(body, drives, step_s),
      state_(std::move(start)),
      before_m_(state_.position_m),
      step_s_(step_s),
      kind_(kind) {
  if (!(step_s > 0.0) || step_s > integrator_.largest_step_s()) {
    std::ostringstream message;
    message << "step_s = " << step_s << ": must be in (0, " << integrator_.largest_step_s()
            << "] s, the stable range of the semi-implicit integrator for this body";
    throw std::invalid_argument(message.str());
  }
  triangles_of_.resize(static_cast<std::size_t>(body.node_count()));
  for (std::uint32_t t = 0; t < triangle_count(); ++t)
    for (const std::uint32_t node : corners(t)) triangles_of_[node].push_back(t);
  for (const Triangle& t : body.triangles())
    for (std::size_t c = 0; c < 3; ++c)
      longest_edge_m_ =
          std::max(longest_edge_m_,
                   (body.rest_position_m().col(t[c]) - body.rest_position_m().col(t[(c + 1) % 3])).norm());
}

std::array<std::uint32_t, 3> BodySurface::corners(std::uint32_t triangle) const {
  const Triangle& t = body_.triangles()[triangle];
  return {static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
          static_cast<std::uint32_t>(t[2])};
}

std::int32_t BodySurface::neighbour(std::uint32_t triangle, std::uint32_t corner) const {
  // The body counts edges by their first corner, contact by the corner opposite to them.
  return body_.triangle_neighbours()[triangle][(corner + 1) % 3];
}

Nearness BodySurface::nearness(const Vec3d&, const Vec3d&, double) const {
  return body_.triangles().empty() ? Nearness::far : Nearness::near;
}

bool BodySurface::may_touch(std::uint32_t triangle, const Vec3d& from, const Vec3d& to,
                            double tip_radius_m) const {
  // The closest point of a triangle is within its longest edge of its first corner; twice for stretched ones.
  const double reach = tip_radius_m + norm(to - from) + 2.0 * longest_edge_m_;
  const Vec3d offset = position(corners(triangle)[0]) - to;
  return dot(offset, offset) <= reach * reach;
}

Vec3d BodySurface::position(std::uint32_t node) const {
  return from_eigen(state_.position_m.col(static_cast<Eigen::Index>(node)));
}

Vec3d BodySurface::position_before(std::uint32_t node) const {
  return from_eigen(before_m_.col(static_cast<Eigen::Index>(node)));
}

Vec3d BodySurface::area_before(std::uint32_t triangle) const {
  const auto corner = corners(triangle);
  const Vec3d a = position_before(corner[0]);
  return cross(position_before(corner[1]) - a, position_before(corner[2]) - a);
}

Vec3d BodySurface::normal_before(std::uint32_t triangle, const Vec3d& barycentric) const {
  if (kind_ == SurfaceKind::flat) return normalized(area_before(triangle));
  const auto corner = corners(triangle);
  Vec3d sum{};
  for (std::size_t c = 0; c < 3; ++c) {
    Vec3d vertex{};
    for (const std::uint32_t t : triangles_of_[corner[c]]) vertex += area_before(t);
    sum += normalized(vertex) * barycentric[c];
  }
  return normalized(sum);
}

void BodySurface::advance() {
  before_m_ = state_.position_m;
  integrator_.predict(state_, {}, step_s_);
  drives_.impose(state_);
  integrator_.finish(state_, step_s_);
}

double BodySurface::inverse_mass_1_kg(std::uint32_t node) const {
  const int n = static_cast<int>(node);
  return body_.fixed(n) || drives_.drove(n) ? 0.0 : 1.0 / body_.mass_kg(n);
}

PointResponse<double> BodySurface::respond(std::uint32_t triangle, const Vec3d& barycentric) const {
  PointResponse<double> response{};
  double compliance = 0.0, fixed = 0.0;
  const auto corner = corners(triangle);
  for (std::size_t c = 0; c < 3; ++c) {
    response.free_m += position(corner[c]) * barycentric[c];
    const double inverse_mass = inverse_mass_1_kg(corner[c]);
    compliance += barycentric[c] * barycentric[c] * step_s_ * step_s_ * inverse_mass;
    if (inverse_mass == 0.0) fixed += barycentric[c];
  }
  response.compliance_m_N = Mat3d::identity(compliance);
  response.skin_m_N = fixed / kSkinStiffness_N_m;
  return response;
}

void BodySurface::apply(std::uint32_t triangle, const Vec3d& barycentric, const Vec3d& force_N) {
  const auto corner = corners(triangle);
  for (std::size_t c = 0; c < 3; ++c) {
    const Eigen::Vector3d velocity =
        to_eigen(force_N) * (barycentric[c] * step_s_ * inverse_mass_1_kg(corner[c]));
    const auto node = static_cast<Eigen::Index>(corner[c]);
    state_.velocity_m_s.col(node) += velocity;
    state_.position_m.col(node) += step_s_ * velocity;
  }
}

void BodySurface::overwrite(int node, int axis, double position_m, double velocity_m_s) {
  if (drives_.drove(node)) return;
  state_.position_m(axis, node) = position_m;
  state_.velocity_m_s(axis, node) = velocity_m_s;
}

int steps_per_tick(double step_s) {
  const double steps = kTick_s / step_s;
  const double rounded = std::round(steps);
  if (!(step_s > 0.0) || rounded < 1.0 || std::abs(steps - rounded) > 1e-6 * rounded) {
    std::ostringstream message;
    message << "step_s = " << step_s << ": must divide the servo tick of 0.001 s";
    throw std::invalid_argument(message.str());
  }
  return static_cast<int>(rounded);
}

BodyTick advance_tick(BodySurface& surface, ContactState<double>& contact, const ContactLaw<double>& law,
                      const Vec3d& tip_before_m, const Vec3d& tip_m) {
  const int steps = steps_per_tick(surface.step_s());
  BodyTick result{};
  Vec3d tip = tip_before_m, weighted_normal{};
  for (int i = 1; i <= steps; ++i) {
    const Vec3d next = tip_before_m + (tip_m - tip_before_m) * (static_cast<double>(i) / steps);
    step_contact(surface, contact, law, tip, next);
    result.mean_force_N += contact.force_N * (1.0 / steps);
    weighted_normal += contact.normal * norm(contact.force_N);
    tip = next;
  }
  result.contact = contact;
  if (weighted_normal != Vec3d{}) {
    result.normal = normalized(weighted_normal);
  } else if (contact.mode != ContactMode::free) {
    result.normal = contact.normal;
  }
  return result;
}

}  // namespace palpate::host
