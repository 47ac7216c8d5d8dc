// A tip's path from any payload is finite; any path is within its bound or is refused.
#include <cmath>
#include <vector>

#include "host/fuzz/input.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/tip_trace.hpp"

using namespace palpate;
using fuzz::require;

namespace {

void read(std::span<const std::uint8_t> payload) {
  palpate_TipTrace_1_0 message;
  if (wire::deserialize(payload, message) != Status::ok || wire::check_tips(message) != Status::ok) return;
  for (std::size_t i = 0; i <= message.offsets.count; ++i) {
    const Vec3d tip_m = wire::read_tip(message, i);
    require(std::isfinite(tip_m.x) && std::isfinite(tip_m.y) && std::isfinite(tip_m.z), "a tip is finite");
  }
}

void write(fuzz::Input& input) {
  std::vector<Vec3f> path;
  while (path.empty() || (!input.empty() && path.size() < wire::kMaxTraceTicks)) {
    const auto x_m = input.take<float>(), y_m = input.take<float>(), z_m = input.take<float>();
    path.push_back({x_m, y_m, z_m});
  }
  palpate_TipTrace_1_0 message{};
  if (wire::write_tips(path, message) != Status::ok) return;
  require(wire::check_tips(message) == Status::ok, "what was written can be read");
  require(message.offsets.count + 1 == path.size(), "every tick is there");
  const double step_m = std::ldexp(1.0, message.step_exponent);
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vec3d tip_m = wire::read_tip(message, i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double error_m = std::fabs(tip_m[axis] - static_cast<double>(path[i][axis]));
      require(error_m < wire::kTipError_steps * step_m, "a coordinate is within its bound");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  if (input.take<std::uint8_t>() % 2 == 0)
    read(input.bytes(size));
  else
    write(input);
  return 0;
}
