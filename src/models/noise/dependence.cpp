#include "models/noise/dependence.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "base/contracts.h"
#include "models/noise/inference.h"
#include "models/noise/parameter_scale.h"
#include "models/noise/separable_fit.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A level or rate whose logarithm would have a larger sd is held at the start model; a slope is left out
/// where the change that it makes over one sd of the driver is known no better.
constexpr double kUndeterminedSd = 0.4;
constexpr int kMaxSteps = 60;
constexpr double kLongestStep = 0.7;  // of a logarithm
/// Squared distance to the solution in standard deviations: settled, and near enough where steps no longer
/// help.
constexpr double kSettled = 1e-10;
constexpr double kNearlySettled = 1e-4;
/// A window farther from the fit than this quantile of the others' distances pulls no harder than one that
/// lies there. So few are held back without need that it costs nothing.
constexpr double kFarQuantile = 0.99;
/// Weights and fit make each other: again until no weight moves by more than this.
constexpr double kWeightsSettled = 1e-4;
constexpr int kMaxRounds = 50;
constexpr double kFarWeight = 0.5;

/// The windows as the search sees them.
struct Problem {
  std::vector<int> levels;
  std::vector<ParameterPlace> places;
  std::vector<VectorXd> wv;  ///< one a window
  MatrixXd x;                ///< a row a window: drivers minus their means, in their own standard deviations
  VectorXd x_scale;
  MatrixXd correlation_inverse;  ///< of the levels' errors under the start model
  VectorXd relative_sd;          ///< of the levels under the start model
  VectorXd weight;               ///< of each window, 0 to 1
};

/// What is searched for: for every place a level and, where it has them, slopes, one a driver. In this order
/// they make up a vector.
struct Unknowns {
  std::vector<bool> level;
  std::vector<std::vector<bool>> slope;
  [[nodiscard]] Index count() const {
    auto n = std::count(level.begin(), level.end(), true);
    for (const auto& of_place : slope) n += std::count(of_place.begin(), of_place.end(), true);
    return static_cast<Index>(n);
  }
};

struct Values {
  VectorXd level;  ///< interval scale of each place
  MatrixXd slope;  ///< a row a place, a column a driver
};

/// G-24: the model of a window.
Model model_at(const Model& start, const std::vector<ParameterPlace>& places, const Values& values,
               const Eigen::RowVectorXd& x) {
  Model model = start;
  for (std::size_t p = 0; p < places.size(); ++p) {
    const auto k = static_cast<Index>(p);
    const double u = values.level(k) + values.slope.row(k).dot(x);
    Component& c = model.components[places[p].component];
    if (places[p].shape < 0) {
      c.amplitude = std::exp(u);
    } else {
      const auto s = static_cast<std::size_t>(places[p].shape);
      c.shape[s] = shape_of_coordinate(c.kind, u);
    }
  }
  return model;
}

Values start_values(const Model& model, const std::vector<ParameterPlace>& places, Index drivers) {
  Values values{VectorXd::Zero(static_cast<Index>(places.size())),
                MatrixXd::Zero(static_cast<Index>(places.size()), drivers)};
  for (std::size_t p = 0; p < places.size(); ++p) {
    const Component& c = model.components[places[p].component];
    values.level(static_cast<Index>(p)) =
        places[p].shape < 0 ? std::log(c.amplitude)
                            : coordinate_of_shape(c.kind, c.shape[static_cast<std::size_t>(places[p].shape)]);
  }
  return values;
}

/// G-24: scores of all windows and the information, at one point.
struct Scores {
  VectorXd gradient;
  MatrixXd information;
  std::vector<VectorXd> of_window;
  std::vector<MatrixXd> information_of_window;
  VectorXd distance2;  ///< of each window from the fit, squared, in standard deviations of the start model
};

Scores scores_at(const Problem& problem, const Model& start, const Values& values, const Unknowns& unknowns) {
  const Index n = unknowns.count();
  Scores out{VectorXd::Zero(n), MatrixXd::Zero(n, n), {}, {}, VectorXd(problem.weight.size())};
  const auto rows = static_cast<Index>(problem.levels.size());
  MatrixXd design(rows, n);
  for (std::size_t w = 0; w < problem.wv.size(); ++w) {
    const Eigen::RowVectorXd x = problem.x.row(static_cast<Index>(w));
    const Model model = model_at(start, problem.places, values, x);
    const MatrixXd jacobian = wv_jacobian(model, problem.levels, problem.places);
    VectorXd expected(rows);
    for (Index r = 0; r < rows; ++r)
      expected(r) = model_wv(model, problem.levels[static_cast<std::size_t>(r)]);
    // Levels in units of their standard deviation: the shares of the start model, at this window's height.
    const VectorXd unit = expected.cwiseProduct(problem.relative_sd).cwiseInverse();
    Index column = 0;
    for (std::size_t p = 0; p < problem.places.size(); ++p) {
      const VectorXd of_place = unit.cwiseProduct(jacobian.col(static_cast<Index>(p)));
      if (unknowns.level[p]) design.col(column++) = of_place;
      for (std::size_t k = 0; k < unknowns.slope[p].size(); ++k) {
        if (unknowns.slope[p][k]) design.col(column++) = x(static_cast<Index>(k)) * of_place;
      }
    }
    const VectorXd residual = unit.cwiseProduct(problem.wv[w] - expected);
    const double distance2 = residual.dot(problem.correlation_inverse * residual);
    out.distance2(static_cast<Index>(w)) =
        std::isfinite(distance2) ? distance2 : std::numeric_limits<double>::infinity();
    const double weight = problem.weight(static_cast<Index>(w));
    const MatrixXd weighted = weight * design.transpose() * problem.correlation_inverse;
    // What is infinitely far has no weight, and its product with infinity would be no number.
    const VectorXd score = weight > 0.0 ? VectorXd(weighted * residual) : VectorXd::Zero(n);
    out.gradient += score;
    const MatrixXd information = weighted * design;
    out.information += information;
    out.of_window.push_back(score);
    out.information_of_window.push_back(information);
  }
  return out;
}

MatrixXd inverse_of(const MatrixXd& information) {
  const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  // Of two drivers that are one, neither is determined: a variance that is huge, and a number.
  constexpr double kRidge = 1e-10;
  MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  scaled.diagonal().array() += kRidge;
  return scale.asDiagonal() *
         MatrixXd(scaled.ldlt().solve(MatrixXd::Identity(scaled.rows(), scaled.cols()))) * scale.asDiagonal();
}

/// G-24: covariance of the unknowns from the scatter of the windows' scores, each freed of the part by which its
/// own window has drawn the fit to itself (Mancl and DeRouen 2001): it holds where windows vary more than the
/// model says, and with few of them.
MatrixXd scatter_covariance(const Scores& scores) {
  const Index n = scores.gradient.size();
  const MatrixXd inverse = inverse_of(scores.information);
  MatrixXd outer = MatrixXd::Zero(n, n);
  for (std::size_t w = 0; w < scores.of_window.size(); ++w) {
    const MatrixXd rest = MatrixXd::Identity(n, n) - scores.information_of_window[w] * inverse;
    const VectorXd score = rest.partialPivLu().solve(scores.of_window[w]);
    outer.noalias() += score * score.transpose();
  }
  return inverse * outer * inverse;
}

/// G-24: Huber's weights: the distances' scale is their median's, since windows vary more than the model says.
VectorXd weights_of(const VectorXd& distance2, std::size_t levels) {
  std::vector<double> sorted(distance2.begin(), distance2.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const boost::math::chi_squared chi2(static_cast<double>(levels));
  const double limit = *middle * boost::math::quantile(chi2, kFarQuantile) / boost::math::median(chi2);
  VectorXd weights(distance2.size());
  for (Index w = 0; w < weights.size(); ++w)
    weights(w) = distance2(w) <= limit ? 1.0 : std::sqrt(limit / distance2(w));
  return weights;
}

/// G-24: leaves out, one by one, what is known worst, as long as it is not determined.
void leave_out_undetermined(const Problem& problem, const Model& start, const Values& values,
                            Unknowns& unknowns) {
  while (unknowns.count() > 0) {
    const MatrixXd covariance = inverse_of(scores_at(problem, start, values, unknowns).information);
    double worst = kUndeterminedSd * kUndeterminedSd;
    std::size_t worst_place = problem.places.size();
    std::optional<std::size_t> worst_driver;  // absent: it is the level
    Index column = 0;
    const auto look = [&](std::size_t place, std::optional<std::size_t> driver) {
      const double variance = covariance(column, column);
      ++column;
      if (variance >= 0.0 && variance <= worst) return;
      worst = variance >= 0.0 ? variance : std::numeric_limits<double>::infinity();
      worst_place = place;
      worst_driver = driver;
    };
    for (std::size_t p = 0; p < problem.places.size(); ++p) {
      if (unknowns.level[p]) look(p, std::nullopt);
      for (std::size_t k = 0; k < unknowns.slope[p].size(); ++k) {
        if (unknowns.slope[p][k]) look(p, k);
      }
    }
    if (worst_place == problem.places.size()) return;
    if (worst_driver) {
      unknowns.slope[worst_place][*worst_driver] = false;
      continue;
    }
    unknowns.level[worst_place] = false;
    unknowns.slope[worst_place].assign(unknowns.slope[worst_place].size(), false);
  }
}

void add_to(const Unknowns& unknowns, const VectorXd& move, Values& values) {
  Index column = 0;
  for (std::size_t p = 0; p < unknowns.level.size(); ++p) {
    if (unknowns.level[p]) values.level(static_cast<Index>(p)) += move(column++);
    for (std::size_t k = 0; k < unknowns.slope[p].size(); ++k) {
      if (unknowns.slope[p][k]) values.slope(static_cast<Index>(p), static_cast<Index>(k)) += move(column++);
    }
  }
}

/// G-24: Fisher scoring; a step after which the scores are no smaller (in the metric of the information) is halved.
/// False where it does not settle.
bool search(const Problem& problem, const Model& start, const Unknowns& unknowns, Values& values,
            Scores& last) {
  last = scores_at(problem, start, values, unknowns);
  MatrixXd inverse = inverse_of(last.information);
  double size = last.gradient.dot(inverse * last.gradient);
  for (int step = 0; step < kMaxSteps; ++step) {
    VectorXd move = inverse * last.gradient;
    if (!move.allFinite()) return false;
    const double longest = move.cwiseAbs().maxCoeff();
    if (longest > kLongestStep) move *= kLongestStep / longest;
    for (int halving = 0;; ++halving) {
      constexpr int kMaxHalvings = 12;
      Values trial = values;
      add_to(unknowns, move, trial);
      Scores there = scores_at(problem, start, trial, unknowns);
      const MatrixXd inverse_there = inverse_of(there.information);
      const double size_there = there.gradient.dot(inverse_there * there.gradient);
      if (size_there < size || size < kSettled) {
        values = std::move(trial);
        last = std::move(there);
        inverse = inverse_there;
        size = size_there;
        break;
      }
      if (halving == kMaxHalvings) return size < kNearlySettled;
      move *= 0.5;
    }
    if (size < kSettled) return true;
  }
  return size < kNearlySettled;
}

/// Searches and weights in turn. False where a search does not settle.
bool search_and_weight(Problem& problem, const Model& start, const Unknowns& unknowns, Values& values,
                       Scores& last) {
  for (int round = 0; round < kMaxRounds; ++round) {
    if (!search(problem, start, unknowns, values, last)) return false;
    const VectorXd weight = weights_of(last.distance2, problem.levels.size());
    const double change = (weight - problem.weight).cwiseAbs().maxCoeff();
    if (change < kWeightsSettled) return true;
    problem.weight = weight;
  }
  return true;
}

/// The drivers of all windows about their means, in their standard deviations.
Result<void> set_drivers(std::span<const DrivenWindow> windows, Problem& problem) {
  const auto n = static_cast<Index>(windows.size());
  const auto drivers = static_cast<Index>(windows.front().drivers.size());
  problem.x.resize(n, drivers);
  problem.x_scale.resize(drivers);
  for (Index w = 0; w < n; ++w) {
    const auto& of_window = windows[static_cast<std::size_t>(w)].drivers;
    IMUSCOPE_EXPECTS(static_cast<Index>(of_window.size()) == drivers);
    for (Index k = 0; k < drivers; ++k) {
      problem.x(w, k) = of_window[static_cast<std::size_t>(k)];
      if (!std::isfinite(problem.x(w, k)))
        return work_error(fmt::format("the driver of window {} is no number", w + 1),
                          "leave windows without a driver out");
    }
  }
  for (Index k = 0; k < drivers; ++k) {
    const double mean = problem.x.col(k).mean();
    problem.x.col(k).array() -= mean;
    const double variance = problem.x.col(k).squaredNorm() / static_cast<double>(n);
    constexpr double kConstant = 1e-9;
    if (!(variance > kConstant * kConstant * (mean * mean + variance)))
      return work_error("the driver does not vary", "a dependence shows only where its driver changes");
    problem.x_scale(k) = std::sqrt(variance);
    problem.x.col(k) /= problem.x_scale(k);
  }
  return {};
}

Result<Problem> problem_of(std::span<const DrivenWindow> windows, const Model& model) {
  const std::size_t needed =
      kFewestWindows * (windows.empty() ? 1 : std::max<std::size_t>(1, windows.front().drivers.size()));
  if (windows.size() < needed) {
    return work_error(fmt::format("there are {} windows and {} are needed", windows.size(), needed),
                      "use shorter windows or a longer drive");
  }
  Problem problem;
  const WaveletVariance& first = windows.front().wv;
  for (const auto& level : first.levels) {
    if (has_enough_coefficients(level, first.efficiency)) problem.levels.push_back(level.level);
  }
  if (problem.levels.empty()) return work_error("the windows are too short", "use longer windows");
  const auto rows = static_cast<Index>(problem.levels.size());
  if (auto set = set_drivers(windows, problem); !set) return tl::unexpected<Error>(set.error());
  for (const DrivenWindow& window : windows) {
    VectorXd wv(rows);
    for (Index r = 0; r < rows; ++r) wv(r) = window.wv.levels.at(static_cast<std::size_t>(r)).value;
    problem.wv.push_back(std::move(wv));
  }
  problem.weight = VectorXd::Ones(problem.x.rows());
  problem.places = parameter_places(model);
  const MatrixXd v = wv_covariance(model, first, problem.levels.size());
  problem.relative_sd.resize(rows);
  for (Index r = 0; r < rows; ++r)
    problem.relative_sd(r) =
        std::sqrt(v(r, r)) / model_wv(model, problem.levels[static_cast<std::size_t>(r)]);
  const VectorXd scale = v.diagonal().cwiseSqrt().cwiseInverse();
  problem.correlation_inverse =
      (scale.asDiagonal() * v * scale.asDiagonal()).eval().ldlt().solve(MatrixXd::Identity(rows, rows));
  return problem;
}

/// The start model without what has no amplitude.
Model present_part(const Model& model) {
  Model present;
  for (const auto& c : model.components) {
    if (c.amplitude > 0.0) present.components.push_back(c);
  }
  return present;
}

/// Places' names as the fit prints them: the components of `start.model` in order, those of amplitude zero
/// left out.
std::vector<const ParameterEstimate*> names_of(const FitResult& start) {
  std::vector<const ParameterEstimate*> names;
  const auto places = parameter_places(start.model);
  for (std::size_t p = 0; p < places.size(); ++p) {
    if (start.model.components[places[p].component].amplitude > 0.0) names.push_back(&start.parameters[p]);
  }
  return names;
}

/// Value of a place as it is printed, from the value in the start fit and the change on its scale.
double printed(const ParameterEstimate& like, double start_scale, double now_scale) {
  const double change = now_scale - start_scale;
  const ParameterScale scale = parameter_scale_of(like.name);
  return from_scale(scale, to_scale(scale, like.value) + change);
}

}  // namespace

Result<Dependence> fit_dependence(std::span<const DrivenWindow> windows, const FitResult& start,
                                  const DependenceOptions& options) {
  const Model model = present_part(start.model);
  auto problem = problem_of(windows, model);
  if (!problem) return tl::unexpected<Error>(problem.error());
  const std::size_t places = problem->places.size();
  const auto drivers = static_cast<std::size_t>(problem->x.cols());
  Unknowns unknowns{std::vector<bool>(places, true),
                    std::vector<std::vector<bool>>(places, std::vector<bool>(drivers, true))};
  Values values = start_values(model, problem->places, problem->x.cols());
  const Values begin = values;
  problem->weight =
      weights_of(scores_at(*problem, model, values, unknowns).distance2, problem->levels.size());
  leave_out_undetermined(*problem, model, values, unknowns);
  Scores last;
  if (unknowns.count() > 0 && !search_and_weight(*problem, model, unknowns, values, last)) {
    return work_error("the dependence on the driver could not be fitted: the search does not settle",
                      "use a simpler model or longer windows");
  }

  Dependence out;
  out.n_windows = windows.size();
  out.n_far = static_cast<std::size_t>((problem->weight.array() < kFarWeight).count());
  for (std::size_t k = 0; k < drivers; ++k) {
    double sum = 0.0;
    for (const auto& w : windows) sum += w.drivers[k];
    out.mean_drivers.push_back(sum / static_cast<double>(windows.size()));
  }
  out.at_mean_driver = model_at(model, problem->places, values, Eigen::RowVectorXd::Zero(problem->x.cols()));
  const auto names = names_of(start);
  const Index n = unknowns.count();
  const auto free = static_cast<double>(windows.size()) - static_cast<double>(n);
  const MatrixXd covariance = n > 0 ? scatter_covariance(last) : MatrixXd();
  const boost::math::students_t t(std::max(free, 1.0));
  const double quantile = boost::math::quantile(t, 0.5 * (1.0 + options.confidence));
  Index column = 0;
  for (std::size_t p = 0; p < places; ++p) {
    const auto row = static_cast<Index>(p);
    if (unknowns.level[p]) ++column;
    for (std::size_t k = 0; k < drivers; ++k) {
      if (!unknowns.slope[p][k]) {
        out.undetermined.push_back({k, names[p]->process, names[p]->name,
                                    unknowns.level[p]
                                        ? "its change with the driver is not determined by this run"
                                        : "windows of this length do not determine it"});
        continue;
      }
      const auto of_driver = static_cast<Index>(k);
      ParameterSlope slope;
      slope.driver = k;
      slope.process = names[p]->process;
      slope.name = names[p]->name;
      slope.unit = names[p]->unit;
      slope.at_mean_driver = printed(*names[p], begin.level(row), values.level(row));
      slope.slope = values.slope(row, of_driver) / problem->x_scale(of_driver);
      slope.sd = std::sqrt(covariance(column, column)) / problem->x_scale(of_driver);
      ++column;
      slope.ci_low = slope.slope - quantile * slope.sd;
      slope.ci_high = slope.slope + quantile * slope.sd;
      slope.p_value = 2.0 * boost::math::cdf(boost::math::complement(t, std::abs(slope.slope) / slope.sd));
      out.slopes.push_back(slope);
    }
  }
  return out;
}

std::optional<WindowWhiteNoise> white_noise_of(const WaveletVariance& window, const Model& model,
                                               double confidence) {
  if (window.levels.empty()) return std::nullopt;
  const auto at = std::find_if(model.components.begin(), model.components.end(),
                               [](const Component& c) { return c.kind == ProcessKind::kWhiteNoise; });
  if (at == model.components.end()) return std::nullopt;
  // The first level alone holds more than half of what all tell of it, and no slow process.
  const WvLevel& level = window.levels.front();
  const double of_white = unit_wv(ProcessKind::kWhiteNoise, {}, level.level).value;
  const double rest = model_wv(model, level.level) - at->amplitude * of_white;
  const double value = (level.value - rest) / of_white;
  if (!(value > 0.0)) return std::nullopt;
  const MatrixXd v = wv_covariance(model, window, 1);
  const double log_sd =
      std::sqrt(v(0, 0)) / (model_wv(model, level.level)) * level.value / (level.value - rest);
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + confidence));
  return WindowWhiteNoise{value, value * std::exp(-z * log_sd), value * std::exp(z * log_sd)};
}

}  // namespace imuscope::noise
