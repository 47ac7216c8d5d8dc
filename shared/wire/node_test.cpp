#include "shared/wire/node.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate::wire {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Message>
Bytes to_bytes(const Message& message) {
  Bytes out(MessageTraits<Message>::kMaxBytes, 0xEE);
  std::size_t written = 0;
  EXPECT_EQ(serialize(message, out, written), Status::ok);
  out.resize(written);
  return out;
}

TEST(Node, AHeartbeatHasItsFieldsInOrder) {
  const Heartbeat message{0x04030201u, NodeHealth::caution, NodeMode::initialization, 9};
  EXPECT_EQ(to_bytes(message), (Bytes{1, 2, 3, 4, 2, 1, 9}));
}

TEST(Node, InfoHasItsFieldsInOrder) {
  NodeInfo message{{2, 3}, {4, 5}, {}, "mill_7"};
  for (std::size_t i = 0; i < message.unique_id.size(); ++i)
    message.unique_id[i] = static_cast<std::uint8_t>(100 + i);
  Bytes expected{1, 0, 2, 3, 4, 5, 0, 0, 0, 0, 0, 0, 0, 0};
  expected.insert(expected.end(), message.unique_id.begin(), message.unique_id.end());
  const std::string name = "org.palpate.mill_7";
  expected.push_back(static_cast<std::uint8_t>(name.size()));
  expected.insert(expected.end(), name.begin(), name.end());
  expected.insert(expected.end(), {0, 0});
  EXPECT_EQ(to_bytes(message), expected);
}

TEST(Node, InfoWithTheLongestNameIsTheLongest) {
  const std::string board(kMaxNodeName - kNodeNamePrefix.size(), 'x');
  const NodeInfo message{{}, {}, {1}, board};
  EXPECT_EQ(to_bytes(message).size(), MessageTraits<NodeInfo>::kMaxBytes);
}

TEST(Node, WhatDoesNotFitIsRefused) {
  Bytes out(MessageTraits<NodeInfo>::kMaxBytes);
  std::size_t written = 0;
  EXPECT_EQ(serialize(Heartbeat{}, std::span(out).first(6), written), Status::payload_malformed);
  EXPECT_EQ(serialize(TimeSynchronization{}, std::span(out).first(6), written), Status::payload_malformed);
  const NodeInfo good{{}, {}, {1}, "mill"};
  EXPECT_EQ(serialize(good, std::span(out).first(out.size() - 1), written), Status::payload_malformed);
  EXPECT_EQ(serialize(NodeInfo{{}, {}, {1}, "Mill"}, out, written), Status::payload_malformed);
  EXPECT_EQ(written, 0u);
}

TEST(Node, NamesHaveTheStandardsCharactersAndLength) {
  EXPECT_TRUE(is_node_name("mps2_an386"));
  EXPECT_TRUE(is_node_name("a-b.9"));
  for (const char* const bad : {"", "Native", "a b", "a/b", "\xc3\xa4"})
    EXPECT_FALSE(is_node_name(bad)) << bad;
  EXPECT_TRUE(is_node_name(std::string(38, 'x')));
  EXPECT_FALSE(is_node_name(std::string(39, 'x')));
}

TEST(Node, TheTimeHasSevenBytes) {
  EXPECT_EQ(to_bytes(TimeSynchronization{0x07060504030201u}), (Bytes{1, 2, 3, 4, 5, 6, 7}));
}

TEST(Node, VersionsAreReadFromText) {
  EXPECT_EQ(node_version("1.20.3"), (NodeVersion{1, 20}));
  EXPECT_EQ(node_version("255.7"), (NodeVersion{255, 7}));
  EXPECT_EQ(node_version("3"), (NodeVersion{3, 0}));
  EXPECT_EQ(node_version("256.1a.2"), (NodeVersion{0, 0}));
  EXPECT_EQ(node_version("99999999999.4"), (NodeVersion{0, 4}));
  EXPECT_EQ(node_version("1x2.4"), (NodeVersion{0, 4}));
  EXPECT_EQ(node_version(""), NodeVersion{});
}

TEST(Node, OfMessagesThoseWithFixedNumbersAreStandard) {
  EXPECT_TRUE(is_standard_message(MessageTraits<Heartbeat>::kSpecifier));
  EXPECT_TRUE(is_standard_message(7168));
  EXPECT_TRUE(is_standard_message(8191));
  EXPECT_FALSE(is_standard_message(7167));
  EXPECT_FALSE(is_standard_message(8192));
  EXPECT_FALSE(is_standard_message(MessageTraits<NodeInfo>::kSpecifier));
}

}  // namespace
}  // namespace palpate::wire
