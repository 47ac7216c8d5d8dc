// A session that hears a scripted tip's trace: for tests without a board.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "host/session/session.hpp"
#include "host/session/test_contact.hpp"

namespace palpate::host::test {

inline constexpr std::uint32_t kSamplesPerTrace = 4;

// As the board sends them: in single precision.
inline palpate_ServoTrace_1_0 trace(const Path& path, std::uint32_t first_tick) {
  palpate_ServoTrace_1_0 message{};
  message.first_tick = first_tick;
  for (std::uint32_t tick = first_tick; tick <= path.ticks() && tick < first_tick + kSamplesPerTrace;
       ++tick) {
    auto& sample = message.samples.elements[message.samples.count++];
    for (std::size_t axis = 0; axis < 3; ++axis)
      sample.tip_m[axis] = static_cast<float>(path.tip_m[tick][axis]);
  }
  return message;
}

class SessionTestBed : public ::testing::Test {
 protected:
  SessionTestBed() {
    config_.friction.elsewhere = {0.5, 0.5};
    path_.to({0.0145, 0.0165, -2e-3}, 60).to({0.0245, 0.0175, -2e-3}, 139);
  }
  // Sends the path but for `lost_traces`, by their first ticks, with an update every 33 ticks; returns the
  // models.
  std::vector<ModelUpdate> run(Session& session, const std::vector<std::uint32_t>& lost_traces = {}) {
    std::vector<ModelUpdate> updates;
    for (std::uint32_t tick = 0; tick <= path_.ticks(); ++tick) {
      if (tick % kSamplesPerTrace == kSamplesPerTrace - 1) {
        const std::uint32_t first = tick + 1 - kSamplesPerTrace;
        if (std::count(lost_traces.begin(), lost_traces.end(), first) == 0) session.take(trace(path_, first));
      }
      if (!session.due(tick)) continue;
      if (auto update = session.update()) updates.push_back(std::move(*update));
    }
    return updates;
  }

  Body body_ = block(5);
  SessionConfig config_{};
  Path path_{{0.0145, 0.0165, 5e-4}};
};

}  // namespace palpate::host::test
