#include "firmware/core/renderer.hpp"

#include <algorithm>
#include <cmath>

#include "shared/wire/model_basis.hpp"
#include "shared/wire/model_state.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint8_t kFlagModelUsed = 4, kFlagModelSwap = 8;  // palpate.ServoSample FLAG_*
static_assert((kTipHistory & (kTipHistory - 1)) == 0, "the history is indexed by tick modulo its length");

// Of one model: twice what the supervisor lets a force give before it is a fault (Limits::energy_J).
constexpr float kMostCorrection_J = 1.0f;
// What a state may say of contact: offsets within the reach of the arm. Beyond, it is a fault of its sender.
constexpr float kLargestOffset_m = 1.0f;  // stretch, inset, overhang and height

// False for NaN.
bool is_within(float value, float low, float high) {
  return value >= low && value <= high;
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

// No contact, and no force: not that of a number that is none.
bool says_no_force(const palpate_Contact_1_0& contact) {
  const float* force_N = contact.force_N;
  return contact.mode == static_cast<std::uint8_t>(ContactMode::free) && force_N[0] == 0.0f &&
         force_N[1] == 0.0f && force_N[2] == 0.0f;
}

}  // namespace

void Renderer::step(Slot& slot, const Vec3f& tip_m) {
  if (slot.kind == ModelKind::held_force) return;
  const Vec3f tip = tip_m - slot.view.origin_m;
  step_contact(slot.surface, slot.contact, slot.law, slot.previous_tip_m, tip);
  slot.previous_tip_m = tip;
}

void Renderer::account(Slot& slot, const Vec3f& tip_m) {
  slot.correction_energy_J += dot(slot.force_change_N, tip_m - slot.view.origin_m - slot.previous_tip_m);
  slot.force_change_N = {};
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
    active_since_ = tick;
    shadow_tick_.store(0, std::memory_order_relaxed);
    Slot& taken = slots_[offer - 1];
    taken.surface.set_near_period(near_period_);
    account(taken, tip_m);
    // A force that is no number is the supervisor's to stop; the sum must stay one.
    if (!std::isfinite(taken.correction_energy_J)) taken.correction_energy_J = 0.0f;
    // Of a model that has diverged, which must not leave the sum without its last digits.
    correction_energy_J_ += std::clamp(taken.correction_energy_J, -kMostCorrection_J, kMostCorrection_J);
    sample.flags |= kFlagModelSwap;
  }
  if (have_model_.load(std::memory_order_relaxed)) {
    Slot& slot = slots_[active_.load(std::memory_order_relaxed)];
    step(slot, tip_m);
    slot.tick = tick;
    sample.force_N = slot.contact.force_N;
    sample.mode = slot.contact.mode;
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

Status Renderer::decode(std::span<const std::uint8_t> payload) {
  const std::uint8_t* bytes = payload.data();
  if (bytes == nullptr) return Status::payload_malformed;  // the generated decoder takes it for zeros
  std::size_t size = payload.size();
  const std::int8_t result = palpate_ModelState_1_0_deserialize_(&message_, bytes, &size);
  if (result == -NUNAVUT_ERROR_REPRESENTATION_BAD_ARRAY_LENGTH) return Status::model_too_large;
  if (result < 0) return Status::payload_malformed;
  if (message_.schema_hash != schema_hash_) return Status::schema_mismatch;
  // The decoder takes what is cut off for zeros.
  if (payload.size() < wire::payload_bytes(message_)) return Status::payload_malformed;
  if (message_.kind > static_cast<std::uint8_t>(ModelKind::modes_from_now) ||
      message_.tip_source > static_cast<std::uint8_t>(TipSource::estimated))
    return Status::model_inconsistent;
  const bool held = static_cast<ModelKind>(message_.kind) == ModelKind::held_force;
  // Only what has no force may be without a horizon.
  if (message_.valid_ticks == 0 && !(held && says_no_force(message_.contact)))
    return Status::model_inconsistent;
  return held == (message_.basis_id == 0) ? Status::ok : Status::model_inconsistent;
}

Status Renderer::load(Slot& slot) {
  const palpate_ModelState_1_0& m = message_;
  slot.kind = static_cast<ModelKind>(m.kind);
  slot.tip = static_cast<TipSource>(m.tip_source);
  slot.tick = slot.model_tick = m.tick;
  slot.sequence = m.sequence;
  slot.valid_ticks = m.valid_ticks;
  slot.growth_ticks = m.growth_ticks;
  slot.force_change_N = {};
  slot.correction_energy_J = 0.0f;
  slot.view = {};
  slot.law = {};
  if (slot.kind != ModelKind::held_force) {
    const Status status = wire::open_basis(bases_.bytes(slot.basis), schema_hash_, slot.view, slot.law);
    if (status != Status::ok) return status;
  }
  if (!wire::counts_agree(m, slot.view)) return Status::model_inconsistent;
  wire::read_state(m, slot.view, slot.position_m.data(), slot.load.data(), slot.state);
  slot.view.position_m = slot.position_m.data();
  slot.view.load = slot.load.data();
  if (slot.kind == ModelKind::held_force) {
    // It has no triangles but the one that the host says is touched.
    slot.held_triangle = m.contact.triangle;
    slot.view.triangle_id = &slot.held_triangle;
  }
  return load_contact(slot);
}

Status Renderer::load_contact(Slot& slot) const {
  const palpate_Contact_1_0& from = message_.contact;
  ContactState<float>& contact = slot.contact;
  contact = {};
  contact.force_N = {from.force_N[0], from.force_N[1], from.force_N[2]};
  if (!is_finite(contact.force_N)) return Status::model_not_finite;
  contact.barycentric = {from.barycentric[0], from.barycentric[1], from.barycentric[2]};
  if (from.mode > static_cast<std::uint8_t>(ContactMode::slip)) return Status::model_inconsistent;
  contact.mode = static_cast<ContactMode>(from.mode);
  // A tip that is free has no place and no offsets, whatever the message says.
  if (contact.mode == ContactMode::free) return Status::ok;
  if (!is_finite(contact.barycentric)) return Status::model_not_finite;
  if (!is_on_triangle(contact.barycentric)) return Status::model_inconsistent;
  if (slot.kind != ModelKind::held_force) {
    const std::uint16_t* const end = slot.view.triangle_id + slot.view.triangles;
    const std::uint16_t* const found = std::find(slot.view.triangle_id, end, from.triangle);
    if (found == end) return Status::model_inconsistent;
    contact.triangle = static_cast<std::uint32_t>(found - slot.view.triangle_id);
  }
  contact.stretch_m = {from.coupling_stretch_m[0], from.coupling_stretch_m[1], from.coupling_stretch_m[2]};
  contact.inset_m = from.inset_m;
  contact.overhang_m = {from.overhang_m[0], from.overhang_m[1], from.overhang_m[2]};
  contact.height_m = from.height_m;
  if (!is_finite(contact.stretch_m) || !std::isfinite(contact.inset_m) || !is_finite(contact.overhang_m) ||
      !std::isfinite(contact.height_m))
    return Status::model_not_finite;
  return offsets_are_valid(contact) ? Status::ok : Status::model_inconsistent;
}

Status Renderer::start(Slot& slot) {
  const std::uint32_t newest = last_tick_.load(std::memory_order_acquire);
  if (slot.kind != ModelKind::held_force) {
    const Status checked = check(slot.view, slot.state);
    if (checked != Status::ok) return checked;
    slot.surface.bind(slot.view, slot.state);
  }
  if (static_cast<std::int32_t>(slot.tick - newest) > 0) return Status::model_from_future;
  // A force may be late, for it grows old; that nothing is near does not.
  if (slot.kind != ModelKind::modes && slot.valid_ticks != 0) return Status::ok;
  ServoSample at_model_tick{};
  if (!sample(slot.tick, at_model_tick)) return Status::model_too_old;
  if (slot.kind != ModelKind::modes) return Status::ok;
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
  // Stops where one more step would go over the budget: as costly as the costliest so far, but for the near
  // field, whose steps are known. The first ones, in the air and cheap, say nothing about a collision.
  ModalSurface& surface = slot.surface;
  surface.set_near_period(catch_up_policy_.near_period_steps);
  std::uint32_t work = 0, costliest = slot.view.springs == 0 ? kUsualStepWork : kUsualNearStepWork;
  while (slot.tick != newest && work + costliest + surface.next_near_work() <= catch_up_policy_.work) {
    if (!sample(slot.tick + 1, past)) {
      finish_shadow(Status::model_too_old);
      return;
    }
    const std::uint32_t before = surface.work(), near_before = surface.near_work();
    account(slot, past.tip_m);
    step(slot, past.tip_m);
    ++slot.tick;
    if (static_cast<std::int32_t>(slot.tick - account_from_) >= 0)
      slot.force_change_N = slot.contact.force_N - past.force_N;
    const std::uint32_t cost = surface.work() - before, near_cost = surface.near_work() - near_before;
    work += cost;
    if (cost - near_cost > costliest) costliest = cost - near_cost;
  }
}

bool Renderer::reclaim_offer() {
  return offered_.exchange(0, std::memory_order_acq_rel) != 0;
}

void Renderer::finish_shadow(Status status) {
  report_taken();
  shadow_ = Shadow::empty;
  if (status == Status::ok) {
    shadow_slot_ = 1u - shadow_slot_;
    taken_tick_ = account_from_ = offered_tick_.load(std::memory_order_relaxed) + 1;
    take_over_to_report_ = true;
    report_taken();
  } else {
    const Slot& slot = slots_[shadow_slot_];
    add_report({slot.sequence, status, slot.model_tick, 0, 0.0f});
    shadow_tick_.store(0, std::memory_order_relaxed);
  }
}

// A take-over is reported when its tick is over: on another core the interrupt may still be adding up the
// energy.
void Renderer::report_taken() {
  if (!take_over_to_report_ ||
      static_cast<std::int32_t>(last_tick_.load(std::memory_order_acquire) - taken_tick_) < 0)
    return;
  take_over_to_report_ = false;
  const Slot& slot = slots_[1u - shadow_slot_];
  add_report({slot.sequence, Status::ok, slot.model_tick, taken_tick_, slot.correction_energy_J});
}

void Renderer::add_report(const ModelReport& report) {
  if (report_count_ < reports_.size()) reports_[report_count_++] = report;
}

void Renderer::add_event(const BasisStore::Event& event) {
  if (basis_event_count_ < basis_events_.size()) basis_events_[basis_event_count_++] = event;
}

bool Renderer::next_report(ModelReport& report) {
  if (report_count_ == 0) return false;
  report = reports_.front();
  std::copy(reports_.begin() + 1, reports_.end(), reports_.begin());
  --report_count_;
  return true;
}

bool Renderer::next_basis_event(BasisStore::Event& event) {
  if (basis_event_count_ == 0) return false;
  event = basis_events_.front();
  std::copy(basis_events_.begin() + 1, basis_events_.end(), basis_events_.begin());
  --basis_event_count_;
  return true;
}

// The slot that is not the shadow's is the interrupt's; while a shadow is on offer it may be either. A state
// that waits keeps its basis, too.
std::uint32_t Renderer::bases_in_use() const {
  const auto bit = [](const Slot& slot) { return slot.basis == BasisStore::kNone ? 0u : 1u << slot.basis; };
  return bit(slots_[1u - shadow_slot_]) | (shadow_ != Shadow::empty ? bit(slots_[shadow_slot_]) : 0u) |
         (waiting_bytes_ != 0 ? bases_.slot_bit(waiting_basis_) : 0u);
}

Status Renderer::accept_part(std::span<const std::uint8_t> payload) {
  drop_after_reset();
  const Status status = wire::deserialize(payload, part_);
  if (status == Status::ok) take(bases_.add(part_, bases_in_use()));
  return status;
}

void Renderer::take(const BasisStore::Events& events) {
  for (std::size_t i = 0; i < events.count; ++i) {
    const BasisStore::Event& event = events.event[i];
    add_event(event);
    if (event.status != Status::ok || waiting_bytes_ == 0 || event.id != waiting_basis_) continue;
    accept_waiting();
  }
}

void Renderer::supersede_waiting() {
  if (waiting_bytes_ == 0) return;
  waiting_bytes_ = 0;
  add_report(waiting_report_);
}

// Reordered, or repeated as a new transfer. A tick from the future is refused in its turn: it holds up none.
bool Renderer::is_outdated() const {
  const std::uint32_t newest = last_tick_.load(std::memory_order_acquire);
  const auto precedes = [&](std::uint32_t tick, std::uint32_t sequence) {
    const auto later = static_cast<std::int32_t>(message_.tick - tick);
    return static_cast<std::int32_t>(newest - tick) >= 0 &&
           (later < 0 || (later == 0 && message_.sequence == sequence));
  };
  const Slot &active = slots_[1u - shadow_slot_], &shadow = slots_[shadow_slot_];
  return (have_model_.load(std::memory_order_relaxed) && precedes(active.model_tick, active.sequence)) ||
         (shadow_ != Shadow::empty && precedes(shadow.model_tick, shadow.sequence)) ||
         (waiting_bytes_ != 0 && precedes(waiting_report_.model_tick, waiting_report_.sequence));
}

bool Renderer::shadow_is_busy() const {
  if (shadow_ == Shadow::empty || slots_[shadow_slot_].kind != ModelKind::modes) return false;
  return last_tick_.load(std::memory_order_acquire) - shadow_began_ <= kCatchUpHorizon_ticks;
}

void Renderer::accept_waiting() {
  if (waiting_bytes_ == 0 || shadow_is_busy() || bases_.find_complete(waiting_basis_) == BasisStore::kNone)
    return;
  const std::size_t bytes = waiting_bytes_;
  waiting_bytes_ = 0;
  ModelReport report;
  if (accept(std::span(waiting_).first(bytes), report) != Status::ok) add_report(report);
}

void Renderer::wait(std::span<const std::uint8_t> payload) {
  supersede_waiting();
  // More bytes than the message has may follow it; it is decoded without them.
  waiting_bytes_ = std::min(payload.size(), waiting_.size());
  std::copy_n(payload.begin(), waiting_bytes_, waiting_.begin());
  waiting_report_ = {message_.sequence, Status::model_superseded, message_.tick, 0, 0.0f};
  waiting_basis_ = message_.basis_id;
}

Status Renderer::accept(std::span<const std::uint8_t> payload, ModelReport& report) {
  drop_after_reset();
  const Status decoded = decode(payload);
  if (decoded != Status::ok) {
    report = {message_.sequence, decoded, message_.tick, 0, 0.0f};
    return decoded;
  }
  if (is_outdated()) {
    const bool forgotten = last_tick_.load(std::memory_order_acquire) - message_.tick >= kTipHistory - 1;
    report = {message_.sequence, forgotten ? Status::model_too_old : Status::model_superseded, message_.tick,
              0, 0.0f};
    return report.status;
  }
  std::uint32_t basis = BasisStore::kNone;
  if (message_.basis_id != 0) {
    basis = bases_.find_complete(message_.basis_id);
    if (basis == BasisStore::kNone) {
      wait(payload);
      add_event({message_.basis_id, Status::basis_missing});
      return Status::ok;
    }
  }
  if (shadow_ == Shadow::offered) {
    if (reclaim_offer()) {
      shadow_ = Shadow::catching_up;
    } else {
      finish_shadow(Status::ok);
    }
  }
  if (static_cast<ModelKind>(message_.kind) == ModelKind::modes && shadow_is_busy()) {
    wait(payload);
    return Status::ok;
  }
  supersede_waiting();
  if (shadow_ != Shadow::empty) finish_shadow(Status::model_superseded);
  Slot& slot = slots_[shadow_slot_];
  slot.basis = basis;
  const Status status = load(slot);
  if (status != Status::ok) {
    report = {slot.sequence, status, slot.model_tick, 0, 0.0f};
    return status;
  }
  shadow_ = Shadow::decoded;
  shadow_began_ = last_tick_.load(std::memory_order_acquire);
  return Status::ok;
}

void Renderer::drop_after_reset() {
  const std::uint32_t resets = resets_.load(std::memory_order_acquire);
  if (resets == resets_seen_) return;
  resets_seen_ = resets;
  supersede_waiting();
  if (shadow_ != Shadow::empty) {
    // An offer that is gone was taken before the reset.
    const bool taken = shadow_ == Shadow::offered && !reclaim_offer();
    finish_shadow(taken ? Status::ok : Status::model_superseded);
  }
  account_from_ = reset_tick_.load(std::memory_order_relaxed) + 1;
}

bool Renderer::catch_up(ModelReport& report) {
  report_taken();
  drop_after_reset();
  take(bases_.check());
  if (shadow_ == Shadow::offered) {
    if (reclaim_offer()) {
      shadow_ = Shadow::catching_up;  // the interrupt has gone on without it
    } else {
      finish_shadow(Status::ok);
    }
  }
  accept_waiting();
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
  return next_report(report);
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

Vec3f Renderer::contact_barycentric() const {
  if (!have_model_.load(std::memory_order_relaxed)) return {};
  return slots_[active_.load(std::memory_order_relaxed)].contact.barycentric;
}

std::uint32_t Renderer::model_valid_ticks() const {
  return have_model_.load(std::memory_order_relaxed)
             ? slots_[active_.load(std::memory_order_relaxed)].valid_ticks
             : 0;
}

std::uint32_t Renderer::model_growth_ticks() const {
  return have_model_.load(std::memory_order_relaxed)
             ? slots_[active_.load(std::memory_order_relaxed)].growth_ticks
             : 0;
}

std::uint32_t Renderer::model_use_ticks() const {
  return last_tick_.load(std::memory_order_relaxed) - active_since_;
}

std::uint32_t Renderer::catch_up_ticks() const {
  const std::uint32_t shadow_tick = shadow_tick_.load(std::memory_order_relaxed);
  return shadow_tick == 0 ? 0 : last_tick_.load(std::memory_order_relaxed) - shadow_tick;
}

void Renderer::isr_set_near_period(std::uint32_t steps) {
  near_period_ = steps;
  if (have_model_.load(std::memory_order_relaxed))
    slots_[active_.load(std::memory_order_relaxed)].surface.set_near_period(steps);
}

void Renderer::isr_reset() {
  have_model_.store(false, std::memory_order_relaxed);
  // An offer is withdrawn at once; a shadow that is still catching up is dropped when the background sees the
  // count.
  std::uint32_t offer = offered_.load(std::memory_order_relaxed);
  if (offer != 0) (void)offered_.compare_exchange_strong(offer, kWithdrawn, std::memory_order_acq_rel);
  correction_energy_J_ = 0.0f;
  reset_tick_.store(last_tick_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  resets_.fetch_add(1, std::memory_order_acq_rel);
}

}  // namespace palpate::firmware
