#include "shared/bench/contact_situations.hpp"

#include <cmath>

#include "shared/contact/contact.hpp"
#include "shared/model/backward_euler_mode.hpp"

namespace palpate::bench {
namespace {

constexpr float kSpacing_m = 0.01f;
constexpr float kNodeMass_kg = 0.001f;
// Along an axis, a face's and a body's diagonal.
constexpr std::array<float, 3> kSpringLength_m{0.01f, 0.0141421f, 0.0173205f};
constexpr std::array<float, 3> kSpringStiffness_N_m{100.0f, 100.0f, 100.0f};
constexpr std::array<float, 3> kSpringDamping_N_s_m{0.447f, 0.447f, 0.447f};
constexpr std::size_t kNearFieldModes = 96;

Vec3f random_vector(Lcg& random, float magnitude) {
  return {random.uniform(-magnitude, magnitude), random.uniform(-magnitude, magnitude),
          random.uniform(-magnitude, magnitude)};
}

}  // namespace

// Modes with random shapes, of such a size that a node weighs about a gram, stepped by backward Euler: the
// cost of a tick does not depend on their values.
void ContactSituations::build_model(ModelSize size, SurfaceKind surface, std::uint32_t number) {
  Lcg random(1000u * static_cast<std::uint32_t>(size) + number + 1u);
  const bool wide = size == ModelSize::modes_96_nodes_32, near = size == ModelSize::near_field;
  const std::size_t columns = wide ? 8 : 4, rows = 4, surface_nodes = columns * rows,
                    nodes = near ? 2 * surface_nodes : surface_nodes,
                    modes = size == ModelSize::modes_192_nodes_16 ? 192
                            : near                                ? kNearFieldModes
                                                                  : 96;
  // Flat triangles cost more the steeper their folds are.
  const float rough_m = surface == SurfaceKind::flat && number % 2 == 1 ? 5e-3f : 2e-3f;
  for (std::size_t n = 0; n < nodes; ++n) {
    const std::size_t column = n % columns, row = n / columns % rows;
    const float depth_m = n < surface_nodes ? 0.0f : kSpacing_m;
    rest_m_[3 * n] = static_cast<float>(column) * kSpacing_m;
    rest_m_[3 * n + 1] = static_cast<float>(row) * kSpacing_m;
    rest_m_[3 * n + 2] = -depth_m;
    position_m_[3 * n] = rest_m_[3 * n] + random.uniform(-1e-3f, 1e-3f);
    position_m_[3 * n + 1] = rest_m_[3 * n + 1] + random.uniform(-1e-3f, 1e-3f);
    position_m_[3 * n + 2] = rest_m_[3 * n + 2] + random.uniform(-rough_m, rough_m);
  }
  std::size_t t = 0;
  for (std::size_t j = 0; j + 1 < rows; ++j) {
    for (std::size_t i = 0; i + 1 < columns; ++i) {
      const std::size_t a = j * columns + i, b = a + 1, c = b + columns, d = a + columns;
      for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
        for (std::size_t k = 0; k < 3; ++k) corner_[3 * t + k] = static_cast<std::uint8_t>(corners[k]);
        triangle_id_[t] = static_cast<std::uint16_t>(t);
        ++t;
      }
    }
  }
  constexpr float kLargestEntry = 32767.0f;
  // A third of the modes moves along each axis; entries are uniform: their mean square is a third.
  const float largest = std::sqrt(9.0f / (kNodeMass_kg * static_cast<float>(modes)));
  for (std::size_t m = 0; m < modes; ++m) {
    for (std::size_t row = 0; row < 3 * nodes; ++row) {
      const std::int32_t range = row % 3 == m % 3 ? 32767 : 1000;
      basis_[row * modes + m] =
          static_cast<std::int16_t>(random.below(2u * static_cast<std::uint32_t>(range)) - range);
    }
    basis_scale_[m] = largest / kLargestEntry;
    const float omega_rad_s = random.uniform(250.0f, 1200.0f);
    const float lambda = omega_rad_s * omega_rad_s, damping_rad_s = omega_rad_s;
    backward_euler_mode(lambda, damping_rad_s, &coefficient_[kCoefficientsPerMode * m]);
    load_[m] = random.uniform(-1.0f, 1.0f);
  }
  view_ = LocalModelView{.modes = modes,
                         .nodes = nodes,
                         .surface_nodes = surface_nodes,
                         .triangles = t,
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
  view_.surface = surface;
  if (near) connect_neighbours();
}

// Springs between all nodes that are neighbours along an axis or a diagonal, as in a lattice with 26 of them.
void ContactSituations::connect_neighbours() {
  std::size_t springs = 0;
  for (std::size_t j = 1; j < view_.nodes; ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      std::size_t kind = 0;
      bool neighbours = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float apart = std::fabs(rest_m_[3 * i + axis] - rest_m_[3 * j + axis]);
        if (apart > 1.5f * kSpacing_m) neighbours = false;
        if (apart > 0.5f * kSpacing_m) ++kind;
      }
      if (!neighbours) continue;
      spring_end_[2 * springs] = static_cast<std::uint8_t>(i);
      spring_end_[2 * springs + 1] = static_cast<std::uint8_t>(j);
      spring_kind_[springs++] = static_cast<std::uint8_t>(kind - 1);
    }
  }
  view_.springs = springs;
  view_.rest_m = rest_m_.data();
  view_.spring_end = spring_end_.data();
  view_.spring_kind = spring_kind_.data();
  view_.spring_kinds = kSpringLength_m.size();
  view_.spring_stiffness_N_m = kSpringStiffness_N_m.data();
  view_.spring_damping_N_s_m = kSpringDamping_N_s_m.data();
  view_.spring_length_m = kSpringLength_m.data();
}

void ContactSituations::prepare(ModelSize size, SurfaceKind surface, std::uint32_t number) {
  const std::uint32_t model = number / kSituationsPerModel;
  if (!built_ || built_size_ != size || built_surface_ != surface || built_number_ != model) {
    build_model(size, surface, model);
    built_ = true;
    built_size_ = size;
    built_surface_ = surface;
    built_number_ = model;
  }
  Lcg random(2u * number + static_cast<std::uint32_t>(size) + 7u);
  // Nodes up to some millimetres from where the model was made, at up to some decimetres a second.
  for (std::size_t m = 0; m < view_.modes; ++m) {
    state_.q[m] = random.uniform(-5e-5f, 5e-5f);
    state_.p[m] = random.uniform(-5e-3f, 5e-3f);
  }
  const float friction = random.uniform(0.0f, 1.0f);
  friction_ = random.below(8) == 0 ? Friction<float>{} : Friction<float>{friction, friction};
  law_ = {};
  if (random.below(2) == 0) law_.tip_radius_m = random.uniform(0.0f, 0.005f);
  surface_.bind(view_, state_);
  place_tip(random);
}

void ContactSituations::place_tip(Lcg& random) {
  const auto triangle = static_cast<std::uint32_t>(random.below(static_cast<std::uint32_t>(view_.triangles)));
  const float a = random.uniform(0.0f, 1.0f), b = random.uniform(0.0f, 1.0f);
  const Vec3f barycentric =
      a + b <= 1.0f ? Vec3f{1.0f - a - b, a, b} : Vec3f{a + b - 1.0f, 1.0f - a, 1.0f - b};
  const auto corner = surface_.corners(triangle);
  const Vec3f x[3] = {surface_.position(corner[0]), surface_.position(corner[1]),
                      surface_.position(corner[2])};
  const Vec3f normal = normalized(cross(x[1] - x[0], x[2] - x[0]));
  const Vec3f point_m = x[0] * barycentric.x + x[1] * barycentric.y + x[2] * barycentric.z;
  contact_ = {};
  const bool free = random.below(3) == 0;
  // Up to 5 m/s: 5 mm a tick; mostly slower.
  const float reach_m = random.below(4) == 0 ? 5e-3f : 5e-4f;
  if (free) {
    contact_.outside = random.below(4) != 0;
    from_m_ = point_m + normal * (law_.tip_radius_m + random.uniform(0.0f, 3e-3f));
    to_m_ = from_m_ + random_vector(random, reach_m) - normal * random.uniform(0.0f, reach_m);
  } else {
    contact_.mode = random.below(2) == 0 ? ContactMode::stick : ContactMode::slip;
    contact_.triangle = triangle;
    contact_.barycentric = barycentric;
    contact_.normal = normal;
    from_m_ = point_m + normal * law_.tip_radius_m;
    to_m_ = from_m_ + random_vector(random, reach_m) - normal * random.uniform(0.0f, 1e-3f);
  }
}

void ContactSituations::step() {
  before_ = contact_;
  step_contact(surface_, contact_, law_, from_m_, to_m_);
}

TickKind ContactSituations::finish() {
  const Vec3f motion_m = to_m_ - from_m_;
  from_m_ = to_m_;
  to_m_ += motion_m;
  const bool was_free = before_.mode == ContactMode::free;
  if (contact_.mode == ContactMode::free) return was_free ? TickKind::free : TickKind::separation;
  if (was_free) return TickKind::first_contact;
  if (contact_.mode == ContactMode::stick) return TickKind::stick;
  return contact_.triangle == before_.triangle ? TickKind::slip : TickKind::edge_crossing;
}

}  // namespace palpate::bench
