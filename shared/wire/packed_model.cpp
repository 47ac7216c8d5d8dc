#include "shared/wire/packed_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>

#include "shared/wire/model_basis.hpp"
#include "shared/wire/model_state.hpp"

namespace palpate::wire {
namespace {

class BasisWriter {
 public:
  explicit BasisWriter(const BasisHeader& header) : header_(header), bytes_(sizeof header) {}
  template <class T, std::size_t Capacity>
  void add(const BoundedArray<T, Capacity>& array) {
    const std::size_t begin = bytes_.size(), length = array.count * sizeof(T);
    bytes_.resize(begin + (length + 3) / 4 * 4);
    std::memcpy(bytes_.data() + begin, array.elements, length);
  }
  std::vector<std::uint8_t> finish() {
    header_.bytes = static_cast<std::uint32_t>(bytes_.size());
    std::memcpy(bytes_.data(), &header_, sizeof header_);
    return std::move(bytes_);
  }

 private:
  BasisHeader header_;
  std::vector<std::uint8_t> bytes_;
};

std::vector<std::uint8_t> write_basis(const ModelContents& m) {
  BasisHeader header{};
  header.schema_hash = m.schema_hash;
  header.modes = m.modes;
  header.nodes = m.nodes;
  header.surface_nodes = m.surface_nodes;
  header.triangles = m.triangles;
  header.frictions = static_cast<std::uint8_t>(m.static_friction.count);
  header.springs = static_cast<std::uint8_t>(m.spring_kind.count);
  header.spring_kinds = static_cast<std::uint8_t>(m.spring_stiffness_N_m.count);
  header.surface = m.surface;
  header.target_below_half_16ths = m.target_below_half_16ths;
  std::copy(m.origin_m, m.origin_m + 3, header.origin_m);
  header.tip_radius_m = m.tip_radius_m;
  header.coupling_stiffness_N_m = m.coupling_stiffness_N_m;
  header.coupling_damping_N_s_m = m.coupling_damping_N_s_m;

  BasisWriter writer(header);
  writer.add(m.rest_m.count != 0 ? m.rest_m : m.position_m);
  writer.add(m.coefficient);
  writer.add(m.basis_scale);
  writer.add(m.static_friction);
  writer.add(m.kinetic_friction);
  writer.add(m.spring_stiffness_N_m);
  writer.add(m.spring_damping_N_s_m);
  writer.add(m.spring_length_m);
  writer.add(m.basis);
  writer.add(m.triangle_id);
  writer.add(m.corner);
  writer.add(m.triangle_friction);
  writer.add(m.spring_end);
  writer.add(m.spring_kind);
  return writer.finish();
}

// Returns the step of which the largest of the values is kLargestStateEntry; 0 where all are zero, NaN where
// one is no number.
template <class Array>
float quantize(const std::vector<float>& values, Array& out) {
  float largest = 0.0f;
  bool finite = true;
  for (const float value : values) {
    finite = finite && std::isfinite(value);
    largest = std::max(largest, std::fabs(value));
  }
  const float step = finite ? largest / kLargestStateEntry : std::numeric_limits<float>::quiet_NaN();
  out.count = 0;
  if (step == 0.0f) return 0.0f;
  out.count = values.size();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float steps = std::round(values[i] / step);
    out.elements[i] =
        std::fabs(steps) <= kLargestStateEntry ? static_cast<std::int16_t>(steps) : std::int16_t{0};
  }
  return step;
}

template <std::size_t Capacity>
std::vector<float> weighted(const BoundedArray<float, Capacity>& values, const std::vector<ModeUnit>& units,
                            bool by_stiffness) {
  std::vector<float> result(values.elements, values.elements + std::min(values.count, Capacity));
  for (std::size_t m = 0; m < std::min(result.size(), units.size()); ++m)
    result[m] *=
        by_stiffness ? units[m].displacement_m / units[m].stiffness_rad2_s2 : units[m].displacement_m;
  return result;
}

}  // namespace

PackedModel pack(const ModelContents& m) {
  PackedModel packed;
  palpate_ModelState_1_0& state = packed.state;
  state.sequence = m.sequence;
  state.schema_hash = m.schema_hash;
  state.tick = m.tick;
  state.valid_ticks = m.valid_ticks;
  state.growth_ticks = m.growth_ticks;
  state.kind = m.kind;
  state.tip_source = m.tip_source;
  state.contact = m.contact;
  if (m.modes == 0 && m.nodes == 0 && m.triangles == 0) return packed;

  packed.basis = std::make_shared<const std::vector<std::uint8_t>>(write_basis(m));
  state.basis_id = basis_id(*packed.basis);
  std::vector<float> displacement_m(m.rest_m.count);
  for (std::size_t i = 0; i < m.rest_m.count; ++i)
    displacement_m[i] = m.position_m.elements[i] - m.rest_m.elements[i];
  std::vector<ModeUnit> units;
  for (std::size_t i = 0; i < std::min(m.basis_scale.count, m.coefficient.count / kCoefficientsPerMode); ++i)
    units.push_back(mode_unit(m.basis_scale.elements[i], m.coefficient.elements + kCoefficientsPerMode * i));
  state.displacement_step_m = quantize(displacement_m, state.displacement);
  state.load_step_m = quantize(weighted(m.load, units, true), state.load);
  state.q_step_m = quantize(weighted(m.state_q, units, false), state.q);
  state.p_step_m_s = quantize(weighted(m.state_p, units, false), state.p);
  return packed;
}

ModelContents unpack(const PackedModel& packed, const ModelContents& contents) {
  ModelContents received = contents;
  LocalModelView view;
  ContactLaw<float> law;
  if (packed.basis == nullptr || open_basis(*packed.basis, contents.schema_hash, view, law) != Status::ok)
    return received;
  if (!counts_agree(packed.state, view)) return received;
  ModalState state;
  read_state(packed.state, view, received.position_m.elements, received.load.elements, state);
  std::copy_n(state.q.begin(), view.modes, received.state_q.elements);
  std::copy_n(state.p.begin(), view.modes, received.state_p.elements);
  return received;
}

palpate_ModelPart_1_0 part_of(const std::vector<std::uint8_t>& basis, std::uint32_t id,
                              std::uint16_t first_block, std::size_t blocks) {
  palpate_ModelPart_1_0 part{};
  part.basis_id = id;
  part.basis_bytes = static_cast<std::uint32_t>(basis.size());
  part.first_block = first_block;
  const std::size_t begin = std::size_t{first_block} * palpate_ModelPart_1_0_BLOCK_BYTES;
  const std::size_t end = std::min(basis.size(), begin + blocks * palpate_ModelPart_1_0_BLOCK_BYTES);
  part.data.count = begin < end ? end - begin : 0;
  std::copy_n(basis.begin() + static_cast<std::ptrdiff_t>(begin), part.data.count, part.data.elements);
  return part;
}

std::vector<palpate_ModelPart_1_0> parts_of(const std::vector<std::uint8_t>& basis, std::uint32_t id) {
  constexpr std::size_t kBlocks =
      palpate_ModelPart_1_0_data_ARRAY_CAPACITY_ / palpate_ModelPart_1_0_BLOCK_BYTES;
  std::vector<palpate_ModelPart_1_0> parts;
  for (std::size_t block = 0; block * palpate_ModelPart_1_0_BLOCK_BYTES < basis.size(); block += kBlocks)
    parts.push_back(part_of(basis, id, static_cast<std::uint16_t>(block), kBlocks));
  return parts;
}

}  // namespace palpate::wire
