#pragma once

/// How large each kind of imperfection is taken to be: as the sensor's class has it, and more where the drive
/// shows more (B-16). Three accelerometers on one chip or on three is decided by which of the two the drive
/// makes likelier (B-17).

#include <Eigen/Core>

#include "estimation/batch/sensor_model.h"

namespace imuscope::batch {

class PriorScales {
 public:
  explicit PriorScales(const SensorClass& sensor);

  /// Inverse variances in force; 0 for psi and t_d.
  [[nodiscard]] ParameterVector precision() const;

  using Covariance = Eigen::Matrix<double, kParameters, kParameters>;

  /// B-16.
  /// @param x           the estimate
  /// @param covariance  of it, with precision() in it
  void learn_sizes(const ParameterVector& x, const Covariance& covariance);

  /// B-17. Each belief moves the estimate, and with it the odds: where one chip does not hold under its own belief,
  /// twice, it is three, which reach to one.
  /// @param x          the estimate
  /// @param per_slope  inverse of the information that the drive really gives and precision(): without what the
  ///                   reference's noise only seems to tell
  void choose_places(const ParameterVector& x, const Covariance& per_slope);

  [[nodiscard]] bool one_chip() const { return one_chip_; }

  /// B-17a: by how much the covariance grows for the doubt in the choice: as much as the estimate would move,
  /// and its covariance grow, were the accelerometers in three places; by the probability that they are.
  /// Zero where three places were chosen: these reach to one.
  /// @param x, per_slope  as of choose_places(), in the choice made there
  [[nodiscard]] Covariance doubt(const ParameterVector& x, const Covariance& per_slope) const;

 private:
  SensorClass sensor_;
  ParameterVector class_sd_;
  ParameterVector sd_;
  bool one_chip_ = false;
  double log_odds_ = 0.0;  ///< of one chip against three, by the drive alone
  int falls_ = 0;          ///< how often one chip was believed and then not
};

}  // namespace imuscope::batch
