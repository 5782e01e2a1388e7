#include "models/noise/export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>

#include "models/noise/felt_noise.h"
#include "models/noise/replicates.h"

namespace imuscope::noise {
namespace {

using testing::HasSubstr;

constexpr double kRateHz = 200.0;
constexpr std::size_t kSeriesLength = 1U << 14U;
constexpr double kRadPerDegree = std::numbers::pi / 180.0;

/// A signal of white noise, a Gauss-Markov or (rate 0) a random-walk bias; variances of one sample.
std::vector<double> signal(double white, double bias, double rate_per_sample, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<double> x(kSeriesLength);
  const double phi = std::exp(-rate_per_sample);
  const double step = rate_per_sample > 0.0 ? bias * (1.0 - phi * phi) : bias;
  double state = rate_per_sample > 0.0 ? std::sqrt(bias) * normal(random) : 0.0;
  for (double& v : x) {
    v = state + std::sqrt(white) * normal(random);
    state = phi * state + std::sqrt(step) * normal(random);
  }
  return x;
}

FitResult fitted(const std::vector<double>& x, const char* model, double rate_hz = kRateHz) {
  return fit(haar_wavelet_variance(x).value(), parse_model(model).value(), rate_hz).value();
}

/// The numbers of "key: value" and "id id key value type" lines; of a list its first.
std::map<std::string, double> numbers_of(const std::string& text) {
  std::map<std::string, double> out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    line = line.substr(0, line.find('#'));
    for (char& c : line) {
      if (c == ':' || c == '[' || c == ',' || c == '\t') c = ' ';
    }
    std::istringstream words(line);
    std::string key;
    while (words >> key && key.find_first_not_of("0123456789") == std::string::npos) {
    }
    double value = 0.0;
    if (words >> value) out[key] = value;
  }
  return out;
}

/// What a tool's file means, in SI and by the tool's own equations: densities, and the bias' correlation
/// time.
struct Meaning {
  double white_density = 0.0;
  double walk_density = 0.0;
  double bias_variance = 0.0;
  double correlation_time_s = 0.0;
};

Meaning meaning_of_kalibr(const std::string& text) {
  auto n = numbers_of(text);
  EXPECT_EQ(n.at("update_rate"), kRateHz);
  return {std::pow(n.at("gyroscope_noise_density"), 2), std::pow(n.at("gyroscope_random_walk"), 2), 0.0, 0.0};
}

/// OpenVINS: Qc = sigma^2 / dt of a rate, sigma_b^2 dt of a bias, as kalibr.
Meaning meaning_of_openvins(const std::string& text) {
  EXPECT_NE(text.find("imu0:\n  gyroscope_noise_density: "), std::string::npos);
  return meaning_of_kalibr(text);
}

/// VINS-Fusion, a step of dt with two samples: velocity gets (dt/2)^2 (n^2 + n^2), a bias (dt w)^2.
Meaning meaning_of_vins_fusion(const std::string& text) {
  auto n = numbers_of(text);
  const double dt = 1.0 / kRateHz;
  const double per_step = 2.0 * std::pow(0.5 * dt * n.at("acc_n"), 2);
  return {per_step / dt, std::pow(dt * n.at("acc_w"), 2) / dt, 0.0, 0.0};
}

/// LIO-SAM: a covariance of noise^2 in continuous time, a bias that goes by sqrt(dt) n between key frames.
Meaning meaning_of_lio_sam(const std::string& text) {
  auto n = numbers_of(text);
  constexpr double kBetweenFrames_s = 0.4;
  return {std::pow(n.at("imuGyrNoise"), 2),
          std::pow(std::sqrt(kBetweenFrames_s) * n.at("imuGyrBiasN"), 2) / kBetweenFrames_s, 0.0, 0.0};
}

/// GTSAM: covariances in continuous time.
Meaning meaning_of_gtsam(const std::string& text) {
  const auto argument = [&](const std::string& setter) {
    const auto at = text.find(setter + "(");
    EXPECT_NE(at, std::string::npos) << setter;
    return std::stod(text.substr(at + setter.size() + 1));
  };
  return {argument("setGyroscopeCovariance"), argument("setBiasOmegaCovariance"), 0.0, 0.0};
}

/// Of an EKF2 update of 10 ms: rate noise NOISE in each, a step of B_NOISE * dt of the bias in each.
Meaning meaning_of_px4(const std::string& text) {
  constexpr double kUpdate_s = 0.01;
  auto n = numbers_of(text);
  return {std::pow(n.at("EKF2_ACC_NOISE"), 2) * kUpdate_s,
          std::pow(n.at("EKF2_ACC_B_NOISE") * kUpdate_s, 2) / kUpdate_s, 0.0, 0.0};
}

/// Bias of the simulation plugins: db/dt = -b / T + random_walk * white.
Meaning meaning_of_ros(const std::string& text) {
  auto n = numbers_of(text);
  const double t = n.at("gyroscope_bias_correlation_time");
  EXPECT_NEAR(n.at("angular_velocity_covariance") / (std::pow(n.at("gyroscope_noise_density"), 2) * kRateHz),
              1.0, 1e-6);
  EXPECT_EQ(n.at("linear_acceleration_covariance"), -1.0);
  return {std::pow(n.at("gyroscope_noise_density"), 2), 0.0,
          std::pow(n.at("gyroscope_random_walk"), 2) * t / 2.0, t};
}

/// KF-GINS: deg/sqrt(h) and deg/h; hours.
Meaning meaning_of_kf_gins(const std::string& text) {
  auto n = numbers_of(text);
  return {std::pow(n.at("arw") * kRadPerDegree / 60.0, 2), 0.0,
          std::pow(n.at("gbstd") * kRadPerDegree / 3600.0, 2), n.at("corrtime") * 3600.0};
}

struct RoundTrip {
  ExportFormat format;
  SignalUnit unit;
  double unit_si;  ///< of the signal's unit
  const char* model;
  double white;            ///< truth, signal unit squared
  double bias;             ///< step variance of a walk, variance of a Gauss-Markov process
  double rate_per_sample;  ///< 0: a walk
  std::function<Meaning(const std::string&)> meaning;
};

class ExportRoundTrip : public testing::TestWithParam<RoundTrip> {};

/// Fit, export, read as the other tool reads, simulate by its equations, refit: the exported parameters lie
/// in the refit's 95 % intervals as often as those promise.
TEST_P(ExportRoundTrip, ARefitOfWhatTheFileMeansHasTheExportedModelInsideItsIntervals) {
  const RoundTrip& p = GetParam();
  constexpr int kTrips = 20;
  std::mt19937_64 random(42);
  std::vector<int> inside;
  for (int trip = 0; trip < kTrips; ++trip) {
    const FitResult first = fitted(signal(p.white, p.bias, p.rate_per_sample, random), p.model);
    ASSERT_TRUE(first.identifiable);
    const auto text = export_models({{"x", p.unit, first}}, p.format).value();
    const Meaning m = p.meaning(text);
    const double a = m.correlation_time_s > 0.0 ? 1.0 / (m.correlation_time_s * kRateHz) : 0.0;
    const FitResult again = fitted(
        signal(m.white_density * kRateHz, a > 0.0 ? m.bias_variance : m.walk_density / kRateHz, a, random),
        p.model);
    inside.resize(first.parameters.size());
    for (std::size_t i = 0; i < first.parameters.size(); ++i) {
      const auto& before = first.parameters[i];
      const auto& after = again.parameters[i];
      const double si = before.name == "beta" ? 1.0 : p.unit_si * p.unit_si;
      ASSERT_TRUE(after.ci_low.has_value()) << after.process << " " << after.name;
      inside[i] += *after.ci_low <= before.value * si && before.value * si <= *after.ci_high ? 1 : 0;
    }
  }
  // 19 of 20 expected; fewer than 16 has a chance of 0.3 % at the nominal 95 %.
  for (const int n : inside) EXPECT_GE(n, 16);
}

INSTANTIATE_TEST_SUITE_P(Each, ExportRoundTrip,
                         testing::Values(RoundTrip{ExportFormat::kKalibr, SignalUnit::kDegps, kRadPerDegree,
                                                   "WN+RW", 0.04, 4e-6, 0.0, meaning_of_kalibr},
                                         RoundTrip{ExportFormat::kOpenVins, SignalUnit::kRadps, 1.0, "WN+RW",
                                                   1e-5, 1e-9, 0.0, meaning_of_openvins},
                                         RoundTrip{ExportFormat::kVinsFusion, SignalUnit::kMps2, 1.0, "WN+RW",
                                                   1e-4, 1e-8, 0.0, meaning_of_vins_fusion},
                                         RoundTrip{ExportFormat::kLioSam, SignalUnit::kDegps, kRadPerDegree,
                                                   "WN+RW", 0.04, 4e-6, 0.0, meaning_of_lio_sam},
                                         RoundTrip{ExportFormat::kGtsam, SignalUnit::kRadps, 1.0, "WN+RW",
                                                   1e-5, 1e-9, 0.0, meaning_of_gtsam},
                                         RoundTrip{ExportFormat::kPx4, SignalUnit::kG, 9.80665, "WN+RW", 1e-6,
                                                   1e-10, 0.0, meaning_of_px4},
                                         RoundTrip{ExportFormat::kRos, SignalUnit::kRadps, 1.0, "WN+GM", 1e-5,
                                                   4e-6, 0.01, meaning_of_ros},
                                         RoundTrip{ExportFormat::kKfGins, SignalUnit::kDegps, kRadPerDegree,
                                                   "WN+GM", 0.04, 0.02, 0.01, meaning_of_kf_gins}),
                         [](const auto& test) {
                           switch (test.param.format) {
                             case ExportFormat::kKalibr:
                               return "Kalibr";
                             case ExportFormat::kOpenVins:
                               return "OpenVins";
                             case ExportFormat::kVinsFusion:
                               return "VinsFusion";
                             case ExportFormat::kLioSam:
                               return "LioSam";
                             case ExportFormat::kGtsam:
                               return "Gtsam";
                             case ExportFormat::kPx4:
                               return "Px4";
                             case ExportFormat::kRos:
                               return "Ros";
                             default:
                               return "KfGins";
                           }
                         });

Eigen::MatrixXd matrix_of(const nlohmann::json& rows) {
  Eigen::MatrixXd m(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(rows.size()));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < rows.size(); ++c) {
      m(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = rows[r][c].get<double>();
    }
  }
  return m;
}

Eigen::MatrixXd root_of(const Eigen::MatrixXd& m) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(m);
  const Eigen::MatrixXd l = ldlt.matrixL();
  return ldlt.transpositionsP().transpose() * l *
         Eigen::MatrixXd(ldlt.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal());
}

/// A series of the system in the file. A state without noise of its own (a ramp's slope, a vibration) starts
/// where its covariance says it typically is: the model has one amplitude, not a distribution of them.
std::vector<double> simulated(const nlohmann::json& axis, std::size_t n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd f = matrix_of(axis.at("F"));
  const Eigen::MatrixXd q = matrix_of(axis.at("Q"));
  const Eigen::MatrixXd p0 = matrix_of(axis.at("P0"));
  const Eigen::MatrixXd q_root = root_of(q);
  const auto h_values = axis.at("H").get<std::vector<double>>();
  const auto size = f.rows();
  const Eigen::Map<const Eigen::RowVectorXd> h(h_values.data(), size);
  const auto draw = [&] {
    return Eigen::VectorXd(Eigen::VectorXd::NullaryExpr(size, [&] { return normal(random); }));
  };
  Eigen::VectorXd x = Eigen::VectorXd::Zero(size);
  if (q.isZero() && size > 0) {
    x[size - 1] = std::sqrt(p0.trace());
  } else {
    x = root_of(p0) * draw();
  }
  std::vector<double> z(n);
  for (double& v : z) {
    v = h.dot(x) + std::sqrt(axis.at("R").get<double>()) * normal(random);
    x = f * x + q_root * draw();
  }
  return z;
}

TEST(ExportStateSpace, EveryProcessComesBackFromASimulationOfItsMatrices) {
  struct Case {
    const char* name;
    Model model;
  };
  const std::vector<Case> cases{
      {"WN+2*GM",
       {{{ProcessKind::kWhiteNoise, 1.0, {}},
         {ProcessKind::kGaussMarkov, 0.5, {0.1, 0}},
         {ProcessKind::kGaussMarkov, 0.3, {0.002, 0}}}}},
      {"QN+WN+RW",
       {{{ProcessKind::kQuantization, 1.0, {}},
         {ProcessKind::kWhiteNoise, 0.09, {}},
         {ProcessKind::kRandomWalk, 1e-5, {}}}}},
      {"WN+DR", {{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kRamp, 1e-8, {}}}}},
      {"MA1", {{{ProcessKind::kMa1, 2.0, {-0.5, 0}}}}},
      {"ARMA11", {{{ProcessKind::kArma11, 1.0, {0.9, -0.4}}}}},
      {"WN+SIN", {{{ProcessKind::kWhiteNoise, 0.2, {}}, {ProcessKind::kSinusoid, 0.5, {0.21, 0}}}}}};
  constexpr std::size_t kSamples = 1U << 16U;
  std::mt19937_64 random(7);
  for (const Case& c : cases) {
    FitResult fit;
    fit.rate_hz = kRateHz;
    fit.spec = parse_model(c.name).value();
    fit.model = c.model;
    const auto text = export_models({{"x", SignalUnit::kNone, fit}}, ExportFormat::kStateSpace).value();
    const auto json = nlohmann::json::parse(text);
    const auto wv = haar_wavelet_variance(simulated(json.at("axes").at(0), kSamples, random)).value();
    const auto distance = distance_from_model(wv, fit);
    ASSERT_TRUE(distance.has_value());
    EXPECT_GT(distance->p_value, 1e-3) << c.name;
  }
}

TEST(ExportStateSpace, RefitsOfTheSimulatedMatricesHoldTheExportedParametersInTheirIntervals) {
  constexpr int kTrips = 20;
  std::mt19937_64 random(11);
  std::vector<int> inside(5);
  for (int trip = 0; trip < kTrips; ++trip) {
    FitResult fit;
    fit.rate_hz = 100.0;
    fit.spec = parse_model("WN+2*GM").value();
    fit.model = {{{ProcessKind::kWhiteNoise, 1.0, {}},
                  {ProcessKind::kGaussMarkov, 0.5, {0.1, 0}},
                  {ProcessKind::kGaussMarkov, 0.3, {0.002, 0}}}};
    const std::vector<double> truth{1.0, 10.0, 0.5, 0.2, 0.3};
    const auto json = nlohmann::json::parse(
        export_models({{"x", SignalUnit::kNone, fit}}, ExportFormat::kStateSpace).value());
    const auto again = fitted(simulated(json.at("axes").at(0), 1U << 16U, random), "WN+2*GM", 100.0);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const auto& p = again.parameters[i];
      inside[i] += p.ci_low && *p.ci_low <= truth[i] && truth[i] <= *p.ci_high ? 1 : 0;
    }
  }
  for (const int n : inside) EXPECT_GE(n, 16);
}

TEST(ExportStateSpace, TheContinuousFormSampledIsTheDiscreteOne) {
  FitResult fit;
  fit.rate_hz = 50.0;
  fit.spec = parse_model("GM+RW").value();
  fit.model = {{{ProcessKind::kGaussMarkov, 0.5, {0.02, 0}}, {ProcessKind::kRandomWalk, 1e-5, {}}}};
  const auto axis =
      nlohmann::json::parse(export_models({{"x", SignalUnit::kNone, fit}}, ExportFormat::kStateSpace).value())
          .at("axes")
          .at(0);
  const auto a = matrix_of(axis.at("continuous").at("A"));
  const auto qc = matrix_of(axis.at("continuous").at("Qc"));
  EXPECT_NEAR(matrix_of(axis.at("F"))(0, 0), std::exp(a(0, 0) / 50.0), 1e-15);
  EXPECT_NEAR(matrix_of(axis.at("Q"))(0, 0),
              qc(0, 0) * (1.0 - std::exp(2.0 * a(0, 0) / 50.0)) / (-2.0 * a(0, 0)), 1e-15);
  EXPECT_NEAR(matrix_of(axis.at("Q"))(1, 1), qc(1, 1) / 50.0, 1e-18);
}

TEST(Export, AFormThatHoldsLessGetsATermThatGrowsAlikeAndSaysSo) {
  std::mt19937_64 random(3);
  const auto first = fitted(signal(1.0, 0.5, 0.001, random), "WN+GM");
  const auto text = export_models({{"gyro_x", SignalUnit::kRadps, first}}, ExportFormat::kKalibr).value();
  EXPECT_THAT(text, HasSubstr("in place of GM1 a random walk that grows alike over 1 s to 100 s"));
  EXPECT_THAT(text, HasSubstr("accelerometer: not given"));
  EXPECT_THAT(text, testing::Not(HasSubstr("accelerometer_noise_density")));
  // White noise is the fit's own; the walk's growth over T the process' in the mean over ln T (trapezium,
  // fine).
  const double beta = first.parameters[1].value;
  const double variance = first.parameters[2].value;
  double sum = 0.0;
  constexpr int kPoints = 20'000;
  for (int i = 0; i < kPoints; ++i) {
    const double t = std::pow(100.0, (i + 0.5) / kPoints);
    sum += std::log(2.0 * variance * (1.0 - std::exp(-beta * t)) / t) / kPoints;
  }
  const Meaning m = meaning_of_kalibr(text);
  EXPECT_NEAR(m.white_density * kRateHz / first.parameters[0].value, 1.0, 1e-6);
  EXPECT_NEAR(m.walk_density / std::exp(sum), 1.0, 0.01);
}

/// Truths of a gyroscope at 100 Hz: white noise, a bias of a minute, a walk.
TEST(Export, WhiteNoiseBesideSlowTermsIsTheModelsOwn) {
  constexpr double kWhite = 0.05 * 0.05;
  std::mt19937_64 random(21);
  for (const double factor : {0.83, 1.0, 1.17}) {
    std::vector<double> x;
    for (int block = 0; block < 16; ++block) {
      const auto more = signal(factor * factor * kWhite, 0.0, 0.0, random);
      x.insert(x.end(), more.begin(), more.end());
    }
    std::normal_distribution<double> normal;
    double bias = 0.004 * normal(random);
    const double phi = std::exp(-1.0 / 6000.0);
    for (double& v : x) {
      v += bias;
      bias = phi * bias + 0.004 * std::sqrt(1.0 - phi * phi) * normal(random);
    }
    const auto fit = fitted(x, "WN+GM+RW", 100.0);
    for (const bool conservative : {false, true}) {
      const auto text = export_models({{"gyro_x", SignalUnit::kDegps, fit}}, ExportFormat::kKalibr,
                                      {.conservative = conservative, .force = true});
      const double density = numbers_of(text.value()).at("gyroscope_noise_density") / kRadPerDegree;
      EXPECT_NEAR(density / (factor * 0.05 / 10.0), 1.0, 0.02);
    }
  }
}

TEST(Export, WhatTheRecordOnlyBoundsIsWrittenAsThatBoundAndMarked) {
  std::mt19937_64 random(13);
  int below = 0;
  int bounds = 0;
  constexpr double kWalk = 1e-9;  // of a step; too weak for such a record in most series
  for (int trip = 0; trip < 40; ++trip) {
    const auto fit = fitted(signal(1.0, kWalk, 0.0, random), "WN+RW");
    const auto text =
        export_models({{"x", SignalUnit::kRadps, fit}}, ExportFormat::kKalibr, {.force = true}).value();
    if (text.find("an upper bound") == std::string::npos) continue;
    ++bounds;
    const double walk = numbers_of(text).at("gyroscope_random_walk");
    EXPECT_GT(walk, 0.0);
    below += walk * walk < kWalk * kRateHz ? 1 : 0;
  }
  EXPECT_GE(bounds, 10);
  EXPECT_LE(below, 5);  // 5 % promised; more than 5 of 40 has a chance of 1.4 %
}

TEST(Export, AModelThatMissesItsBandIsRefusedUnlessForced) {
  std::mt19937_64 random(14);
  auto fit = fitted(signal(1.0, 1e-4, 0.0, random), "WN+RW");
  const std::vector<AxisFit> good{{"gyro_x", SignalUnit::kRadps, fit}};
  ASSERT_TRUE(export_models(good, ExportFormat::kPx4));
  // tau of level 9 is 2.56 s: within the band; level 2 is not.
  auto outside = good;
  outside[0].fit.wv[1].fitted *= 5.0;
  EXPECT_TRUE(export_models(outside, ExportFormat::kPx4));
  auto wrong = good;
  wrong[0].fit.wv[8].fitted *= 5.0;
  const auto refused = export_models(wrong, ExportFormat::kPx4);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kWork);
  EXPECT_THAT(refused.error().text(), HasSubstr("tau = 2.56 s"));
  EXPECT_THAT(refused.error().text(), HasSubstr("--force"));
  EXPECT_THAT(export_models(wrong, ExportFormat::kPx4, {.force = true}).value(),
              HasSubstr("FORCED although gyro_x"));
}

// A slow sinusoid is none of the model's terms. It leaves next to nothing at the level of its period, where a
// wrong process in its place would leave no room for white noise.
TEST(Export, ABoundLiesAboveTheTruthWhereTheModelIsRejectedToo) {
  constexpr std::size_t kN = 1U << 17U;
  constexpr double kPeriods = 3.95;
  std::mt19937_64 random(16);
  std::normal_distribution<double> normal;
  for (int trip = 0; trip < 6; ++trip) {
    std::vector<double> x(kN);
    for (std::size_t i = 0; i < kN; ++i)
      x[i] = normal(random) + std::sin(2.0 * std::numbers::pi * kPeriods * static_cast<double>(i) / kN);
    const auto fit = fitted(x, "WN+GM");
    EXPECT_GT(fit.model_error, 0.0);
    const Felt white = felt_white_density(fit, {});
    EXPECT_EQ(white.knowledge, Knowledge::kBound);
    EXPECT_GE(white.upper, 1.0 / kRateHz);
  }
}

// G-28 and G-29: a time constant that crosses the band's first time moves what is white and what is slow
// without a step, half a second is white, and two seconds are not.
TEST(Export, WhatIsWhiteGoesOverIntoWhatIsSlowWithoutAStep) {
  constexpr FilterBand kBand{1.0, 100.0};
  FitResult fit;
  fit.rate_hz = kRateHz;
  fit.spec = parse_model("WN+GM").value();
  const auto at = [&](double tau_s) {
    fit.model.components = {{ProcessKind::kWhiteNoise, 1.0, {}},
                            {ProcessKind::kGaussMarkov, 0.01, {1.0 / (tau_s * kRateHz), 0.0}}};
    return std::pair{felt_white_density(fit, kBand).value * kRateHz, felt_walk_density(fit, kBand).value};
  };
  const auto whole = [](double tau_s) { return 0.01 / std::tanh(0.5 / (tau_s * kRateHz)); };
  EXPECT_NEAR(at(0.4).first, 1.0 + whole(0.4), 1e-9);
  EXPECT_EQ(at(0.4).second, 0.0);
  EXPECT_NEAR(at(1.0).first, 1.0 + 0.5 * whole(1.0), 1e-9);
  EXPECT_NEAR(at(2.1).first, 1.0, 1e-9);
  EXPECT_GT(at(2.1).second, 0.0);
  constexpr double kStep = 1.01;
  for (double tau_s = 0.45; tau_s < 2.2; tau_s *= kStep) {
    // The share falls by at most 3/2 of the step on the logarithm's scale of a factor of four.
    EXPECT_NEAR(at(tau_s * kStep).first, at(tau_s).first, 0.03 * whole(tau_s)) << tau_s;
  }
}

TEST(Export, ARandomWalkThatIsOnlyBoundedHasTheBoundOfItsFit) {
  std::mt19937_64 random(18);
  const auto x = signal(1.0, 0.0, 0.0, random);
  FitOptions options;
  options.intervals = Intervals::kInverted;
  const auto fit =
      imuscope::noise::fit(haar_wavelet_variance(x).value(), parse_model("WN+RW").value(), kRateHz, options)
          .value();
  const auto& walk = fit.parameters[1];
  ASSERT_FALSE(walk.ci_low);
  ASSERT_TRUE(walk.ci_high);
  const Felt felt = felt_walk_density(fit, {1.0, 100.0});
  EXPECT_EQ(felt.knowledge, Knowledge::kBound);
  EXPECT_NEAR(felt.value, *walk.ci_high * kRateHz, 1e-9 * felt.value);
  for (const Quantity& q : filter_quantities(fit, SignalUnit::kRadps)) {
    if (q.process != "RW" || q.name != "driving density") continue;
    EXPECT_NEAR(q.value, felt.value, 1e-9 * felt.value);
  }
}

TEST(Export, AModelThatStatesAnErrorOfTheLevelsOwnSizeIsRefused) {
  std::mt19937_64 random(17);
  auto fit = fitted(signal(1.0, 1e-4, 0.0, random), "WN+RW");
  fit.model_error = 0.9;
  EXPECT_TRUE(export_models({{"gyro_x", SignalUnit::kRadps, fit}}, ExportFormat::kKalibr));
  fit.model_error = 1.2;
  const auto refused = export_models({{"gyro_x", SignalUnit::kRadps, fit}}, ExportFormat::kKalibr);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("misses every level by 120 %"));
}

TEST(Export, AConservativeAmplitudeOfMoreThanTwiceTheFittedIsRefused) {
  std::mt19937_64 random(15);
  auto fit = fitted(signal(1.0, 1e-4, 0.0, random), "WN+RW");
  for (FittedLevel& level : fit.wv) level.observed.n_coefficients = 1 + level.observed.n_coefficients / 200;
  const auto refused =
      export_models({{"gyro_x", SignalUnit::kRadps, fit}}, ExportFormat::kKalibr, {.conservative = true});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("the conservative random walk is"));
}

TEST(Export, ASensorsOwnLowPassBecomesWhiteNoiseAndNotAFiltersBias) {
  // Noise of 0.3 samples' memory and a slow bias: what a filter needs is the density at low frequency, sigma2
  // times (1 + phi) / (1 - phi), and the slow bias.
  constexpr double kFast = 1.8;
  std::mt19937_64 random(8);
  auto x = signal(0.0, 1.0, kFast, random);
  const auto slow = signal(0.0, 0.02, 0.01, random);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += slow[i];
  const auto first = fitted(x, "WN+2*GM");
  const auto text = export_models({{"gyro_x", SignalUnit::kDegps, first}}, ExportFormat::kKfGins).value();
  const Meaning m = meaning_of_kf_gins(text);
  const double phi = std::exp(-kFast);
  const double si = kRadPerDegree * kRadPerDegree;
  EXPECT_NEAR(m.white_density * kRateHz / si, (1.0 + phi) / (1.0 - phi), 0.1);
  EXPECT_NEAR(m.bias_variance / si, 0.02, 0.012);
  EXPECT_GT(m.correlation_time_s, 0.1);
}

TEST(Export, ThreeAxesOfATriadBecomeTheMeanOfTheirVariances) {
  std::mt19937_64 random(4);
  std::vector<AxisFit> axes;
  for (const double white : {0.5, 1.0, 1.5}) {
    axes.push_back({"gyro", SignalUnit::kRadps, fitted(signal(white, 1e-4, 0.0, random), "WN+RW")});
  }
  const auto n = numbers_of(export_models(axes, ExportFormat::kKalibr).value());
  EXPECT_NEAR(std::pow(n.at("gyroscope_noise_density"), 2) * kRateHz, 1.0, 0.03);
}

TEST(Export, ConservativeParametersAreLargerThanTheFit) {
  std::mt19937_64 random(5);
  const auto first = fitted(signal(1.0, 1e-4, 0.0, random), "WN+RW");
  for (const auto format : {ExportFormat::kKalibr, ExportFormat::kPx4}) {
    const auto plain = numbers_of(export_models({{"x", SignalUnit::kRadps, first}}, format).value());
    const auto bound =
        numbers_of(export_models({{"x", SignalUnit::kRadps, first}}, format, {.conservative = true}).value());
    for (const char* key :
         {"gyroscope_noise_density", "gyroscope_random_walk", "EKF2_GYR_NOISE", "EKF2_GYR_B_NOISE"}) {
      if (!plain.contains(key)) continue;
      EXPECT_GT(bound.at(key), plain.at(key)) << key;
    }
  }
}

TEST(Export, WithoutAUnitOnlyTheMatricesCanBeWritten) {
  std::mt19937_64 random(6);
  const auto first = fitted(signal(1.0, 1e-4, 0.0, random), "WN+RW");
  const auto refused = export_models({{"x", SignalUnit::kNone, first}}, ExportFormat::kRos);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(refused.error().text(), HasSubstr("--unit"));
  EXPECT_FALSE(parse_export_format("matlab"));
}

}  // namespace
}  // namespace imuscope::noise
