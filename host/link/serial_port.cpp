#include "host/link/serial_port.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "host/link/descriptor_link.hpp"

namespace palpate::link {
namespace {

struct Rate {
  std::uint32_t baud;
  speed_t name;
};
constexpr std::array kRates = {Rate{1200, B1200},       Rate{2400, B2400},       Rate{4800, B4800},
                               Rate{9600, B9600},       Rate{19200, B19200},     Rate{38400, B38400},
                               Rate{57600, B57600},     Rate{115200, B115200},   Rate{230400, B230400},
                               Rate{460800, B460800},   Rate{500000, B500000},   Rate{576000, B576000},
                               Rate{921600, B921600},   Rate{1000000, B1000000}, Rate{1152000, B1152000},
                               Rate{1500000, B1500000}, Rate{2000000, B2000000}, Rate{2500000, B2500000},
                               Rate{3000000, B3000000}, Rate{3500000, B3500000}, Rate{4000000, B4000000}};
constexpr double kBitsPerByte = 10.0;

[[noreturn]] void fail(const std::string& what, int error) {
  throw TransportError(what + ": " + std::strerror(error));
}

speed_t name_of(const std::string& address, std::uint32_t baud) {
  std::string allowed;
  for (const Rate& rate : kRates) {
    if (rate.baud == baud) return rate.name;
    allowed += (allowed.empty() ? "" : ", ") + std::to_string(rate.baud);
  }
  throw TransportError(address + ": baud is " + std::to_string(baud) + ", allowed " + allowed);
}

void make_raw(int descriptor, const std::string& address, speed_t rate) {
  termios settings{};
  if (::tcgetattr(descriptor, &settings) != 0) throw TransportError(address + ": is no serial line");
  ::cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS | PARENB);
  settings.c_cflag |= CLOCAL | CREAD;
  if (::cfsetspeed(&settings, rate) != 0 || ::tcsetattr(descriptor, TCSANOW, &settings) != 0)
    fail(address, errno);
}

bool is_pseudo_terminal(int descriptor) {
  constexpr unsigned kFirstMajor = 136, kLastMajor = 143;  // Linux: Unix98 pseudo-terminals
  struct stat what {};
  return ::fstat(descriptor, &what) == 0 && gnu_dev_major(what.st_rdev) >= kFirstMajor &&
         gnu_dev_major(what.st_rdev) <= kLastMajor;
}

// Our own hold of the far end: without it the terminal hangs up between two programs.
class PseudoTerminal final : public DescriptorLink {
 public:
  PseudoTerminal(Descriptor near, Descriptor far, std::string path)
      : DescriptorLink(std::move(near), "serial:" + std::move(path), 0.0), far_(std::move(far)) {}

 protected:
  // A board does not wait for a host.
  [[nodiscard]] std::chrono::milliseconds write_patience() const override { return {}; }

 private:
  Descriptor far_;
};

}  // namespace

std::unique_ptr<Transport> open_serial_port(const std::string& path, std::optional<std::uint32_t> given) {
  const std::string address = "serial:" + path;
  const std::uint32_t baud = given.value_or(kDefaultBaud);
  const speed_t rate = name_of(address, baud);
  Descriptor descriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (descriptor.get() < 0) fail(address, errno);
  if (::flock(descriptor.get(), LOCK_EX | LOCK_NB) != 0)
    throw TransportError(address + ": another program has it: a board obeys one host");
  make_raw(descriptor.get(), address, rate);
  ::tcflush(descriptor.get(), TCIOFLUSH);
  if (!given && is_pseudo_terminal(descriptor.get()))
    return std::make_unique<DescriptorLink>(std::move(descriptor), address, 0.0);
  return std::make_unique<DescriptorLink>(std::move(descriptor), address + "," + std::to_string(baud),
                                          baud / kBitsPerByte);
}

std::unique_ptr<Transport> open_pseudo_terminal() {
  const std::string address = "pty:";
  Descriptor near(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  std::array<char, 64> path{};
  if (near.get() < 0 || ::grantpt(near.get()) != 0 || ::unlockpt(near.get()) != 0 ||
      ::ptsname_r(near.get(), path.data(), path.size()) != 0)
    fail(address, errno);
  Descriptor far(::open(path.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  if (far.get() < 0) fail(address, errno);
  make_raw(far.get(), address, B115200);
  return std::make_unique<PseudoTerminal>(std::move(near), std::move(far), path.data());
}

}  // namespace palpate::link
