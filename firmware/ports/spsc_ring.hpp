// A ring of fixed capacity between two contexts: one producer, one consumer, no locks.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::firmware {

// push() and write() belong to one context (interrupt, background or thread), pop() and read() to one other;
// the counts may be read from both. Indices run freely and wrap modulo 2^32, so a full ring holds `Capacity`
// elements.
template <class T, std::uint32_t Capacity>
class SpscRing {
  static_assert(Capacity != 0 && (Capacity & (Capacity - 1)) == 0, "capacity must be a power of two");
  static_assert(std::atomic<std::uint32_t>::is_always_lock_free);

 public:
  static constexpr std::uint32_t kCapacity = Capacity;

  [[nodiscard]] std::uint32_t size() const {
    // The reader's index first: an index read later can only have grown, so the difference never wraps below
    // zero.
    const std::uint32_t tail = tail_.load(std::memory_order_acquire);
    const std::uint32_t used = head_.load(std::memory_order_acquire) - tail;
    return used < Capacity ? used : Capacity;
  }
  [[nodiscard]] std::uint32_t free() const { return Capacity - size(); }

  // Producer. False, and nothing stored, when the ring is full.
  bool push(const T& value) { return write({&value, 1}); }

  // Producer. Stores all of `values` or, where they do not fit, nothing.
  bool write(std::span<const T> values) {
    const std::uint32_t head = head_.load(std::memory_order_relaxed);
    const std::uint32_t used = head - tail_.load(std::memory_order_acquire);
    if (values.size() > Capacity - used) return false;
    std::uint32_t index = head;
    for (const T& value : values) slots_[index++ & (Capacity - 1)] = value;
    head_.store(index, std::memory_order_release);
    return true;
  }

  // Consumer. False when the ring is empty.
  bool pop(T& value) { return read({&value, 1}) == 1; }

  // Consumer. Copies at most values.size() elements, which stay in the ring, and returns how many.
  std::size_t peek(std::span<T> values) const {
    const std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    const std::uint32_t used = head_.load(std::memory_order_acquire) - tail;
    const std::size_t count = values.size() < used ? values.size() : used;
    std::uint32_t index = tail;
    for (T& value : values.first(count)) value = slots_[index++ & (Capacity - 1)];
    return count;
  }
  // Consumer. Drops `count` elements, at most as many as peek() has just found.
  void skip(std::size_t count) {
    tail_.store(tail_.load(std::memory_order_relaxed) + static_cast<std::uint32_t>(count),
                std::memory_order_release);
  }
  // Consumer. Moves at most values.size() elements out and returns how many.
  std::size_t read(std::span<T> values) {
    const std::size_t count = peek(values);
    skip(count);
    return count;
  }

 private:
  std::array<T, Capacity> slots_{};
  std::atomic<std::uint32_t> head_{0};  // written by the producer
  std::atomic<std::uint32_t> tail_{0};  // written by the consumer
};

}  // namespace palpate::firmware
