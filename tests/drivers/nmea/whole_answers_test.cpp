// Everything that comes out of rich streams of sentences, held as it once was.
#include <gtest/gtest.h>

#include "drivers/nmea/decoder.h"
#include "drivers/nmea/session.h"
#include "tests/drivers/nmea/sentence_builder.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::nmea {
namespace {

using test::bytes_of;
using test::expect_recorded;
using test::sentence;
using namespace std::chrono_literals;

constexpr HostTime kBegin = host_time_from_ns(5'000'000'000'000);

std::string gga(const std::string& time, int quality, const std::string& separation = "46.250,M",
                const std::string& altitude = "35.250,M") {
  return sentence("GNGGA," + time + ",4851.39684,N,00221.13314,W," + std::to_string(quality) + ",18,0.7," +
                  altitude + "," + separation + ",1.0,0123");
}
std::string rmc(const std::string& time, const std::string& motion, const std::string& date,
                char valid = 'A') {
  return sentence("GNRMC," + time + "," + valid + ",4851.39684,N,00221.13314,W," + motion + "," + date +
                  ",,,R,V");
}
std::string gst(const std::string& time, const std::string& sd) {
  return sentence("GNGST," + time + ",0.8,0.014,0.011,45.0," + sd);
}

/// One read each, 100 ms apart.
std::string played(const DecoderConfig& config, const std::vector<std::string>& reads) {
  Decoder decoder(config);
  test::CollectingSink sink;
  HostTime now = kBegin;
  std::string text;
  for (const std::string& read : reads) {
    decoder.push(bytes_of(read), {now, now - 300us}, sink);
    now += 100ms;
    if (!decoder.remark().empty() && text.find(decoder.remark()) == std::string::npos)
      text += std::string(decoder.remark()) + '\n';
  }
  decoder.finish(now, sink);
  for (const Sample& sample : sink.samples) text += test::sample_text(sample) + '\n';
  return text + test::counts_text(decoder.counters()) + '\n';
}

DecoderConfig config_of(Duration period) {
  DecoderConfig config;
  config.device = 4;
  config.period = period;
  config.per_byte = byte_time(38'400.0);
  return config;
}

TEST(NmeaWhole, EpochsOfEveryKind) {
  const std::vector<std::string> reads{
      gga("235958.00", 4) + rmc("235958.00", "2.617,338.17", "140326") +
          gst("235958.00", "0.012,0.013,0.020"),
      gga("235958.10", 5) + rmc("235958.10", "2.617,38.17", "140326") + gst("235958.10", "0.112,0.113,0.120"),
      gga("235958.20", 2) + rmc("235958.20", "0.5,", "140326") + gst("235958.20", "0.0,0.113,0.120"),
      gga("235958.50", 1) + rmc("235958.50", "0.6,", "140326") + gst("235958.50", "0.1,0.113,"),
      gga("235958.90", 3) + rmc("235958.90", ",20.0", "140326") + gst("235958.90", "0.1,0.0,0.2"),
      gga("235959.00", 6) + rmc("235959.00", "1.5,20.0", "140326") + gst("235959.00", "0.1,0.1,0.0"),
      gga("000000.00", 0) + rmc("000000.00", "1.5,20.0", "150326"),
      gga("000000.10", 7) + gga("000000.20", 8) + rmc("000000.20", "1.5,20.0", "150326", 'V'),
      sentence("GNVTG,120.5,T,,M,3.5,N,6.5,K,A") + gga("000000.30", 4),
      gga("000000.40", 4) + sentence("GNVTG,120.5,T,,M,3.5,N,6.5,K,A"),
      gga("000000.50", 4, ",M") + rmc("000000.50", "1.5,20.0", "150326"),
      gga("000000.60", 4, "46.250,M", ",M") + rmc("000000.60", "1.5,20.0", "150326"),
      sentence("GNZDA,000000.70,16,03,2026,01,30") + gga("000000.70", 4),
      sentence("GNZDA,000000.80,31,02,2026,01,30") + gga("000000.80", 4),
      sentence("GNZDA,000000.90,-1,02,2026,01,30") + gga("000000.90", 4),
      sentence("GNHDT,123.4,T") + gga("", 4) + gga("000001.00", 4),
      rmc("000001.20", "1.5,20.0", ""),
      gga("000001.40", 4),
      gga("000001.40", 4)};
  std::string text;
  for (const Duration period : {Duration{100ms}, Duration{}}) text += played(config_of(period), reads);
  DecoderConfig fixed = config_of(50ms);
  fixed.clock = ClockMapConfig::fixed(kBegin, 1.0);
  fixed.geoid_separation_m = 12.5;
  fixed.horizontal_velocity_sd_mps = 0.25;
  fixed.vertical_velocity_sd_mps = 3.5;
  text += played(fixed, reads);
  expect_recorded("drivers/nmea/epochs.txt", text, test::kSampleShare);
}

TEST(NmeaWhole, MidnightAndLeapSeconds) {
  std::string text;
  for (const auto& times :
       std::vector<std::vector<std::string>>{{"235959.00", "235960.00", "000000.00", "000001.00"},
                                             {"235958.50", "235959.50", "235959.50", "000000.50"},
                                             {"235959.00", "000000.00", "000000.00", "000001.00"},
                                             {"235959.50", "235959.00", "000000.00"},
                                             {"120001.00", "120000.50", "120002.00"},
                                             {"000002.00", "000001.50", "000003.00"},
                                             {"000001.90", "000001.50", "000003.00"},
                                             {"235957.90", "235957.80", "000003.00"},
                                             {"235958.10", "235958.05", "000003.00"},
                                             {"000000.00", "120000.00", "000000.00", "115959.00"}}) {
    std::vector<std::string> reads;
    for (const std::string& time : times)
      reads.push_back(gga(time, 4) + rmc(time, "1.0,2.0", reads.empty() ? "300626" : ""));
    text += played(config_of(1s), reads);
  }
  expect_recorded("drivers/nmea/midnight.txt", text, test::kSampleShare);
}

std::string outcome(const test::Bytes& bytes, bool checksum_required = true) {
  DecoderConfig config = config_of(100ms);
  config.checksum_required = checksum_required;
  config.clock = ClockMapConfig::fixed(kBegin, 1.0);
  Decoder decoder(config);
  return test::outcome_text(decoder, bytes, kBegin);
}

std::string two_epochs() {
  return gga("123456.10", 4) + rmc("123456.10", "2.617,338.17", "140326") + "!AB\r\n" +
         gst("123456.10", "0.012,0.013,0.020") + gga("123456.20", 4) + gst("123456.20", "0.012,0.013,0.020");
}

TEST(NmeaWhole, AFlippedBitAndACutAtEveryPlace) {
  const test::Bytes stream = bytes_of(two_epochs());
  std::string text;
  for (const bool required : {true, false}) {
    text += test::at_every_place(
        stream.size(),
        [&](std::size_t at) {
          test::Bytes bytes = stream;
          bytes[at] ^= 0x04U;
          return bytes;
        },
        [&](const test::Bytes& bytes) { return outcome(bytes, required); });
  }
  text += test::at_every_place(
      stream.size(),
      [&](std::size_t at) {
        return test::Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at));
      },
      [](const test::Bytes& bytes) { return outcome(bytes); });
  expect_recorded("drivers/nmea/damage.txt", text);
}

/// Contents that are wrong under a right checksum.
TEST(NmeaWhole, AnotherCharacterAtEveryPlaceOfTheSentences) {
  std::string text;
  const std::string first = "GNGGA,123456.10,4851.39684,N,00221.13314,E,4,18,0.7,35.250,M,46.250,M,1.0,0123";
  const std::string second = "GNRMC,123456.10,A,4851.39684,N,00221.13314,E,2.617,338.17,140326,,,R,V";
  for (const char other : {'7', '.', ',', '-', 'S'}) {
    text += std::string("with ") + other + '\n';
    text += test::at_every_place(
        first.size() + second.size(),
        [&](std::size_t at) {
          std::string a = first;
          std::string b = second;
          (at < a.size() ? a[at] : b[at - a.size()]) = other;
          return bytes_of(sentence(a) + sentence(b));
        },
        [](const test::Bytes& bytes) { return outcome(bytes); });
  }
  expect_recorded("drivers/nmea/other_characters.txt", text);
}

std::string fields_text(const std::string& content) {
  const std::string whole = sentence(content);
  const Fields fields(std::string_view(whole).substr(0, whole.size() - 2));
  std::string text = content + ": " + std::string(fields.address()) + " '" + std::string(fields.type()) + "'";
  for_each_field(fields, [&](const NamedValue& value) {
    text +=
        ' ' + std::string(value.name) + '=' +
        (value.kind == NamedValue::Kind::kText ? std::string(value.text) : test::real_text(value.number)) +
        '/' + std::to_string(static_cast<int>(value.kind));
  });
  return text + '\n';
}

TEST(NmeaWhole, FieldsOfEverySentence) {
  std::string text;
  for (const char* content :
       {"GNGGA,123456.10,4851.39684,N,00221.13314,E,4,18,0.7,35.250,M,46.250,M,1.0,0123",
        "GNGGA,,,,,,0,,,,M,,M,,",
        "GPRMC,235960.9994,A,4851.39684,S,00221.13314,W,2.617,338.17,311299,,,R,V",
        "GPRMC,235960.9996,V,,,,,,,010180,,,N",
        "GPRMC,120000,A,,,,,,,010179,,,N",
        "GPVTG,338.17,T,,M,2.617,N,4.847,K,D",
        "GPGST,123456.10,0.8,0.014,0.011,45.0,0.012,0.013,0.020",
        "GPZDA,123456.10,14,03,2026,-01,30",
        "GPZDA,123456.10,,03,2026,00,00",
        "HEHDT,001.5,T",
        "PASHR,123456.100,338.17,T,-1.25,2.5,0.75,0.1,0.2,0.3,2,1",
        "PASHR",
        "PIXSE,ATITUD,-1.234,0.567",
        "PIXSE,POSITI,48.5,2.25,81.5",
        "PIXSE,SPEED_,1.5,-2.5,0.25",
        "PIXSE,HEAVE_,0.1,0.2,0.3",
        "PIXSE,STDHRP,0.1,0.2,0.3",
        "PIXSE,STDPOS,1,2,3",
        "PIXSE,TIME__,123456.100000",
        "PIXSE,TIME__,123456.12345678901234567890",
        "PIXSE,TIME__,243456.1",
        "PIXSE,ALGSTS,0000a001,80000000",
        "PIXSE,STATUS,12G,00000010",
        "PIXSE,HT_STS,ffffffff",
        "PIXSE,STDSPD,1,2,3",
        "PIXSE",
        "PGRME,1,2",
        "ABCD,1",
        "GNXYZ,1,2,3",
        "GPGGA"}) {
    text += fields_text(content);
  }
  for (const char* time : {"235959.99", "240000", "236000", "235961", "235960.999", "12345", "123456",
                           "1a3456", "12a456", "123a56", "-23456", "12345.", "000000"}) {
    text += fields_text(std::string("GPGST,") + time + ",1");
  }
  for (const char* place : {"4851.5,N,00221.5,E", "4851.5,S,00221.5,W", "4851.5,E,00221.5,N",
                            "4851.5,X,00221.5,NE", "51.5,N,221.5,E", "051.5,N,1221,E", "4860.0,N,00259.999,E",
                            "-4851.5,N,00221.-5,E", "4851,N,221,E", ".5,N,5,E", "9000.0,N,18000.0,E"}) {
    text += fields_text(std::string("GPGGA,123456,") + place + ",1");
  }
  for (const char* date :
       {"140326", "010180", "311279", "14032", "1403260", "a40326", "14a326", "1403a6", "999999"}) {
    text += fields_text(std::string("GPRMC,123456,A,,,,,,,") + date + ",,,N");
  }
  std::string many = "GPGST";
  for (int i = 0; i < 60; ++i) {
    many += ',' + std::to_string(i);
    if (i > 35) {
      const std::string whole = sentence(many);
      const Fields fields(std::string_view(whole).substr(0, whole.size() - 2));
      text += std::to_string(i);
      for (const std::size_t at : {0U, 7U, 37U, 38U, 39U, 40U, 41U, 59U})
        text += " '" + std::string(fields.at(at)) + '\'';
      text += '\n';
    }
  }
  expect_recorded("drivers/nmea/fields.txt", text);
}

TEST(NmeaWhole, SentencesOfEveryLength) {
  std::string text;
  for (const std::size_t size : {1U, 2U, 3U, 4U, 5U, 80U, 100U, 500U, 1000U, 1010U, 1015U, 1020U, 1021U,
                                 1022U, 1023U, 1024U, 1025U, 1030U, 2000U}) {
    const std::string whole = sentence(std::string(size, 'A'));
    text += std::to_string(size) + ": " + outcome(bytes_of(whole + gga("123456.10", 4))) + '\n';
    text += outcome(bytes_of('$' + std::string(size, 'A') + "\r\n" + gga("123456.10", 4)), false) + '\n';
  }
  for (std::size_t size = kSentenceMax - 6; size < kSentenceMax + 3; ++size) {
    text += std::to_string(size) + ": " + outcome(bytes_of(sentence(std::string(size, 'A')))) + '\n';
  }
  expect_recorded("drivers/nmea/lengths.txt", text);
}

TEST(NmeaWhole, WhatTheSessionTells) {
  expect_recorded("drivers/nmea/session.txt", test::listening_text([] { return std::make_unique<Session>(); },
                                                                   bytes_of(gga("123456.10", 4))));
}

TEST(NmeaWhole, EveryVectorAsItIs) {
  std::string text;
  for (const auto& vector : test::load_vectors(test::source_path("tests/vectors/nmea.hex"))) {
    text += vector.name + ": " + outcome(vector.bytes) + '\n';
  }
  expect_recorded("drivers/nmea/vectors.txt", text);
}

}  // namespace
}  // namespace imuscope::nmea
