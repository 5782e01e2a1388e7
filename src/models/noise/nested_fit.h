#pragma once

/// Models of one wavelet variance that contain each other: each starts from what its sub-models found, so
/// that a model never explains the data worse than a part of itself does.

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "models/noise/fit.h"
#include "models/noise/fixed_point.h"

namespace imuscope::noise {

/// Below this level of the J-test a model is rejected outright, and an error of the model itself is allowed
/// for. Rare enough to leave a right model's intervals alone.
inline constexpr double kRejectedOutright = 0.001;

/// A fixed point with its test.
struct TestedPoint {
  FixedPoint point;
  std::optional<JTest> test;  ///< with the model's sampling covariance alone

  [[nodiscard]] bool rejected() const { return test && test->p_value < kRejectedOutright; }
};

/// Solves models of one wavelet variance, and remembers them.
class NestedFit {
 public:
  /// Of which sub-models a rejected model starts: all of a model of few terms, solved for that where need be,
  /// or those that were solved before. A search that grows its models knows what they grew from.
  enum class Starts : std::uint8_t { kSubModels, kKnownSubModels };

  /// The first `levels` of `wv`, which must outlive this.
  /// @param tables  to take covariances from; nothing: each is computed by itself
  NestedFit(const WaveletVariance& wv, std::size_t levels, CovarianceTables* tables,
            Starts starts = Starts::kSubModels)
      : wv_(wv),
        levels_(levels),
        table_(tables != nullptr ? tables->of(wv, levels) : nullptr),
        starts_(starts) {}

  [[nodiscard]] std::size_t levels() const { return levels_; }

  /// Best fixed point of the model, over all rates and from its sub-models. One that the J-test does not
  /// reject comes before one that it does; of those the likelier; of rejected ones that with less error.
  const TestedPoint& solve(const ModelSpec& spec);

  /// Tries one more start for a model that solve() knows or finds. True where its solution is better by it.
  bool improve(const ModelSpec& spec, const Model& start);

  /// From an earlier solution of the same model alone.
  /// @param model_error  of that solution
  TestedPoint refine(const ModelSpec& spec, const Model& start, double model_error) const;

 private:
  TestedPoint search(const ModelSpec& spec, bool with_sub_models);
  void improve_from(const TestedPoint& part, const ModelSpec& part_spec, WeightedProblem& problem,
                    TestedPoint& best) const;
  [[nodiscard]] TestedPoint tested(FixedPoint point) const;
  [[nodiscard]] WeightedProblem problem_of(const ModelSpec& spec) const;

  const WaveletVariance& wv_;
  std::size_t levels_;
  std::shared_ptr<const CovarianceTable> table_;
  Starts starts_;
  std::map<std::string, TestedPoint> known_;
};

/// `problem` without weights.
SeparableProblem unweighted_problem(const WaveletVariance& wv, const ModelSpec& spec, std::size_t levels);

/// Twice the negative log-likelihood of the wavelet variance under the model, in units of the observed
/// values; the levels are cubes of Gaussian numbers (G-16).
double deviance_of(const SeparableProblem& problem, const Model& model, const Eigen::MatrixXd& v);

/// J-test of a model whose sampling covariance is `v`; see j_test().
std::optional<JTest> j_test_of(const WaveletVariance& wv, const SeparableProblem& problem, const Model& model,
                               const Eigen::MatrixXd& v, bool by_these_weights);

/// fit() that shares its solutions with those of other models of `wv`. `models` was made for the same levels.
Result<FitResult> fit(const WaveletVariance& wv, const ModelSpec& spec, double rate_hz,
                      const FitOptions& options, NestedFit& models);

/// Levels of `wv` that the options ask for.
std::size_t fitted_levels(const WaveletVariance& wv, const FitOptions& options);

/// The terms of a model that are not zero, by parameter (parameter_places()).
std::vector<bool> present_parameters(const Model& model);

}  // namespace imuscope::noise
