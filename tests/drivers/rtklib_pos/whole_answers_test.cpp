// Everything that comes out of rich streams of solutions, held as it once was.
#include <gtest/gtest.h>

#include "drivers/rtklib_pos/decoder.h"
#include "drivers/rtklib_pos/session.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::rtklib_pos {
namespace {

using test::bytes_of;
using test::expect_recorded;
using namespace std::chrono_literals;

constexpr HostTime kWholeBegin = host_time_from_ns(5'000'000'000'000);

DecoderConfig whole_config(Duration period = 200ms) {
  DecoderConfig config;
  config.device = 4;
  config.period = period;
  config.per_byte = byte_time(115'200.0);
  return config;
}

/// One read a line, 100 ms apart.
std::string whole_text(const DecoderConfig& config, const std::string& lines) {
  Decoder decoder(config);
  test::CollectingSink sink;
  HostTime now = kWholeBegin;
  for (std::size_t at = 0; at < lines.size();) {
    const std::size_t end = std::min(lines.find('\n', at), lines.size() - 1) + 1;
    decoder.push(bytes_of(lines.substr(at, end - at)), {now, now - 300us}, sink);
    now += 100ms;
    at = end;
  }
  decoder.finish(now, sink);
  std::string text;
  for (const Sample& sample : sink.samples) text += test::sample_text(sample) + '\n';
  text += test::counts_text(decoder.counters()) + '\n';
  const Format& f = decoder.format();
  text += "format " + std::to_string(static_cast<int>(f.time_system)) + ' ' +
          std::to_string(static_cast<int>(f.layout)) + " '" + f.separator + "' " +
          (f.geodetic_height ? "geodetic " : "") + (f.has_velocity ? "velocity " : "") +
          (decoder.base_is_missing() ? "no base" : "") + '\n';
  return text + std::string(decoder.remark()) + '\n';
}

const std::string kSd = "   0.0100   0.0200   0.0300  -0.0040   0.0050   0.0060";
const std::string kVelocityHeader =
    "      vn(m/s)    ve(m/s)    vu(m/s)      sdvn     sdve     sdvu    sdvne    sdveu    sdvun";
std::string llh_header(const std::string& system = "GPST", const std::string& more = "") {
  return "%  " + system +
         "                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio" +
         more + '\n';
}
std::string row(const std::string& time, const std::string& place, int q, const std::string& more = "") {
  return time + ' ' + place + "   " + std::to_string(q) + "  12" + kSd + "   0.10   12.3" + more + '\n';
}
const std::string kPlace = "48.856614000    2.352219000    81.5000";

TEST(RtklibWhole, LatitudesAndLongitudes) {
  std::string lines =
      "% program : hand written\n% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix)\n" + llh_header();
  int tenths = 0;
  for (int q = 0; q < 8; ++q)
    lines += row("2026/03/14 12:34:5" + std::to_string(tenths / 10) + '.' + std::to_string(tenths % 10),
                 kPlace, q),
        tenths += 2;
  lines += row("2026/03/14 12:34:52.0", kPlace, 1) + row("2026/03/14 12:34:52.0", kPlace, 1) +
           row("2026/03/14 12:34:51.0", kPlace, 1) + row("2026/03/14 12:34:51.301", kPlace, 1);
  lines +=
      row("2026/03/14 12:34:53.0", "90.0 360.0 1.5", 1) + row("2026/03/14 12:34:53.2", "90.1 360.0 1.5", 1) +
      row("2026/03/14 12:34:53.4", "-90.0 -360.0 1.5", 1) +
      row("2026/03/14 12:34:53.6", "-45.0 360.1 1.5", 1) + row("2026/03/14 12:34:53.8", "-45.0 270.0 1.5", 1);
  std::string text = whole_text(whole_config(), lines) + whole_text(whole_config(0ms), lines);
  DecoderConfig fixed = whole_config(100ms);
  fixed.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
  text += whole_text(fixed, lines);
  expect_recorded("drivers/rtklib_pos/llh.txt", text, test::kSampleShare);
}

TEST(RtklibWhole, EveryFormat) {
  std::string text;
  const std::string velocity = "  1.50 -2.50 0.25  0.10 0.20 0.30 0 0 0";
  for (const char* system : {"GPST", "UTC", "JST"})
    text += whole_text(whole_config(), llh_header(system) + row("2026/03/14 12:34:56.1", kPlace, 1) +
                                           row("1990/03/14 12:34:56.1", kPlace, 1));
  text += whole_text(whole_config(),
                     llh_header("GPST", kVelocityHeader) + row("2026/03/14 12:34:56.1", kPlace, 2, velocity) +
                         row("2026/03/14 12:34:56.2", kPlace, 2, "  1.5 -2.5 0.25 0.1 0.2 0") +
                         row("2026/03/14 12:34:56.3", kPlace, 2, "  1.5 -2.5") +
                         row("2026/03/14 12:34:56.4", kPlace, 0, velocity));
  text += whole_text(whole_config(), "% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n" + llh_header() +
                                         row("2026/03/14 12:34:56.1", kPlace, 1));
  text += whole_text(whole_config(), "% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n% height ellipsoidal\n" +
                                         llh_header() + row("2026/03/14 12:34:56.1", kPlace, 1));
  text +=
      whole_text(whole_config(),
                 "%  GPST                  latitude(d'\")   longitude(d'\")  height(m)   Q  ns   sdn(m)\n" +
                     row("2026/03/14 12:34:56.1", "48 51 23.8104  -2 21 7.9884  81.5", 1) +
                     row("2026/03/14 12:34:56.2", "-0 30 30.0  0 30 15.0  81.5", 1) +
                     row("2026/03/14 12:34:56.3", "48 51  2 21 7.9884  81.5", 1) +
                     row("2026/03/14 12:34:56.4", "48 x 1  2 21 7.9884  81.5", 1));
  const std::string xyz_header =
      "%  GPST              x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns   sdx(m)   sdy(m)   sdz(m)  sdxy(m)  sdyz(m)  sdzx(m) age(s)  ratio";
  text +=
      whole_text(whole_config(),
                 xyz_header + '\n' + row("2409 563714.1", "4200952.1250    171262.0625   4780236.7500", 1) +
                     row("2409 563714.2", "-2694045.0 -4293642.0 3857878.0", 3) +
                     row("2409 563714.3", "0 0 5999999.0", 1) + row("2409 563714.4", "0 0 6300000.0", 1) +
                     row("2409 563714.5", "5.9e6 1.2e6 0.1", 1));
  text +=
      whole_text(whole_config(),
                 xyz_header + "  vx(m/s) vy(m/s) vz(m/s) sdvx sdvy sdvz\n" +
                     row("2409 563714.1", "4200952.1250    171262.0625   4780236.7500", 1, velocity) +
                     row("2409 563714.2", "4200952.1250    171262.0625   4780236.7500", 1, " 1 2 3 0 0 0"));
  const std::string enu_header =
      "%  UTC                    e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns   sde(m)   sdn(m)   sdu(m)  sden(m)  sdnu(m)  sdue(m) age(s)  ratio";
  const std::string enu_row = row("2026/03/14 12:34:38.1", "10.0 -20.0 0.5", 4);
  text += whole_text(whole_config(), enu_header + '\n' + enu_row);
  text += whole_text(whole_config(), "% ref pos   : 48.85 2.35 80.5\n" + enu_header + '\n' + enu_row);
  text += whole_text(whole_config(), "% ref pos   : 48.85 2.35\n" + enu_header + '\n' + enu_row);
  text += whole_text(whole_config(), "% ref pos :48.85 2.35 80.5\n% ref pos : x\n" + enu_header +
                                         "  ve(m/s) vn(m/s) vu(m/s)\n" +
                                         row("2026/03/14 12:34:38.1", "10.0 -20.0 0.5", 4, velocity));
  DecoderConfig based = whole_config();
  based.base = ReferencePosition{-33.5, 151.25, 20.0};
  text += whole_text(based, enu_header + '\n' + row("2026/03/14 12:34:38.1", "1000.0 -2000.0 50.0", 5));
  based.format.layout = Layout::kEnu;
  text += whole_text(based, enu_row);
  expect_recorded("drivers/rtklib_pos/formats.txt", text, test::kSampleShare);
}

std::string replaced(std::string text, char from, char to) {
  std::replace(text.begin(), text.end(), from, to);
  return text;
}

TEST(RtklibWhole, SeparatorsBlanksAndTimes) {
  std::string text;
  for (const char separator : {',', ';', '\t'}) {
    const std::string header =
        std::string("%  GPST") + separator + "latitude(deg)" + separator + "longitude(deg)\n";
    const std::string cells =
        replaced("2026/03/14_12:34:56.1 48.5 2.25 81.5 1 12 0.01 0.02 0.03 0.004 0.005 0.006 0.1 12.3\n", ' ',
                 separator);
    text += whole_text(
        whole_config(),
        header + replaced(cells, '_', ' ') +
            replaced("2409 563714.1 48.5 2.25 81.5 1 12 0.01 0.02 0.03 0 0 0 0.1 12.3\n", ' ', separator));
    text += whole_text(whole_config(), std::string("%  GPST    ") + separator + "latitude(deg)\n" +
                                           replaced(cells, '_', ' '));
  }
  text += whole_text(whole_config(), "%  GPST    \n%  latitude(deg) JST\n" +
                                         row(" \t2026/03/14   12:34:56.1", kPlace, 1, " \t\r"));
  text += whole_text(
      whole_config(),
      "%  GPST,latitude(deg)\n 2026/03/14   12:34:56.1 \t, 48.5\t,\t2.25 , 81.5 \t,1 ,12,0.01,0.02 ,0.03,0,0,0,0.1,12.3 \t\r\n");
  std::string lines = llh_header();
  for (const char* time : {"1979/12/31 00:00:00",
                           "1980/01/01 00:00:00",
                           "2261/12/31 23:59:59",
                           "2262/01/01 0:0:0",
                           "2026/02/29 00:00:00",
                           "2024/02/29 00:00:00",
                           "2026/13/01 00:00:00",
                           "2026/3/4 1:2:3.5",
                           "2026/03/14 24:00:00",
                           "2026/03/14 23:60:00",
                           "2026/03/14 23:59:60.9",
                           "2026/03/14 23:59:61",
                           "2026/03/14 -1:00:00",
                           "2026/03/14 1:-1:00",
                           "2026/03/14 1:1:-1",
                           "2026/03 1:1:1",
                           "2026/03/14 1:1",
                           "2026/03/14",
                           "x/03/14 1:1:1",
                           "2026/x/14 1:1:1",
                           "2026/03/x 1:1:1",
                           "2026/03/14 x:1:1",
                           "2026/03/14 1:x:1",
                           "2026/03/14 1:1:x",
                           "0 0",
                           "0 604800",
                           "0 604800.1",
                           "0 -0.1",
                           "-1 5",
                           "10000 5",
                           "10001 5",
                           "2409.5 5",
                           "2409 x",
                           "2409"}) {
    lines += row(time, kPlace, 1);
  }
  text += whole_text(whole_config(0ms), lines);
  lines = llh_header();
  int second = 10;
  for (const char* rest :
       {"48 2 81 1000 12 1 2 3 4 5 6 7 8", "48 2 81 1001 12 1 2 3 4 5 6 7 8", "48 2 81 -1 12 1 2 3 4 5 6 7 8",
        "48 2 81 1 1000 1 2 3 4 5 6 7 8", "48 2 81 1 1001 1 2 3 4 5 6 7 8", "48 2 81 1 -1 1 2 3 4 5 6 7 8",
        "48 2 81 1 12 -1 2 3 4 5 6 7 8", "48 2 81 1 12 1 0 3 4 5 6 7 8", "48 2 81 1 12 1 2 3 4 5 6 7",
        "48 2 81 1 12 1 2 3 4 5 x 7 8", "48 2 81 1 12 1 2 x 4 5 6 7 8", "48 2 81 1", "48 2",
        "48 x 81 1 12 1 2 3 4 5 6 7 8", "48 2 81 1.9 12.9 1 2 3 4 5 6 7 8"}) {
    lines += "2026/03/14 12:00:" + std::to_string(second++) + ' ' + rest + '\n';
  }
  text += whole_text(whole_config(0ms), lines);
  expect_recorded("drivers/rtklib_pos/separators.txt", text, test::kSampleShare);
}

std::string solution_text(const std::string& line, const Format& format) {
  const auto solution = parse_solution(line, format);
  if (!solution) return "nothing\n";
  std::string text = test::in_groups(solution->time_ns);
  for_each_field(*solution, format.layout, [&](std::string_view name, double value) {
    text += ' ' + std::string(name) + '=' + test::real_text(value);
  });
  return text + " v " + test::real_text(solution->velocity) + " sd " +
         test::real_text(solution->velocity_sd) + '\n';
}

TEST(RtklibWhole, FieldsOfSolutions) {
  std::string text;
  for (const Layout layout : {Layout::kLlh, Layout::kLlhDms, Layout::kXyz, Layout::kEnu}) {
    for (const bool has_velocity : {false, true}) {
      Format format;
      format.layout = layout;
      format.has_velocity = has_velocity;
      const std::string place = layout == Layout::kLlhDms ? "48 30 36 -2 15 18 81.5" : "48.5 -2.25 81.5";
      text += solution_text("2026/03/14 12:34:56.123456789 " + place +
                                " 2 11 0.1 -0.2 0.3 -0.4 0.5 -0.6 0.7 0.8 1 2 3 4 5 6 7 8 9",
                            format);
    }
  }
  expect_recorded("drivers/rtklib_pos/fields.txt", text, test::kSampleShare);
}

std::string whole_outcome(const test::Bytes& bytes) {
  DecoderConfig config = whole_config();
  config.clock = ClockMapConfig::fixed(kWholeBegin, 1.0);
  Decoder decoder(config);
  return test::outcome_text(decoder, bytes, kWholeBegin);
}

TEST(RtklibWhole, AnotherCharacterAtEveryPlace) {
  const std::string stream =
      llh_header("UTC") + row("2026/03/14 12:34:56.1", kPlace, 1) + row("2026/03/14 12:34:56.3", kPlace, 2);
  std::string text;
  for (const char other : {'7', '\n', ' ', '-', '%'}) {
    text += "with " + std::to_string(static_cast<int>(other)) + '\n' +
            test::at_every_place(
                stream.size(),
                [&](std::size_t at) {
                  std::string changed = stream;
                  changed[at] = other;
                  return bytes_of(changed);
                },
                whole_outcome);
  }
  expect_recorded("drivers/rtklib_pos/other_characters.txt", text);
}

TEST(RtklibWhole, LinesOfEveryLength) {
  std::string text;
  const std::string good = row("2026/03/14 12:34:56.1", kPlace, 1);
  for (const std::size_t size : {kLineMax - 1, kLineMax, kLineMax + 1, kLineMax + 2, 2 * kLineMax - 1,
                                 2 * kLineMax, 2 * kLineMax + 1, 5 * kLineMax}) {
    for (const char* end : {"\n", ""}) {
      const std::string line = '%' + std::string(size - 1, 'x') + end;
      text += std::to_string(size) + ' ' + whole_outcome(bytes_of(line)) + " | " +
              whole_outcome(bytes_of(std::string(good).append(line).append(good))) + " | " +
              whole_outcome(bytes_of(std::string(line).append("\n \t\r\n\n").append(good))) + '\n';
    }
  }
  text += whole_outcome(bytes_of(good.substr(0, good.size() - 1))) + '\n';
  expect_recorded("drivers/rtklib_pos/lengths.txt", text);
}

TEST(RtklibWhole, WhatTheSessionTells) {
  const auto make = [] { return std::make_unique<Session>(); };
  expect_recorded("drivers/rtklib_pos/session.txt",
                  test::listening_text(make, bytes_of(row("2026/03/14 12:34:56.1", kPlace, 1))) +
                      test::listening_text(make, bytes_of(llh_header())) +
                      test::listening_text(make, bytes_of("2026/03/14 12:34:56.1 x\n")));
}

TEST(RtklibWhole, EveryVectorAsItIs) {
  std::string text;
  for (const char* name : {"llh", "xyz", "enu"}) {
    const auto bytes =
        test::load_bytes(test::source_path(std::string("tests/vectors/rtklib_") + name + ".pos"));
    DecoderConfig config = whole_config();
    config.base = ReferencePosition{48.85, 2.35, 80.5};
    text += whole_text(config, std::string(bytes.begin(), bytes.end()));
  }
  expect_recorded("drivers/rtklib_pos/vectors.txt", text, test::kSampleShare);
}

}  // namespace
}  // namespace imuscope::rtklib_pos
