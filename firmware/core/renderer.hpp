// Renders the force of the active local model each servo tick, and brings a newer model up to date in the
// background.
//
// Two slots hold models. The interrupt steps the active one. A state that arrives is decoded into the other
// slot, at an earlier tick k0, beside a basis that has come before (basis_store.hpp) and may be that of the
// active model, too; the background replays the recorded tip path from k0 on through
// its contact and modes until it has caught up with the servo tick, then offers it, and the next servo tick
// takes it over: neither the link's delay nor the host's makes it stale (docs/architecture.md, "One
// pipeline"). Models of the other kinds (ModelKind) are not advanced: they begin when they are taken over.
//
// Correction energy: what was rendered until then gave the hand more energy than the model that replaces it
// would have given, by the sum over the replayed ticks t of
//   (replayed force[t] - rendered force[t]) . (tip[t+1] - tip[t]).
// Forces are of the tip on the body, so that -force acts on the hand; that of tick t is commanded at its end
// and held until the next tick: for a force that is held so the sum is exact
// (docs/decisions/correction_energy.md).
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/basis_store.hpp"
#include "palpate/ModelState_1_0.h"
#include "shared/contact/contact_state.hpp"
#include "shared/model/local_model.hpp"
#include "shared/model/modal_surface.hpp"
#include "shared/status.hpp"
#include "shared/wire/messages.hpp"

namespace palpate::firmware {

// Ticks of tip history kept for replay and for resending to the host; a power of two.
inline constexpr std::uint32_t kTipHistory = 256;
// How a board brings a model up to date. Fixed for each board, so that it catches up in the same number of
// ticks in every run.
struct CatchUpPolicy {
  // Background work per servo tick, in instructions as ModalSurface::work() counts them (docs/benchmarks.md).
  std::uint32_t work;
  // Steps between two computations of the near field: with kNearPeriod_steps a model is replayed as it will
  // be rendered.
  std::uint32_t near_period_steps;
};
// For a Cortex-M4F with 125,000 instructions a tick: replaying with every eighth step costs two thirds as
// much as with every second one (docs/decisions/near_field.md).
inline constexpr CatchUpPolicy kCatchUpCortexM4{70'000, 8};
// For a Cortex-M7 with 600,000 cycles a tick (docs/decisions/larger_part.md).
inline constexpr CatchUpPolicy kCatchUpCortexM7{200'000, kNearPeriod_steps};
// A model that has not caught up this long after it was accepted gives way to a newer one. Before, a newer
// one waits: were each superseded by the next, none would ever be rendered where that takes longer than a
// frame.
inline constexpr std::uint32_t kCatchUpHorizon_ticks = 50;
// What a replayed tick is expected to take at least, before its kind is known.
inline constexpr std::uint32_t kUsualStepWork = 25'000;
inline constexpr std::uint32_t kUsualNearStepWork = 20'000;  // of a model with a near field, without that

// One servo tick as rendered; what the trace to the host and the record are made of.
struct ServoSample {
  Vec3f tip_m{};    // device frame
  Vec3f force_N{};  // of the tip on the body, before limits
  ContactMode mode = ContactMode::free;
  std::uint8_t flags = 0;      // palpate.ServoSample FLAG_*
  std::uint16_t triangle = 0;  // the body's own number
};

struct ModelReport {
  std::uint32_t sequence = 0;
  Status status = Status::ok;
  std::uint32_t model_tick = 0;
  std::uint32_t swap_tick = 0;
  float correction_energy_J = 0.0f;  // of a model that was taken over; 0 of one that was not rolled forward
};

class Renderer {
 public:
  Renderer(std::uint64_t schema_hash, const CatchUpPolicy& catch_up_policy)
      : schema_hash_(schema_hash), catch_up_policy_(catch_up_policy) {}

  // Interrupt context, once per tick with tick increasing by one: steps the active model against the tip.
  // Records the sample in the history. Without a usable model the force is zero.
  ServoSample isr_tick(std::uint32_t tick, const Vec3f& tip_m);

  // Background context. Takes a serialized palpate.ModelPart.1.0; a state that waits for the basis that it
  // completes is accepted. Anything but Status::ok: it can't be read.
  Status accept_part(std::span<const std::uint8_t> payload);
  // Background context. What has become of bases since the last call, one at a time; false: no more.
  bool next_basis_event(BasisStore::Event& event);
  [[nodiscard]] const BasisStore& bases() const { return bases_; }

  // Background context. Decodes a serialized palpate.ModelState.1.0 into the shadow slot and starts to catch
  // up. Where its basis is not complete, or the shadow is still catching up (kCatchUpHorizon_ticks), the
  // state waits, and one that was waiting is superseded. A state that is older than the newest so far, or
  // comes again, is superseded at once. Anything but Status::ok leaves the active model as it is and fills
  // `report` for the host; after Status::ok the report comes later, from catch_up.
  Status accept(std::span<const std::uint8_t> payload, ModelReport& report);

  // Background context, once per servo tick: replays the shadow for about the policy's work. Returns true
  // when `report` was filled: a state was taken over, superseded, or dropped. There may be more: next_report.
  bool catch_up(ModelReport& report);
  bool next_report(ModelReport& report);

  // Any context: the sample of a tick, if the history still holds it.
  bool sample(std::uint32_t tick, ServoSample& out) const;

  // Interrupt context.
  [[nodiscard]] std::uint32_t model_sequence() const;  // of the active model; 0: none
  // Modes of the active model after the newest tick, for the host that repeats the rendering; nullptr: none.
  [[nodiscard]] const ModalState* model_state() const;
  // Its contact, triangle by the model's index; nullptr: none.
  [[nodiscard]] const ContactState<float>* model_contact() const;
  [[nodiscard]] std::uint32_t model_age_ticks() const;  // ticks since the active model's own tick
  // Unit outward normal in which the force of the newest tick was found; zero when free.
  [[nodiscard]] Vec3f contact_normal() const;
  // Where on its triangle the contact of the newest tick is; zero without a model.
  [[nodiscard]] Vec3f contact_barycentric() const;
  [[nodiscard]] std::uint32_t catch_up_ticks() const;  // that the shadow lags behind; 0: none is catching up
  // Does the active model want the tip between encoder counts (palpate.ModelState TIP_ESTIMATED)?
  [[nodiscard]] bool estimates_tip() const;
  // The active model's horizon; 0: it has none, for it says that nothing is near, or there is no model.
  [[nodiscard]] std::uint32_t model_valid_ticks() const;
  // The active model's: its force may grow for so many ticks after it was taken over.
  [[nodiscard]] std::uint32_t model_growth_ticks() const;
  // Since the active model was taken over.
  [[nodiscard]] std::uint32_t model_use_ticks() const;
  // Interrupt context. Sum of the correction energies of all models that were taken over since the reset:
  // what the passivity controller takes back (firmware/core/passivity.hpp).
  [[nodiscard]] float correction_energy_J() const { return correction_energy_J_; }
  // Interrupt context. Steps between two computations of the near field of models that are taken over, and of
  // the active one: for the host, which repeats what the board did while a model caught up.
  void isr_set_near_period(std::uint32_t steps);
  // Forgets the models (outputs must be off): the next one starts afresh.
  void isr_reset();

 private:
  struct Slot {
    LocalModelView view{};  // of a basis, position_m and load below
    std::array<float, 3 * kMaxSurfaceNodes> position_m{};
    std::array<float, kMaxModes> load{};
    std::uint32_t basis = BasisStore::kNone;  // its slot
    std::uint16_t held_triangle = 0;          // of a held force
    ModalState state{};
    ModalSurface surface{};
    ContactState<float> contact{};
    ContactLaw<float> law{};
    TipSource tip = TipSource::counts;
    ModelKind kind = ModelKind::modes;
    Vec3f previous_tip_m{};  // relative to the model's origin
    // Replayed less rendered force of `tick`, which acts until the next; zero in ticks that are not
    // accounted.
    Vec3f force_change_N{};
    float correction_energy_J = 0.0f;  // up to the end of `tick`; final from the take-over on
    std::uint32_t tick = 0;            // state and contact are those at the end of this tick
    std::uint32_t model_tick = 0;
    std::uint32_t sequence = 0;
    std::uint32_t valid_ticks = 0;
    std::uint32_t growth_ticks = 0;
  };
  // Decoding, checking and replaying take a servo tick's background each: together they would not fit in one.
  enum class Shadow : std::uint8_t { empty, decoded, loaded, catching_up, offered };

  static void step(Slot& slot, const Vec3f& tip_m);
  // What the force's change of slot.tick does until the tip is at tip_m, in the next tick.
  static void account(Slot& slot, const Vec3f& tip_m);
  // Into message_.
  Status decode(std::span<const std::uint8_t> payload);
  // message_ into a slot, whose basis is known.
  Status load(Slot& slot);
  Status load_contact(Slot& slot) const;
  [[nodiscard]] std::uint32_t bases_in_use() const;
  void take(const BasisStore::Events& events);
  // Is message_ of an older tick than a model in use or under way, or the same one again?
  [[nodiscard]] bool is_outdated() const;
  // Keeps message_, with its payload, for later.
  void wait(std::span<const std::uint8_t> payload);
  [[nodiscard]] bool shadow_is_busy() const;
  void accept_waiting();
  void supersede_waiting();
  void add_report(const ModelReport& report);
  void add_event(const BasisStore::Event& event);
  Status start(Slot& slot);
  void advance_shadow(Slot& slot, std::uint32_t newest);
  bool reclaim_offer();
  void finish_shadow(Status status);
  void report_taken();
  void drop_after_reset();

  std::uint64_t schema_hash_;
  CatchUpPolicy catch_up_policy_;
  std::array<Slot, 2> slots_{};
  // Interrupt's own.
  std::atomic<std::uint32_t> active_{0};
  std::atomic<bool> have_model_{false};
  std::uint32_t active_since_ = 0;        // tick of its take-over
  std::atomic<std::uint32_t> resets_{0};  // isr_reset() so far
  float correction_energy_J_ = 0.0f;      // since the reset
  std::uint32_t near_period_ = kNearPeriod_steps;
  // Written by the interrupt before it counts the reset: the newest tick then.
  std::atomic<std::uint32_t> reset_tick_{0};
  // Background to interrupt: slot index + 1 that is on offer, 0 for none. Whoever exchanges it for 0 owns the
  // slot. kWithdrawn: a reset has come in between; the slot is the background's.
  static constexpr std::uint32_t kWithdrawn = 0xffffffffu;
  std::atomic<std::uint32_t> offered_{0};
  // Written by the background before it offers: the tick up to which the slot has been stepped.
  std::atomic<std::uint32_t> offered_tick_{0};
  // Background's own.
  Shadow shadow_ = Shadow::empty;
  std::uint32_t shadow_began_ = 0;  // tick in which it was accepted
  std::uint32_t shadow_slot_ = 1;   // the slot that is not the interrupt's: changes when an offer was taken
  // First tick whose force no correction has accounted for: each tick counts once, in the first model that
  // replays it.
  std::uint32_t account_from_ = 0;
  bool take_over_to_report_ = false;
  std::uint32_t taken_tick_ = 0;  // of that take-over
  BasisStore bases_;
  // One message at a time, too large for the stack.
  union {
    palpate_ModelState_1_0 message_{};
    palpate_ModelPart_1_0 part_;
  };
  // The newest state whose basis is not complete, or that came while another was still catching up.
  std::array<std::uint8_t, wire::MessageTraits<palpate_ModelState_1_0>::kMaxBytes> waiting_{};
  std::size_t waiting_bytes_ = 0;  // 0: none
  ModelReport waiting_report_{};   // of it, should it never be taken
  std::uint32_t waiting_basis_ = 0;
  // What the host is to be told. Whoever takes them after each message and each tick loses none.
  std::array<ModelReport, 8> reports_{};
  std::size_t report_count_ = 0;
  std::array<BasisStore::Event, 8> basis_events_{};
  std::size_t basis_event_count_ = 0;
  std::uint32_t resets_seen_ = 0;
  std::array<ServoSample, kTipHistory> history_{};
  std::atomic<std::uint32_t> last_tick_{0};  // newest tick in history_
  std::atomic<std::uint32_t> ticks_recorded_{0};
  std::atomic<std::uint32_t> shadow_tick_{0};  // how far the shadow has come; 0: none
};

}  // namespace palpate::firmware
