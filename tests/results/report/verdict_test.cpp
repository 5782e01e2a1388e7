#include "results/report/verdict.h"

#include <gmock/gmock.h>

#include "results/report/sections.h"

#include "tests/results/report/synthetic_run.h"
#include "tests/support/shared_data.h"

namespace imuscope::report {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

RunFiles run_with(const test::SyntheticRun& options) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, options);
  auto run = read_run_files(folder);
  EXPECT_TRUE(run) << run.error().text();
  return *run;
}

TEST(Verdict, AnAccurateMountingIsUsable) {
  EXPECT_EQ(calibration_verdict(run_with({})).answer, Answer::kYes);
}

TEST(Verdict, ABoresightSdAboveTheLimitIsALimitAndSaysSo) {
  test::SyntheticRun options;
  options.boresight_sd_deg = 0.3;
  const auto run = run_with(options);
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kPartly);
  EXPECT_THAT(verdict.reasons,
              Contains(AllOf(HasSubstr("mtx1: usable with limits"), HasSubstr("0.3 deg (wanted: 0.1 deg)"))));
  EXPECT_THAT(next_steps(run, {}), Contains(HasSubstr("figures of eight")));
}

TEST(Verdict, ABoresightThatAProtractorTellsAsWellIsNotUsable) {
  test::SyntheticRun options;
  options.boresight_sd_deg = 1.3;
  const auto run = run_with(options);
  EXPECT_EQ(calibration_verdict(run).answer, Answer::kNo);
  EXPECT_THAT(calibration_verdict(run).headline, HasSubstr("Not usable"));
}

TEST(Verdict, WhatIsNotObservableIsNamedWithTheManoeuvreThatShowsIt) {
  test::SyntheticRun options;
  options.psi_z_observable = false;
  const auto run = run_with(options);
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kPartly);
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("Not observable in this drive: boresight about z")));
  EXPECT_THAT(next_steps(run, {}), Contains(HasSubstr("brake and accelerate firmly")));
}

TEST(Verdict, AnErrorFarBeyondItsSdIsTold) {
  auto run = run_with({});
  // The same estimate with a hundredth of the sd: the errors of the made-up run are about one sd.
  for (double scale : {0.01}) {
    for (auto& study : run.studies) {
      for (auto& sd : study.calibration["boresight_sd_deg"]) sd = sd.get<double>() * scale;
    }
  }
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kPartly);
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("more than their sd allows")));
}

TEST(Verdict, AReceiverThatContradictsTheMotionMakesNothingUsable) {
  auto run = run_with({});
  run.run["gnss"] = {{"contradicts_motion", false}};
  EXPECT_EQ(calibration_verdict(run).answer, Answer::kYes);
  run.run["gnss"] = {{"contradicts_motion", true}};
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kNo);
  EXPECT_THAT(verdict.headline, HasSubstr("contradict the motion"));
}

TEST(Verdict, WhatTheLookAtTheDataFoundStandsFirstAndJudgesTheRest) {
  auto run = run_with({});
  EXPECT_THAT(calibration_verdict(run).headline, HasSubstr("Usable"));
  run.run["findings"] = nlohmann::json::array({{{"harm", "note"}, {"text", "a: never rests"}}});
  EXPECT_EQ(calibration_verdict(run).answer, Answer::kYes);
  run.run["findings"].push_back({{"harm", "limits"}, {"text", "a: gyro x is cut off"}});
  EXPECT_EQ(calibration_verdict(run).answer, Answer::kPartly);
  EXPECT_THAT(calibration_verdict(run).headline, HasSubstr("Usable with limits"));
  run.run["findings"].push_back({{"harm", "wrong"}, {"text", "b: <in> g"}});
  EXPECT_EQ(calibration_verdict(run).answer, Answer::kNo);
  EXPECT_THAT(calibration_verdict(run).headline, HasSubstr("Not usable"));
  const std::string page = summary_section(run, {}).str();
  const auto wrong = page.find("b: &lt;in&gt; g");
  EXPECT_LT(wrong, page.find("a: gyro x is cut off"));
  EXPECT_LT(page.find("a: gyro x is cut off"), page.find("Is the calibration usable?"));
  EXPECT_EQ(page.find("a: never rests"), std::string::npos);
}

TEST(Verdict, DataAreNotCalledFlawlessWhereTheRunWarned) {
  auto run = run_with({});
  run.run["findings"] = nlohmann::json::array();
  run.run["warnings"] = nlohmann::json::array();
  run.run["notes"] = {"mtx1: no temperature in this record"};
  EXPECT_EQ(data_verdict(run).answer, Answer::kYes) << "what was left out of a study is no fault of the data";
  const std::string page = making_section(run).str();
  EXPECT_NE(page.find("The run gave no warning."), std::string::npos);
  EXPECT_NE(page.find("mtx1: no temperature in this record"), std::string::npos);
  run.run["warnings"] = {"mtx1: 12 samples were lost"};
  const Verdict verdict = data_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kPartly);
  EXPECT_EQ(verdict.headline, "Yes, but the run gave 1 warning.");
  EXPECT_EQ(verdict.reasons, std::vector<std::string>{"mtx1: 12 samples were lost"});
}

TEST(Verdict, ModelsThatTheDataDoNotContradictAreAdequate) {
  EXPECT_EQ(model_verdict(read_fits(run_with({}).models)).answer, Answer::kYes);
}

TEST(Verdict, ModelsThatTheTestRejectsAreNot) {
  test::SyntheticRun options;
  options.j_p_value = 1e-7;
  EXPECT_EQ(model_verdict(read_fits(run_with(options).models)).answer, Answer::kNo);
}

TEST(Verdict, OneRejectionInTwentyFourIsChance) {
  auto fits = read_fits(run_with({}).models);
  ASSERT_EQ(fits.size(), 24U);
  fits.front().j_p_value = 0.03;
  const Verdict verdict = model_verdict(fits);
  EXPECT_EQ(verdict.answer, Answer::kYes);
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("rejects 1 of 24 models (1.2 expected by chance")));
}

TEST(Verdict, AModelOverAllRegimesIsNotJudgedBesideThoseOfTheRegimes) {
  auto fits = read_fits(run_with({}).models);
  Fit whole = fits.front();
  whole.regime = "all";
  whole.j_p_value = 1e-9;
  fits.push_back(whole);
  EXPECT_EQ(model_verdict(fits).answer, Answer::kYes);
  EXPECT_EQ(model_verdict({whole}).answer, Answer::kNo);
}

/// A model of which the white noise is known to a hundredth, and of whose slow process only that it is there.
Fit partly_known(double slow_beta, double record_s) {
  constexpr double kRate_hz = 100.0;
  Fit fit;
  fit.imu = "mtx1";
  fit.axis = "gyro_x";
  fit.regime = "dynamic";
  fit.unit = "deg/s";
  fit.model = "WN+GM";
  fit.n = record_s * kRate_hz;
  fit.identifiable = false;
  fit.levels.push_back({2.0 / kRate_hz, 0.32, 0.31, 0.33, 0.32});
  fit.parameters = {{"WN", "sigma2", "(deg/s)²", 0.64, 0.64 * 0.98, 0.64 / 0.98},
                    {"GM1", "beta", "1/s", slow_beta, std::nullopt, std::nullopt},
                    {"GM1", "sigma2", "(deg/s)²", 0.01, std::nullopt, std::nullopt}};
  return fit;
}

TEST(Verdict, SaysFirstWhatIsKnownAndHowWell) {
  const auto known = what_is_known({partly_known(0.01, 900.0)});
  ASSERT_EQ(known.size(), 2U);
  // The interval of the variance is 2 % either way, that of the sd half of it.
  EXPECT_EQ(known[0], "Known of the white noise, dynamic: gyroscopes 0.8 deg/s a sample, ± 1 %.");
  EXPECT_THAT(known[1], HasSubstr("GM1 in 0 of 1 models"));
  EXPECT_EQ(model_verdict({partly_known(0.01, 900.0)}).reasons.front(), known[0]);
}

TEST(Verdict, SaysHowLongARecordTheSlowProcessWouldNeed) {
  // 100 s of correlation, seen in a quarter of an hour, want 2000 s.
  EXPECT_THAT(records_needed({partly_known(0.01, 900.0)}),
              testing::ElementsAre(
                  AllOf(HasSubstr("about 33 min 20 s as fitted"), HasSubstr("This run has 15 min"))));
  // A process slower than the record is known by no more than that.
  EXPECT_THAT(records_needed({partly_known(1e-4, 900.0)}),
              testing::ElementsAre(HasSubstr("more than 5 h 0 min in 1 models")));
  EXPECT_TRUE(records_needed({partly_known(0.1, 900.0)}).empty());
}

TEST(Verdict, WithoutModelsNothingIsClaimed) { EXPECT_EQ(model_verdict({}).answer, Answer::kOpen); }

}  // namespace
}  // namespace imuscope::report
