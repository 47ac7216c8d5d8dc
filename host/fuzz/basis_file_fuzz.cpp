// Any file is a basis of the size that was asked for, or is refused with a reason.
#include <sys/mman.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "host/fuzz/input.hpp"
#include "host/linearize/basis_file.hpp"
#include "shared/wire/crc.hpp"

using namespace palpate;
using fuzz::require;

namespace {

constexpr host::BasisKey kKey{1, 2};
constexpr Eigen::Index kDofs = 11, kMostModes = 3;
constexpr std::size_t kHeaderBytes = 40, kVersionAt = 8, kModesAt = 12, kDofsAt = 16;

// A file in memory; the path of it is good while it lives.
class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : descriptor_(::memfd_create("basis", 0)) {
    require(descriptor_ >= 0 && ::write(descriptor_, bytes.data(), bytes.size()) == std::ssize(bytes),
            "a file in memory can be written");
  }
  ~MemoryFile() { ::close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

template <class T>
void put(std::vector<std::uint8_t>& bytes, std::size_t at, const T& value) {
  std::memcpy(&bytes[at], &value, sizeof value);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto good = input.take<std::uint8_t>();
  const std::span<const std::uint8_t> rest = input.bytes(size);
  std::vector<std::uint8_t> bytes(rest.begin(), rest.end());
  if ((good & 1U) != 0 && bytes.size() >= kHeaderBytes) {
    std::memcpy(bytes.data(), "palpbase", 8);
    put(bytes, kVersionAt, std::uint32_t{1});
    put(bytes, kDofsAt, std::uint64_t{kDofs});
    put(bytes, kDofsAt + 8, kKey);
    if ((good & 2U) != 0) {  // a length that fits the header
      const std::uint32_t modes = bytes[kModesAt] % (kMostModes + 1);
      put(bytes, kModesAt, modes);
      bytes.resize(kHeaderBytes + 8 * modes * (modes + 1) + 4 * kDofs * modes + 4);
    }
  }
  if ((good & 4U) != 0 && bytes.size() >= 4) {
    const auto guarded = std::span(bytes).first(bytes.size() - 4);
    put(bytes, guarded.size(), wire::crc32c_value(wire::crc32c_update(wire::kCrc32cInitial, guarded)));
  }
  const MemoryFile file(bytes);
  const auto read = host::read_basis_file(file.path(), kKey, kDofs, kMostModes);
  if (const auto* refused = std::get_if<host::Refusal>(&read)) {
    require(!refused->reason.empty(), "a refusal has a reason");
    return 0;
  }
  const auto& basis = std::get<host::StoredBasis>(read);
  const Eigen::Index modes = basis.lambda_rad2_s2.size();
  require(modes <= kMostModes && basis.damping_1_s.rows() == modes && basis.damping_1_s.cols() == modes &&
              basis.basis_1_sqrt_kg.rows() == kDofs && basis.basis_1_sqrt_kg.cols() == modes,
          "a basis has the size that was asked for");
  return 0;
}
