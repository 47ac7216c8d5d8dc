#include "firmware/core/renderer.hpp"

#include <cmath>

#include "shared/wire/messages.hpp"
#include "shared/wire/model_view.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint8_t kFlagModelUsed = 4, kFlagModelSwap = 8;  // palpate.ServoSample FLAG_*
static_assert((kTipHistory & (kTipHistory - 1)) == 0, "the history is indexed by tick modulo its length");

bool counts_agree(const palpate_LocalModel_1_0& m) {
  return m.position_m.count == 3u * m.nodes && m.triangle_id.count == m.triangles &&
         m.corner.count == 3u * m.triangles && m.coefficient.count == kCoefficientsPerMode * m.modes &&
         m.triangle_friction.count == m.triangles && m.kinetic_friction.count == m.static_friction.count &&
         m.load.count == m.modes && m.state_q.count == m.modes && m.state_p.count == m.modes &&
         m.basis_scale.count == m.modes && m.basis.count == 3u * m.nodes * m.modes;
}

// What a model may say of tip, coupling and contact: what a scene may (docs/scenes.md), and offsets within
// the reach of the arm. Beyond, a model is a fault of its sender.
constexpr float kLargestTipRadius_m = 0.05f;
constexpr float kSoftestCoupling_N_m = 10.0f, kStiffestCoupling_N_m = 1e6f;
constexpr float kLargestCouplingDamping_N_s_m = 1e3f;
constexpr float kLargestOffset_m = 1.0f;  // stretch, inset, overhang and height

// False for NaN.
bool is_within(float value, float low, float high) {
  return value >= low && value <= high;
}

bool law_is_valid(const palpate_LocalModel_1_0& m) {
  const bool kinematic = m.coupling_stiffness_N_m == 0.0f;
  return is_within(m.tip_radius_m, 0.0f, kLargestTipRadius_m) &&
         (kinematic || is_within(m.coupling_stiffness_N_m, kSoftestCoupling_N_m, kStiffestCoupling_N_m)) &&
         is_within(m.coupling_damping_N_s_m, 0.0f, kLargestCouplingDamping_N_s_m) &&
         m.tip_source <= static_cast<std::uint8_t>(TipSource::estimated);
}

// Of a contact, with finite numbers.
bool offsets_are_valid(const ContactState<float>& contact) {
  return is_within(contact.inset_m, 0.0f, kLargestOffset_m) && norm(contact.stretch_m) <= kLargestOffset_m &&
         norm(contact.overhang_m) <= kLargestOffset_m && std::fabs(contact.height_m) <= kLargestOffset_m;
}

// Weights of a point on a triangle, as single precision leaves them.
bool is_on_triangle(const Vec3f& barycentric) {
  constexpr float kRounding = 1e-3f;
  const float sum = barycentric.x + barycentric.y + barycentric.z;
  return barycentric.x >= -kRounding && barycentric.y >= -kRounding && barycentric.z >= -kRounding &&
         std::fabs(sum - 1.0f) <= kRounding;
}

}  // namespace

void Renderer::step(Slot& slot, const Vec3f& tip_m) {
  if (slot.kind == ModelKind::held_force) return;
  const Vec3f tip = tip_m - slot.view.origin_m;
  step_contact(slot.surface, slot.contact, slot.law, slot.previous_tip_m, tip);
  slot.previous_tip_m = tip;
}

ServoSample Renderer::isr_tick(std::uint32_t tick, const Vec3f& tip_m) {
  ServoSample sample{};
  sample.tip_m = tip_m;

  std::uint32_t offer = offered_.load(std::memory_order_acquire);
  if (offer != 0 && offer != kWithdrawn && offered_tick_.load(std::memory_order_relaxed) + 1 == tick &&
      offered_.compare_exchange_strong(offer, 0, std::memory_order_acq_rel)) {
    // From here on the slot that was active is the background's.
    active_.store(offer - 1, std::memory_order_relaxed);
    have_model_.store(true, std::memory_order_relaxed);
    shadow_tick_.store(0, std::memory_order_relaxed);
    sample.flags |= kFlagModelSwap;
  }
  if (have_model_.load(std::memory_order_relaxed)) {
    Slot& slot = slots_[active_.load(std::memory_order_relaxed)];
    step(slot, tip_m);
    slot.tick = tick;
    sample.force_N = slot.contact.force_N;
    sample.mode = slot.contact.mode;
    sample.barycentric = slot.contact.barycentric;
    sample.triangle = slot.view.triangle_id[slot.contact.triangle];
    sample.flags |= kFlagModelUsed;
  }

  // A tick that was missed leaves its entry of the history as this one: the trace stays without holes.
  const std::uint32_t recorded = ticks_recorded_.load(std::memory_order_relaxed);
  std::uint32_t first = tick;
  if (recorded != 0) {
    const std::uint32_t newest = last_tick_.load(std::memory_order_relaxed);
    const std::uint32_t missed = tick - newest - 1;
    first = missed < kTipHistory ? newest + 1 : tick - kTipHistory + 1;
  }
  for (std::uint32_t t = first; t != tick + 1; ++t) history_[t % kTipHistory] = sample;
  const std::uint32_t added = tick + 1 - first;
  ticks_recorded_.store(recorded + added < kTipHistory ? recorded + added : kTipHistory,
                        std::memory_order_relaxed);
  last_tick_.store(tick, std::memory_order_release);
  return sample;
}

bool Renderer::sample(std::uint32_t tick, ServoSample& out) const {
  const auto held = [&] {
    const std::uint32_t newest = last_tick_.load(std::memory_order_acquire);
    // One entry less than the history holds: the interrupt may be writing the oldest one.
    return newest - tick < ticks_recorded_.load(std::memory_order_relaxed) && newest - tick < kTipHistory - 1;
  };
  if (!held()) return false;
  out = history_[tick % kTipHistory];
  return held();
}

Status Renderer::load(Slot& slot, std::span<const std::uint8_t> payload) {
  std::size_t size = payload.size();
  const std::int8_t result = palpate_LocalModel_1_0_deserialize_(&slot.message, payload.data(), &size);
  const palpate_LocalModel_1_0& m = slot.message;
  if (result == -NUNAVUT_ERROR_REPRESENTATION_BAD_ARRAY_LENGTH) return Status::model_too_large;
  if (result < 0) return Status::payload_malformed;
  if (m.schema_hash != schema_hash_) return Status::schema_mismatch;
  // The decoder takes what is cut off for zeros.
  if (payload.size() < wire::payload_bytes(m)) return Status::payload_malformed;
  if (m.modes > kMaxModes || m.nodes > kMaxSurfaceNodes || m.triangles > kMaxTriangles)
    return Status::model_too_large;
  if (!counts_agree(m) || !law_is_valid(m) || m.valid_ticks == 0 ||
      m.surface > static_cast<std::uint8_t>(SurfaceKind::flat) ||
      m.kind > static_cast<std::uint8_t>(ModelKind::modes_from_now))
    return Status::model_inconsistent;
  slot.kind = static_cast<ModelKind>(m.kind);
  const bool held = slot.kind == ModelKind::held_force;
  if (held && (m.modes != 0 || m.nodes != 0 || m.triangles != 0)) return Status::model_inconsistent;

  slot.view = wire::view_of(m);
  // A held force has no triangles but the one that the host says is touched.
  if (held) slot.view.triangle_id = &m.contact.triangle;
  wire::read_state(m, slot.state);
  slot.law = {m.tip_radius_m, {m.coupling_stiffness_N_m, m.coupling_damping_N_s_m}};
  slot.tip = static_cast<TipSource>(m.tip_source);
  slot.contact = {};
  slot.contact.force_N = {m.contact.force_N[0], m.contact.force_N[1], m.contact.force_N[2]};
  if (!is_finite(slot.contact.force_N)) return Status::model_not_finite;
  slot.contact.barycentric = {m.contact.barycentric[0], m.contact.barycentric[1], m.contact.barycentric[2]};
  if (m.contact.mode > static_cast<std::uint8_t>(ContactMode::slip)) return Status::model_inconsistent;
  slot.contact.mode = static_cast<ContactMode>(m.contact.mode);
  if (slot.contact.mode != ContactMode::free) {
    if (!is_finite(slot.contact.barycentric)) return Status::model_not_finite;
    if (!is_on_triangle(slot.contact.barycentric)) return Status::model_inconsistent;
    std::uint32_t triangle = 0;
    while (triangle < m.triangles && m.triangle_id.elements[triangle] != m.contact.triangle) ++triangle;
    if (triangle == m.triangles && !held) return Status::model_inconsistent;
    slot.contact.triangle = triangle;
    // Only of a contact: a tip that is free has none of these, whatever the message says.
    slot.contact.stretch_m = {m.contact.coupling_stretch_m[0], m.contact.coupling_stretch_m[1],
                              m.contact.coupling_stretch_m[2]};
    slot.contact.inset_m = m.contact.inset_m;
    slot.contact.overhang_m = {m.contact.overhang_m[0], m.contact.overhang_m[1], m.contact.overhang_m[2]};
    slot.contact.height_m = m.contact.height_m;
    if (!is_finite(slot.contact.stretch_m) || !std::isfinite(slot.contact.inset_m) ||
        !is_finite(slot.contact.overhang_m) || !std::isfinite(slot.contact.height_m))
      return Status::model_not_finite;
    if (!offsets_are_valid(slot.contact)) return Status::model_inconsistent;
  }
  slot.tick = slot.model_tick = m.tick;
  slot.sequence = m.sequence;
  slot.valid_ticks = m.valid_ticks;
  return Status::ok;
}

Status Renderer::start(Slot& slot) {
  const std::uint32_t newest = last_tick_.load(std::memory_order_acquire);
  if (slot.kind != ModelKind::held_force) {
    const Status checked = check(slot.view, slot.state);
    if (checked != Status::ok) return checked;
    slot.surface.bind(slot.view, slot.state);
  }
  if (static_cast<std::int32_t>(slot.tick - newest) > 0) return Status::model_from_future;
  if (slot.kind != ModelKind::modes) return Status::ok;
  ServoSample at_model_tick{};
  if (!sample(slot.tick, at_model_tick)) return Status::model_too_old;
  slot.previous_tip_m = at_model_tick.tip_m - slot.view.origin_m;
  return Status::ok;
}

void Renderer::advance_shadow(Slot& slot, std::uint32_t newest) {
  ServoSample past{};
  if (slot.kind != ModelKind::modes) {
    (void)sample(newest, past);
    slot.previous_tip_m = past.tip_m - slot.view.origin_m;
    slot.tick = newest;
    return;
  }
  // Stops where one more step, as costly as the costliest so far, would go over the budget; the first ones,
  // in the air and cheap, say nothing about a collision.
  std::uint32_t work = 0, costliest = kUsualStepWork;
  while (slot.tick != newest && work + costliest <= kCatchUpWork) {
    if (!sample(slot.tick + 1, past)) {
      finish_shadow(Status::model_too_old);
      return;
    }
    const std::uint32_t before = slot.surface.work();
    step(slot, past.tip_m);
    ++slot.tick;
    const std::uint32_t cost = slot.surface.work() - before;
    work += cost;
    if (cost > costliest) costliest = cost;
  }
}

bool Renderer::reclaim_offer() {
  return offered_.exchange(0, std::memory_order_acq_rel) != 0;
}

void Renderer::finish_shadow(Status status) {
  const Slot& slot = slots_[shadow_slot_];
  const bool taken = status == Status::ok;
  finished_ = {slot.sequence, status, slot.model_tick,
               taken ? offered_tick_.load(std::memory_order_relaxed) + 1 : 0};
  has_finished_ = true;
  shadow_ = Shadow::empty;
  if (taken) {
    shadow_slot_ = 1u - shadow_slot_;
  } else {
    shadow_tick_.store(0, std::memory_order_relaxed);
  }
}

Status Renderer::accept(std::span<const std::uint8_t> payload, ModelReport& report) {
  drop_after_reset();
  if (shadow_ == Shadow::offered && !reclaim_offer()) {
    finish_shadow(Status::ok);
  } else if (shadow_ != Shadow::empty) {
    finish_shadow(Status::model_superseded);
  }
  Slot& slot = slots_[shadow_slot_];
  const Status status = load(slot, payload);
  if (status != Status::ok) {
    report = {slot.message.sequence, status, slot.message.tick, 0};
    return status;
  }
  shadow_ = Shadow::decoded;
  return Status::ok;
}

void Renderer::drop_after_reset() {
  const std::uint32_t resets = resets_.load(std::memory_order_acquire);
  if (resets == resets_seen_) return;
  resets_seen_ = resets;
  if (shadow_ == Shadow::empty) return;
  // An offer that is gone was taken before the reset.
  const bool taken = shadow_ == Shadow::offered && !reclaim_offer();
  finish_shadow(taken ? Status::ok : Status::model_superseded);
}

bool Renderer::catch_up(ModelReport& report) {
  drop_after_reset();
  if (shadow_ == Shadow::offered) {
    if (reclaim_offer()) {
      shadow_ = Shadow::catching_up;  // the interrupt has gone on without it
    } else {
      finish_shadow(Status::ok);
    }
  }
  if (shadow_ == Shadow::decoded) {
    shadow_ = Shadow::loaded;
  } else if (shadow_ == Shadow::loaded) {
    Slot& slot = slots_[shadow_slot_];
    const Status status = start(slot);
    if (status == Status::ok) {
      shadow_ = Shadow::catching_up;
      shadow_tick_.store(slot.tick, std::memory_order_relaxed);
    } else {
      finish_shadow(status);
    }
  } else if (shadow_ == Shadow::catching_up) {
    Slot& slot = slots_[shadow_slot_];
    const std::uint32_t newest = last_tick_.load(std::memory_order_acquire);
    advance_shadow(slot, newest);
    if (shadow_ == Shadow::catching_up) {
      shadow_tick_.store(slot.tick, std::memory_order_relaxed);
      if (slot.tick == newest) {
        shadow_ = Shadow::offered;
        offered_tick_.store(newest, std::memory_order_relaxed);
        offered_.store(shadow_slot_ + 1, std::memory_order_release);
      }
    }
  }
  if (!has_finished_) return false;
  has_finished_ = false;
  report = finished_;
  return true;
}

std::uint32_t Renderer::model_sequence() const {
  return have_model_.load(std::memory_order_relaxed)
             ? slots_[active_.load(std::memory_order_relaxed)].sequence
             : 0;
}

bool Renderer::estimates_tip() const {
  return have_model_.load(std::memory_order_relaxed) &&
         slots_[active_.load(std::memory_order_relaxed)].tip == TipSource::estimated;
}

const ContactState<float>* Renderer::model_contact() const {
  return have_model_.load(std::memory_order_relaxed)
             ? &slots_[active_.load(std::memory_order_relaxed)].contact
             : nullptr;
}

const ModalState* Renderer::model_state() const {
  return have_model_.load(std::memory_order_relaxed) ? &slots_[active_.load(std::memory_order_relaxed)].state
                                                     : nullptr;
}

std::uint32_t Renderer::model_age_ticks() const {
  if (!have_model_.load(std::memory_order_relaxed)) return 0;
  return last_tick_.load(std::memory_order_relaxed) -
         slots_[active_.load(std::memory_order_relaxed)].model_tick;
}

Vec3f Renderer::contact_normal() const {
  if (!have_model_.load(std::memory_order_relaxed)) return {};
  const ContactState<float>& contact = slots_[active_.load(std::memory_order_relaxed)].contact;
  return contact.mode == ContactMode::free ? Vec3f{} : contact.normal;
}

std::uint32_t Renderer::model_valid_ticks() const {
  return have_model_.load(std::memory_order_relaxed)
             ? slots_[active_.load(std::memory_order_relaxed)].valid_ticks
             : 0;
}

std::uint32_t Renderer::catch_up_ticks() const {
  const std::uint32_t shadow_tick = shadow_tick_.load(std::memory_order_relaxed);
  return shadow_tick == 0 ? 0 : last_tick_.load(std::memory_order_relaxed) - shadow_tick;
}

void Renderer::isr_reset() {
  have_model_.store(false, std::memory_order_relaxed);
  // An offer is withdrawn at once; a shadow that is still catching up is dropped when the background sees the
  // count.
  std::uint32_t offer = offered_.load(std::memory_order_relaxed);
  if (offer != 0) (void)offered_.compare_exchange_strong(offer, kWithdrawn, std::memory_order_acq_rel);
  resets_.fetch_add(1, std::memory_order_acq_rel);
}

}  // namespace palpate::firmware
