// The host's side of a session: replays the measured tip path on the full body and streams local models.
//
// At each update it advances the non-linear body, with the same contact code as the board's, through the
// servo ticks that have arrived, linearizes it there, reduces it around the place where the tip is expected,
// and stamps the model with that tick. The full body thus carries every local deformation: the geometry
// feedback of Jacobs, Fu, Cavusoglu 2010, section 3, done exactly. Other schemes of feedback can be had for
// comparison (feedback.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "host/linearize/model_builder.hpp"
#include "host/session/body_surface.hpp"
#include "host/session/feedback.hpp"
#include "host/session/model_message.hpp"
#include "host/session/tip_forecast.hpp"
#include "host/session/tip_history.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::host {

// Two updates and the host's jitter of 30 ms, so that neither the loss of one model nor that jitter holds the
// force (docs/safety.md); at most what the message holds.
[[nodiscard]] std::uint16_t default_growth_ticks(double update_Hz);

struct SessionConfig {
  Feedback feedback = Feedback::exact;
  ContactLaw<double> law{};
  TipSource tip = TipSource::counts;
  SurfaceKind surface = SurfaceKind::smooth;
  FrictionSpec friction{};
  double step_s = 1e-4;     // of the full body; divides the servo tick
  double update_Hz = 30.0;  // of local models, in virtual time
  BuilderConfig model{};
  std::uint16_t valid_ticks = 200;
  // After a model was taken over its force may grow; std::nullopt: default_growth_ticks().
  std::optional<std::uint16_t> growth_ticks{};
  std::vector<NodeDrive> drives;  // times count from the first tick that is heard of
  // No model is built while the tip is further from the surface than this. 2 cm: a hand at 0.25 m/s
  // needs 80 ms for it, a frame of 33 ms and the 45 ms that a model takes at most in the demo to be in use.
  double near_m = 0.02;
  // The patch lies around the place where the tip is expected in the middle of the time in which the model
  // will be in use. Otherwise around the contact at the model's tick, as in the paper.
  bool patch_ahead = true;
};

// One local model and what led to it.
struct ModelUpdate {
  wire::PackedModel packed;     // as it is sent
  wire::ModelContents message;  // as it arrives
  // The basis is a constant of body and patch: it need not be sent again with each state.
  bool basis_stays = false;
  // A basis that the states to come would have, were it on the board; null: that of `packed`.
  std::shared_ptr<const std::vector<std::uint8_t>> wanted_basis;
  std::uint32_t wanted_basis_id = 0;
  BodyState state;               // that was linearized
  std::vector<int> patch_nodes;  // of the model: on the surface first, then below; the body's own numbers
  std::uint32_t interpolated_ticks = 0;
  double damping_coupling = 0;  // what the modal form neglects (host/linearize/modal_reduction.hpp)
  int limited_modes = 0;        // that would grow too fast (host/linearize/growth_limit.hpp)

  // No model: nothing that could give a force is near the tip (palpate.ModelState).
  [[nodiscard]] bool says_nothing() const { return packed.state.valid_ticks == 0; }
};

class Session {
 public:
  // The body must outlive the session. Throws std::invalid_argument as BodySurface and make_builder do.
  Session(const Body& body, BodyState start, const SessionConfig& config);

  // What the board says of ticks, in any order and either form: only the tip's path is used. Ticks that do
  // not follow those that are known (TipHistory::follows) are the beginning of another path: the body goes on
  // as it is, without contact.
  void take(const palpate_ServoTrace_1_0& trace);
  void take(const palpate_TipTrace_1_0& trace);

  // Is a model due in this tick?
  [[nodiscard]] bool due(std::uint32_t tick) const;
  // What to ask the board for again; ticks that were asked for at the update before and still miss are
  // interpolated by update().
  [[nodiscard]] std::vector<TickRange> missing() const { return path_.gaps(); }
  // Which bases the board holds. From then on, while the basis that a state should have is not there, states
  // go on with that of the patch before, as long as the contact is on it.
  void note_held_bases(std::vector<std::uint32_t> ids) { held_bases_ = std::move(ids); }
  // The board took over a model of this tick in swap_tick: what the patches ahead are planned by.
  void note_taken(std::uint32_t model_tick, std::uint32_t swap_tick);
  // Outputs are off for want of a model: a board that knows that nothing is near waits to be told so again.
  void note_suspended();
  // Between updates, as often as one likes: has the builder prepare for where the tip is and will be.
  void prepare();
  // Advances the body through the ticks that are known and, near the surface, builds a model. Where there is
  // none to be had, the board is told so before its newest one grows old: an update that says_nothing(),
  // again until note_taken() has heard of it. Empty: no news, or none of these. Throws what the builders and
  // the feedback throw.
  std::optional<ModelUpdate> update();

  [[nodiscard]] const BodyState& state() const { return surface_.state(); }
  // Servo tick that state() has come to.
  [[nodiscard]] std::uint32_t tick() const { return tick_; }
  [[nodiscard]] const ContactState<double>& contact() const { return contact_; }
  // Ticks whose tip position was interpolated, with the position used.
  struct Interpolated {
    std::uint32_t tick;
    Vec3d tip_m;
    std::uint32_t sequence;  // of the first model that builds on it; the next one where there is none yet
  };
  [[nodiscard]] const std::vector<Interpolated>& interpolated() const { return interpolated_; }
  [[nodiscard]] const ModelBuilder& builder() const { return *builder_; }
  // Updates at which the basis of the patch that a model should have was not there yet: it is on the patch
  // before, or one less far ahead, or was not had.
  [[nodiscard]] std::size_t basis_waits() const { return basis_waits_; }

 private:
  void add(std::uint32_t tick, const Vec3d& tip_m);
  void begin_anew();
  [[nodiscard]] std::optional<SurfacePoint> focus(std::uint32_t tick) const;
  [[nodiscard]] double reach_m() const { return config_.near_m + config_.law.tip_radius_m; }
  void foresee(std::uint32_t tick, const std::optional<SurfacePoint>& focus);
  // From a model's tick to the middle of the time in which it will be in use; 0 where patches are not ahead.
  [[nodiscard]] double lead_ticks() const;
  void interpolate_old_gaps();
  void advance_body();
  [[nodiscard]] ModelUpdate begin_update();
  [[nodiscard]] ModelStamp stamp(std::uint32_t sequence) const;
  std::optional<ModelUpdate> send_model(const SurfacePoint& focus);
  ModelUpdate send_force();
  // Where update() has no model, and the board may have an old one.
  [[nodiscard]] bool nothing_is_due() const;
  ModelUpdate send_nothing();
  struct Model {
    LocalModel model;
    wire::ModelContents contents;
    wire::PackedModel packed;
  };
  Model make_model(const SurfacePoint& focus);
  // Around the place ahead, if the contact is on its patch, otherwise less far ahead.
  Model make_model_ahead(const SurfacePoint& contact);
  [[nodiscard]] bool has_contact(const Model& made) const;
  // The basis of the patch after this one, if it is another, there, and not on the board.
  using WantedBasis = std::pair<std::shared_ptr<const std::vector<std::uint8_t>>, std::uint32_t>;
  WantedBasis next_basis(const Model& made);
  [[nodiscard]] bool is_held(std::uint32_t basis_id) const;

  const Body& body_;
  SessionConfig config_;
  BodySurface surface_;
  std::unique_ptr<FeedbackScheme> feedback_;
  std::unique_ptr<ModelBuilder> builder_;
  ContactState<double> contact_{};
  TipHistory path_;
  bool started_ = false;
  std::uint32_t tick_ = 0;
  std::uint32_t sequence_ = 0;
  // Of the newest model that the board may have, of a host before this one at the beginning; empty: it has
  // been told that nothing is near.
  std::optional<std::uint32_t> modelled_tick_;
  std::optional<std::uint32_t> nothing_tick_;  // of the first update since then that says so
  TipForecast forecast_;
  std::uint32_t foreseen_tick_ = 0;
  std::size_t basis_waits_ = 0;
  std::size_t around_ = 0;  // counts the cells around the contact that were foreseen
  double late_ticks_;       // from a model's tick to that in which the board takes it over, smoothed
  std::optional<std::uint32_t> requested_until_;  // gaps that end here were asked for at the last update
  std::optional<std::vector<std::uint32_t>> held_bases_;
  // The patch after the present one, when it was looked for last.
  std::vector<int> next_patch_;
  WantedBasis next_basis_;
  std::optional<SurfacePoint> around_held_;  // of the newest model whose basis was on the board
  std::vector<Interpolated> interpolated_;
  std::uint32_t interpolated_in_model_ = 0;
};

}  // namespace palpate::host
