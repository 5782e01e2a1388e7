// Lines of RTKLIB solutions, and samples made of them.
#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "base/wgs84.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/rtklib_pos/session.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::rtklib_pos {
namespace {

using nlohmann::json;
using test::bytes_of;
using namespace std::chrono_literals;

struct Rig {
  explicit Rig(DecoderConfig config = {})
      : decoder((config.clock = ClockMapConfig::fixed({}, 1.0), config)) {}
  std::vector<Sample>& push(std::string_view text) {
    decoder.push(bytes_of(text), {}, sink);
    decoder.finish({}, sink);
    return sink.samples;
  }
  Decoder decoder;
  test::CollectingSink sink;
};

constexpr std::string_view kLlhHeader =
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  "
    "sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n";
constexpr std::string_view kRow =
    "2026/03/14 12:34:56.100   45.5   -5.25    81.5   1  12   0.01   0.02   0.03  0 0 0 0.1 12.3\n";
const UtcTime kDay = std::chrono::sys_days{std::chrono::year{2026} / 3 / 14};

TEST(RtklibPosVectors, EveryFileDecodesToItsPublishedRows) {
  const json expected = test::load_json(test::source_path("tests/vectors/rtklib_pos.json"));
  for (const auto& [name, file] : expected["files"].items()) {
    SCOPED_TRACE(name);
    const auto bytes = test::load_bytes(test::source_path("tests/vectors/" + name));
    std::string text(bytes.begin(), bytes.end());
    Format format;
    std::optional<ReferencePosition> base;
    std::size_t row = 0;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      const std::string_view line = std::string_view(text).substr(at, end - at);
      at = end + 1;
      if (line.starts_with('%')) {
        (void)read_comment(line, format, base);
        continue;
      }
      const auto solution = parse_solution(line, format);
      ASSERT_TRUE(solution) << line;
      ASSERT_LT(row, file["rows"].size());
      json fields = json::object();
      for_each_field(*solution, format.layout,
                     [&](std::string_view field, double value) { fields[std::string(field)] = value; });
      for (const auto& [field, value] : file["rows"][row].items()) {
        if (field == "time" || field == "week" || field == "tow") continue;
        ASSERT_TRUE(fields.contains(field)) << field;
        EXPECT_NEAR(fields[field].get<double>(), value.get<double>(),
                    1e-15 + 1e-15 * std::abs(value.get<double>()))
            << field;
      }
      ++row;
    }
    EXPECT_EQ(row, file["rows"].size());
    EXPECT_EQ(format.time_system, file["time_system"] == "UTC" ? TimeSystem::kUtc : TimeSystem::kGpst);
    EXPECT_EQ(format.layout, file["format"] == "llh"   ? Layout::kLlh
                             : file["format"] == "xyz" ? Layout::kXyz
                                                       : Layout::kEnu);
  }
}

TEST(RtklibPosDecoder, ALineBecomesASampleInUtc) {
  Rig rig;
  const auto& samples = rig.push(std::string(kLlhHeader) + std::string(kRow));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms - 18s);
  EXPECT_EQ(samples[0].gnss.solution, GnssSolution::kFixed);
  EXPECT_DOUBLE_EQ(samples[0].gnss.latitude_rad, 45.5 * kRadPerDeg);
  EXPECT_DOUBLE_EQ(samples[0].gnss.longitude_rad, -5.25 * kRadPerDeg);
  EXPECT_NEAR(samples[0].gnss.sd_position_m[1], 0.02, 1e-15);
  EXPECT_EQ(samples[0].gnss.flags, kPositionValid | kHasPositionSd);
}

TEST(RtklibPosDecoder, QualityNumbersAreThoseOfRtklib) {
  const GnssSolution expected[] = {
      GnssSolution::kNone,         GnssSolution::kFixed,  GnssSolution::kFloat, GnssSolution::kDifferential,
      GnssSolution::kDifferential, GnssSolution::kSingle, GnssSolution::kFloat};
  for (int q = 0; q <= 6; ++q) {
    Rig rig;
    const auto& samples =
        rig.push("2026/03/14 12:34:56.100 45.5 -5.25 81.5 " + std::to_string(q) + " 12 1 1 1 0 0 0 0 0\n");
    ASSERT_EQ(samples.size(), 1U) << q;
    EXPECT_EQ(samples[0].gnss.solution, expected[q]) << q;
  }
}

TEST(RtklibPosDecoder, XyzGivesTheSamePlaceAndRotatedStandardDeviations) {
  const Geodetic at{45.5 * kRadPerDeg, -5.25 * kRadPerDeg, 81.5};
  const auto xyz = ecef_of(at);
  // Covariance in ECEF of 0.1, 0.2, 0.4 m north, east, down, from the definition C' diag C.
  const auto c = rotation_ecef_to_ned(at);
  const double variance[] = {0.01, 0.04, 0.16};
  const auto element = [&](std::size_t i, std::size_t j) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) sum += c[3 * k + i] * variance[k] * c[3 * k + j];
    return sum < 0.0 ? -std::sqrt(-sum) : std::sqrt(sum);
  };
  std::string row = "2409 563714.100";
  for (const double value : {xyz[0], xyz[1], xyz[2]}) row += " " + std::to_string(value);
  row += " 1 12";
  for (const double value :
       {element(0, 0), element(1, 1), element(2, 2), element(0, 1), element(1, 2), element(2, 0)}) {
    char text[40];
    std::snprintf(text, sizeof text, " %.17g", value);
    row += text;
  }
  Rig rig;
  const auto& samples = rig.push("%  GPST  x-ecef(m)  y-ecef(m)  z-ecef(m)   Q\n" + row + " 0 0\n");
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_NEAR(samples[0].gnss.latitude_rad, at.lat_rad, 1e-12);
  EXPECT_NEAR(samples[0].gnss.height_m, 81.5, 1e-5);  // coordinates written with 6 decimals
  EXPECT_NEAR(samples[0].gnss.sd_position_m[0], 0.1, 1e-7);
  EXPECT_NEAR(samples[0].gnss.sd_position_m[1], 0.2, 1e-7);
  EXPECT_NEAR(samples[0].gnss.sd_position_m[2], 0.4, 1e-7);
  // Week 2409 and 563714.1 s: Saturday 2026-03-14, 12:35:14.1 GPS time.
  EXPECT_EQ(samples[0].utc, kDay + 45'314'100ms - 18s);
}

TEST(RtklibPosDecoder, EnuIsPlacedAtTheBaseOfTheHeader) {
  const std::string header =
      "% ref pos   : 45.5000000  -5.2500000   81.5000\n%  UTC   e-baseline(m)  n-baseline(m)\n";
  Rig rig;
  const auto& samples = rig.push(header + "2026/03/14 12:34:56.1 1000 2000 30 4 8 0.3 0.4 0.8 0 0 0 2 0\n");
  ASSERT_EQ(samples.size(), 1U);
  // On the plane through the base the Earth falls away by d^2/2R: 0.39 m at 2.2 km.
  EXPECT_NEAR(samples[0].gnss.height_m, 81.5 + 30.0 + 5e6 / (2.0 * 6.38e6), 0.01);
  EXPECT_NEAR((samples[0].gnss.latitude_rad - 45.5 * kRadPerDeg) * 6.368e6, 2000.0, 1.0);
  EXPECT_NEAR(samples[0].gnss.sd_position_m[0], 0.4, 1e-12);  // sde comes first in the line
  EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms);

  Rig without;
  EXPECT_TRUE(
      without.push("%  UTC   e-baseline(m)\n2026/03/14 12:34:56.1 1 2 3 4 8 1 1 1 0 0 0 2 0\n").empty());
  EXPECT_TRUE(without.decoder.base_is_missing());
  EXPECT_EQ(without.decoder.counters().bad_contents, 1U);
}

TEST(RtklibPosDecoder, DegreesMinutesSecondsAndSeparatorsAreRead) {
  Rig dms;
  const auto& southern = dms.push(
      "%  GPST    latitude(d'\") longitude(d'\")  height(m)\n"
      "2026/03/14 12:34:56.100  -0 30 36.0  -5 15 0.0  81.5 1 12 1 1 1 0 0 0 0 0\n");
  ASSERT_EQ(southern.size(), 1U);
  EXPECT_NEAR(southern[0].gnss.latitude_rad, -0.51 * kRadPerDeg, 1e-15);
  EXPECT_NEAR(southern[0].gnss.longitude_rad, -5.25 * kRadPerDeg, 1e-15);

  Rig commas;
  const auto& samples = commas.push(
      "%  GPST                  ,latitude(deg),longitude(deg)\n"
      "2026/03/14 12:34:56.100, 45.5,-5.25, "
      "81.5,1,12,1,1,1,0,0,0,0,0\n2409,563714.1,45.5,-5.25,81.5,1,12,1,1,1,0,0,0,0,0\n");
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms - 18s);
  EXPECT_EQ(samples[1].utc, kDay + 45'314'100ms - 18s);
}

TEST(RtklibPosDecoder, LinesThatAreNoSolutionAreCountedAndTheNextOneIsRead) {
  for (const char* bad :
       {"hello\n", "29999/03/14 12:34:56 45 5 81 1 12 1 1 1 0 0 0 0 0\n",
        "2026/13/14 12:34:56 45 5 81 1 12 1 1 1 0 0 0 0 0\n",
        "2026/03/14 12:34:56 95 5 81 1 12 1 1 1 0 0 0 0 0\n", "2026/03/14 12:34:56 45 5 81 1\n",
        "2026/03/14 12:34:56 45 x 81 1 12 1 1 1 0 0 0 0 0\n"}) {
    Rig rig;
    EXPECT_EQ(rig.push(std::string(bad) + std::string(kRow)).size(), 1U) << bad;
    EXPECT_EQ(rig.decoder.counters().bad_contents, 1U) << bad;
  }
  Rig rig;
  EXPECT_EQ(rig.push(std::string(50'000, '1') + "\n" + std::string(kRow)).size(), 1U);
}

TEST(RtklibPosDecoder, NumbersThatCannotBeAreNoSolution) {
  for (const char* bad :
       {"2026/03/14 24:34:56 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:60:56 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:61 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:-1 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 -1:34:56 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:-4:56 45 5 81 1 12 1 1 1 0 0 0 0 0", "2026/03/14 1234:56 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03 12:34:56 45 5 81 1 12 1 1 1 0 0 0 0 0", "10001 1 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "-1 1 45 5 81 1 12 1 1 1 0 0 0 0 0", "2409 604801 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2409 -1 45 5 81 1 12 1 1 1 0 0 0 0 0", "2409 x 45 5 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:56 45 361 81 1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:56 45 5 81 -1 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:56 45 5 81 1001 12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:56 45 5 81 1 -12 1 1 1 0 0 0 0 0",
        "2026/03/14 12:34:56 45 5 81 1 1001 1 1 1 0 0 0 0 0"}) {
    Rig rig;
    EXPECT_TRUE(rig.push(std::string(bad) + "\n").empty()) << bad;
    EXPECT_EQ(rig.decoder.counters().bad_contents, 1U) << bad;
  }
  Rig centre;
  EXPECT_TRUE(centre
                  .push("%  GPST  x-ecef(m)  y-ecef(m)  z-ecef(m)   Q\n"
                        "2409 563714.100 0 0 0 1 12 1 1 1 0 0 0 0 0\n")
                  .empty());
  EXPECT_EQ(centre.decoder.counters().bad_contents, 1U);
  Rig minutes;
  EXPECT_TRUE(minutes
                  .push("%  GPST    latitude(d'\") longitude(d'\")  height(m)\n"
                        "2026/03/14 12:34:56.100  45 x 36.0  -5 15 0.0  81.5 1 12 1 1 1 0 0 0 0 0\n"
                        "2026/03/14 12:34:56.100  45 30 36.0  -5 15 x  81.5 1 12 1 1 1 0 0 0 0 0\n")
                  .empty());
  EXPECT_EQ(minutes.decoder.counters().bad_contents, 2U);
}

TEST(RtklibPosDecoder, TimesOfJapanAreNineHoursAheadOfUtc) {
  Rig rig;
  const auto& samples = rig.push("%  JST   latitude(deg) longitude(deg)  height(m)\n" + std::string(kRow));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms - 9h);
}

TEST(RtklibPosDecoder, TheSeparatorIsTheOneBehindTheTimeSystem) {
  for (const char separator : {';', '\t'}) {
    std::string row(kRow);
    row = row.substr(0, row.find("   45.5")) + ",45.5,-5.25,81.5,1,12,0.01,0.02,0.03,0,0,0,0.1,12.3\n";
    std::string text = "%  GPST  ,latitude(deg),longitude(deg),height(m)\n" + row;
    std::replace(text.begin(), text.end(), ',', separator);
    Rig rig;
    const auto& samples = rig.push(text);
    ASSERT_EQ(samples.size(), 1U) << separator;
    EXPECT_DOUBLE_EQ(samples[0].gnss.longitude_rad, -5.25 * kRadPerDeg) << separator;
    EXPECT_EQ(samples[0].utc, kDay + 45'296'100ms - 18s) << separator;
  }
}

TEST(RtklibPosDecoder, MissingEpochsAreCountedAndARepeatedOneIsRefused) {
  DecoderConfig config;
  config.period = 100ms;
  Rig rig(config);
  const auto row = [](const char* second) {
    return std::string("2026/03/14 12:34:") + second + " 45.5 -5.25 81.5 1 12 1 1 1 0 0 0 0 0\n";
  };
  const auto& samples = rig.push(row("56.1") + row("56.2") + row("56.2") + row("56.6"));
  EXPECT_EQ(samples.size(), 3U);
  EXPECT_EQ(rig.decoder.counters().samples_lost, 3U);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 1U);
}

TEST(RtklibPosDecoder, HeightsAboveTheGeoidGiveNoPositionAndTheRemedyIsSaid) {
  Rig rig;
  EXPECT_TRUE(rig.decoder.remark().empty());
  const auto& samples =
      rig.push("% (lat/lon/height=WGS84/geodetic)\n" + std::string(kLlhHeader) + std::string(kRow));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].gnss.flags & kPositionValid, 0U);
  EXPECT_NE(rig.decoder.remark().find("ellipsoidal"), std::string_view::npos);

  Rig ellipsoid;
  EXPECT_NE(
      ellipsoid.push("% (lat/lon/height=WGS84/ellipsoidal)\n" + std::string(kLlhHeader) + std::string(kRow))
              .at(0)
              .gnss.flags &
          kPositionValid,
      0U);
  EXPECT_TRUE(ellipsoid.decoder.remark().empty());

  Rig relative;
  relative.push("%  UTC   e-baseline(m)\n2026/03/14 12:34:56.1 1 2 3 4 8 1 1 1 0 0 0 2 0\n");
  EXPECT_NE(relative.decoder.remark().find("base_lat_lon_height"), std::string_view::npos);
}

TEST(RtklibPosDecoder, ColumnsOfVelocityThatTheHeaderNamesAreNeeded) {
  const std::string header = "%  GPST   latitude(deg) longitude(deg)  height(m)   Q  vn(m/s)  ve(m/s)\n";
  const std::string row =
      "2026/03/14 12:34:56.100   45.5   -5.25    81.5   1  12   0.01   0.02   0.03  0 0 0 0.1 12.3";
  Rig rig;
  const auto& samples = rig.push(header + row + " 1 2 3 0.1 0.2 0.3 0 0 0\n");
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].gnss.v_n_mps, (Vector3{1, 2, -3}));
  EXPECT_EQ(samples[0].gnss.sd_velocity_mps, (Vector3{0.1, 0.2, 0.3}));

  Rig unknown;
  const auto& without_sd = unknown.push(header + row + " 1 2 3 0 0 0 0 0 0\n");
  ASSERT_EQ(without_sd.size(), 1U);
  EXPECT_EQ(without_sd[0].gnss.flags & (kVelocityValid | kHasVelocitySd), kVelocityValid);

  Rig cut;
  EXPECT_TRUE(cut.push(header + row + "\n").empty());
  EXPECT_TRUE(cut.push(row + " 1 2 3 0.1\n").empty());
  EXPECT_EQ(cut.decoder.counters().bad_contents, 2U);
}

TEST(RtklibPosDecoder, VelocityAlongTheAxesOfTheEarthIsTurnedToNorthEastDown) {
  const Geodetic at{45.5 * kRadPerDeg, -5.25 * kRadPerDeg, 81.5};
  const auto xyz_m = ecef_of(at);
  const auto c = rotation_ecef_to_ned(at);
  const Vector3 v_n_mps{3.0, -2.0, 0.5};
  std::string row = "2026/03/14 12:34:56.100";
  for (const double value : xyz_m) row += " " + std::to_string(value);
  row += " 1 12 0.1 0.1 0.1 0 0 0 0.1 12.3";
  for (std::size_t i = 0; i < 3; ++i)
    row += " " + std::to_string(c[i] * v_n_mps[0] + c[3 + i] * v_n_mps[1] + c[6 + i] * v_n_mps[2]);
  Rig rig;
  const auto& samples = rig.push("%  GPST  x-ecef(m)  y-ecef(m)  z-ecef(m)   Q  vx(m/s)  vy(m/s)  vz(m/s)\n" +
                                 row + " 0.2 0.2 0.2 0 0 0\n");
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].gnss.flags & kVelocityValid, kVelocityValid);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(samples[0].gnss.v_n_mps[i], v_n_mps[i], 2e-6) << i;  // written with 6 decimals
}

TEST(RtklibPosDecoder, AnEpochRoundedUpToTheEndOfItsWeekIsTheBeginningOfTheNext) {
  // As 604799.9996 s is printed with three decimals.
  Rig rig;
  const auto& samples = rig.push("2409 604800.000 45.5 -5.25 81.5 1 12 1 1 1 0 0 0 0 0\n");
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].utc, kDay + 24h - 18s);
}

TEST(RtklibPosDecoder, StandardDeviationsOfZeroAreNone) {
  Rig rig;
  const auto& samples = rig.push("2026/03/14 12:34:56.100 45.5 -5.25 81.5 1 12 0.1 0 0.1 0 0 0 0 0\n");
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].gnss.flags, kPositionValid);
}

TEST(RtklibPosSession, LinesInTheFormatOfTheHeaderKeepItStreaming) {
  for (const std::string& header_and_row :
       {std::string("%  GPST                  ,latitude(deg),longitude(deg)\n"
                    "2026/03/14 12:34:56.100, 45.5,-5.25, 81.5,1,12,1,1,1,0,0,0,0,0\n"),
        std::string("%  GPST    latitude(d'\") longitude(d'\")  height(m)\n"
                    "2026/03/14 12:34:56.100  45 30 36.0  -5 15 0.0  81.5 1 12 1 1 1 0 0 0 0 0\n")}) {
    const std::size_t row_at = header_and_row.find('\n') + 1;
    Session session;
    HostTime now = host_time_from_ns(0);
    session.on_bytes(bytes_of(header_and_row.substr(0, row_at)), now);
    EXPECT_EQ(session.state(), SessionState::kStreaming);
    now += 4s;
    session.on_bytes(bytes_of(header_and_row.substr(row_at)), now);
    now += 4s;
    (void)session.poll(now);
    EXPECT_EQ(session.state(), SessionState::kStreaming) << header_and_row;
    EXPECT_EQ(session.problem(), "") << header_and_row;
  }
}

TEST(RtklibPosSession, SilenceAndOtherLinesAreToldApart) {
  Session session;
  const HostTime begin = host_time_from_ns(0);
  (void)session.poll(begin);
  EXPECT_EQ(session.state(), SessionState::kConnecting);
  (void)session.poll(begin + 6s);
  EXPECT_EQ(session.state(), SessionState::kFailed);
  EXPECT_NE(session.problem().find("rtkrcv"), std::string_view::npos);
  session.on_bytes(bytes_of("$GPHDT,1.0,T*1F\r\n"), begin + 7s);
  (void)session.poll(begin + 8s);
  EXPECT_NE(session.problem().find("output format"), std::string_view::npos);
  session.on_bytes(bytes_of(kRow), begin + 9s);
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_EQ(session.problem(), "");
}

TEST(RtklibPosDecoder, EverySplitIntoReadsGivesTheSameSamples) {
  const std::string text = std::string(kLlhHeader) + std::string(kRow) + std::string(kLlhHeader) +
                           "2026/03/14 12:34:56.200 45.5 -5.25 82.5 1 12 1 1 1 0 0 0 0 0\r\n";
  for (std::size_t at = 0; at <= text.size(); ++at) {
    Rig rig;
    rig.decoder.push(bytes_of(text.substr(0, at)), {}, rig.sink);
    rig.decoder.push(bytes_of(text.substr(at)), {}, rig.sink);
    ASSERT_EQ(rig.sink.samples.size(), 2U) << at;
    ASSERT_EQ(rig.sink.samples[1].gnss.height_m, 82.5) << at;
  }
}

TEST(RtklibPosRecordings, TheRtkDriveIsReadWithItsVelocities) {
  IMUSCOPE_NEEDS_SHARED("data/rtk_drive/gnss.pos");
  DecoderConfig config;
  config.period = 250ms;
  Rig rig(config);
  const auto bytes = test::load_bytes(test::shared_path("data/rtk_drive/gnss.pos"));
  rig.decoder.push(bytes, {}, rig.sink);
  rig.decoder.finish({}, rig.sink);
  const auto& samples = rig.sink.samples;
  EXPECT_EQ(static_cast<std::ptrdiff_t>(samples.size()), std::count(bytes.begin(), bytes.end(), '\n') - 1);
  EXPECT_EQ(rig.decoder.counters().bad_contents, 0U);
  const auto fixed = std::count_if(samples.begin(), samples.end(), [](const Sample& sample) {
    return sample.gnss.solution == GnssSolution::kFixed;
  });
  EXPECT_GT(fixed, static_cast<std::ptrdiff_t>(samples.size() * 9 / 10));
  // Positions and velocities tell the same motion: 2 s apart, on the way, within a metre.
  std::size_t compared = 0;
  for (std::size_t i = 0; i + 8 < samples.size(); ++i) {
    const GnssData& from = samples[i].gnss;
    const GnssData& to = samples[i + 8].gnss;
    if (samples[i + 8].utc - samples[i].utc != Duration(2s)) continue;
    double north_m = 0.0;
    for (std::size_t k = i; k < i + 8; ++k) {
      north_m += 0.125 * (samples[k].gnss.v_n_mps[0] + samples[k + 1].gnss.v_n_mps[0]);
    }
    ASSERT_EQ(from.flags, kPositionValid | kVelocityValid | kHasPositionSd | kHasVelocitySd);
    if (from.solution != GnssSolution::kFixed || to.solution != GnssSolution::kFixed) continue;
    // Meridian radius of curvature at 40 deg plus 1600 m.
    EXPECT_NEAR((to.latitude_rad - from.latitude_rad) * 6.363e6, north_m, 1.0) << i;
    ++compared;
  }
  EXPECT_GT(compared, 1000U);
}

}  // namespace
}  // namespace imuscope::rtklib_pos
