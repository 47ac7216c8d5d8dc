#include "host/linearize/basis_key.hpp"

#include <Eigen/Core>
#include <cstdio>

#include "host/linearize/whole_body_basis.hpp"
#include "host/msd/lattice.hpp"

namespace palpate::host {
namespace {

// Raised when bases mean something else than before.
constexpr std::uint32_t kReductionVersion = 2;

void add(Hash128& hash, const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  for (Eigen::Index c = 0; c < matrix.cols(); ++c)
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) hash.add(matrix(r, c));
}

// The reduction of a body of 6 x 6 x 6 nodes on 16 ports.
BasisKey arithmetic() {
  LatticeSpec spec;
  spec.nodes = {6, 6, 6};
  spec.damping_N_s_m = damping_from_ratio(1.0, spec.mass_kg, spec.stiffness_N_m);
  spec.fixed_faces = {Face::z_minus};
  const Body body = make_lattice(spec);
  std::vector<int> ports;
  for (int j = 1; j < 5; ++j)
    for (int i = 1; i < 5; ++i) ports.push_back(body.lattice()->node(i, j, 5));
  const WholeBodyBasis basis = WholeBodyReduction(body, {0.0, 100.0}).reduce(ports);
  Hash128 hash;
  add(hash, basis.lambda_rad2_s2);
  add(hash, basis.damping_1_s);
  add(hash, basis.basis_1_sqrt_kg);
  return hash.value();
}

void add(Hash128& hash, const BasisKey& key) {
  hash.add(key.high);
  hash.add(key.low);
}

}  // namespace

std::string BasisKey::hex() const {
  std::array<char, 33> text{};
  std::snprintf(text.data(), text.size(), "%016llx%016llx", static_cast<unsigned long long>(high),
                static_cast<unsigned long long>(low));
  return text.data();
}

void Hash128::add(std::span<const std::byte> bytes) {
  // Times 2^88 + 0x13b, modulo 2^128.
  __extension__ using Wide = unsigned __int128;
  constexpr std::uint64_t kPrimeLow = 0x13b;
  for (const std::byte byte : bytes) {
    low_ ^= static_cast<std::uint64_t>(byte);
    const Wide product = static_cast<Wide>(low_) * kPrimeLow;
    high_ = high_ * kPrimeLow + (low_ << 24U) + static_cast<std::uint64_t>(product >> 64U);
    low_ = static_cast<std::uint64_t>(product);
  }
}

BasisKeys::BasisKeys(const Body& body, const Shifts& shifts) {
  static const BasisKey here = arithmetic();
  Hash128 hash;
  hash.add(kReductionVersion);
  add(hash, here);
  for (const std::vector<double>& list : {shifts.all_rad_s, shifts.middle_rad_s}) {
    hash.add(list.size());
    for (const double shift : list) hash.add(shift);
  }
  hash.add(body.planar());
  hash.add(body.node_count());
  for (int node = 0; node < body.node_count(); ++node) {
    hash.add(body.mass_kg(node));
    hash.add(body.fixed(node));
  }
  add(hash, body.rest_position_m());
  hash.add(body.springs().size());
  for (const Spring& spring : body.springs()) {
    hash.add(spring.i);
    hash.add(spring.j);
    hash.add(spring.stiffness_N_m);
    hash.add(spring.damping_N_s_m);
    hash.add(spring.rest_length_m);
  }
  body_ = hash.value();
}

BasisKey BasisKeys::of(const std::vector<int>& ports) const {
  Hash128 hash;
  add(hash, body_);
  hash.add(ports.size());
  for (const int port : ports) hash.add(port);
  return hash.value();
}

}  // namespace palpate::host
