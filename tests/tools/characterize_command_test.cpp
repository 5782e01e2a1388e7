/// `imuscope characterize` as a user meets it.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>
#include <vector>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;
using testing::Not;

struct Columns {
  std::string header;
  double gyro_factor = 1.0;   ///< of rad/s
  double accel_factor = 1.0;  ///< of m/s^2
};

class Characterize : public testing::Test {
 protected:
  /// A log of a sensor at rest, 100 Hz, a minute and a half.
  std::string log(const std::string& name, const Columns& columns, unsigned seed = 1) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::ofstream out(folder_ / name);
    out << columns.header << '\n';
    for (int i = 0; i < 9000; ++i) {
      out << fmt::format("{:.2f}", 0.01 * i);
      for (int k = 0; k < 3; ++k) out << fmt::format(",{:.7g}", columns.gyro_factor * 3e-3 * normal(random));
      for (int k = 0; k < 3; ++k)
        out << fmt::format(",{:.7g}", columns.accel_factor * ((k == 2 ? 9.81 : 0.0) + 0.02 * normal(random)));
      out << '\n';
    }
    return (folder_ / name).string();
  }
  int run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> all{"characterize"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return run_program("imuscope", all, folder_ / "log.txt");
  }
  std::string output() const { return read_text(folder_ / "log.txt"); }

  std::filesystem::path folder_ = scratch_folder();
};

// 3e-3 rad/s a sample at 100 Hz: 3e-4 rad/s/sqrt(Hz), 1.031 deg/sqrt(h); 0.02 m/s^2: 0.12 m/s/sqrt(h).
void expect_the_truth(const nlohmann::json& certificate) {
  ASSERT_EQ(certificate.at("axes").size(), 6U);
  for (const auto& axis : certificate.at("axes")) {
    const auto& n = axis.at("terms").at(0);
    EXPECT_EQ(n.at("symbol"), "N");
    const bool gyro = axis.at("name").get<std::string>().starts_with("gyro");
    EXPECT_NEAR(n.at("value").get<double>(), gyro ? 1.031 : 0.12, gyro ? 0.04 : 0.005) << axis.at("name");
  }
}

TEST_F(Characterize, ReadsAnyonesColumnsAndUnits) {
  const double deg = 180.0 / M_PI;
  const std::vector<Columns> all{
      {"time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"},
      {"time,wx [deg/s],wy [deg/s],wz [deg/s],ax [g],ay [g],az [g]", deg, 1.0 / 9.80665},
      {"t_s,AngularVelocity.X (dps),AngularVelocity.Y (dps),AngularVelocity.Z (dps),LinearAcceleration.X,"
       "LinearAcceleration.Y,LinearAcceleration.Z",
       deg, 1.0 / 9.80665},
      {"timestamp,imu.gyr_x.rad_s,imu.gyr_y.rad_s,imu.gyr_z.rad_s,acc_x_mg,acc_y_mg,acc_z_mg", 1.0,
       1000.0 / 9.80665}};
  for (const Columns& columns : all) {
    ASSERT_EQ(run({log("static.csv", columns), "--no-page", "--json"}), 0) << columns.header << output();
    expect_the_truth(nlohmann::json::parse(output()));
  }
}

TEST_F(Characterize, WritesAPageWithFiguresThatExportReads) {
  const Columns columns{
      "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const auto out = folder_ / "page";
  ASSERT_EQ(run({log("static.csv", columns), "--out", out.string(), "--sensor", "Unit <7>"}), 0) << output();
  const std::string page = read_text(out / "certificate.html");
  EXPECT_THAT(page, HasSubstr("Unit &lt;7&gt;"));
  EXPECT_THAT(page, HasSubstr("angle random walk (N)"));
  EXPECT_THAT(page, HasSubstr("data:image/svg+xml;base64,"));
  EXPECT_THAT(page, testing::Not(HasSubstr("<script")));
  for (const char* file : {"axis1.svg", "axis6.pdf", "allan_gyroscopes.gp"})
    EXPECT_TRUE(std::filesystem::exists(out / "figures" / file)) << file;
  ASSERT_EQ(
      run_program("imuscope", {"export", (out / "certificate.json").string(), "--to", "kalibr", "--force"},
                  folder_ / "kalibr.yaml"),
      0);
  EXPECT_THAT(read_text(folder_ / "kalibr.yaml"), HasSubstr("gyroscope_noise_density: 3.0"));
  // Once more is no surprise, but a page of somebody's own stays.
  EXPECT_EQ(run({log("static.csv", columns), "--out", out.string()}), 0) << output();
  std::filesystem::remove(out / "certificate.json");
  EXPECT_EQ(run({log("static.csv", columns), "--out", out.string()}), 2);
  EXPECT_THAT(output(), HasSubstr("was not written by this command"));
}

TEST_F(Characterize, TablesForPapersSayWhatTheDocumentSays) {
  const Columns columns{
      "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const std::string file = log("static.csv", columns);
  const auto out = folder_ / "page";
  ASSERT_EQ(run({file, "--out", out.string(), "--table", "csv"}), 0) << output();
  const auto certificate = nlohmann::json::parse(read_text(out / "certificate.json"));
  std::istringstream table(output());
  std::string line;
  std::getline(table, line);
  EXPECT_EQ(line, "axis,term,value,ci_low,ci_high,bound,unit");
  for (const auto& axis : certificate.at("axes")) {
    for (const auto& term : axis.at("terms")) {
      ASSERT_TRUE(std::getline(table, line));
      std::string start =
          axis.at("name").get<std::string>() + "," + term.at("symbol").get<std::string>() + ",";
      if (term.at("known") != "unknown") start += fmt::format("{:.3g},", term.at("value").get<double>());
      EXPECT_TRUE(line.starts_with(start)) << line << " against " << start;
      EXPECT_THAT(line, HasSubstr(term.at("known") == "bound" ? ",1," : ",0,"));
    }
  }
  EXPECT_FALSE(std::getline(table, line));
  const std::string allan = read_text(out / "allan.csv");
  std::size_t points = 1;
  for (const auto& axis : certificate.at("axes")) points += axis.at("allan").size();
  EXPECT_EQ(static_cast<std::size_t>(std::count(allan.begin(), allan.end(), '\n')), points);
  ASSERT_EQ(run({file, "--no-page", "--table", "latex"}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("gyro\\_x & $N$ & 1.0"));
  ASSERT_EQ(run({file, "--no-page", "--table", "markdown"}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("| accel_z | N | 0.1"));
}

TEST_F(Characterize, ATerminalShowsThePointsOfWvAndFit) {
  const Columns columns{
      "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const std::string file = log("static.csv", columns);
  ASSERT_EQ(run_program("imuscope", {"fit", file, "--column", "gyro_x_radps", "--model", "WN", "--plot"},
                        folder_ / "log.txt"),
            0)
      << output();
  // White noise falls by a decade a decade: the first point stands at the left and above, the last one at the
  // right.
  std::vector<std::size_t> columns_of_points;
  std::istringstream lines(output());
  for (std::string line; std::getline(lines, line);) {
    const auto axis = line.find(" |");
    if (axis == std::string::npos) continue;
    for (auto at = line.find('o', axis); at != std::string::npos; at = line.find('o', at + 1))
      columns_of_points.push_back(at);
  }
  EXPECT_GE(columns_of_points.size(), 8U) << output();
  EXPECT_TRUE(std::is_sorted(columns_of_points.begin(), columns_of_points.end())) << output();
}

TEST_F(Characterize, UnitsStandBesideEachOther) {
  const Columns columns{
      "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const Columns loud{columns.header, 2.0, 1.0};
  std::vector<std::string> arguments{"--no-page"};
  for (unsigned seed = 1; seed <= 5; ++seed)
    arguments.push_back(log(fmt::format("unit{}.csv", seed), columns, seed));
  arguments.push_back(log("unit6.csv", loud, 6));
  ASSERT_EQ(run(arguments), 0) << output();
  EXPECT_THAT(output(), HasSubstr("All 6 records"));
  EXPECT_THAT(output(), HasSubstr("unit6 stands out: 2.0"));
  EXPECT_THAT(output(), HasSubstr("95 % are below"));
}

TEST_F(Characterize, StandsBesideADataSheet) {
  const Columns columns{
      "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const std::string file = log("static.csv", columns);
  const auto sheet = (folder_ / "sheets.json").string();
  // The truth is 1.031 deg/sqrt(h) and 0.12 m/s/sqrt(h): half of the first, twice the second are stated.
  std::ofstream(sheet) << R"json({"schema": "imuscope.data_sheets/1", "parts": [{"part": "A-1", "values": [
    {"axes": "gyro", "term": "N", "value": 0.5, "unit": "deg/sqrt(h)", "kind": "maximum",
     "document": "DS <9>", "revision": "C", "page": "7"},
    {"axes": "accel", "term": "N", "value": 0.24, "unit": "m/s/sqrt(h)",
     "document": "DS <9>", "revision": "C", "page": "8"}]}]})json";
  const auto out = folder_ / "page";
  ASSERT_EQ(run({file, "--out", out.string(), "--data-sheet", sheet}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("stated 0.5 deg/sqrt(h) (maximum): worse; DS <9>, C, page 7"));
  const auto certificate = nlohmann::json::parse(read_text(out / "certificate.json"));
  ASSERT_EQ(certificate.at("comparison").at("rows").size(), 6U);
  for (const auto& row : certificate.at("comparison").at("rows")) {
    const bool gyro = row.at("axis").get<std::string>().starts_with("gyro");
    EXPECT_EQ(row.at("verdict"), gyro ? "worse" : "better") << row;
  }
  EXPECT_THAT(read_text(out / "certificate.html"), HasSubstr("DS &lt;9&gt;, C, page 8"));
  EXPECT_THAT(read_text(out / "figures" / "allan_gyroscopes.gp"), HasSubstr("data sheet, N"));
  EXPECT_EQ(run({file, "--no-page", "--part", "A-1"}), 2);
  EXPECT_EQ(run({file, "--no-page", "--data-sheet", sheet, "--part", "B-2"}), 2);
  EXPECT_THAT(output(), HasSubstr("holds no part B-2"));
  EXPECT_EQ(run({file, "--no-page", "--data-sheet", (folder_ / "none.json").string()}), 1);
}

TEST_F(Characterize, EachImuOfACaptureIsARecord) {
  const auto capture = (folder_ / "golden.lcm").string();
  const std::string unpack =
      "gzip -dc '" + source_path("tests/golden/capture.lcm.gz").string() + "' > '" + capture + "'";
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  ASSERT_EQ(run({capture, "--no-page", "--json", "--name", "mtx1"}), 0) << output();
  const std::string text = output();
  const auto certificate = nlohmann::json::parse(text.substr(text.find('{')));
  EXPECT_EQ(certificate.at("selection"), "device mtx1");
  ASSERT_EQ(certificate.at("axes").size(), 6U);
  EXPECT_NEAR(certificate.at("rate_hz").get<double>(), 100.0, 0.1);
  // The golden errors hold as many samples as the S-IMU sent while the reference was there.
  EXPECT_GT(certificate.at("axes").at(0).at("n_samples").get<int>(), 1000);
  ASSERT_EQ(run({capture, "--no-page", "--json"}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("device airins"));
  EXPECT_EQ(run({capture, "--no-page", "--name", "nobody"}), 2);
  EXPECT_THAT(output(), HasSubstr("there is airins, mtx1"));
  std::ofstream(folder_ / "none.lcm") << "no capture";
  EXPECT_NE(run({(folder_ / "none.lcm").string(), "--no-page"}), 0);
  EXPECT_THAT(output(), HasSubstr("none.lcm"));
}

TEST_F(Characterize, BadInputGetsASentence) {
  const Columns good{"time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"};
  const auto refuses = [&](const std::vector<std::string>& arguments, int code, const std::string& words) {
    std::vector<std::string> all = arguments;
    all.emplace_back("--no-page");
    EXPECT_EQ(run(all), code) << output();
    EXPECT_THAT(output(), HasSubstr(words));
  };
  refuses({(folder_ / "none.csv").string()}, 1, "does not exist");
  refuses({log("a.csv", {"time_s,a1,a2,a3,a4,a5,a6"})}, 2, "no column whose name tells an axis");
  refuses({log("b.csv", {"time_s,wx,wy,wz,ax,ay,az"})}, 2, "give --gyro-unit rad/s or deg/s");
  refuses({log("c.csv", {"time_s,wx_radps,wy_radps,wz_radps,ax,ay,az", 1.0, 3.0})}, 2, "no size of gravity");
  refuses({log("d.csv", good), "--rate", "200"}, 2, "100");
  refuses({log("e.csv", good), "--axis", "roll=wx"}, 2, "--axis roll=wx is not understood");
  refuses({log("f.csv", good), "--axis", "gyro_x=nothing"}, 2, "has no column 'nothing'");
  std::ofstream(folder_ / "short.csv") << "time_s,gyro_x_radps\n0,0.1\n0.01,0.2\n0.02,0.3\n0.03,0.1\n";
  refuses({(folder_ / "short.csv").string()}, 1, "4 valid samples are too few");
  std::ofstream(folder_ / "text.csv") << "time_s,gyro_x_radps\n0,zero\n";
  refuses({(folder_ / "text.csv").string()}, 1, "'zero' is not a number");
  std::ofstream(folder_ / "sound.f64") << "12345678";
  refuses({(folder_ / "sound.f64").string(), "--rate", "100"}, 2, "tells no axis");
}

TEST_F(Characterize, UnitsThatDoNotGoTogetherAreTold) {
  const std::string mixed = log(
      "mixed.csv", {"time_s,gyro_x_degps,gyro_y_radps,gyro_z_degps,accel_x_mps2,accel_y_mps2,accel_z_mps2"});
  EXPECT_EQ(run({mixed, "--no-page"}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("gyro_x is in deg/s and gyro_y in rad/s by their names"));
  EXPECT_THAT(output(), Not(HasSubstr("and gravity is")));
  const std::string in_g =
      log("in_g.csv", {"time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_g,accel_y_g,accel_z_g"});
  EXPECT_EQ(run({in_g, "--no-page"}), 0) << output();
  EXPECT_THAT(output(), HasSubstr("and gravity is 9.81"));
  EXPECT_THAT(output(), Not(HasSubstr("by their names")));
}

// Raw files of more than 96 MB together are fetched axis by axis, and what they have in common is looked for in means.
TEST_F(Characterize, ALongRecordIsFetchedAndSaysInWhatItsAxesWereCompared) {
  constexpr std::size_t kSamples = 6'400'000;
  constexpr double kSd_radps = 1e-3;
  constexpr double kRate_hz = 200.0;
  std::mt19937_64 random(5);
  std::normal_distribution<double> white(0.0, kSd_radps);
  std::vector<double> samples(kSamples);
  for (const char* name : {"gyro_x_radps.f64", "gyro_y_radps.f64"}) {
    std::ranges::generate(samples, [&] { return white(random); });
    std::ofstream file(folder_ / name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(samples.data()),
               static_cast<std::streamsize>(samples.size() * sizeof(double)));
  }
  ASSERT_EQ(run({(folder_ / "gyro_x_radps.f64").string(), (folder_ / "gyro_y_radps.f64").string(), "--rate",
                 "200", "--no-page", "--json"}),
            0)
      << output();
  const auto page = nlohmann::json::parse(output());
  EXPECT_EQ(page.at("correlation_of_means_s").get<double>(), 4.0 / kRate_hz)
      << "the least power of two below 2^21";
  const double n = page.at("axes").at(0).at("terms").at(0).at("value").get<double>();
  const double truth = kSd_radps / std::sqrt(kRate_hz) * 60.0 * 180.0 / std::numbers::pi;
  EXPECT_NEAR(n, truth, 0.02 * truth);
}

// A real sensor: the resonance of its z gyroscope near 20 Hz, and a random walk that is no white noise's.
TEST_F(Characterize, ARealGyroscopeHasItsResonanceNamed) {
  IMUSCOPE_NEEDS_SHARED("data/adis16405_static/gyro_z_degps.f64");
  const auto file = shared_path("data/adis16405_static/gyro_z_degps.f64");
  ASSERT_EQ(run({file.string(), "--rate", "100", "--no-page", "--json"}), 0) << output();
  const auto axis = nlohmann::json::parse(output()).at("axes").at(0);
  ASSERT_FALSE(axis.at("resonances").empty());
  EXPECT_NEAR(axis.at("resonances").at(0).at("frequency_hz").get<double>(), 20.0, 0.5);
  const double n = axis.at("terms").at(0).at("value").get<double>();
  for (const auto& point : axis.at("allan")) {
    const double tau_s = point.at("tau_s").get<double>();
    if (tau_s < 1.0 || tau_s > 4.0) continue;
    EXPECT_NEAR(60.0 * point.at("deviation").get<double>() * std::sqrt(tau_s), n, 0.05 * n) << tau_s;
  }
}

double named(const nlohmann::json& axis, const char* symbol) {
  for (const auto& term : axis.at("terms")) {
    if (term.at("symbol") == symbol) return term.at("value").get<double>();
  }
  return std::numeric_limits<double>::quiet_NaN();
}

bool is_named(const nlohmann::json& of_axis, double frequency_hz, double within_hz) {
  return std::ranges::any_of(of_axis, [&](const nlohmann::json& one) {
    return std::abs(one.at("frequency_hz").get<double>() - frequency_hz) < within_hz;
  });
}

/// A model near every level, N and B as the curve has them.
void expect_honest(const nlohmann::json& axis) {
  constexpr double kNear = 0.05;
  for (const auto& level : axis.at("fit").at("wv")) {
    const double fitted = level.at("fitted").get<double>();
    const double value = level.at("value").get<double>();
    const bool in_interval =
        fitted >= level.at("ci_low").get<double>() && fitted <= level.at("ci_high").get<double>();
    EXPECT_TRUE(std::abs(fitted - value) <= kNear * value || in_interval)
        << level.at("level") << ": " << fitted / value;
  }
  const bool is_gyro = axis.at("unit") == "deg/s";
  const double per_root_hour = is_gyro ? 60.0 : 60.0 * 9.80665;
  const double per_hour = is_gyro ? 3600.0 : 1e6;
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& point : axis.at("allan")) {
    const double deviation = point.at("deviation").get<double>();
    smallest = std::min(smallest, deviation);
    const double tau_s = point.at("tau_s").get<double>();
    if (tau_s < 0.8 || tau_s > 1.3) continue;  // as a filter feels it: at a second
    EXPECT_NEAR(per_root_hour * deviation * std::sqrt(tau_s), named(axis, "N"), kNear * named(axis, "N"))
        << tau_s;
  }
  for (const auto& term : axis.at("terms")) {
    if (term.at("symbol") != "B" || term.at("known") == "bound") continue;
    constexpr double kFlickerOfMinimum = 0.664;  // IEEE Std 952
    const double of_curve = per_hour * smallest / kFlickerOfMinimum;
    EXPECT_NEAR(term.at("value").get<double>(), of_curve, 0.1 * of_curve);
  }
}

TEST_F(Characterize, SixRealAxesAreDescribedAsTheyAre) {
  IMUSCOPE_NEEDS_SHARED("data/adis16405_static/gyro_z_degps.f64");
  std::vector<std::string> arguments;
  for (const char* name :
       {"gyro_x_degps", "gyro_y_degps", "gyro_z_degps", "accel_x_g", "accel_y_g", "accel_z_g"})
    arguments.push_back(shared_path(std::string("data/adis16405_static/") + name + ".f64").string());
  for (const char* option : {"--rate", "100", "--no-page", "--json"}) arguments.emplace_back(option);
  ASSERT_EQ(run(arguments), 0) << output();
  const auto axes = nlohmann::json::parse(output()).at("axes");
  ASSERT_EQ(axes.size(), 6U);
  for (const auto& axis : axes) {
    SCOPED_TRACE(axis.at("name").get<std::string>());
    expect_honest(axis);
    if (axis.at("unit") == "deg/s") continue;
    EXPECT_TRUE(is_named(axis.at("lines"), 0.565, 0.005));
    EXPECT_TRUE(is_named(axis.at("lines"), 1.69, 0.01));
  }
  EXPECT_TRUE(is_named(axes.at(2).at("resonances"), 20.0, 0.5));
  EXPECT_TRUE(is_named(axes.at(3).at("resonances"), 10.0, 0.5));
}

}  // namespace
}  // namespace imuscope::test
