#include "host/bench/board_patch.hpp"

#include <cstddef>

#include "host/msd/vectors.hpp"
#include "host/session/model_message.hpp"
#include "host/session/surface_friction.hpp"
#include "shared/servo_tick.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::host::bench {

BoardPatch::BoardPatch(const Body& body, const BodyState& state, const Eigen::Vector3d& near_m,
                       SurfaceKind kind, double friction)
    : model_(build_patch(body, state, nearest_surface_point(body, state.position_m, near_m), PatchSize{},
                         kTick_s)),
      message_(std::make_unique<wire::ModelContents>()) {
  wire::ModelContents& m = *message_;
  const FrictionSpec spec{.elsewhere = {friction, friction}, .regions = {}};
  pack_model(model_, ModelStamp{}, {}, kind, SurfaceFriction(body, spec), {}, m);
  view_ = wire::view_of(m);
  wire::read_state(m, state_);
}

Vec3f BoardPatch::to_patch(const Vec3d& position_m) const {
  return narrow(position_m) - view_.origin_m;
}

Vec3d BoardPatch::moved_m(const ModalState& before, std::uint32_t triangle, const Vec3d& barycentric) const {
  Vec3d moved_m{};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t node = view_.corner[3 * triangle + c];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int16_t* row = view_.basis + (3 * node + axis) * view_.modes;
      double sum_m = 0;
      for (std::size_t m = 0; m < view_.modes; ++m)
        sum_m += row[m] * static_cast<double>(view_.basis_scale[m]) *
                 (static_cast<double>(state_.q[m]) - static_cast<double>(before.q[m]));
      moved_m[axis] += barycentric[c] * sum_m;
    }
  }
  return moved_m;
}

double BoardPatch::energy_J() const {
  double energy_J = 0;
  for (Eigen::Index m = 0; m < model_.modes(); ++m) {
    const auto at = static_cast<std::size_t>(m);
    const double q = static_cast<double>(state_.q[at]), p = static_cast<double>(state_.p[at]);
    energy_J += 0.5 * p * p + 0.5 * model_.lambda_rad2_s2[m] * q * q - model_.load[m] * q;
  }
  return energy_J;
}

ContactState<double> widen_contact(const ContactState<float>& contact) {
  ContactState<double> wide;
  wide.mode = contact.mode;
  wide.triangle = contact.triangle;
  wide.force_N = widen(contact.force_N);
  wide.normal = widen(contact.normal);
  return wide;
}

}  // namespace palpate::host::bench
