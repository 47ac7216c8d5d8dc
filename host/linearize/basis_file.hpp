// A basis in a file.
//
// Version 1; all numbers little-endian, without gaps:
//   offset  type       content
//   0       8 bytes    "palpbase"
//   8       uint32     version of this format: 1
//   12      uint32     m, modes
//   16      uint64     n, degrees of freedom
//   24      2 uint64   key, high and low half (basis_key.hpp)
//   40      float64    lambda_rad2_s2, m
//           float64    damping_1_s, m x m, column by column
//           float32    basis_1_sqrt_kg, n x m, column by column
//   end     uint32     CRC-32C of all before
#pragma once

#include <filesystem>
#include <string>
#include <variant>

#include "host/linearize/basis_key.hpp"
#include "host/linearize/stored_basis.hpp"

namespace palpate::host {

// Why a file is not used, for people: "is damaged: its CRC does not match".
struct Refusal {
  std::string reason;
};

// Writes a file of another name beside it, then renames it: readers see a whole file or none. Empty: done.
// Otherwise what went wrong, and no file is left.
std::string write_basis_file(const std::filesystem::path& file, const BasisKey& key,
                             const StoredBasis& basis);

// The basis in a file, if it is whole and has this key, as many degrees of freedom and at most `most_modes`.
std::variant<StoredBasis, Refusal> read_basis_file(const std::filesystem::path& file, const BasisKey& key,
                                                   Eigen::Index dofs, Eigen::Index most_modes);

}  // namespace palpate::host
