#include "models/noise/homogeneity.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "models/noise/chi_squared.h"
#include "models/noise/fixed_point.h"
#include "models/noise/inference.h"

namespace imuscope::noise {
namespace {

constexpr int kDraws = 999;
constexpr double kSingular = 1e-9;

/// G-17: one record under the common model: s, I.
class Unit {
 public:
  Unit(const WaveletVariance& wv, const Model& common, const std::vector<Eigen::Index>& in_use,
       double model_error)
      : v_(sampling_covariance(common, wv, wv.levels.size())) {
    std::vector<int> levels;
    expected_.resize(v_.rows());
    Eigen::VectorXd observed(v_.rows());
    for (std::size_t i = 0; i < wv.levels.size(); ++i) {
      levels.push_back(wv.levels[i].level);
      expected_[static_cast<Eigen::Index>(i)] = model_wv(common, wv.levels[i].level);
      observed[static_cast<Eigen::Index>(i)] = wv.levels[i].value;
    }
    v_.diagonal() += model_error * model_error * expected_.cwiseAbs2();
    const Eigen::MatrixXd whitener = whitener_of(v_);
    const Eigen::MatrixXd all = wv_jacobian(common, levels, parameter_places(common));
    const Eigen::MatrixXd slope = whitener * all(Eigen::all, in_use);
    to_score_ = slope.transpose() * whitener;
    information_ = slope.transpose() * slope;
    invert();
    score_ = to_score_ * (observed - expected_);
    const Eigen::VectorXd sd = v_.diagonal().cwiseSqrt();
    correlation_root_ =
        Eigen::MatrixXd(sd.cwiseInverse().asDiagonal() * v_ * sd.cwiseInverse().asDiagonal()).llt().matrixL();
    // Cube roots of chi-square numbers are nearly Gaussian (Wilson and Hilferty 1931).
    root_variance_ = v_.diagonal().cwiseQuotient(9.0 * expected_.cwiseAbs2());
  }

  [[nodiscard]] const Eigen::VectorXd& score() const { return score_; }
  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }
  [[nodiscard]] const Eigen::MatrixXd& inverse() const { return inverse_; }

  /// Score of a record drawn under the common model.
  [[nodiscard]] Eigen::VectorXd drawn_score(std::mt19937_64& random) const {
    std::normal_distribution<double> normal;
    Eigen::VectorXd z(expected_.size());
    for (double& value : z) value = normal(random);
    z = correlation_root_ * z;
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      const double root = std::max(0.0, 1.0 - root_variance_[i] + z[i] * std::sqrt(root_variance_[i]));
      z[i] = expected_[i] * (root * root * root - 1.0);
    }
    return to_score_ * z;
  }

 private:
  void invert() {
    const Eigen::VectorXd scale = information_.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information_ *
                                                               scale.asDiagonal());
    Eigen::VectorXd values = eigen.eigenvalues();
    for (double& value : values) value = value > kSingular ? 1.0 / value : 0.0;
    inverse_ = scale.asDiagonal() * eigen.eigenvectors() * values.asDiagonal() *
               eigen.eigenvectors().transpose() * scale.asDiagonal();
  }

  Eigen::MatrixXd v_;
  Eigen::VectorXd expected_;
  Eigen::MatrixXd to_score_;
  Eigen::MatrixXd information_;
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd score_;
  Eigen::MatrixXd correlation_root_;
  Eigen::VectorXd root_variance_;
};

/// G-17. Sum over the units of what their scores have beyond the common step that all of them agree on.
double statistic_of(const std::vector<Unit>& units, const std::vector<Eigen::VectorXd>& scores,
                    const Eigen::LDLT<Eigen::MatrixXd>& total) {
  Eigen::VectorXd sum = scores.front();
  for (std::size_t k = 1; k < scores.size(); ++k) sum += scores[k];
  const Eigen::VectorXd step = total.solve(sum);
  double statistic = 0.0;
  for (std::size_t k = 0; k < units.size(); ++k) {
    const Eigen::VectorXd left = scores[k] - units[k].information() * step;
    statistic += left.dot(units[k].inverse() * left);
  }
  return statistic;
}

}  // namespace

Homogeneity test_homogeneity(std::span<const WaveletVariance> records, const Model& common,
                             std::span<const double> model_errors) {
  Homogeneity out;
  const auto places = parameter_places(common);
  std::vector<Eigen::Index> in_use;
  for (std::size_t p = 0; p < places.size(); ++p) {
    if (common.components[places[p].component].amplitude > 0.0)
      in_use.push_back(static_cast<Eigen::Index>(p));
  }
  if (in_use.empty() || records.size() < 2) return out;
  std::vector<Unit> units;
  std::vector<Eigen::VectorXd> scores;
  const auto size = static_cast<Eigen::Index>(in_use.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t k = 0; k < records.size(); ++k) {
    const Unit& unit =
        units.emplace_back(records[k], common, in_use, model_errors.empty() ? 0.0 : model_errors[k]);
    scores.push_back(unit.score());
    information += unit.information();
  }
  const Eigen::LDLT<Eigen::MatrixXd> total(information);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto all = static_cast<Eigen::Index>(places.size());
  for (const Unit& unit : units) {
    UnitEstimate estimate{Eigen::VectorXd::Constant(all, kNan), Eigen::MatrixXd::Constant(all, all, kNan)};
    // G-17: the record's own step
    estimate.step(in_use) = unit.inverse() * unit.score();
    estimate.covariance(in_use, in_use) = unit.inverse();
    out.units.push_back(std::move(estimate));
  }
  JTest test;
  test.dof = static_cast<int>((records.size() - 1) * in_use.size());
  test.statistic = statistic_of(units, scores, total);
  std::mt19937_64 random(1);
  int larger = 0;
  for (int i = 0; i < kDraws; ++i) {
    for (std::size_t k = 0; k < units.size(); ++k) scores[k] = units[k].drawn_score(random);
    larger += statistic_of(units, scores, total) >= test.statistic ? 1 : 0;
  }
  test.p_value = static_cast<double>(larger + 1) / (kDraws + 1);
  // Beyond what draws can tell the chi-square's tail is the better guess.
  if (larger == 0) test.p_value = std::min(test.p_value, chi_squared_p_value(test.statistic, test.dof));
  out.test = test;
  return out;
}

}  // namespace imuscope::noise
