// Whole outputs of a fleet: every table of the catalogue, the page, its drawings, what a population tells.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <cmath>
#include <fstream>
#include <map>
#include <regex>

#include "base/units.h"
#include "fleet/catalogue.h"
#include "fleet/content_hash.h"
#include "fleet/fleet_page.h"
#include "fleet/page_pictures.h"
#include "fleet/population.h"
#include "fleet/study_summary.h"
#include "fleet/unit_task.h"
#include "made_campaign.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/markup.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Between -1 and 1, the same wherever it is asked for.
double chance(int a, int b = 0, int c = 0) { return std::sin(12.9898 * a + 78.233 * b + 37.719 * c + 0.5); }

constexpr int kUnitsMade = 5;
constexpr int kDrivesMade = 5;

json measurements_of_drive(int unit, int drive, int device) {
  json rows = json::array();
  const double louder = unit == 2 ? 1.1 : 0.0;
  const double drifts = unit == 1 ? 0.25 * drive : 0.0;
  const double odd = unit == 3 && drive == 2 ? 0.9 : 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string xyz(1, static_cast<char>('x' + axis));
    const auto by_chance = [&](int what) { return 0.05 * chance(unit + 7 * device, drive, 3 * what + axis); };
    rows.push_back({"angle random walk", "static", "gyro_" + xyz, "deg/sqrt(h)", true,
                    -0.2 + 0.1 * axis + louder + by_chance(1) + (axis == 0 ? odd : 0.0), 0.03});
    rows.push_back(
        {"angle random walk", "dynamic", "gyro_" + xyz, "deg/sqrt(h)", true, 0.3 + by_chance(2), 0.04});
    rows.push_back({"velocity random walk", "static", "accel_" + xyz, "m/s/sqrt(h)", true,
                    -2.0 + by_chance(3) + drifts, 0.03});
    rows.push_back(
        {"bias instability", "static", "gyro_" + xyz, "deg/h", true, 1.5 + 3.0 * by_chance(4), 0.1});
    rows.push_back({"bias instability", "static", "accel_" + xyz, "ug", true, 3.5 + 3.0 * by_chance(5), 0.1});
    rows.push_back({"gyro bias", "", xyz, "deg/s", false,
                    0.4 * chance(unit, device, axis) + by_chance(6) + 0.002 * (unit + 5 * drive), 0.01});
  }
  rows.push_back({"no", "measurement"});
  return rows;
}

json imu_of_drive(int unit, int drive, int device) {
  const double turn = 0.01 * (unit + 1) * drive;
  json imu{{"device", device == 0 ? "imu" : "other"},
           {"status", drive == 4 ? "converging" : "calibrated"},
           {"usability", unit == 4 && drive > 2 ? "not usable" : "usable"},
           {"temperature_degC", drive == 3 ? json(nullptr) : json(12.0 + 3.0 * drive + unit)},
           {"measurements", measurements_of_drive(unit, drive, device)},
           {"models",
            {{{"axis", "gyro_x"},
              {"regime", "static"},
              {"model", "WN+GM"},
              {"p_value", 0.01 * (drive + 1)},
              {"identifiable", drive == 1 ? "false" : "true"},
              {"simpler_model", drive == 2 ? "WN" : ""},
              {"seconds", 100.0 + drive},
              {"parameters",
               {{"GM1", "beta", "1/s", 0.02 + 0.001 * drive, 0.004, 0.01, 0.03},
                {"GM1", "sigma2", "(rad/s)^2", 1e-8 * (1 + unit), 2e-9, nullptr, 5e-8}}}}}},
           {"C_b_s", {std::cos(turn), -std::sin(turn), 0, std::sin(turn), std::cos(turn), 0, 0, 0, 1}},
           {"boresight_sd_deg", {0.011, 0.013, 0.012}},
           {"r_bs_b_m", {0.1 + 0.001 * drive, 0.2, 0.3 + 0.01 * unit}},
           {"r_bs_b_sd_m", {0.001, 0.002, 0.0015}},
           {"t_d_s", 0.001 * drive},
           {"t_d_sd_s", 1e-4}};
  if (unit < 3)
    imu["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.0138},
                         {"gyro_bias_stability_deg_per_h", 5.0},
                         {"accel_density_ug_per_sqrt_hz", 230.0},
                         {"accel_bias_stability_ug", 0.0}};
  return imu;
}

json result_of_drive(const fleet::StudyTask& task, int unit, int drive) {
  json result = made_result(task, 70 * drive + unit, [](const std::string&) { return 0.0; });
  json& summary = result["summary"];
  summary["duration_s"] = 900.0 + drive;
  summary["static_s"] = 300.0 + unit;
  summary["dynamic_s"] = 500.0 + unit;
  summary["gnss_used"] = unit == 0 && drive == 1 ? json(nullptr) : json(9000 + drive);
  summary["distance_m"] = 5000.0 + 100.0 * unit + drive;
  summary["track"] = json::array();
  for (int i = 0; i < 4 && !(unit == 1 && drive == 1); ++i)
    summary["track"].push_back({46.5 + 0.01 * unit + 0.002 * i, 6.5 + 0.003 * drive + 0.001 * i * i});
  summary["warnings"] = 2 * unit + drive;
  if (unit == 1)
    summary["findings"] = {{{"harm", "note"}, {"check", "rest"}, {"device", "imu"}, {"text", "never rests"}},
                           {{"harm", drive % 2 == 0 ? "limits" : "wrong"},
                            {"check", "rate"},
                            {"device", "ref"},
                            {"text", "a, \"b\"\nc"}}};
  summary["devices"] = {{{"device", "imu"},
                         {"role", "study"},
                         {"protocol", "xsens_mt"},
                         {"samples", 90000 + unit},
                         {"samples_lost", drive},
                         {"bad_frames", 1.0},
                         {"late", 2},
                         {"problem", ""}},
                        {{"device", "ref"},
                         {"role", "reference"},
                         {"protocol", "csv_imu"},
                         {"samples", 80000},
                         {"samples_lost", nullptr},
                         {"bad_frames", 0.0},
                         {"late", 0},
                         {"problem", "none"}}};
  summary["imus"] = {imu_of_drive(unit, drive, 0)};
  if (unit == 0) summary["imus"].push_back(imu_of_drive(unit, drive, 1));
  return result;
}

class WholeFleet : public testing::Test {
 protected:
  WholeFleet() : fleet_(make_fleet(folder_, kUnitsMade, kDrivesMade)) {
    add_certificate();
    plan_ = *fleet::plan_campaign(fleet_, kMadeProgram);
    int place = 0;
    for (const auto& task : plan_.studies) {
      const int unit = place / kDrivesMade;
      const int drive = place % kDrivesMade;
      ++place;
      if (unit == 4 && drive == 4) continue;  // not yet
      json result = result_of_drive(task, unit, drive);
      if (unit == 4 && drive == 3) {
        result["state"] = "refused";
        result["reason"] = "no reference";
        result.erase("summary");
      }
      publish(task, result);
    }
    for (const auto& task : plan_.units) EXPECT_TRUE(fleet::do_unit(task, kMadeProgram));
    const auto written = fleet::write_catalogue(fleet_, plan_);
    EXPECT_TRUE(written) << written.error().text();
  }

  /// Of two units; one is noisier than it says.
  void add_certificate() {
    for (const char* unit : {"unit00", "unit03"}) {
      json axes = json::array();
      for (const char* axis : {"gyro_x", "gyro_y", "accel_x"})
        axes.push_back(
            {{"name", axis},
             {"terms",
              {{{"symbol", "N"}, {"value", unit[5] == '0' ? 0.8 : 0.3}, {"ci_low", 0.28}, {"ci_high", 0.9}},
               {{"symbol", "B"}, {"value", 4.0}, {"ci_low", 3.5}, {"ci_high", 4.5}},
               {{"symbol", "K"}, {"value", 4.0}, {"ci_low", 3.5}, {"ci_high", 4.5}},
               {{"symbol", "B"}, {"value", 4.0}, {"ci_low", 0.0}, {"ci_high", 4.5}}}}});
      write_file(folder_ / (std::string(unit) + ".json"), json{{"axes", axes}}.dump());
      fleet_.certificates[unit] = folder_ / (std::string(unit) + ".json");
    }
  }

  [[nodiscard]] std::string tables_text(const std::vector<std::string>& names) const {
    const fs::path tables = folder_ / "tables";
    EXPECT_TRUE(fleet::export_csv(fleet_.out / fleet::kCatalogue, tables));
    std::string text;
    for (const auto& name : names) text += name + '\n' + content_of(tables / (name + ".csv"));
    return text;
  }

  fs::path folder_ = scratch_folder();
  fleet::FleetFile fleet_;
  fleet::Plan plan_;
};

TEST_F(WholeFleet, TablesHoldWhatTheStudiesTold) {
  expect_recorded("fleet/drives.txt",
                  tables_text({"versions", "vehicles", "units", "mountings", "captures", "drives", "tracks",
                               "findings", "health", "calibrations"}));
  expect_recorded("fleet/units.txt",
                  tables_text({"quantities", "unit_mountings", "population", "outliers", "drifts",
                               "certificates", "attempts", "other_results"}),
                  1e-4, 1e-9);
}

TEST_F(WholeFleet, SomeRowsOfTheLongTablesHoldTheirNumbers) {
  std::string text;
  for (const char* name : {"models", "parameters", "measurements", "unit_results"}) {
    const std::string table = tables_text({name});
    std::size_t row = 0;
    for (std::size_t begin = 0; begin < table.size(); ++row) {
      const std::size_t end = table.find('\n', begin);
      if (row < 4 || row % 23 == 0) text += table.substr(begin, end + 1 - begin);
      begin = end + 1;
    }
    text += fmt::format("{} rows\n", row);
  }
  expect_recorded("fleet/rows.txt", text, 1e-4, 1e-9);
}

TEST_F(WholeFleet, ThePageShowsTheCatalogue) {
  const auto page = fleet::write_fleet_page(fleet_.out, "the fleet");
  ASSERT_TRUE(page) << page.error().text();
  const std::string html = content_of(*page);
  const std::string markup = std::regex_replace(lines_of_markup(html), std::regex("sha256-[^']*"), "HASH");
  expect_recorded("fleet/page.txt", markup, 1e-3);
  const std::size_t begin = html.find('{', html.find("application/json"));
  const json data = json::parse(html.substr(begin, html.find("</script>", begin) - begin));
  expect_recorded("fleet/page_data.txt", data.dump(1), 1e-4);
}

// The made runs say no status, so that there is no mounting to combine.
TEST(WholeUnit, HoldsTheMeansOfItsDrives) {
  const auto folder = scratch_folder();
  const auto fleet = make_fleet(folder, 1, 3);
  const auto plan = *fleet::plan_campaign(fleet, kMadeProgram);
  int drive = 0;
  for (const auto& task : plan.studies) {
    publish(task, result_of_drive(task, 0, drive));
    const auto run = task.out / "studies" / task.key / "run";
    fs::create_directories(run);
    write_synthetic_run(
        run, {.duration_s = 13.0, .names = {"imu", "other"}, .boresight_sd_deg = 0.01 + 0.002 * drive});
    ++drive;
  }
  ASSERT_TRUE(fleet::do_unit(plan.units.front(), kMadeProgram));
  EXPECT_TRUE(fleet::unit_is_done(plan.units.front()));
  const json unit =
      json::parse(content_of(plan.units.front().out / "units" / (plan.units.front().key + ".json")));
  expect_recorded("fleet/unit.txt", unit.dump(1), 1e-4, 1e-9);
}

/// What a study writes of two S-IMUs that sat alike in all drives.
void write_mountings(const fs::path& run, int drive, double variance) {
  json covariance = json::array();
  for (int i = 0; i < 36; ++i) covariance.push_back(i % 7 == 0 ? variance * (1 + i) : 1e-8);
  const double turn = 0.3 + 1e-3 * chance(drive);
  json imus = json::array();
  for (const char* name : {"other", "imu"}) {
    imus.push_back(
        {{"name", name},
         {"status", "calibrated"},
         {"C_b_s", {std::cos(turn), -std::sin(turn), 0, std::sin(turn), std::cos(turn), 0, 0, 0, 1}},
         {"r_bs_b_m", {0.35, -0.22 + 3e-3 * chance(drive, 1), 0.12}},
         {"covariance_psi_r", covariance}});
  }
  fs::create_directories(run);
  write_file(run / "calibration.json", json{{"schema", "imuscope.calibration/1"}, {"imus", imus}}.dump());
  write_file(run / "run.json",
             json{{"schema", "imuscope.run/1"}, {"inputs", {fmt::format("drive{}", drive)}}}.dump());
}

TEST(WholeUnit, CombinesTheMountingsOfItsDrives) {
  std::string text;
  for (const double variance : {1e-6, -1.0}) {
    const auto folder = scratch_folder() / (variance > 0.0 ? "right" : "wrong");
    fs::create_directories(folder);
    const auto fleet = make_fleet(folder, 1, 3);
    const auto plan = *fleet::plan_campaign(fleet, kMadeProgram);
    int drive = 0;
    for (const auto& task : plan.studies) {
      publish(task, result_of_drive(task, 0, drive));
      write_mountings(task.out / "studies" / task.key / "run", drive, variance);
      ++drive;
    }
    ASSERT_TRUE(fleet::do_unit(plan.units.front(), kMadeProgram));
    const auto file = plan.units.front().out / "units" / (plan.units.front().key + ".json");
    text += json::parse(content_of(file))["mountings"].dump(1) + "\n";
  }
  expect_recorded("fleet/unit_mountings.txt", text, 1e-4, 1e-9);
}

TEST(FleetPictures, DrawTheMapToItsScale) {
  std::string text;
  const auto draw = [&](const std::string& title, const std::vector<fleet::MapTrack>& tracks) {
    text += title + "\n" + lines_of_markup(fleet::map_of(tracks).str()) + "\n";
  };
  draw("nothing", {});
  draw("no points", {{"wrong", {}}});
  draw("one yard", {{"", {{46.5, 6.5}, {46.50001, 6.50001}}}});
  draw("wide", {{"wrong", {{46.5, 6.5}, {46.52, 6.9}, {46.51, 7.1}}},
                {"limits", {{46.4, 6.6}, {46.4, 6.7}}},
                {"note", {{46.45, 6.55}, {46.6, 6.8}}},
                {"", {}}});
  draw("high", {{"", {{-33.0, 151.0}, {-33.4, 151.01}, {-34.0, 151.2}}}});
  draw("at the pole", {{"", {{89.99999, 0.0}, {90.0, 10.0}}}});
  for (const double size : {0.0021, 0.0059, 0.011, 0.027, 0.055, 0.6})
    draw(fmt::format("{} deg", size), {{"", {{10.0, 10.0}, {10.0, 10.0 + size}}}});
  std::vector<std::pair<double, double>> many;
  for (int i = 0; i < 60001; ++i)
    many.emplace_back(46.0 + 0.004 * std::sin(0.0002 * i), 6.0 + 0.004 * std::cos(0.0003 * i));
  const std::string path = fleet::map_of({{"", many}}).str();
  text += fmt::format("{} points of 60001\n", std::count(path.begin(), path.end(), 'L'));
  many.pop_back();
  const std::string all = fleet::map_of({{"", many}}).str();
  text +=
      fmt::format("{} points of 60000\n{}\n", std::count(all.begin(), all.end(), 'L'), all.substr(0, 400));
  expect_recorded("fleet/maps.txt", text);
}

TEST(FleetPictures, DrawDistributionsAsDotsOrBars) {
  std::string text;
  const auto draw = [&](const std::string& title, bool is_log, const std::vector<fleet::AxisValues>& axes,
                        std::optional<double> sheet) {
    text += title + "\n" +
            lines_of_markup(fleet::distribution_of("words <of> it", is_log, axes, sheet).str()) + "\n";
  };
  const auto values = [](std::size_t n, double scale) {
    std::vector<double> all;
    for (std::size_t i = 0; i < n; ++i)
      all.push_back(scale * (2.0 + std::pow(chance(static_cast<int>(i)), 3)));
    return all;
  };
  draw("nothing", false, {}, std::nullopt);
  draw("dots", false,
       {{"gyro_x", {0.1, 0.11, 0.11, 0.25, -0.05}, {false, true, false, false, true}, -0.08, 0.3},
        {"gyro_y", {0.2, std::nan("")}, {true, false}, std::nullopt, 0.3}},
       0.22);
  draw("dots of logarithms", true,
       {{"accel_x", {1.2, 1.3, 1.9, 3.0, -1.0}, {false, true, false, false, false}, 1.0, 3.5}}, 1.1);
  draw("one", false, {{"x", {5.0}, {false}, {}, {}}}, {});
  draw("one logarithm", true, {{"x", {5.0}, {false}, {}, {}}}, 5.0);
  for (const std::size_t n : {60, 61}) {
    std::vector<bool> out(n, false);
    out[3] = out[40] = true;
    draw(fmt::format("{} units", n), n == 61, {{"gyro_z", values(n, 7.0), out, 8.0, 20.0}}, 19.0);
  }
  expect_recorded("fleet/distributions.txt", text);
}

/// A fleet of one quantity whose numbers follow from formulas.
fleet::Fleet made_population(bool is_log, bool from_first, int units, int drives) {
  fleet::Fleet all;
  all.devices = {"a", "b"};
  fleet::Quantity quantity{"noise", "static", "x", "unit", is_log, from_first, {}, {}};
  fleet::Quantity parameter{"GM1 beta", "static", "x", "1/s", true, false, {}, {}};
  for (int u = 0; u < units; ++u) {
    all.units.push_back(fmt::format("u{}", u));
    for (int d = 0; d < drives; ++d) {
      const auto capture = static_cast<std::uint32_t>(all.captures.size());
      all.captures.push_back(fmt::format("c{}", capture));
      all.days.push_back(d == 4 ? std::nan("") : 20000.0 + 30.0 * d + u);
      all.temperatures_degC.push_back({20.0 + 8.0 * chance(u, d), d == 1 ? std::nan("") : 25.0});
      const double value =
          1.0 + (u == 3 ? 0.5 : 0.0) + 0.1 * chance(u) + 0.04 * chance(u, d, 1) + (u == 1 ? 0.02 * d : 0.0);
      const auto unit = static_cast<std::uint32_t>(u);
      quantity.values.push_back({unit, capture, static_cast<std::uint32_t>(d % 2),
                                 from_first && d == 0 ? 0.0 : value, 0.02 + 0.002 * d});
      parameter.values.push_back({unit, capture, 0, value, 0.05});
    }
    quantity.stated.push_back({static_cast<std::uint32_t>(u), u % 2 == 0 ? "data sheet" : "certificate", 0.95,
                               u % 2 == 0 ? 0.0 : 0.03});
  }
  all.quantities = {quantity, parameter};
  return all;
}

std::string population_text(const fleet::Fleet& all) {
  std::string text;
  for (const fleet::QuantityResult& r : fleet::population_of(all)) {
    if (const auto& e = r.effects)
      text += fmt::format(
          "effects {} {}: {:.7g} [{:.7g} {:.7g}] {:.7g} [{:.7g} {:.7g}] tolerance {:.7g} {:.7g}\n", e->units,
          e->drives, e->mean.value, e->mean.low, e->mean.high, e->unit_sd.value, e->unit_sd.low,
          e->unit_sd.high, e->tolerance_low, e->tolerance_high);
    if (r.effects && r.effects->drive_sd)
      text += fmt::format("drives {:.7g} [{:.7g} {:.7g}]\n", r.effects->drive_sd->value,
                          r.effects->drive_sd->low, r.effects->drive_sd->high);
    if (r.per_degC) text += fmt::format("per degC {:.7g} {:.7g}\n", r.per_degC->value, r.per_degC->sd);
    if (r.per_year) text += fmt::format("per year {:.7g} {:.7g}\n", r.per_year->value, r.per_year->sd);
    const auto tests = [&](const char* title, const std::vector<fleet::Tested>& of) {
      for (const fleet::Tested& t : of)
        text += fmt::format("{} {} {} {}: {:.7g} {:.7g} {:.7g} {:.5g} {:.5g}\n", title, t.unit,
                            t.capture ? static_cast<int>(*t.capture) : -1,
                            t.device ? static_cast<int>(*t.device) : -1, t.test.deviation, t.test.t,
                            t.test.dof, t.test.p_value, t.p_corrected);
    };
    tests("unit", r.outlying_units);
    tests("drive", r.outlying_drives);
    tests("drift", r.drifts);
    for (const fleet::Holding& h : r.holdings)
      text += fmt::format("holding {} {} {:.7g}: {:.7g} [{:.7g} {:.7g}] {:.5g} {:.5g} {}\n", h.unit,
                          h.against, h.stated, h.ratio, h.ratio_low, h.ratio_high, h.p_value, h.p_corrected,
                          fleet::words_of(h, all.certificate_factor));
  }
  return text;
}

TEST(WholePopulation, TellsTheSameOfTheSameNumbers) {
  std::string text;
  for (const auto& [is_log, from_first, units, drives] : {std::tuple(true, false, 6, 6),
                                                          {false, false, 5, 4},
                                                          {false, true, 5, 5},
                                                          {true, false, 4, 1},
                                                          {true, false, 1, 6},
                                                          {true, false, 2, 2},
                                                          {true, false, 8, 3}})
    text += fmt::format("-- {} {} {} {}\n", is_log, from_first, units, drives) +
            population_text(made_population(is_log, from_first, units, drives));
  expect_recorded("fleet/population.txt", text, 1e-4, 1e-9);
}

TEST(WholePopulation, HoldsWhereTheWholeIntervalIsBelowTheFactor) {
  const auto words = [](double low, double high, double p) {
    fleet::Holding holding;
    holding.ratio_low = low;
    holding.ratio_high = high;
    holding.p_corrected = p;
    return std::string(fleet::words_of(holding, 1.5));
  };
  std::string text;
  for (const double low : {1.0, 1.49, 1.5, 1.51})
    for (const double high : {1.49, 1.5, 1.51, 2.0})
      for (const double p : {0.049, 0.05, 0.051})
        text += fmt::format("{} {} {}: {}\n", low, high, p, words(low, high, p));
  expect_recorded("fleet/holdings.txt", text);
}

TEST(WholeSummary, OfARunHoldsWhatItsFilesSay) {
  const auto folder = scratch_folder();
  write_synthetic_run(folder, {.duration_s = 40.0, .names = {"mtx1", "mtx2"}});
  auto run = json::parse(content_of(folder / "run.json"));
  run["gnss"] = {{"used", 123}};
  run["warnings"] = {"a", "b", "c"};
  run["findings"] = {{{"harm", "wrong"}, {"check", "rate"}, {"device", "mtx1"}, {"text", "t"}, {"more", 1}},
                     {{"harm", 1}}};
  run["devices"][1]["bad_checksums"] = 3;
  run["devices"][1]["bad_lengths"] = 5;
  run["devices"][1]["bad_contents"] = 7;
  run["devices"][1]["late"] = 11;
  run["devices"][1]["problem"] = "loose";
  run["devices"][1]["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.01}};
  run["devices"][2].erase("samples");
  write_file(folder / "run.json", run.dump());
  auto calibration = json::parse(content_of(folder / "calibration.json"));
  calibration["imus"][0]["status"] = "calibrated";
  calibration["imus"][1]["status"] = "no estimate";
  calibration["imus"][0]["accel_boresight_deg"] = {0.1, 0.2, 0.3};
  calibration["imus"][0]["accel_boresight_sd_deg"] = {0.01, 0.0, 0.03};
  write_file(folder / "calibration.json", calibration.dump());
  auto dependence = json::parse(content_of(folder / "dependence.json"));
  dependence["points"] = {{{"name", "mtx1"}, {"driver", {{"temperature", 20.0}}}},
                          {{"name", "mtx2"}, {"driver", {{"temperature", 90.0}}}},
                          {{"name", "mtx1"}, {"driver", {{"temperature", 25.0}}}},
                          {{"name", "mtx1"}, {"driver", json::object()}}};
  write_file(folder / "dependence.json", dependence.dump());
  const auto summary = fleet::summary_of_run(folder);
  ASSERT_TRUE(summary) << summary.error().text();
  expect_recorded("fleet/summary.txt", summary->dump(1));
  std::string text;
  for (const char* rows : {"", "46.0,6.0\n", "46.0,6.0\nnan,6.1\n46.1,6.1\n46.1,6.2\n"}) {
    write_file(folder / "smoothed_navigation.csv", std::string("lat_deg,lon_deg\n") + rows);
    const auto again = fleet::summary_of_run(folder);
    text += fmt::format("{} {}\n", again->at("distance_m").dump(), again->at("track").dump());
  }
  for (const char* file : {"calibration.json", "run.json"}) {
    write_file(folder / file, "[]");
    const std::string told = fleet::summary_of_run(folder).error().what;
    text += told.substr(told.rfind('/') + 1) + '\n';
  }
  expect_recorded("fleet/tracks_of_runs.txt", text);
}

constexpr const char* kWholeFile = R"([fleet]
name = "vans"
captures = ["captures", "../other"]
out = "results"
[study]
config = "car.toml"
files = "all"
[tasks]
attempts = 7
memory_mb = 2048.0
timeout_min = 1.5
[certificate]
factor = 1.4
[[mounting]]
vehicle = "van 1"
name = "spring"
captures = ["v1/*", "?x.lcm"]
units = { imu = "A1", rear = "A2" }
[[mounting]]
vehicle = "van 2"
[[unit]]
serial = "A1"
certificate = "a1.json"
[[unit]]
serial = "A2"
)";

TEST(WholeFleetFile, HoldsAllThatIsWrittenAndRefusesWhatIsNot) {
  const auto folder = scratch_folder();
  std::string text;
  const auto tell = [&](const std::string& toml) {
    write_file(folder / "fleet.toml", toml);
    const auto read = fleet::read_fleet_file(folder / "fleet.toml");
    const auto below = [&](const fs::path& path) { return path.lexically_relative(folder).string(); };
    if (!read) {
      const std::string told = read.error().text();
      text += told.substr(told.rfind(folder.string(), 0) == 0 ? folder.string().size() + 1 : 0) + '\n';
      return;
    }
    text += fmt::format("{} {} {} {} {} {}\n", read->name, below(read->file), below(read->out),
                        read->config ? below(*read->config) : "-", read->keep_all_files,
                        read->certificate_factor);
    for (const auto& place : read->captures) text += " from " + below(place) + '\n';
    text += fmt::format(" limits {} {} {}\n", read->limits.attempts, read->limits.memory_mb,
                        read->limits.timeout_s);
    for (const auto& m : read->mountings)
      text += fmt::format(" mounting {}|{}|{}|{}\n", m.vehicle, m.name, fmt::join(m.captures, ","),
                          json(m.units).dump());
    for (const auto& [serial, file] : read->certificates)
      text += fmt::format(" {} {}\n", serial, below(file));
    for (const char* capture : {"v1/a.lcm", "ax.lcm", "abx.lcm", "v2/b.lcm"}) {
      const auto mounting = fleet::mounting_of(*read, capture);
      text += fmt::format(" {}: {} {}\n", capture, mounting ? static_cast<int>(*mounting) : -1,
                          mounting ? fleet::unit_of(read->mountings[*mounting], "imu") : "");
    }
  };
  const std::string least = "[fleet]\ncaptures = [\"c\"]\n";
  tell(kWholeFile);
  tell(least);
  for (const char* more : {"[tasks]\nattempts = 0\n",
                           "[tasks]\nattempts = 1\n",
                           "[tasks]\nattempts = 100\n",
                           "[tasks]\nattempts = 101\n",
                           "[tasks]\nmemory_mb = 63.9\n",
                           "[tasks]\nmemory_mb = 64\n",
                           "[tasks]\nmemory_mb = 1e7\n",
                           "[tasks]\nmemory_mb = 1.1e7\n",
                           "[tasks]\ntimeout_min = 0.009\n",
                           "[tasks]\ntimeout_min = 0.01\n",
                           "[tasks]\ntimeout_min = 1e6\n",
                           "[tasks]\ntimeout_min = 1.1e6\n",
                           "[tasks]\ntime = 1\n",
                           "[certificate]\nfactor = 1\n",
                           "[certificate]\nfactor = 0.9\n",
                           "[certificate]\nfactor = 100\n",
                           "[certificate]\nfactor = 101\n",
                           "[certificate]\nfactors = 1\n",
                           "[study]\nfiles = \"report\"\n",
                           "[study]\nfiles = \"some\"\n",
                           "[study]\nconfigs = \"a\"\n",
                           "[[mounting]]\nname = \"a\"\n",
                           "[[mounting]]\nvehicle = \"a\"\nunits = { imu = 1 }\n",
                           "[[mounting]]\nvehicle = \"a\"\nunit = 1\n",
                           "mounting = 1\n",
                           "[mounting]\nvehicle = \"a\"\n",
                           "[[unit]]\ncertificate = \"a\"\n",
                           "[[unit]]\nserial = \"a\"\nname = \"a\"\n",
                           "[other]\na = 1\n",
                           "x"})
    tell(least + more);
  tell("mounting = [1]\n" + least);
  tell("[fleet]\nname = \"a\"\n");
  tell("[fleet]\ncaptures = []\n");
  tell("[fleet]\ncaptures = [\"c\"]\nfolder = 1\n");
  tell("");
  std::string deep = "a";
  for (int i = 0; i < 70; ++i) deep += ".a";
  tell(deep + " = 1\n");
  expect_recorded("fleet/fleet_files.txt", text);
}

TEST(WholePlan, FindsCapturesWithWhatGoesOnAndTellsItsCommands) {
  const auto folder = scratch_folder() / "it's";
  const auto capture = [&](const std::string& name, const std::string& content) {
    write_file(folder / "captures" / name, content);
  };
  capture("a.lcm", "1");
  capture("a_001.lcm", "2");
  capture("a_002.lcm", "3");
  capture("b_001.lcm", "4");
  capture("c_01.lcm", "5");
  capture("c.lcm", "6");
  capture("d-001.lcm", "7");
  capture("d.lcm", "8");
  capture("e_0x1.lcm", "9");
  capture("e.lcm", "10");
  capture("same/f.lcm", "10");
  capture("_001.lcm", "11");
  capture("none/g.lcm", "12");
  capture("h.txt", "13");
  capture("i_a/i.lcm", "14");
  capture("i_a/i_009.lcm", "15");
  write_file(folder / "file.lcm", "16");
  write_file(folder / "file_001.lcm", "17");
  write_file(folder / "file_003.lcm", "18");
  write_file(folder / "captures" / "campaign" / "own.lcm", "19");
  write_file(folder / "car.toml", "x = 1");
  write_file(
      folder / "fleet.toml",
      "[fleet]\ncaptures = [\"captures\", \"file.lcm\"]\nout = \"captures/campaign\"\n[study]\nconfig = \"car.toml\"\nfiles = \"all\"\n[tasks]\nmemory_mb = 100\ntimeout_min = 2\nattempts = 4\n"
      "[[mounting]]\nvehicle = \"v\"\nname = \"m\"\ncaptures = [\"[!n]*\"]\nunits = { imu = \"A 1\", rear = \"B\" }\n");
  const auto read = fleet::read_fleet_file(folder / "fleet.toml");
  ASSERT_TRUE(read) << read.error().text();
  const auto plan = fleet::plan_campaign(*read, kMadeProgram);
  ASSERT_TRUE(plan) << plan.error().text();
  std::string text;
  const auto without_folder = [&](std::string line) {
    const std::string path = folder.string();
    for (auto at = line.find(path); at != std::string::npos; at = line.find(path))
      line.replace(at, path.size(), "HERE");
    const std::string quoted = std::regex_replace(path, std::regex("'"), "'\\''");
    for (auto at = line.find(quoted); at != std::string::npos; at = line.find(quoted))
      line.replace(at, quoted.size(), "QUOTED");
    return line;
  };
  for (const auto& c : plan->captures) {
    text += fmt::format("{}: {} bytes, {}, mounting {}, key {}, {}\n", c.name, c.bytes, c.sha256,
                        c.mounting ? static_cast<int>(*c.mounting) : -1, c.key, c.not_studied);
    for (const auto& file : c.files) text += "  " + without_folder(file.string()) + '\n';
  }
  for (const auto& task : plan->studies)
    text += without_folder(fleet::shell_line(fleet::command_of(task))) + '\n';
  for (const auto& task : plan->units)
    text += without_folder(fleet::shell_line(fleet::command_of(task))) + '\n';
  fleet::StudyTask plain = plan->studies.front();
  plain.config.reset();
  plain.keep_all_files = false;
  plain.limits = {};
  text += without_folder(fleet::shell_line(fleet::command_of(plain))) + '\n';
  text += fleet::shell_line({"", "a", "a b", "az-AZ_09./=+,:@", "a{", "`", "[", "0;", "{", "'"}) + '\n';
  const auto again = fleet::plan_campaign(*read, kMadeProgram);
  text += fmt::format("again: {}\n", again->captures.front().sha256 == plan->captures.front().sha256);
  std::string hashes = content_of(folder / "captures" / "campaign" / "hashes.json");
  text +=
      std::regex_replace(without_folder(hashes), std::regex("[0-9]{12,}(?![0-9a-f])"), "TIME").substr(0, 60) +
      '\n';
  write_file(folder / "captures" / "file.lcm", "20");
  text += without_folder(fleet::plan_campaign(*read, kMadeProgram).error().text()) + '\n';
  expect_recorded("fleet/plan.txt", text);
}

}  // namespace
}  // namespace imuscope::test
