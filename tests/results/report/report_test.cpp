#include "results/report/report.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "results/report/page_parts.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/markup.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::content_of;
using testing::HasSubstr;

/// Whether the page holds `text`; a failure names the text, not the whole page.
testing::AssertionResult holds(const std::string& page, const std::string& text) {
  const bool found = page.find(text) != std::string::npos;
  return (found ? testing::AssertionSuccess() : testing::AssertionFailure())
         << "the page " << (found ? "holds " : "does not hold ") << text;
}

/// Writes a run folder, makes its report, returns the page.
std::string page_of(const std::filesystem::path& folder) {
  const auto written = write_report(folder);
  EXPECT_TRUE(written) << written.error().text();
  return content_of(folder / "report.html");
}

std::string page_of(const test::SyntheticRun& options) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, options);
  return page_of(folder);
}

/// Names of elements left open or closed out of order; empty for well-formed markup.
std::string nesting_fault(const std::string& markup) {
  static const std::regex kTag("<(/?)([a-z][a-z0-9]*)([^<>]*?)(/?)>");
  std::vector<std::string> open;
  for (std::sregex_iterator tag(markup.begin(), markup.end(), kTag), end; tag != end; ++tag) {
    const std::string name = (*tag)[2];
    if (name == "meta" || name == "br" || (*tag)[4] == "/") continue;
    if ((*tag)[1] == "/") {
      if (open.empty() || open.back() != name)
        return "</" + name + "> does not close " + (open.empty() ? "anything" : open.back());
      open.pop_back();
    } else {
      open.push_back(name);
    }
  }
  return open.empty() ? "" : "never closed: " + open.back();
}

nlohmann::json figures_of(const std::string& page) {
  const std::string mark = "id=\"figures\">";
  const std::size_t begin = page.find(mark) + mark.size();
  const auto sheet =
      nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin), nullptr, false);
  return sheet.is_discarded() ? sheet : sheet.at("figures");
}

/// Time of value `i` of a figure.
double time_of(const nlohmann::json& figure, std::size_t i) {
  return figure["times"][0].get<double>() + static_cast<double>(i) * figure["times"][1].get<double>();
}

TEST(Report, PageIsWellFormedAndHoldsEverySImu) {
  test::SyntheticRun options;
  options.names = {"mtx1", "mtx2", "left_rear"};
  const std::string page = page_of(options);
  EXPECT_EQ(nesting_fault(test::markup_of(page)), "");
  for (const std::string& name : options.names) {
    EXPECT_TRUE(holds(page, "<h3>" + name + "</h3>"));
    for (const char* figure : {"psi-x-", "r-z-", "error-gyro_x-", "error-accel_z-", "wavelet-gyro_z-"}) {
      EXPECT_TRUE(holds(page, "data-figure=\"" + (figure + name) + "\""));
    }
  }
}

TEST(Report, EveryFigureThatThePageNamesIsInTheSheetOnce) {
  const std::string page = page_of(test::SyntheticRun{});
  const auto figures = figures_of(page);
  ASSERT_FALSE(figures.is_discarded());
  std::multiset<std::string> drawn;
  for (const auto& figure : figures) drawn.insert(figure.at("id").get<std::string>());
  static const std::regex kPlace("data-figure=\"([^\"]*)\"");
  const std::string markup = test::markup_of(page);
  std::size_t n_places = 0;
  for (std::sregex_iterator place(markup.begin(), markup.end(), kPlace), end; place != end;
       ++place, ++n_places) {
    EXPECT_EQ(drawn.count((*place)[1]), 1U) << (*place)[1];
  }
  // Map, speed, height; per sensor six panels each of Figures 1, 2 and 4, fifteen of Figure 3, one
  // dependence.
  EXPECT_EQ(n_places, 3U + 2U * 34U);
  EXPECT_EQ(drawn.size(), n_places);
}

TEST(Report, ThePageLoadsNothing) {
  const std::string page = page_of(test::SyntheticRun{});
  const std::string markup = test::markup_of(page);
  EXPECT_FALSE(std::regex_search(markup, std::regex("\\s(src|action|data|poster|srcset)\\s*=")));
  EXPECT_FALSE(std::regex_search(markup, std::regex("\\shref\\s*=\\s*\"[^#]")))
      << "links lead within the page only";
  EXPECT_FALSE(holds(markup, "<link"));
  EXPECT_FALSE(holds(markup, "http:"));
  EXPECT_FALSE(holds(markup, "https:"));
  for (const char* loader : {"@import", "url(", "importScripts", "fetch(", "new Worker", "sendBeacon"}) {
    EXPECT_FALSE(holds(page, loader));
  }
  EXPECT_TRUE(holds(page, "Content-Security-Policy\" content=\"default-src 'none'"));
}

TEST(Report, ThePlottingLibraryStandsInThePageWithItsLicence) {
  const std::string page = page_of(test::SyntheticRun{});
  EXPECT_TRUE(holds(page, "Permission is hereby granted, free of charge"));
  EXPECT_TRUE(holds(page, "@license"));
}

TEST(Report, TextsWithMarkupAreTextInThePageAndInItsScripts) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  auto models = nlohmann::json::parse(content_of(folder / "models.json"));
  for (auto& fit : models.at("models")) {
    if (fit.at("regime") == "static") fit["regime"] = "<img onerror=alert(1)>&\"'";
    if (fit.at("regime") == "dynamic") fit["regime"] = "<!--<script>";
  }
  std::ofstream(folder / "models.json") << models.dump();
  const std::string page = page_of(folder);
  EXPECT_FALSE(holds(page, "<img"));
  EXPECT_FALSE(holds(page, "<!--<script>"));
  EXPECT_TRUE(holds(page, "&lt;img onerror=alert(1)&gt;&amp;&quot;&#39;"));
  EXPECT_EQ(nesting_fault(test::markup_of(page)), "");
  const auto figures = figures_of(page);
  ASSERT_FALSE(figures.is_discarded());
  EXPECT_THAT(figures.dump(), HasSubstr("<img onerror=alert(1)>"));
}

TEST(Report, ClosingScriptTagsInJsonCannotEndTheScript) {
  EXPECT_EQ(report::json_for_script("{\"a\":\"</script>\"}"), "{\"a\":\"\\u003c/script>\"}");
}

TEST(Report, FifteenMinutesOfThreeSensorsStayBelowOneAndAHalfMegabytes) {
  test::SyntheticRun options;
  options.duration_s = 900.0;
  options.names = {"mtx1", "mtx2", "mtx3"};
  EXPECT_LT(page_of(options).size(), 1'500'000U);
}

TEST(Report, ErrorFigureShowsTheExtremesOfTheSamples) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  // One sample of 10 rad/s among thousands: it must not be lost in a mean.
  std::string errors = content_of(folder / "errors_mtx1.csv");
  errors += "60.0,6000,10,0,0,0,0,0,dynamic\n";
  std::ofstream(folder / "errors_mtx1.csv") << errors;
  const auto figures = figures_of(page_of(folder));
  for (const auto& figure : figures) {
    if (figure["id"] != "error-gyro_x-mtx1") continue;
    double largest = 0.0;
    for (const auto& high : figure["high"])
      largest = std::max(largest, high.is_null() ? 0.0 : high.get<double>());
    EXPECT_NEAR(largest, 572.958, 0.1);  // 10 rad/s in deg/s, four digits
    return;
  }
  FAIL() << "no such figure";
}

TEST(Report, WheelsOfADriveWithOdometryAreDrawnAndSummedUp) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  EXPECT_FALSE(holds(page_of(folder), "<h3>Odometry")) << "without odometry nothing is said of it";
  // 60 s at 10 Hz: 20 s standing, the last 15 of them used; the scale goes from 0 to 1.2 %.
  std::ofstream out(folder / "odometry.csv");
  out << "time_s,speed_mps,standing,zero_velocity,scale_percent,sd_scale_percent\n";
  for (int i = 0; i <= 600; ++i) {
    const double t = 0.1 * i;
    out << t << ',' << (t <= 20.0 ? 0.0 : 10.0) << ',' << (t <= 20.0) << ',' << (t > 5.0 && t <= 20.0) << ','
        << 1.2 * t / 60.0 << ",0.05\n";
  }
  out.close();
  const std::string page = page_of(folder);
  EXPECT_TRUE(holds(page, "+1.20 % (sd 0.05 %)"));
  EXPECT_TRUE(holds(page, "They stood for 20 s; for 15 s of it"));
  EXPECT_EQ(nesting_fault(test::markup_of(page)), "");
  int found = 0;
  for (const auto& figure : figures_of(page)) {
    if (figure["id"] != "wheel_speed" && figure["id"] != "wheel_scale") continue;
    ++found;
    EXPECT_GT(figure["mid"].size(), 100U);
  }
  EXPECT_EQ(found, 2);
}

TEST(Report, ALiveRunHasABudgetOfTimeForEachDevice) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  EXPECT_FALSE(holds(page_of(folder), "adapter up to")) << "a recording has no line";
  auto run = nlohmann::json::parse(std::ifstream(folder / "run.json"));
  run["devices"][1]["time_budget"] = {{"wire_s", 0.003733},  {"adapter_s", 0.016},    {"latency_s", 0.0098},
                                      {"clock_sd_s", 21e-6}, {"clock_drift_ppm", 11}, {"t_d_s", -0.0048},
                                      {"sd_t_d_s", nullptr}};
  std::ofstream(folder / "run.json") << run;
  const std::string page = page_of(folder);
  for (const char* cell : {"3.733", "16", "9.80", "21", "-4.800", "–"})
    EXPECT_TRUE(holds(page, std::string("\">") + cell + "</td>")) << cell;
  EXPECT_EQ(nesting_fault(test::markup_of(page)), "");
}

TEST(Report, AGapInTheErrorsIsAGapInTheFigure) {
  test::SyntheticRun options;
  options.gap_begin_s = 20.0;
  options.gap_end_s = 40.0;
  for (const auto& figure : figures_of(page_of(options))) {
    if (figure["id"] != "error-gyro_x-mtx1") continue;
    for (std::size_t i = 0; i < figure["mid"].size(); ++i) {
      const double time_s = time_of(figure, i);
      if (time_s > 21.0 && time_s < 39.0) {
        EXPECT_TRUE(figure["mid"][i].is_null()) << time_s;
      }
      if (time_s > 1.0 && time_s < 19.0) {
        EXPECT_TRUE(figure["mid"][i].is_number()) << time_s;
      }
    }
    return;
  }
  FAIL() << "no such figure";
}

TEST(Report, GyroscopeModelsAreShownInDegrees) {
  // The made-up static WN sigma2 is 0.5055 (deg/s)^2, written in (rad/s)^2.
  const std::string page = page_of(test::SyntheticRun{});
  EXPECT_TRUE(std::regex_search(page, std::regex("<td[^>]*>\\(deg/s\\)²</td><td[^>]*>0.5055 ")));
  // Other tools' configurations are in their own units.
  EXPECT_FALSE(holds(std::regex_replace(page, std::regex("<pre>[^<]*</pre>"), ""), "(rad/s)"));
}

TEST(Report, TruthIsComparedWhereGivenAndNotMissedSilentlyWhereAbsent) {
  test::SyntheticRun options;
  EXPECT_TRUE(holds(page_of(options), ">truth<"));
  options.with_truth = false;
  const std::string page = page_of(options);
  EXPECT_FALSE(holds(page, ">truth<"));
  EXPECT_TRUE(holds(page, "No truth.json in this run"));
}

TEST(Report, TheRegressionsSayWhatTheyFoundAndWhatItWouldMean) {
  test::SyntheticRun options;
  const std::string page = page_of(options);
  EXPECT_TRUE(holds(page, "15.42 %"));
  EXPECT_TRUE(holds(page, "1.23 %"));
  EXPECT_TRUE(holds(page, "&lt; 10⁻⁶"));
  EXPECT_TRUE(holds(page, "f_x: g-sensitivity of 0.56 deg/s per g"));
  EXPECT_FALSE(holds(page, "g-sensitivity of nothing"));
  EXPECT_TRUE(holds(page, "\"id\":\"scatter-gyro_x-omega_x-mtx1\""));
  EXPECT_TRUE(holds(page, "gyroscope x, deg/s, against its axis&#39; angular rate; r = 1.000"));
  options.with_regression = false;
  const std::string without = page_of(options);
  EXPECT_TRUE(holds(without, "No regression.json in this run"));
  EXPECT_TRUE(holds(without, "No scatter_NAME.csv in this run"));
}

TEST(Report, ACalibrationAloneMakesAReportThatNamesWhatIsAbsent) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename() != "calibration.json") std::filesystem::remove(entry.path());
  }
  const std::string page = page_of(folder);
  EXPECT_EQ(nesting_fault(test::markup_of(page)), "");
  for (const char* file : {"run.json", "navigation.csv", "calibration_mtx1.csv", "errors_mtx2.csv",
                           "scatter_mtx1.csv", "models.json", "regression.json", "truth.json"}) {
    EXPECT_TRUE(holds(page, "<li>" + std::string(file) + "</li>"));
  }
  EXPECT_TRUE(holds(page, "No navigation in this run"));
  EXPECT_TRUE(holds(page, "No noise model in this run"));
}

TEST(Report, AMissingFolderIsOneClearSentence) {
  const auto written = write_report(test::scratch_folder() / "nowhere");
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text(),
              HasSubstr("nowhere is not a folder; give the folder that a run wrote with --out"));
}

TEST(Report, AFolderWithoutCalibrationIsRefusedAndLeftAlone) {
  const auto folder = test::scratch_folder();
  const auto written = write_report(folder);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text(), HasSubstr("holds no calibration.json"));
  EXPECT_TRUE(std::filesystem::is_empty(folder));
}

TEST(Report, ABrokenJsonIsNamed) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  std::ofstream(folder / "models.json") << "{\"models\": [";
  const auto written = write_report(folder);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text(), HasSubstr("models.json is not a JSON object"));
}

TEST(Report, AMissingColumnIsNamedWithItsFile) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  std::ofstream(folder / "errors_mtx1.csv") << "time_s,counter,e_gyro_x_radps\n0,0,0\n";
  const auto written = write_report(folder);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text(), HasSubstr("errors_mtx1.csv has no column 'e_gyro_y_radps'"));
}

TEST(Report, AnEmptyCsvIsNamed) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  std::ofstream(folder / "navigation.csv") << "";
  const auto written = write_report(folder);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text(), HasSubstr("navigation.csv"));
}

TEST(Report, CsvFilesWithAHeaderAloneLeaveTheirFiguresOut) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  for (const char* file : {"navigation.csv", "calibration_mtx1.csv", "errors_mtx1.csv"}) {
    const std::string content = content_of(folder / file);
    std::ofstream(folder / file) << content.substr(0, content.find('\n') + 1);
  }
  const std::string page = page_of(folder);
  EXPECT_FALSE(holds(page, "data-figure=\"map\""));
  EXPECT_TRUE(holds(page, "No errors_mtx1.csv with samples"));
  EXPECT_FALSE(holds(test::markup_of(page), "nan"));
}

TEST(Report, UnknownNumbersAreNotDrawnNorCalculatedWith) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  auto calibration = nlohmann::json::parse(content_of(folder / "calibration.json"));
  for (auto& imu : calibration["imus"]) {
    imu["boresight_sd_deg"] = nullptr;
    imu["C_b_s"] = {1, 0, nullptr, 0, 1, 0, 0, 0, 1};
    imu.erase("r_bs_b_m");
    imu["observable"] = nullptr;
  }
  std::ofstream(folder / "calibration.json") << calibration.dump();
  const std::string page = page_of(folder);
  EXPECT_TRUE(holds(page, "The mounting is not known."));
  EXPECT_TRUE(holds(page, "boresight unknown"));
}

TEST(Report, SameRunSamePage) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  const std::string first = page_of(folder);
  EXPECT_EQ(page_of(folder), first);
}

}  // namespace
}  // namespace imuscope
