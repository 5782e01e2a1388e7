// Everything that comes out of messages of every kind, held as it once was.
#include <gtest/gtest.h>

#include "drivers/ros_message/decoder.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::ros_message {
namespace {

using test::Bytes;
using namespace std::chrono_literals;

constexpr std::int64_t kWholeBegin_ns = 1'700'000'000'000'000'000;
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

void add(Bytes& stream, const Content& content) {
  Bytes frame(kFrameMost);
  frame.resize(write_frame(content, frame));
  stream.insert(stream.end(), frame.begin(), frame.end());
}

Content content_of(Kind kind, unsigned flags, Duration after, std::initializer_list<double> values) {
  Content content;
  content.kind = kind;
  content.flags = static_cast<std::uint8_t>(flags);
  content.time_ns = kWholeBegin_ns + after.count();
  std::copy(values.begin(), values.end(), content.values.begin());
  return content;
}

Bytes stream_of_everything() {
  Bytes stream;
  int ms = 0;
  for (unsigned flags = 0; flags < 4; ++flags)
    add(stream, content_of(Kind::kImu, flags, Duration{10ms} * ms++, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  ms += 3;
  add(stream, content_of(Kind::kImu, 3, Duration{10ms} * ms, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  add(stream, content_of(Kind::kImu, 3, Duration{10ms} * ms, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  add(stream, content_of(Kind::kImu, 3, Duration{10ms} * ms - Duration{1}, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  add(stream,
      content_of(Kind::kImu, 3, Duration{10ms} * ms + Duration{15ms}, {0.1, 0.2, 0.3, 1.0, 2.0, kNoNumber}));
  add(stream,
      content_of(Kind::kImu, 3, Duration{10ms} * ms + Duration{15ms}, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  add(stream,
      content_of(Kind::kImu, 3, Duration{10ms} * ms + Duration{30'100us}, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  for (unsigned flags = 0; flags < 64; flags += 3) {
    add(stream, content_of(Kind::kGnss, flags, Duration{10ms} * (10 + static_cast<int>(flags)),
                           {0.85, 0.04, 106.5, 0.01, 0.02, 0.03, 1.5, -0.5, 0.25, 0.1, 0.2, 0.3}));
  }
  for (const double lat : {1.5707, 1.571, -1.5707, -1.571}) {
    for (const double lon : {6.283, 6.284, -6.283, -6.284, 4.0})
      add(stream, content_of(Kind::kGnss, 0x34, 1s, {lat, lon, 1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
  }
  add(stream, content_of(Kind::kSpeed, 0, 1100ms, {13.5}));
  for (const double off : {0.25, -0.25, 0.5, -0.5, 0.51, -0.51})
    add(stream, content_of(Kind::kTimeReference, 0, 2s, {off, 1.7e9 + off}));
  for (const double second : {3.9e9, 4.0e9, -3.9e9, -4.1e9, 1.7})
    add(stream, content_of(Kind::kTimeReference, 0, 3s, {0.0, second}));
  for (const std::int64_t ns :
       {std::int64_t{3'999'999'999'999'999'999}, std::int64_t{4'000'000'000'000'000'000},
        std::int64_t{-4'000'000'000'000'000'000}}) {
    add(stream, content_of(Kind::kSpeed, 0, Duration{ns - kWholeBegin_ns}, {1.5}));
  }
  return stream;
}

TEST(RosMessageWhole, MessagesOfEveryKind) {
  std::string text;
  for (int which = 0; which < 3; ++which) {
    DecoderConfig config;
    config.device = 3;
    if (which > 0) config.period = 10ms;
    if (which == 1) config.times_are_utc = true, config.axes = {0, 1, 0, 0, 0, -1, -1, 0, 0};
    if (which == 2) config.clock = {};
    Decoder decoder(config);
    text +=
        test::decoded_text(decoder, stream_of_everything(), 300, host_time_from_ns(5'000'000'000'000), 5ms);
  }
  test::expect_recorded("drivers/ros_message/kinds.txt", text, test::kSampleShare);
}

TEST(RosMessageWhole, DamageAtEveryPlace) {
  Bytes stream;
  add(stream, content_of(Kind::kImu, 3, 0ms, {0.1, 0.2, 0.3, 1.0, 2.0, 9.8}));
  stream.push_back('x');
  add(stream, content_of(Kind::kSpeed, 0, 10ms, {13.5}));
  add(stream, content_of(Kind::kTimeReference, 0, 20ms, {0.1, 1.7e9}));
  const auto outcome = [](const Bytes& bytes) {
    Decoder decoder({});
    return test::outcome_text(decoder, bytes, {});
  };
  std::string text = test::at_every_place(
      stream.size(),
      [&](std::size_t at) {
        Bytes bytes = stream;
        bytes[at] ^= 0x05U;
        return bytes;
      },
      outcome);
  text += test::at_every_place(
      stream.size(),
      [&](std::size_t at) { return Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at)); },
      outcome);
  text += "head " + test::hex_text(std::span(stream).first(kHeadBytes)) + '\n';
  test::expect_recorded("drivers/ros_message/damage.txt", text);
}

}  // namespace
}  // namespace imuscope::ros_message
