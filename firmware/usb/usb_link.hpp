// The board's end of the link on USB: joins the link's two rings to the endpoints of TinyUSB's stack.
//
// Two functions can carry the link, the vendor's bulk endpoints and the serial line. It is carried by the one
// that the host has opened last, or has sent something to since:
//   serial line  opened and closed by DTR, as programs do that open and close such a port
//   vendor       open when the host takes a packet or sends one; closed when it lets one wait for
//                kPatience_ticks. While it is closed a packet without bytes waits: who takes it is there
// What the board says while neither is open is lost, as on a line that nobody listens to, and counted
// (LinkBuffers::frames_unsent); frame by frame, so that who opens one never gets a frame without its
// beginning.
//
// On the vendor's endpoints one frame is one transfer: it ends with a packet of less than 64 bytes, so behind
// a full one with one without bytes. A transfer from the host may end anywhere, the framing finds the frames.
// Bytes that the receive ring has no room for wait at the host.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.hpp"
#include "firmware/usb/descriptors.hpp"

namespace palpate::firmware::usb {

inline constexpr std::uint32_t kPatience_ticks = 100;

// One per program, for TinyUSB is one. Background context throughout.
class UsbLink {
 public:
  UsbLink(LinkBuffers& link, const std::array<std::uint8_t, 16>& unique_id);
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  // Starts the stack and connects to the bus: once in a program, and not in the constructor, since the
  // controller's driver begins to work.
  void begin();
  // Handles what the controller has reported, at most a packet each way and endpoint: after every
  // transaction, or as often as the main loop comes round.
  void service();
  // Has the controller reported what service() has not handled? Also with interrupts held back.
  [[nodiscard]] static bool has_work();
  // Once after each servo tick.
  void tick();

  // Asked by TinyUSB.
  const std::uint16_t* text_descriptor(Text index);
  void note_line_state(bool is_open);

 private:
  enum class Function : std::uint8_t { vendor, serial };
  struct Packet {
    std::size_t length;
    bool ends_frame;
  };

  void start_over();
  [[nodiscard]] bool is_open() const { return carrier_ == Function::serial || vendor_open_; }
  void open(Function function);
  void receive();
  void transmit();
  void transmit_to_vendor();
  void transmit_to_serial();
  // Moves bytes up to the next end of a frame, at most bytes.size(), from the ring.
  Packet take(std::span<std::uint8_t> bytes);
  void skip_rest_of_frame();
  void discard_all();
  // At most a packet; false: there is nothing.
  bool discard_some();

  LinkBuffers& link_;
  std::array<std::uint8_t, 16> unique_id_;
  std::array<std::uint16_t, 1 + 2 * 16> text_{};  // header and characters of the last that was asked for
  Function carrier_ = Function::vendor;
  bool serial_open_ = false;
  bool vendor_open_ = false;
  bool packet_waits_ = false;  // in the vendor's endpoint
  bool end_waits_ = false;     // it ends a frame
  bool empty_due_ = false;     // the frame that was sent last filled its last packet
  bool within_frame_ = false;  // the ring begins within a frame
  std::uint32_t waited_ticks_ = 0;
};

}  // namespace palpate::firmware::usb
