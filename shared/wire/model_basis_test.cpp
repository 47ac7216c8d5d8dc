#include "shared/wire/model_basis.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "shared/wire/crc.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::wire {
namespace {

constexpr std::uint64_t kHash = 0x0123456789abcdefu;

template <class T, std::size_t Capacity>
void fill(BoundedArray<T, Capacity>& array, std::size_t count, std::mt19937& random) {
  array.count = count;
  for (std::size_t i = 0; i < count; ++i) array.elements[i] = static_cast<T>(random() % 100);
}

ModelContents model(std::size_t modes, std::size_t nodes, std::size_t triangles, std::size_t springs) {
  std::mt19937 random(static_cast<unsigned>(modes + nodes));
  ModelContents m;
  m.schema_hash = kHash;
  m.modes = static_cast<std::uint16_t>(modes);
  m.nodes = static_cast<std::uint8_t>(nodes);
  m.surface_nodes = static_cast<std::uint8_t>(nodes / 2);
  m.triangles = static_cast<std::uint8_t>(triangles);
  m.surface = static_cast<std::uint8_t>(SurfaceKind::flat);
  for (float& value : m.origin_m) value = static_cast<float>(random() % 100);
  m.target_below_half_16ths = 3;
  m.tip_radius_m = 0.003f;
  m.coupling_stiffness_N_m = 500.0f;
  m.coupling_damping_N_s_m = 2.0f;
  fill(m.rest_m, 3 * nodes, random);
  fill(m.position_m, 3 * nodes, random);
  fill(m.triangle_id, triangles, random);
  fill(m.corner, 3 * triangles, random);
  fill(m.triangle_friction, triangles, random);
  fill(m.static_friction, 3, random);
  fill(m.kinetic_friction, 3, random);
  fill(m.coefficient, 6 * modes, random);
  fill(m.basis_scale, modes, random);
  fill(m.basis, 3 * nodes * modes, random);
  fill(m.spring_end, 2 * springs, random);
  fill(m.spring_kind, springs, random);
  fill(m.spring_stiffness_N_m, 5, random);
  fill(m.spring_damping_N_s_m, 5, random);
  fill(m.spring_length_m, 5, random);
  return m;
}

template <class T, std::size_t Capacity>
void expect_same(const T* got, const BoundedArray<T, Capacity>& sent) {
  for (std::size_t i = 0; i < sent.count; ++i) EXPECT_EQ(got[i], sent.elements[i]);
}

TEST(ModelBasis, IsReadWhereItLies) {
  for (const auto& sent : {model(48, 32, 18, 45), model(192, 16, 96, 192), model(1, 3, 1, 0)}) {
    const PackedModel packed = pack(sent);
    const std::vector<std::uint8_t>& bytes = *packed.basis;
    EXPECT_LE(bytes.size(), kMaxBasisBytes);
    EXPECT_EQ(packed.state.basis_id, crc32c_value(crc32c_update(kCrc32cInitial, bytes)));
    LocalModelView view;
    ContactLaw<float> law;
    ASSERT_EQ(open_basis(bytes, kHash, view, law), Status::ok);
    EXPECT_EQ(view.modes, sent.modes);
    EXPECT_EQ(view.nodes, sent.nodes);
    EXPECT_EQ(view.surface_nodes, sent.surface_nodes);
    EXPECT_EQ(view.triangles, sent.triangles);
    EXPECT_EQ(view.surface, SurfaceKind::flat);
    EXPECT_EQ(view.target_extrapolation(), 0.5f - 3.0f / 16.0f);
    EXPECT_EQ(view.origin_m, (Vec3f{sent.origin_m[0], sent.origin_m[1], sent.origin_m[2]}));
    EXPECT_EQ(law.tip_radius_m, 0.003f);
    EXPECT_EQ(law.coupling.stiffness_N_m, 500.0f);
    EXPECT_EQ(law.coupling.damping_N_s_m, 2.0f);
    expect_same(view.position_m, sent.rest_m);
    expect_same(view.rest_m, sent.rest_m);
    expect_same(view.triangle_id, sent.triangle_id);
    expect_same(view.corner, sent.corner);
    expect_same(view.triangle_friction, sent.triangle_friction);
    EXPECT_EQ(view.frictions, 3u);
    expect_same(view.static_friction, sent.static_friction);
    expect_same(view.kinetic_friction, sent.kinetic_friction);
    expect_same(view.coefficient, sent.coefficient);
    expect_same(view.basis_scale, sent.basis_scale);
    expect_same(view.basis, sent.basis);
    EXPECT_EQ(view.springs, sent.spring_kind.count);
    expect_same(view.spring_end, sent.spring_end);
    expect_same(view.spring_kind, sent.spring_kind);
    EXPECT_EQ(view.spring_kinds, 5u);
    expect_same(view.spring_stiffness_N_m, sent.spring_stiffness_N_m);
    expect_same(view.spring_damping_N_s_m, sent.spring_damping_N_s_m);
    expect_same(view.spring_length_m, sent.spring_length_m);
  }
}

TEST(ModelBasis, TheLargestFillsTheCapacity) {
  ModelContents m = model(192, 16, 96, 192);
  std::mt19937 random(1);
  fill(m.static_friction, kMaxFrictions, random);
  fill(m.kinetic_friction, kMaxFrictions, random);
  fill(m.spring_stiffness_N_m, kMaxSpringKinds, random);
  fill(m.spring_damping_N_s_m, kMaxSpringKinds, random);
  fill(m.spring_length_m, kMaxSpringKinds, random);
  EXPECT_EQ(pack(m).basis->size(), kMaxBasisBytes);
}

TEST(ModelBasis, ABasisDoesNotDependOnTheState) {
  ModelContents m = model(48, 16, 18, 0);
  const std::uint32_t id = pack(m).state.basis_id;
  ++m.sequence;
  ++m.tick;
  m.position_m.elements[3] += 1.0f;
  EXPECT_EQ(pack(m).state.basis_id, id);
  m.basis.elements[7] = static_cast<std::int16_t>(m.basis.elements[7] + 1);
  EXPECT_NE(pack(m).state.basis_id, id);
}

TEST(ModelBasis, RefusesWhatDoesNotFit) {
  const std::vector<std::uint8_t> good = *pack(model(48, 16, 18, 45)).basis;
  LocalModelView view;
  ContactLaw<float> law;
  const auto opened = [&](const std::vector<std::uint8_t>& bytes) {
    return open_basis(bytes, kHash, view, law);
  };
  const auto with = [&good](std::size_t offset, auto value) {
    std::vector<std::uint8_t> bytes = good;
    std::memcpy(bytes.data() + offset, &value, sizeof value);
    return bytes;
  };
  EXPECT_EQ(open_basis(good, kHash + 1, view, law), Status::schema_mismatch);
  std::vector<std::uint8_t> cut = good;
  cut.resize(cut.size() - 4);
  EXPECT_EQ(opened(cut), Status::model_inconsistent);
  cut.resize(20);
  EXPECT_EQ(opened(cut), Status::model_inconsistent);
  EXPECT_EQ(opened({}), Status::model_inconsistent);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, bytes), std::uint32_t{100})), Status::model_inconsistent);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, modes), std::uint16_t{193})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, modes), std::uint16_t{47})), Status::model_inconsistent);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, nodes), std::uint8_t{33})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, triangles), std::uint8_t{97})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, frictions), std::uint8_t{5})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, springs), std::uint8_t{193})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, spring_kinds), std::uint8_t{17})), Status::model_too_large);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, surface), std::uint8_t{2})), Status::model_inconsistent);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, target_below_half_16ths), std::uint8_t{9})),
            Status::model_inconsistent);
  EXPECT_EQ(opened(with(offsetof(BasisHeader, tip_radius_m), 0.06f)), Status::model_inconsistent);
}

// Any bytes are refused or make a view within them; under AddressSanitizer nothing else is touched.
TEST(ModelBasis, RandomHeadersStayWithinBounds) {
  std::mt19937 random(2);
  const std::vector<std::uint8_t> good = *pack(model(12, 4, 2, 3)).basis;
  std::size_t opened = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    std::vector<std::uint8_t> bytes = good;
    for (std::uint32_t i = random() % 4; i > 0; --i)
      bytes[8 + random() % (sizeof(BasisHeader) - 8)] = static_cast<std::uint8_t>(random());
    LocalModelView view;
    ContactLaw<float> law;
    if (open_basis(bytes, kHash, view, law) != Status::ok) continue;
    ++opened;
    const auto* const end = reinterpret_cast<const std::uint8_t*>(bytes.data() + bytes.size());
    ASSERT_LE(view.spring_kind + view.springs, end);
    ASSERT_LE(view.triangle_friction + view.triangles, end);
    ASSERT_LE(reinterpret_cast<const std::uint8_t*>(view.basis + 3 * view.nodes * view.modes), end);
  }
  EXPECT_GT(opened, 0u);
}

}  // namespace
}  // namespace palpate::wire
