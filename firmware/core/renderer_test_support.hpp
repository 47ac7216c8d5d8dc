// What the tests of the renderer share: a tip that comes and goes, a renderer with its two contexts, and the
// same model stepped directly.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "firmware/test_support.hpp"
#include "shared/contact/contact.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::firmware::test {

inline constexpr Vec3f kCentre_m{0.001f, -0.002f, 0.003f};
inline constexpr std::uint8_t kModelUsed = palpate_ServoSample_1_0_FLAG_MODEL_USED,
                              kModelSwap = palpate_ServoSample_1_0_FLAG_MODEL_SWAP;

// Down onto the square, a slow circle on it, and up again: every 400 ticks.
inline Vec3f tip_at(std::uint32_t tick) {
  const float phase = static_cast<float>(tick % 400) / 400.0f;
  const float angle_rad = 6.2831853f * phase;
  return kCentre_m + Vec3f{0.0025f * std::cos(angle_rad), 0.0025f * std::sin(2.0f * angle_rad),
                           0.001f - 0.0025f * std::sin(3.1415927f * phase)};
}

inline void expect_equal(const ServoSample& a, const ServoSample& b, std::uint32_t tick) {
  EXPECT_EQ(a.tip_m, b.tip_m) << tick;
  EXPECT_EQ(a.force_N, b.force_N) << tick;
  EXPECT_EQ(a.mode, b.mode) << tick;
  EXPECT_EQ(a.flags, b.flags) << tick;
  EXPECT_EQ(a.triangle, b.triangle) << tick;
}

// A model, quantized as the board has it, stepped directly.
class Reference {
 public:
  Reference(const wire::ModelContents& message, const Vec3f& tip_m)
      : message_(std::make_unique<wire::ModelContents>(wire::unpack(wire::pack(message), message))) {
    const wire::ModelContents& m = *message_;
    view_ = wire::view_of(m);
    wire::read_state(m, state_);
    surface_.bind(view_, state_);
    previous_m_ = tip_m - view_.origin_m;
    if (m.contact.mode == palpate_Contact_1_0_MODE_FREE) return;
    contact_.mode = static_cast<ContactMode>(m.contact.mode);
    while (view_.triangle_id[contact_.triangle] != m.contact.triangle) ++contact_.triangle;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      contact_.barycentric[axis] = m.contact.barycentric[axis];
      contact_.stretch_m[axis] = m.contact.coupling_stretch_m[axis];
      contact_.overhang_m[axis] = m.contact.overhang_m[axis];
    }
    contact_.inset_m = m.contact.inset_m;
    contact_.height_m = m.contact.height_m;
  }
  const ContactState<float>& step(const Vec3f& tip_m) {
    const ContactLaw<float> law{
        .tip_radius_m = message_->tip_radius_m,
        .coupling = {message_->coupling_stiffness_N_m, message_->coupling_damping_N_s_m}};
    step_contact(surface_, contact_, law, previous_m_, tip_m - view_.origin_m);
    previous_m_ = tip_m - view_.origin_m;
    return contact_;
  }
  [[nodiscard]] const ContactState<float>& contact() const { return contact_; }
  void set_near_period(std::uint32_t steps) { surface_.set_near_period(steps); }
  // How much the force can change per change of the tip, in a step that sticks or has no friction: the
  // inverse of the point's compliance (Frobenius norm, not below the spectral one) and the target's
  // extrapolation.
  [[nodiscard]] float stiffness_N_m() {
    const auto response = surface_.respond(contact_.triangle, contact_.barycentric);
    float sum = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vec3f unit{}, column{};
      unit[axis] = 1.0f;
      EXPECT_TRUE(solve(response.compliance_m_N, unit, column));
      sum += dot(column, column);
    }
    return std::sqrt(sum) * (1.0f + surface_.target_extrapolation());
  }
  // The model with the state and the contact that it has now.
  wire::ModelContents as_it_is(std::uint32_t sequence, std::uint32_t tick) const {
    wire::ModelContents m = *message_;
    m.sequence = sequence;
    m.tick = tick;
    for (std::size_t i = 0; i < m.modes; ++i) {
      m.state_q.elements[i] = state_.q[i];
      m.state_p.elements[i] = state_.p[i];
    }
    m.contact.mode = static_cast<std::uint8_t>(contact_.mode);
    m.contact.triangle = m.triangle_id.elements[contact_.triangle];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      m.contact.barycentric[axis] = contact_.barycentric[axis];
      m.contact.force_N[axis] = contact_.force_N[axis];
      m.contact.coupling_stretch_m[axis] = contact_.stretch_m[axis];
    }
    m.contact.height_m = contact_.height_m;
    return m;
  }

 private:
  std::unique_ptr<wire::ModelContents> message_;
  LocalModelView view_{};
  ModalState state_{};
  ModalSurface surface_{};
  ContactState<float> contact_{};
  Vec3f previous_m_{};
};

// Gives basis and state to the renderer.
inline Status deliver(Renderer& renderer, const wire::ModelContents& contents, ModelReport& report) {
  const wire::PackedModel packed = wire::pack(contents);
  if (packed.basis) {
    for (const auto& part : wire::parts_of(*packed.basis, packed.state.basis_id))
      EXPECT_EQ(renderer.accept_part(HostPeer::payload(part)), Status::ok);
  }
  return renderer.accept(HostPeer::payload(packed.state), report);
}

// A renderer with its two contexts in turn.
struct Runner {
  // Interrupt, then background; the tick's sample.
  ServoSample tick() {
    const ServoSample sample = renderer->isr_tick(now, tip_at(now));
    ++now;
    ModelReport report;
    if (renderer->catch_up(report)) reports.push_back(report);
    for (BasisStore::Event event; renderer->next_basis_event(event);) basis_events.push_back(event);
    return sample;
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) (void)tick();
  }
  Status accept(const wire::ModelContents& contents) {
    ModelReport report;
    const Status status = deliver(*renderer, contents, report);
    if (status != Status::ok) reports.push_back(report);
    return status;
  }
  Status accept(const std::vector<std::uint8_t>& payload) {
    ModelReport report;
    const Status status = renderer->accept(payload, report);
    if (status != Status::ok) reports.push_back(report);
    return status;
  }

  std::unique_ptr<Renderer> renderer = std::make_unique<Renderer>(wire::kSchemaHash, kCatchUpCortexM4);
  std::uint32_t now = 0;  // the next tick
  std::vector<ModelReport> reports;
  std::vector<BasisStore::Event> basis_events;
};

}  // namespace palpate::firmware::test
