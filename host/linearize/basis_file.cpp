#include "host/linearize/basis_file.hpp"

#include <unistd.h>

#include <array>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <span>
#include <system_error>
#include <vector>

#include "shared/wire/crc.hpp"

namespace palpate::host {
namespace {

static_assert(std::endian::native == std::endian::little, "basis files are little-endian");

constexpr std::array<char, 8> kMagic{'p', 'a', 'l', 'p', 'b', 'a', 's', 'e'};
constexpr std::uint32_t kVersion = 1;

struct Header {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t modes = 0;
  std::uint64_t dofs = 0;
  std::uint64_t key_high = 0, key_low = 0;
};
static_assert(sizeof(Header) == 40, "without gaps");

template <class T>
std::span<std::uint8_t> bytes_of(T* data, Eigen::Index count) {
  return {reinterpret_cast<std::uint8_t*>(data), sizeof(T) * static_cast<std::size_t>(count)};
}
template <class T>
std::span<const std::uint8_t> bytes_of(const T* data, Eigen::Index count) {
  return {reinterpret_cast<const std::uint8_t*>(data), sizeof(T) * static_cast<std::size_t>(count)};
}

std::uint64_t file_bytes(std::uint64_t dofs, std::uint64_t modes) {
  return sizeof(Header) + sizeof(double) * modes * (modes + 1) + sizeof(float) * dofs * modes +
         sizeof(std::uint32_t);
}

std::string system_message() {
  return std::generic_category().message(errno);
}

}  // namespace

std::string write_basis_file(const std::filesystem::path& file, const BasisKey& key,
                             const StoredBasis& basis) {
  // Unique between threads and processes.
  static std::atomic<unsigned> count{0};
  std::filesystem::path unfinished = file;
  for (const std::string& part : {std::to_string(::getpid()), std::to_string(count++), std::string("tmp")})
    unfinished.concat(".").concat(part);

  Header header;
  header.modes = static_cast<std::uint32_t>(basis.lambda_rad2_s2.size());
  header.dofs = static_cast<std::uint64_t>(basis.basis_1_sqrt_kg.rows());
  header.key_high = key.high;
  header.key_low = key.low;
  std::string problem;
  {
    std::ofstream out(unfinished, std::ios::binary | std::ios::trunc);
    std::uint32_t crc = wire::kCrc32cInitial;
    const auto put = [&](std::span<const std::uint8_t> bytes) {
      crc = wire::crc32c_update(crc, bytes);
      out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    };
    put(bytes_of(&header, 1));
    put(bytes_of(basis.lambda_rad2_s2.data(), basis.lambda_rad2_s2.size()));
    put(bytes_of(basis.damping_1_s.data(), basis.damping_1_s.size()));
    put(bytes_of(basis.basis_1_sqrt_kg.data(), basis.basis_1_sqrt_kg.size()));
    const std::uint32_t value = wire::crc32c_value(crc);
    put(bytes_of(&value, 1));
    out.close();
    if (!out) problem = "cannot be written: " + system_message();
  }
  std::error_code error;
  if (problem.empty()) {
    std::filesystem::rename(unfinished, file, error);
    if (error) problem = "cannot be written: " + error.message();
  }
  if (!problem.empty()) std::filesystem::remove(unfinished, error);
  return problem;
}

std::variant<StoredBasis, Refusal> read_basis_file(const std::filesystem::path& file, const BasisKey& key,
                                                   Eigen::Index dofs, Eigen::Index most_modes) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) return Refusal{"cannot be read: " + error.message()};
  std::ifstream in(file, std::ios::binary);
  if (!in) return Refusal{"cannot be read: " + system_message()};
  std::uint32_t crc = wire::kCrc32cInitial;
  const auto get = [&](std::span<std::uint8_t> bytes) {
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    crc = wire::crc32c_update(crc, bytes);
    return static_cast<bool>(in);
  };

  // Sizes are taken from the header only once they are known to be those that belong here.
  Header header;
  if (size < sizeof(Header) || !get(bytes_of(&header, 1)))
    return Refusal{std::string("is cut off: ") + std::to_string(size) + " bytes"};
  if (header.magic != kMagic) return Refusal{"is no basis"};
  if (header.version != kVersion)
    return Refusal{"has version " + std::to_string(header.version) + " of the format, known is " +
                   std::to_string(kVersion)};
  if (BasisKey{header.key_high, header.key_low} != key)
    return Refusal{"is the basis of something else: its key is not its name's"};
  if (header.dofs != static_cast<std::uint64_t>(dofs) ||
      header.modes > static_cast<std::uint64_t>(most_modes))
    return Refusal{"has " + std::to_string(header.dofs) + " degrees of freedom and " +
                   std::to_string(header.modes) + " modes, expected " + std::to_string(dofs) +
                   " and at most " + std::to_string(most_modes)};
  if (size != file_bytes(header.dofs, header.modes))
    return Refusal{"is cut off or too long: " + std::to_string(size) + " bytes instead of " +
                   std::to_string(file_bytes(header.dofs, header.modes))};

  const auto modes = static_cast<Eigen::Index>(header.modes);
  StoredBasis basis{Eigen::VectorXd(modes), Eigen::MatrixXd(modes, modes), Eigen::MatrixXf(dofs, modes)};
  std::uint32_t value = 0;
  const bool whole = get(bytes_of(basis.lambda_rad2_s2.data(), modes)) &&
                     get(bytes_of(basis.damping_1_s.data(), modes * modes)) &&
                     get(bytes_of(basis.basis_1_sqrt_kg.data(), dofs * modes)) && get(bytes_of(&value, 1));
  if (!whole) return Refusal{"cannot be read to its end"};
  if (crc != wire::kCrc32cResidue) return Refusal{"is damaged: its CRC does not match"};
  return basis;
}

}  // namespace palpate::host
