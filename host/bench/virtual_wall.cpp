#include "host/bench/virtual_wall.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "firmware/core/passivity.hpp"
#include "firmware/core/supervisor.hpp"
#include "shared/device/count_estimator.hpp"

namespace palpate::host::bench {
namespace {

constexpr double kStart_m = -5e-3;
// Of the integration between two samples. The fastest that it has to follow is a grip of 1 kN/m on 0.05 kg:
// 140 rad/s.
constexpr double kStep_s = 25e-6;
constexpr std::uint32_t kMostDelay_ticks = 64;

// The device in the hand: force held, friction with true sticking.
class Axis {
 public:
  Axis(const WallDevice& device, const WallHand& hand) : device_(device), hand_(hand) {}

  // Implicit in friction, exact for what is held: a position by the new velocity alone would damp by K times
  // half a step. `motor_N` pushes out of the wall.
  void step(double motor_N, double step_s) {
    const double mass_kg = device_.mass_kg + hand_.mass_kg;
    const double old_m_s = velocity_m_s_;
    const double pull_N = hand_.push_N - hand_.stiffness_N_m * (position_m_ - kStart_m) - motor_N;
    // Before Coulomb's friction; that takes as much of it as it can.
    const double free_m_s = (mass_kg * old_m_s + step_s * pull_N) /
                            (mass_kg + step_s * (device_.viscosity_N_s_m + hand_.damping_N_s_m));
    const double most_m_s = step_s * device_.friction_N / mass_kg;
    velocity_m_s_ =
        free_m_s > most_m_s ? free_m_s - most_m_s : (free_m_s < -most_m_s ? free_m_s + most_m_s : 0.0);
    const double mean_m_s = 0.5 * (old_m_s + velocity_m_s_);
    const double move_m = mean_m_s * step_s;
    position_m_ += move_m;
    // Force of the hand on the tool, its inertia included, over the move.
    const double hand_N = hand_.push_N - hand_.stiffness_N_m * (position_m_ - 0.5 * move_m - kStart_m) -
                          hand_.damping_N_s_m * velocity_m_s_ -
                          hand_.mass_kg * (velocity_m_s_ - old_m_s) / step_s;
    given_J_ += hand_N * move_m;
  }

  [[nodiscard]] double position_m() const { return position_m_; }
  // By the hand to the tool.
  [[nodiscard]] double given_J() const { return given_J_; }

 private:
  WallDevice device_;
  WallHand hand_;
  double position_m_ = kStart_m;
  double velocity_m_s_ = 0.0;
  double given_J_ = 0.0;
};

// What the servo knows of the tip.
class Sampler {
 public:
  explicit Sampler(const WallServo& servo) : servo_(servo) {}

  void take(double position_m) {
    const double sample_m =
        servo_.count_m > 0.0 ? servo_.count_m * std::floor(position_m / servo_.count_m) : position_m;
    const double step_m = is_first_ ? 0.0 : sample_m - position_m_;
    position_m_ = sample_m;
    is_first_ = false;
    step_m_ = step_m;
    if (servo_.count_m > 0.0) {
      estimator_.update(static_cast<float>(step_m / servo_.count_m), 1.0f);
      velocity_m_s_ = static_cast<double>(estimator_.velocity_count_tick()) * servo_.count_m * servo_.rate_Hz;
    } else {
      velocity_m_s_ = step_m * servo_.rate_Hz;
    }
  }

  [[nodiscard]] double position_m() const { return position_m_; }
  [[nodiscard]] double step_m() const { return step_m_; }
  [[nodiscard]] double difference_m_s() const { return step_m_ * servo_.rate_Hz; }
  // As the firmware estimates it.
  [[nodiscard]] double velocity_m_s() const { return velocity_m_s_; }

 private:
  WallServo servo_;
  device::CountEstimator estimator_;
  double position_m_ = 0.0, step_m_ = 0.0, velocity_m_s_ = 0.0;
  bool is_first_ = true;
};

void check(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

}  // namespace

const std::vector<WallHand>& wall_hands() {
  static const std::vector<WallHand> hands{
      {.mass_kg = 0.0, .stiffness_N_m = 0.0, .damping_N_s_m = 0.2},
      {.mass_kg = 0.2, .stiffness_N_m = 0.0, .damping_N_s_m = 0.5},
      {.mass_kg = 0.05, .stiffness_N_m = 50.0, .damping_N_s_m = 0.5},
      {.mass_kg = 0.1, .stiffness_N_m = 1000.0, .damping_N_s_m = 5.0, .push_N = 6.0},
  };
  return hands;
}

double created_energy_J(const WallDevice& device, const WallHand& hand, const WallServo& servo,
                        const Wall& wall, double duration_s, double most_J) {
  check(servo.rate_Hz >= 100.0 && servo.rate_Hz <= 20e3, "rate_Hz: must be in [100, 20000] Hz");
  check(servo.delay_ticks <= kMostDelay_ticks, "delay_ticks: must be at most 64");
  check(servo.count_m >= 0.0 && servo.count_m <= 1e-3, "count_m: must be in [0, 0.001] m");
  const double tick_s = 1.0 / servo.rate_Hz;
  const int steps = std::max(1, static_cast<int>(std::ceil(tick_s / kStep_s)));
  const auto ticks = static_cast<std::uint32_t>(duration_s * servo.rate_Hz);
  const firmware::PassivityLimits limits = firmware::passivity_limits(firmware::kDefaultLimits);
  Axis axis(device, hand);
  Sampler sampler(servo);
  firmware::PassivityState passivity;
  // Of the tip on the wall, as in the firmware: from the tick of its sample on.
  std::array<double, kMostDelay_ticks + 1> waiting_N{};
  double created_J = 0.0, in_use_N = 0.0;
  for (std::uint32_t tick = 0; tick < ticks && created_J <= most_J; ++tick) {
    sampler.take(axis.position_m());
    double wanted_N = 0.0;
    if (sampler.position_m() > 0.0)
      wanted_N = std::max(
          0.0, wall.stiffness_N_m * sampler.position_m() + wall.damping_N_s_m * sampler.difference_m_s());
    const std::size_t now = tick % (servo.delay_ticks + 1);
    waiting_N[now] = wanted_N;
    const double arrived_N = tick < servo.delay_ticks ? 0.0 : waiting_N[(now + 1) % (servo.delay_ticks + 1)];
    double force_N = std::min(arrived_N, device.most_force_N);
    if (servo.is_controlled) {
      // The account is of what the motors did, whatever was late in what they were told.
      passivity = observe(passivity,
                          {.force_N = {static_cast<float>(in_use_N), 0.0f, 0.0f},
                           .step_m = {static_cast<float>(sampler.step_m()), 0.0f, 0.0f},
                           .touches = arrived_N != 0.0},
                          limits);
      const Vec3f damping_N =
          passivity_damping(passivity, {static_cast<float>(sampler.velocity_m_s()), 0.0f, 0.0f},
                            static_cast<float>(tick_s), limits);
      const double with_N =
          std::clamp(force_N + static_cast<double>(damping_N.x), -device.most_force_N, device.most_force_N);
      passivity.damping_N = {static_cast<float>(with_N - force_N), 0.0f, 0.0f};
      force_N = with_N;
    }
    in_use_N = force_N;
    for (int i = 0; i < steps; ++i) {
      axis.step(force_N, tick_s / steps);
      created_J = std::max(created_J, -axis.given_J());
    }
  }
  return created_J;
}

std::optional<double> stiffest_wall_N_m(const WallDevice& device, const WallServo& servo,
                                        double damping_N_s_m, double duration_s, double most_J) {
  constexpr int kFirst = 20, kLast = 100;  // 10 to 1e5
  std::optional<double> stiffest_N_m;
  for (int i = kFirst; i <= kLast; ++i) {
    const Wall wall{std::pow(10.0, i / 20.0), damping_N_s_m};
    for (const WallHand& hand : wall_hands()) {
      if (created_energy_J(device, hand, servo, wall, duration_s, most_J) > most_J) return stiffest_N_m;
    }
    stiffest_N_m = wall.stiffness_N_m;
  }
  return stiffest_N_m;
}

}  // namespace palpate::host::bench
