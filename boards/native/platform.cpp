#include "boards/native/platform.hpp"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

namespace palpate::board {
namespace {

[[noreturn]] void fail() {
  std::_Exit(static_cast<int>(lockstep::ExitCode::no_channel));
}

int open_or_fail(const std::string& path, int flags) {
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC);
  if (descriptor < 0) fail();
  return descriptor;
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;

std::int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kSecond_ns + now.tv_nsec;
}

std::uint32_t to_count(std::int64_t time_ns) {
  return static_cast<std::uint32_t>(time_ns / (kSecond_ns / NativePlatform::kClock_Hz));
}

}  // namespace

NativePlatform NativePlatform::in_lockstep(const std::string& actuator_path, const std::string& sensor_path,
                                           const std::string& times) {
  NativePlatform platform;
  platform.actuator_path_ = actuator_path;
  platform.sensor_path_ = sensor_path;
  platform.times_ = times;
  platform.actuators_ = open_or_fail(actuator_path, O_WRONLY);
  platform.sensors_ = open_or_fail(sensor_path, O_RDONLY);
  return platform;
}

NativePlatform NativePlatform::on_pseudo_terminal() {
  NativePlatform platform;
  platform.terminal_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
  if (platform.terminal_ < 0 || ::grantpt(platform.terminal_) != 0 || ::unlockpt(platform.terminal_) != 0)
    fail();
  platform.client_ = open_or_fail(platform.terminal_path(), O_RDWR | O_NOCTTY);
  termios settings{};
  if (::tcgetattr(platform.client_, &settings) != 0) fail();
  ::cfmakeraw(&settings);
  if (::tcsetattr(platform.client_, TCSANOW, &settings) != 0) fail();
  return platform;
}

std::string NativePlatform::terminal_path() const {
  std::array<char, 64> path{};
  if (::ptsname_r(terminal_, path.data(), path.size()) != 0) fail();
  return path.data();
}

bool NativePlatform::read_sensors(std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::read(sensors_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

bool NativePlatform::write_actuators(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(actuators_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

void NativePlatform::reset() {
  // The files close of themselves (O_CLOEXEC); the plant holds them open, too.
  ::execl("/proc/self/exe", "palpate_native", "--lockstep", actuator_path_.c_str(), sensor_path_.c_str(),
          times_.empty() ? nullptr : times_.c_str(), nullptr);
  fail();
}

std::uint32_t NativePlatform::clock_count() const {
  return has_plant() ? 0 : to_count(monotonic_ns());
}

void NativePlatform::wait_for_tick() {
  constexpr std::int64_t kTick_ns = kSecond_ns / firmware::kServoRate_Hz;
  const std::int64_t now_ns = monotonic_ns();
  if (due_ns_ == 0) {
    due_ns_ = now_ns;
    first_due_count_ = to_count(due_ns_ + kTick_ns);
  }
  due_ns_ += kTick_ns;
  if (now_ns >= due_ns_) {
    due_ns_ += (now_ns - due_ns_) / kTick_ns * kTick_ns;
    return;
  }
  const timespec due{due_ns_ / kSecond_ns, due_ns_ % kSecond_ns};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) != 0) {
  }
}

void NativePlatform::transmit(firmware::LinkBuffers& link) {
  // A client that does not read fills the terminal; the rest is lost, as on a line that nobody listens to.
  std::array<std::uint8_t, firmware::kLinkTransmitCapacity> bytes;
  const std::size_t count = link.transmit.read(bytes);
  if (count != 0) (void)!::write(terminal_, bytes.data(), count);
}

void NativePlatform::receive(firmware::LinkBuffers& link) {
  std::array<std::uint8_t, firmware::kLinkReceiveCapacity> bytes;
  const std::size_t room = std::min<std::size_t>(bytes.size(), link.received.free());
  const ssize_t count = ::read(terminal_, bytes.data(), room);
  if (count > 0) (void)link.received.write(std::span(bytes).first(static_cast<std::size_t>(count)));
}

}  // namespace palpate::board
