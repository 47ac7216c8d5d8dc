#include "host/session/lockstep_peer.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstddef>

namespace palpate::host {

void FileDescriptorPeer::send(const lockstep::SensorFrame& frame) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&frame);
  for (std::size_t done = 0; done < sizeof frame;) {
    const ssize_t count = ::write(sensor_fd_, bytes + done, sizeof frame - done);
    if (count < 0 && errno == EINTR) continue;
    require_of_board(count > 0, "its sensor stream is closed");
    done += static_cast<std::size_t>(count);
  }
}

void FileDescriptorPeer::receive(lockstep::ActuatorFrame& frame) {
  auto* bytes = reinterpret_cast<std::byte*>(&frame);
  for (std::size_t done = 0; done < sizeof frame;) {
    const ssize_t count = ::read(actuator_fd_, bytes + done, sizeof frame - done);
    if (count < 0 && errno == EINTR) continue;
    require_of_board(count > 0, "its actuator stream ended");
    done += static_cast<std::size_t>(count);
  }
}

}  // namespace palpate::host
