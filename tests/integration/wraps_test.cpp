/// A drive through everything that begins anew: the S-IMU's 16-bit counter, the week of GPS time, a leap
/// second and midnight UTC, within a minute of one another, through bytes and into the estimator, with every
/// kind of receiver.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "demo_vehicle.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;

/// 23:59:60 UTC comes 150 s into the drive, the new week of GPS time 17 s before.
constexpr const char* kStart = "2016-12-31T23:57:30Z";
constexpr double kLength_min = 4.0;
constexpr double kLeap_s = 150.0;
/// Of mtx1: its counter of 16 bits wraps with the leap second.
constexpr int kFirstCounter = 50536;

struct Receiver {
  const char* name;
  const char* protocol;
};
void PrintTo(const Receiver& receiver, std::ostream* out) { *out << receiver.name; }

/// One column of a run's CSV file.
std::vector<double> column(const fs::path& file, const std::string& name) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::istringstream header(line);
  std::size_t index = 0;
  for (std::string word; std::getline(header, word, ',') && word != name;) ++index;
  std::vector<double> values;
  while (std::getline(in, line)) {
    std::istringstream row(line);
    std::string word;
    for (std::size_t i = 0; i <= index; ++i) std::getline(row, word, ',');
    values.push_back(std::stod(word));
  }
  return values;
}

class Wraps : public testing::TestWithParam<Receiver> {};

TEST_P(Wraps, NothingIsLostAndNavigationNoticesNothing) {
  const auto folder = scratch_folder();
  const auto vehicle = DemoVehicle()
                           .start_at(kStart)
                           .set_truth("mtx1", "first_counter", kFirstCounter)
                           .set_device("gnss", "protocol", GetParam().protocol)
                           .write(folder / "vehicle.toml");
  ASSERT_EQ(run_program("imusim",
                        {"record", vehicle.string(), "--minutes", std::to_string(kLength_min), "--seed", "3",
                         "--out", (folder / "drive").string()},
                        folder / "imusim.log"),
            0)
      << read_text(folder / "imusim.log");
  ASSERT_EQ(
      run_program("imuscope",
                  {"replay", (folder / "drive" / "capture.lcm").string(), "--out", (folder / "run").string()},
                  folder / "replay.log"),
      0)
      << read_text(folder / "replay.log");

  const auto run = read_json(folder / "run" / "run.json");
  for (const auto& device : run.at("devices")) {
    SCOPED_TRACE(device.dump());
    for (const char* count : {"samples_lost", "clock_resets", "bad_contents", "bytes_skipped"})
      EXPECT_EQ(device.at(count), 0) << count;
  }
  for (const auto& event : run.at("events")) {
    EXPECT_EQ(event.at("text").get<std::string>().find("rejected"), std::string::npos) << event.dump();
  }

  // Rows follow each other sample by sample, through the counter's wrap and the leap second.
  const auto counter = column(folder / "run" / "errors_mtx1.csv", "counter");
  const auto time_s = column(folder / "run" / "errors_mtx1.csv", "time_s");
  ASSERT_GT(time_s.size(), 10'000U);
  EXPECT_LT(time_s.front(), kLeap_s - 30.0);
  EXPECT_GT(time_s.back(), kLeap_s + 60.0);
  EXPECT_LT(counter.front(), 65'536.0);
  EXPECT_GT(counter.back(), 65'536.0);
  constexpr double kPeriod_s = 0.01;
  constexpr double kClockMap_s = 0.0005;  // how far the map of a clock behind USB frames moves in one sample
  for (std::size_t i = 1; i < time_s.size(); ++i) {
    ASSERT_EQ(counter[i], counter[i - 1] + 1.0) << time_s[i];
    ASSERT_NEAR(time_s[i] - time_s[i - 1], kPeriod_s, kClockMap_s) << time_s[i];
  }

  // UTC has the leap second, GPS time goes on through it, the week's begin with it.
  const auto row_s = column(folder / "run" / "navigation.csv", "time_s");
  const auto utc_s = column(folder / "run" / "navigation.csv", "utc_s");
  const auto week = column(folder / "run" / "navigation.csv", "gps_week");
  const auto tow_s = column(folder / "run" / "navigation.csv", "gps_tow_s");
  constexpr double kWeek_s = 7.0 * 86400.0;
  constexpr double kNewYear_utc_s = 1'483'228'800.0;
  constexpr double kNewYear_gps_s = 1930.0 * kWeek_s + 18.0;  // 2017-01-01 is the first day of week 1930
  ASSERT_LT(utc_s.front(), kNewYear_utc_s - 30.0);
  ASSERT_GT(utc_s.back(), kNewYear_utc_s + 60.0);
  int before = 0;
  for (std::size_t i = 0; i < utc_s.size(); ++i) {
    const double gps_s = week[i] * kWeek_s + tow_s[i];
    EXPECT_NEAR(gps_s - (week[0] * kWeek_s + tow_s[0]), row_s[i] - row_s[0], 0.02) << row_s[i];
    // While the second is inserted, and until the tags say so, nobody can tell one from the other.
    if (row_s[i] > kLeap_s - 0.1 && row_s[i] < kLeap_s + 1.2) continue;
    const bool is_new_year = row_s[i] > kLeap_s;
    EXPECT_NEAR(gps_s - kNewYear_gps_s, utc_s[i] - kNewYear_utc_s - (is_new_year ? 0.0 : 1.0), 2e-6)
        << row_s[i];
    before += is_new_year ? 0 : 1;
  }
  EXPECT_GT(before, 100);

  // Every fix is used: the position stays as well known as before, and as right as its sd says.
  const auto at_s = column(folder / "run" / "navigation.csv", "time_s");
  const auto sd_m = column(folder / "run" / "navigation.csv", "sd_n_m");
  const auto down_mps = column(folder / "run" / "navigation.csv", "v_d_mps");
  double before_m = 0.0;
  double after_m = 0.0;
  for (std::size_t i = 0; i < at_s.size(); ++i) {
    EXPECT_LT(std::abs(down_mps[i]), 3.0) << at_s[i];
    if (at_s[i] > kLeap_s - 30.0 && at_s[i] < kLeap_s - 1.0) before_m = std::max(before_m, sd_m[i]);
    if (at_s[i] > kLeap_s - 1.0 && at_s[i] < kLeap_s + 5.0) after_m = std::max(after_m, sd_m[i]);
  }
  constexpr double kSameTraffic = 1.2;
  EXPECT_LT(after_m, kSameTraffic * before_m);
}

INSTANTIATE_TEST_SUITE_P(Receivers, Wraps,
                         testing::Values(Receiver{"Greis", "greis"}, Receiver{"Nmea", "nmea"},
                                         Receiver{"Ubx", "ubx"}, Receiver{"Rtklib", "rtklib_pos"}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace imuscope::test
