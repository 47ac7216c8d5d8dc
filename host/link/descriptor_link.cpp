#include "host/link/descriptor_link.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>
#include <utility>

namespace palpate::link {
namespace {

// More than any driver hands out at once.
constexpr std::size_t kChunk_bytes = 16384;
// Where the device's queue is full (ENOBUFS) nothing tells when it has room again: poll(2) looks at the
// socket's. A CAN frame takes at least as long on its bus.
constexpr std::chrono::microseconds kQueueNap{100};

bool is_full(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == ENOBUFS;
}

}  // namespace

Descriptor::~Descriptor() {
  if (value_ >= 0) ::close(value_);
}

Descriptor::Descriptor(Descriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(value_, other.value_);
  return *this;
}

bool wait_for(int descriptor, short events, std::chrono::microseconds longest) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + longest;
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(end - Clock::now()).count();
    const timespec patience{left > 0 ? left / 1'000'000'000 : 0, left > 0 ? left % 1'000'000'000 : 0};
    pollfd wanted{.fd = descriptor, .events = events, .revents = 0};
    const int ready = ::ppoll(&wanted, 1, &patience, nullptr);
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

DescriptorLink::DescriptorLink(Descriptor descriptor, std::string address, double bytes_per_s)
    : descriptor_(std::move(descriptor)), address_(std::move(address)), bytes_per_s_(bytes_per_s) {}

ssize_t DescriptorLink::put(std::span<const std::uint8_t> bytes) {
  return ::write(descriptor_.get(), bytes.data(), bytes.size());
}

ssize_t DescriptorLink::get(std::span<std::uint8_t> bytes) {
  return ::read(descriptor_.get(), bytes.data(), bytes.size());
}

bool DescriptorLink::is_end(int error) const {
  return !is_full(error);
}

bool DescriptorLink::write(std::span<const std::uint8_t> frame) {
  using Clock = std::chrono::steady_clock;
  Clock::time_point end = Clock::now() + write_patience();
  while (open_ && !frame.empty()) {
    const ssize_t count = put(frame);
    if (count > 0) {
      end = Clock::now() + write_patience();
      bytes_sent_ += static_cast<std::uint64_t>(count);
      frame = frame.subspan(static_cast<std::size_t>(count));
    } else if (count < 0 && errno == EINTR) {
      continue;
    } else if (count < 0 && is_end(errno)) {
      open_ = false;
    } else {
      const bool full_queue = errno == ENOBUFS;
      const auto left = std::chrono::duration_cast<std::chrono::microseconds>(end - Clock::now());
      if (left <= left.zero()) break;
      if (full_queue)
        std::this_thread::sleep_for(std::min(kQueueNap, left));
      else
        wait_for(descriptor_.get(), POLLOUT, left);
    }
  }
  if (frame.empty()) return true;
  ++frames_unsent_;
  return false;
}

std::vector<std::uint8_t> DescriptorLink::read(std::chrono::microseconds longest) {
  if (!open_ || !wait_for(descriptor_.get(), POLLIN, longest)) return {};
  std::array<std::uint8_t, kChunk_bytes> chunk;
  const ssize_t count = get(chunk);
  if (count <= 0) {
    if (count == 0 || (errno != EINTR && is_end(errno))) open_ = false;
    return {};
  }
  bytes_received_ += static_cast<std::uint64_t>(count);
  return {chunk.begin(), chunk.begin() + count};
}

TransportCounters DescriptorLink::counters() const {
  return {.bytes_sent = bytes_sent_, .bytes_received = bytes_received_, .frames_unsent = frames_unsent_};
}

}  // namespace palpate::link
