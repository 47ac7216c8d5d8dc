// A local model from any bytes of a basis and of a state: nothing is read beyond them, and what passes
// palpate::check() has finite numbers and indices within its counts.
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "host/fuzz/input.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/model_basis.hpp"
#include "shared/wire/model_state.hpp"

using namespace palpate;
using fuzz::require;

namespace {

void require_finite(const float* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) require(std::isfinite(values[i]), "a checked model is finite");
}

void require_sound(const LocalModelView& view, const ModalState& state) {
  for (std::size_t i = 0; i < 3 * view.triangles; ++i)
    require(view.corner[i] < view.surface_nodes, "corners are nodes of the surface");
  for (std::size_t i = 0; i < view.triangles; ++i)
    require(view.triangle_friction[i] < view.frictions, "a triangle's friction is one that there is");
  for (std::size_t i = 0; i < view.springs; ++i)
    require(view.spring_kind[i] < view.spring_kinds && view.spring_end[2 * i] < view.nodes &&
                view.spring_end[2 * i + 1] < view.nodes,
            "a spring is of a kind and between nodes");
  require_finite(view.position_m, 3 * view.nodes);
  require_finite(view.coefficient, kCoefficientsPerMode * view.modes);
  require_finite(view.load, view.modes);
  require_finite(view.basis_scale, view.modes);
  require_finite(state.q.data(), view.modes);
  require_finite(state.p.data(), view.modes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto good = input.take<std::uint8_t>();
  const std::span<const std::uint8_t> payload = input.bytes(input.take<std::uint16_t>() % 2048);
  const std::span<const std::uint8_t> rest = input.bytes(size);
  // As long as it is, and aligned as the board's.
  std::vector<std::uint8_t> basis(rest.begin(), rest.end());
  wire::BasisHeader header;
  if ((good & 1U) != 0 && basis.size() >= sizeof header) {
    std::memcpy(&header, basis.data(), sizeof header);
    header.schema_hash = wire::kSchemaHash;
    if ((good & 2U) != 0) {
      const std::size_t bytes =
          wire::basis_layout(header.modes % (kMaxModes + 1), header.nodes % (kMaxSurfaceNodes + 1),
                             header.triangles, header.frictions, header.springs, header.spring_kinds)
              .bytes;
      header.modes = static_cast<std::uint16_t>(header.modes % (kMaxModes + 1));
      header.nodes = static_cast<std::uint8_t>(header.nodes % (kMaxSurfaceNodes + 1));
      basis.resize(bytes);
      header.bytes = static_cast<std::uint32_t>(bytes);
    }
    std::memcpy(basis.data(), &header, sizeof header);
  }
  LocalModelView view;
  ContactLaw<float> law;
  if (wire::open_basis(basis, wire::kSchemaHash, view, law) != Status::ok) return 0;
  require(view.modes <= kMaxModes && view.nodes <= kMaxSurfaceNodes && view.triangles <= kMaxTriangles &&
              3 * view.nodes * view.modes <= kMaxBasis,
          "an open basis is within the capacities");
  const auto message = std::make_unique<palpate_ModelState_1_0>();
  if (wire::deserialize(payload, *message) != Status::ok || !wire::counts_agree(*message, view)) return 0;
  std::vector<float> position_m(3 * view.nodes), load(view.modes);
  ModalState state;
  wire::read_state(*message, view, position_m.data(), load.data(), state);
  view.position_m = position_m.data();
  view.load = load.data();
  if (check(view, state) == Status::ok) require_sound(view, state);
  return 0;
}
