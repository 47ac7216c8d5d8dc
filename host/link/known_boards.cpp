#include "host/link/known_boards.hpp"

#include <algorithm>

#include "known_board_names.hpp"

namespace palpate::link {

std::span<const std::string_view> known_boards() {
  return kKnownBoardNames;
}

bool is_known_board(std::string_view name) {
  return std::ranges::find(kKnownBoardNames, name) != kKnownBoardNames.end();
}

std::string unknown_board_text(std::string_view name, std::span<const std::string_view> known) {
  std::string text = "it calls itself \"" + std::string(name) + "\", which is none that this program arms:";
  for (std::size_t i = 0; i < known.size(); ++i) text += (i == 0 ? " " : ", ") + std::string(known[i]);
  return text + " (docs/safety.md, \"Arming\")";
}

}  // namespace palpate::link
