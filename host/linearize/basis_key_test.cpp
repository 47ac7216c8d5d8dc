#include "host/linearize/basis_key.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <span>
#include <string_view>

#include "host/msd/lattice.hpp"
#include "host/msd/test_bodies.hpp"

namespace palpate::host {
namespace {

BasisKey hash_of(std::string_view text) {
  Hash128 hash;
  hash.add(std::as_bytes(std::span(text.data(), text.size())));
  return hash.value();
}

TEST(Hash128, IsFnv1a) {
  // Test vectors of its authors.
  EXPECT_EQ(hash_of("").hex(), "6c62272e07bb014262b821756295c58d");
  EXPECT_EQ(hash_of("a").hex(), "d228cb696f1a8caf78912b704e4a8964");
  EXPECT_EQ(hash_of("foobar").hex(), "343e1662793c64bf6f0d3597ba446f18");
}

TEST(BasisKeys, DifferInWhatABasisDependsOn) {
  const LatticeSpec spec = test::reference_spec(4);
  const BasisKey key = BasisKeys(make_lattice(spec), {0.0}).of({20, 21});
  EXPECT_EQ(BasisKeys(make_lattice(spec), {0.0}).of({20, 21}), key);
  EXPECT_NE(BasisKeys(make_lattice(spec), {0.0}).of({21, 20}), key);
  EXPECT_NE(BasisKeys(make_lattice(spec), {0.0, 1.0}).of({20, 21}), key);
  const auto changed = [&](const std::function<void(LatticeSpec&)>& change) {
    LatticeSpec other = spec;
    change(other);
    return BasisKeys(make_lattice(other), {0.0}).of({20, 21});
  };
  EXPECT_NE(changed([](LatticeSpec& s) { s.mass_kg *= 1.001; }), key);
  EXPECT_NE(changed([](LatticeSpec& s) { s.stiffness_N_m *= 1.001; }), key);
  EXPECT_NE(changed([](LatticeSpec& s) { s.damping_N_s_m *= 1.001; }), key);
  EXPECT_NE(changed([](LatticeSpec& s) { s.spacing_m *= 1.001; }), key);
  EXPECT_NE(changed([](LatticeSpec& s) { s.fixed_faces = {Face::z_minus, Face::y_minus}; }), key);
  // Not on weight.
  EXPECT_EQ(changed([](LatticeSpec& s) { s.gravity_m_s2 = {0, 0, -9.81}; }), key);
}

}  // namespace
}  // namespace palpate::host
