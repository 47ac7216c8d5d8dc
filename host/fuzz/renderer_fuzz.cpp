// The renderer under models with changed bytes, payloads of any bytes, any tip path and resets.
#include <cmath>
#include <memory>

#include "firmware/core/renderer.hpp"
#include "host/fuzz/input.hpp"
#include "host/fuzz/model_input.hpp"

using namespace palpate;
using fuzz::require;

namespace {

constexpr std::uint32_t kFirstTick = 300;
constexpr std::uint32_t kMostTicks = 600;  // of a run: beyond the tip history, in some milliseconds

class Run {
 public:
  explicit Run(fuzz::Input& input)
      : input_(input),
        renderer_(std::make_unique<firmware::Renderer>(
            wire::kSchemaHash,
            input.take<std::uint8_t>() % 2 == 0 ? firmware::kCatchUpCortexM4 : firmware::kCatchUpCortexM7)) {}

  void go() {
    while (!input_.empty() && tick_ < kFirstTick + kMostTicks) step();
    for (int i = 0; i < 60; ++i) tick();
  }

 private:
  enum Action : std::uint8_t { ticks, model, any_state, any_part, leap, reset, actions };

  void step() {
    switch (static_cast<Action>(input_.take<std::uint8_t>() % actions)) {
      case ticks: {
        for (float& speed : speed_m_) speed = 1e-5f * static_cast<float>(input_.take<std::int8_t>());
        for (int count = input_.take<std::uint8_t>() % 64; count >= 0; --count) tick();
        return;
      }
      case model: {
        const fuzz::ModelPayloads payloads = fuzz::take_model(input_, tick_);
        for (const auto& part : payloads.parts) (void)renderer_->accept_part(part);
        (void)renderer_->accept(payloads.state, report_);
        return;
      }
      case any_state:
        (void)renderer_->accept(input_.bytes(input_.take<std::uint16_t>() % 2048), report_);
        return;
      case any_part:
        (void)renderer_->accept_part(input_.bytes(input_.take<std::uint16_t>() % 2048));
        return;
      case leap:
        for (float& place : tip_m_) place = input_.take<float>();
        return;
      case reset:
        renderer_->isr_reset();
        return;
      case actions:
        return;
    }
  }

  void tick() {
    for (std::size_t axis = 0; axis < 3; ++axis) tip_m_[axis] += speed_m_[axis];
    const Vec3f tip_m{tip_m_[0], tip_m_[1], tip_m_[2]};
    (void)renderer_->isr_tick(++tick_, tip_m);
    (void)renderer_->catch_up(report_);
    while (renderer_->next_report(report_)) {
    }
    firmware::BasisStore::Event event;
    while (renderer_->next_basis_event(event)) {
    }
    firmware::ServoSample sample;
    require(renderer_->sample(tick_, sample), "the newest tick is in the history");
  }

  fuzz::Input& input_;
  std::unique_ptr<firmware::Renderer> renderer_;
  firmware::ModelReport report_;
  std::uint32_t tick_ = kFirstTick;
  std::array<float, 3> tip_m_{0.0f, 0.0f, 1e-3f}, speed_m_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  Run(input).go();
  return 0;
}
