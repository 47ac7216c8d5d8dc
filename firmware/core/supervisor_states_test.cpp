#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <set>
#include <tuple>
#include <vector>

#include "firmware/core/supervisor.hpp"

namespace palpate::firmware {
namespace {

constexpr std::uint32_t kSeed = 0x12345678u;
// Rounding of the limited force: a few operations on numbers up to 10 N.
constexpr float kForceRounding_N = 4e-6f;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Walks through every state that is reachable with small limits, under every command together with every
// condition, and checks what must hold in all of them.
class AllStates : public ::testing::Test {
 protected:
  static Limits small_limits() {
    Limits limits;
    limits.boot_ticks = 2;
    limits.arming_window_ticks = 3;
    limits.soft_start_ticks = 2;
    limits.force_step_N = 20.0f;  // no step is limited: few forces
    limits.model_fade_ticks = 2;
    limits.direct_force_step_N = 5.0f;
    limits.direct_hold_ticks = 2;
    limits.direct_fade_ticks = 2;
    limits.direct_lost_ticks = 3;
    limits.calibration_ticks = 2;
    limits.over_current_ticks = 2;
    limits.missed_deadline_weight = 2;
    limits.missed_deadline_bucket = 3;
    limits.link_silent_ticks = 2;
    limits.damping_ticks = 2;
    limits.link_lost_ticks = 6;
    return limits;
  }

  static std::vector<SupervisorInputs> situations(const Limits& limits) {
    SupervisorInputs quiet;
    quiet.tick = 5;
    quiet.force_N = {0.0f, 0.0f, 20.0f};
    quiet.model_sequence = 1;
    quiet.model_valid_ticks = 10;
    std::vector<SupervisorInputs> all{quiet};
    const auto add = [&](auto&& change) {
      all.push_back(quiet);
      change(all.back());
    };
    add([](auto& in) { in.emergency_stop_open = true; });
    add([](auto& in) { in.joint_step_rad = 1.0f; });
    add([](auto& in) { in.tip_speed_m_s = 100.0f; });
    add([](auto& in) { in.inside_workspace = false; });
    add([](auto& in) { in.at_rest = false; });
    add([](auto& in) { in.force_N.x = kNan; });
    add([](auto& in) { in.force_N.x = 1e6f; });
    add([](auto& in) { in.missed_deadlines = 1; });
    add([](auto& in) { in.elapsed_ticks = 4; });
    add([](auto& in) { in.model_sequence = 0; });
    add([](auto& in) { in.model_age_ticks = 11; });
    add([](auto& in) { in.link_age_ticks = 3; });
    add([](auto& in) { in.link_age_ticks = 3, in.model_age_ticks = 20; });
    add([](auto& in) { in.link_age_ticks = 7, in.model_age_ticks = 20, in.tip_velocity_m_s.x = 0.3f; });
    add([](auto& in) { in.force_N = {}, in.model_valid_ticks = 0; });  // nothing is near
    add([](auto& in) { in.force_N = {}, in.model_valid_ticks = 0, in.model_age_ticks = 20; });
    add([](auto& in) { in.model_valid_ticks = 0, in.model_age_ticks = 20, in.link_age_ticks = 3; });
    add([](auto& in) { in.model_age_ticks = 20, in.tip_velocity_m_s.x = 0.3f; });
    add([](auto& in) { in.model_use_ticks = 1; });  // no growth any more
    add([](auto& in) { in.tip_step_m.z = -1.0f; });
    add([](auto& in) { in.direct_age_ticks = 0, in.direct_force_N = {0.0f, 20.0f, 0.0f}; });
    add([](auto& in) { in.direct_age_ticks = 9, in.direct_force_N = {0.0f, 20.0f, 0.0f}; });
    add([](auto& in) { in.direct_age_ticks = 0, in.direct_force_N.x = kNan; });
    add([](auto& in) { in.direct_age_ticks = 0, in.direct_force_N.x = 1e6f; });
    add([&](auto& in) { in.measured_current_A[0] = 10.0f * limits.motor_current_A[0]; });
    return all;
  }

  static FaultSet lowest(int faults) { return static_cast<FaultSet>(faults & -faults); }

  // Ages beyond all limits make no difference: this keeps the number of states finite.
  static SupervisorState reduced(SupervisorState state) {
    constexpr std::uint32_t kOld = 8;
    state.mode_age_ticks = std::min(state.mode_age_ticks, kOld);
    state.token_age_ticks = std::min(state.token_age_ticks, kOld);
    state.over_current_ticks = std::min(state.over_current_ticks, kOld);
    // Nor does it make one which faults are latched beside two of them.
    FaultSet kept = 0;
    for (int i = 0; i < 2; ++i) kept = static_cast<FaultSet>(kept | lowest(state.faults & ~kept));
    state.faults = kept;
    state.soft_start_ticks = std::min(state.soft_start_ticks, small_limits().soft_start_ticks);
    state.damping_ticks = std::min(state.damping_ticks, small_limits().damping_ticks + 1);
    return state;
  }

  struct Before {
    static auto key(const SupervisorState& s) {
      return std::make_tuple(s.mode, s.faults, s.mode_age_ticks, s.token, s.token_age_ticks,
                             s.token_is_direct, s.token_node, s.over_current_ticks, s.missed_deadline_level,
                             s.position_trusted, s.force_N.x, s.force_N.y, s.force_N.z, s.force_was_lost,
                             s.growth_had_ended, s.grown_N, s.soft_start_ticks, s.damping_ticks, s.energy_J);
    }
    bool operator()(const SupervisorState& a, const SupervisorState& b) const { return key(a) < key(b); }
  };
};

TEST_F(AllStates, KeepTheRules) {
  const Limits limits = small_limits();
  const std::vector<SupervisorInputs> inputs = situations(limits);
  std::set<SupervisorState, Before> seen{SupervisorState{}};
  std::deque<SupervisorState> open{SupervisorState{}};
  std::size_t edges = 0;
  std::array<bool, kModes> mode_seen{};
  while (!open.empty()) {
    const SupervisorState state = open.front();
    open.pop_front();
    mode_seen[static_cast<std::size_t>(state.mode)] = true;
    for (SupervisorInputs in : inputs) {
      for (std::uint8_t number = 0; number <= 10; ++number) {
        // 8 is no action; 9 stands for a confirmation with another token, 10 for one of another node.
        const bool wrong_token = number == 9, another_node = number == 10;
        const Action action = number > 8 ? Action::arm_confirm : static_cast<Action>(number);
        in.command_node = another_node ? 11 : 10;
        in.command = {action, wrong_token ? state.token + 1 : state.token};
        const Decision decision = supervise(state, in, limits, kSeed);
        const SupervisorState& next = decision.state;
        ++edges;

        ASSERT_EQ(decision.outputs_on, next.mode == Mode::render || next.mode == Mode::direct);
        ASSERT_EQ(next.faults != 0, next.mode == Mode::fault);
        if (!decision.outputs_on) {
          ASSERT_EQ(next.force_N, Vec3f{});
        }
        ASSERT_TRUE(is_finite(next.force_N));
        const float peak_N = next.mode == Mode::direct ? limits.direct_force_N : limits.peak_force_N;
        ASSERT_LE(norm(next.force_N), peak_N + kForceRounding_N);
        // One door: outputs come on by a confirmation with the open token in idle, within its window.
        // They never go from one source of forces to the other.
        if (decision.outputs_on && outputs_on(state.mode)) {
          ASSERT_EQ(next.mode, state.mode);
        }
        // The exception: a link that was lost, whose host is heard and has sent a model.
        const bool resumes = decision.outputs_on && state.mode == Mode::suspended;
        if (resumes) {
          ASSERT_EQ(next.mode, Mode::render);
          ASSERT_NE(action, Action::disarm);
          ASSERT_LE(in.link_age_ticks, limits.link_silent_ticks);
          ASSERT_LE(state.mode_age_ticks + in.elapsed_ticks, limits.link_lost_ticks);
          const std::uint32_t horizon =
              in.model_valid_ticks != 0 ? in.model_valid_ticks : limits.link_silent_ticks;
          ASSERT_TRUE(in.model_sequence != 0 && in.model_age_ticks <= horizon);
          ASSERT_EQ(next.force_N, Vec3f{});
        }
        // A model that has faded is never rendered: nothing but the damper, and not for ever.
        const bool has_faded = in.model_sequence != 0 && in.model_valid_ticks != 0 &&
                               in.model_age_ticks >= in.model_valid_ticks + limits.model_fade_ticks;
        if (next.mode == Mode::render && state.mode == Mode::render && has_faded) {
          ASSERT_NEAR(norm(next.force_N - limits.damping_N_s_m * in.tip_velocity_m_s), 0.0f,
                      kForceRounding_N);
          ASSERT_GT(next.damping_ticks, state.damping_ticks);
          ASSERT_LE(next.damping_ticks, limits.damping_ticks);
        }
        // Nor does the force of one that has been in use for too long grow.
        const bool grows = in.model_sequence == 0 || in.model_use_ticks <= in.model_growth_ticks;
        if (next.mode == Mode::render && state.mode == Mode::render && next.damping_ticks == 0 && !grows) {
          ASSERT_LE(norm(next.force_N - next.passivity.damping_N),
                    std::max(norm(state.force_N), limits.force_step_N) + kForceRounding_N);
        }
        if (next.mode == Mode::suspended) {
          ASSERT_TRUE(state.mode == Mode::suspended || state.mode == Mode::render);
          ASSERT_LE(in.link_age_ticks, limits.link_lost_ticks);
          ASSERT_LE(next.mode_age_ticks, limits.link_lost_ticks);
        }
        if (decision.outputs_on && !outputs_on(state.mode) && !resumes) {
          ASSERT_EQ(next.mode == Mode::direct, state.token_is_direct);
          ASSERT_TRUE(state.mode == Mode::idle || state.mode == Mode::calibrate || state.mode == Mode::boot);
          ASSERT_EQ(action, Action::arm_confirm);
          ASSERT_FALSE(wrong_token);
          ASSERT_FALSE(another_node);
          ASSERT_NE(state.token, 0u);
          ASSERT_LE(state.token_age_ticks + in.elapsed_ticks, limits.arming_window_ticks);
          ASSERT_TRUE(state.position_trusted);
          ASSERT_EQ(next.force_N, Vec3f{});
        }
        // Tokens are open in idle only.
        ASSERT_TRUE(next.token == 0 || next.mode == Mode::idle);
        // Latched: faults only grow, unless they are cleared.
        if (state.mode == Mode::fault && action != Action::clear_fault) {
          ASSERT_EQ(next.mode, Mode::fault);
          ASSERT_EQ(next.faults & state.faults, state.faults);
        }
        if (action == Action::stop || in.emergency_stop_open || !is_finite(in.force_N) ||
            !is_finite(in.direct_force_N)) {
          ASSERT_EQ(next.mode, Mode::fault);
        }
        if (state.mode == Mode::fault && next.mode != Mode::fault) {
          ASSERT_EQ(next.mode, Mode::idle);
          ASSERT_EQ(next.faults, 0);
        }
        if (next.mode == Mode::boot) {
          ASSERT_EQ(state.mode, Mode::boot);
        }
        if (decision.calibration_ends) {
          ASSERT_EQ(state.mode, Mode::calibrate);
        }
        const SupervisorState key = reduced(next);
        if (seen.insert(key).second) open.push_back(key);
      }
    }
  }
  for (const bool mode : mode_seen) EXPECT_TRUE(mode);
  RecordProperty("states", static_cast<int>(seen.size()));
  RecordProperty("edges", static_cast<int>(edges));
  EXPECT_GT(seen.size(), 100u);  // the walk has not stopped at the door
}

}  // namespace
}  // namespace palpate::firmware
