// Prints the hashes of the golden trace and its work, a line each: name, space, 16 hexadecimal digits.
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <memory>

#include "shared/golden/golden_trace.hpp"

int main() {
  const auto trace = std::make_unique<palpate::golden::GoldenTrace>();
  const palpate::golden::Result result = trace->run();
  const auto print_line = [](const char* name, std::uint64_t value) {
    std::printf("%s %016" PRIx64 "\n", name, value);
  };
  print_line("model", result.model_hash);
  print_line("near", result.near_hash);
  print_line("felt", result.felt_hash);
  print_line("device", result.device_hash);
  print_line("math", result.math_hash);
  print_line("work", result.work);
  return 0;
}
