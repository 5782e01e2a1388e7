#include "report/verdict.h"

#include <gmock/gmock.h>

#include "tests/report/synthetic_run.h"
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

TEST(Verdict, ABoresightSdAboveTheLimitIsNotUsableAndSaysSo) {
  test::SyntheticRun options;
  options.boresight_sd_deg = 0.3;
  const auto run = run_with(options);
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kNo);
  EXPECT_THAT(verdict.reasons, Contains(AllOf(HasSubstr("mtx1"), HasSubstr("0.3 deg (wanted: 0.1 deg)"))));
  EXPECT_THAT(next_steps(run, {}), Contains(HasSubstr("figures of eight")));
}

TEST(Verdict, WhatIsNotObservableIsNamedWithTheManoeuvreThatShowsIt) {
  test::SyntheticRun options;
  options.psi_z_observable = false;
  const auto run = run_with(options);
  const Verdict verdict = calibration_verdict(run);
  EXPECT_EQ(verdict.answer, Answer::kNo);
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("Not observable in this drive: boresight about z")));
  EXPECT_THAT(next_steps(run, {}), Contains(HasSubstr("Brake and start firmly")));
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

TEST(Verdict, WithoutModelsNothingIsClaimed) { EXPECT_EQ(model_verdict({}).answer, Answer::kOpen); }

}  // namespace
}  // namespace imuscope::report
