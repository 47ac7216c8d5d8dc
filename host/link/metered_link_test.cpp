#include "host/link/metered_link.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "host/link/can_cost.hpp"

namespace palpate::link {
namespace {

// Bytes a tick of the fastest stream, by the definition of each medium: 10 bits a byte; a full frame's record
// (8 or 64 bytes and 7) in its longest time; 19 packets of 64 bytes.
TEST(MeteredLink, CarriesWhatItsMediumDoes) {
  const auto rate = [](const MeteredLinkOptions& options) {
    return make_metered_link(options)->down().bytes_per_tick();
  };
  EXPECT_DOUBLE_EQ(rate({.medium = MediumKind::uart, .baud = 921'600}), 92.16);
  EXPECT_DOUBLE_EQ(rate({.medium = MediumKind::can}), 15.0 / (can_frame_s(kClassicCan_1_Mbit, 8) * 1e3));
  EXPECT_DOUBLE_EQ(rate({.medium = MediumKind::can, .bit_rate_Hz = 500'000}),
                   7.5 / (can_frame_s(kClassicCan_1_Mbit, 8) * 1e3));
  EXPECT_DOUBLE_EQ(rate({.medium = MediumKind::canfd}), 71.0 / (can_frame_s(kCanFd_5_Mbit, 64) * 1e3));
  EXPECT_DOUBLE_EQ(rate({.medium = MediumKind::usb}), 1216.0);
}

TEST(MeteredLink, SaysWhatIsSpokenOnIt) {
  EXPECT_EQ(framing_of(MediumKind::uart), FramingKind::serial);
  EXPECT_EQ(framing_of(MediumKind::usb), FramingKind::serial);
  EXPECT_EQ(framing_of(MediumKind::can), FramingKind::can_classic);
  EXPECT_EQ(framing_of(MediumKind::canfd), FramingKind::can_fd);
}

TEST(MeteredLink, HasAHostsControllerOnUsbAlone) {
  for (const MediumKind kind : {MediumKind::uart, MediumKind::can, MediumKind::canfd, MediumKind::usb})
    EXPECT_EQ(make_metered_link({.medium = kind})->usb_host() != nullptr, kind == MediumKind::usb);
}

TEST(MeteredLink, RefusesRatesThatItsMediumCannotHave) {
  for (const MeteredLinkOptions& options :
       {MeteredLinkOptions{.medium = MediumKind::uart, .baud = 300},
        MeteredLinkOptions{.medium = MediumKind::can, .bit_rate_Hz = 1'000'001},
        MeteredLinkOptions{.medium = MediumKind::can, .bit_rate_Hz = 9'999},
        MeteredLinkOptions{.medium = MediumKind::canfd, .bit_rate_Hz = 0},
        MeteredLinkOptions{.medium = MediumKind::canfd, .data_bit_rate_Hz = 999'999},
        MeteredLinkOptions{.medium = MediumKind::canfd, .data_bit_rate_Hz = 8'000'001},
        MeteredLinkOptions{.medium = MediumKind::uart, .errors = {.errors = {{.chance = 0.1}}}},
        MeteredLinkOptions{.medium = MediumKind::usb, .queue_bytes = 0}})
    EXPECT_THROW((void)make_metered_link(options), std::invalid_argument);
}

}  // namespace
}  // namespace palpate::link
