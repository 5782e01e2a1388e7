/// Intervals of white noise beside a Gauss-Markov process that is nearly white and whose rate nobody knows.

#include "models/noise/loose_rates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/simulated_noise.h"

namespace imuscope::noise {
namespace {

constexpr double kSampled_hz = 100.0;
constexpr double kWhite = 1.0;

Model sensor_with_low_pass() {
  constexpr double kFastRate =
      1.135;  // a sample: as the static gyroscopes of the reference literature have it
  return {{{ProcessKind::kWhiteNoise, kWhite, {}}, {ProcessKind::kGaussMarkov, 0.11, {kFastRate, 0.0}}}};
}

FitResult fit_drawn(const Model& truth, unsigned seed, Intervals intervals) {
  std::mt19937_64 random(seed);
  const auto x = simulated_noise(truth, std::size_t{1} << 14U, random);
  FitOptions options;
  options.intervals = intervals;
  return fit(haar_wavelet_variance(x).value(), parse_model("WN+GM").value(), kSampled_hz, options).value();
}

const ParameterEstimate& white_of(const FitResult& fit) { return fit.parameters.front(); }

bool is_inside(const ParameterEstimate& p, double truth) {
  return (!p.ci_low || *p.ci_low <= truth) && (!p.ci_high || truth <= *p.ci_high);
}

TEST(LooseRates, WhiteNoiseBesideANearlyWhiteProcessIsHeld) {
  for (const Intervals intervals : {Intervals::kQuick, Intervals::kInverted}) {
    const int series = intervals == Intervals::kQuick ? 200 : 40;
    int held = 0;
    int held_by_sd = 0;  // of the estimate alone
    int told = 0;
    for (int s = 0; s < series; ++s) {
      const FitResult fit = fit_drawn(sensor_with_low_pass(), static_cast<unsigned>(s), intervals);
      const auto& white = white_of(fit);
      held += is_inside(white, kWhite) ? 1 : 0;
      const double by_sd = 1.959964 * white.log_sd.value_or(10.0);
      held_by_sd += std::abs(std::log(kWhite / white.value)) <= by_sd ? 1 : 0;
      told += white.ci_low || white.ci_high ? 1 : 0;
    }
    // 91 %, less 3.3 of the sd of such a count.
    EXPECT_GE(held, 0.91 * series - 3.3 * std::sqrt(0.91 * 0.09 * series)) << "of " << series;
    EXPECT_LT(held_by_sd, held);
    EXPECT_GE(told, series / 2);
  }
}

TEST(LooseRates, AWhiteNoiseOfZeroBoundsNoOtherParameter) {
  int at_zero = 0;
  for (unsigned s = 0; s < 20; ++s) {
    const FitResult quick = fit_drawn(sensor_with_low_pass(), s, Intervals::kQuick);
    if (white_of(quick).value > 0.0) continue;
    ++at_zero;
    const FitResult fit = fit_drawn(sensor_with_low_pass(), s, Intervals::kInverted);
    for (const std::size_t p : {1U, 2U}) {
      ASSERT_TRUE(quick.parameters[p].ci_low && quick.parameters[p].ci_high);
      const auto& rate_or_amplitude = fit.parameters[p];
      // With white noise the process is a slower and smaller one.
      EXPECT_LT(rate_or_amplitude.ci_low.value_or(0.0), 0.7 * *quick.parameters[p].ci_low) << s;
    }
  }
  EXPECT_GE(at_zero, 3);
}

TEST(LooseRates, AProcessFarAwayLeavesTheQuickInterval) {
  const Model slow{{{ProcessKind::kWhiteNoise, kWhite, {}}, {ProcessKind::kGaussMarkov, 0.1, {0.01, 0.0}}}};
  const FitResult fit = fit_drawn(slow, 1, Intervals::kQuick);
  const auto& white = white_of(fit);
  ASSERT_TRUE(white.ci_low && white.ci_high && white.log_sd);
  // About the logarithm's middle, as wide as its sd says.
  EXPECT_NEAR(std::log(*white.ci_high / white.value), std::log(white.value / *white.ci_low), 1e-9);
  EXPECT_NEAR(std::log(*white.ci_high / *white.ci_low), 2.0 * 1.959964 * *white.log_sd, 1e-5);
}

TEST(LooseRates, OnlyALooseRateOfAnotherProcessIsLeantOn) {
  const Model model = sensor_with_low_pass();  // beta, sigma2 of GM after WN's sigma2
  const auto of = [](double sd_rate, double correlation) {
    ParameterCovariance out;
    out.covariance = Eigen::Matrix3d::Identity();
    out.covariance.diagonal() << 1e-4, sd_rate * sd_rate, 0.04;
    out.covariance(0, 1) = out.covariance(1, 0) = correlation * 0.01 * sd_rate;
    out.covariance(1, 2) = out.covariance(2, 1) = 0.9 * sd_rate * 0.2;
    out.determined = {true, true, true};
    return out;
  };
  EXPECT_EQ(leaning_on_loose_rates(model, of(0.5, 0.5)), (std::vector<bool>{true, false, false}));
  EXPECT_EQ(leaning_on_loose_rates(model, of(0.5, 0.2)), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(leaning_on_loose_rates(model, of(0.1, 0.5)), (std::vector<bool>{false, false, false}));
  auto undetermined = of(0.5, 0.5);
  undetermined.determined[1] = false;
  EXPECT_EQ(leaning_on_loose_rates(model, undetermined), (std::vector<bool>{false, false, false}));
}

}  // namespace
}  // namespace imuscope::noise
