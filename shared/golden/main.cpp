// Prints the hashes of the golden trace, a line each: name, space, 16 hexadecimal digits.
#include <cinttypes>
#include <cstdio>
#include <memory>

#include "shared/golden/golden_trace.hpp"

int main() {
  const auto trace = std::make_unique<palpate::golden::GoldenTrace>();
  const palpate::golden::Result result = trace->run();
  std::printf("model %016" PRIx64 "\ndevice %016" PRIx64 "\nmath %016" PRIx64 "\n", result.model_hash,
              result.device_hash, result.math_hash);
  return 0;
}
