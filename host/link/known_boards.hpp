// The boards of this project, by what they call themselves (palpate.GetInfo): hosts arm no other
// (docs/safety.md, "Arming").
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace palpate::link {

// The folders of boards/ that have a limits.hpp, in alphabetical order (boards/cmake/known_boards.cmake).
std::span<const std::string_view> known_boards();
bool is_known_board(std::string_view name);

// Why a board is not armed, with its name and those that would be.
std::string unknown_board_text(std::string_view name,
                               std::span<const std::string_view> known = known_boards());

}  // namespace palpate::link
