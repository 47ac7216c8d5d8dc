#include "shared/golden/golden_trace.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "shared/contact/contact.hpp"
#include "shared/device/actuation.hpp"
#include "shared/device/arm.hpp"
#include "shared/device/count_estimator.hpp"
#include "shared/device/encoders.hpp"
#include "shared/math/lcg.hpp"
#include "shared/math/trig.hpp"
#include "shared/model/backward_euler_mode.hpp"

namespace palpate::golden {
namespace {

constexpr float kSpacing_m = 0.01f;

// A movement of the tip's centre in a straight line, with a small circle on top that makes it stick and slip.
struct Movement {
  std::uint32_t ticks;
  Vec3f to_m;
  float circle_m;  // radius, in the surface's plane; one turn in 125 ticks
  Friction<float> friction;
  ContactLaw<float> law;
};

constexpr float kCircle_rad_per_tick = 0.0502654825f;  // 2 pi / 125
constexpr Vec3f kStart_m{0.008f, 0.011f, 0.012f};
constexpr Friction<float> kRough{1.0f, 1.0f}, kUsual{0.4f, 0.3f}, kSlippery{0.0f, 0.0f}, kMiddle{0.5f, 0.5f};
constexpr ContactLaw<float> kPoint{0.0f}, kBall{0.003f};
constexpr Movement kMovements[] = {
    {300, {0.008f, 0.011f, -0.002f}, 0.0f, kRough, kPoint},      // touches, presses: sticks
    {400, {0.010f, 0.012f, -0.002f}, 0.0003f, kRough, kPoint},   // held with a tremor
    {900, {0.024f, 0.019f, -0.0015f}, 0.0004f, kUsual, kPoint},  // dragged: slips, sticks again
    {300, {0.024f, 0.019f, 0.010f}, 0.0f, kUsual, kPoint},       // lifted off
    {300, {0.022f, 0.006f, -0.001f}, 0.0f, kSlippery, kPoint},   // touches elsewhere
    {600, {0.005f, 0.024f, -0.001f}, 0.0f, kSlippery, kPoint},   // without friction, diagonally
    {400, {0.0f, 0.033f, -0.001f}, 0.0f, kSlippery, kPoint},     // over the border
    {200, {0.016f, 0.015f, 0.015f}, 0.0f, kMiddle, kBall},       // away
    {10, {0.016f, 0.015f, 0.0015f}, 0.0f, kMiddle, kBall},       // a fast hit with a sphere
    {800, {0.006f, 0.016f, 0.0015f}, 0.0005f, kMiddle, kBall},   // dragged back
    {200, {0.006f, 0.016f, 0.03f}, 0.0f, kMiddle, kBall},        // far away: the near test says no
    {100, {0.016f, 0.015f, 0.001f}, 0.0f, kMiddle, kBall},
    {100, {0.016f, 0.015f, -0.0005f}, 0.0f, kMiddle, kBall},
};

// A way of touching, and a movement of the arm's joints in straight lines with a small circle on top. All of
// the ways go through all of the movements; the tip is inside the body at first.
struct Touch {
  SurfaceKind surface;
  Friction<float> friction;
  ContactLaw<float> law;
};
constexpr Touch kTouches[] = {
    {SurfaceKind::flat, kUsual, kPoint},
    {SurfaceKind::flat, kMiddle, {0.0f, {800.0f, 1.0f}}},
    {SurfaceKind::smooth, kUsual, {0.0f, {2000.0f, 1.0f}}},
    {SurfaceKind::flat, kSlippery, {0.003f, {500.0f, 0.5f}}},
};
struct JointMovement {
  std::uint32_t ticks;
  Vec3f to_rad;
};
constexpr Vec3f kFirst_rad{-0.03f, -0.028f, -0.02f};
constexpr JointMovement kJointMovements[] = {
    {150, kFirst_rad},                 // held inside
    {100, {-0.03f, -0.033f, -0.02f}},  // pushed further in
    {300, {-0.03f, 0.005f, -0.02f}},   // led out
    {200, {-0.03f, -0.022f, -0.02f}},  // touches from outside
    {600, {0.04f, -0.022f, 0.03f}},    // dragged over the diagonal
    {300, {0.04f, -0.024f, -0.05f}},
    {300, {0.09f, -0.024f, -0.05f}},  // over the border
    {200, {0.04f, -0.022f, 0.0f}},    // and back
    {150, {0.04f, 0.01f, 0.0f}},      // lifted off
};
constexpr float kTremor_rad = 0.0004f;
// Where the patch lies: its corner, in the device frame.
constexpr Vec3f kPatch_m{-0.015f, -0.015f, -0.003f};

void count(Counters& counters, const ContactState<float>& before, const ContactState<float>& after) {
  const bool was_free = before.mode == ContactMode::free, is_free = after.mode == ContactMode::free;
  counters.free_ticks += is_free;
  counters.stick_ticks += after.mode == ContactMode::stick;
  counters.slip_ticks += after.mode == ContactMode::slip;
  counters.touches += was_free && !is_free;
  counters.separations += !was_free && is_free;
  counters.stick_to_slip += before.mode == ContactMode::stick && after.mode == ContactMode::slip;
  counters.slip_to_stick += before.mode == ContactMode::slip && after.mode == ContactMode::stick;
  counters.edge_crossings += !was_free && !is_free && before.triangle != after.triangle;
  counters.border_ticks += !is_free && after.at_border;
  counters.inset_ticks += after.inset_m > 0.0f;
  counters.stretched_ticks += !(after.stretch_m == Vec3f{});
  const float force_N = norm(after.force_N);
  if (force_N > counters.largest_force_N) counters.largest_force_N = force_N;
}

void run_device(Result& result) {
  constexpr std::uint32_t kPoses = 3000;
  const device::Parameters& arm = device::kPremium15;
  const device::EncoderCounts reference{1200, -800, 2147483000};  // the third counter wraps around
  Lcg random(3);
  Fnv1a hash;
  for (std::uint32_t i = 0; i < kPoses; ++i) {
    // Incommensurate sweeps of the joints through and a little beyond their limits, and encoder noise.
    const float t = static_cast<float>(i) * 0.01f;
    const float upper_rad = 0.4f + 1.35f * sin_cos(1.618034f * t).sine;
    const Vec3f swept_rad{1.25f * sin_cos(t).sine, upper_rad,
                          upper_rad - 0.1f + 1.1f * sin_cos(2.236068f * t).cosine};
    device::EncoderCounts counts{};
    for (std::size_t j = 0; j < 3; ++j) {
      const auto difference =
          static_cast<std::uint32_t>(device::encoder_count(arm.joint[j], swept_rad[j]) + random.below(3) - 1);
      counts[j] = static_cast<std::int32_t>(static_cast<std::uint32_t>(reference[j]) + difference);
      hash.add(static_cast<std::uint32_t>(counts[j]));
    }
    const Vec3f joint_rad = device::joint_angles(arm, counts, reference);
    const device::Pose pose = device::evaluate(arm, joint_rad);
    result.counters.pose_faults += pose.faults != 0;
    hash.add(joint_rad);
    hash.add(std::uint32_t{pose.faults});
    hash.add(pose.tip_m);
    for (const Vec3f& row : pose.jacobian_m.row) hash.add(row);
    hash.add(pose.gravity_torque_N_m);

    const Vec3f force_N{static_cast<float>(random.below(2001) - 1000) * 0.01f,
                        static_cast<float>(random.below(2001) - 1000) * 0.01f,
                        static_cast<float>(random.below(2001) - 1000) * 0.01f};
    const Vec3f torque_N_m = device::joint_torque(pose, force_N) + pose.gravity_torque_N_m;
    const device::CurrentSetpoints currents = device::motor_currents(arm, torque_N_m);
    result.counters.limited_currents += currents.scale < 1.0f;
    hash.add(torque_N_m);
    hash.add(currents.current_A);
    hash.add(currents.scale);
  }
  result.device_hash = hash.value();
}

void run_math(Result& result) {
  Fnv1a hash;
  // Beyond the accepted range on both sides.
  constexpr std::int32_t kAngles = 10100;
  for (std::int32_t i = -kAngles; i <= kAngles; ++i) {
    const SinCos both = sin_cos(static_cast<float>(i) * 0.00992f);
    hash.add(both.sine);
    hash.add(both.cosine);
  }
  result.math_hash = hash.value();
}

// Along a row or column, and a diagonal.
constexpr std::array<float, 2> kSpringLength_m{kSpacing_m, 1.41421f * kSpacing_m};
constexpr std::array<float, 2> kSpringStiffness_N_m{100.0f, 70.0f};
constexpr std::array<float, 2> kSpringDamping_N_s_m{0.4f, 0.3f};

}  // namespace

void Fnv1a::add(std::uint32_t word) {
  constexpr std::uint64_t kPrime = 1099511628211ull;
  for (int shift = 0; shift < 32; shift += 8) hash_ = (hash_ ^ ((word >> shift) & 0xffu)) * kPrime;
}

void Fnv1a::add(float value) {
  constexpr std::uint32_t kNan = 0x7fc00000u;
  add(std::isnan(value) ? kNan : std::bit_cast<std::uint32_t>(value));
}

void Fnv1a::add(const Vec3f& vector) {
  add(vector.x);
  add(vector.y);
  add(vector.z);
}

// Modes are Walsh functions over the nodes, one set per axis: orthogonal, and made of integers alone. An LCG
// disturbs rest positions and basis, so that no two numbers are equal by symmetry.
void GoldenTrace::build_model() {
  Lcg random(1);
  for (std::size_t n = 0; n < kNodes; ++n) {
    const std::size_t column = n % kSide, row = n / kSide;
    position_m_[3 * n] =
        static_cast<float>(column) * kSpacing_m + static_cast<float>(random.below(1000)) * 1e-6f;
    position_m_[3 * n + 1] =
        static_cast<float>(row) * kSpacing_m + static_cast<float>(random.below(1000)) * 1e-6f;
    position_m_[3 * n + 2] = static_cast<float>(random.below(1000)) * 1e-6f;
  }
  std::size_t t = 0;
  for (std::size_t j = 0; j + 1 < kSide; ++j) {
    for (std::size_t i = 0; i + 1 < kSide; ++i) {
      const std::size_t a = j * kSide + i, b = a + 1, c = b + kSide, d = a + kSide;
      for (const auto& nodes : {std::array{a, b, c}, std::array{a, c, d}}) {
        for (std::size_t k = 0; k < 3; ++k) corner_[3 * t + k] = static_cast<std::uint8_t>(nodes[k]);
        triangle_id_[t] = static_cast<std::uint16_t>(100 + t);
        ++t;
      }
    }
  }

  for (std::size_t m = 0; m < kModes; ++m) {
    const std::size_t axis = m % 3, walsh = m / 3;
    for (std::size_t row = 0; row < 3 * kNodes; ++row) {
      const bool negative = (std::popcount(walsh & (row / 3)) & 1) != 0;
      const std::int32_t size = row % 3 == axis ? 30000 + random.below(2767) : random.below(600) - 300;
      basis_[row * kModes + m] = static_cast<std::int16_t>(negative ? -size : size);
    }
    // 1 / (sqrt(16 nodes) sqrt(1 g)) = 7.9 for the largest entries.
    basis_scale_[m] = 7.9f / 32767.0f;
    // Frequencies from 250 to 1,150 rad/s, every fourth mode hardly damped.
    const float omega_rad_s = 250.0f + 60.0f * static_cast<float>(walsh);
    const float lambda = omega_rad_s * omega_rad_s;
    const float damping_rad_s = m % 4 == 0 ? 5.0f : 0.8f * omega_rad_s;
    backward_euler_mode(lambda, damping_rad_s, &coefficient_[kCoefficientsPerMode * m]);
    load_[m] = static_cast<float>(random.below(2001) - 1000) * 1e-3f;
  }
  view_ = LocalModelView{.modes = kModes,
                         .nodes = kNodes,
                         .surface_nodes = kNodes,
                         .triangles = kTriangles,
                         .origin_m = {},
                         .position_m = position_m_.data(),
                         .corner = corner_.data(),
                         .triangle_id = triangle_id_.data(),
                         .frictions = 1,
                         .static_friction = &friction_.static_coefficient,
                         .kinetic_friction = &friction_.kinetic_coefficient,
                         .triangle_friction = triangle_friction_.data(),
                         .coefficient = coefficient_.data(),
                         .load = load_.data(),
                         .basis_scale = basis_scale_.data(),
                         .basis = basis_.data()};
  state_ = {};
}

// Along the rows, the columns and the diagonals, at rest where the masses are undisturbed.
void GoldenTrace::connect_neighbours() {
  for (std::size_t n = 0; n < kNodes; ++n) {
    const std::size_t column = n % kSide, row = n / kSide;
    rest_m_[3 * n] = static_cast<float>(column) * kSpacing_m;
    rest_m_[3 * n + 1] = static_cast<float>(row) * kSpacing_m;
  }
  std::size_t s = 0;
  for (std::size_t j = 1; j < kNodes; ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      const std::size_t column = i % kSide > j % kSide ? i % kSide - j % kSide : j % kSide - i % kSide,
                        row = j / kSide - i / kSide;
      if (column > 1 || row > 1) continue;
      spring_end_[2 * s] = static_cast<std::uint8_t>(i);
      spring_end_[2 * s + 1] = static_cast<std::uint8_t>(j);
      spring_kind_[s++] = static_cast<std::uint8_t>(column + row - 1);
    }
  }
  view_.springs = s;
  view_.rest_m = rest_m_.data();
  view_.spring_end = spring_end_.data();
  view_.spring_kind = spring_kind_.data();
  view_.spring_kinds = kSpringLength_m.size();
  view_.spring_stiffness_N_m = kSpringStiffness_N_m.data();
  view_.spring_damping_N_s_m = kSpringDamping_N_s_m.data();
  view_.spring_length_m = kSpringLength_m.data();
}

void GoldenTrace::run_model(Result& result) {
  build_model();
  result.model_hash = run_movements(result.counters);
  result.work += surface_.work();
}

void GoldenTrace::run_near(Result& result) {
  build_model();
  connect_neighbours();
  result.near_hash = run_movements(result.near);
  result.work += surface_.work();
}

std::uint64_t GoldenTrace::run_movements(Counters& counters) {
  Fnv1a hash;
  hash.add(static_cast<std::uint32_t>(check(view_, state_)));
  surface_.bind(view_, state_);
  ContactState<float> contact{};
  Vec3f start_m = kStart_m, tip_m = kStart_m;
  std::uint32_t tick = 0;
  for (const Movement& movement : kMovements) {
    friction_ = movement.friction;
    // As while a model catches up, and as when it has.
    surface_.set_near_period(tick % 2 == 0 ? 8 : kNearPeriod_steps);
    for (std::uint32_t i = 1; i <= movement.ticks; ++i, ++tick) {
      const float fraction = static_cast<float>(i) / static_cast<float>(movement.ticks);
      const SinCos turn = sin_cos(kCircle_rad_per_tick * static_cast<float>(i % 125));
      const Vec3f next_m = start_m + (movement.to_m - start_m) * fraction +
                           Vec3f{turn.sine, 1.0f - turn.cosine, 0.0f} * movement.circle_m;
      const ContactState<float> before = contact;
      step_contact(surface_, contact, movement.law, tip_m, next_m);
      tip_m = next_m;
      count(counters, before, contact);

      hash.add(static_cast<std::uint32_t>(contact.mode));
      hash.add(contact.force_N);
      hash.add(std::uint32_t{contact.at_border} | std::uint32_t{contact.outside} << 1);
      if (contact.mode != ContactMode::free) {
        hash.add(contact.triangle);
        hash.add(contact.barycentric);
      }
      constexpr std::uint32_t kTicksPerState = 16;
      if (tick % kTicksPerState == 0) {
        for (std::uint32_t node = 0; node < kNodes; ++node) hash.add(surface_.position(node));
        for (std::size_t m = 0; m < kModes; ++m) {
          hash.add(state_.q[m]);
          hash.add(state_.p[m]);
        }
      }
    }
    start_m = movement.to_m;
  }
  return hash.value();
}

void GoldenTrace::run_felt(Result& result) {
  const device::Parameters& arm = device::kPremium15;
  Fnv1a hash;
  for (const Touch& touch : kTouches) {
    build_model();
    view_.surface = touch.surface;
    friction_ = touch.friction;
    surface_.bind(view_, state_);
    ContactState<float> contact{};
    device::CountEstimators estimators{};
    device::EncoderCounts counts{};
    for (std::size_t j = 0; j < 3; ++j) counts[j] = device::encoder_count(arm.joint[j], kFirst_rad[j]);
    Vec3f start_rad = kFirst_rad,
          tip_m = device::forward_kinematics(arm, device::joint_angles(arm, counts, {})) - kPatch_m;
    for (const JointMovement& movement : kJointMovements) {
      for (std::uint32_t i = 1; i <= movement.ticks; ++i) {
        const float fraction = static_cast<float>(i) / static_cast<float>(movement.ticks);
        const SinCos turn = sin_cos(kCircle_rad_per_tick * static_cast<float>(i % 125));
        const Vec3f joint_rad = start_rad + (movement.to_rad - start_rad) * fraction +
                                Vec3f{turn.sine, 0.0f, 1.0f - turn.cosine} * kTremor_rad;
        for (std::size_t j = 0; j < 3; ++j) {
          const std::int32_t now = device::encoder_count(arm.joint[j], joint_rad[j]);
          estimators[j].update(static_cast<float>(now - counts[j]), 1.0f);
          counts[j] = now;
        }
        const device::Pose pose = device::evaluate(arm, device::joint_angles(arm, counts, {}));
        const Vec3f estimated_m = device::estimated_tip(arm, pose, estimators);
        result.farthest_estimate_m = std::max(result.farthest_estimate_m, norm(estimated_m - pose.tip_m));
        const Vec3f next_m = estimated_m - kPatch_m;
        const ContactState<float> before = contact;
        step_contact(surface_, contact, touch.law, tip_m, next_m);
        tip_m = next_m;
        count(result.felt, before, contact);

        hash.add(next_m);
        hash.add(static_cast<std::uint32_t>(contact.mode));
        hash.add(contact.force_N);
        hash.add(contact.normal);
        hash.add(contact.height_m);
        hash.add(std::uint32_t{contact.at_border} | std::uint32_t{contact.outside} << 1);
        if (contact.mode == ContactMode::free) continue;
        hash.add(contact.triangle);
        hash.add(contact.barycentric);
        hash.add(contact.stretch_m);
        hash.add(contact.inset_m);
        hash.add(contact.overhang_m);
      }
      start_rad = movement.to_rad;
    }
    result.work += surface_.work();
  }
  result.felt_hash = hash.value();
}

Result GoldenTrace::run() {
  Result result{};
  run_model(result);
  run_near(result);
  run_felt(result);
  run_device(result);
  run_math(result);
  return result;
}

}  // namespace palpate::golden
