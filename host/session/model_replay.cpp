#include "host/session/model_replay.hpp"

#include <stdexcept>
#include <string>
#include <vector>

#include "host/msd/vectors.hpp"
#include "shared/wire/model_basis.hpp"
#include "shared/wire/model_state.hpp"

namespace palpate::host {

namespace {

template <class Message>
std::vector<std::uint8_t> payload_of(const Message& message) {
  std::vector<std::uint8_t> payload(wire::MessageTraits<Message>::kMaxBytes);
  std::size_t length = 0;
  if (wire::serialize(message, payload, length) != Status::ok)
    throw std::invalid_argument("a part of a local model cannot be serialized");
  payload.resize(length);
  return payload;
}

}  // namespace

ModelReplay::ModelReplay(const wire::PackedModel& model, const Vec3f& tip_m, std::uint32_t tick)
    : basis_(model.basis),
      renderer_(std::make_unique<firmware::Renderer>(wire::kSchemaHash, firmware::kCatchUpCortexM4)),
      tick_(tick) {
  firmware::ModelReport report;
  (void)renderer_->isr_tick(tick_, tip_m);
  if (basis_) {
    for (const auto& part : wire::parts_of(*basis_, model.state.basis_id))
      (void)renderer_->accept_part(payload_of(part));
  }
  Status status = renderer_->accept(payload_of(model.state), report);
  // Decoding, checking and catching up (nothing: no tick has passed) take a pass each. A report means
  // refusal.
  constexpr int kPasses = 3;
  for (int pass = 0; pass < kPasses && status == Status::ok; ++pass)
    if (renderer_->catch_up(report)) status = report.status;
  ContactLaw<float> law;
  if (status == Status::ok && basis_) status = wire::open_basis(*basis_, wire::kSchemaHash, view_, law);
  if (status != Status::ok)
    throw std::invalid_argument("local model " + std::to_string(model.state.sequence) +
                                ": the board would refuse it with status " +
                                std::to_string(static_cast<int>(status)));
  position_m_.resize(3 * view_.nodes);
  load_.resize(view_.modes);
  wire::read_state(model.state, view_, position_m_.data(), load_.data(), state_);
  view_.position_m = position_m_.data();
  view_.load = load_.data();
}

void ModelReplay::set_near_period(std::uint32_t steps) {
  renderer_->isr_set_near_period(steps);
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
  if (now->mode != ContactMode::free) contact.triangle = view_.triangle_id[now->triangle];
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
  Eigen::Vector3d position_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t row = 3 * node + axis;
    double x = static_cast<double>(view_.origin_m[axis]) + static_cast<double>(view_.position_m[row]);
    for (std::size_t mode = 0; mode < view_.modes; ++mode)
      x += static_cast<double>(view_.basis[row * view_.modes + mode]) *
           static_cast<double>(view_.basis_scale[mode]) * static_cast<double>(state_.q[mode]);
    position_m[static_cast<Eigen::Index>(axis)] = x;
  }
  return position_m;
}

}  // namespace palpate::host
