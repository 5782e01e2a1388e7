#include "drivers/xsens_mt/mtb_file.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/drivers/xsens_mt/mt_frames.h"

namespace imuscope::xsens {
namespace {

using test_frames::Bytes;
using test_frames::frame;
using test_frames::mtdata;

void add_to(Bytes& to, const Bytes& more) { to.insert(to.end(), more.begin(), more.end()); }

/// What a header may hold: text, zeros, numbers; no byte of it a preamble.
Bytes header_of(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> byte(0, kPreamble - 1);
  Bytes bytes(size);
  for (auto& b : bytes) b = static_cast<std::uint8_t>(byte(random));
  return bytes;
}

Bytes ten_messages() {
  Bytes bytes;
  for (std::uint16_t k = 0; k < 10; ++k) add_to(bytes, mtdata(k));
  return bytes;
}

TEST(MtbFile, TheDevicesBytesBeginAtTheFirstMessageBehindTheHeader) {
  for (const std::size_t size : {0U, 1U, 7U, 512U, 5000U, 100'000U}) {
    Bytes file = header_of(size, 1);
    add_to(file, ten_messages());
    EXPECT_EQ(data_offset_of_mtb(file), size);
  }
}

TEST(MtbFile, AMessageThatTheHeaderHoldsByChanceIsNoBeginning) {
  // Alone, and two in a row with bytes after them that are no message.
  for (const int n : {1, 2}) {
    Bytes file = header_of(40, 2);
    for (int i = 0; i < n; ++i) add_to(file, frame(0x3E, {1, 2, 3}));
    add_to(file, header_of(60, 3));
    const std::size_t begin = file.size();
    add_to(file, ten_messages());
    EXPECT_EQ(data_offset_of_mtb(file), begin) << n;
  }
}

TEST(MtbFile, WithoutThreeMessagesInARowThereIsNoBeginning) {
  EXPECT_EQ(data_offset_of_mtb({}), std::nullopt);
  EXPECT_EQ(data_offset_of_mtb(header_of(50'000, 4)), std::nullopt);
  Bytes file = header_of(100, 5);
  add_to(file, mtdata(1));
  add_to(file, mtdata(2));
  EXPECT_EQ(data_offset_of_mtb(file), std::nullopt);
  add_to(file, mtdata(3));
  EXPECT_EQ(data_offset_of_mtb(file), 100U);
}

/// A message of which the last bytes are a whole message themselves: its checksum is that of the other, too.
Bytes message_that_ends_in_another(std::uint8_t value) {
  Bytes data{value, 0};
  add_to(data, frame(0x10, {7, 8}));
  const std::uint8_t checksum = data.back();
  data.pop_back();
  // The second byte makes the sums of both alike.
  for (int make_up = 0; make_up < 256; ++make_up) {
    data[1] = static_cast<std::uint8_t>(make_up);
    if (Bytes whole = frame(mid::kMtData, data); whole.back() == checksum) return whole;
  }
  ADD_FAILURE() << "no byte makes the sums alike";
  return {};
}

/// A message in whose data a whole one stands.
Bytes message_with_another_inside(std::uint8_t value) {
  Bytes data{value};
  add_to(data, frame(0x10, {7, 8}));
  add_to(data, {9, 9, 9});
  return frame(mid::kMtData, data);
}

// A measurement may look like a message, in one place of the data for as long as the vehicle stands.
TEST(MtbFile, WhatLooksLikeAMessageInsideOfOneIsDataOfIt) {
  for (const auto& make : {message_that_ends_in_another, message_with_another_inside}) {
    Bytes file = header_of(321, 6);
    for (std::uint8_t k = 0; k < 10; ++k) add_to(file, make(k));
    EXPECT_EQ(data_offset_of_mtb(file), 321U);
  }
  // In the first one alone: not even that one is lost.
  Bytes file = header_of(321, 7);
  add_to(file, message_with_another_inside(1));
  add_to(file, ten_messages());
  EXPECT_EQ(data_offset_of_mtb(file), 321U);
}

// The end of the header looks like the beginning of a message that reaches into the data.
TEST(MtbFile, AFalseMessageOfTheHeaderThatCoversTheFirstMessagesLosesNone) {
  const Bytes data = ten_messages();
  const std::size_t one = mtdata(0).size();
  for (const std::size_t covered : {one / 2, one + 5, 2 * one + 5, 3 * one + 5}) {
    // FA FF 32 LEN x [covered bytes of the data, the last of which has to be the checksum].
    Bytes file = header_of(64, 8);
    const std::size_t begin = file.size() + 5;
    Bytes false_message{kPreamble, kMasterBid, mid::kMtData, static_cast<std::uint8_t>(covered), 0};
    ASSERT_LT(covered, kExtendedLength);
    unsigned sum = 0;
    for (std::size_t i = 1; i < false_message.size(); ++i) sum += false_message[i];
    for (std::size_t i = 0; i < covered; ++i) sum += data[i];
    false_message.back() = static_cast<std::uint8_t>(0U - sum);
    add_to(file, false_message);
    add_to(file, data);
    EXPECT_EQ(data_offset_of_mtb(file), begin) << covered << " bytes covered";
  }
}

}  // namespace
}  // namespace imuscope::xsens
