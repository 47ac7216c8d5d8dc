#include "shared/model/modal_surface.hpp"

#include <cmath>

#include "shared/math/dot16.hpp"
#include "shared/servo_tick.hpp"

namespace palpate {
namespace {

constexpr float kLead_s = ModalSurface::kOutputExtrapolation * static_cast<float>(kTick_s);

// Work in Cortex-M4F instructions, as counted in QEMU (docs/benchmarks.md). Models without a near field are
// counted as if they had 96 modes, generously for nodes: that is what their catch-up was balanced with
// (docs/decisions/catch_up.md).
constexpr ModalSurfaceWork work_of(std::size_t modes, bool with_near_field) {
  if (!with_near_field) return {.step = 0, .pass = 2000, .new_point = 9000, .node = 1000};
  const auto m = static_cast<std::uint32_t>(modes);
  return {.step = 2500, .pass = 25 * m, .new_point = 2000 + 65 * m, .node = 60 + 7 * m / 2};
}
constexpr std::uint32_t work_of_near_forces(std::size_t springs) {
  return 2000 + 250 * static_cast<std::uint32_t>(springs);
}
constexpr std::uint32_t work_of_following(std::size_t springs) {  // the contact to another triangle
  return 2000 + 130 * static_cast<std::uint32_t>(springs);
}
constexpr std::uint32_t work_of_projection(std::size_t rows, std::size_t modes) {
  return 1000 + 17 * static_cast<std::uint32_t>(rows * modes) / 10;
}

}  // namespace

void ModalSurface::bind(const LocalModelView& model, ModalState& state) {
  model_ = model;
  state_ = &state;
  now_valid_ = 0;
  clearance_m_ = 0.0f;
  work_ = 0;
  of_ = work_of(model.modes, model.springs != 0);
  point_triangle_ = kNoPoint;
  step_ = 0;
  normal_step_ = {};
  triangle_count_of_ = {};
  q_is_quantized_ = false;
  near_load_ = near_rise_ = {};
  near_period_ = near_acting_ = kNearPeriod_steps;
  near_age_ = 0;
  near_due_ = true;
  near_waiting_ = false;
  near_paused_ = true;
  near_work_ = 0;
  near_.bind();
  if (model.springs != 0) {
    quantize(state.p.data());
    for (std::uint32_t n = 0; n < model.nodes; ++n) near_.start_with(model, n, of_quantized(n));
  }

  for (std::uint32_t t = 0; t < model.triangles; ++t) {
    for (const std::uint32_t node : corners(t)) {
      std::uint8_t& count = triangle_count_of_[node];
      if (count < kMaxTrianglesOfNode) triangles_of_[node][count++] = static_cast<std::uint8_t>(t);
    }
  }

  fixed_ = 0;
  for (std::uint32_t n = 0; n < model.nodes; ++n)
    if (!is_moved(n)) fixed_ |= 1u << n;

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
    for (std::size_t n = 1; n < model.surface_nodes; ++n) {
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

Nearness ModalSurface::nearness(const Vec3f& from, const Vec3f& to, float tip_radius_m) {
  const float reach = margin_m_ + tip_radius_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float low = from[axis] < to[axis] ? from[axis] : to[axis];
    const float high = from[axis] < to[axis] ? to[axis] : from[axis];
    if (high < lowest_m_[axis] - reach || low > highest_m_[axis] + reach) {
      clearance_m_ = 0.0f;
      return Nearness::far;
    }
  }
  if (clearance_m_ > 0.0f) {
    work_ += of_.pass;
    clearance_m_ -= norm(to - from) + largest_travel_m();
    if (clearance_m_ > 0.0f) return Nearness::outside;
  }
  for (std::uint32_t n = 0; n < model_.surface_nodes; ++n) (void)position(n);
  return Nearness::near;
}

// Quantizes basis_scale * q with one step for all modes. The largest entry is 32767, so a node is off by
// about 3e-5 of the displacement since the model was made (1 mm: 30 nm); the contact's gap itself is computed
// in float.
void ModalSurface::quantize(const float* __restrict q) {
  const std::size_t modes = model_.modes;
  const float* __restrict scale = model_.basis_scale;
  std::int16_t* __restrict out = quantized_.data();
  float largest = 0.0f;
  for (std::size_t m = 0; m < modes; ++m) {
    const float magnitude = std::fabs(scale[m] * q[m]);
    // What is no number stays: nothing compares greater than it.
    if (magnitude > largest || std::isnan(magnitude)) largest = magnitude;
  }
  constexpr float kLargestEntry = 32767.0f, kSmallestStep = 1e-30f;
  quantum_ = largest * (1.0f / kLargestEntry);
  constexpr float kLargestStep = 1e30f;
  if (!(quantum_ > kSmallestStep && quantum_ < kLargestStep)) {  // at rest, or no numbers any more
    quantum_ = 0.0f;
    for (std::size_t m = 0; m < modes; ++m) out[m] = 0;
    return;
  }
  const float inverse = 1.0f / quantum_;
  for (std::size_t m = 0; m < modes; ++m) {
    const float steps = scale[m] * q[m] * inverse;
    out[m] = static_cast<std::int16_t>(static_cast<std::int32_t>(steps < 0.0f ? steps - 0.5f : steps + 0.5f));
  }
}

// What the quantized modes are at a node.
Vec3f ModalSurface::of_quantized(std::uint32_t node) const {
  // A sum of 192 products of 30 bits has 38 bits: without the lowest 8 it fits in 32.
  constexpr int kShift = 8;
  const float unit = quantum_ * static_cast<float>(1 << kShift);
  const auto sum = dot16_rows(model_.basis + 3 * node * model_.modes, quantized_.data(), model_.modes);
  Vec3f x;
  for (std::size_t axis = 0; axis < 3; ++axis)
    x[axis] = static_cast<float>(static_cast<std::int32_t>(sum[axis] >> kShift)) * unit;
  return x;
}

// Bound on how far any node moves in the step to come: each mode at its present velocity and, for a free mode
// whose velocity may grow before it turns, its load for a tick; twice, for what a mode gains within the tick.
float ModalSurface::largest_travel_m() const {
  constexpr float kLargestEntry = 32767.0f, kStep_s = static_cast<float>(kTick_s);
  const float* __restrict scale = model_.basis_scale;
  const float* __restrict p = state_->p.data();
  const float* __restrict load = model_.load;
  const float* __restrict near_load = near_load_.data();
  const bool with_near = model_.springs != 0;
  float speed = 0.0f;
  for (std::size_t m = 0; m < model_.modes; ++m)
    speed += scale[m] * (std::fabs(p[m]) + kStep_s * std::fabs(with_near ? load[m] + near_load[m] : load[m]));
  return 2.0f * speed * kLargestEntry * kStep_s;
}

Vec3f ModalSurface::position(std::uint32_t node) {
  if ((now_valid_ >> node & 1u) != 0u) return now_[node];
  if (!q_is_quantized_) {
    quantize(state_->q.data());
    q_is_quantized_ = true;
    work_ += of_.pass;
  }
  const float* rest = model_.position_m + 3 * node;
  const Vec3f x = Vec3f{rest[0], rest[1], rest[2]} + of_quantized(node);
  now_[node] = x;
  now_valid_ |= 1u << node;
  work_ += of_.node;
  return x;
}

bool ModalSurface::is_moved(std::uint32_t node) const {
  const std::int16_t* row = model_.basis + 3 * node * model_.modes;
  for (std::size_t i = 0; i < 3 * model_.modes; ++i)
    if (row[i] != 0) return true;
  return false;
}

bool ModalSurface::normal_is_fresh(std::uint32_t node, std::uint32_t step) const {
  return normal_step_[node] != 0 && step + 1 - normal_step_[node] < kNormalLifetime_steps;
}

void ModalSurface::prepare(std::uint32_t triangle) {
  if (near_.follow(model_, triangle)) {
    near_work_ += work_of_following(near_.springs());
    work_ += work_of_following(near_.springs());
  }
  for (const std::uint32_t node : corners(triangle)) {
    (void)position(node);
    if (model_.surface != SurfaceKind::flat && normal_is_fresh(node, step_ + 1)) continue;
    for (std::uint32_t k = 0; k < triangle_count_of_[node]; ++k)
      for (const std::uint32_t around : corners(triangles_of_[node][k])) (void)position(around);
  }
}

Vec3f ModalSurface::node_normal_before(std::uint32_t node) {
  if (normal_is_fresh(node, step_)) return normal_[node];
  Vec3f sum{};
  for (std::uint32_t k = 0; k < triangle_count_of_[node]; ++k) {
    const auto corner = corners(triangles_of_[node][k]);
    const Vec3f a = before_[corner[0]];
    sum += cross(before_[corner[1]] - a, before_[corner[2]] - a);
  }
  normal_step_[node] = step_ + 1;
  return normal_[node] = normalized(sum);
}

Vec3f ModalSurface::normal_before(std::uint32_t triangle, const Vec3f& barycentric) {
  const auto corner = corners(triangle);
  if (model_.surface == SurfaceKind::flat) {
    const Vec3f a = before_[corner[0]];
    return normalized(cross(before_[corner[1]] - a, before_[corner[2]] - a));
  }
  return normalized(node_normal_before(corner[0]) * barycentric.x +
                    node_normal_before(corner[1]) * barycentric.y +
                    node_normal_before(corner[2]) * barycentric.z);
}

void ModalSurface::moved() {
  now_valid_ = 0;
  q_is_quantized_ = false;
}

void ModalSurface::set_near_period(std::uint32_t steps) {
  // Forces that have not been projected yet are for the middle of the other period: they are computed anew.
  if (near_waiting_ && steps != near_period_) near_due_ = true;
  near_period_ = steps;
}

// No springs are near. What they did so far ends.
void ModalSurface::pause_near_field() {
  near_.skip();
  if (near_paused_) return;
  near_paused_ = true;
  near_load_ = near_rise_ = {};
  near_due_ = true;
  near_waiting_ = false;
  near_age_ = 0;
}

// In one step the forces on the nodes, in the next what they do to the modes. Those act from then on until
// the next do: the middle of that is 1 + half a period after the positions.
void ModalSurface::step_near_field() {
  near_paused_ = false;
  const std::uint32_t before = work_;
  if (near_due_ || near_age_ >= near_period_) {
    for (std::uint32_t n = 0; n < model_.nodes; ++n) (void)position(n);
    const std::uint32_t elapsed = near_age_ > 0 ? near_age_ : 1;
    near_.evaluate(model_, now_, elapsed, 1.0f + 0.5f * static_cast<float>(near_period_));
    work_ += work_of_near_forces(near_.springs());
    near_due_ = false;
    near_age_ = 0;
    near_waiting_ = true;
  } else if (near_waiting_) {
    near_waiting_ = false;
    project_near_field();
    near_work_ += work_ - before;
    ++near_age_;
    return;
  }
  for (std::size_t m = 0; m < model_.modes; ++m) near_load_[m] += near_rise_[m];
  near_work_ += work_ - before;
  ++near_age_;
}

std::uint32_t ModalSurface::next_near_work() const {
  if (near_.is_empty()) return 0;
  if (near_due_ || near_age_ >= near_period_)
    return static_cast<std::uint32_t>(model_.nodes) * of_.node + work_of_near_forces(near_.springs());
  return near_waiting_ ? work_of_projection(3 * model_.nodes, model_.modes) : 0;
}

// The near field's forces on nodes as modal forces. They are rounded to steps of which all together have no
// more than a 16-bit number without sign: then every sum fits in 32 bits.
void ModalSurface::project_near_field() {
  const auto& force = near_.force_N();
  float sum_N = 0.0f;
  for (std::uint32_t n = 0; n < model_.nodes; ++n)
    for (std::size_t axis = 0; axis < 3; ++axis) sum_N += std::fabs(force[n][axis]);
  constexpr float kSmallest = 1e-30f, kLargest = 1e30f;
  if (!(sum_N > kSmallest && sum_N < kLargest)) {
    near_load_ = near_rise_ = {};
    return;
  }
  // Rounding adds up to half a step for each of at most 96 forces. As they add up to nothing, none is more
  // than half of all.
  constexpr float kSteps = 65535.0f - 1.5f * static_cast<float>(kMaxSurfaceNodes);
  const float inverse = kSteps / sum_N, quantum = sum_N * (1.0f / kSteps);
  std::array<Row16, 3 * kMaxSurfaceNodes> row;
  std::size_t rows = 0;
  for (std::uint32_t n = 0; n < model_.nodes; ++n) {
    if (force[n] == Vec3f{}) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float f = force[n][axis] * inverse;
      row[rows++] = {static_cast<std::uint16_t>(3 * n + axis),
                     static_cast<std::int16_t>(static_cast<std::int32_t>(f < 0.0f ? f - 0.5f : f + 0.5f))};
    }
  }
  work_ += work_of_projection(rows, model_.modes);
  // A straight line from the middle of the steps in which the last forces acted to the middle of those to
  // come, or it would be heard.
  const float half = 0.5f * static_cast<float>(near_period_ - 1),
              half_before = 0.5f * static_cast<float>(near_acting_ - 1);
  const float per_step = 2.0f / static_cast<float>(near_period_ + near_acting_);
  dot16_columns(model_.basis, model_.modes, row.data(), rows, [&](std::size_t m, std::int32_t sum) {
    const float middle = static_cast<float>(sum) * (quantum * model_.basis_scale[m]);
    const float rise = per_step * (middle - (near_load_[m] - half_before * near_rise_[m]));
    near_load_[m] = middle - half * rise;
    near_rise_[m] = rise;
  });
  near_acting_ = near_period_;
}

void ModalSurface::advance() {
  if (near_.is_empty()) {
    pause_near_field();
  } else {
    step_near_field();
  }
  work_ += of_.step + of_.pass;
  before_ = now_;
  ++step_;
  moved();
  const float* __restrict c = model_.coefficient;
  const float* __restrict load = model_.load;
  const float* __restrict near_load = near_load_.data();
  const bool with_near = model_.springs != 0;
  float* __restrict q = state_->q.data();
  float* __restrict p = state_->p.data();
  for (std::size_t m = 0; m < model_.modes; ++m, c += kCoefficientsPerMode) {
    const float old_q = q[m], old_p = p[m], u = with_near ? load[m] + near_load[m] : load[m];
    q[m] = old_q + (c[0] * old_q + c[1] * old_p + c[4] * u);
    p[m] = old_p + (c[2] * old_q + c[3] * old_p + c[5] * u);
  }
}

// The motion of a surface point by modes, and its compliance: they change only when the contact point moves.
void ModalSurface::load_point(std::uint32_t triangle, const Vec3f& barycentric) {
  if (point_triangle_ == triangle && point_barycentric_ == barycentric) return;
  point_triangle_ = triangle;
  point_barycentric_ = barycentric;
  work_ += of_.new_point;
  const std::size_t modes = model_.modes;
  const auto corner = corners(triangle);
  point_rest_m_ = {};
  float fixed = 0.0f;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* x = model_.position_m + 3 * corner[k];
    point_rest_m_ += Vec3f{x[0], x[1], x[2]} * barycentric[k];
    if ((fixed_ >> corner[k] & 1u) != 0u) fixed += barycentric[k];
  }
  point_skin_m_N_ = fixed * static_cast<float>(1.0 / kSkinStiffness_N_m);
  const float wa = barycentric.x, wb = barycentric.y, wc = barycentric.z;
  const float* __restrict scale = model_.basis_scale;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int16_t* __restrict a = model_.basis + (3 * corner[0] + axis) * modes;
    const std::int16_t* __restrict b = model_.basis + (3 * corner[1] + axis) * modes;
    const std::int16_t* __restrict c = model_.basis + (3 * corner[2] + axis) * modes;
    float* __restrict out = point_basis_[axis].data();
    for (std::size_t m = 0; m < modes; ++m)
      out[m] =
          (wa * static_cast<float>(a[m]) + wb * static_cast<float>(b[m]) + wc * static_cast<float>(c[m])) *
          scale[m];
  }
  const float* __restrict wx = point_basis_[0].data();
  const float* __restrict wy = point_basis_[1].data();
  const float* __restrict wz = point_basis_[2].data();
  const float* __restrict c = model_.coefficient;
  float xx = 0, yy = 0, zz = 0, yz = 0, xz = 0, xy = 0;
  for (std::size_t m = 0; m < modes; ++m, c += kCoefficientsPerMode) {
    const float b = c[4] + kLead_s * c[5];
    const float bx = b * wx[m], by = b * wy[m], bz = b * wz[m];
    xx += bx * wx[m];
    yy += by * wy[m];
    zz += bz * wz[m];
    yz += by * wz[m];
    xz += bx * wz[m];
    xy += bx * wy[m];
  }
  point_compliance_m_N_ = {{{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}}};
}

PointResponse<float> ModalSurface::respond(std::uint32_t triangle, const Vec3f& barycentric) {
  load_point(triangle, barycentric);
  work_ += of_.pass;
  const float* __restrict wx = point_basis_[0].data();
  const float* __restrict wy = point_basis_[1].data();
  const float* __restrict wz = point_basis_[2].data();
  const float* __restrict q = state_->q.data();
  const float* __restrict p = state_->p.data();
  float x = 0, y = 0, z = 0;
  for (std::size_t m = 0; m < model_.modes; ++m) {
    const float ahead = q[m] + kLead_s * p[m];
    x += wx[m] * ahead;
    y += wy[m] * ahead;
    z += wz[m] * ahead;
  }
  return {point_rest_m_ + Vec3f{x, y, z}, point_compliance_m_N_, point_skin_m_N_};
}

void ModalSurface::apply(std::uint32_t triangle, const Vec3f& barycentric, const Vec3f& force_N) {
  load_point(triangle, barycentric);
  work_ += of_.pass;
  moved();
  const float fx = force_N.x, fy = force_N.y, fz = force_N.z;
  const float* __restrict wx = point_basis_[0].data();
  const float* __restrict wy = point_basis_[1].data();
  const float* __restrict wz = point_basis_[2].data();
  const float* __restrict c = model_.coefficient;
  float* __restrict q = state_->q.data();
  float* __restrict p = state_->p.data();
  for (std::size_t m = 0; m < model_.modes; ++m, c += kCoefficientsPerMode) {
    const float u = wx[m] * fx + wy[m] * fy + wz[m] * fz;
    q[m] += c[4] * u;
    p[m] += c[5] * u;
  }
}

}  // namespace palpate
