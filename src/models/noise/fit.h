#pragma once

/// Generalized method of wavelet moments: the parameters of a composite model from a wavelet variance, by the
/// global minimum of (wv - model)' Omega (wv - model). Deterministic: amplitudes by non-negative least
/// squares, rates by a grid and a polish; no random starts. An amplitude at zero is exactly zero and is said
/// to be unsupported.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

class CovarianceTables;

enum class Weighting : std::uint8_t {
  kOptimal,  ///< inverse of the wavelet variance's covariance under the model itself, iterated
  kCi,       ///< 1 / (interval width)^2, diagonal: what the reference packages use
};

struct FitResult;

/// How the intervals of the parameters are made.
enum class Intervals : std::uint8_t {
  kQuick,     ///< from the estimate's own covariance; none for a process of less than 20 correlation times
  kInverted,  ///< by inversion of a test where that covariance is not small (inverted_intervals.h); optimal
              ///< weights
};

/// How a model is fitted: weights, levels, and the confidence of what is said of it.
struct FitOptions {
  Weighting weighting = Weighting::kOptimal;
  Intervals intervals = Intervals::kQuick;
  int levels = 0;  ///< use only the first so many levels; 0: all
  double confidence = 0.95;
  std::string signal_unit{};  ///< as printed with the parameters: "rad/s", "m/s^2", "deg/s"
  /// Covariances of many models are taken from tables here, which fits of records of one length share;
  /// nothing: each is computed by itself.
  CovarianceTables* covariances = nullptr;
  const FitResult* warm_start = nullptr;  ///< an earlier fit of the same model: polish from it, no grid
};

/// Observed and fitted wavelet variance of one level, signal unit squared.
struct FittedLevel {
  WvLevel observed;
  double fitted = 0.0;
  double model_ci_low = 0.0;  ///< interval of the observed value from the fitted model's own covariance
  double model_ci_high = 0.0;
};

/// One parameter in the terms of the reference literature at the given rate: WN sigma2; GM beta (1/s) and
/// sigma2 (variance of the process); RW gamma2 (per sample); QN q2; DR omega (per sample); MA1 theta, sigma2;
/// ARMA11 phi, theta, sigma2; SIN alpha, frequency (Hz).
struct ParameterEstimate {
  std::string process;  ///< "WN", "GM1" (GM in order of falling beta), ...
  std::string name;     ///< "sigma2", "beta", ...
  std::string unit;
  double value = 0.0;
  std::optional<double> sd;  ///< absent where the parameter is not identifiable
  std::optional<double>
      ci_low;  ///< interval on the logarithmic scale (amplitudes, rates); an end that the data
  std::optional<double> ci_high;  ///< do not tell is absent: with ci_high alone it is known to be below that
  std::optional<double> log_sd;   ///< sd on the scale the interval was made on
  /// What sd and interval hold of the spread between parts or replicates (replicates.h), as an sd on the
  /// scale of `covariance`.
  double spread_sd = 0.0;
};

/// Test that the model explains the wavelet variance, on the levels with enough coefficients
/// (wavelet_variance.h).
struct JTest {
  double statistic = 0.0;
  int dof = 0;
  double p_value = 0.0;
};

/// A fitted model and all that is said of it, the observed wavelet variance included: a value that refers to
/// nothing else.
struct FitResult {
  std::uint64_t n = 0;        ///< samples used
  std::size_t stretches = 0;  ///< runs of neighbouring samples that they make; 0 where not known
  double rate_hz = 0.0;
  ModelSpec spec;
  Weighting weighting = Weighting::kOptimal;
  double confidence = 0.95;  ///< of the intervals
  Intervals intervals = Intervals::kQuick;
  double efficiency = 1.0;  ///< of the wavelet variance's estimator; 1 = classical
  std::vector<FittedLevel> wv;
  std::vector<ParameterEstimate> parameters;
  Model model;  ///< the estimate in sample terms
  /// Covariance of the parameters on their interval scale (log for amplitudes and rates), row-major, in the
  /// order of `parameters`; NaN rows where not identifiable.
  std::vector<double> covariance;
  double objective = 0.0;
  /// Where the J-test rejects the model outright (p < 0.001, optimal weights): the share by which the model
  /// misses the levels, part of the weights and of the intervals. 0 elsewhere.
  double model_error = 0.0;
  std::optional<JTest> j_test;  ///< absent with fewer levels than parameters + 1
  /// For the ranking of models of the same signal, smaller is better: -2 log likelihood of the wavelet
  /// variance under the model plus ln(levels) for each parameter.
  double criterion = 0.0;
  bool identifiable = true;
  std::string simpler_model;  ///< where not identifiable: the model to use instead
  std::vector<std::string> warnings;
};

/// The wavelet variance that was fitted, without its segments.
WaveletVariance observed_wv(const FitResult& fit);

/// Errors: rate not positive (kUsage); fewer levels than parameters, constant signal (kWork).
Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options = {});

}  // namespace imuscope::noise
