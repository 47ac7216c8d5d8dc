#include "boards/stm32g4/can_link.hpp"

#include "boards/cortex_m/core_registers.hpp"
#include "boards/cortex_m/fault_record.hpp"
#include "boards/stm32g4/can_bits.hpp"
#include "boards/stm32g4/registers.hpp"
#include "shared/wire/messages.hpp"
#include "shared/wire/node.hpp"

namespace palpate::stm32g4 {
namespace {

// Message RAM of an instance, RM0440, 44.3.3: words of 32 bits, sizes fixed.
constexpr Base kMessageRam{kFdcanMessageRam_address + 0x350};  // FDCAN2's
constexpr std::uint32_t kMessageRam_words = 0x350 / 4;
constexpr std::uint32_t kExtendedFilters = 0x70, kReceiveFifo0 = 0xB0, kReceiveFifo1 = 0x188,
                        kTransmit = 0x278;
constexpr std::uint32_t kElement_bytes = 18 * 4;
constexpr std::uint32_t kElements = 3;

// First word of an element.
constexpr Bits kExtended{30}, kIdentifier{0, 29};
// Second word.
constexpr Bits kFdFormat{21}, kRateSwitch{20}, kLengthCode{16, 4};

// Filter of extended identifiers: "classic", identifier and mask.
constexpr std::uint32_t kToFifo0 = 1u << 29, kToFifo1 = 2u << 29, kByMask = 2u << 30;
constexpr std::uint32_t kReject = 2;      // RXGFC.ANFE, ANFS
constexpr std::uint32_t kFromPclk1 = 2;   // RCC_CCIPR.FDCANSEL
constexpr std::uint32_t kAllBuffers = 7;  // TXBTIE

// What a board is sent (firmware/link/framing.hpp): models to FIFO 0, the rest to FIFO 1. Identifiers: those
// of shared/wire/can_frame.hpp, whatever their priority and source.
struct Filter {
  std::uint32_t identifier, mask, target;
};
constexpr Filter subject(std::uint32_t specifier, std::uint32_t target) {
  return {specifier << 8, (7u << 23) | (0x1FFFu << 8), target};
}
constexpr std::array<Filter, 6> kFilters{
    subject(wire::kModelStateSubject, kToFifo0),
    subject(wire::kModelPartSubject, kToFifo0),
    subject(wire::kTraceRequestSubject, kToFifo1),
    subject(wire::kDirectForceSubject, kToFifo1),
    subject(wire::kHeartbeatSubject, kToFifo1),
    // Requests to this board.
    Filter{(3u << 24) | (wire::kBoardNode << 7), (3u << 24) | (0x7Fu << 7), kToFifo1},
};

Register& word(std::uint32_t offset) {
  return kMessageRam[{offset}];
}

// Set before the interrupt comes on.
CanLink* the_link = nullptr;

}  // namespace

struct CanLink::Fifo {
  Offset status, release;
  std::uint32_t memory;
};

void CanLink::begin() {
  the_link = this;
  put(RCC[rcc::CCIPR], rcc::CCIPR_FDCANSEL, kFromPclk1);
  switch_on(RCC[rcc::APB1ENR1], rcc::APB1ENR1_FDCANEN);
  FDCAN2[fdcan::CCCR] = fdcan::CCCR_INIT.mask();
  require(wait_until([] { return is_set(FDCAN2[fdcan::CCCR], fdcan::CCCR_INIT); }), FDCAN2[fdcan::CCCR]);
  // The format can be written only once CCE is set.
  FDCAN2[fdcan::CCCR] = fdcan::CCCR_INIT | fdcan::CCCR_CCE;
  FDCAN2[fdcan::CCCR] = (fdcan::CCCR_INIT | fdcan::CCCR_CCE) |
                        (format_ == wire::CanFormat::fd ? (fdcan::CCCR_FDOE | fdcan::CCCR_BRSE) : 0u);
  FDCAN2[fdcan::NBTP] = fdcan::NBTP_NTSEG1.of(kNominalBit.before_sample - 1) |
                        fdcan::NBTP_NTSEG2.of(kNominalBit.after_sample - 1) |
                        fdcan::NBTP_NSJW.of(kNominalBit.jump_width - 1);
  FDCAN2[fdcan::DBTP] = fdcan::DBTP_DTSEG1.of(kDataBit.before_sample - 1) |
                        fdcan::DBTP_DTSEG2.of(kDataBit.after_sample - 1) |
                        fdcan::DBTP_DSJW.of(kDataBit.jump_width - 1) | fdcan::DBTP_TDC;
  FDCAN2[fdcan::TDCR] = fdcan::TDCR_TDCO.of(1 + kDataBit.before_sample);
  FDCAN2[fdcan::RXGFC] = fdcan::RXGFC_RRFE | fdcan::RXGFC_RRFS | fdcan::RXGFC_ANFE.of(kReject) |
                         fdcan::RXGFC_ANFS.of(kReject) | fdcan::RXGFC_LSE.of(kFilters.size());
  for (std::uint32_t i = 0; i < kMessageRam_words; ++i) word(4 * i) = 0;
  std::uint32_t at = kExtendedFilters;
  for (const Filter& filter : kFilters) {
    word(at) = filter.target | filter.identifier;
    word(at + 4) = kByMask | filter.mask;
    at += 8;
  }
  FDCAN2[fdcan::TXBTIE] = kAllBuffers;
  FDCAN2[fdcan::IE] = fdcan::IE_RF0NE | fdcan::IE_RF1NE | fdcan::IE_TCE;
  FDCAN2[fdcan::ILE] = fdcan::ILE_EINT0.mask();
  clear(FDCAN2[fdcan::CCCR], fdcan::CCCR_INIT);
  require(wait_until([] { return !is_set(FDCAN2[fdcan::CCCR], fdcan::CCCR_INIT); }), FDCAN2[fdcan::CCCR]);
  enable_interrupt(interrupt::FDCAN2_IT0, kLinkPriority);
}

// Interrupts feed the ring; here the bus is joined again after too many errors.
void CanLink::poll_receive() {
  if (!is_set(FDCAN2[fdcan::PSR], fdcan::PSR_BO) || !is_set(FDCAN2[fdcan::CCCR], fdcan::CCCR_INIT)) return;
  clear(FDCAN2[fdcan::CCCR], fdcan::CCCR_INIT);
  ++bus_offs_;
}

void CanLink::start_transmit() {
  const Masked masked(interrupt::FDCAN2_IT0);
  fill();
}

void CanLink::isr_handle() {
  // Acknowledged first: what comes from here on interrupts again.
  const std::uint32_t flags = FDCAN2[fdcan::IR];
  FDCAN2[fdcan::IR] = flags;
  if ((flags & (fdcan::IR_RF0L | fdcan::IR_RF1L)) != 0) ++frames_lost_;
  drain({.status = fdcan::RXF1S, .release = fdcan::RXF1A, .memory = kReceiveFifo1});
  drain({.status = fdcan::RXF0S, .release = fdcan::RXF0A, .memory = kReceiveFifo0});
  fill();
}

void CanLink::drain(const Fifo& fifo) {
  // Fields of both FIFOs lie alike.
  for (std::uint32_t i = 0; i < kElements && get(FDCAN2[fifo.status], fdcan::RXF0S_F0FL) != 0; ++i) {
    const std::uint32_t index = get(FDCAN2[fifo.status], fdcan::RXF0S_F0GI);
    const std::uint32_t element = fifo.memory + kElement_bytes * index;
    const std::uint32_t first = word(element), second = word(element + 4);
    const std::uint32_t code = (second & kLengthCode.mask()) >> kLengthCode.position;
    const bool fd = (second & kFdFormat.mask()) != 0;
    // On classic CAN a code above 8 says 8.
    const std::size_t bytes = wire::kCanDataLengths[fd || code < 8 ? code : 8];
    std::array<std::uint8_t, 64> data;
    for (std::uint32_t at = 0; at < bytes; at += 4) {
      const std::uint32_t four = word(element + 8 + at);
      for (std::uint32_t byte = 0; byte < 4; ++byte) {
        data[at + byte] = static_cast<std::uint8_t>(four >> (8 * byte));
      }
    }
    FDCAN2[fifo.release] = index;
    std::array<std::uint8_t, wire::kMaxCanRecordBytes> record;
    const std::size_t length = wire::write_can_record(
        {.identifier = first & kIdentifier.mask(), .fd = fd, .data = std::span(data).first(bytes)}, record);
    if (!link_.received.write(std::span(record).first(length))) ++frames_lost_;
  }
}

void CanLink::fill() {
  for (std::uint32_t i = 0; i < kElements && get(FDCAN2[fdcan::TXFQS], fdcan::TXFQS_TFFL) != 0; ++i) {
    wire::CanFrame frame;
    if (!next_to_send(frame)) return;
    const std::uint32_t index = get(FDCAN2[fdcan::TXFQS], fdcan::TXFQS_TFQPI);
    const std::uint32_t element = kTransmit + kElement_bytes * index;
    word(element) = kExtended | (frame.identifier & kIdentifier.mask());
    word(element + 4) = kLengthCode.of(wire::can_length_code(frame.data.size())) |
                        (frame.fd ? (kFdFormat | kRateSwitch) : 0u);
    for (std::size_t at = 0; at < frame.data.size(); at += 4) {
      std::uint32_t four = 0;
      for (std::size_t byte = 0; byte < 4 && at + byte < frame.data.size(); ++byte) {
        four |= std::uint32_t{frame.data[at + byte]} << (8 * byte);
      }
      word(element + 8 + static_cast<std::uint32_t>(at)) = four;
    }
    FDCAN2[fdcan::TXBAR] = 1u << index;
  }
}

// The next record of the transmit ring; its data lie in the reader until the next call.
bool CanLink::next_to_send(wire::CanFrame& frame) {
  std::array<std::uint8_t, 32> some;
  // The longest record is three pieces long.
  for (int i = 0; i < 4; ++i) {
    const std::size_t there = link_.transmit.peek(some);
    const wire::CanRecordReader::Step step = reader_.read(std::span(some).first(there));
    link_.transmit.skip(step.consumed);
    if (step.found == wire::CanRecordReader::Found::frame) {
      frame = step.frame;
      return true;
    }
    if (there == 0) return false;
  }
  return false;
}

}  // namespace palpate::stm32g4

extern "C" {

void fdcan2_handler() {
  palpate::stm32g4::the_link->isr_handle();
}

}  // extern "C"
