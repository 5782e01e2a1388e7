#include "models/noise/fixed_point.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "models/noise/inference.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Rounds of re-weighting by the model's own covariance; most settle in 2 to 4. From some round on they meet
/// halfway, since two weightings may each lead to the other, and later less than that.
constexpr int kMaxReweighting = 20;
constexpr int kUndampedRounds = 1;
constexpr int kHalfwayRounds = 8;
constexpr double kSettledShareOfSd = 0.02;
/// Of a level's value: nearer than what the error of a model is known to.
constexpr double kNearEnough = 0.02;
/// Rounds whose models bound what an iteration that does not settle roams over.
constexpr int kRoamingRounds = 6;
/// Added to the diagonal of the covariance, relative: an exact ramp has none of its own.
constexpr double kRidge = 1e-10;

/// The most that a level moved between two curves, in its sd.
double moved_in_sd(const Eigen::VectorXd& before, const Eigen::VectorXd& after, const Eigen::MatrixXd& v) {
  return (after - before).cwiseQuotient(v.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
}

double relative_move(const Eigen::VectorXd& before, const Eigen::VectorXd& after) {
  return (after - before).cwiseQuotient(before.cwiseAbs().cwiseMax(1e-300)).cwiseAbs().maxCoeff();
}

double step_of_round(int round) {
  if (round < kUndampedRounds) return 1.0;
  return round < kHalfwayRounds ? 0.5 : 0.2;
}

/// Half of what the levels moved over in the last rounds.
class Roaming {
 public:
  void add(const Eigen::VectorXd& curve) {
    low_ = low_.size() == 0 ? curve : Eigen::VectorXd(low_.cwiseMin(curve));
    high_ = high_.size() == 0 ? curve : Eigen::VectorXd(high_.cwiseMax(curve));
  }
  /// Adds its square to what belongs to `point`, which did not settle.
  void widen(FixedPoint& point) const {
    if (low_.size() > 0) point.v.diagonal() += (0.5 * (high_ - low_)).cwiseAbs2();
  }

 private:
  Eigen::VectorXd low_;
  Eigen::VectorXd high_;
};

/// G-15: the share^2 at which r' (V + share^2 diag(scale2))^-1 r = dof; 0 where the sampling errors alone explain
/// the residuals.
double share2_at(const Eigen::VectorXd& residual, const Eigen::MatrixXd& sampling,
                 const Eigen::VectorXd& scale2, double dof) {
  const Eigen::VectorXd unit = scale2.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * sampling *
                                                             unit.asDiagonal());
  const Eigen::ArrayXd square = (eigen.eigenvectors().transpose() * unit.cwiseProduct(residual)).cwiseAbs2();
  const Eigen::ArrayXd own = eigen.eigenvalues().cwiseMax(0.0);
  const auto excess = [&](double share2) { return (square / (own + share2)).sum() - dof; };
  double high = square.sum() / dof;
  if (!(high > 0.0) || !std::isfinite(high)) return 0.0;
  double low = high * 1e-30;
  if (excess(low) <= 0.0) return 0.0;
  constexpr int kBisections = 100;
  for (int i = 0; i < kBisections && high > low * (1.0 + 1e-12); ++i) {
    const double middle = std::sqrt(low * high);
    (excess(middle) > 0.0 ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

/// G-15: what delta^2 is multiplied by, level by level.
Eigen::VectorXd scale2_of(const Eigen::VectorXd& y, const Eigen::VectorXd& fitted) {
  const Eigen::VectorXd m = fitted.cwiseMax(kRidge * y);
  return 2.0 * y.cwiseProduct(m.cwiseAbs2()).cwiseQuotient(y + m);
}

double spare_levels(const WeightedProblem& problem, const Model& model) {
  return std::max(1.0, static_cast<double>(problem.levels()) - parameters_in_use(model));
}

/// What belongs to `point`'s model: its sampling covariance and its error, exactly there.
void complete_with_model_error(const WeightedProblem& problem, FixedPoint& point) {
  point.sampling = sampling_covariance(point.model, problem.wv, problem.levels(), problem.table);
  const Eigen::VectorXd residual = residual_of(problem.problem, point.model);
  const Eigen::VectorXd scale2 = scale2_of(problem.problem.y, problem.problem.y - residual);
  const double dof = spare_levels(problem, point.model);
  const double share2 = share2_at(residual, point.sampling, scale2, dof);
  point.model_error = std::sqrt(share2);
  point.v = point.sampling;
  point.v.diagonal() += share2 * scale2;
  point.objective = share2 > 0.0 ? dof : residual.dot(Eigen::VectorXd(point.v.llt().solve(residual)));
}

/// G-15: rounds of weights and fit in which the covariance of `point`, exact at its model when they begin, follows
/// the curve by its scale alone: every level's sd goes with its value. `point.v` becomes that of the last
/// round. False where the weights have no inverse.
bool follow_with_scaled_covariance(WeightedProblem& problem, FixedPoint& point, double& share2, bool search) {
  constexpr int kRounds = 12;
  constexpr int kSearchRounds = 2;
  SeparableProblem& p = problem.problem;
  Eigen::VectorXd fitted = wv_curve(point.model, p.levels);
  const Eigen::VectorXd exact_at = fitted.cwiseMax(kRidge * p.y);
  Eigen::VectorXd anchor = exact_at;
  for (int round = 0; round < kRounds; ++round) {
    // Halfway to the new curve on the logarithm: whole steps overshoot by as much as they correct.
    anchor = anchor.cwiseProduct(fitted.cwiseMax(kRidge * p.y)).cwiseSqrt();
    const Eigen::VectorXd scale = anchor.cwiseQuotient(exact_at);
    const Eigen::VectorXd scale2 = scale2_of(p.y, anchor);
    point.v = scale.asDiagonal() * point.sampling * scale.asDiagonal();
    const double wanted = share2_at(p.y - fitted, point.v, scale2, spare_levels(problem, point.model));
    share2 = share2 > 0.0 ? std::sqrt(share2 * std::max(wanted, 1e-4 * share2)) : wanted;
    point.v.diagonal() += share2 * scale2;
    const Eigen::MatrixXd whitener = whitener_of(point.v);
    if (whitener.size() == 0) return false;
    p.whitener = whitener;
    const bool searches = search && round < kSearchRounds;
    point.model = searches ? find_global_minimum(p).model : polish(p, point.model).model;
    const Eigen::VectorXd now = wv_curve(point.model, p.levels);
    const double moved = relative_move(fitted, now);
    fitted = now;
    if (!searches && moved < kNearEnough && std::abs(wanted - share2) <= kNearEnough * share2) break;
  }
  return true;
}

}  // namespace

Eigen::MatrixXd whitener_of(const Eigen::MatrixXd& v) {
  const Eigen::LLT<Eigen::MatrixXd> llt(v);
  if (llt.info() != Eigen::Success) return {};
  return llt.matrixL().solve(Eigen::MatrixXd::Identity(v.rows(), v.cols()));
}

int parameters_in_use(const Model& model) {
  int count = 0;
  for (const Component& c : model.components) count += c.amplitude > 0.0 ? 1 + shape_count(c.kind) : 0;
  return count;
}

Eigen::VectorXd residual_of(const SeparableProblem& problem, const Model& model) {
  return problem.y - wv_curve(model, problem.levels);
}

Eigen::MatrixXd sampling_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels,
                                    const CovarianceTable* table) {
  Eigen::MatrixXd v = table != nullptr ? table->of(model, wv) : wv_covariance(model, wv, levels);
  std::vector<int> of_levels;
  for (std::size_t i = 0; i < levels; ++i) of_levels.push_back(wv.levels[i].level);
  v.diagonal() += kRidge * (v.diagonal() + kRidge * wv_curve(model, of_levels).cwiseAbs2());
  return v;
}

// G-12: weights by the model's own covariance, iterated
FixedPoint settle(WeightedProblem& problem, const Model& start, bool search) {
  FixedPoint point;
  point.model = start;
  point.sampling = sampling_covariance(start, problem.wv, problem.levels(), problem.table);
  point.settled = false;
  Eigen::MatrixXd weights = point.sampling;
  Eigen::VectorXd curve = wv_curve(start, problem.problem.levels);
  Roaming roaming;
  for (int round = 0; round < kMaxReweighting; ++round) {
    const Eigen::MatrixXd whitener = whitener_of(weights);
    if (whitener.size() == 0) break;
    problem.problem.whitener = whitener;
    const SeparableSolution next =
        search && round == 0 ? find_global_minimum(problem.problem) : polish(problem.problem, point.model);
    const Eigen::VectorXd now = wv_curve(next.model, problem.problem.levels);
    const double moved = moved_in_sd(curve, now, weights);
    point.model = next.model;
    point.objective = next.objective;
    curve = now;
    if (round >= kMaxReweighting - kRoamingRounds) roaming.add(curve);
    point.settled = moved <= kSettledShareOfSd;
    // Where the weights are the last model's own and it has not moved, they are this one's.
    if (point.settled && round <= kUndampedRounds) break;
    point.sampling = sampling_covariance(point.model, problem.wv, problem.levels(), problem.table);
    if (point.settled) break;
    weights += step_of_round(round) * (point.sampling - weights);
  }
  point.v = point.sampling;
  if (!point.settled) roaming.widen(point);
  return point;
}

FixedPoint settle_with_model_error(WeightedProblem& problem, const std::optional<Model>& start,
                                   double share) {
  constexpr int kCovariances = 6;
  SeparableProblem& p = problem.problem;
  FixedPoint point;
  if (start) {
    point.model = *start;
  } else {
    // From a solution that knows nothing of the sampling errors that misled the first one.
    p.whitener = p.y.cwiseInverse().asDiagonal();
    point.model = find_global_minimum(p).model;
  }
  point.settled = false;
  double share2 = share * share;
  Roaming roaming;
  for (int i = 0; i < kCovariances && !point.settled; ++i) {
    point.sampling = sampling_covariance(point.model, problem.wv, problem.levels(), problem.table);
    const Eigen::VectorXd before = wv_curve(point.model, p.levels);
    if (!follow_with_scaled_covariance(problem, point, share2, !start && i == 0)) break;
    const Eigen::VectorXd now = wv_curve(point.model, p.levels);
    roaming.add(now);
    point.settled =
        relative_move(before, now) < kNearEnough || moved_in_sd(before, now, point.v) < kSettledShareOfSd;
  }
  complete_with_model_error(problem, point);
  if (!point.settled) roaming.widen(point);
  return point;
}

}  // namespace imuscope::noise
