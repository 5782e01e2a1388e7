#pragma once

/// Two fits side by side, with the test that they have the same parameters.

#include <optional>
#include <string>
#include <vector>

#include "models/noise/fit.h"

namespace imuscope::noise {

/// One parameter in both fits; the difference is tested on the scale of its interval (logarithms).
struct ComparedParameter {
  std::string process;
  std::string name;
  std::string unit;
  std::optional<double> first;  ///< absent where that fit does not have the parameter
  std::optional<double> second;
  std::optional<double> ratio;  ///< second / first
  /// Interval of the ratio at the first fit's confidence; absent where an sd is, and for theta and phi.
  std::optional<double> ratio_ci_low;
  std::optional<double> ratio_ci_high;
  /// Of no difference; absent where an sd is, and where one record is too short for the process of the other.
  std::optional<double> p_value;
};

/// Score test that both records come from one model, over all its parameters (homogeneity.h). Differences
/// below what the models miss of the levels do not count.
struct DifferenceTest {
  double statistic = 0.0;
  int dof = 0;
  double p_value = 0.0;
};

/// Parameters of both fits in one table, and the test over all of them.
struct Comparison {
  std::vector<ComparedParameter> parameters;
  /// Absent where no parameter is determined in both, and where units, rates or estimators differ.
  std::optional<DifferenceTest> test;
  std::vector<std::string> warnings;
};

/// A parameter on the scale of its interval and of FitResult::covariance.
double on_interval_scale(const ParameterEstimate& parameter);
/// As printed, what has the given place on that scale.
double from_interval_scale(const ParameterEstimate& parameter, double place);

/// The fits are of different stretches or sensors (independent). Parameters are matched by process and name.
Comparison compare(const FitResult& first, const FitResult& second);

}  // namespace imuscope::noise
