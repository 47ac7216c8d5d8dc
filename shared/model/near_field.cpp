#include "shared/model/near_field.hpp"

#include <cmath>

#include "shared/servo_tick.hpp"

namespace palpate {
namespace {

constexpr float kStep_s = static_cast<float>(kTick_s);

// Nodes that coincide have no direction between them (host/msd/spring.hpp).
constexpr float kShortest_m = 1e-9f;

Vec3f at(const float* values, std::uint32_t node) {
  return {values[3 * node], values[3 * node + 1], values[3 * node + 2]};
}

}  // namespace

void NearField::bind() {
  triangle_ = 0xffffffffu;
  count_ = 0;
  force_N_ = {};
  before_known_ = true;
}

void NearField::start_with(const LocalModelView& model, std::uint32_t node, const Vec3f& velocity_m_s) {
  start_velocity_m_s_[node] = velocity_m_s;
  before_m_[node] = at(model.position_m, node) - velocity_m_s * kStep_s;
}

bool NearField::follow(const LocalModelView& model, std::uint32_t triangle) {
  if (triangle == triangle_ || model.springs == 0) return false;
  triangle_ = triangle;
  count_ = 0;
  const std::uint8_t* corner = model.corner + 3 * triangle;
  const std::uint32_t touched = 1u << corner[0] | 1u << corner[1] | 1u << corner[2];
  for (std::size_t s = 0; s < model.springs && count_ < kMaxNearSprings; ++s) {
    const std::uint8_t i = model.spring_end[2 * s], j = model.spring_end[2 * s + 1];
    if ((touched & (1u << i | 1u << j)) == 0u) continue;
    const std::uint8_t kind = model.spring_kind[s];
    const float k = model.spring_stiffness_N_m[kind], b = model.spring_damping_N_s_m[kind];
    const Vec3f n = normalized(at(model.rest_m, j) - at(model.rest_m, i));
    const Vec3f u = at(model.position_m, j) - at(model.position_m, i);
    const Vec3f w = start_velocity_m_s_[j] - start_velocity_m_s_[i];
    Vec3f force{};
    if (const float length = norm(u); length > kShortest_m) {
      const Vec3f e = u * (1.0f / length);
      force = e * (k * (length - model.spring_length_m[kind]) + b * dot(w, e));
    }
    spring_[count_++] = {i, j, kind, n, n * (k * dot(n, u) + b * dot(n, w)) - force};
  }
  return true;
}

void NearField::evaluate(const LocalModelView& model, const std::array<Vec3f, kMaxSurfaceNodes>& position_m,
                         std::uint32_t elapsed_steps, float ahead_steps) {
  const float per_step = 1.0f / static_cast<float>(elapsed_steps);
  const float per_second = per_step * static_cast<float>(1.0 / kTick_s), ahead = per_step * ahead_steps;
  if (!before_known_) before_m_ = position_m;
  before_known_ = true;
  force_N_ = {};
  for (std::size_t s = 0; s < count_; ++s) {
    const NearSpring& spring = spring_[s];
    const float k = model.spring_stiffness_N_m[spring.kind], b = model.spring_damping_N_s_m[spring.kind];
    const Vec3f start = position_m[spring.j] - position_m[spring.i];
    const Vec3f change = start - (before_m_[spring.j] - before_m_[spring.i]);
    const Vec3f u = start + change * ahead, w = change * per_second;
    Vec3f g =
        spring.constant_N - spring.direction * (k * dot(spring.direction, u) + b * dot(spring.direction, w));
    const float length = norm(u);
    if (length > kShortest_m) {
      const float inverse = 1.0f / length;
      g += u * (inverse * (k * (length - model.spring_length_m[spring.kind]) + b * dot(w, u) * inverse));
    }
    force_N_[spring.i] += g;
    force_N_[spring.j] -= g;
  }
  before_m_ = position_m;
}

}  // namespace palpate
