#include "host/session/session.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "firmware/core/supervisor.hpp"
#include "host/linearize/growth_limit.hpp"
#include "host/msd/vectors.hpp"
#include "shared/servo_tick.hpp"
#include "shared/wire/tip_trace.hpp"

namespace palpate::host {
namespace {

// Places on the tip's way ahead to prepare for: where it will be when what is begun now is done, when what is
// begun after that is done, and between the two.
constexpr std::array kForeseen{1.0, 1.5, 2.0};

constexpr std::size_t kAroundAtOnce = 2;

// Where updates are rarer than 20 a second, what they need is prepared between them.
constexpr std::uint32_t kPrepareAfter_ticks = 50;

// How much the lateness of the newest model counts: a single one that had to wait moves no patch by much.
constexpr double kNewestsShare = 0.25;

// A board's tip history is shorter: what is said to be later is an error of its sender.
constexpr std::uint32_t kLatest_ticks = 1000;

double period_ticks(const SessionConfig& config) {
  return 1.0 / (config.update_Hz * kTick_s);
}

}  // namespace

std::uint16_t default_growth_ticks(double update_Hz) {
  constexpr double kJitter_ticks = 30.0;
  const double ticks = std::ceil(2.0 / (update_Hz * kTick_s)) + kJitter_ticks;
  return static_cast<std::uint16_t>(std::min<double>(ticks, std::numeric_limits<std::uint16_t>::max()));
}

Session::Session(const Body& body, BodyState start, const SessionConfig& config)
    : body_(body),
      config_(config),
      surface_(body, std::move(start), config.step_s, config.surface, config.drives, config.friction),
      feedback_(make_feedback(config.feedback, config.law)),
      builder_(make_builder(body, config.model, kTick_s)),
      forecast_(body),
      late_ticks_(period_ticks(config)) {
  (void)steps_per_tick(config.step_s);
  if (!config_.growth_ticks) config_.growth_ticks = default_growth_ticks(config.update_Hz);
}

void Session::take(const palpate_ServoTrace_1_0& trace) {
  for (std::uint32_t i = 0; i < trace.samples.count; ++i) {
    const float* tip = trace.samples.elements[i].tip_m;
    add(trace.first_tick + i,
        {static_cast<double>(tip[0]), static_cast<double>(tip[1]), static_cast<double>(tip[2])});
  }
}

void Session::take(const palpate_TipTrace_1_0& trace) {
  for (std::uint32_t i = 0; i <= trace.offsets.count; ++i)
    add(trace.first_tick + i, wire::read_tip(trace, i));
}

void Session::add(std::uint32_t tick, const Vec3d& tip_m) {
  if (!path_.follows(tick)) begin_anew();
  path_.add(tick, tip_m);
}

void Session::begin_anew() {
  path_ = {};
  started_ = false;
  contact_ = {};
  feedback_ = make_feedback(config_.feedback, config_.law);
  forecast_.forget();
  foreseen_tick_ = 0;
  requested_until_.reset();
}

bool Session::due(std::uint32_t tick) const {
  // The tick in which the count of whole update periods since tick 0 goes up.
  const double per_tick = config_.update_Hz * kTick_s;
  return tick > 0 && std::floor(tick * per_tick) > std::floor((tick - 1) * per_tick);
}

void Session::interpolate_old_gaps() {
  if (requested_until_) {
    for (const std::uint32_t tick : path_.interpolate_until(*requested_until_)) {
      interpolated_.push_back({tick, path_.at(tick), sequence_ + 1});
      ++interpolated_in_model_;
    }
  }
  requested_until_.reset();
  const auto gaps = path_.gaps();
  if (!gaps.empty()) requested_until_ = gaps.back().first + gaps.back().count - 1;
}

void Session::advance_body() {
  const std::uint32_t until = path_.complete_tick();
  feedback_->advance(surface_, contact_, path_, tick_, until);
  tick_ = until;
  path_.forget_before(tick_);
}

std::optional<SurfacePoint> Session::focus(std::uint32_t tick) const {
  if (contact_.mode != ContactMode::free)
    return SurfacePoint{static_cast<int>(contact_.triangle), to_eigen(contact_.barycentric)};
  const Eigen::Vector3d tip = to_eigen(path_.at(tick));
  SurfacePoint nearest = nearest_surface_point(body_, surface_.state().position_m, tip);
  const double distance = (surface_position_m(body_, surface_.state().position_m, nearest) - tip).norm();
  if (distance > reach_m()) return std::nullopt;
  return nearest;
}

double Session::lead_ticks() const {
  return config_.patch_ahead ? late_ticks_ + 0.5 * period_ticks(config_) : 0.0;
}

void Session::note_taken(std::uint32_t model_tick, std::uint32_t swap_tick) {
  if (nothing_tick_ && static_cast<std::int32_t>(model_tick - *nothing_tick_) >= 0) {
    modelled_tick_.reset();
    nothing_tick_.reset();
    return;
  }
  const std::uint32_t late_ticks = swap_tick - model_tick;
  if (late_ticks > kLatest_ticks) return;
  late_ticks_ += kNewestsShare * (static_cast<double>(late_ticks) - late_ticks_);
}

// The place where it is now comes after those ahead: a tip that moves on is no longer there when that is
// ready. Last come the ways that it may take next, some of the cells around it at each update.
void Session::foresee(std::uint32_t tick, const std::optional<SurfacePoint>& focus) {
  foreseen_tick_ = tick;
  const std::uint32_t ahead = builder_->foresight_ticks();
  if (ahead == 0 && !config_.patch_ahead) return;
  const Eigen::Vector3d tip_m = to_eigen(path_.at(tick));
  const Eigen::Matrix3Xd& position_m = surface_.state().position_m;
  forecast_.note(tick, tip_m, position_m, focus ? *focus : nearest_surface_point(body_, position_m, tip_m));
  if (ahead == 0) return;
  std::vector<SurfacePoint> contacts;
  if (forecast_.moves())
    for (const double part : kForeseen)
      if (const auto place = forecast_.place(lead_ticks() + part * ahead, reach_m()))
        contacts.push_back(*place);
  if (focus) {
    contacts.push_back(*focus);
    const std::vector<int> around = neighbour_cells(body_, focus->triangle);
    for (std::size_t i = 0; i < kAroundAtOnce; ++i)
      contacts.push_back({around[around_++ % around.size()], Eigen::Vector3d::Constant(1.0 / 3.0)});
  }
  builder_->foresee(tick, contacts);
}

void Session::prepare() {
  if (path_.empty() || builder_->foresight_ticks() == 0) return;
  const std::uint32_t tick = path_.complete_tick();
  if (tick >= foreseen_tick_ + kPrepareAfter_ticks) foresee(tick, focus(tick));
}

std::optional<ModelUpdate> Session::update() {
  if (path_.empty()) return std::nullopt;
  interpolate_old_gaps();
  if (!started_) {
    started_ = true;
    tick_ = path_.first_tick();
    modelled_tick_ = tick_;
    nothing_tick_.reset();
  }
  const std::uint32_t before = tick_;
  advance_body();
  // Not with the first sample alone: whether the tip starts inside the body is known after a tick.
  if (tick_ == before) return std::nullopt;
  const auto point = focus(tick_);
  foresee(tick_, point);
  std::optional<ModelUpdate> sent;
  const std::size_t waits = basis_waits_;
  if (point) sent = feedback_->kind() == ModelKind::held_force ? send_force() : send_model(*point);
  if (sent) {
    modelled_tick_ = tick_;
    nothing_tick_.reset();
    return sent;
  }
  feedback_->sent_none();
  // A model whose basis is still being made will come.
  if (basis_waits_ == waits && nothing_is_due()) return send_nothing();
  return std::nullopt;
}

void Session::note_suspended() {
  if (modelled_tick_ || !started_) return;
  // Due at once.
  modelled_tick_ =
      tick_ - firmware::kDefaultLimits.model_horizon_ticks - firmware::kDefaultLimits.model_fade_ticks;
}

bool Session::nothing_is_due() const {
  if (!modelled_tick_) return false;
  // A tip that is soon back finds the model that it left, and that one never grows old. A tip that presses
  // where the body is fixed has a force, which is left to fade.
  const firmware::Limits& board = firmware::kDefaultLimits;
  const std::uint32_t horizon_ticks = std::min<std::uint32_t>(config_.valid_ticks, board.model_horizon_ticks);
  const std::uint32_t wait_ticks =
      contact_.mode == ContactMode::free ? horizon_ticks / 2 : horizon_ticks + board.model_fade_ticks;
  return tick_ - *modelled_tick_ >= wait_ticks;
}

ModelUpdate Session::begin_update() {
  ++sequence_;
  ModelUpdate update;
  update.state = surface_.state();
  update.interpolated_ticks = std::exchange(interpolated_in_model_, 0);
  return update;
}

ModelStamp Session::stamp(std::uint32_t sequence) const {
  return {.sequence = sequence,
          .tick = tick_,
          .valid_ticks = config_.valid_ticks,
          .tip = config_.tip,
          .kind = feedback_->kind(),
          .growth_ticks = *config_.growth_ticks};
}

Session::Model Session::make_model(const SurfacePoint& focus) {
  Model made;
  made.model = builder_->build(surface_.state(), focus, surface_.drives().upcoming());
  limit_growth(made.model, config_.valid_ticks * kTick_s);
  if (made.model.modes() == 0) return made;
  pack_model(made.model, stamp(sequence_ + 1), config_.law, config_.surface, surface_.friction(), contact_,
             made.contents);
  made.packed = wire::pack(made.contents);
  return made;
}

bool Session::is_held(std::uint32_t basis_id) const {
  return held_bases_ && std::find(held_bases_->begin(), held_bases_->end(), basis_id) != held_bases_->end();
}

bool Session::has_contact(const Model& made) const {
  const std::vector<int>& triangles = made.model.triangle;
  return contact_.mode == ContactMode::free ||
         std::find(triangles.begin(), triangles.end(), static_cast<int>(contact_.triangle)) !=
             triangles.end();
}

Session::Model Session::make_model_ahead(const SurfacePoint& contact) {
  const std::size_t waits = builder_->basis_waits();
  Model made;
  for (const double part : {1.0, 0.5, 0.0}) {
    // A tip that sticks takes its place along.
    if (part != 0.0 && (!config_.patch_ahead || contact_.mode == ContactMode::stick)) continue;
    const auto place = part == 0.0 ? contact : forecast_.place(part * lead_ticks(), reach_m());
    if (!place) continue;
    made = make_model(*place);
    if (made.model.modes() != 0 && has_contact(made)) break;
  }
  if (builder_->basis_waits() != waits) ++basis_waits_;
  return made;
}

Session::WantedBasis Session::next_basis(const Model& made) {
  if (!config_.patch_ahead || !forecast_.moves() || contact_.mode == ContactMode::stick) return {};
  // It is to be on the board at the update after the next.
  const auto place = forecast_.place(lead_ticks() + 2.0 * period_ticks(config_), reach_m());
  if (!place) return {};
  const PatchSize& size = config_.model.patch;
  const std::vector<int> patch = select_patch(body_, *place, size);
  if (patch == select_patch(body_, *made.model.chosen_around, size)) return {};
  if (patch != next_patch_ || next_basis_.first == nullptr) {
    const Model next = make_model(*place);
    // Without modes of its own it is on the patch before.
    if (next.model.modes() == 0 || select_patch(body_, *next.model.chosen_around, size) != patch) return {};
    next_patch_ = patch;
    next_basis_ = {next.packed.basis, next.packed.state.basis_id};
  }
  if (is_held(next_basis_.second)) return {};
  return next_basis_;
}

std::optional<ModelUpdate> Session::send_model(const SurfacePoint& contact) {
  Model made = make_model_ahead(contact);
  const bool stays = made.contents.rest_m.count != 0;
  WantedBasis wanted;
  if (stays && is_held(made.packed.state.basis_id)) {
    around_held_ = made.model.chosen_around;
    wanted = next_basis(made);
  } else if (around_held_) {
    Model before = make_model(*around_held_);
    if (before.model.modes() != 0 && has_contact(before) && is_held(before.packed.state.basis_id)) {
      if (made.model.modes() != 0) wanted = {made.packed.basis, made.packed.state.basis_id};
      made = std::move(before);
    }
  }
  if (made.model.modes() == 0)
    return std::nullopt;  // the tip is over fixed nodes only, or the basis is not there
  ModelUpdate update = begin_update();
  std::tie(update.wanted_basis, update.wanted_basis_id) = std::move(wanted);
  update.message = wire::unpack(made.packed, made.contents);
  update.packed = std::move(made.packed);
  update.basis_stays = made.contents.rest_m.count != 0;
  update.patch_nodes = made.model.node;
  update.damping_coupling = made.model.damping_coupling;
  update.limited_modes = made.model.limited_modes;
  feedback_->sent(made.model, update.packed, surface_.state(), path_.at(tick_));
  return update;
}

ModelUpdate Session::send_force() {
  ModelUpdate update = begin_update();
  pack_held_force(stamp(sequence_), config_.law, contact_, update.message);
  update.packed = wire::pack(update.message);
  return update;
}

ModelUpdate Session::send_nothing() {
  if (!nothing_tick_) nothing_tick_ = tick_;
  ModelUpdate update = begin_update();
  pack_nothing({.sequence = sequence_, .tick = tick_, .tip = config_.tip}, config_.law, update.message);
  update.packed = wire::pack(update.message);
  return update;
}

}  // namespace palpate::host
