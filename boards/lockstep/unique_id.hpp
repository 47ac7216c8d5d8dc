// The unique identifier of an emulated board: there is no chip to ask, so it is the board's name, filled up
// with zeros. Two emulated boards of a kind have the same one.
#pragma once

#include <algorithm>
#include <string_view>

#include "shared/wire/node.hpp"

namespace palpate::board {

consteval wire::UniqueId emulated_unique_id(std::string_view board) {
  wire::UniqueId id{};
  std::transform(board.begin(), board.end(), id.begin(),  // a longer name does not compile
                 [](char one) { return static_cast<std::uint8_t>(one); });
  return id;
}

}  // namespace palpate::board
