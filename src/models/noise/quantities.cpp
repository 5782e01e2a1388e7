#include "models/noise/quantities.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "base/units.h"
#include "models/noise/inference.h"
#include "models/noise/parameter_scale.h"

namespace imuscope::noise {
namespace {

constexpr std::array<std::pair<SignalUnit, std::string_view>, 5> kUnits{{{SignalUnit::kNone, ""},
                                                                         {SignalUnit::kRadps, "rad/s"},
                                                                         {SignalUnit::kDegps, "deg/s"},
                                                                         {SignalUnit::kMps2, "m/s^2"},
                                                                         {SignalUnit::kG, "g"}}};
/// sqrt(2 ln 2 / pi): Allan deviation of flicker noise of unit bias instability (IEEE 952, annex C).
constexpr double kFlickerAllanDeviation = 0.664;
const double kSqrtSecondsPerHour = std::sqrt(kSecondsPerHour);

/// Factor to the data sheet's own unit: degrees, or metres per second squared.
double sheet_factor(SignalUnit unit) { return si_factor(unit) * (is_gyro(unit) ? kDegPerRad : 1.0); }

class Builder {
 public:
  /// @param over_bounding  amplitudes are bounds as they stand
  Builder(const FitResult& fit, SignalUnit unit, bool over_bounding)
      : fit_(fit), unit_(unit), over_bounding_(over_bounding), u_(unit_name(unit)) {
    if (u_.empty()) u_ = "unit";
  }

  std::vector<Quantity> build() {
    for (const ParameterEstimate& p : fit_.parameters) add_parameter(p);
    add_white_noise_of_all();
    add_bias_instability();
    return std::move(out_);
  }

 private:
  /// value = factor * parameter^power
  void add(const ParameterEstimate& p, std::string name, std::string unit, double factor, double power) {
    const auto map = [&](double v) { return factor * std::pow(v, power); };
    Quantity q{p.process, std::move(name), std::move(unit), map(p.value), std::nullopt, std::nullopt};
    if (over_bounding_) {
      if (p.name != "beta") make_bound(q);
    } else if (p.ci_low && p.ci_high) {
      q.ci_low = std::min(map(*p.ci_low), map(*p.ci_high));
      q.ci_high = std::max(map(*p.ci_low), map(*p.ci_high));
    } else if (const Felt most = amplitude_of(p); most.knowledge == Knowledge::kBound) {
      q.value =
          map(parameter_scale_of(p.name) == ParameterScale::kLogSquare ? std::sqrt(most.value) : most.value);
      make_bound(q);
    } else {
      q.knowledge = Knowledge::kUnknown;
    }
    out_.push_back(std::move(q));
  }

  static void make_bound(Quantity& q) {
    q.ci_low.reset();
    q.ci_high = q.value;
    q.knowledge = Knowledge::kBound;
  }

  /// What the data tell of a parameter that is an amplitude of its own.
  [[nodiscard]] Felt amplitude_of(const ParameterEstimate& p) const {
    const auto places = parameter_places(fit_.model);
    const auto at = static_cast<std::size_t>(&p - fit_.parameters.data());
    if (at >= places.size() || places[at].shape >= 0) return {};
    // The amplitude of a Gauss-Markov process means nothing without its rate.
    const Component& c = fit_.model.components[places[at].component];
    return c.kind == ProcessKind::kGaussMarkov ? Felt{} : felt_amplitude(fit_, places[at].component);
  }

  // G-25
  void add_parameter(const ParameterEstimate& p) {
    const double f = fit_.rate_hz;
    if (p.process == "WN") {
      add(p, "density", fmt::format("({})^2/Hz", u_), 1.0 / f, 1.0);
      add(p, "density root", fmt::format("{}/sqrt(Hz)", u_), 1.0 / std::sqrt(f), 0.5);
    } else if (p.process == "RW") {
      add(p, "driving density", fmt::format("({})^2 Hz", u_), f, 1.0);
      if (unit_ == SignalUnit::kNone) return;
      const double sheet = sheet_factor(unit_) * kSqrtSecondsPerHour * std::sqrt(f);
      add(p, is_gyro(unit_) ? "rate random walk" : "acceleration random walk",
          is_gyro(unit_) ? "deg/s/sqrt(h)" : "m/s^2/sqrt(h)", sheet, 0.5);
    } else if (p.process == "QN") {
      add(p, "quantization", fmt::format("{} s", u_), 1.0 / f, 0.5);
    } else if (p.process == "DR") {
      add(p, "ramp", fmt::format("{}/s", u_), f, 1.0);
    } else if (p.process.starts_with("GM")) {
      add_gauss_markov(p);
    }
  }

  void add_gauss_markov(const ParameterEstimate& p) {
    if (p.name == "beta") {
      add(p, "correlation time", "s", 1.0, -1.0);
      beta_ = p.value;
      return;
    }
    add(p, "sd", u_, 1.0, 0.5);
    // beta stands directly before its sigma2; the logarithm of the density is the sum of theirs.
    const auto at = static_cast<Eigen::Index>(&p - fit_.parameters.data());
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit_.parameters.size()));
    gradient[at] = 1.0;
    if (at > 0) gradient[at - 1] = 1.0;
    Quantity q{p.process, "driving density", fmt::format("({})^2 Hz", u_), 2.0 * beta_ * p.value, {}, {}};
    set_interval(q, gradient);
    if (over_bounding_)
      make_bound(q);
    else if (!q.ci_low)
      q.knowledge = Knowledge::kUnknown;
    out_.push_back(std::move(q));
  }

  /// Interval of a quantity whose logarithm has this gradient over the parameters' interval scales.
  void set_interval(Quantity& q, const Eigen::VectorXd& gradient) const {
    const auto n = gradient.size();
    if (static_cast<Eigen::Index>(fit_.covariance.size()) != n * n) return;
    const Eigen::Map<const Eigen::MatrixXd> all(fit_.covariance.data(), n, n);
    double variance = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index k = 0; k < n; ++k) {
        if (gradient[i] != 0.0 && gradient[k] != 0.0) variance += gradient[i] * gradient[k] * all(i, k);
      }
    }
    if (!(variance > 0.0)) return;  // NaN where a parameter is not determined
    const double half_width =
        boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + fit_.confidence)) * std::sqrt(variance);
    q.ci_low = q.value * std::exp(-half_width);
    q.ci_high = q.value * std::exp(half_width);
  }

  void add_white_noise_of_all() {
    if (unit_ == SignalUnit::kNone || fit_.model.components.empty()) return;
    const double over_bounding = white_density(fit_.model, fit_.rate_hz, {});
    const Felt white = over_bounding_ ? Felt{over_bounding, over_bounding, 0.0, Knowledge::kBound}
                                      : felt_white_density(fit_, {});
    const double sheet = sheet_factor(unit_) * kSqrtSecondsPerHour;
    const bool gyro = is_gyro(unit_);
    Quantity q{"model",
               gyro ? "angle random walk" : "velocity random walk",
               gyro ? "deg/sqrt(h)" : "m/s/sqrt(h)",
               sheet * std::sqrt(white.value),
               {},
               {},
               white.knowledge};
    if (white.knowledge == Knowledge::kFitted) q.ci_low = sheet * std::sqrt(white.lower);
    if (white.knowledge != Knowledge::kUnknown) q.ci_high = sheet * std::sqrt(white.upper);
    out_.push_back(std::move(q));
  }

  void add_bias_instability() {
    if (unit_ == SignalUnit::kNone || fit_.wv.empty()) return;
    const auto smallest =
        std::min_element(fit_.wv.begin(), fit_.wv.end(),
                         [](const FittedLevel& a, const FittedLevel& b) { return a.fitted < b.fitted; });
    // The Allan variance is twice the wavelet variance.
    const double deviation = std::sqrt(2.0 * smallest->fitted) / kFlickerAllanDeviation * sheet_factor(unit_);
    const double per_hour = is_gyro(unit_) ? kSecondsPerHour : 1.0 / kMps2PerMicroG;
    Quantity q{"model", "bias instability", is_gyro(unit_) ? "deg/h" : "micro-g", deviation * per_hour, {},
               {}};
    const auto places = parameter_places(fit_.model);
    if (places.size() == fit_.parameters.size() && smallest->fitted > 0.0) {
      const Eigen::MatrixXd slope = wv_jacobian(fit_.model, {smallest->observed.level}, places);
      set_interval(q, slope.row(0).transpose() / (2.0 * smallest->fitted));
    }
    // Beyond the last level it may fall further.
    if (over_bounding_ || smallest + 1 == fit_.wv.end()) {
      q.value = q.ci_high.value_or(q.value);
      make_bound(q);
    }
    out_.push_back(std::move(q));
  }

  const FitResult& fit_;
  SignalUnit unit_;
  bool over_bounding_;
  std::string u_;
  double beta_ = 0.0;
  std::vector<Quantity> out_;
};

}  // namespace

bool is_gyro(SignalUnit unit) noexcept { return unit == SignalUnit::kRadps || unit == SignalUnit::kDegps; }

double si_factor(SignalUnit unit) noexcept {
  if (unit == SignalUnit::kDegps) return kRadPerDeg;
  return unit == SignalUnit::kG ? kMps2PerG : 1.0;
}

Result<SignalUnit> parse_unit(std::string_view text) {
  for (const auto& [unit, name] : kUnits) {
    if (name == text) return unit;
  }
  return usage_error(fmt::format("the unit '{}' is not known", text), "give rad/s, deg/s, m/s^2 or g");
}

std::string_view unit_name(SignalUnit unit) noexcept {
  for (const auto& [kind, name] : kUnits) {
    if (kind == unit) return name;
  }
  return "";
}

std::vector<Quantity> filter_quantities(const FitResult& fit, SignalUnit unit) {
  return Builder(fit, unit, false).build();
}

std::vector<Quantity> over_bounding_quantities(const FitResult& bound, SignalUnit unit) {
  return Builder(bound, unit, true).build();
}

}  // namespace imuscope::noise
