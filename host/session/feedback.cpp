#include "host/session/feedback.hpp"

#include <optional>
#include <stdexcept>
#include <vector>

#include "host/msd/vectors.hpp"
#include "host/session/model_replay.hpp"

namespace palpate::host {
namespace {

class Exact final : public FeedbackScheme {
 public:
  explicit Exact(const ContactLaw<double>& law) : law_(law) {}
  void advance(BodySurface& surface, ContactState<double>& contact, const TipHistory& path,
               std::uint32_t from, std::uint32_t until) override {
    for (std::uint32_t tick = from; tick != until; ++tick)
      (void)advance_tick(surface, contact, law_, path.at(tick), path.at(tick + 1));
  }
  [[nodiscard]] ModelKind kind() const override { return ModelKind::modes; }

 private:
  ContactLaw<double> law_;
};

// Between two updates the tip goes in a straight line, for the body must be stepped more often than it is
// told of the tip.
class Sampled final : public FeedbackScheme {
 public:
  Sampled(ModelKind kind, const ContactLaw<double>& law) : kind_(kind), law_(law) {}
  void advance(BodySurface& surface, ContactState<double>& contact, const TipHistory& path,
               std::uint32_t from, std::uint32_t until) override {
    if (from == until) return;
    const std::uint32_t ticks = until - from;
    const Vec3d start_m = path.at(from), way_m = path.at(until) - start_m;
    BodyTick last{};
    for (std::uint32_t i = 0; i < ticks; ++i)
      last = advance_tick(surface, contact, law_, start_m + way_m * (static_cast<double>(i) / ticks),
                          start_m + way_m * (static_cast<double>(i + 1) / ticks));
    // A servo tick's force, not that of one of its steps: the impact of a step would be held for a whole
    // period.
    contact.force_N = last.mean_force_N;
  }
  [[nodiscard]] ModelKind kind() const override { return kind_; }

 private:
  ModelKind kind_;
  ContactLaw<double> law_;
};

class Paper final : public FeedbackScheme {
 public:
  void advance(BodySurface& surface, ContactState<double>& contact, const TipHistory& path,
               std::uint32_t from, std::uint32_t until) override {
    if (from == until) return;
    const int steps = steps_per_tick(surface.step_s());
    for (std::uint32_t tick = from; tick != until; ++tick) {
      for (int i = 0; i < steps; ++i) surface.advance();
      // The positions came over the link in single precision: the same bits.
      if (patch_) (void)patch_->replay.step(narrow(path.at(tick + 1)));
    }
    contact = {};
    if (!patch_) return;
    overwrite(surface);
    contact = patch_->replay.contact();
  }
  [[nodiscard]] ModelKind kind() const override { return ModelKind::modes; }
  void sent(const LocalModel& model, const wire::PackedModel& packed, const BodyState& state,
            const Vec3d& tip_m) override {
    patch_.emplace(Patch{ModelReplay(packed, narrow(tip_m)), model.dof_node, model.dof_axis, model.dof_basis,
                         state.position_m});
  }
  void sent_none() override { patch_.reset(); }

 private:
  struct Patch {
    ModelReplay replay;
    std::vector<int> node, axis;
    Eigen::MatrixXd basis_1_sqrt_kg;
    Eigen::Matrix3Xd start_m;  // of all nodes, at q = 0
  };

  void overwrite(BodySurface& surface) const {
    const auto modes = patch_->basis_1_sqrt_kg.cols();
    const ModalState& modal = patch_->replay.state();
    const Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXf>(modal.q.data(), modes).cast<double>();
    const Eigen::VectorXd p = Eigen::Map<const Eigen::VectorXf>(modal.p.data(), modes).cast<double>();
    const Eigen::VectorXd moved_m = patch_->basis_1_sqrt_kg * q, moving_m_s = patch_->basis_1_sqrt_kg * p;
    for (std::size_t d = 0; d < patch_->node.size(); ++d) {
      const auto row = static_cast<Eigen::Index>(d);
      surface.overwrite(patch_->node[d], patch_->axis[d],
                        patch_->start_m(patch_->axis[d], patch_->node[d]) + moved_m[row], moving_m_s[row]);
    }
  }

  std::optional<Patch> patch_;
};

}  // namespace

std::unique_ptr<FeedbackScheme> make_feedback(Feedback feedback, const ContactLaw<double>& law) {
  switch (feedback) {
    case Feedback::exact:
      return std::make_unique<Exact>(law);
    case Feedback::paper:
      return std::make_unique<Paper>();
    case Feedback::discard:
      return std::make_unique<Sampled>(ModelKind::modes_from_now, law);
    case Feedback::hold:
      return std::make_unique<Sampled>(ModelKind::held_force, law);
  }
  throw std::invalid_argument("feedback: unknown scheme");
}

}  // namespace palpate::host
