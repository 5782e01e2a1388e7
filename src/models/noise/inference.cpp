#include "models/noise/inference.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "models/noise/chi_squared.h"
#include "models/noise/parameter_scale.h"
#include "models/noise/separable_fit.h"

namespace imuscope::noise {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
/// A parameter whose log has a larger sd (factor 20 either way at 95 %) is not determined by the data.
constexpr double kUndeterminedLogSd = 1.5;
/// Rates of two GM closer than this are one.
constexpr double kSameRate = 1.05;
/// phi below 0.01: white to within a percent.
constexpr double kWhiteRate = 4.6;

std::string simpler_name(const ModelSpec& spec, const std::vector<ProcessKind>& without,
                         std::optional<ProcessKind> with = std::nullopt) {
  ModelSpec simpler = spec;
  for (const ProcessKind kind : without) {
    const auto at = std::find(simpler.processes.begin(), simpler.processes.end(), kind);
    if (at != simpler.processes.end()) simpler.processes.erase(at);
  }
  if (with && simpler.count(*with) == 0) simpler.processes.push_back(*with);
  return simpler.name();
}

/// How one parameter is printed: value and units from the sample terms, and the derivative that carries its
/// interval.
struct Presentation {
  std::string name;
  std::string unit;
  double value;
  double slope;  ///< d(value)/d(interval scale)
};

std::string squared(const std::string& unit) { return unit.empty() ? "" : fmt::format("({})^2", unit); }

Presentation present(const Component& c, int shape, double rate_hz, const std::string& unit) {
  if (shape < 0) {
    const double root = std::sqrt(c.amplitude);
    switch (c.kind) {
      case ProcessKind::kRamp:
        return {"omega", unit.empty() ? unit : unit + "/sample", root, 0.5 * root};
      case ProcessKind::kSinusoid:
        return {"alpha", unit, root, 0.5 * root};
      case ProcessKind::kFlicker:
        return {"B", unit, root, 0.5 * root};
      case ProcessKind::kQuantization:
        return {"q2", squared(unit), c.amplitude, c.amplitude};
      case ProcessKind::kRandomWalk:
        return {"gamma2", squared(unit), c.amplitude, c.amplitude};
      default:
        return {"sigma2", squared(unit), c.amplitude, c.amplitude};
    }
  }
  const double s = c.shape[static_cast<std::size_t>(shape)];
  const double frequency_hz = s * rate_hz / (2.0 * std::numbers::pi);
  switch (c.kind) {
    case ProcessKind::kGaussMarkov:
      return {"beta", "1/s", s * rate_hz, s * rate_hz};
    case ProcessKind::kSinusoid:
      return {"frequency", "Hz", frequency_hz, frequency_hz};
    case ProcessKind::kResonance:
      if (shape == 0) return {"damping", "1/s", s * rate_hz, s * rate_hz};
      return {"frequency", "Hz", frequency_hz, frequency_hz};
    case ProcessKind::kPowerLaw:
      return {"exponent", "1", s, 1.0 - (s - 1.0) * (s - 1.0)};
    case ProcessKind::kArma11:
      return {shape == 0 ? "phi" : "theta", "1", s, 1.0 - s * s};
    default:
      return {"theta", "1", s, 1.0 - s * s};
  }
}

// G-13: intervals on the parameter's own scale
void set_interval(ParameterEstimate& p, const Presentation& shown, double sd, double z) {
  const ParameterScale scale = parameter_scale_of(shown.name);
  p.sd = std::abs(shown.slope) * sd;
  p.log_sd = scale == ParameterScale::kLogSquare ? 0.5 * sd : sd;
  const double centre = to_scale(scale, shown.value);
  p.ci_low = from_scale(scale, centre - z * sd);
  p.ci_high = from_scale(scale, centre + z * sd);
}

class Verdict {
 public:
  explicit Verdict(FitResult& result) : result_(result), names_(component_names(result.model)) {}

  void not_identifiable(std::string reason, std::string simpler) {
    result_.identifiable = false;
    result_.warnings.push_back(std::move(reason));
    if (result_.simpler_model.empty()) result_.simpler_model = std::move(simpler);
  }

  void unsupported_terms() {
    std::vector<ProcessKind> without;
    std::string list;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (result_.model.components[i].amplitude > 0.0) continue;
      without.push_back(result_.model.components[i].kind);
      list += (list.empty() ? "" : ", ") + names_[i];
    }
    if (without.empty()) return;
    const std::string simpler = simpler_name(result_.spec, without);
    not_identifiable(
        fmt::format("{}: amplitude exactly zero, not supported by the data; the simpler model is {}", list,
                    simpler.empty() ? "none" : simpler),
        simpler);
  }

  void rates(int highest_level) {
    const auto& components = result_.model.components;
    for (std::size_t i = 0; i < components.size(); ++i) {
      const Component& c = components[i];
      if (c.amplitude <= 0.0 || c.kind != ProcessKind::kGaussMarkov) continue;
      const CoordinateRange range = coordinate_range(c.kind, 0, highest_level);
      if (c.shape[0] <= std::exp(range.low) * 1.001) {
        undetermined_[i] = true;
        const std::string simpler = simpler_name(result_.spec, {c.kind}, ProcessKind::kRandomWalk);
        not_identifiable(
            fmt::format("{}: its rate is at the slow end of what {} levels can show, where it is a random "
                        "walk; the simpler model is {}",
                        names_[i], highest_level, simpler),
            simpler);
      } else if (c.shape[0] * static_cast<double>(result_.n) < kFewestCorrelationTimes) {
        undetermined_[i] = true;
        const std::string simpler = simpler_name(result_.spec, {c.kind}, ProcessKind::kRandomWalk);
        not_identifiable(fmt::format("{}: the signal lasts {:.2g} of its correlation times, and rate and "
                                     "variance can be told apart from about {:.0f} on; "
                                     "the simpler model is {}",
                                     names_[i], c.shape[0] * static_cast<double>(result_.n),
                                     kFewestCorrelationTimes, simpler),
                         simpler);
      } else if (c.shape[0] >= kWhiteRate) {
        undetermined_[i] = true;
        const std::string simpler = simpler_name(result_.spec, {c.kind}, ProcessKind::kWhiteNoise);
        not_identifiable(fmt::format("{}: its correlation time is below a quarter of a sample, it is white "
                                     "noise; the simpler model is {}",
                                     names_[i], simpler),
                         simpler);
      }
      if (i > 0 && components[i - 1].kind == c.kind && components[i - 1].amplitude > 0.0 &&
          components[i - 1].shape[0] < kSameRate * c.shape[0]) {
        undetermined_[i] = true;
        undetermined_[i - 1] = true;
        const std::string simpler = simpler_name(result_.spec, {c.kind});
        not_identifiable(fmt::format("{} and {} have one rate: they are one process; the simpler model is {}",
                                     names_[i - 1], names_[i], simpler),
                         simpler);
      }
    }
  }

  /// The curvature says so: a parameter without a usable sd, in a component nothing was said of yet.
  void curvature(std::size_t component) {
    if (undetermined_[component] || told_[component]) return;
    told_[component] = true;
    const ProcessKind kind = result_.model.components[component].kind;
    const std::string simpler = simpler_name(result_.spec, {kind});
    not_identifiable(
        fmt::format("{}: the data do not determine it (its logarithm has an sd above {}, or another term "
                    "can take its place); the simpler model is {}",
                    names_[component], kUndeterminedLogSd, simpler.empty() ? "none" : simpler),
        simpler);
  }

  [[nodiscard]] bool undetermined(std::size_t component) const { return undetermined_[component]; }
  [[nodiscard]] const std::string& name(std::size_t component) const { return names_[component]; }

 private:
  FitResult& result_;
  std::vector<std::string> names_;
  std::vector<bool> undetermined_ = std::vector<bool>(names_.size(), false);
  std::vector<bool> told_ = std::vector<bool>(names_.size(), false);
};

std::vector<Eigen::Index> indices_of(const std::vector<bool>& present) {
  std::vector<Eigen::Index> out;
  for (std::size_t i = 0; i < present.size(); ++i) {
    if (present[i]) out.push_back(static_cast<Eigen::Index>(i));
  }
  return out;
}

/// One process of amplitude 1 at some levels: many in one go, which costs a few of them.
class UnitPoints {
 public:
  UnitPoints(const Component& c, const std::vector<int>& levels) {
    if (levels.size() == 1) {
      points_[index(levels[0])] = unit_wv(c.kind, c.shape, levels[0]);
    } else if (!levels.empty()) {
      const int highest = *std::max_element(levels.begin(), levels.end());
      unit_curve(c.kind, c.shape, std::span(points_).first(static_cast<std::size_t>(highest)));
    }
  }

  [[nodiscard]] const CurvePoint& at(int level) const { return points_[index(level)]; }

 private:
  static std::size_t index(int level) { return static_cast<std::size_t>(level) - 1; }

  std::array<CurvePoint, kMaxLevel> points_;
};

}  // namespace

std::vector<ParameterPlace> parameter_places(const Model& model) {
  std::vector<ParameterPlace> places;
  for (std::size_t i = 0; i < model.components.size(); ++i) {
    for (int s = 0; s < shape_count(model.components[i].kind); ++s) places.push_back({i, s});
    places.push_back({i, -1});
  }
  return places;
}

Eigen::VectorXd wv_curve(const Model& model, const std::vector<int>& levels) {
  Eigen::VectorXd curve = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(levels.size()));
  for (const Component& c : model.components) {
    if (!(c.amplitude > 0.0)) continue;
    const UnitPoints points(c, levels);
    for (std::size_t r = 0; r < levels.size(); ++r)
      curve[static_cast<Eigen::Index>(r)] += c.amplitude * points.at(levels[r]).value;
  }
  return curve;
}

Eigen::MatrixXd wv_jacobian(const Model& model, const std::vector<int>& levels,
                            const std::vector<ParameterPlace>& places) {
  Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(levels.size()),
                           static_cast<Eigen::Index>(places.size()));
  for (std::size_t p = 0; p < places.size(); ++p) {
    const Component& c = model.components[places[p].component];
    const UnitPoints points(c, levels);
    for (std::size_t r = 0; r < levels.size(); ++r) {
      const CurvePoint& point = points.at(levels[r]);
      double slope = point.value;
      if (places[p].shape >= 0) {
        const double shape = c.shape[static_cast<std::size_t>(places[p].shape)];
        slope = point.derivative[static_cast<std::size_t>(places[p].shape)] *
                shape_slope(c.kind, coordinate_of_shape(c.kind, shape));
      }
      jacobian(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(p)) = c.amplitude * slope;
    }
  }
  return jacobian;
}

// G-13
ParameterCovariance parameter_covariance(const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& v,
                                         const Eigen::MatrixXd& omega, const std::vector<bool>& present) {
  const auto n = static_cast<Eigen::Index>(present.size());
  ParameterCovariance out;
  out.covariance = Eigen::MatrixXd::Constant(n, n, kNan);
  out.determined.assign(present.size(), false);
  const auto index = indices_of(present);
  if (index.empty()) return out;
  const Eigen::MatrixXd d = jacobian(Eigen::all, index);
  const Eigen::MatrixXd information = d.transpose() * omega * d;
  // Scaled to unit diagonal, so that an eigenvalue tells how well a direction is determined relative to its
  // parts.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  constexpr double kSingularShare = 1e-12;
  const Eigen::VectorXd& values = eigen.eigenvalues();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(values.size(), values.size());
  std::vector<bool> in_null_space(index.size(), false);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Eigen::VectorXd direction = eigen.eigenvectors().col(i);
    if (values[i] > kSingularShare) {
      inverse += direction * direction.transpose() / values[i];
      continue;
    }
    for (Eigen::Index k = 0; k < direction.size(); ++k) {
      if (std::abs(direction[k]) > 1e-3) in_null_space[static_cast<std::size_t>(k)] = true;
    }
  }
  inverse = (scale.asDiagonal() * inverse * scale.asDiagonal()).eval();
  const Eigen::MatrixXd gain = inverse * d.transpose() * omega;
  const Eigen::MatrixXd covariance = gain * v * gain.transpose();
  for (std::size_t i = 0; i < index.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double variance = covariance(k, k);
    const bool good = !in_null_space[i] && std::isfinite(variance) && variance > 0.0 &&
                      std::sqrt(variance) < kUndeterminedLogSd;
    out.determined[static_cast<std::size_t>(index[i])] = good;
  }
  for (std::size_t i = 0; i < index.size(); ++i) {
    for (std::size_t k = 0; k < index.size(); ++k) {
      if (!out.determined[static_cast<std::size_t>(index[i])] ||
          !out.determined[static_cast<std::size_t>(index[k])])
        continue;
      out.covariance(index[i], index[k]) =
          covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
    }
  }
  return out;
}

// G-14
std::optional<JTest> j_test(const WaveletVariance& wv, const Eigen::VectorXd& residual,
                            const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& v,
                            const std::vector<bool>& present, bool by_these_weights) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    if (has_enough_coefficients(wv.levels[static_cast<std::size_t>(i)], wv.efficiency)) rows.push_back(i);
  }
  const auto columns = indices_of(present);
  if (rows.empty() || columns.empty()) return std::nullopt;
  const Eigen::MatrixXd part = v(rows, rows);
  const Eigen::LLT<Eigen::MatrixXd> llt(part);
  if (llt.info() != Eigen::Success) return std::nullopt;
  Eigen::MatrixXd d = llt.matrixL().solve(Eigen::MatrixXd(jacobian(rows, columns)));
  const Eigen::VectorXd r = llt.matrixL().solve(Eigen::VectorXd(residual(rows)));
  for (Eigen::Index c = 0; c < d.cols(); ++c) {
    const double norm = d.col(c).norm();
    if (norm > 0.0) d.col(c) /= norm;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(d);
  constexpr double kRank = 1e-6;
  qr.setThreshold(kRank);
  const Eigen::VectorXd rotated = qr.householderQ().adjoint() * r;
  JTest test;
  test.dof = static_cast<int>(rotated.size() - qr.rank());
  if (test.dof < 1) return std::nullopt;
  test.statistic = rotated.tail(test.dof).squaredNorm();
  if (by_these_weights) {
    // A curve far above all data leaves a residual that is minus itself, which a factor would follow.
    constexpr double kNeverByChance = 1e-6;
    const auto rank = static_cast<double>(qr.rank());
    const double followed = rotated.head(qr.rank()).squaredNorm();
    test.statistic += std::max(0.0, followed - chi_squared_quantile(rank, 1.0 - kNeverByChance));
  }
  test.p_value = chi_squared_p_value(test.statistic, test.dof);
  return test;
}

// G-18: a level's residual
double near_gaussian_residual(double value, double expected, double variance) {
  const double dof = 2.0 * expected * expected / variance;
  return 3.0 * expected * (std::cbrt(value / expected) - 1.0 + 2.0 / (9.0 * dof));
}

void report_parameters(FitResult& result, const ParameterCovariance& covariance, const FitOptions& options,
                       int highest_level) {
  const auto places = parameter_places(result.model);
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + options.confidence));
  Verdict verdict(result);
  verdict.unsupported_terms();
  verdict.rates(highest_level);
  result.covariance.assign(places.size() * places.size(), kNan);
  std::vector<bool> has_interval(places.size(), false);
  for (std::size_t p = 0; p < places.size(); ++p) {
    const std::size_t component = places[p].component;
    const Component& c = result.model.components[component];
    const Presentation shown = present(c, places[p].shape, result.rate_hz, options.signal_unit);
    ParameterEstimate estimate;
    estimate.process = verdict.name(component);
    estimate.name = shown.name;
    estimate.unit = shown.unit;
    estimate.value = shown.value;
    if (c.amplitude > 0.0 && !verdict.undetermined(component)) {
      if (covariance.determined[p]) {
        const auto k = static_cast<Eigen::Index>(p);
        set_interval(estimate, shown, std::sqrt(covariance.covariance(k, k)), z);
        has_interval[p] = true;
      } else {
        verdict.curvature(component);
      }
    }
    result.parameters.push_back(estimate);
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (std::size_t k = 0; k < places.size(); ++k) {
      if (!has_interval[i] || !has_interval[k]) continue;
      result.covariance[i * places.size() + k] =
          covariance.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
    }
  }
}

}  // namespace imuscope::noise
