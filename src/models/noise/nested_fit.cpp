#include "models/noise/nested_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "models/noise/inference.h"

namespace imuscope::noise {
namespace {

/// Share of an objective below which a start is worth settling.
constexpr double kWorthwhile = 0.97;

/// Beyond so many sub-models those of sub-models are not solved only to be started from.
constexpr int kMostSubModels = 32;

int count_sub_models(const ModelSpec& spec) {
  int count = 1;
  for (int kind = 0; kind <= static_cast<int>(ProcessKind::kRamp); ++kind)
    count *= 1 + spec.count(static_cast<ProcessKind>(kind));
  return count;
}

/// Whitener from the equivalent degrees of freedom that most processes roughly have, 2 M_j / 2^j.
Eigen::MatrixXd rough_whitener(const WaveletVariance& wv, std::size_t levels) {
  Eigen::VectorXd d(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    const WvLevel& level = wv.levels[i];
    const double dof = 2.0 * std::max(static_cast<double>(level.n_coefficients) / level.tau_samples, 0.5);
    d[static_cast<Eigen::Index>(i)] = std::sqrt(0.5 * dof) / level.value;
  }
  return d.asDiagonal();
}

/// `whole` without one term of each of its kinds in turn.
std::vector<std::pair<ModelSpec, ProcessKind>> without_one_term(const ModelSpec& whole) {
  std::vector<std::pair<ModelSpec, ProcessKind>> parts;
  for (std::size_t i = 0; i < whole.processes.size(); ++i) {
    if (i > 0 && whole.processes[i] == whole.processes[i - 1]) continue;
    ModelSpec part = whole;
    part.processes.erase(part.processes.begin() + static_cast<std::ptrdiff_t>(i));
    if (!part.processes.empty()) parts.emplace_back(std::move(part), whole.processes[i]);
  }
  return parts;
}

/// Models whose limit `whole` holds: one of its GM slow enough to be a walk, or fast enough to be white.
std::vector<ModelSpec> limits_of(const ModelSpec& whole) {
  std::vector<ModelSpec> limits;
  const auto gm = std::find(whole.processes.begin(), whole.processes.end(), ProcessKind::kGaussMarkov);
  if (gm == whole.processes.end()) return limits;
  for (const ProcessKind kind : {ProcessKind::kRandomWalk, ProcessKind::kWhiteNoise}) {
    if (whole.count(kind) > 0) continue;
    ModelSpec limit = whole;
    limit.processes[static_cast<std::size_t>(gm - whole.processes.begin())] = kind;
    std::sort(limit.processes.begin(), limit.processes.end());
    limits.push_back(std::move(limit));
  }
  return limits;
}

/// A model of limits_of(), with a GM in place of its walk or its white noise.
Model with_gauss_markov(const Model& limit, ProcessKind replaced, int highest_level) {
  const CoordinateRange range = coordinate_range(ProcessKind::kGaussMarkov, 0, highest_level);
  Model model = limit;
  for (Component& c : model.components) {
    if (c.kind != replaced) continue;
    const bool slow = replaced == ProcessKind::kRandomWalk;
    const double rate = std::exp(slow ? range.low : range.high);
    c = {ProcessKind::kGaussMarkov, slow ? 0.5 * c.amplitude / rate : c.amplitude, {rate, 0.0}};
  }
  std::stable_sort(model.components.begin(), model.components.end(),
                   [](const Component& a, const Component& b) {
                     return a.kind != b.kind ? a.kind < b.kind : a.shape[0] > b.shape[0];
                   });
  return model;
}

ProcessKind missing_kind(const ModelSpec& whole, const ModelSpec& part) {
  for (const ProcessKind kind : whole.processes) {
    if (part.count(kind) < whole.count(kind)) return kind;
  }
  return whole.processes.front();
}

/// Whether a is the better of two fixed points of one model.
bool is_better(const TestedPoint& a, const TestedPoint& b, const SeparableProblem& problem) {
  if (a.rejected() != b.rejected()) return b.rejected();
  if (a.rejected()) return a.point.model_error < b.point.model_error;
  return deviance_of(problem, a.point.model, a.point.v) < deviance_of(problem, b.point.model, b.point.v);
}

}  // namespace

SeparableProblem unweighted_problem(const WaveletVariance& wv, const ModelSpec& spec, std::size_t levels) {
  SeparableProblem problem;
  problem.spec = spec;
  problem.y.resize(static_cast<Eigen::Index>(levels));
  for (std::size_t i = 0; i < levels; ++i) {
    problem.levels.push_back(wv.levels[i].level);
    problem.y[static_cast<Eigen::Index>(i)] = wv.levels[i].value;
  }
  return problem;
}

double deviance_of(const SeparableProblem& problem, const Model& model, const Eigen::MatrixXd& v) {
  const Eigen::VectorXd scale = problem.y.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> llt(scale.asDiagonal() * v * scale.asDiagonal());
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd factor = llt.matrixL();
  // G-16
  const Eigen::VectorXd expected = problem.y - residual_of(problem, model);
  Eigen::VectorXd residual(problem.y.size());
  double jacobian = 0.0;
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    if (!(expected[i] > 0.0)) return std::numeric_limits<double>::infinity();
    residual[i] = scale[i] * near_gaussian_residual(problem.y[i], expected[i], v(i, i));
    jacobian -= 4.0 / 3.0 * std::log(scale[i] * expected[i]);
  }
  return llt.matrixL().solve(residual).squaredNorm() + 2.0 * factor.diagonal().array().log().sum() + jacobian;
}

std::vector<bool> present_parameters(const Model& model) {
  std::vector<bool> present;
  for (const ParameterPlace& place : parameter_places(model)) {
    present.push_back(model.components[place.component].amplitude > 0.0);
  }
  return present;
}

std::optional<JTest> j_test_of(const WaveletVariance& wv, const SeparableProblem& problem, const Model& model,
                               const Eigen::MatrixXd& v, bool by_these_weights) {
  return j_test(wv, residual_of(problem, model), wv_jacobian(model, problem.levels, parameter_places(model)),
                v, present_parameters(model), by_these_weights);
}

WeightedProblem NestedFit::problem_of(const ModelSpec& spec) const {
  WeightedProblem problem{wv_, unweighted_problem(wv_, spec, levels_), table_.get()};
  problem.problem.whitener = rough_whitener(wv_, levels_);
  return problem;
}

TestedPoint NestedFit::tested(FixedPoint point) const {
  TestedPoint out{std::move(point), {}};
  const SeparableProblem problem = unweighted_problem(wv_, {}, levels_);
  out.test = j_test_of(wv_, problem, out.point.model, out.point.sampling, true);
  return out;
}

const TestedPoint& NestedFit::solve(const ModelSpec& spec) {
  const std::string name = spec.name();
  if (const auto at = known_.find(name); at != known_.end()) return at->second;
  TestedPoint found = search(spec, true);
  return known_.emplace(name, std::move(found)).first->second;
}

TestedPoint NestedFit::refine(const ModelSpec& spec, const Model& start, double model_error) const {
  WeightedProblem problem = problem_of(spec);
  if (model_error > 0.0) {
    TestedPoint with_error = tested(settle_with_model_error(problem, start, model_error));
    if (with_error.rejected()) return with_error;
  }
  TestedPoint found = tested(settle(problem, start, false));
  if (!found.rejected() || model_error > 0.0) return found;
  return tested(settle_with_model_error(problem, start, 0.0));
}

bool NestedFit::improve(const ModelSpec& spec, const Model& start) {
  solve(spec);
  TestedPoint& best = known_.at(spec.name());
  WeightedProblem problem = problem_of(spec);
  problem.problem.whitener = whitener_of(best.point.v);
  if (problem.problem.whitener.size() == 0) return false;
  const double to_beat =
      (problem.problem.whitener * residual_of(problem.problem, best.point.model)).squaredNorm();
  const SeparableSolution from_start = polish(problem.problem, start);
  if (from_start.objective >= kWorthwhile * to_beat) return false;
  TestedPoint found = refine(spec, from_start.model, best.point.model_error);
  if (!is_better(found, best, problem.problem)) return false;
  best = std::move(found);
  return true;
}

TestedPoint NestedFit::search(const ModelSpec& spec, bool with_sub_models) {
  WeightedProblem problem = problem_of(spec);
  TestedPoint best = tested(settle(problem, find_global_minimum(problem.problem).model, true));
  if (!best.rejected()) return best;
  TestedPoint with_error = tested(settle_with_model_error(problem, std::nullopt, 0.0));
  // Where the data hold the model after all, it is found from there.
  TestedPoint again = tested(settle(problem, with_error.point.model, false));
  best = again.rejected() ? std::move(with_error) : std::move(again);
  if (!with_sub_models) return best;
  const bool with_unknown = starts_ == Starts::kSubModels;
  const bool deep = with_unknown && count_sub_models(spec) <= kMostSubModels;
  for (const auto& [part, kind] : without_one_term(spec)) {
    const auto at = known_.find(part.name());
    if (at != known_.end() || deep) {
      improve_from(solve(part), part, problem, best);
    } else if (with_unknown) {
      improve_from(search(part, false), part, problem, best);
    }
  }
  for (const ModelSpec& limit : limits_of(spec)) {
    const auto at = known_.find(limit.name());
    if (at == known_.end() && !deep) continue;
    const TestedPoint& part = solve(limit);
    if (!is_better(part, best, problem.problem)) continue;
    const Model start =
        with_gauss_markov(part.point.model, missing_kind(limit, spec), problem.problem.levels.back());
    TestedPoint found = part.rejected()
                            ? tested(settle_with_model_error(problem, start, part.point.model_error))
                            : tested(settle(problem, start, false));
    if (is_better(found, best, problem.problem)) best = std::move(found);
  }
  return best;
}

/// Tries what grows out of a sub-model's solution, and that solution itself, the missing term at zero.
void NestedFit::improve_from(const TestedPoint& part, const ModelSpec& part_spec, WeightedProblem& problem,
                             TestedPoint& best) const {
  const ProcessKind kind = missing_kind(problem.problem.spec, part_spec);
  const bool part_is_better = is_better(part, best, problem.problem);
  const Eigen::MatrixXd whitener = whitener_of(part_is_better ? part.point.v : best.point.v);
  if (whitener.size() == 0) return;
  problem.problem.whitener = whitener;
  const double to_beat = part_is_better
                             ? std::numeric_limits<double>::infinity()
                             : (whitener * residual_of(problem.problem, best.point.model)).squaredNorm();
  SeparableSolution grown;
  grown.objective = std::numeric_limits<double>::infinity();
  std::vector<Model> starts = with_one_more(problem.problem, part.point.model, kind);
  const Model embedded = starts.front();
  for (const Model& start : starts) {
    SeparableSolution candidate = polish(problem.problem, start);
    if (candidate.objective < grown.objective) grown = std::move(candidate);
  }
  if (grown.objective < kWorthwhile * to_beat) {
    TestedPoint found = part.rejected()
                            ? tested(settle_with_model_error(problem, grown.model, part.point.model_error))
                            : tested(settle(problem, grown.model, false));
    if (is_better(found, best, problem.problem)) best = std::move(found);
  }
  if (!is_better(part, best, problem.problem)) return;
  best = part;
  best.point.model = embedded;
}

}  // namespace imuscope::noise
