// Compiled for each board, with its folder's limits.hpp: one that is out of range stops the build.
#include "firmware/core/limit_ranges.hpp"
#include "limits.hpp"

static_assert(palpate::firmware::bad_limit(palpate::board::kLimits).empty(),
              "a limit of this board is out of the range of firmware/core/limit_ranges.hpp");
