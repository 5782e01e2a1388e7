/// The UTC of the rows of a run against the simulator's: through bytes, the clock maps and the time scale, on
/// a PC whose clock is fast, and where the recording was made the regimes that a person named in UTC.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;

/// Rows of a CSV file by the names of columns.
class Rows {
 public:
  explicit Rows(const fs::path& file) {
    std::ifstream in(file);
    std::string line;
    std::getline(in, line);
    std::istringstream header(line);
    for (std::string name; std::getline(header, name, ',');) names_.push_back(name);
    while (std::getline(in, line)) {
      std::istringstream cells(line);
      std::vector<std::string> row;
      for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
      row.resize(names_.size());
      rows_.push_back(std::move(row));
    }
  }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] const std::string& cell(std::size_t row, const std::string& name) const {
    const auto place = std::find(names_.begin(), names_.end(), name) - names_.begin();
    return rows_.at(row).at(static_cast<std::size_t>(place));
  }
  [[nodiscard]] double number(std::size_t row, const std::string& name) const {
    return std::stod(cell(row, name));
  }

 private:
  std::vector<std::string> names_;
  std::vector<std::vector<std::string>> rows_;
};

/// "2026-03-14T09:30:00.004500Z", split so that microseconds survive.
struct Begin {
  std::int64_t s;
  double fraction_s;
};
Begin begin_of(const nlohmann::json& truth) {
  const std::string text = truth.at("t0_utc");
  std::tm parts{};
  std::istringstream(text) >> std::get_time(&parts, "%Y-%m-%dT%H:%M:%S");
  return {timegm(&parts), std::stod("0" + text.substr(text.find('.')))};
}

/// Seconds of UTC since the simulator's first R-IMU sample.
double since(const Begin& begin, const std::string& utc_s) {
  const auto point = utc_s.find('.');
  EXPECT_EQ(utc_s.size() - point, 7U) << "microseconds: " << utc_s;
  return static_cast<double>(std::stoll(utc_s.substr(0, point)) - begin.s) +
         std::stod("0" + utc_s.substr(point)) - begin.fraction_s;
}

double of_95_percent(std::vector<double> errors) {
  const auto place = errors.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(errors.size()));
  std::nth_element(errors.begin(), place, errors.end());
  return *place;
}

TEST(Utc, EveryRowHasThatOfTheSimulator) {
  const auto folder = scratch_folder();
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/demo.toml").string(), "--minutes", "4", "--seed", "5",
                         "--pc-ppm", "40", "--out", (folder / "drive").string()},
                        folder / "imusim.log"),
            0)
      << read_text(folder / "imusim.log");
  const auto truth = read_json(folder / "drive" / "truth.json");
  const Begin begin = begin_of(truth);
  std::ofstream(folder / "labels.csv") << "begin_utc,end_utc,regime\n"
                                       << begin.s + 100 << ".5," << begin.s + 130 << ",wet\n";
  const auto capture = (folder / "drive" / "capture.lcm").string();
  ASSERT_EQ(run_program("imuscope",
                        {"process", capture, "--out", (folder / "study").string(), "--labels",
                         (folder / "labels.csv").string()},
                        folder / "process.log"),
            0)
      << read_text(folder / "process.log");

  const auto run = read_json(folder / "study" / "run.json");
  const auto& time_scale = run.at("time_scale");
  EXPECT_EQ(time_scale.at("utc_from"), "reference");
  EXPECT_EQ(time_scale.at("gps_minus_utc_s"), 18);
  EXPECT_NEAR(time_scale.at("host_clock_ppm").get<double>(), 40.0, 0.5);
  EXPECT_LT(time_scale.at("sd_utc_s").get<double>(), 60e-6);
  ASSERT_FALSE(run.at("events").empty());
  EXPECT_EQ(run.at("events")[0].at("utc").get<std::string>().substr(0, 11), "2026-03-14T");

  // The R-IMU samples on the hundredths of a second of UTC and tells them in ticks of 100 us.
  const Rows navigation(folder / "study" / "navigation.csv");
  ASSERT_GT(navigation.size(), 1000U);
  std::vector<double> errors;
  constexpr double kWeek_s = 604'800.0;
  constexpr double kGpsEpoch_s = 315'964'800.0;
  for (std::size_t i = 0; i < navigation.size(); ++i) {
    const double t_s = since(begin, navigation.cell(i, "utc_s"));
    errors.push_back(std::abs(std::remainder(t_s, 0.01)));
    ASSERT_NEAR(navigation.number(i, "time_s"), t_s * (1.0 + 40e-6), 2e-3) << i;
    const double gps_s = navigation.number(i, "gps_week") * kWeek_s + navigation.number(i, "gps_tow_s");
    EXPECT_NEAR(gps_s, navigation.number(i, "utc_s") + 18.0 - kGpsEpoch_s, 1e-6) << i;
  }
  EXPECT_LT(of_95_percent(errors), 60e-6);
  const Rows smoothed(folder / "study" / "smoothed_navigation.csv");
  errors.clear();
  for (std::size_t i = 0; i < smoothed.size(); ++i)
    errors.push_back(std::abs(std::remainder(since(begin, smoothed.cell(i, "utc_s")), 0.01)));
  EXPECT_LT(of_95_percent(errors), 60e-6);

  // An S-IMU's row has the UTC of the motion that it shows: of the sample's instant, less the sensor's own
  // delay. How well that is known, its time offset says.
  const auto calibration = read_json(folder / "study" / "calibration.json");
  for (const auto& imu : truth.at("imus")) {
    const std::string name = imu.at("name");
    SCOPED_TRACE(name);
    const auto found = std::find_if(calibration.at("imus").begin(), calibration.at("imus").end(),
                                    [&](const auto& one) { return one.at("name") == name; });
    ASSERT_NE(found, calibration.at("imus").end());
    const double sd_s = found->at("t_d_sd_s").get<double>();
    const auto& sampled = imu.at("sample_time");
    const Rows rows(folder / "study" / ("errors_" + name + ".csv"));
    ASSERT_GT(rows.size(), 5000U);
    errors.clear();
    int labelled = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double k = rows.number(i, "counter") - sampled.at("counter0").get<double>();
      const double shown_s = sampled.at("t0_s").get<double>() + k * sampled.at("period_s").get<double>() -
                             imu.at("gyro_delay_s").get<double>();
      const double t_s = since(begin, rows.cell(i, "utc_s"));
      errors.push_back(std::abs(t_s - shown_s));
      // A person's label holds from the second that was named, to a sample.
      if (t_s < 100.47 - begin.fraction_s || t_s > 130.03 - begin.fraction_s) {
        EXPECT_EQ(rows.cell(i, "regime"), "") << t_s;
      } else if (t_s > 100.53 - begin.fraction_s && t_s < 129.97 - begin.fraction_s) {
        EXPECT_EQ(rows.cell(i, "regime"), "wet") << t_s;
        ++labelled;
      }
    }
    EXPECT_GT(labelled, 2900);
    // A clock map behind USB frames wanders by a tenth of a millisecond about the offset that is estimated of
    // it.
    EXPECT_LT(of_95_percent(errors), 0.15e-3 + 3.0 * sd_s);
  }
}

}  // namespace
}  // namespace imuscope::test
