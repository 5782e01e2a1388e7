#pragma once

/// Noise parameters as functions of drivers (rate, vibration, speed ...): over many short windows,
///
///   log theta_p(w) = log theta_p + sum over drivers k of slope_pk (x_kw - mean x_k),
///
/// for amplitudes and rates alike, fitted to the wavelet variances of all windows at once (G-24 in
/// EQUATIONS.md). With several drivers each slope is what follows that driver while the others stay. What
/// windows of that length do not determine is held at the start model and said. A window
/// that lies far from all others (a blow, a fault) makes no dependence of its own: it pulls no harder than
/// one at the edge of the others.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// One window: its wavelet variance, and the drivers there.
struct DrivenWindow {
  WaveletVariance wv;
  std::vector<double> drivers;
};

/// Confidence of the intervals, and the signal's unit as printed with the parameters.
struct DependenceOptions {
  double confidence = 0.95;
  std::string signal_unit{};
};

/// How one parameter of the model follows a driver; exp(slope) is its factor per unit of the driver.
struct ParameterSlope {
  std::size_t driver = 0;  ///< index in DrivenWindow::drivers
  std::string process;     ///< as in FitResult: "WN", "GM1", ...
  std::string name;        ///< "sigma2", "beta", ...
  std::string unit;
  double at_mean_driver = 0.0;  ///< value where the drivers have their means
  double slope = 0.0;           ///< of the logarithm, per unit of the driver
  double sd = 0.0;
  double ci_low = 0.0;
  double ci_high = 0.0;
  double p_value = 1.0;  ///< of no dependence
};

/// A parameter that windows of this length do not determine, or its change with a driver, and why, in words.
struct UndeterminedSlope {
  std::size_t driver = 0;
  std::string process;
  std::string name;
  std::string why;
};

struct Dependence {
  std::size_t n_windows = 0;
  std::size_t n_far = 0;  ///< of them, so far from the fit that they count less than half
  std::vector<double> mean_drivers;
  std::vector<ParameterSlope> slopes;
  std::vector<UndeterminedSlope> undetermined;
  Model at_mean_driver;
};

/// For each driver.
inline constexpr std::size_t kFewestWindows = 12;

/// @param windows  all of one length, so that one covariance serves them, and with the same drivers
/// @param start    a fit of the same signal: which processes, and where the search begins
/// Errors (kWork): fewer than kFewestWindows windows a driver; a driver that is no number or does not vary;
/// no level with enough coefficients; a search that does not settle.
Result<Dependence> fit_dependence(std::span<const DrivenWindow> windows, const FitResult& start,
                                  const DependenceOptions& options = {});

/// The white-noise variance of one window, everything else as in `model`; absent where the rest of the model
/// explains more than the window shows. For pictures.
struct WindowWhiteNoise {
  double value = 0.0;
  double ci_low = 0.0;
  double ci_high = 0.0;
};
std::optional<WindowWhiteNoise> white_noise_of(const WaveletVariance& window, const Model& model,
                                               double confidence);

}  // namespace imuscope::noise
