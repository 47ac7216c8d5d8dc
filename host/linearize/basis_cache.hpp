// Bases in a folder, shared by all runs and processes of a user.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "host/linearize/basis_file.hpp"
#include "host/linearize/basis_key.hpp"
#include "host/linearize/stored_basis.hpp"

namespace palpate::host {

struct BasisCacheConfig {
  std::filesystem::path folder;
  std::uint64_t most_bytes = 1ULL << 30U;  // of all bases in the folder
};

// Files KEY.basis (basis_file.hpp). Nothing here throws for what is wrong with folder or files: a cache that
// cannot be used is none. One object per thread; several processes may use a folder.
class BasisCache {
 public:
  explicit BasisCache(BasisCacheConfig config) : config_(std::move(config)) {}

  // The basis of this key, with as many degrees of freedom and at most so many modes. A file that is not
  // exactly that is not used; `refusal` then says which and why. Without a file, nothing.
  std::optional<StoredBasis> load(const BasisKey& key, Eigen::Index dofs, Eigen::Index most_modes,
                                  std::string& refusal);

  // Keeps it, then removes the files that have been unused for longest until all are within the bound; one
  // that is larger than the bound is not kept. Empty: done. Otherwise what went wrong.
  std::string save(const BasisKey& key, const StoredBasis& basis);

 private:
  [[nodiscard]] std::filesystem::path file(const BasisKey& key) const {
    return config_.folder / (key.hex() + ".basis");
  }
  void trim() const;

  BasisCacheConfig config_;
};

}  // namespace palpate::host
