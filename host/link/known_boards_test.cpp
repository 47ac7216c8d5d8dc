#include "host/link/known_boards.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "shared/wire/node.hpp"

namespace palpate::link {
namespace {

TEST(KnownBoards, AreTheFoldersWithLimits) {
  std::vector<std::string> folders;
  for (const auto& entry : std::filesystem::directory_iterator(PALPATE_BOARDS_FOLDER))
    if (std::filesystem::exists(entry.path() / "limits.hpp")) folders.push_back(entry.path().filename());
  std::ranges::sort(folders);
  EXPECT_TRUE(std::ranges::equal(known_boards(), folders));
  EXPECT_TRUE(is_known_board("native"));
  EXPECT_TRUE(is_known_board("mps2_an386"));
  for (const char* other : {"", "mps2", "cmake", "lockstep", "nativ", "native ", "skeleton"})
    EXPECT_FALSE(is_known_board(other));
  for (const std::string_view name : known_boards()) EXPECT_TRUE(wire::is_node_name(name)) << name;
}

TEST(KnownBoards, ASkeletonIsNone) {
  std::size_t skeletons = 0;
  for (const auto& entry : std::filesystem::directory_iterator(PALPATE_BOARDS_FOLDER)) {
    if (!std::filesystem::exists(entry.path() / "skeleton.txt")) continue;
    ++skeletons;
    EXPECT_FALSE(is_known_board(entry.path().filename().string())) << entry.path();
  }
  EXPECT_GE(skeletons, 1u);
}

TEST(KnownBoards, AnotherIsNamedWithThoseThatAreKnown) {
  const std::string text = unknown_board_text("stranger");
  EXPECT_NE(text.find("\"stranger\", which is none that this program arms: "), std::string::npos) << text;
  for (const std::string_view name : known_boards()) EXPECT_NE(text.find(name), std::string::npos) << text;
}

}  // namespace
}  // namespace palpate::link
