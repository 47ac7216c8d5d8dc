// A local model as the wire carries it: the bytes of its basis, and its state as a message. For the host and
// for tests.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "palpate/ModelPart_1_0.h"
#include "palpate/ModelState_1_0.h"
#include "shared/wire/model_contents.hpp"

namespace palpate::wire {

struct PackedModel {
  std::shared_ptr<const std::vector<std::uint8_t>> basis;  // null: a held force
  palpate_ModelState_1_0 state{};
};

// Cuts a model into basis and state. Counts must be within bounds; whether they fit together, and what the
// numbers are, is the board's to judge: of an array that holds no numbers the step is none either.
PackedModel pack(const ModelContents& contents);

// The model as a receiver has it: that of pack(), with the state as it comes back from its steps.
ModelContents unpack(const PackedModel& packed, const ModelContents& contents);

// The piece of a basis that begins with this block and has `blocks` of them, or what is left.
palpate_ModelPart_1_0 part_of(const std::vector<std::uint8_t>& basis, std::uint32_t id,
                              std::uint16_t first_block, std::size_t blocks);

// Of a whole basis, in pieces as large as the message allows.
std::vector<palpate_ModelPart_1_0> parts_of(const std::vector<std::uint8_t>& basis, std::uint32_t id);

}  // namespace palpate::wire
