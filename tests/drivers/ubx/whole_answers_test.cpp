// Everything that comes out of rich streams, held as it once was.
#include <gtest/gtest.h>

#include "drivers/ubx/decoder.h"
#include "drivers/ubx/session.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/drivers/ubx/message_builder.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::ubx {
namespace {

using test::expect_recorded;
using test::ubx_message;
using test::ubx_nav_pvt;
using namespace std::chrono_literals;

constexpr HostTime kBegin = host_time_from_ns(5'000'000'000'000);

/// A solution whose fields are all different.
test::Bytes pvt_payload(std::uint32_t itow_ms) {
  const test::Bytes message = ubx_nav_pvt(itow_ms);
  test::Bytes payload(message.begin() + 6, message.end() - 2);
  const auto put = [&](std::size_t at, std::int32_t value) {
    for (std::size_t i = 0; i < 4; ++i)
      payload.at(at + i) = static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> (8 * i));
  };
  put(12, 25), put(16, -125'000'000), put(52, -500), put(56, -125), put(60, 1346), put(64, 33'812'300),
      put(72, 180'000);
  payload.at(76) = 112;
  return payload;
}

DecoderConfig config_of(Duration period) {
  DecoderConfig config;
  config.device = 4;
  config.period = period;
  config.per_byte = byte_time(38'400.0);
  return config;
}

std::string outcome(const test::Bytes& bytes) {
  DecoderConfig config = config_of(100ms);
  config.clock = ClockMapConfig::fixed(kBegin, 1.0);
  Decoder decoder(config);
  return test::outcome_text(decoder, bytes, kBegin);
}

TEST(UbxWhole, EpochsWithGapsRepeatsAndTheEndOfTheWeek) {
  std::string text;
  for (const Duration period : {Duration{100ms}, Duration{250ms}, Duration{}}) {
    Decoder decoder(config_of(period));
    test::CollectingSink sink;
    HostTime now = kBegin;
    for (const std::uint32_t itow_ms :
         {604'799'700U, 604'799'800U, 604'799'900U, 0U, 100U, 100U, 250U, 400U, 650U, 1000U, 990U, 1100U,
          604'800'000U, 302'400'000U, 302'400'001U, 1200U}) {
      decoder.push(ubx_message(1, 7, pvt_payload(itow_ms)), {now, now - 300us}, sink);
      now += 100ms;
    }
    for (const Sample& sample : sink.samples) text += test::sample_text(sample) + '\n';
    text += test::counts_text(decoder.counters()) + '\n';
  }
  expect_recorded("drivers/ubx/epochs.txt", text, test::kSampleShare);
}

TEST(UbxWhole, AnotherByteAtEveryPlaceOfASolution) {
  const test::Bytes payload = pvt_payload(400'000'000);
  std::string text;
  for (const std::uint8_t other : test::Bytes{0x00, 0x03, 0x04, 0x41, 0x7F, 0x80, 0xFF}) {
    text += "byte " + std::to_string(other) + '\n' +
            test::at_every_place(
                80,
                [&](std::size_t at) {
                  test::Bytes changed = payload;
                  changed[at] = other;
                  return ubx_message(1, 7, changed);
                },
                outcome);
  }
  expect_recorded("drivers/ubx/other_bytes.txt", text);
}

TEST(UbxWhole, DamageAtEveryPlace) {
  test::Bytes stream = ubx_message(1, 7, pvt_payload(400'000'000));
  const auto append = [&](const test::Bytes& more) { stream.insert(stream.end(), more.begin(), more.end()); };
  append(test::bytes_of("\r\n$GPZDA,123456.10,14,03,2026,00,00*60\r\n!"));
  append(ubx_message(5, 1, {6, 1, 0xB5}));
  append(ubx_message(1, 7, pvt_payload(400'000'100)));
  std::string text = test::at_every_place(
      stream.size(),
      [&](std::size_t at) {
        test::Bytes bytes = stream;
        bytes[at] ^= 0x21U;
        return bytes;
      },
      outcome);
  text += test::at_every_place(
      stream.size(),
      [&](std::size_t at) {
        return test::Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at));
      },
      outcome);
  for (const std::size_t size :
       {0U, 83U, 84U, 91U, 92U, 100U, 1000U, 1023U, 1024U, 1025U, 2047U, 2048U, 2049U, 4096U, 4097U, 8000U}) {
    test::Bytes payload = pvt_payload(400'000'000);
    payload.resize(size);
    text += std::to_string(size) + ": " + outcome(ubx_message(1, 7, payload)) + '\n';
  }
  expect_recorded("drivers/ubx/damage.txt", text);
}

TEST(UbxWhole, WhatTheSessionTells) {
  std::string text =
      test::listening_text([] { return std::make_unique<Session>(); }, ubx_nav_pvt(400'000'000));
  text += test::listening_text([] { return std::make_unique<Session>(); }, ubx_message(1, 3, {1, 2}));
  text += test::listening_text([] { return std::make_unique<Session>(); }, ubx_message(2, 7, {1, 2}));
  expect_recorded("drivers/ubx/session.txt", text);
}

}  // namespace
}  // namespace imuscope::ubx
