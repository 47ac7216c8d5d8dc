#include "shared/model/modal_surface.hpp"

#include <cmath>

#include "shared/servo_tick.hpp"

namespace palpate {

void ModalSurface::bind(const LocalModelView& model, ModalState& state) {
  model_ = model;
  state_ = &state;
  now_valid_ = 0;
  evaluations_ = 0;
  step_ = 0;
  normal_step_ = {};
  triangle_count_of_ = {};
  for (std::size_t m = 0; m < model.modes; ++m) scaled_q_[m] = model.basis_scale[m] * state.q[m];

  for (std::uint32_t t = 0; t < model.triangles; ++t) {
    for (const std::uint32_t node : corners(t)) {
      std::uint8_t& count = triangle_count_of_[node];
      if (count < kMaxTrianglesOfNode) triangles_of_[node][count++] = static_cast<std::uint8_t>(t);
    }
  }

  // The neighbour across the edge opposite to corner c shares the two other corners, in reverse order.
  for (std::uint32_t t = 0; t < model.triangles; ++t) {
    for (std::uint32_t c = 0; c < 3; ++c) {
      const std::uint8_t* mine = model.corner + 3 * t;
      const std::uint8_t start = mine[(c + 1) % 3], end = mine[(c + 2) % 3];
      std::int8_t found = static_cast<std::int8_t>(kNoTriangle);
      for (std::uint32_t other = 0; other < model.triangles; ++other) {
        const std::uint8_t* theirs = model.corner + 3 * other;
        for (std::uint32_t k = 0; k < 3; ++k)
          if (theirs[k] == end && theirs[(k + 1) % 3] == start) found = static_cast<std::int8_t>(other);
      }
      neighbour_[t][c] = found;
    }
  }

  for (std::size_t axis = 0; axis < 3; ++axis) {
    float lowest = model.position_m[axis], highest = lowest;
    for (std::size_t n = 1; n < model.nodes; ++n) {
      const float x = model.position_m[3 * n + axis];
      if (x < lowest) lowest = x;
      if (x > highest) highest = x;
    }
    lowest_m_[axis] = lowest;
    highest_m_[axis] = highest;
  }
  // Nodes stay within a tenth of the patch's diagonal of where they were while a model is valid (4 mm at the
  // reference body, where the linear model itself has long lost its meaning).
  margin_m_ = 0.1f * norm(highest_m_ - lowest_m_);
}

bool ModalSurface::is_near(const Vec3f& from, const Vec3f& to, float tip_radius_m) {
  const float reach = margin_m_ + tip_radius_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float low = from[axis] < to[axis] ? from[axis] : to[axis];
    const float high = from[axis] < to[axis] ? to[axis] : from[axis];
    if (high < lowest_m_[axis] - reach || low > highest_m_[axis] + reach) return false;
  }
  for (std::uint32_t n = 0; n < model_.nodes; ++n) refresh_normal(n);
  return true;
}

Vec3f ModalSurface::position(std::uint32_t node) {
  if ((now_valid_ >> node & 1u) == 0u) {
    const float* rest = model_.position_m + 3 * node;
    Vec3f x{rest[0], rest[1], rest[2]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int16_t* row = model_.basis + (3 * node + axis) * model_.modes;
      // Two sums hide the latency of the multiplier; the order is fixed, so the bits are the same everywhere.
      float even = 0.0f, odd = 0.0f;
      std::size_t m = 0;
      for (; m + 1 < model_.modes; m += 2) {
        even += static_cast<float>(row[m]) * scaled_q_[m];
        odd += static_cast<float>(row[m + 1]) * scaled_q_[m + 1];
      }
      if (m < model_.modes) even += static_cast<float>(row[m]) * scaled_q_[m];
      x[axis] += even + odd;
    }
    now_[node] = x;
    now_valid_ |= 1u << node;
    ++evaluations_;
  }
  return now_[node];
}

void ModalSurface::prepare(std::uint32_t triangle) {
  for (const std::uint32_t node : corners(triangle)) refresh_normal(node);
}

void ModalSurface::refresh_normal(std::uint32_t node) {
  (void)position(node);
  if (normal_step_[node] != 0 && step_ + 1 - normal_step_[node] < kNormalLifetime_steps) return;
  Vec3f sum{};
  for (std::uint32_t k = 0; k < triangle_count_of_[node]; ++k) {
    const auto corner = corners(triangles_of_[node][k]);
    const Vec3f a = position(corner[0]);
    sum += cross(position(corner[1]) - a, position(corner[2]) - a);
  }
  normal_[node] = normalized(sum);
  normal_step_[node] = step_ + 1;
}

Vec3f ModalSurface::normal_before(std::uint32_t triangle, const Vec3f& barycentric) const {
  const auto corner = corners(triangle);
  return normalized(normal_[corner[0]] * barycentric.x + normal_[corner[1]] * barycentric.y +
                    normal_[corner[2]] * barycentric.z);
}

void ModalSurface::advance() {
  ++step_;
  before_ = now_;
  now_valid_ = 0;
  for (std::size_t m = 0; m < model_.modes; ++m) {
    const float* c = model_.coefficient + kCoefficientsPerMode * m;
    const float q = state_->q[m], p = state_->p[m], u = model_.load[m];
    const float next_q = q + (c[0] * q + c[1] * p + c[4] * u);
    state_->p[m] = p + (c[2] * q + c[3] * p + c[5] * u);
    state_->q[m] = next_q;
    scaled_q_[m] = model_.basis_scale[m] * next_q;
  }
}

PointResponse<float> ModalSurface::respond(std::uint32_t triangle, const Vec3f& barycentric) {
  constexpr float kLead_s = kTargetExtrapolation * static_cast<float>(kTick_s);
  const auto corner = corners(triangle);
  PointResponse<float> response{};
  for (std::size_t k = 0; k < 3; ++k) {
    const float* x = model_.position_m + 3 * corner[k];
    response.free_m += Vec3f{x[0], x[1], x[2]} * barycentric[k];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int16_t* a = model_.basis + (3 * corner[0] + axis) * model_.modes;
    const std::int16_t* b = model_.basis + (3 * corner[1] + axis) * model_.modes;
    const std::int16_t* c = model_.basis + (3 * corner[2] + axis) * model_.modes;
    float* out = point_basis_[axis].data();
    for (std::size_t m = 0; m < model_.modes; ++m) {
      out[m] = (barycentric.x * static_cast<float>(a[m]) + barycentric.y * static_cast<float>(b[m]) +
                barycentric.z * static_cast<float>(c[m])) *
               model_.basis_scale[m];
    }
  }
  Mat3f& compliance = response.compliance_m_N;
  const float* wx = point_basis_[0].data();
  const float* wy = point_basis_[1].data();
  const float* wz = point_basis_[2].data();
  Vec3f displacement{}, diagonal{}, off{};  // off: yz, zx, xy
  for (std::size_t m = 0; m < model_.modes; ++m) {
    const float* c = model_.coefficient + kCoefficientsPerMode * m;
    const float ahead = state_->q[m] + kLead_s * state_->p[m];
    const float b = c[4] + kLead_s * c[5];
    displacement += Vec3f{wx[m], wy[m], wz[m]} * ahead;
    const float bx = b * wx[m], by = b * wy[m];
    diagonal += Vec3f{bx * wx[m], by * wy[m], b * wz[m] * wz[m]};
    off += Vec3f{by * wz[m], bx * wz[m], bx * wy[m]};
  }
  response.free_m += displacement;
  compliance = {{{diagonal.x, off.z, off.y}, {off.z, diagonal.y, off.x}, {off.y, off.x, diagonal.z}}};
  evaluations_ += 3;
  return response;
}

void ModalSurface::apply(std::uint32_t, const Vec3f&, const Vec3f& force_N) {
  now_valid_ = 0;
  for (std::size_t m = 0; m < model_.modes; ++m) {
    const float* c = model_.coefficient + kCoefficientsPerMode * m;
    const float u =
        point_basis_[0][m] * force_N.x + point_basis_[1][m] * force_N.y + point_basis_[2][m] * force_N.z;
    state_->q[m] += c[4] * u;
    state_->p[m] += c[5] * u;
    scaled_q_[m] = model_.basis_scale[m] * state_->q[m];
  }
}

}  // namespace palpate
