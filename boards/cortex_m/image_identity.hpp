// What an image is, for programs that have it as a file: an object of a fixed name and layout in its flash.
#pragma once

#include <array>
#include <cstdint>

namespace palpate::board {

struct ImageIdentity {
  std::uint64_t schema_hash = 0;
  std::array<char, 32> board{}, firmware{};
};

}  // namespace palpate::board

extern "C" {
extern const palpate::board::ImageIdentity palpate_image_identity;
}
