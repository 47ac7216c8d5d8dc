#include "host/session/model_replay.hpp"

#include <stdexcept>
#include <string>
#include <vector>

#include "host/msd/vectors.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::host {

ModelReplay::ModelReplay(const palpate_LocalModel_1_0& message, const Vec3f& tip_m, std::uint32_t tick)
    : message_(std::make_unique<palpate_LocalModel_1_0>(message)),
      renderer_(std::make_unique<firmware::Renderer>(wire::kSchemaHash)),
      tick_(tick) {
  std::vector<std::uint8_t> payload(wire::MessageTraits<palpate_LocalModel_1_0>::kMaxBytes);
  std::size_t length = 0;
  Status status = wire::serialize(message, payload, length);
  firmware::ModelReport report;
  (void)renderer_->isr_tick(tick_, tip_m);
  if (status == Status::ok) status = renderer_->accept(std::span(payload).first(length), report);
  // Decoding, checking and catching up (nothing: no tick has passed) take a pass each. A report means
  // refusal.
  constexpr int kPasses = 3;
  for (int pass = 0; pass < kPasses && status == Status::ok; ++pass)
    if (renderer_->catch_up(report)) status = report.status;
  if (status != Status::ok)
    throw std::invalid_argument("local model " + std::to_string(message.sequence) +
                                ": the board would refuse it with status " +
                                std::to_string(static_cast<int>(status)));
  wire::read_state(message, state_);
}

firmware::ServoSample ModelReplay::step(const Vec3f& tip_m) {
  const firmware::ServoSample sample = renderer_->isr_tick(++tick_, tip_m);
  state_ = *renderer_->model_state();
  return sample;
}

ContactState<double> ModelReplay::contact() const {
  const ContactState<float>* now = renderer_->model_contact();
  if (now == nullptr) throw std::logic_error("a replay has no contact before its first step");
  ContactState<double> contact;
  contact.mode = now->mode;
  if (now->mode != ContactMode::free) contact.triangle = message_->triangle_id.elements[now->triangle];
  contact.barycentric = widen(now->barycentric);
  contact.force_N = widen(now->force_N);
  contact.normal = widen(now->normal);
  contact.stretch_m = widen(now->stretch_m);
  contact.inset_m = static_cast<double>(now->inset_m);
  contact.overhang_m = widen(now->overhang_m);
  contact.height_m = static_cast<double>(now->height_m);
  contact.outside = now->outside;
  contact.at_border = now->at_border;
  return contact;
}

Eigen::Vector3d ModelReplay::surface_node_m(std::size_t node) const {
  const palpate_LocalModel_1_0& m = *message_;
  Eigen::Vector3d position_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t row = 3 * node + axis;
    double x = static_cast<double>(m.origin_m[axis]) + static_cast<double>(m.position_m.elements[row]);
    for (std::size_t mode = 0; mode < m.modes; ++mode)
      x += static_cast<double>(m.basis.elements[row * m.modes + mode]) *
           static_cast<double>(m.basis_scale.elements[mode]) * static_cast<double>(state_.q[mode]);
    position_m[static_cast<Eigen::Index>(axis)] = x;
  }
  return position_m;
}

}  // namespace palpate::host
