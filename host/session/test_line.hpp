// A serial line for tests that look at what is submitted to it: receivers of whole frames in front of a UART.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host/link/uart.hpp"
#include "shared/wire/frame_receiver.hpp"

namespace palpate::host::test {

class WatchedLine : public link::Medium {
 public:
  explicit WatchedLine(std::uint32_t baud) : uart_(baud) {}
  bool submit(std::span<const std::uint8_t> bytes, std::uint32_t tick) override {
    return uart_.submit(bytes, tick);
  }
  std::vector<std::uint8_t> deliver(std::uint32_t tick) override { return uart_.deliver(tick); }
  [[nodiscard]] std::size_t backlog_bytes(std::uint32_t tick) const override {
    return uart_.backlog_bytes(tick);
  }
  [[nodiscard]] double bytes_per_tick() const override { return uart_.bytes_per_tick(); }
  [[nodiscard]] link::MediumCounters counters() const override { return uart_.counters(); }

 protected:
  // Of what is submitted to the board, a frame at a time.
  wire::Reception receive(std::span<const std::uint8_t> bytes) { return receiver_->receive(bytes); }

 private:
  link::Uart uart_;
  std::unique_ptr<wire::FrameReceiver<wire::kLargestPayloadToBoard>> receiver_ =
      std::make_unique<wire::FrameReceiver<wire::kLargestPayloadToBoard>>();
};

}  // namespace palpate::host::test
