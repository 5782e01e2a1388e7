// Sentences, damaged streams, and epochs made of sentences.
#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"
#include "drivers/nmea/decoder.h"
#include "drivers/nmea/messages.h"
#include "drivers/nmea/scanner.h"
#include "drivers/nmea/session.h"
#include "tests/drivers/nmea/sentence_builder.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::nmea {
namespace {

using nlohmann::json;
using test::Bytes;
using test::bytes_of;
using test::sentence;
using namespace std::chrono_literals;

std::vector<std::string> scan_text(const Bytes& bytes, bool checksum_required = true) {
  Scanner scanner(Duration::zero(), checksum_required);
  std::vector<std::string> found;
  Frame frame;
  std::span<const std::uint8_t> rest(bytes);
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, {}));
    while (scanner.next(frame)) found.emplace_back(frame.sentence);
  }
  while (scanner.next(frame, true)) found.emplace_back(frame.sentence);
  return found;
}

json fields_of(std::string_view text) {
  json fields = json::object();
  for_each_field(Fields(text), [&](const NamedValue& value) {
    json& field = fields[std::string(value.name)];
    switch (value.kind) {
      case NamedValue::Kind::kText:
        field = value.text;
        break;
      case NamedValue::Kind::kBool:
        field = value.number != 0.0;
        break;
      case NamedValue::Kind::kReal:
      case NamedValue::Kind::kInteger:
        field = value.number;
        break;
    }
  });
  return fields;
}

TEST(NmeaText, ATimeHasAsManyDecimalsAsThereIsRoomFor) {
  EXPECT_EQ(detail::phins_time_text("123456.100").view(), "12:34:56.100");
  EXPECT_EQ(detail::phins_time_text("123456.78901234567890123456").view(), "12:34:56.7890123456789");
  EXPECT_EQ(detail::phins_time_text("noon").view(), "");
}

TEST(NmeaVectors, EveryVectorDecodesToItsPublishedValues) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/nmea.hex"));
  const json expected = test::load_json(test::source_path("tests/vectors/nmea.json"));
  ASSERT_EQ(vectors.size(), expected["vectors"].size());
  for (const json& vector : expected["vectors"]) {
    const std::string name = vector["name"];
    SCOPED_TRACE(name);
    const Bytes& bytes = test::vector_named(vectors, name);
    ASSERT_EQ(bytes.size(), vector["length"]);
    const auto found = scan_text(bytes);
    if (name == "GGA_bad_checksum" || name == "GGA_no_checksum") {
      EXPECT_TRUE(found.empty());
      EXPECT_EQ(scan_text(bytes, false).size(), name == "GGA_no_checksum" ? 1U : 0U);
      continue;
    }
    ASSERT_EQ(found.size(), 1U);
    if (vector.contains("sentence")) {
      EXPECT_EQ(found[0], vector["sentence"]);
    }
    const json fields = fields_of(found[0]);
    for (const auto& [field, value] : vector["expected"].items()) {
      if (value.is_null()) {
        EXPECT_FALSE(fields.contains(field)) << field;
        continue;
      }
      ASSERT_TRUE(fields.contains(field)) << field;
      if (value.is_number()) {
        // The published positions are decimal roundings of the sentence's minutes.
        EXPECT_NEAR(fields[field].get<double>(), value.get<double>(),
                    1e-9 * std::abs(value.get<double>()) + 1e-12)
            << field;
      } else {
        EXPECT_EQ(fields[field], value) << field;
      }
    }
  }
}

TEST(NmeaVectors, ThePhinsStandardGroupDecodesToItsPublishedValues) {
  const auto found = scan_text(test::load_bytes(test::source_path("tests/vectors/phins_standard.nmea")));
  const json sentences = test::load_json(test::source_path("tests/vectors/phins_standard.json"))["sentences"];
  ASSERT_EQ(found.size(), 9U);
  ASSERT_EQ(found.size(), sentences.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i], sentences[i]["sentence"]);
    EXPECT_EQ(fields_of(found[i]), sentences[i]["expected"]);
  }
}

DecoderConfig fixed_config() {
  DecoderConfig config;
  config.clock = ClockMapConfig::fixed(host_time_from_ns(0), 1.0);
  return config;
}

std::vector<Sample> decode(const std::string& text, const DecoderConfig& config = fixed_config()) {
  Decoder decoder(config);
  test::CollectingSink sink;
  decoder.push(bytes_of(text), {}, sink);
  decoder.finish({}, sink);
  return sink.samples;
}

std::string gga(const std::string& time, const std::string& tail = "4,18,0.7,35.250,M,46.250,M,1.0,0123") {
  return sentence("GNGGA," + time + ",4530.0000,N,00515.0000,W," + tail);
}

const UtcTime kDay = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};

TEST(NmeaDecoder, SentencesOfOneTimeBecomeOneSample) {
  const auto samples =
      decode(sentence("GPRMC,123456.10,A,4530.0000,N,00515.0000,W,10.0,90.0,140326,,,R,V") +
             gga("123456.10") + sentence("GPGST,123456.10,,,,,0.012,0.013,0.020") + sentence("GPHDT,1.0,T"));
  ASSERT_EQ(samples.size(), 1U);
  const GnssData& gnss = samples[0].gnss;
  EXPECT_EQ(gnss.solution, GnssSolution::kFixed);
  EXPECT_NEAR(gnss.latitude_rad, 45.5 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(gnss.longitude_rad, -5.25 * kRadPerDeg, 1e-15);
  EXPECT_DOUBLE_EQ(gnss.height_m, 81.5);
  EXPECT_EQ(gnss.sd_position_m, (Vector3{0.012, 0.013, 0.020}));
  EXPECT_NEAR(gnss.v_n_mps[0], 0.0, 1e-12);
  EXPECT_NEAR(gnss.v_n_mps[1], 18520.0 / 3600.0, 1e-12);
  EXPECT_GE(gnss.sd_velocity_mps[2], 1.0);  // the vertical velocity is not known
  EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms);
  EXPECT_EQ(to_ns(samples[0].time), 45'296'100'000'000);
}

TEST(NmeaDecoder, AnEpochIsHandedOutWithItsLastSentenceOnceTheOrderIsKnown) {
  Decoder decoder(fixed_config());
  test::CollectingSink sink;
  const auto rmc = [](const std::string& time) {
    return sentence("GPRMC," + time + ",A,4530.0000,N,00515.0000,W,10.0,90.0,140326,,,R,V");
  };
  decoder.push(bytes_of(rmc("000001.00") + gga("000001.00")), {}, sink);
  EXPECT_EQ(sink.samples.size(), 0U);  // nothing says yet that no more sentences follow
  decoder.push(bytes_of(rmc("000002.00")), {}, sink);
  EXPECT_EQ(sink.samples.size(), 1U);
  decoder.push(bytes_of(gga("000002.00")), {}, sink);
  EXPECT_EQ(sink.samples.size(), 2U);
  decoder.push(bytes_of(rmc("000003.00") + gga("000003.00")), {}, sink);
  EXPECT_EQ(sink.samples.size(), 3U);
  for (const Sample& sample : sink.samples) EXPECT_NE(sample.gnss.flags & kPositionValid, 0U);
}

TEST(NmeaDecoder, TheTalkerMayChangeDuringTheDrive) {
  std::string later = gga("000002.00");
  later = sentence("GP" + later.substr(3, later.find('*') - 3));
  EXPECT_EQ(decode(gga("000001.00") + later).size(), 2U);
}

TEST(NmeaDecoder, TheDateIsCarriedThroughMidnight) {
  const auto samples =
      decode(sentence("GPZDA,235959.90,14,03,2026,00,00") + gga("235959.90") + gga("000000.00"));
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].utc, kDay + 24h - 100ms);
  EXPECT_EQ(samples[1].utc, kDay + 24h);
  EXPECT_EQ(samples[1].time - samples[0].time, Duration(100ms));
}

TEST(NmeaDecoder, ALeapSecondIsASecondAndNoEpochOfItIsLost) {
  const auto zda = [](const std::string& time, const char* date) {
    return sentence("GPZDA," + time + "," + date + ",00,00");
  };
  const char* const last = "31,12,2016";
  const char* const first = "01,01,2017";
  const auto samples =
      decode(zda("235959.00", last) + gga("235959.00") + zda("235960.00", last) + gga("235960.00") +
             zda("000000.00", first) + gga("000000.00") + zda("000001.00", first) + gga("000001.00"));
  ASSERT_EQ(samples.size(), 4U);
  for (std::size_t i = 1; i < samples.size(); ++i)
    EXPECT_EQ(samples[i].time - samples[i - 1].time, Duration(1s)) << i;
  const UtcTime new_year = std::chrono::sys_days{std::chrono::year{2017} / 1 / 1};
  EXPECT_EQ(samples[0].utc, new_year - 1s);
  EXPECT_EQ(samples[1].utc, new_year) << "second 60 is the first of the next day, as elsewhere";
  EXPECT_EQ(samples[2].utc, new_year);
  EXPECT_EQ(samples[3].utc, new_year + 1s);
}

TEST(NmeaDecoder, QualitiesThatAreNotOfSatellitesGiveNoPosition) {
  for (const char* quality : {"0", "6", "7", "8", ""}) {
    const auto samples = decode(gga("000001.00", std::string(quality) + ",18,0.7,35.250,M,46.250,M,,"));
    ASSERT_EQ(samples.size(), 1U) << quality;
    EXPECT_EQ(samples[0].gnss.solution, GnssSolution::kNone) << quality;
    EXPECT_EQ(samples[0].gnss.flags, 0U) << quality;
  }
  EXPECT_EQ(decode(gga("000001.00", "5,18,0.7,35.2,M,46.2,M,,")).at(0).gnss.solution, GnssSolution::kFloat);
}

TEST(NmeaDecoder, WithoutGeoidSeparationTheConfiguredOneIsTaken) {
  const std::string text = gga("000001.00", "4,18,0.7,35.250,M,,M,,");
  EXPECT_EQ(decode(text).at(0).gnss.flags & kPositionValid, 0U);
  DecoderConfig config = fixed_config();
  config.geoid_separation_m = 40.0;
  EXPECT_DOUBLE_EQ(decode(text, config).at(0).gnss.height_m, 75.25);
}

TEST(NmeaDecoder, AReceiverThatStandsGivesZeroVelocityWithoutACourse) {
  const auto velocity = [](const char* knots) {
    return decode(sentence(std::string("GPRMC,000001.00,A,4530.0,N,00515.0,W,") + knots + ",,140326,,,R,V"))
        .at(0)
        .gnss;
  };
  EXPECT_NE(velocity("0.025").flags & kVelocityValid, 0U);
  EXPECT_EQ(velocity("0.025").v_n_mps, (Vector3{0, 0, 0}));
  EXPECT_EQ(velocity("5.0").flags & kVelocityValid, 0U);
}

TEST(NmeaDecoder, WithoutRmcTheVelocityIsOfVtg) {
  // VTG has no time of its own: what comes before the first time belongs to no epoch.
  const auto samples = decode(sentence("GPVTG,0.0,T,,M,99.0,N,,K,A") + gga("000001.00") +
                              sentence("GPVTG,90.0,T,,M,10.0,N,18.5,K,A"));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_NE(samples[0].gnss.flags & kVelocityValid, 0U);
  EXPECT_NEAR(samples[0].gnss.v_n_mps[0], 0.0, 1e-12);
  EXPECT_NEAR(samples[0].gnss.v_n_mps[1], 18520.0 / 3600.0, 1e-12);
}

TEST(NmeaDecoder, AnRmcThatWarnsGivesNoVelocity) {
  const auto rmc = [](const char* status) {
    return decode(gga("000001.00") + sentence(std::string("GPRMC,000001.00,") + status +
                                              ",4530.0,N,00515.0,W,10.0,90.0,140326,,,R,V"));
  };
  ASSERT_EQ(rmc("V").size(), 1U);
  EXPECT_NE(rmc("A")[0].gnss.flags & kVelocityValid, 0U);
  EXPECT_EQ(rmc("V")[0].gnss.flags & kVelocityValid, 0U);
  // A speed without a solution is none either.
  EXPECT_EQ(decode(gga("000001.00", "0,00,,,M,,M,,") +
                   sentence("GPRMC,000001.00,A,4530.0,N,00515.0,W,10.0,90.0,140326,,,R,V"))
                .at(0)
                .gnss.flags,
            0U);
}

TEST(NmeaDecoder, SentencesWithoutAPossibleTimeMakeNoEpoch) {
  for (const char* time : {"", "1234", "245959.00", "126000.00", "123461.00", "1234xx", "12x456.00"}) {
    EXPECT_TRUE(decode(gga(time)).empty()) << time;
  }
}

TEST(NmeaDecoder, APlaceThatCannotBeIsNotUsed) {
  for (const char* place : {",,,", "4530.0,X,00515.0,W", "4560.0,N,00515.0,W", "45,N,00515.0,W",
                            "4530.0,,00515.0,W", "4530.0,N,x515.0,W", "-4530.0,N,00515.0,W"}) {
    const auto samples =
        decode(sentence(std::string("GPGGA,000001.00,") + place + ",4,18,0.7,35.2,M,46.2,M,,"));
    ASSERT_EQ(samples.size(), 1U) << place;
    EXPECT_EQ(samples[0].gnss.flags, 0U) << place;
  }
}

TEST(NmeaDecoder, ADateThatCannotBeGivesNoUtc) {
  for (const char* date : {"140026", "310226", "14x326", "1403"}) {
    const auto samples =
        decode(gga("000001.00") +
               sentence(std::string("GPRMC,000001.00,A,4530.0,N,00515.0,W,1.0,90.0,") + date + ",,,R,V"));
    ASSERT_EQ(samples.size(), 1U) << date;
    EXPECT_FALSE(samples[0].has_utc) << date;
  }
  EXPECT_FALSE(decode(sentence("GPZDA,000001.00,-1,03,2026,00,00") + gga("000001.00")).at(0).has_utc);
  EXPECT_FALSE(decode(sentence("GPZDA,000001.00,,,,00,00") + gga("000001.00")).at(0).has_utc);
}

TEST(NmeaDecoder, StandardDeviationsOfZeroOrLeftOutAreNone) {
  for (const char* sd : {"0.012,0.013,0.0", "0.012,,0.02", "0.0,0.013,0.02", ",,"}) {
    const auto samples = decode(gga("000001.00") + sentence(std::string("GPGST,000001.00,,,,,") + sd));
    ASSERT_EQ(samples.size(), 1U) << sd;
    EXPECT_EQ(samples[0].gnss.flags, kPositionValid) << sd;
  }
}

TEST(NmeaDecoder, MissingEpochsAreCountedByTimeThroughMidnightToo) {
  DecoderConfig config = fixed_config();
  config.period = 100ms;
  Decoder decoder(config);
  test::CollectingSink sink;
  decoder.push(bytes_of(gga("235959.80") + gga("235959.90") + gga("000000.30") + gga("000000.40")), {}, sink);
  decoder.finish({}, sink);
  ASSERT_EQ(sink.samples.size(), 4U);
  EXPECT_EQ(decoder.counters().samples_lost, 3U);
  // One epoch late, from the day before: time steps back by it and not forward by a day.
  Decoder late(config);
  test::CollectingSink back;
  late.push(bytes_of(gga("000001.00") + gga("235959.90")), {}, back);
  late.finish({}, back);
  ASSERT_EQ(back.samples.size(), 2U);
  EXPECT_EQ(back.samples[1].time - back.samples[0].time, Duration(-1100ms));
}

TEST(NmeaDecoder, TheRemedyForHeightsWithoutAGeoidIsSaid) {
  Decoder decoder(fixed_config());
  test::CollectingSink sink;
  decoder.push(bytes_of(gga("000001.00") + gga("000002.00")), {}, sink);
  EXPECT_EQ(decoder.remark(), "");
  decoder.push(bytes_of(gga("000003.00", "4,18,0.7,35.250,M,,M,,")), {}, sink);
  decoder.finish({}, sink);
  EXPECT_NE(decoder.remark().find("geoid_separation_m"), std::string_view::npos);
}

TEST(NmeaSession, SilenceAWrongBaudRateAndAGoodStreamAreToldApart) {
  const HostTime begin = host_time_from_ns(0);
  Session session;
  EXPECT_TRUE(session.poll(begin).empty());
  EXPECT_EQ(session.state(), SessionState::kConnecting);
  (void)session.poll(begin + 6s);
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("cable"), std::string_view::npos);
  EXPECT_FALSE(session.wants_other_baud()) << "silence says nothing of the rate";

  session.on_bytes(Bytes(200, 0xA5), begin + 7s);
  (void)session.poll(begin + 8s);
  EXPECT_NE(session.problem().find("baud rate"), std::string_view::npos);
  EXPECT_TRUE(session.wants_other_baud());

  session.on_bytes(bytes_of(gga("000001.00")), begin + 9s);
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_EQ(session.problem(), "");
  (void)session.poll(begin + 13s);
  EXPECT_EQ(session.state(), SessionState::kStreaming);

  // The rate has once been right: what comes now is another trouble.
  session.on_bytes(Bytes(200, 0xA5), begin + 14s);
  (void)session.poll(begin + 15s);
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_FALSE(session.wants_other_baud());
}

TEST(NmeaDecoder, TheRecordedDriveGivesOneSampleASecond) {
  IMUSCOPE_NEEDS_SHARED("data/streams/nmea/drive.nmea");
  DecoderConfig config = fixed_config();
  config.period = 1s;
  Decoder decoder(config);
  test::CollectingSink sink;
  decoder.push(test::load_bytes(test::shared_path("data/streams/nmea/drive.nmea")), {}, sink);
  decoder.finish({}, sink);
  EXPECT_EQ(decoder.counters().frames, 7268U);
  EXPECT_EQ(decoder.counters().bytes_skipped, 0U);
  EXPECT_EQ(sink.samples.size(), 3634U);
  for (const Sample& sample : sink.samples) ASSERT_TRUE(sample.has_utc);
}

}  // namespace
}  // namespace imuscope::nmea
