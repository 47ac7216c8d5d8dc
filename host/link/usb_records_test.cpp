#include "host/link/usb_records.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace palpate::link {
namespace {

using Bytes = std::vector<std::uint8_t>;

TEST(UsbAnswerReader, ReadsRecordsHoweverTheyAreCut) {
  Bytes sent;
  append_usb_record(sent, UsbRecord::attach);
  append_usb_record(sent, UsbRecord::data1, 0x81, Bytes(64, 7));
  append_usb_record(sent, UsbRecord::nak, 0x01);
  for (std::size_t step = 1; step <= sent.size(); ++step) {
    UsbAnswerReader reader;
    std::vector<UsbAnswer> got;
    for (std::size_t at = 0; at < sent.size(); at += step) {
      reader.feed(std::span(sent).subspan(at, std::min(step, sent.size() - at)));
      while (const auto answer = reader.next()) got.push_back(*answer);
    }
    ASSERT_EQ(got.size(), 3u) << step;
    EXPECT_EQ(got[0].kind, UsbRecord::attach);
    EXPECT_EQ(got[1].data, Bytes(64, 7));
    EXPECT_EQ(got[2].address, 0x01);
  }
}

TEST(UsbAnswerReader, RefusesWhatNoDeviceSends) {
  for (const Bytes& bytes :
       {Bytes{0x11, 1, 0}, Bytes{0x00, 0, 0}, Bytes{0x93, 0x81, 65}, Bytes{0x90, 1, 1}}) {
    UsbAnswerReader reader;
    reader.feed(bytes);
    EXPECT_THROW((void)reader.next(), std::runtime_error);
  }
}

}  // namespace
}  // namespace palpate::link
