// Brings bases of local models to the board, in pieces, and knows which are there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "shared/wire/messages.hpp"
#include "shared/wire/packed_model.hpp"

namespace palpate::host {

class BasisSender {
 public:
  using Bytes = std::shared_ptr<const std::vector<std::uint8_t>>;

  // Begins with another basis, from its first piece; what was under way is given up.
  void begin(std::uint32_t id, Bytes basis);
  // The next piece of at most so many blocks (palpate.ModelPart); none: nothing is left to be sent. When then
  // the board does not answer for kAnswer_ticks, the last block goes again.
  std::optional<palpate_ModelPart_1_0> next(std::size_t blocks, std::uint32_t tick);
  // What the board says. Sends again what it misses of the basis that is under way.
  void take(const palpate_BasisReport_1_0& report);

  // Is a basis under way that the board has not said to be complete?
  [[nodiscard]] bool busy() const { return basis_ != nullptr && !complete_; }
  [[nodiscard]] std::uint32_t id() const { return id_; }  // that came last; 0: none yet
  // Bases that were complete on the board when it reported last.
  [[nodiscard]] const std::vector<std::uint32_t>& held() const { return held_; }
  [[nodiscard]] bool is_held(std::uint32_t id) const;

 private:
  static constexpr std::uint32_t kAnswer_ticks = 100;

  [[nodiscard]] std::size_t blocks() const;

  Bytes basis_;
  std::uint32_t id_ = 0;
  std::vector<bool> wanted_;                  // blocks that are to be sent
  std::size_t next_ = 0;                      // none before it is wanted
  std::optional<std::uint32_t> waits_since_;  // for the board's answer
  bool complete_ = false;
  std::vector<std::uint32_t> held_;
};

}  // namespace palpate::host
