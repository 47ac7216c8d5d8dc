// For tests of CAN links.
#pragma once

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "host/link/can_record_bytes.hpp"
#include "host/link/descriptor_link.hpp"
#include "host/link/link_testing.hpp"

namespace palpate::link::testing {

inline Bytes record(std::uint32_t identifier, const Bytes& data, bool fd) {
  Bytes bytes = can_record_of({.identifier = identifier, .fd = fd, .data = data});
  EXPECT_FALSE(bytes.empty());
  return bytes;
}

// Tests on the interface that an environment variable names.
class OnInterface : public ::testing::Test {
 protected:
  explicit OnInterface(const char* variable) : variable_(variable) {
    if (const char* name = std::getenv(variable)) interface_ = name;
  }
  void SetUp() override {
    if (interface_.empty()) GTEST_SKIP() << variable_ << " names no CAN interface";
  }
  [[nodiscard]] const std::string& interface() const { return interface_; }

 private:
  const char* variable_;
  std::string interface_;
};

// The bus as any other program sees it: the kernel's own structs, no code of ours.
class PlainSocket {
 public:
  explicit PlainSocket(const std::string& interface)
      : descriptor_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    const int on = 1;
    sockaddr_can where{};
    where.can_family = AF_CAN;
    where.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    EXPECT_EQ(::setsockopt(descriptor_.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on), 0);
    EXPECT_EQ(::bind(descriptor_.get(), reinterpret_cast<const sockaddr*>(&where), sizeof where), 0);
  }
  void send(canid_t identifier, const Bytes& data, bool fd) {
    canfd_frame frame{};
    frame.can_id = identifier;
    frame.len = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), frame.data);
    const std::size_t size = fd ? CANFD_MTU : CAN_MTU;
    EXPECT_EQ(::write(descriptor_.get(), &frame, size), static_cast<ssize_t>(size));
  }
  // The next frame; `size` is what the kernel says, 16 or 72.
  canfd_frame receive(ssize_t& size) {
    canfd_frame frame{};
    size =
        wait_for(descriptor_.get(), POLLIN, kPatience) ? ::read(descriptor_.get(), &frame, sizeof frame) : 0;
    return frame;
  }

 private:
  Descriptor descriptor_;
};

}  // namespace palpate::link::testing
