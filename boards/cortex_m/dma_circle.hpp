#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.hpp"

namespace palpate::cortex_m {

// What a DMA writes or reads is in memory on the other side of this.
inline void dma_barrier() {
  asm volatile("dmb" ::: "memory");
}

// Moves what a DMA has written round its circle into the link's ring, in two pieces where the circle closes.
// remaining: items that the DMA still has until then; read: where the last call ended. Returns where this one
// did. What the ring has no room for is lost, the framing notices.
inline std::uint32_t drain_circle(std::span<const std::uint8_t> circle, std::uint32_t remaining,
                                  std::uint32_t read, firmware::LinkBuffers& link) {
  const auto size = static_cast<std::uint32_t>(circle.size());
  const std::uint32_t written = (size - remaining) % size;
  dma_barrier();
  const auto take = [&](std::uint32_t begin, std::uint32_t end) {
    const auto bytes = circle.subspan(begin, end - begin);
    (void)link.received.write(bytes.first(std::min<std::size_t>(bytes.size(), link.received.free())));
  };
  if (written < read) {
    take(read, size);
    read = 0;
  }
  take(read, written);
  return written;
}

}  // namespace palpate::cortex_m
