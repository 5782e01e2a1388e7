// Everything that comes out of rich streams, held as it once was.
#include <gtest/gtest.h>

#include "drivers/ixblue_stdbin/decoder.h"
#include "drivers/ixblue_stdbin/session.h"
#include "tests/drivers/ixblue_stdbin/telegram_builder.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::ixblue_stdbin {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr HostTime kWholeBegin = host_time_from_ns(5'000'000'000'000);
constexpr std::uint32_t kDay = 864'000'000;

DecoderConfig whole_config() {
  DecoderConfig config;
  config.device = 4;
  config.per_byte = byte_time(115'200.0);
  return config;
}

/// What a telegram holds beside its head.
struct Content {
  std::optional<std::array<float, 3>> attitude{{10.0F, 2.0F, 3.0F}};
  std::optional<std::array<float, 3>> attitude_sd{{0.1F, 0.02F, 0.03F}};
  std::optional<std::array<float, 3>> rate{{1.0F, 2.0F, 3.0F}};
  std::optional<std::array<float, 3>> acceleration{{0.1F, 0.2F, 9.8F}};
  std::optional<std::array<float, 3>> rate_change;
  std::optional<Bytes> date = TelegramBuilder::date(14, 3, 2026);
  std::optional<std::uint32_t> user_status = 1U << 8U;
};

Bytes triple(const std::array<float, 3>& v) { return TelegramBuilder::floats({v[0], v[1], v[2]}); }

Bytes telegram(std::uint32_t counter, std::uint32_t ticks, const Content& content, std::uint8_t version = 5) {
  TelegramBuilder builder(version, counter, ticks);
  if (content.attitude) builder.nav(0, triple(*content.attitude));
  if (content.attitude_sd) builder.nav(1, triple(*content.attitude_sd));
  if (content.date) builder.nav(13, *content.date);
  if (content.user_status) builder.nav(17, TelegramBuilder::word(*content.user_status));
  if (content.acceleration) builder.nav(28, triple(*content.acceleration));
  if (content.rate_change) builder.extended(0, triple(*content.rate_change));
  if (content.rate) builder.extended(2, triple(*content.rate));
  return builder.build();
}

/// Values that change, so that nothing looks frozen.
Content moving(int i) {
  Content content;
  const auto x = 0.01F * static_cast<float>(i % 97);
  content.rate = {{1.0F + x, 2.0F - x, 3.0F}};
  content.acceleration = {{0.1F - x, 0.2F, 9.8F + x}};
  content.attitude = {{10.0F + x, 2.0F, 3.0F - x}};
  return content;
}

struct Stream {
  explicit Stream(const DecoderConfig& config) : decoder(config) {}
  void push(const Bytes& bytes) {
    decoder.push(bytes, {now, now - 300us}, sink);
    now += 10ms;
    if (decoder.remark() != remark) text += "remark " + std::string(decoder.remark()) + '\n';
    remark = decoder.remark();
    for (; told < sink.samples.size(); ++told) text += sample_text(sink.samples[told]) + '\n';
  }
  std::string whole() {
    decoder.finish(now, sink);
    return text + counts_text(decoder.counters()) + " drift " + real_text(decoder.clock_drift_ppm()) + '\n';
  }
  Decoder decoder;
  CollectingSink sink;
  HostTime now = kWholeBegin;
  std::string text;
  std::string remark;
  std::size_t told = 0;
};

TEST(StdbinWhole, CountersThatSkipRepeatAndRestart) {
  Stream stream(whole_config());
  std::uint32_t ticks = 500'000;
  int i = 0;
  for (const std::uint32_t counter :
       {100U,           101U,           103U,           103U,     102U,     104U,    90U, 105U,
        4'294'967'290U, 4'294'967'291U, 4'294'967'295U, 2U,       1U,       0U,      1U,  2U,
        400'000U,       400'001U,       400'017U,       400'001U, 400'000U, 400'018U}) {
    stream.push(telegram(counter, ticks += 100, moving(i++)));
  }
  // A restart: counts from 0 at another time of day.
  ticks = 900;
  for (std::uint32_t counter = 400'010; counter < 400'014; ++counter)
    stream.push(telegram(counter, ticks += 100, moving(i++)));
  stream.push(telegram(760'013, ticks += 100, moving(i++)));
  stream.push(telegram(1'120'014, ticks += 100, moving(i++)));
  expect_recorded("drivers/ixblue_stdbin/counters.txt", stream.whole(), kSampleShare);
}

TEST(StdbinWhole, BlocksOfEveryKind) {
  std::string text;
  for (const bool turned : {false, true}) {
    DecoderConfig config = whole_config();
    if (turned) {
      config.axes = {0, 1, 0, 0, 0, -1, -1, 0, 0};
      config.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
    }
    Stream stream(config);
    std::uint32_t counter = 10;
    const auto push = [&](const std::function<void(Content&)>& change) {
      Content content = moving(static_cast<int>(counter));
      change(content);
      stream.push(telegram(counter, 100 * counter, content));
      ++counter;
    };
    push([](Content&) {});
    push([](Content& c) { c.rate_change = {{4.0F, 5.0F, 6.0F}}; });
    push([](Content& c) { c.rate.reset(); });
    push([](Content& c) { c.acceleration.reset(); });
    push([](Content& c) { c.rate = {{0, 0, 0}}; });
    push([](Content& c) { c.acceleration = {{0, 0, 0}}; });
    push([](Content& c) { c.acceleration = {{0, 0, 9.8F}}; });
    push([](Content& c) { c.rate = {{1.0F, std::numeric_limits<float>::quiet_NaN(), 2.0F}}; });
    push([](Content& c) { c.acceleration = {{1.0F, 2.0F, std::numeric_limits<float>::infinity()}}; });
    for (int axis = 0; axis < 3; ++axis)
      push([axis](Content& c) {
        c.attitude->at(static_cast<std::size_t>(axis)) = std::numeric_limits<float>::quiet_NaN();
      });
    push([](Content& c) { c.attitude.reset(); });
    push([](Content& c) { c.attitude_sd.reset(); });
    for (int axis = 0; axis < 3; ++axis)
      push([axis](Content& c) { c.attitude_sd->at(static_cast<std::size_t>(axis)) = -0.5F; });
    push([](Content& c) { c.attitude_sd = {{0.0F, 0.5F, 0.25F}}; });
    push([](Content& c) { c.attitude_sd = {{0.75F, 0.25F, 0.5F}}; });
    push([](Content& c) { c.attitude = {{-30.0F, 179.0F, -89.0F}}; });
    push([](Content& c) { c.attitude = {{359.5F, -120.0F, 60.0F}}; });
    push([](Content& c) { c.date.reset(); });
    push([](Content& c) { c.user_status.reset(); });
    for (unsigned bit = 0; bit < 32; ++bit) {
      push([bit](Content& c) {
        c.user_status = 1U << bit | 1U << 8U;
        c.rate.reset();
      });
    }
    push([](Content& c) { c.user_status = 0; });
    for (int i = 0; i < 12; ++i) {
      push([](Content& c) {
        c.rate = {{1.0F, 2.0F, 3.0F}};
        c.attitude.reset();
      });
    }
    for (int i = 0; i < 11; ++i) {
      push([](Content& c) {
        c.acceleration = {{1.0F, 2.0F, 3.0F}};
        c.attitude.reset();
      });
    }
    push([](Content&) {});
    text += stream.whole();
  }
  expect_recorded("drivers/ixblue_stdbin/blocks.txt", text, kSampleShare);
}

/// Pairs of time of day and date, one telegram after the other.
std::string dated(const std::vector<std::pair<std::uint32_t, std::optional<Bytes>>>& telegrams,
                  std::optional<std::uint32_t> status = 1U << 8U) {
  Stream stream(whole_config());
  std::uint32_t counter = 10;
  for (const auto& [ticks, date] : telegrams) {
    Content content = moving(static_cast<int>(counter));
    content.attitude.reset();
    content.date = date;
    content.user_status = status;
    stream.push(telegram(counter++, ticks, content));
  }
  std::string text;
  for (const Sample& sample : stream.sink.samples) {
    text += "t " + in_groups(to_ns(sample.time)) +
            (sample.has_utc ? " utc " + in_groups(to_ns(sample.utc)) : " no utc") + '\n';
  }
  return text + counts_text(stream.decoder.counters()) + "\n";
}

TEST(StdbinWhole, DatesAndMidnights) {
  const Bytes day = TelegramBuilder::date(30, 6, 2026);
  const Bytes next = TelegramBuilder::date(1, 7, 2026);
  const Bytes none = TelegramBuilder::date(0, 0, 0);
  std::string text;
  text += dated({{kDay - 200, day}, {kDay - 100, day}, {0, day}, {100, day}, {200, next}, {300, next}});
  text += dated({{kDay - 200, day}, {kDay - 100, next}, {0, next}, {100, next}});
  text += dated({{kDay - 200, day}, {kDay - 100, std::nullopt}, {0, std::nullopt}, {100, next}});
  text += dated({{kDay - 200, none}, {kDay - 100, day}, {0, none}, {100, none}});
  text += dated({{kDay - 100, day}, {kDay, day}, {kDay + 9'900, day}, {0, next}});
  text += dated({{kDay - 100, day}, {kDay + 9'999, day}, {kDay + 10'000, day}, {0, next}});
  text +=
      dated({{kDay - 5'000, day}, {kDay - 100, day}, {kDay - 5'000, day}, {kDay - 100, day}, {4'800, next}});
  text += dated({{kDay - 100, day}, {0, next}, {0, next}, {100, next}});
  text += dated({{500'000, day}, {400'000, day}, {400'100, day}, {400'200, std::nullopt}});
  // How near to midnight the date may be that of the day before.
  for (const std::uint32_t off : {5'999'900U, 6'000'000U, 6'000'100U}) {
    text += dated(
        {{kDay - off, day}, {kDay - off + 100, next}, {kDay - off + 200, TelegramBuilder::date(2, 7, 2026)}});
    text += dated({{off, next}, {off + 100, day}, {off + 200, TelegramBuilder::date(29, 6, 2026)}});
  }
  text += dated({{100, day}, {200, day}}, 0U);
  text += dated({{100, day}, {200, day}}, std::nullopt);
  text += dated(
      {{kDay / 2 + 100, day}, {100, day}, {kDay / 2 + 200, day}, {kDay - 1, day}, {kDay / 2 - 2, next}});
  expect_recorded("drivers/ixblue_stdbin/dates.txt", text, kSampleShare);
}

std::string whole_outcome(const Bytes& bytes) {
  DecoderConfig config = whole_config();
  config.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
  Decoder decoder(config);
  return outcome_text(decoder, bytes, kWholeBegin);
}

Bytes answer(const std::string& content) {
  Bytes bytes{'A', 'N', 3};
  const std::size_t total = 5 + content.size() + 4;
  bytes.push_back(static_cast<std::uint8_t>(total >> 8U));
  bytes.push_back(static_cast<std::uint8_t>(total));
  for (const char c : content) bytes.push_back(static_cast<std::uint8_t>(c));
  std::uint32_t sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(sum >> shift));
  return bytes;
}

TEST(StdbinWhole, DamageAtEveryPlace) {
  std::string text;
  for (const std::uint8_t version : Bytes{2, 3, 4, 5}) {
    Bytes stream = telegram(7, 5000, moving(1), version);
    for (const Bytes& more : {answer("$PIXSE,C*"), Bytes{'I', 'X'}, telegram(8, 5100, moving(2), version),
                              Bytes{'A', 'N', 4, 'I', 'X', 6}, telegram(9, 5200, moving(3), version)}) {
      stream.insert(stream.end(), more.begin(), more.end());
    }
    text += "V" + std::to_string(version) + '\n' +
            at_every_place(
                stream.size(),
                [&](std::size_t at) {
                  Bytes bytes = stream;
                  bytes[at] ^= 0x05U;
                  return bytes;
                },
                whole_outcome);
    if (version == 5) {
      text += "cuts\n" + at_every_place(
                             stream.size(),
                             [&](std::size_t at) {
                               return Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at));
                             },
                             whole_outcome);
    }
  }
  expect_recorded("drivers/ixblue_stdbin/damage.txt", text);
}

void put_sum(Bytes& bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 4 < bytes.size(); ++i) sum += bytes[i];
  for (std::size_t i = 0; i < 4; ++i)
    bytes[bytes.size() - 4 + i] = static_cast<std::uint8_t>(sum >> (24 - 8 * i));
}

/// Heads that are wrong under a right checksum.
TEST(StdbinWhole, AnotherByteAtEveryPlaceOfATelegram) {
  std::string text;
  const Bytes good = telegram(6, 4990, moving(0));
  for (const std::uint8_t version : Bytes{2, 5}) {
    const Bytes whole = telegram(7, 5000, moving(1), version);
    for (const std::uint8_t other : Bytes{0x00, 0x80, 0xFF}) {
      text += "V" + std::to_string(version) + " byte " + std::to_string(other) + '\n' +
              at_every_place(
                  whole.size() - 4,
                  [&](std::size_t at) {
                    Bytes bytes = whole;
                    bytes[at] = other;
                    put_sum(bytes);
                    bytes.insert(bytes.begin(), good.begin(), good.end());
                    return bytes;
                  },
                  whole_outcome);
    }
  }
  expect_recorded("drivers/ixblue_stdbin/other_bytes.txt", text);
}

/// Of bytes that follow a good telegram.
std::string frames_text(const Bytes& bytes) {
  Scanner scanner;
  std::string text;
  Frame frame;
  scanner.append(telegram(7, 5000, moving(1)), kWholeBegin);
  EXPECT_TRUE(scanner.next(frame));
  std::span<const std::uint8_t> rest(bytes);
  const auto drain = [&](bool at_end) {
    while (scanner.next(frame, at_end))
      text += " [" + std::to_string(static_cast<int>(frame.kind)) + ' ' + std::to_string(frame.bytes.size()) +
              ']';
  };
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, kWholeBegin));
    drain(false);
  }
  drain(true);
  const ScanCounters& c = scanner.counters();
  return text + " skipped " + std::to_string(c.bytes_skipped) + " checksums " +
         std::to_string(c.bad_checksums) + " lengths " + std::to_string(c.bad_lengths) + " V6 " +
         std::to_string(scanner.unsupported_versions()) + '\n';
}

TEST(StdbinWhole, SizesAndMasksThatContradictThemselves) {
  std::string text;
  for (const std::size_t size :
       {0U, 1U, 100U, 200U, 240U, 246U, 247U, 248U, 500U, 503U, 504U, 1000U, 1015U, 1016U, 1100U})
    text += "answer " + std::to_string(size) + frames_text(answer(std::string(size, 'x')));
  for (const std::uint8_t version : Bytes{2, 3, 4, 5}) {
    const std::size_t masks = version == 2 ? 2 : 3;
    for (std::size_t mask = 0; mask < masks; ++mask) {
      for (unsigned bit = 0; bit < 32; ++bit) {
        Bytes bytes = telegram(7, 5000, {}, version);
        bytes[3 + 4 * mask + 3 - bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        put_sum(bytes);
        text += std::to_string(version) + ' ' + std::to_string(mask) + ' ' + std::to_string(bit) +
                frames_text(bytes);
      }
    }
  }
  for (const std::uint8_t version : Bytes{0, 1, 6, 7})
    text += "version " + std::to_string(version) + frames_text(telegram(7, 5000, {}, version));
  // An unknown bit, with room for its block.
  for (const unsigned bit : {27U, 31U}) {
    for (const std::size_t room : {0U, 4U, 40U}) {
      TelegramBuilder builder(5, 7, 5000);
      builder.nav(0, TelegramBuilder::floats({1, 2, 3}))
          .extended(bit, Bytes(room, 1))
          .external(13, Bytes(8, 2));
      const Bytes bytes = builder.build();
      const Telegram parsed = parse_telegram(bytes);
      text += "unknown " + std::to_string(bit) + ' ' + std::to_string(room) +
              (parsed.rest_unread ? " unread" : "") + frames_text(bytes);
    }
  }
  expect_recorded("drivers/ixblue_stdbin/sizes.txt", text);
}

TEST(StdbinWhole, EveryFieldOfEveryVector) {
  std::string text;
  for (const auto& vector : load_vectors(source_path("tests/vectors/ixblue_stdbin.hex"))) {
    text += vector.name + ": " + whole_outcome(vector.bytes) + '\n';
    Scanner scanner;
    scanner.append(vector.bytes, kWholeBegin);
    Frame frame;
    while (scanner.next(frame, true)) {
      if (frame.kind != Frame::Kind::kTelegram) continue;
      const Telegram t = parse_telegram(frame.bytes);
      text += std::to_string(t.version) + ' ' + std::to_string(t.nav_mask) + ' ' +
              std::to_string(t.extended_mask) + ' ' + std::to_string(t.external_mask) + ' ' +
              std::to_string(t.nav_size.value_or(0)) + ' ' + std::to_string(t.total_size) + ' ' +
              std::to_string(t.validity_ticks) + ' ' + std::to_string(t.counter) + ' ' +
              std::to_string(t.checksum) + (t.rest_unread ? " unread" : "");
      for (const std::uint16_t at : t.nav_at) text += ' ' + std::to_string(at);
      for (const std::uint16_t at : t.extended_at) text += ' ' + std::to_string(at);
      for (const std::uint16_t at : t.external_at) text += ' ' + std::to_string(at);
      text += '\n';
    }
  }
  expect_recorded("drivers/ixblue_stdbin/vectors.txt", text);
}

TEST(StdbinWhole, WhatTheSessionTells) {
  const auto make = [] { return std::make_unique<Session>(); };
  std::string text = listening_text(make, telegram(7, 5000, {})) + listening_text(make, answer("a"));
  Session session;
  SessionDiary diary(session);
  for (int ms = 0; ms < 8000; ms += 10) {
    const HostTime now = host_time_from_ns(1'000'000LL * ms);
    if (ms % 100 == 0) session.on_bytes(telegram(7, 5000, {}, 6), now);
    diary.step(now);
  }
  expect_recorded("drivers/ixblue_stdbin/session.txt", text + diary.text());
}

}  // namespace
}  // namespace imuscope::ixblue_stdbin
