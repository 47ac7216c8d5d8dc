#include "shared/wire/model_basis.hpp"

#include <bit>
#include <cstring>

#include "shared/wire/crc.hpp"

namespace palpate::wire {
namespace {

static_assert(std::endian::native == std::endian::little, "a basis is used where it lies");

constexpr float kLargestTipRadius_m = 0.05f;
constexpr float kSoftestCoupling_N_m = 10.0f, kStiffestCoupling_N_m = 1e6f;
constexpr float kLargestCouplingDamping_N_s_m = 1e3f;

// False for NaN.
bool is_within(float value, float low, float high) {
  return value >= low && value <= high;
}

// What the tip brings to the contact. Beyond the bounds that a scene has (docs/scenes.md) it is a fault of
// its sender.
bool is_valid(const ContactLaw<float>& law) {
  const bool kinematic = law.coupling.stiffness_N_m == 0.0f;
  return is_within(law.tip_radius_m, 0.0f, kLargestTipRadius_m) &&
         (kinematic || is_within(law.coupling.stiffness_N_m, kSoftestCoupling_N_m, kStiffestCoupling_N_m)) &&
         is_within(law.coupling.damping_N_s_m, 0.0f, kLargestCouplingDamping_N_s_m);
}

template <class T>
const T* at(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return reinterpret_cast<const T*>(bytes.data() + offset);
}

}  // namespace

Status open_basis(std::span<const std::uint8_t> bytes, std::uint64_t schema_hash, LocalModelView& view,
                  ContactLaw<float>& law) {
  BasisHeader header;
  if (bytes.size() < sizeof header) return Status::model_inconsistent;
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.schema_hash != schema_hash) return Status::schema_mismatch;
  const std::size_t modes = header.modes, nodes = header.nodes;
  if (modes > kMaxModes || nodes > kMaxSurfaceNodes || header.triangles > kMaxTriangles ||
      header.frictions > kMaxFrictions || header.springs > kMaxSprings ||
      header.spring_kinds > kMaxSpringKinds || 3 * nodes * modes > kMaxBasis)
    return Status::model_too_large;
  const BasisLayout layout =
      basis_layout(modes, nodes, header.triangles, header.frictions, header.springs, header.spring_kinds);
  if (header.bytes != bytes.size() || layout.bytes != bytes.size() ||
      header.surface > static_cast<std::uint8_t>(SurfaceKind::flat) ||
      header.target_below_half_16ths > kMaxTargetBelowHalf_16ths)
    return Status::model_inconsistent;
  law = {header.tip_radius_m, {header.coupling_stiffness_N_m, header.coupling_damping_N_s_m}};
  if (!is_valid(law)) return Status::model_inconsistent;
  view = {.modes = modes,
          .nodes = nodes,
          .surface_nodes = header.surface_nodes,
          .triangles = header.triangles,
          .surface = static_cast<SurfaceKind>(header.surface),
          .target_below_half_16ths = header.target_below_half_16ths,
          .origin_m = {header.origin_m[0], header.origin_m[1], header.origin_m[2]},
          .position_m = at<float>(bytes, layout.place_m),
          .corner = at<std::uint8_t>(bytes, layout.corner),
          .triangle_id = at<std::uint16_t>(bytes, layout.triangle_id),
          .frictions = header.frictions,
          .static_friction = at<float>(bytes, layout.static_friction),
          .kinetic_friction = at<float>(bytes, layout.kinetic_friction),
          .triangle_friction = at<std::uint8_t>(bytes, layout.triangle_friction),
          .coefficient = at<float>(bytes, layout.coefficient),
          .load = nullptr,
          .basis_scale = at<float>(bytes, layout.basis_scale),
          .basis = at<std::int16_t>(bytes, layout.basis),
          .springs = header.springs,
          .rest_m = at<float>(bytes, layout.place_m),
          .spring_end = at<std::uint8_t>(bytes, layout.spring_end),
          .spring_kind = at<std::uint8_t>(bytes, layout.spring_kind),
          .spring_kinds = header.spring_kinds,
          .spring_stiffness_N_m = at<float>(bytes, layout.spring_stiffness_N_m),
          .spring_damping_N_s_m = at<float>(bytes, layout.spring_damping_N_s_m),
          .spring_length_m = at<float>(bytes, layout.spring_length_m)};
  return Status::ok;
}

std::uint32_t basis_id(std::span<const std::uint8_t> bytes) {
  return basis_id_of(crc32c_update(kCrc32cInitial, bytes));
}

std::uint32_t basis_id_of(std::uint32_t crc_state) {
  const std::uint32_t crc = crc32c_value(crc_state);
  return crc != 0 ? crc : 1;
}

}  // namespace palpate::wire
