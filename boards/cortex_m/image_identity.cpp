#include "boards/cortex_m/image_identity.hpp"

#include <algorithm>
#include <string_view>

#include "shared/wire/messages.hpp"
#include "shared/wire/node.hpp"

namespace {

static_assert(palpate::wire::is_node_name(PALPATE_BOARD_NAME));

consteval std::array<char, 32> filled(std::string_view text) {
  std::array<char, 32> out{};
  std::ranges::copy(text, out.begin());
  return out;
}

}  // namespace

extern "C" {
[[gnu::used, gnu::section(".identity")]] constinit const palpate::board::ImageIdentity palpate_image_identity{
    palpate::wire::kSchemaHash, filled(PALPATE_BOARD_NAME), filled(PALPATE_VERSION)};
}
