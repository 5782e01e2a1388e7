// Everything that comes out of rich streams, held as it once was.
#include <gtest/gtest.h>

#include "drivers/greis/decoder.h"
#include "drivers/greis/session.h"
#include "tests/drivers/greis/message_builder.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::greis {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr HostTime kWholeBegin = host_time_from_ns(5'000'000'000'000);
constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();

DecoderConfig whole_config(Duration period = 100ms) {
  DecoderConfig config;
  config.device = 4;
  config.period = period;
  config.per_byte = byte_time(115'200.0);
  return config;
}

Bytes gt(U32 tow_ms, U16 week) { return greis_message("GT", test::Body().put(tow_ms).put(week)); }
Bytes uo(std::int8_t leap_s) {
  test::Body body;
  for (int i = 0; i < 18; ++i) body.put(U8{0x11});
  return greis_message("UO", body.put(static_cast<U8>(leap_s)).put(U32{1}));
}
Bytes pv(const std::array<double, 3>& xyz_m, float psigma, const std::array<float, 3>& v_mps, float vsigma,
         U8 type) {
  return greis_message("PV", test::Body()
                                 .put(xyz_m[0])
                                 .put(xyz_m[1])
                                 .put(xyz_m[2])
                                 .put(psigma)
                                 .put(v_mps[0])
                                 .put(v_mps[1])
                                 .put(v_mps[2])
                                 .put(vsigma)
                                 .put(type));
}
const std::array<double, 3> kParis_m{4200952.125, 171262.0625, 4780236.75};

/// One read each, 100 ms apart.
std::string whole_text(const DecoderConfig& config, const std::vector<Bytes>& reads) {
  Decoder decoder(config);
  CollectingSink sink;
  HostTime now = kWholeBegin;
  for (const Bytes& read : reads) {
    decoder.push(read, {now, now - 300us}, sink);
    now += 100ms;
  }
  decoder.finish(now, sink);
  std::string text;
  for (const Sample& sample : sink.samples) text += sample_text(sample) + '\n';
  return text + counts_text(decoder.counters()) + " epochs " + std::to_string(decoder.epochs()) +
         " damaged " + std::to_string(decoder.epochs_damaged()) + '\n';
}

Bytes usual(U32 tod_ms) {
  return lines({rt(tod_ms), pg(0.85, 0.04, 106.5, 0.012F, 4), vg(1.5F, -0.5F, 0.25F, 0.02F, 4), et(tod_ms)});
}

TEST(GreisWhole, EpochsOfEveryKind) {
  std::vector<Bytes> reads{
      lines({rt(1000), gt(400'000'000, 361), st(900, 4), pg(0.85, 0.04, 106.5, 0.012F, 4),
             vg(1.5F, -0.5F, 0.25F, 0.02F, 3), et(1000)}),
      lines({rt(1100), pg(0.85, 0.04, 106.5, 0.012F, 3), vg(1.5F, -0.5F, 0.25F, 0.02F, 2),
             sg(0.01F, 0.02F, 0.03F, 0.04F, 4), et(1100)}),
      lines(
          {rt(1200), rd(2026, 3, 14, 0), po(kParis_m, 0.5F, 2), ve({1.25, -0.5, 0.125}, 0.25F, 1), et(1200)}),
      lines({rt(1300), gt(500'000'000, 362), pv(kParis_m, 0.75F, {1.5F, -2.5F, 0.5F}, 0.375F, 1), to(1e-4),
             et(1300)}),
      lines({rt(1400), rd(2026, 3, 14, 1), pg(0.85, 0.04, 106.5, 0.012F, 5), vg(1.5F, -0.5F, 0.25F, 0.02F, 0),
             et(1400)}),
      lines({rt(1500), rd(2026, 3, 14, 2), pg(0.85, 0.04, 106.5, 0.0F, 4),
             vg(1.5F, kNoNumber, 0.25F, 0.02F, 4), to(0.49), et(1500)}),
      lines({rt(1600), rd(2026, 3, 14, 3), pg(kNoNumber, 0.04, 106.5, 0.5F, 4),
             vg(1.5F, 0.5F, 0.25F, 0.0F, 4), to(-0.51), et(1600)}),
      lines({rt(1700), rd(2026, 3, 14, 4), uo(37), po(kParis_m, 0.5F, 4),
             sg(0.01F, 0.0F, 0.03F, kNoNumber, 4), et(1700)}),
      lines({rt(1800), rd(2026, 2, 30, 0), ve({1.25, -0.5, 0.125}, 0.25F, 4), sg(0.0F, 0.1F, 0.03F, 0.4F, 4),
             et(1800)}),
      lines({rt(1900), rd(2026, 3, 15, 0), pg(0.85, 0.04, 106.5, 0.012F, 4), st(86'399'900, 4), et(1900)}),
      lines({rt(2000), pg(0.85, 0.04, 106.5, 0.012F, 4), st(2001, 4), et(2000)}),
      usual(2000),
      usual(2250),
      usual(2450),
      lines({rt(2550), pg(0.85, 0.04, 106.5, 0.012F, 4), et(2551)}),
      lines({rt(2650), pg(0.85, 0.04, 106.5, 0.012F, 4)}),
      usual(2750),
      lines({rt(86'400'000), pg(0.85, 0.04, 106.5, 0.012F, 4), et(86'400'000)}),
      lines({rt(2850), greis_message("~X", test::Body().put(U8{1})), pg(0.85, 0.04, 106.5, 0.012F, 4),
             et(2850)}),
      lines({rt(2950), greis_message("X~", test::Body().put(U8{1})), pg(0.85, 0.04, 106.5, 0.012F, 4),
             et(2950)}),
      lines({rt(3050), greis_message("XY", test::Body().put(U8{1})), pg(0.85, 0.04, 106.5, 0.012F, 4),
             et(3050)}),
      lines({et(3050), pg(0.85, 0.04, 106.5, 0.012F, 4)}),
      usual(2000),
      lines({rt(43'300'000), pg(0.85, 0.04, 106.5, 0.012F, 4)})};
  std::string text;
  for (const Duration period : {Duration{100ms}, Duration{50ms}, Duration{}})
    text += whole_text(whole_config(period), reads);
  DecoderConfig fixed = whole_config();
  fixed.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
  text += whole_text(fixed, reads);
  expect_recorded("drivers/greis/epochs.txt", text, kSampleShare);
}

TEST(GreisWhole, StreamsWithoutAnEndOfEpochMidnightsAndWeeks) {
  std::string text;
  std::vector<Bytes> open;
  for (const U32 tod_ms : {86'399'800U, 86'399'900U, 0U, 100U}) {
    open.push_back(lines({rt(tod_ms), gt(tod_ms % 604'800'000U, 361), pg(0.85, 0.04, 106.5, 0.012F, 4)}));
  }
  text += whole_text(whole_config(), open);
  for (const U16 week :
       {U16{0}, U16{905}, U16{906}, U16{907}, U16{1023}, U16{1024}, U16{1929}, U16{1930}, U16{2400}}) {
    text += whole_text(whole_config(),
                       {lines({rt(1000), gt(1000, week), pg(0.85, 0.04, 106.5, 0.012F, 4), et(1000)})});
  }
  for (const auto& [tod_ms, solution_ms] : std::vector<std::pair<U32, U32>>{
           {60'500, 500}, {60'500, 499}, {500, 86'340'500}, {500, 86'340'499}, {500, 500}}) {
    text += whole_text(whole_config(), {lines({rt(tod_ms), rd(2026, 12, 31, 1), st(solution_ms, 4),
                                               pg(0.85, 0.04, 106.5, 0.012F, 4), et(tod_ms)})});
  }
  for (const double offset_s : {0.4999, 0.5, -0.4999, -0.5}) {
    text += whole_text(
        whole_config(),
        {lines({rt(1000), rd(2026, 12, 31, 1), pg(0.85, 0.04, 106.5, 0.012F, 4), to(offset_s), et(1000)})});
  }
  for (const U32 tod_ms : {43'200'999U, 43'201'000U, 43'201'001U}) {
    text += whole_text(whole_config(), {usual(1000), usual(tod_ms)});
  }
  expect_recorded("drivers/greis/midnights.txt", text, kSampleShare);
}

std::string whole_outcome(const Bytes& bytes) {
  DecoderConfig config = whole_config();
  config.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
  Decoder decoder(config);
  return outcome_text(decoder, bytes, kWholeBegin);
}

Bytes text_message(std::string_view id, const std::string& body) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  Bytes bytes = bytes_of(id);
  for (const unsigned shift : {8U, 4U, 0U})
    bytes.push_back(static_cast<U8>(kHex[body.size() >> shift & 0xFU]));
  const Bytes text = bytes_of(body);
  bytes.insert(bytes.end(), text.begin(), text.end());
  return bytes;
}

Bytes damaged_greis() {
  Bytes crc = greis_message("XX", test::Body().put(U8{1}).put(U8{2}));
  return lines({rt(1000), rd(2026, 3, 14, 1), pg(0.85, 0.04, 106.5, 0.012F, 4),
                vg(1.5F, -0.5F, 0.25F, 0.02F, 4), sg(0.01F, 0.02F, 0.03F, 0.04F, 4), et(1000),
                bytes_of("$GPZDA,1*60"), text_message("RE", "%1%\n"), crc, rt(1100), po(kParis_m, 0.5F, 2),
                ve({1.25, -0.5, 0.125}, 0.25F, 1), uo(18), et(1100)});
}

TEST(GreisWhole, DamageAtEveryPlace) {
  const Bytes stream = damaged_greis();
  std::string text = at_every_place(
      stream.size(),
      [&](std::size_t at) {
        Bytes bytes = stream;
        bytes[at] ^= 0x11U;
        return bytes;
      },
      whole_outcome);
  text += "cuts\n" + at_every_place(
                         stream.size(),
                         [&](std::size_t at) {
                           return Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at));
                         },
                         whole_outcome);
  expect_recorded("drivers/greis/damage.txt", text);
}

/// Of bytes that follow a good message.
std::string frames_text(const Bytes& bytes) {
  Scanner scanner;
  std::string text;
  Frame frame;
  scanner.append(et(0), kWholeBegin);
  EXPECT_TRUE(scanner.next(frame));
  std::span<const std::uint8_t> rest(bytes);
  const auto drain = [&](bool at_end) {
    while (scanner.next(frame, at_end)) {
      text += " [" + std::to_string(static_cast<int>(frame.kind)) + ' ' + std::to_string(frame.id) + " at " +
              std::to_string(frame.offset) + ' ' + std::to_string(frame.bytes.size()) + '/' +
              std::to_string(frame.body.size()) + ']';
    }
  };
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, kWholeBegin));
    drain(false);
  }
  drain(true);
  const ScanCounters& c = scanner.counters();
  return text + " skipped " + std::to_string(c.bytes_skipped) + " checksums " +
         std::to_string(c.bad_checksums) + " lengths " + std::to_string(c.bad_lengths) + '\n';
}

Bytes with_crc(std::string_view id, Bytes body) {
  body.insert(body.end(), {0, 0});
  Bytes message = text_message(id, std::string(body.begin(), body.end()));
  const auto crc = crc16(std::span(message).first(message.size() - 2));
  message[message.size() - 2] = static_cast<U8>(crc & 0xFFU);
  message[message.size() - 1] = static_cast<U8>(crc >> 8U);
  return message;
}

/// Every kind of message in every length about its own.
TEST(GreisWhole, MessagesOfEveryLengthAndChecksum) {
  std::string text;
  for (const char* id : {"~~", "::", "RD", "ST", "GT", "TO", "UO", "PO", "PG", "PV", "VE", "VG", "SG", "DP",
                         "SP", "SV", "XX"}) {
    std::string before;
    for (std::size_t size = 0; size < 90; ++size) {
      test::Body body;
      body.bytes.assign(size, 0x21);
      const std::string now = frames_text(greis_message(id, body)).substr(0, 9);
      if (now != before) text += std::string(id) + ' ' + std::to_string(size) + ':' + now + '\n';
      before = now;
    }
  }
  for (const char* id : {"JP", "RE", "ER", "MF", "PM"}) {
    for (const std::string body : {"", "a", "%1%\r\n", "\x01 a", "tab\t", "with a checksum 00"})
      text += id + frames_text(text_message(id, body));
    Bytes message = text_message(id, "some text--");
    const unsigned sum = checksum(std::span(message).first(message.size() - 2));
    constexpr std::string_view kHex = "0123456789ABCDEF";
    message[message.size() - 2] = static_cast<U8>(kHex[sum >> 4U]);
    message[message.size() - 1] = static_cast<U8>(kHex[sum & 0xFU]);
    text += "good " + std::string(id) + frames_text(message);
    message[message.size() - 1] = 'a';
    text += "bad " + std::string(id) + frames_text(message);
  }
  for (const char* id : {"rE", "rM", "rV", "rX"}) {
    for (const std::size_t size : {0U, 1U, 2U, 9U}) text += id + frames_text(with_crc(id, Bytes(size, 0x33)));
    text += id + frames_text(text_message(id, "a"));
  }
  for (const std::size_t size : {1U, 254U, 255U, 256U, 257U, 300U})
    text += "text" + frames_text(bytes_of('#' + std::string(size, 'x') + '\n'));
  for (const char* bytes : {"", "~", "~~0", "~ 005", "~~00a", "~~G05", "~~000", "!", "/abc\r", "0~", "/a\x01",
                            "\x1f\x7f", "AB001", "AB001x", "zZ0030"})
    text += std::string(bytes) + frames_text(bytes_of(bytes));
  // Sums of every length about whole words.
  for (std::size_t size = 1; size < 40; ++size) {
    Bytes bytes(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<U8>(37 * i + 11);
    text += std::to_string(size) + ' ' + std::to_string(checksum(bytes)) + ' ' +
            std::to_string(crc16(bytes)) + '\n';
  }
  expect_recorded("drivers/greis/lengths.txt", text);
}

std::string named_text(const Bytes& bytes) {
  Scanner scanner;
  scanner.append(bytes, kWholeBegin);
  Frame frame;
  std::string text;
  while (scanner.next(frame, true)) {
    if (frame.kind != Frame::Kind::kMessage) continue;
    text += std::to_string(frame.id);
    for_each_field(frame.id, frame.body, [&](const NamedValue& value) {
      text += ' ' + std::string(value.name) + (value.is_integer ? "#" : "=") + real_text(value.number);
    });
    text += '\n';
  }
  return text;
}

TEST(GreisWhole, EveryFieldOfEveryVector) {
  std::string text;
  for (const auto& vector : load_vectors(source_path("tests/vectors/greis.hex"))) {
    text += vector.name + ": " + whole_outcome(vector.bytes) + '\n' + named_text(vector.bytes);
  }
  // Fields that are all different.
  for (const char* id :
       {"~~", "RD", "ST", "GT", "TO", "UO", "PO", "PG", "PV", "VE", "VG", "SG", "DP", "SP", "SV"}) {
    test::Body body;
    for (std::size_t i = 0; i + 1 < body_min(id_of(id[0], id[1])) + (id[0] == 'D' ? 4 : 0); ++i)
      body.put(static_cast<U8>(61 + i % 7));
    text += std::string(id) + ' ' + named_text(greis_message(id, body));
  }
  expect_recorded("drivers/greis/fields.txt", text);
}

// ------------------------------------------------------------------------------------------------ session

/// What a receiver does with a command: its number to the answer.
using Answers = std::function<Bytes(int number, int times)>;

std::string talk(const SessionConfig& config, const Answers& answers,
                 const std::function<Bytes(int ms)>& sends, int until_ms) {
  Session session(config);
  SessionDiary diary(session);
  std::array<int, 3> times{};
  for (int ms = 0; ms < until_ms; ms += 10) {
    const HostTime now = host_time_from_ns(1'000'000LL * (ms + 5000));
    const Bytes said = diary.step(now);
    if (said.size() > 2) {
      const int number = said[1] - '0';
      const Bytes answer = answers(number, ++times.at(static_cast<std::size_t>(number)));
      if (!answer.empty()) session.on_bytes(answer, now + 2ms);
    }
    const Bytes sent = sends(ms);
    if (!sent.empty()) session.on_bytes(sent, now + 5ms);
  }
  return diary.text();
}

Bytes accepts(int number, int) { return text_message("RE", '%' + std::to_string(number) + "%\n"); }
Bytes nothing(int) { return {}; }
Bytes never(int, int) { return {}; }
std::function<Bytes(int)> epochs_until(int until_ms, int every_ms = 100) {
  return [=](int ms) {
    return ms % every_ms == 0 && ms > 100 && ms < until_ms ? usual(static_cast<U32>(ms)) : Bytes{};
  };
}

TEST(GreisWhole, Conversations) {
  std::string text;
  const auto add = [&](const std::string& name, const SessionConfig& config, const Answers& answers,
                       const std::function<Bytes(int)>& sends, int until_ms) {
    text += "-- " + name + '\n' + talk(config, answers, sends, until_ms);
  };
  for (const Duration period : {Duration{50ms}, Duration{99ms}, Duration{100ms}, Duration{101ms},
                                Duration{1005ms}, Duration{1050ms}, Duration{10s}}) {
    add("period", {.period = period, .send_commands = true}, accepts, nothing, 100);
  }
  add("good", {}, accepts, epochs_until(9000), 9000);
  add("good, then silent", {}, accepts, epochs_until(2000), 14'000);
  add(
      "good, then noise", {}, accepts,
      [](int ms) { return ms > 2000 ? (ms % 100 == 0 ? Bytes(7, 0x81) : Bytes{}) : epochs_until(2000)(ms); },
      14'000);
  add("slow", {.period = 1s, .send_commands = true}, accepts, epochs_until(3500, 1000), 30'000);
  add("no answer", {}, never, nothing, 16'000);
  add("no answer, epochs come", {}, never, epochs_until(8000), 8000);
  add(
      "noise alone", {}, never, [](int ms) { return ms % 100 == 0 ? Bytes(7, 0x81) : Bytes{}; }, 14'000);
  add(
      "messages without an epoch", {}, accepts,
      [](int ms) { return ms % 100 == 0 ? lines({st(1, 1)}) : Bytes{}; }, 14'000);
  add(
      "epochs without a position", {}, accepts,
      [](int ms) {
        return ms % 100 == 0 ? lines({rt(1), et(1)}) : Bytes{};
      },
      14'000);
  for (const auto& position :
       {pg(0.85, 0.04, 1, 1, 4), po(kParis_m, 1, 4), pv(kParis_m, 1, {1, 2, 3}, 1, 4)}) {
    add(
        "positions", {}, accepts,
        [&](int ms) {
          return ms % 100 == 0 ? lines({rt(1), position}) : Bytes{};
        },
        2000);
  }
  add("only listens", {.period = 100ms, .send_commands = false}, never, epochs_until(2000), 9000);
  add("only listens to nothing", {.period = 100ms, .send_commands = false}, never, nothing, 12'000);
  for (const int refused : {0, 1, 2}) {
    add(
        "refused", {},
        [refused](int number, int times) {
          return number == refused ? text_message("ER", '%' + std::to_string(number) + "%{2,wrong}\r\n")
                                   : accepts(number, times);
        },
        epochs_until(2500), 10'000);
  }
  add(
      "refused with a long word", {},
      [](int number, int times) {
        return number == 2 ? text_message("ER", "%2%" + std::string(200, 'w')) : accepts(number, times);
      },
      epochs_until(800), 1000);
  add(
      "hears at the third try", {},
      [](int number, int times) { return times < 3 ? Bytes{} : accepts(number, times); }, epochs_until(6000),
      6000);
  add(
      "answers another number", {}, [](int number, int times) { return accepts(number + 1, times); }, nothing,
      6000);
  add(
      "answers without a number", {}, [](int, int) { return text_message("RE", "ok\n"); }, nothing, 3000);
  add(
      "a message cut off before the answers", {}, accepts,
      [](int ms) {
        const Bytes whole = pg(0.85, 0.04, 106.5, 0.5F, 4);
        return ms == 0 ? Bytes(whole.begin(), whole.begin() + 9) : epochs_until(3000)(ms);
      },
      3000);
  expect_recorded("drivers/greis/conversations.txt", text);
}

}  // namespace
}  // namespace imuscope::greis
