#include "host/link/metered_link.hpp"

#include <stdexcept>
#include <string>

#include "host/link/can_bus.hpp"
#include "host/link/uart.hpp"
#include "host/link/usb_host.hpp"

namespace palpate::link {
namespace {

class TwoLines final : public MeteredLink {
 public:
  explicit TwoLines(const MeteredLinkOptions& options)
      : down_(options.baud, options.queue_bytes), up_(options.baud, options.queue_bytes) {}
  Medium& down() override { return down_; }
  Medium& up() override { return up_; }

 private:
  Uart down_, up_;
};

class CanLink final : public MeteredLink {
 public:
  CanLink(const CanBus& bus, const MeteredLinkOptions& options)
      : bus_(bus, options.queue_bytes, options.errors) {}
  Medium& down() override { return bus_.down(); }
  Medium& up() override { return bus_.up(); }

 private:
  MeteredCanBus bus_;
};

class UsbLink final : public MeteredLink {
 public:
  explicit UsbLink(const MeteredLinkOptions& options) : host_(options.queue_bytes, options.errors) {}
  Medium& down() override { return host_.down(); }
  Medium& up() override { return host_.up(); }
  UsbHost* usb_host() override { return &host_; }

 private:
  UsbHost host_;
};

void require_rate(const char* what, std::uint32_t rate_Hz, std::uint32_t least_Hz, std::uint32_t most_Hz) {
  if (rate_Hz < least_Hz || rate_Hz > most_Hz)
    throw std::invalid_argument(std::string("CAN: ") + what + " of " + std::to_string(rate_Hz) +
                                " bit/s; allowed: " + std::to_string(least_Hz) + " to " +
                                std::to_string(most_Hz));
}

CanBus can_bus(const MeteredLinkOptions& options, bool fd) {
  require_rate("bit rate", options.bit_rate_Hz, kMinBitRate_Hz, kMaxBitRate_Hz);
  CanBus bus{.fd = fd, .nominal_bit_s = 1.0 / options.bit_rate_Hz, .data_bit_s = 1.0 / options.bit_rate_Hz};
  if (fd) {
    require_rate("data bit rate", options.data_bit_rate_Hz, options.bit_rate_Hz, kMaxDataBitRate_Hz);
    bus.data_bit_s = 1.0 / options.data_bit_rate_Hz;
  }
  return bus;
}

}  // namespace

std::unique_ptr<MeteredLink> make_metered_link(const MeteredLinkOptions& options) {
  if (!options.errors.errors.empty() && options.medium == MediumKind::uart)
    throw std::invalid_argument("make_metered_link: errors on the bus, of a medium that is none");
  switch (options.medium) {
    case MediumKind::uart:
      return std::make_unique<TwoLines>(options);
    case MediumKind::can:
      return std::make_unique<CanLink>(can_bus(options, false), options);
    case MediumKind::canfd:
      return std::make_unique<CanLink>(can_bus(options, true), options);
    case MediumKind::usb:
      return std::make_unique<UsbLink>(options);
  }
  throw std::invalid_argument("make_metered_link: unknown medium " +
                              std::to_string(static_cast<int>(options.medium)));
}

FramingKind framing_of(MediumKind medium) {
  switch (medium) {
    case MediumKind::can:
      return FramingKind::can_classic;
    case MediumKind::canfd:
      return FramingKind::can_fd;
    case MediumKind::uart:
    case MediumKind::usb:
      return FramingKind::serial;
  }
  throw std::invalid_argument("framing_of: unknown medium " + std::to_string(static_cast<int>(medium)));
}

}  // namespace palpate::link
