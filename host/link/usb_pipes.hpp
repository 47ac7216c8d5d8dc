// The host's end of a bulk endpoint: packets, their toggles, and what is repeated (USB 2.0, 5.8 and 8.6).
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "host/link/usb_records.hpp"

namespace palpate::link {

// To the device. A frame is a transfer: packets of 64 bytes and a shorter one at its end, an empty one where
// the last was full. Packets go out before those in front of them are answered; where one is refused, all
// behind it are (usb_record.hpp), and it goes again with them when they are.
class UsbOutPipe {
 public:
  void submit(std::span<const std::uint8_t> frame);
  // Is there a packet to go?
  [[nodiscard]] bool has_packet() const { return !is_refused_ && next_ < packets_.size(); }
  [[nodiscard]] std::size_t packet_bytes() const { return packets_[next_].bytes.size(); }
  // Its record. is_answered: the host will hear the answer; without, it goes again.
  void append_packet(std::vector<std::uint8_t>& records, std::uint8_t address, bool is_answered);
  struct Taken {
    bool is_good = true;  // false: no device answers so
    std::size_t packets = 0, bytes = 0;
  };
  // Of a packet whose answer the host hears.
  Taken take(UsbRecord handshake);
  // Bytes that have not gone out, or have been refused.
  [[nodiscard]] std::size_t waiting_bytes() const;
  // Frames that have not arrived in full.
  [[nodiscard]] std::size_t frames() const;

 private:
  struct Packet {
    std::vector<std::uint8_t> bytes;
    bool ends_frame = false;  // with its last byte
  };
  std::deque<Packet> packets_;  // not acknowledged
  std::size_t next_ = 0;        // of those, how many are on their way
  std::size_t unanswered_ = 0;
  std::uint8_t toggle_ = 0;  // of the first
  bool is_refused_ = false, again_ = false;
};

// From the device.
class UsbInPipe {
 public:
  // A transfer of the host's has room for so much (host/link/usb_link.cpp).
  static constexpr std::size_t kTransferBytes = 16384;

  struct Taken {
    bool is_copy = false;  // came before: its acknowledgement was lost
    bool ends_transfer = false;
  };
  Taken take(const UsbAnswer& packet);
  // Of the transfers that have ended.
  std::vector<std::uint8_t> completed();
  // What is there of the last one.
  void complete() { completed_bytes_ = bytes_.size(); }

 private:
  std::vector<std::uint8_t> bytes_;
  std::size_t completed_bytes_ = 0;
  std::uint8_t toggle_ = 0;
};

}  // namespace palpate::link
