// The board's rendering of one local model, repeated on the host by the board's own code: same messages, same
// tip positions, same bits; of a model with a near field that came late as far as it is told how it caught
// up.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/core/renderer.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::host {

class ModelReplay {
 public:
  // Starts the model at its own tick, with the tip where the board had it then. Throws std::invalid_argument,
  // naming the palpate::Status, for a model that the board would refuse.
  ModelReplay(const wire::PackedModel& model, const Vec3f& tip_m)
      : ModelReplay(model, tip_m, model.state.tick) {}
  // Starts it at a later tick: kinds that the board does not roll forward.
  ModelReplay(const wire::PackedModel& model, const Vec3f& tip_m, std::uint32_t tick);

  // Steps between two computations of the near field. While a model catches up the board's CatchUpPolicy has
  // it: before the first step; kNearPeriod_steps before the tick of its take-over. Without it the model has
  // never been late.
  void set_near_period(std::uint32_t steps);

  // The next servo tick, with the tip where the board had it.
  firmware::ServoSample step(const Vec3f& tip_m);

  // Modes at the end of the newest step; before the first one, at the model's tick.
  [[nodiscard]] const ModalState& state() const { return state_; }
  // Its contact then, on the body's own triangle.
  [[nodiscard]] ContactState<double> contact() const;
  // A surface node of the model (its index there) at the same time, device frame. Evaluated in double
  // precision from the modes: within 3e-5 of its displacement of what the board's contact sees, which rounds
  // them to 16 bits.
  [[nodiscard]] Eigen::Vector3d surface_node_m(std::size_t node) const;

 private:
  std::shared_ptr<const std::vector<std::uint8_t>> basis_;
  LocalModelView view_{};  // of basis_, position_m and load below
  std::vector<float> position_m_, load_;
  std::unique_ptr<firmware::Renderer> renderer_;
  std::uint32_t tick_;
  ModalState state_{};
};

}  // namespace palpate::host
