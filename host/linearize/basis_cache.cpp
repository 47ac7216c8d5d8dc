#include "host/linearize/basis_cache.hpp"

#include <algorithm>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

namespace palpate::host {

namespace fs = std::filesystem;

std::optional<StoredBasis> BasisCache::load(const BasisKey& key, Eigen::Index dofs, Eigen::Index most_modes,
                                            std::string& refusal) {
  const fs::path kept = file(key);
  std::error_code error;
  if (!fs::exists(kept, error)) return std::nullopt;
  auto read = read_basis_file(kept, key, dofs, most_modes);
  if (const auto* refused = std::get_if<Refusal>(&read)) {
    refusal = kept.string() + " " + refused->reason;
    return std::nullopt;
  }
  fs::last_write_time(kept, fs::file_time_type::clock::now(), error);  // used: not the first to go
  return std::move(std::get<StoredBasis>(read));
}

std::string BasisCache::save(const BasisKey& key, const StoredBasis& basis) {
  if (basis.bytes() > config_.most_bytes) return "";
  std::error_code error;
  fs::create_directories(config_.folder, error);
  if (error) return config_.folder.string() + " cannot be made: " + error.message();
  if (std::string problem = write_basis_file(file(key), key, basis); !problem.empty())
    return file(key).string() + " " + problem;
  trim();
  return "";
}

void BasisCache::trim() const {
  struct Kept {
    fs::file_time_type used;
    fs::path file;
    std::uint64_t bytes;
  };
  std::vector<Kept> all;
  std::uint64_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator entry(config_.folder, error), end; !error && entry != end;
       entry.increment(error)) {
    // Unfinished files too: those of a process that was stopped stay behind.
    const fs::path extension = entry->path().extension();
    if (extension != ".basis" && extension != ".tmp") continue;
    std::error_code gone;
    const std::uint64_t size = entry->file_size(gone);
    if (gone) continue;
    const fs::file_time_type used = entry->last_write_time(gone);
    if (gone) continue;
    all.push_back({used, entry->path(), size});
    bytes += size;
  }
  std::sort(all.begin(), all.end(), [](const Kept& a, const Kept& b) { return a.used < b.used; });
  for (const Kept& oldest : all) {
    if (bytes <= config_.most_bytes) return;
    std::error_code gone;
    fs::remove(oldest.file, gone);
    bytes -= oldest.bytes;
  }
}

}  // namespace palpate::host
