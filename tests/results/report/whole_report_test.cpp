// Whole pages of runs: all that a rich run and a poor one show, number by number.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "results/report/binned_signals.h"
#include "results/report/certificate_page.h"
#include "results/report/comparison_page.h"
#include "results/report/mounting.h"
#include "results/report/paper_figures.h"
#include "results/report/people.h"
#include "results/report/report.h"
#include "results/report/scatter.h"
#include "results/report/verdict.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/markup.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::report {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kShare = 2e-3;  // numbers of three digits, where a rounding may go the other way

void edit(const fs::path& file, const std::function<void(json&)>& change) {
  json document = json::parse(test::content_of(file));
  change(document);
  std::ofstream(file) << document.dump();
}

/// Markup with a line for each element, without the numbers of pictures.
std::string readable(const std::string& page) {
  std::string text = test::lines_of_markup(page);
  text = std::regex_replace(text, std::regex("data:image/[^\"]*"), "PICTURE");
  text = std::regex_replace(text, std::regex("sha256-[^']*"), "HASH");
  // Lines of elements that say nothing by themselves only make it long.
  return std::regex_replace(text, std::regex("\n(</?[a-z0-9]+>)+(?=\n)"), "");
}

/// A list of numbers by its size, some of its values and its sum; what is no number is counted.
std::string list_text(const json& list) {
  double sum = 0.0;
  std::size_t others = 0;
  for (const json& value : list) {
    if (value.is_number()) {
      sum += value.get<double>();
    } else {
      ++others;
    }
  }
  std::string text = fmt::format("[{}:", list.size());
  for (const std::size_t place : {std::size_t{0}, list.size() / 3, list.size() - 1})
    if (place < list.size()) text += fmt::format(" {}", list[place].dump());
  return text + fmt::format(" others {} sum {:.7g}]", others, sum);
}

void add_value(const json& value, std::string& text) {
  if (value.is_array() && value.size() > 6 && !value.front().is_object()) {
    text += value.front().is_array() ? fmt::format("[{} of ", value.size()) + list_text(value.front()) + "]"
                                     : list_text(value);
  } else if (value.is_array()) {
    text += '[';
    for (const json& one : value) {
      add_value(one, text);
      text += ' ';
    }
    text += ']';
  } else if (value.is_object()) {
    text += '{';
    for (const auto& [key, one] : value.items()) {
      text += key + ':';
      add_value(one, text);
      text += ' ';
    }
    text += '}';
  } else {
    text += value.dump();
  }
}

/// The figures that page.js draws.
std::string figures_text(const std::string& page) {
  const std::string mark = "id=\"figures\">";
  const std::size_t begin = page.find(mark) + mark.size();
  const json sheet = json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  std::string text;
  for (const json& column : sheet.at("columns")) text += list_text(column) + '\n';
  for (const json& figure : sheet.at("figures")) {
    add_value(figure, text);
    text += '\n';
  }
  return text;
}

void without_folder(std::string& text, const fs::path& folder) {
  for (auto at = text.find(folder.string()); at != std::string::npos; at = text.find(folder.string()))
    text.replace(at, folder.string().size(), "HERE");
}

void hold_page(const std::string& name, const fs::path& folder) {
  const auto written = write_report(folder);
  ASSERT_TRUE(written) << written.error().text();
  const std::string page = test::content_of(folder / "report.html");
  std::string markup = readable(page);
  without_folder(markup, folder);
  // In files of a size that can be looked at.
  constexpr std::size_t kPart = 50'000;
  for (int part = 1; !markup.empty(); ++part) {
    const std::size_t end =
        std::min(markup.find('\n', std::min(kPart, markup.size() - 1)), markup.size() - 1) + 1;
    test::expect_recorded(fmt::format("report/{}_page_{}.txt", name, part), markup.substr(0, end), kShare,
                          1e-9);
    markup.erase(0, end);
  }
  test::expect_recorded("report/" + name + "_figures.txt", figures_text(page), 1e-5, 1e-9);
}

json state(const char* words, const char* unit, double sd, double goal, bool seen, bool reached) {
  return {{"words", words}, {"unit", unit},       {"sd", sd},
          {"goal", goal},   {"observable", seen}, {"goal_reached", reached}};
}

void enrich_calibration(json& calibration) {
  json& first = calibration["imus"][0];
  first["accel_boresight_deg"] = {0.11, -0.12, 0.13};
  first["accel_boresight_sd_deg"] = {0.011, 0.012, 0.013};
  first["batch"] = {{"gyro_matrix", {1.001, 0.0, 0.0, 0.002, 0.999, 0.0, -0.003, 0.004, 1.0}},
                    {"gyro_axes_sd_deg", {0.01, 0.02, 0.03}},
                    {"accel_matrix", {1.0, 0.0, 0.0, 0.005, 1.0, 0.0, 0.006, -0.007, 1.0}},
                    {"accel_axes_sd_deg", {0.04, 0.05, 0.06}}};
  first["observability"] = {{"weakest", {{"words", "boresight about z"}}},
                            {"limited_by", "noise"},
                            {"advice", "figures of eight"},
                            {"states",
                             {state("lever arm x", "m", 0.0012, 0.002, true, true),
                              state("time offset", "s", 0.00031, 0.0001, true, false),
                              state("boresight z", "deg", 0.41, 0.1, false, false)}}};
  calibration["imus"][1]["observability"] = {
      {"weakest", {{"words", "lever arm"}}},
      {"limited_by", ""},
      {"advice", ""},
      {"states", {state("lever arm x", "m", 0.0012, 0.002, true, true)}}};
  if (calibration["imus"].size() > 2) calibration["imus"][2]["observable"]["r_y"] = false;
}

void enrich_run(json& run) {
  run["name"] = "car";
  run["events"] = {{{"time_s", 1.26}, {"text", "<start>"}}, {{"text", "no time"}}};
  run["notes"] = {"mtx1: left out", "mtx2: left out", "of the run"};
  run["warnings"] = {"mtx1: short", "of all"};
  run["findings"] = {{{"harm", "wrong"}, {"device", "mtx1"}, {"check", "rate"}, {"text", "mtx1: is wrong"}},
                     {{"harm", "limits"}, {"device", "mtx2"}, {"check", "x"}, {"text", "mtx2: limits"}},
                     {{"harm", "note"}, {"text", "a note"}}};
  run["inputs"].push_back({{"file", 1}});
  run["odometry"] = {{"speed_used", 11},         {"speed_rejected", 12},
                     {"non_holonomic_used", 13}, {"non_holonomic_rejected", 14},
                     {"zero_velocity_used", 15}, {"zero_velocity_rejected", 16}};
  json& devices = run["devices"];
  int n = 1000;
  for (const char* key : {"bytes_skipped", "bad_checksums", "bad_lengths", "bad_contents", "samples_lost",
                          "gaps", "clock_resets", "refused", "late"})
    devices[1][key] = n += 1111;
  devices[0]["problem"] = "loose";
  devices[1]["problem"] = "loose";
  devices[1]["clock"] = "drifts";
  devices[1]["time_budget"] = {{"stamped_by", "kernel"}, {"stamp_lead_s", 12e-6}, {"stamp_lead_sd_s", 3e-6},
                               {"wire_s", 0.00123},      {"adapter_s", 0.016},    {"latency_s", 0.00234},
                               {"clock_sd_s", 45e-6},    {"t_d_s", -0.0056},      {"sd_t_d_s", 0.00067},
                               {"delay_s", 0.0078},      {"sd_delay_s", 0.00089}};
  devices[2]["time_budget"] = {{"stamped_by", "read"}};
  devices[1]["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.085},
                              {"gyro_bias_stability_deg_per_h", 40.0},
                              {"accel_density_ug_per_sqrt_hz", 180.0},
                              {"accel_bias_stability_ug", 90.0}};
  devices[2]["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.036},
                              {"gyro_bias_stability_deg_per_h", 4000.0},
                              {"accel_density_ug_per_sqrt_hz", 18.0}};
}

void write_odometry(const fs::path& folder, double duration_s) {
  std::ofstream out(folder / "odometry.csv");
  out << "time_s,speed_mps,standing,zero_velocity,scale_percent,sd_scale_percent\n";
  for (double t = 0.0; t < duration_s; t += 0.1) {
    if (t > 20.0 && t < 25.0) continue;
    out << fmt::format("{},{},{},{},{},{}\n", t, 7.0 + std::sin(0.2 * t), t < 8.0 ? 1 : 0,
                       t > 2.0 && t < 6.0 ? 1 : 0, 0.8 - 0.5 * std::exp(-0.05 * t),
                       2.0 * std::exp(-0.03 * t));
  }
}

fs::path rich_run(const fs::path& folder) {
  test::write_synthetic_run(
      folder, {.duration_s = 60.0, .names = {"mtx1", "mtx2"}, .gap_begin_s = 20.0, .gap_end_s = 24.0});
  edit(folder / "calibration.json", enrich_calibration);
  edit(folder / "run.json", enrich_run);
  edit(folder / "models.json", [](json& models) {
    json& list = models["models"];
    for (std::size_t i = 0; i < list.size(); ++i) {
      list[i]["j_test"]["p_value"] = 0.003 * static_cast<double>(i * i % 37);
      if (i % 5 == 1) list[i]["identifiable"] = false;
      if (i % 7 == 2) list[i]["warnings"] = {"it is so", fmt::format("number {}", i)};
      if (i % 4 == 3) list[i]["parameters"][3].erase("ci_low");
      if (i % 6 == 5)
        list[i]["parameters"][1]["ci_low"] = nullptr, list[i]["parameters"][1]["ci_high"] = nullptr;
    }
  });
  edit(folder / "comparison.json", [](json& comparison) {
    comparison["comparisons"][1]["parameters"][0]["verdict"] = "no difference seen";
    comparison["comparisons"][1]["joint"]["p_holm"] = 0.2;
    comparison["comparisons"][2]["remarks"] = {"a remark"};
    comparison["comparisons"][3]["joint"] = nullptr;
  });
  edit(folder / "dependence.json", [](json& dependence) {
    dependence["remarks"] = {"seen in windows"};
    json other = dependence["dependences"][0];
    other["driver"] = "rate";
    other["driver_unit"] = "rad/s";
    other["p_holm"] = 0.3;
    other["beside_others"] = {{"p_holm", 0.4}, {"slope", 0.1}};
    dependence["dependences"].push_back(other);
  });
  edit(folder / "evaluation.json", [](json& evaluation) {
    evaluation["evaluations"][0]["n_independent"] = 2;
    evaluation["evaluations"][1]["horizontal_sd_m"] = nullptr;
    evaluation["evaluations"][3]["nees_position"] = 0.4;
    evaluation["evaluations"][3]["surprise"] = 1.25;
  });
  edit(folder / "vibration.json", [](json& vibration) {
    json line = vibration["lines"][0];
    line["axis"] = "gyro_z";
    line["amplitude_unit"] = "rad/s";
    line["amplitude_sd"] = 0.004;
    vibration["lines"].push_back(line);
  });
  edit(folder / "regression.json", [](json& regression) {
    regression["remarks"] = {"a remark of the regression"};
    regression["regressions"][2]["p_value"] = 0.3;
    regression["regressions"][1]["p_value"] = 0.01;
  });
  write_odometry(folder, 60.0);
  return folder;
}

fs::path poor_run(const fs::path& folder) {
  test::write_synthetic_run(folder, {.duration_s = 200.0,
                                     .names = {"only"},
                                     .boresight_sd_deg = 0.3,
                                     .j_p_value = 1e-7,
                                     .psi_z_observable = false,
                                     .with_truth = false,
                                     .with_regression = false,
                                     .with_findings = false});
  edit(folder / "calibration.json", [](json& calibration) {
    json& only = calibration["imus"][0];
    for (const char* key : {"C_prior", "q_b_s", "t_d_sd_s", "gyro_bias_sd_radps"}) only.erase(key);
    only["observable"]["t_d"] = false;
    only["method"] = "";
    only["r_bs_b_sd_m"] = {0.08, 0.002, 0.004};
  });
  edit(folder / "run.json", [](json& run) {
    for (const char* key : {"configuration_text", "t0_utc", "duration_s", "inputs", "regimes"})
      run.erase(key);
    run["gnss"] = {{"contradicts_motion", true}};
  });
  edit(folder / "models.json", [](json& models) {
    for (json& model : models["models"]) model["regime"] = "all";
    models["models"].erase(1);
  });
  fs::remove(folder / "navigation.csv");
  fs::remove(folder / "calibration_only.csv");
  return folder;
}

TEST(WholeReport, OfARichRun) { hold_page("rich", rich_run(test::scratch_folder())); }
TEST(WholeReport, OfAPoorRun) { hold_page("poor", poor_run(test::scratch_folder())); }

TEST(WholeReport, OfACalibrationAlone) {
  const auto folder = test::scratch_folder();
  std::ofstream(folder / "calibration.json")
      << R"({"imus": [{"name": "a"}, {"name": "b", "C_b_s": [0, 1, 0, -1, 0, 0, 0, 0, 1]}]})";
  hold_page("bare", folder);
}

TEST(WholeReport, OfTwoRunsBesideEachOther) {
  const auto folder = test::scratch_folder();
  for (const char* run : {"monday", "friday"}) fs::create_directories(folder / run);
  rich_run(folder / "monday");
  test::write_synthetic_run(
      folder / "friday",
      {.duration_s = 60.0, .names = {"mtx1", "other", "mtx2"}, .boresight_sd_deg = 0.02, .j_p_value = 0.01});
  edit(folder / "friday" / "calibration.json", [](json& calibration) {
    json& imu = calibration["imus"][0];
    imu["r_bs_b_m"] = {0.352, -0.219, 0.12};
    imu["t_d_s"] = -0.0085;
    imu["C_b_s"] = {0.9998, 0.0175, 0.01, -0.0175, 0.9998, 0.01, -0.01, -0.01, 0.9999};
    calibration["imus"][2].erase("t_d_sd_s");
    calibration["imus"][2].erase("C_b_s");
  });
  const auto page = comparison_page(folder / "monday", folder / "friday");
  ASSERT_TRUE(page) << page.error().text();
  test::expect_recorded("report/comparison_page.txt", readable(*page), kShare, 1e-9);
}

/// In the place of gnuplot: what it is given is held, not what it draws.
class Gnuplot {
 public:
  Gnuplot(const fs::path& beside, const std::string& script) : path_(std::getenv("PATH")) {
    const auto folder = beside / "bin";
    fs::create_directories(folder);
    std::ofstream(folder / "gnuplot") << "#!/bin/sh\n" << script;
    fs::permissions(folder / "gnuplot", fs::perms::owner_all);
    setenv("PATH", script.empty() ? "/nowhere" : (folder.string() + ":" + path_).c_str(), 1);
  }
  ~Gnuplot() { setenv("PATH", path_.c_str(), 1); }
  Gnuplot(const Gnuplot&) = delete;
  Gnuplot& operator=(const Gnuplot&) = delete;

 private:
  std::string path_;
};
constexpr const char* kDrawsNothing =
    "b=${2%.gp}; [ \"$1\" = -d ] || exit 1; echo '<svg/>' > \"$b.svg\"; echo pdf > \"$b.pdf\"\n";

/// A script up to its second output, of each block of data the first and every so many-th line.
std::string script_text(const fs::path& file) {
  std::istringstream in(test::content_of(file));
  std::string text = "== " + file.filename().string() + '\n';
  std::size_t in_block = 0;
  std::size_t resets = 0;
  for (std::string line; std::getline(in, line);) {
    if (line == "reset" && ++resets == 2) text += "(again)\n";
    if (resets > 1) {
      if (line.rfind("set terminal", 0) == 0) text += line + '\n';
      continue;
    }
    if (line == "EOD") in_block = 0;
    const bool keep = in_block == 0 || in_block % 61 == 1;
    if (keep) text += line + '\n';
    if (in_block > 0) ++in_block;
    if (line.find("<< EOD") != std::string::npos) in_block = 1;
  }
  return text;
}

std::string scripts_text(const fs::path& figures) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(figures)) {
    if (entry.path().extension() == ".gp") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::string text;
  for (const fs::path& file : files) text += script_text(file);
  return text;
}

TEST(WholeFigures, OfARunAreScriptsWithItsNumbers) {
  const auto scratch = test::scratch_folder();
  const Gnuplot gnuplot(scratch, kDrawsNothing);
  const auto folder = scratch / "run";
  fs::create_directories(folder);
  test::write_synthetic_run(folder,
                            {.duration_s = 60.0, .names = {"it"}, .gap_begin_s = 20.0, .gap_end_s = 24.0});
  const auto files = write_figures(folder);
  ASSERT_TRUE(files) << files.error().text();
  std::string text;
  for (const fs::path& file : *files) text += file.lexically_relative(folder).string() + '\n';
  test::expect_recorded("report/run_scripts.txt", text + scripts_text(folder / "figures"), 1e-5, 1e-9);
}

TEST(WholeFigures, OfAPoorRunAreThoseThatItHas) {
  const auto scratch = test::scratch_folder();
  const Gnuplot gnuplot(scratch, kDrawsNothing);
  fs::create_directories(scratch / "run");
  const auto folder = poor_run(scratch / "run");
  const auto files = write_figures(folder);
  ASSERT_TRUE(files) << files.error().text();
  std::string text;
  for (const auto& entry : *files) text += entry.filename().string() + '\n';
  const std::string scripts = scripts_text(folder / "figures");
  test::expect_recorded("report/poor_scripts.txt", text + scripts.substr(scripts.find("== figure4")), 1e-5,
                        1e-9);
}

TEST(WholeFigures, TellWhereGnuplotRefusesOrIsNotThere) {
  const auto scratch = test::scratch_folder();
  const auto folder = scratch / "run";
  fs::create_directories(folder);
  test::write_synthetic_run(folder, {.duration_s = 10.0, .names = {"it"}});
  for (const auto& [script, told] : {std::pair("exit 3\n", "refused"), {"", "could not be started"}}) {
    const Gnuplot gnuplot(scratch, script);
    const auto files = write_figures(folder);
    ASSERT_FALSE(files);
    EXPECT_NE(files.error().text().find(told), std::string::npos) << files.error().text();
    EXPECT_TRUE(fs::exists(folder / "figures" / "drive.gp")) << "its script stays";
    EXPECT_FALSE(fs::exists(folder / "figures" / "drive.svg"));
  }
}

json term(const char* name, const char* symbol, const char* unit, const char* known, double value) {
  return {{"name", name},   {"symbol", symbol},      {"unit", unit},           {"known", known},
          {"value", value}, {"ci_low", 0.9 * value}, {"ci_high", 1.15 * value}};
}

json certificate_axis(const std::string& name, const char* unit, double size) {
  json axis{{"name", name},
            {"unit", unit},
            {"n_samples", 360000},
            {"n_missing", 12},
            {"mean", 1.23456789 * size},
            {"sd", 0.5 * size},
            {"resolution", 0.001 * size},
            {"largest_miss", 0.031},
            {"low_pass_hz", 47.3},
            {"warnings", {"is warm", name + " alone"}},
            {"limits", {"the record is short"}},
            {"lines", {{{"words", "a line at 50 Hz"}}}},
            {"resonances", {{{"words", "a resonance at 310 Hz"}}}},
            {"temperature",
             {{"lowest_c", 21.04},
              {"highest_c", 35.06},
              {"bias_per_c", 0.00123 * size},
              {"bias_per_c_sd", 0.00011 * size},
              {"bias_p_value", 0.0021},
              {"noise_variance_per_c", 0.0123},
              {"noise_variance_per_c_sd", 0.0031}}},
            {"terms",
             {term("random walk", "N", "deg/sqrt(h)", "value", 0.302 * size),
              term("bias instability", "B", "deg/h", "bound", 4.5 * size),
              term("rate random walk", "K", "deg/h/sqrt(h)", "unknown", 1.0)}}};
  for (int level = 0; level < 5; ++level) {
    const double tau_s = 0.01 * std::pow(2.0, level);
    const double deviation = size / std::sqrt(tau_s);
    axis["allan"].push_back({{"tau_s", tau_s},
                             {"deviation", deviation},
                             {"ci_low", 0.9 * deviation},
                             {"ci_high", 1.1 * deviation},
                             {"model", 1.01 * deviation}});
    axis["density"].push_back({{"frequency_hz", 1.0 + level},
                               {"density", size * size},
                               {"ci_low", 0.8 * size * size},
                               {"ci_high", level == 2 ? json(nullptr) : json(1.3 * size * size)}});
    axis["fit"]["wv"].push_back({{"level", level + 1},
                                 {"tau_s", tau_s},
                                 {"value", size / tau_s},
                                 {"ci_low", 0.9 * size / tau_s},
                                 {"ci_high", 1.2 * size / tau_s},
                                 {"fitted", 1.02 * size / tau_s}});
  }
  axis["fit"]["model"] = "WN";
  axis["fit"]["parameters"] = {{{"process", "WN"},
                                {"name", "sigma2"},
                                {"unit", std::string("(") + unit + ")^2"},
                                {"value", size * size},
                                {"ci_low", 0.9 * size * size},
                                {"ci_high", 1.1 * size * size}},
                               {{"process", "GM1"}, {"name", "beta"}, {"unit", "1/s"}}};
  return axis;
}

json whole_certificate() {
  json axes{certificate_axis("gyro_x", "rad/s", 0.01), certificate_axis("gyro_y", "rad/s", 0.02),
            certificate_axis("accel_x", "g", 0.001), certificate_axis("accel_z", "m/s^2", 0.004)};
  axes[1]["terms"].erase(2);
  for (const char* key : {"temperature", "resolution", "lines", "resonances", "low_pass_hz", "fit"})
    axes[3].erase(key);
  axes[3]["n_missing"] = 0;
  axes[3]["largest_miss"] = 0.0;
  axes[1]["temperature"].erase("noise_variance_per_c");
  const auto row = [](const char* axis, const char* symbol, double stated, const char* kind) {
    return json{{"axis", axis},     {"symbol", symbol},        {"known", "value"},  {"value", 1.1 * stated},
                {"ci_low", stated}, {"ci_high", 1.2 * stated}, {"stated", stated},  {"kind", kind},
                {"unit", "deg/h"},  {"verdict", "above"},      {"document", "DS1"}, {"revision", "B"},
                {"page", 7}};
  };
  const auto pair = [](const char* a, const char* b, bool shows) {
    return json{{"signals", {a, b}}, {"coherence", 0.42}, {"p_holm", 0.0031}, {"ci_low", 0.31},
                {"ci_high", 0.5},    {"tau_s", 12.8},     {"shows", shows}};
  };
  return {
      {"sensor", "MTi <1>"},
      {"duration_s", 3725.0},
      {"rate_hz", 100.0},
      {"selection", "chosen"},
      {"files", {"a.csv", "b.csv", 7}},
      {"confidence", 0.95},
      {"version", "1.2"},
      {"made_utc", "2026-01-02T03:04:05Z"},
      {"axes", axes},
      {"comparison",
       {{"part", "P1"},
        {"rows",
         {row("gyro_x", "N", 0.6, "typical"), row("gyro_y", "N", 0.9, "maximum"),
          row("gyro_x", "B", 8.0, "typical"), row("accel_x", "B", 15.0, "maximum"),
          row("accel_x", "N", 0.03, "typical")}}}},
      {"correlation",
       {pair("gyro_x", "gyro_y", true),
        pair("gyro_x", "accel_x", false),
        pair("gyro_y", "accel_x", true),
        {{"signals", {"gyro_x"}}}}},
      {"correlation_of_means_s", 2.5},
      {"units",
       {{{"axis", "gyro_x"},
         {"symbol", "N"},
         {"values", {1.0, 2.0, nullptr}},
         {"p_holm", {0.2, 0.01, 0.04}},
         {"mean_ci", {1.2, 1.9}},
         {"mean", 1.5},
         {"spread_log", 0.123},
         {"tolerance_upper_95_95", 2.345},
         {"unit", "deg/sqrt(h)"}},
        {{"axis", "gyro_y"}, {"symbol", "B"}, {"values", {1.0}}, {"p_holm", {0.05}}, {"unit", "deg/h"}}}}};
}

TEST(WholeCertificate, IsAPageWithItsFigures) {
  const auto scratch = test::scratch_folder();
  const Gnuplot gnuplot(scratch, kDrawsNothing);
  const auto folder = scratch / "certificate";
  const auto files = write_certificate_page(folder, whole_certificate());
  ASSERT_TRUE(files) << files.error().text();
  std::string text;
  for (const fs::path& file : *files) text += file.lexically_relative(folder).string() + '\n';
  test::expect_recorded("report/certificate_page.txt",
                        text + readable(test::content_of(folder / "certificate.html")), kShare, 1e-9);
  test::expect_recorded("report/certificate_figures.txt", scripts_text(folder / "figures"), 1e-5, 1e-9);
}

TEST(WholeCertificate, OfLittleSaysLittle) {
  const auto scratch = test::scratch_folder();
  const Gnuplot gnuplot(scratch, kDrawsNothing);
  json certificate = whole_certificate();
  certificate["axes"].erase(3);
  certificate["axes"].erase(2);
  certificate["axes"].erase(1);
  for (const char* key :
       {"duration_s", "rate_hz", "selection", "files", "confidence", "correlation_of_means_s"})
    certificate.erase(key);
  certificate["comparison"]["rows"] = json::array();
  certificate["units"] = json::array();
  certificate["correlation"].erase(2);
  certificate["correlation"].erase(0);
  certificate["axes"][0].erase("n_samples");
  certificate["axes"][0].erase("mean");
  const auto folder = scratch / "certificate";
  ASSERT_TRUE(write_certificate_page(folder, certificate));
  std::string text = readable(test::content_of(folder / "certificate.html"));
  certificate["correlation"] = json::array();
  certificate.erase("comparison");
  ASSERT_TRUE(write_certificate_page(folder, certificate));
  const std::string page = readable(test::content_of(folder / "certificate.html"));
  test::expect_recorded("report/small_certificate.txt", text + page.substr(0, page.size() / 2), kShare, 1e-9);
}

TEST(WholePeople, ReadNumbersWithTheDigitsThatMean) {
  std::string text;
  const double nan = std::nan("");
  for (const double value :
       {0.0, 1.0, -1.0, 9.9996, 12345.678, 999999.0, 1e6, -1e6, 999999.9, 5e-4, 4.99e-4, -3.21e-7, 1e-14,
        1e30, 0.05, 123.456, nan, std::numeric_limits<double>::infinity()}) {
    for (const int digits : {1, 2, 4, 9}) text += number(value, digits).str() + " | ";
    text += number(std::optional<double>()).str() + " | " + number(std::optional<double>(value)).str();
    for (const double sd : {0.0123, 0.096, 1.0, 250.0, 1e-9, 0.0, -1.0, nan, 3e7})
      text += "\n   " + with_sd(value, sd).str();
    for (const auto& [low, high] : {std::pair(0.9, 1.1),
                                    {0.999, 1.001},
                                    {1e-6, 2.0},
                                    {-1.0, 3.0},
                                    {1.0, 1.0},
                                    {2.0, 1.0},
                                    {100.0, 2e7},
                                    {1e-9, 2e-9},
                                    {-3.0, -1.0}})
      text += "\n   " + with_interval(value, low, high).str();
    text += "\n   " + with_interval(value, {}, 2.0).str() + with_interval(value, 0.5, {}).str() +
            with_interval(value, {}, {}).str() + with_interval(value, nan, {}).str();
    text += "\n   " + p_words(value).str() + " " + count(value).str() + " " + in_sd(value, 2.0) + " " +
            in_sd(-value, {}) + " " + duration_words(value) + '\n';
  }
  for (const double p : {1.1e-6, 1e-6, 0.9e-6, 0.049}) text += p_words(p).str() + '\n';
  for (const double seconds : {0.4, 0.5, 59.4, 59.5, 60.0, 119.0, 3599.0, 3599.6, 3600.0, 7384.0, -0.1})
    text += duration_words(seconds) + '\n';
  for (const double n : {12.0, 123.0, 1234.0, 12345.0, 123456.0, 1234567.0, 1234567890.0})
    text += count(n).str() + '\n';
  text += p_words({}).str() + count({}).str() + with_sd(1.0, {}).str() + '\n';
  test::expect_recorded("report/people.txt", text);
}

Rotation turn_of(double x, double y, double z) {
  const double angle = std::hypot(x, y, z);
  if (angle == 0.0) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  x /= angle;
  y /= angle;
  z /= angle;
  const double s = std::sin(angle);
  const double c = std::cos(angle);
  const double d = 1.0 - c;
  return {c + x * x * d,     x * y * d - z * s, x * z * d + y * s, x * y * d + z * s, c + y * y * d,
          y * z * d - x * s, x * z * d - y * s, y * z * d + x * s, c + z * z * d};
}

TEST(WholeMounting, IsTheNearestSquareOneAndWhatIsLeft) {
  std::string text;
  for (const auto& [x, y, z] : {std::tuple(0.0, 0.0, 0.0),
                                {0.01, -0.02, 0.03},
                                {1.5, 0.1, 0.1},
                                {0.1, 1.6, -0.1},
                                {-0.1, 0.0, 1.55},
                                {3.1, 0.1, 0.2},
                                {0.2, -3.0, 0.1},
                                {1e-9, 0.0, 0.0},
                                {3.14159265, 0.0, 0.0},
                                {0.0, 3.14159, 0.0},
                                {0.0, 0.0, -3.1415},
                                {1.8, 1.8, 1.8},
                                {1.2, 1.2, 1.2},
                                {0.7, 0.7, 0.1},
                                {2.0, -2.0, 0.3},
                                {1.9, 1.9, 0.2}}) {
    const Rotation C = turn_of(x, y, z);
    const Rotation square = nearest_square_mounting(C);
    const Angles left = boresight_deg(square, C);
    const Angles all = boresight_deg(turn_of(0.0, 0.0, 0.0), C);
    text += fmt::format("{} {} {}: {} | {:.6g} {:.6g} {:.6g} | {:.6g} {:.6g} {:.6g} |", x, y, z,
                        square_mounting_words(square), left[0], left[1], left[2], all[0], all[1], all[2]);
    for (const double one : square) text += fmt::format(" {}", one);
    text += '\n';
  }
  test::expect_recorded("report/mountings.txt", text, 1e-5, 1e-5);
}

Fit fit_with(const std::string& axis, const std::string& regime, double white, double white_width,
             double beta, bool beta_known, double record_s) {
  Fit fit;
  fit.imu = "imu";
  fit.axis = axis;
  fit.regime = regime;
  fit.unit = axis.rfind("gyro", 0) == 0 ? "deg/s" : "m/s²";
  fit.model = "WN+GM";
  fit.n = 100.0 * record_s;
  fit.levels.push_back({0.02, 0.32, 0.31, 0.33, 0.32});
  const auto bound = [&](double value) { return beta_known ? std::optional(value) : std::nullopt; };
  fit.parameters = {
      {"WN", "sigma2", "", white, white * std::exp(-2.0 * white_width), white * std::exp(2.0 * white_width)},
      {"GM1", "beta", "1/s", beta, bound(0.5 * beta), bound(2.0 * beta)},
      {"GM1", "sigma2", "", 0.01, bound(0.005), bound(0.02)}};
  fit.j_p_value = 0.4;
  return fit;
}

std::string verdict_text(const Verdict& verdict) {
  std::string text = fmt::format("{} {}\n", css_class_of(verdict.answer), verdict.headline);
  for (const std::string& reason : verdict.reasons) text += "  " + reason + '\n';
  return text;
}

TEST(WholeVerdicts, OfModelsSayWhatIsKnownAndWhatItTakes) {
  std::string text;
  const auto tell = [&](const std::string& title, const std::vector<Fit>& fits) {
    text += title + '\n' + verdict_text(model_verdict(fits));
    for (const auto& sentences : {what_is_known(fits), records_needed(fits), next_steps({}, fits)}) {
      for (const std::string& sentence : sentences) text += "    " + sentence + '\n';
      text += "    --\n";
    }
  };
  tell("none", {});
  for (const double width : {0.01, 0.39, 0.41})
    tell(fmt::format("width {}", width), {fit_with("gyro_x", "static", 0.04, width, 1.0, true, 900.0),
                                          fit_with("gyro_y", "static", 0.09, 0.02, 1.0, true, 900.0),
                                          fit_with("accel_x", "static", 0.0004, 0.03, 1.0, false, 900.0)});
  for (const double worst : {0.019, 0.021})
    tell(fmt::format("worst {}", worst), {fit_with("gyro_x", "", 0.04, 0.01, 1.0, true, 900.0),
                                          fit_with("gyro_y", "", 0.04, 0.01, 1.0, true, 900.0),
                                          fit_with("gyro_z", "", 0.04, worst, 1.0, true, 900.0)});
  for (const double beta : {0.0225, 0.0223, 0.0221, 0.0023, 0.00112, 0.0011})
    tell(fmt::format("beta {}", beta), {fit_with("gyro_x", "dynamic", 0.04, 0.01, beta, false, 900.0),
                                        fit_with("gyro_y", "dynamic", 0.04, 0.01, 3.0 * beta, false, 700.0),
                                        fit_with("accel_y", "static", 0.04, 0.01, beta, false, 100.0)});
  for (const double p : {0.051, 0.049, 0.0021, 1e-3, 9e-5}) {
    std::vector<Fit> fits;
    for (int i = 0; i < 24; ++i) {
      fits.push_back(fit_with(kAxes[i % 6], i < 12 ? "static" : "dynamic", 0.04, 0.01, 1.0, true, 900.0));
      if (i < 3) fits.back().j_p_value = p;
      if (i == 7) fits.back().j_p_value.reset();
      if (i == 8) fits.back().identifiable = false;
    }
    tell(fmt::format("p {}", p), fits);
    fits.resize(4);
    tell(fmt::format("p {} of four", p), fits);
  }
  test::expect_recorded("report/model_verdicts.txt", text);
}

TEST(WholeVerdicts, OfRunsSayWhy) {
  std::string text;
  const auto folder = rich_run(test::scratch_folder());
  const RunFiles healthy = *read_run_files(folder);
  std::set<std::string> usual;
  const auto tell = [&](const std::string& title, const std::function<void(RunFiles&)>& change) {
    RunFiles run = healthy;
    run.run["findings"] = json::array();
    run.run["warnings"] = json::array();
    change(run);
    std::string said = verdict_text(data_verdict(run)) + verdict_text(calibration_verdict(run)) +
                       verdict_text(difference_verdict(run)) + verdict_text(outage_verdict(run));
    for (const std::string& step : next_steps(run, read_fits(run.models))) said += "    " + step + '\n';
    text += title + '\n';
    // Of all others what the healthy one does not say, and how many lines there are.
    std::istringstream lines(said);
    std::size_t n = 0;
    for (std::string line; std::getline(lines, line); ++n) {
      if (usual.count(line) == 0) text += line + '\n';
      if (title == "healthy") usual.insert(line);
    }
    text += fmt::format("{} lines\n", n);
  };
  tell("healthy", [](RunFiles&) {});
  for (const double sd : {0.09, 0.11, 0.4, 0.9, 1.1})
    tell(fmt::format("boresight sd {}", sd), [&](RunFiles& run) {
      run.studies[0].calibration["boresight_sd_deg"] = {0.01, sd, 0.01};
    });
  for (const double sd : {0.009, 0.011, 0.04, 0.06, 0.2})
    tell(fmt::format("lever arm sd {}", sd), [&](RunFiles& run) {
      run.studies[1].calibration["r_bs_b_sd_m"] = {0.001, 0.001, sd};
    });
  for (const double sd : {0.0009, 0.0011, 0.004, 0.006, 0.02})
    tell(fmt::format("time sd {}", sd), [&](RunFiles& run) { run.studies[0].calibration["t_d_sd_s"] = sd; });
  for (const double scale : {0.4, 0.25, 0.2, 0.1})
    tell(fmt::format("sd of {} their size", scale), [&](RunFiles& run) {
      for (auto& study : run.studies)
        for (const char* key : {"boresight_sd_deg", "r_bs_b_sd_m"})
          for (auto& sd : study.calibration[key]) sd = sd.get<double>() * scale;
    });
  tell("no C_b_s", [](RunFiles& run) { run.studies[0].calibration.erase("C_b_s"); });
  tell("no sd", [](RunFiles& run) { run.studies[0].calibration.erase("boresight_sd_deg"); });
  tell("nothing", [](RunFiles& run) { run.studies.clear(); });
  tell("all unobservable", [](RunFiles& run) {
    for (auto& study : run.studies)
      for (const char* key : {"psi_x", "psi_y", "psi_z", "r_x", "r_y", "r_z", "t_d", "gyro_scale_x"})
        study.calibration["observable"][key] = false;
  });
  for (const double lost : {0.0, 1.0, 59.0, 61.0, 700.0})
    tell(fmt::format("lost {}", lost), [&](RunFiles& run) {
      run.run["devices"][1]["samples_lost"] = lost;
      run.run["devices"][1]["bad_checksums"] = 2.0 * lost;
    });
  for (const double rest_s : {0.0, 29.0, 31.0, 59.0, 61.0, 200.0})
    tell(fmt::format("rest {}", rest_s), [&](RunFiles& run) {
      run.run["regimes"] = {{"static_s", rest_s}, {"dynamic_s", 5.0 * rest_s}};
    });
  for (const char* harm : {"wrong", "limits", "note"})
    tell(harm, [&](RunFiles& run) { run.run["findings"] = {{{"harm", harm}, {"text", "found"}}}; });
  tell("warned", [](RunFiles& run) { run.run["warnings"] = {"a", "mtx1: b", "mtx2: b"}; });
  tell("no run", [](RunFiles& run) { run.run = nullptr; });
  tell("no comparison", [](RunFiles& run) {
    run.comparison = nullptr;
    run.evaluation = nullptr;
  });
  tell("no difference", [](RunFiles& run) {
    for (auto& c : run.comparison["comparisons"]) {
      c["joint"]["p_holm"] = 0.5;
      for (auto& p : c["parameters"]) p["verdict"] = "no difference seen";
    }
  });
  for (const double nees : {0.6, 1.0, 1.5, 5.0})
    tell(fmt::format("nees {}", nees), [&](RunFiles& run) {
      for (auto& e : run.evaluation["evaluations"]) {
        e["nees_position"] = nees;
        e["surprise"] = nees;
      }
    });
  for (const double worse : {0.0, 0.04, 0.06, 0.6})
    tell(fmt::format("worse by {}", worse), [&](RunFiles& run) {
      for (auto& e : run.evaluation["evaluations"]) {
        e["nees_position"] = 1.0;
        e["surprise"] = e["model"] == "dynamic" ? 3.0 : 3.0 + worse;
      }
    });
  without_folder(text, folder);
  test::expect_recorded("report/run_verdicts.txt", text, kShare);
}

TEST(WholeSignals, AreBinnedAndCorrelated) {
  std::string text;
  for (const std::size_t n : {1U, 7U, 20U, 100U}) {
    BinnedSignals signals(2, 8, 0.5);
    for (std::size_t i = 0; i < n; ++i) {
      const double time_s = 10.0 + 0.3 * static_cast<double>(i) + (i > 12 ? 4.0 : 0.0);
      signals.add(i == 5 ? std::nan("") : time_s,
                  std::array{std::sin(0.7 * static_cast<double>(i)),
                             i % 4 == 1 ? std::nan("") : static_cast<double>(i)});
    }
    signals.add(9.0, std::array{5.0, -5.0});
    for (int pass = 0; pass < 2; ++pass) {
      text += fmt::format("{} {}: {} of {} s\n", n, pass, signals.size(), signals.width_s());
      for (std::size_t i = 0; i < signals.size(); ++i) {
        text += fmt::format(" {:.6g}", signals.time_s(i));
        for (std::size_t k = 0; k < 2; ++k) {
          const auto& bin = signals.bin(k, i);
          text += fmt::format(" | {} {:.6g} {:.6g} {:.6g} {:.6g}", bin.n, bin.smallest, bin.largest, bin.sum,
                              bin.last);
        }
        text += '\n';
      }
      signals.coarsen();
    }
  }
  const double nan = std::nan("");
  text +=
      fmt::format("{:.7g} {:.7g} {:.7g}\n", correlation({1.0, 2.0, 3.0, nan, 5.0}, {2.0, 3.9, 6.5, 1.0, nan}),
                  correlation({1.0, 2.0}, {3.0, 3.0}), correlation({}, {}));
  text += fmt::format("{:.7g} {:.7g}\n", correlation({1.0, 2.0, 4.0}, {-1.0, -2.0, -4.0}),
                      correlation({1.0, 4.0, 2.0, 7.0}, {3.0, 1.0, 5.0, 2.0}));
  test::expect_recorded("report/signals.txt", text);
}

}  // namespace
}  // namespace imuscope::report
